"""Lobes of glossy receivers in files and reports: renders, comparisons, sequences, batches."""

import dataclasses
import json

import numpy as np
import pytest
from click.testing import CliRunner

from refgi.cli.group import VerbGroup
from refgi.compare import compare
from refgi.compare.pages import number
from refgi.compare.pictures import linear_planes
from refgi.compare.report import as_json, page, write_results
from refgi.frame import Frame
from refgi.image import read_exr
from refgi.methods import render
from refgi.provenance import scene_record
from refgi.scene import load_scene
from refgi.settings import of
from refgi.splat.sii import SiiSettings
from refgi.truth import TruthSettings
from tests.glossy import glossy_box

pytestmark = pytest.mark.filterwarnings("ignore::refgi.errors.RefgiWarning")

TINY = {"width": 16, "height": 12, "rsm_resolution": 24}
RING = ["ring:faces=320", "--size", "16x12", "--rsm-resolution", "24", "--method", "sii", "--set", "lights=24"]


def run(*arguments):
    return CliRunner().invoke(VerbGroup.refgi(), [str(argument) for argument in arguments])


def lobes_of(planes, name="lobes"):
    return np.stack([planes[f"{name}.{channel}"] for channel in "RGB"])


@pytest.fixture(scope="module")
def comparison():
    truth = TruthSettings(samples=96)
    return compare(glossy_box(), ["sii", "vpl"], truth_settings=truth,
                   method_settings={"sii": of(SiiSettings, lights=24)}, **TINY)


@pytest.mark.feature("REF-27")
def test_a_render_writes_lobes_and_makes_them_again(tmp_path):
    file = tmp_path / "ring.exr"
    assert run("render", *RING, "--out", str(file)).exit_code == 0
    planes, record = read_exr(file)
    picture = render("ring:faces=320", "sii", of(SiiSettings, lights=24), **TINY)
    assert np.array_equal(lobes_of(planes), picture.lobes)
    assert np.array_equal(np.stack([planes[c] for c in "RGB"]), picture.radiance)
    assert (record["units"]["lobes"], record["units"]["irradiance"]) == ("W/m^2/sr", "W/m^2")
    assert "lobes by direct light" in record["content"]
    assert not any(name.startswith("lobe_variance") for name in planes)
    again = run("render", "--again", str(file), "--out", str(tmp_path / "again.exr"))
    assert again.exit_code == 0
    assert np.array_equal(lobes_of(read_exr(tmp_path / "again.exr")[0]), picture.lobes)


def test_a_render_says_how_bright_lobes_are(tmp_path):
    said = json.loads(run("render", *RING, "--out", str(tmp_path / "a.exr"), "--json").stdout)
    picture = render("ring:faces=320", "sii", of(SiiSettings, lights=24), **TINY)
    covered = picture.frame.gbuffer.covered
    assert said["mean_lobes"] == pytest.approx(float(picture.lobes[:, covered].mean(dtype=float)))
    plain = run("render", "cornell_box", *RING[1:], "--out", str(tmp_path / "b.exr"), "--json")
    assert "mean_lobes" not in json.loads(plain.stdout)
    planes, record = read_exr(tmp_path / "b.exr")
    assert not any("lobe" in name for name in planes)
    assert "lobe" not in json.dumps([record["units"], record["content"]])


@pytest.mark.feature("REF-26", "REF-27")
def test_the_truth_writes_the_variance_of_its_lobes(tmp_path):
    file = tmp_path / "truth.exr"
    assert run("render", *RING[:5], "--method", "truth", "--set", "samples=48", "--out", str(file)).exit_code == 0
    planes, _ = read_exr(file)
    picture = render("ring:faces=320", "truth", TruthSettings(samples=48), **TINY)
    assert picture.lobe_estimate is not None
    assert np.array_equal(lobes_of(planes), picture.lobes)
    variance = picture.lobe_estimate.variance_of_mean.astype(np.float32)
    assert np.array_equal(lobes_of(planes, "lobe_variance"), variance)


@pytest.mark.feature("REF-27")
def test_a_comparison_judges_lobes(comparison, tmp_path):
    """Plain figures by hand, over all pixels that see a surface; the files and the page hold them."""
    covered, truth = comparison.covered, comparison.truth.lobes
    written = json.loads(json.dumps(as_json(comparison)))["methods"]
    for name, result in comparison.results.items():
        off = result.lobes[:, covered].astype(float) - truth.mean[:, covered]
        figures = result.lobes_against["truth"].figures
        assert figures["rmse"].value == pytest.approx(np.sqrt((off**2).mean()))
        r = truth.mean[:, covered]
        assert figures["relmse"].value == pytest.approx((off**2 / (r**2 + (0.1 * r.mean()) ** 2)).mean())
        assert figures["rmse"].noise == pytest.approx(np.sqrt(truth.variance_of_mean[:, covered].mean()))
        share = truth.block_pixels.sum() / covered.sum()
        assert figures["bias"].noise == pytest.approx(np.sqrt(truth.picture_variance).mean() * share)
        assert written[name]["lobes_against"]["truth"]["figures"]["rmse"]["value"] == figures["rmse"].value
        expected = comparison.truth.radiance - render_like(comparison, truth.mean)
        assert np.abs(expected).max() < 1e-5
    assert set(comparison.results["sii"].lobes_against) == {"truth", "unoccluded"}
    assert set(comparison.results["vpl"].lobes_against) == {"truth"}
    write_results(comparison, tmp_path)
    assert np.array_equal(lobes_of(read_exr(tmp_path / "sii.exr")[0]), comparison.results["sii"].lobes)
    planes = read_exr(tmp_path / "truth.exr")[0]
    assert np.array_equal(lobes_of(planes), truth.mean.astype(np.float32))
    assert np.array_equal(lobes_of(planes, "lobe_variance"), truth.variance_of_mean.astype(np.float32))
    assert comparison.truth.estimate["estimate"]["lobes"]["statement"] == truth.error_statement


def render_like(comparison, lobes):
    """Return the picture of the truth's irradiance and some lobes."""
    frame = Frame(comparison.scene, **TINY, shadows="exact")
    buffer = frame.gbuffer
    diffuse = buffer.albedo / np.pi * (frame.direct + comparison.truth.irradiance)
    return diffuse + frame.direct_lobes + lobes


def test_the_page_says_how_far_lobes_are_off(comparison):
    html = page(comparison)
    for result in comparison.results.values():
        rmse = number(result.lobes_against["truth"].figures["rmse"].value)
        assert f"{result.name}: lobes of glossy receivers are off from those of the truth by a RMSE of {rmse}" in html


@pytest.mark.feature("REF-27")
def test_frames_of_a_sequence_are_written_and_resumed_with_lobes(tmp_path):
    path = tmp_path / "path.toml"
    path.write_text('frames = 2\n[[camera]]\nat = 0.0\neye = [0.0, 0.36, 0.36]\ntarget = [0.0, 0.0, 0.0]\n'
                    '[[camera]]\nat = 1.0\neye = [0.05, 0.36, 0.36]\ntarget = [0.0, 0.0, 0.0]\n')
    out = tmp_path / "frames"
    common = ["ring:faces=320", str(path), "--size", "16x12", "--rsm-resolution", "24", "--set", "levels=2", "--set",
              "pattern=all", "--format", "exr", "--out", str(out)]
    done = run("sequence", *common)
    assert done.exit_code == 0, done.output
    files = sorted(out.glob("*.exr"))
    first = [read_exr(file)[0] for file in files]
    assert all(lobes_of(planes).any() for planes in first)
    assert not np.array_equal(lobes_of(first[0]), lobes_of(first[1]))
    files[1].unlink()
    assert run("sequence", *common, "--resume").exit_code == 0
    again = read_exr(files[1])[0]
    assert all(np.array_equal(again[name], plane) for name, plane in first[1].items())


@pytest.mark.feature("REF-27")
def test_a_batch_writes_lobes(tmp_path):
    plan = tmp_path / "plan.toml"
    plan.write_text('[batch]\nscenes = ["ring:faces=320"]\nsize = [16, 12]\nrounds = 2\ntruth = {samples = 48}\n'
                    '[sii]\nlights = [24]\n')
    done = run("batch", str(plan), "--out", str(tmp_path / "out"))
    assert done.exit_code == 0, done.output
    files = {file.name.partition("_")[0]: read_exr(file)[0] for file in (tmp_path / "out").rglob("*.exr")}
    own = next(planes for name, planes in files.items() if name.startswith("sii"))
    truth = files["truth.exr"]
    frame = Frame(load_scene("ring:faces=320"), width=16, height=12, shadows="exact")
    for planes in (own, truth):
        assert lobes_of(planes).any()
        light = frame.radiance(lobes_of(planes, "irradiance"), lobes_of(planes))
        np.testing.assert_allclose(np.stack([planes[c] for c in "RGB"]), light, rtol=1e-5, atol=1e-7)
    assert "lobe_variance.R" in truth


def test_planes_are_named_by_what_they_hold():
    ones = np.ones((3, 2, 2))
    planes = linear_planes(ones, 2 * ones, lobes=3 * ones, lobe_variance=4 * ones)
    assert [float(planes[name][0, 0]) for name in ("R", "irradiance.G", "lobes.B", "lobe_variance.R")] == [1, 2, 3, 4]


def test_records_name_lobes_where_a_material_has_one():
    scene, options = glossy_box(), {"dtype": "float32"}
    glass = dataclasses.replace(scene, materials=tuple(dataclasses.replace(m, ior=1.5) for m in scene.materials))
    assert "lobes" in scene_record(scene, options)["units"]
    assert "lobes" not in scene_record(glass, options)["units"]

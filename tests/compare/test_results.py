"""A comparison's files: all there, whole, and equal to what was compared."""

import dataclasses
import json
import math
import os
import subprocess
import sys
import time
from pathlib import Path

import imageio.v3
import numpy as np
import pytest
from pydantic import ConfigDict, create_model

from refgi.compare import pictures
from refgi.compare.report import as_json, file_names, signed_error, write_results
from refgi.image import is_from_refgi, read_exr, read_png_attributes
from refgi.provenance import plain

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # that is told: tests/pairs/test_loss


def strict(model, /, **fields):
    """A model of exactly these keys, one that may be absent with its default."""
    kinds = {key: kind if isinstance(kind, tuple) else (kind, ...) for key, kind in fields.items()}
    return create_model(model, __config__=ConfigDict(extra="forbid", strict=model != "Results"), **kinds)


NUMBER = float | str | None
PROGRAM = strict("Program", version=str, git=(str, ""))
STAGES = list[strict("Stage", name=str, status=str, seconds=float, depth=int, reason=str)]
FIGURES = dict[str, strict("Figure", value=NUMBER, noise=NUMBER, is_noise=bool)]
MEASURED = strict("Measured", figures=FIGURES, pixels=int, non_finite=int, non_finite_reference=int)
LEDGER = strict("Ledger", rows=dict[str, list[float]], parts=list[str], difference=list[float])
METHOD = strict("Method", summary=str, settings=dict, seconds=float, stages=STAGES, against=dict[str, MEASURED],
                flip=strict("Flip", mean=float | None, exposures=list[float], skipped=str), ledger=LEDGER | None,
                files=list[str])
REFERENCE = strict("Reference", settings=dict, seconds=float, stages=STAGES, mean_irradiance=float, estimate=dict,
                   samples=strict("Samples", fewest=int, most=int, mean=float), standard_error_of_a_pixel=float,
                   standard_error_of_the_mean=float, files=list[str])
SCENE = strict("Scene", name=str, description=str, faces=int, lights=int, exposure=float, camera=dict)
SCENE_RECORD = strict("SceneRecord", source=str | None, files=dict[str, str], name=str, faces=int, geometry_sha256=str,
                      materials_sha256=str, camera=dict, lights=list[dict])
RECORD = strict("Record", provenance=int, refgi=PROGRAM, versions=dict[str, str | None], scene=SCENE_RECORD,
                options=dict, exposure=float, units=dict[str, str], content=str)
RESULTS = strict("Results", schema_=int, refgi=PROGRAM, provenance=RECORD, scene=SCENE, size=tuple[int, int],
                 covered_pixels=int, options=dict, environment=dict, units=dict[str, str],
                 references=dict[str, REFERENCE], methods=dict[str, METHOD], failures=dict[str, str], sound=bool)


def validated(content):
    content = dict(content)
    return RESULTS(schema_=content.pop("schema"), **content)


def test_results_json_keeps_its_schema(comparison, tmp_path):
    write_results(comparison, tmp_path)
    text = (tmp_path / "results.json").read_text()
    results = validated(json.loads(text, parse_constant=pytest.fail))
    assert results.schema_ == 1
    assert set(results.methods) == {"sii", "gather", "vpl"}
    assert set(results.methods["sii"].against) == {"truth", "unoccluded"}
    assert set(results.methods["vpl"].against) == {"truth"}
    figure = results.methods["vpl"].against["truth"].figures["relmse"]
    assert figure.value == comparison.results["vpl"].against["truth"].figures["relmse"].value


def test_a_ledger_is_kept_of_methods_that_have_one(comparison):
    methods = validated(as_json(comparison)).methods
    kept = methods["sii"].ledger
    assert kept.rows["arrived"] == [1.0, 1.5, 0.0]
    parts = np.sum([kept.rows[name] for name in kept.parts], axis=0)
    assert np.array_equal(np.array(kept.rows["emitted"]) - parts, kept.difference)
    assert methods["gather"].ledger is None


def test_every_file_that_results_json_names_is_there_and_no_other(comparison, tmp_path):
    write_results(comparison, tmp_path)
    content = json.loads((tmp_path / "results.json").read_text())
    named = {f for group in ("methods", "references") for made in content[group].values() for f in made["files"]}
    assert named | {"results.json"} == {p.name for p in tmp_path.iterdir()}


def test_the_pixels_are_kept_to_the_bit(comparison, tmp_path):
    write_results(comparison, tmp_path)
    channels, attributes = read_exr(tmp_path / "sii.exr")
    for index, name in enumerate("RGB"):
        assert np.array_equal(channels[f"irradiance.{name}"], comparison.results["sii"].irradiance[index])
        assert np.array_equal(channels[name], comparison.results["sii"].radiance[index])
    assert attributes["settings"] == {"lights": 1024, "pattern": "grid"}
    assert attributes["units"]["irradiance"] == "W/m^2"
    truth, _ = read_exr(tmp_path / "truth.exr")
    assert np.array_equal(truth["variance.G"], comparison.truth.variance[1].astype(np.float32))


def test_every_file_says_how_it_was_made(comparison, tmp_path):
    """A PNG says what the EXR of the same picture says; a reference adds what its estimate came to."""
    references = {name: dataclasses.replace(reference, estimate={"estimate": {"passes": 7}})
                  for name, reference in comparison.references.items()}
    comparison = dataclasses.replace(comparison, references=references)
    write_results(comparison, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} < set(file_names(comparison.results))
    for name, method in (("sii", "sii"), ("vpl", "vpl"), ("truth", "truth"), ("unoccluded", "truth")):
        record = read_exr(tmp_path / f"{name}.exr")[1]
        assert record["method"] == method
        assert record["scene"]["camera"]["width"] == 48
        assert record.get("estimate") == ({"passes": 7} if method == "truth" else None)
        for path in tmp_path.glob(f"{name}*.png"):
            assert read_png_attributes(path) == record
    assert all(map(is_from_refgi, tmp_path.iterdir()))


def test_equal_comparisons_give_equal_files(comparison, tmp_path):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        write_results(comparison, tmp_path / name)
    for path in (tmp_path / "a").iterdir():
        assert path.read_bytes() == (tmp_path / "b" / path.name).read_bytes(), path.name


def test_numbers_that_json_cannot_hold_are_null_or_words():
    given = {"a": math.nan, "b": (math.inf, -math.inf), "c": frozenset({"z", "y"}), "d": np.float32(0.5), 3: None}
    assert plain(given) == {"a": None, "b": ["inf", "-inf"], "c": ["y", "z"], "d": 0.5, "3": None}


def test_infinite_figures_keep_the_schema(comparison):
    result = comparison.results["vpl"]
    result.against["truth"].figures["psnr"] = type(result.against["truth"].figures["psnr"])(math.inf, math.nan)
    figure = validated(as_json(comparison)).methods["vpl"].against["truth"].figures["psnr"]
    assert (figure.value, figure.noise) == ("inf", None)


def test_a_signed_error_is_positive_where_the_method_is_too_bright(comparison):
    """Analytic: sii is 1.3 times the ideal picture, whose noise is 2 %."""
    error = signed_error(comparison, comparison.results["sii"])[comparison.covered]
    truth = pictures.luminance(comparison.truth.irradiance)[comparison.covered]
    assert (error / truth).mean() == pytest.approx(0.3, abs=0.01)


def test_error_maps_are_red_where_too_bright_and_blue_where_too_dark(comparison):
    sii = comparison.results["sii"]
    scale = pictures.error_scale([signed_error(comparison, sii)], comparison.covered)
    assert scale.low == -scale.high
    values = np.array([[-scale.high, 0.0, scale.high, np.nan]])
    dark, none, bright, bad = pictures.paint(values, np.ones((1, 4), bool), scale)[0].astype(int)
    assert dark[2] > dark[0] + 50
    assert bright[0] > bright[2] + 50
    assert none.min() > 230
    assert bad.tolist() == [255, 0, 255]
    assert pictures.paint(values, np.zeros((1, 4), bool), scale)[0].tolist() == [[128] * 3] * 4


def test_the_scale_holds_95_percent_and_is_round():
    errors = np.linspace(0, 3, 1000).reshape(20, 50)
    assert pictures.error_scale([errors], np.ones((20, 50), bool)).high == 5.0
    assert pictures.error_scale([errors * 0.6], np.ones((20, 50), bool)).high == 2.0
    assert pictures.error_scale([0 * errors], np.ones((20, 50), bool)).high == 1.0
    assert pictures.error_scale([np.full((2, 2), np.nan)], np.ones((2, 2), bool)).high == 1.0


WRITER = """
import importlib.util, sys
from pathlib import Path
spec = importlib.util.spec_from_file_location("by_hand", sys.argv[1])
by_hand = importlib.util.module_from_spec(spec)
spec.loader.exec_module(by_hand)
from refgi.compare.report import write_report
from refgi.compare.report import write_results
comparison = by_hand.make_comparison(by_hand.make_scene())
print("ready", flush=True)
while True:
    write_results(comparison, Path(sys.argv[2]))
    write_report(comparison, Path(sys.argv[2]))
"""


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="SIGKILL is POSIX")
def test_a_kill_leaves_whole_files_or_none(tmp_path, evidence):
    """Killed at five moments while it writes a comparison over and over: each file by its own name is whole."""
    conftest = Path(__file__).with_name("conftest.py")
    whole = 0
    for moment in range(5):
        writer = subprocess.Popen([sys.executable, "-c", WRITER, str(conftest), str(tmp_path)], stdout=subprocess.PIPE)
        assert writer.stdout.readline() == b"ready\n"
        time.sleep(0.1 + 0.37 * moment)
        writer.kill()
        writer.wait()
        writer.stdout.close()
        for path in tmp_path.glob("[!.]*"):
            check_whole(path)
            whole += 1
    assert whole
    evidence(f"{whole} of {whole} files whole after 5 kills")


def check_whole(path):
    if path.suffix == ".exr":
        read_exr(path)
    elif path.suffix == ".png":
        imageio.v3.imread(path)
    elif path.suffix == ".json":
        validated(json.loads(path.read_text()))
    else:
        assert path.read_text("utf-8").endswith("</html>")

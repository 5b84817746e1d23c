"""The pictures that a bench writes are those it judged, each with the record of how it was made."""

import warnings
from pathlib import Path

import numpy as np
import pytest

from refgi.bench.grid import Choice, Grid
from refgi.bench.measure import REFERENCE_SEED, bench_scene
from refgi.bench.pictures import Place, places
from refgi.errors import RefgiWarning
from refgi.frame import Frame
from refgi.image import read_exr
from refgi.methods import METHODS
from refgi.scene import load_scene
from refgi.settings import of
from refgi.truth import TruthSettings, trace_truth

SIZE = {"width": 40, "height": 36, "rsm_resolution": 64, "shadows": "exact"}
GRID = Grid(tuple(Choice(name, ("lights=32",), of(METHODS[name].settings, lights=32)) for name in ("sii", "vpl")), (2,))


@pytest.fixture(scope="module")
def box():
    return load_scene("cornell_box")


@pytest.fixture(scope="module")
def made(box, tmp_path_factory):
    out = tmp_path_factory.mktemp("bench")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RefgiWarning)
        found = bench_scene(box, GRID, rounds=2, truth=TruthSettings(samples=96), place=Place(out, "pictures/box"),
                            **SIZE)
    return out, found


def irradiance(planes):
    return np.stack([planes[f"irradiance.{channel}"] for channel in "RGB"])


def test_each_run_names_its_picture(made):
    out, found = made
    names = [run.picture for run in (*found.runs, *found.line)]
    assert names == ["pictures/box/sii-01.exr", "pictures/box/vpl-01.exr", "pictures/box/truth-01.exr"]
    assert sorted(file.name for file in (out / "pictures" / "box").iterdir()) == sorted(
        [*(Path(name).name for name in names), "truth.exr", "truth_unoccluded.exr", "ids.exr"])


def test_a_picture_is_that_of_the_first_seed(box, made):
    out, found = made
    frame = Frame(box, **SIZE)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RefgiWarning)
        right = METHODS["sii"].function(frame, of(METHODS["sii"].settings, lights=32, seed=0))
    planes, record = read_exr(out / found.runs[0].picture)
    assert np.array_equal(irradiance(planes), right)
    assert np.array_equal(np.stack([planes[channel] for channel in "RGB"]), frame.radiance(right))
    assert (record["method"], record["settings"]["lights.count"]) == ("sii", 32)
    assert record["scene"]["source"] == "cornell_box"
    assert record["scene"]["camera"]["width"] == 40
    assert record["options"] == {"dtype": "float32", "rsm_resolution": 64, "shadows": "exact"}


@pytest.mark.parametrize(("name", "visibility"), [("truth", True), ("truth_unoccluded", False)])
def test_references_have_variance_and_samples(box, made, name, visibility):
    planes, record = read_exr(made[0] / "pictures" / "box" / f"{name}.exr")
    right = trace_truth(Frame(box, **SIZE), TruthSettings(samples=96, seed=REFERENCE_SEED, visibility=visibility))
    assert np.array_equal(irradiance(planes), right.mean.astype(np.float32))
    variance = np.stack([planes[f"variance.{channel}"] for channel in "RGB"])
    assert np.array_equal(variance, right.variance_of_mean.astype(np.float32))
    assert np.array_equal(planes["samples"], right.samples.astype(np.float32))
    assert record["settings"]["visibility"] is visibility
    assert record["estimate"]["passes"] == right.passes


def test_ids_are_those_of_the_visible_surface(box, made):
    planes, _ = read_exr(made[0] / "pictures" / "box" / "ids.exr")
    buffer = Frame(box, **SIZE).gbuffer
    assert np.array_equal(planes["face"].astype(np.int32), buffer.triangle_id)
    assert np.array_equal(planes["material"].astype(np.int32), buffer.material_id)
    assert planes["face"].max() < 2**32
    assert (planes["face"] == 2**32 - 1).any()


def test_places_are_named_after_scenes_and_differ():
    names = [place.folder for place in places(Path("out"), ["a/b <1>", "box-2", "box", "..", "box"])]
    assert names == ["pictures/a_b_1_", "pictures/box-2", "pictures/box", "pictures/_", "pictures/box-3"]

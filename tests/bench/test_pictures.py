"""The pictures that a bench writes are those it judged, each with the record of how it was made."""

from pathlib import Path

import numpy as np
import pytest

from refgi.bench.measure import REFERENCE_SEED
from refgi.bench.pictures import named, places, view_of
from refgi.compare.album import SECOND, THIRD
from refgi.compare.pictures import linear_planes
from refgi.errors import InputError
from refgi.frame import Frame
from refgi.image import read_exr, write_exr
from refgi.methods import METHODS
from refgi.settings import of
from refgi.truth import TruthSettings, trace_truth
from tests.bench.conftest import SIZE
from tests.bench.folders import HEIGHT, WIDTH, light, make_folder, radiance

pytestmark = pytest.mark.filterwarnings("ignore::refgi.errors.RefgiWarning")


def irradiance(planes):
    return np.stack([planes[f"irradiance.{channel}"] for channel in "RGB"])


def test_each_run_names_its_picture(benched):
    out, found = benched
    names = [run.picture for run in (*found.runs, *found.line)]
    assert names == ["pictures/box/sii-01.exr", "pictures/box/sii-02.exr", "pictures/box/vpl-01.exr",
                     "pictures/box/gather-01.exr", "pictures/box/truth-01.exr", "pictures/box/truth-02.exr"]
    assert sorted(file.name for file in (out / "pictures" / "box").iterdir()) == sorted(
        [*(Path(name).name for name in names), "truth.exr", "truth_unoccluded.exr", "ids.exr"])


def test_a_picture_is_that_of_the_first_seed(box, benched):
    out, found = benched
    frame = Frame(box, **SIZE)
    right = METHODS["sii"].function(frame, of(METHODS["sii"].settings, lights=32, seed=0))
    planes, record = read_exr(out / found.runs[0].picture)
    assert np.array_equal(irradiance(planes), right)
    assert np.array_equal(np.stack([planes[channel] for channel in "RGB"]), frame.radiance(right))
    assert (record["method"], record["settings"]["lights.count"]) == ("sii", 32)
    assert record["scene"]["source"] == "cornell_box"
    assert record["scene"]["camera"]["width"] == 40
    assert record["options"] == {"dtype": "float32", "rsm_resolution": 64, "shadows": "exact"}


@pytest.mark.parametrize(("name", "visibility"), [("truth", True), ("truth_unoccluded", False)])
def test_references_have_variance_and_samples(box, benched, name, visibility):
    planes, record = read_exr(benched[0] / "pictures" / "box" / f"{name}.exr")
    right = trace_truth(Frame(box, **SIZE), TruthSettings(samples=96, seed=REFERENCE_SEED, visibility=visibility))
    assert np.array_equal(irradiance(planes), right.mean.astype(np.float32))
    variance = np.stack([planes[f"variance.{channel}"] for channel in "RGB"])
    assert np.array_equal(variance, right.variance_of_mean.astype(np.float32))
    assert np.array_equal(planes["samples"], right.samples.astype(np.float32))
    assert record["settings"]["visibility"] is visibility
    assert record["estimate"]["passes"] == right.passes


def test_ids_are_those_of_the_visible_surface(box, benched):
    planes, _ = read_exr(benched[0] / "pictures" / "box" / "ids.exr")
    buffer = Frame(box, **SIZE).gbuffer
    assert np.array_equal(planes["face"].astype(np.int32), buffer.triangle_id)
    assert np.array_equal(planes["material"].astype(np.int32), buffer.material_id)
    assert planes["face"].max() < 2**32
    assert (planes["face"] == 2**32 - 1).any()


def test_places_are_named_after_scenes_and_differ():
    names = [place.folder for place in places(Path("out"), ["a/b <1>", "box-2", "box", "..", "box"])]
    assert names == ["pictures/a_b_1_", "pictures/box-2", "pictures/box", "pictures/_", "pictures/box-3"]


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "out"


def changed(scene, **changes):
    """The scene with its first run changed."""
    return scene.model_copy(update={"runs": (scene.runs[0].model_copy(update=changes), *scene.runs[1:])})


def test_pictures_are_those_of_the_files(folder):
    scene = make_folder(folder).scenes[1]
    view, record = view_of(scene, 2, folder)
    assert (view.title, view.exposure, record["exposure"]) == ("hall", 0.5, 0.5)
    assert [one.name for one in view.pictures] == ["scene2-sii-1", "scene2-sii-2", "scene2-vpl-3", "scene2-truth-5",
                                                   "scene2-truth-6"]
    assert [name for name, _ in named(scene, 2)][3] == "scene2-vpl-4"  # it has no picture
    for seed, picture in enumerate(view.pictures, 2):
        irradiance, seen = picture.load()
        assert np.array_equal(irradiance, light(seed))
        assert np.array_equal(seen, radiance(light(seed)))
    assert [one.judges for one in view.pictures[1:3]] == [("truth", "unoccluded"), ("truth",)]
    for seed, judge in enumerate(view.judges.values()):
        assert np.array_equal(judge.irradiance, light(seed))
        assert np.array_equal(judge.radiance, radiance(light(seed)))
        assert (judge.variance == np.float32(0.0025)).all()
    assert np.array_equal(view.covered, light(0)[0] > 0)
    assert sorted(view.ids) == ["face", "material"]
    assert view.ids["face"][1, 0] == WIDTH + 100_000
    assert view.pictures[0].said == "RMSE 50 % in 20 ms"


def test_the_front_and_each_method_s_nearest_are_important(folder):
    scene = make_folder(folder).scenes[0]
    found = view_of(scene, 1, folder)[0].pictures
    assert [one.importance for one in found] == [SECOND, SECOND, SECOND, THIRD, SECOND]


def test_without_samples_a_pixel_with_any_light_shows_a_surface(folder):
    scene = make_folder(folder).scenes[0]
    truth = folder / "pictures" / "0" / "truth.exr"
    planes, _ = read_exr(truth)
    del planes["samples"]
    for name in ("variance.R", "variance.G", "variance.B"):
        planes[name][:, :3] = 0
    planes["R"][:, 0] = 0.5  # a lamp
    write_exr(truth, planes)
    view = view_of(scene, 1, folder)[0]
    assert view.covered.any(axis=0).tolist() == [True, False] + [True] * (WIDTH - 2)
    assert view.exposure == 1.0


def test_a_missing_picture_is_left_out_and_without_the_truth_there_is_none(folder):
    scene = make_folder(folder).scenes[0]
    place = folder / "pictures" / "0"
    (place / "sii-01.exr").unlink()
    (place / "ids.exr").unlink()
    (place / "truth_unoccluded.exr").unlink()
    view = view_of(scene, 1, folder)[0]
    assert view.pictures[0].name == "scene1-sii-2"
    assert view.ids == {}
    assert view.pictures[0].judges == ("truth",)
    (place / "truth.exr").unlink()
    assert view_of(scene, 1, folder) is None


@pytest.mark.parametrize("name", ["/etc/passwd.exr", "../other/sii.exr", "pictures/../../sii.exr"])
def test_files_outside_the_folder_are_refused(folder, name):
    scene = changed(make_folder(folder).scenes[0], picture=name)
    with pytest.raises(InputError, match=r"results\.json: picture: expected a file inside its folder"):
        view_of(scene, 1, folder)


def test_pictures_of_another_size_or_kind_are_refused(folder):
    scene = make_folder(folder).scenes[0]
    file = folder / "pictures" / "0" / "sii-01.exr"
    small = light(0)[:, :5]
    write_exr(file, linear_planes(small, small))
    with pytest.raises(InputError, match=rf"sii-01\.exr.*{WIDTH} x {HEIGHT} pixels.*{WIDTH} x 5"):
        view_of(scene, 1, folder)[0].pictures[0].load()
    write_exr(file, {"depth": np.ones((HEIGHT, WIDTH), np.float32)})
    with pytest.raises(InputError, match=r"sii-01\.exr.*irradiance\.R"):
        view_of(scene, 1, folder)[0].pictures[0].load()
    file.write_bytes(file.read_bytes()[:200])
    with pytest.raises(InputError, match=r"sii-01\.exr"):
        view_of(scene, 1, folder)[0].pictures[0].load()

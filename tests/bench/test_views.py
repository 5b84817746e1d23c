"""Pictures of a folder as views: what is there, what is missing, and what must not be read."""

import numpy as np
import pytest

from refgi.bench.pictures import named, view_of
from refgi.compare.album import SECOND, THIRD
from refgi.compare.pictures import linear_planes
from refgi.errors import InputError
from refgi.image import read_exr, write_exr
from tests.bench.folders import HEIGHT, WIDTH, light, make_folder, radiance


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

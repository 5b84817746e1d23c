"""What --out may make and overwrite, for every verb that writes."""

from pathlib import Path

import numpy as np
import pytest

from refgi.cli.destination import Permission, make, picture_files
from refgi.image import is_from_refgi, write_exr, write_png
from tests.cli.command import TINY
from tests.cli.command import invoke as run
from tests.cli.command import refused_in_a_line as refused

WAY = "frames = 2\ncamera = [{at = 0.0, vfov_deg = 30.0}]"
VERBS = {
    "render": (["cornell_box", *TINY, "--set", "lights=16"], "cornell_box_sii.png"),
    "compare": (["cornell_box", *TINY, "--methods", "sii", "--set", "sii.lights=16", "--set", "truth.samples=24"],
                "index.html"),
    "sequence": (["cornell_box", "way.toml", *TINY, "--method", "sii", "--set", "lights=16"], "way_00001.exr"),
}
REFUSED = {  # what is wrong with a scene, by verb: before anything is computed or made
    "render": ["no_such.json"], "compare": ["no_such.json"], "sequence": ["no_such.json", "way.toml"],
}


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("way.toml").write_text(WAY)


@pytest.mark.slow("compare")
@pytest.mark.parametrize("verb", VERBS)
def test_missing_folders_are_made_one_deep_or_where_one_says_so(verb):
    arguments, name = VERBS[verb]
    assert refused(run(verb, *arguments, "--out", "a/b/"), "--out a/b", "there is no folder a", "--parents makes it")
    assert not Path("a").exists()
    assert run(verb, *arguments, "--out", "a/b/", "--parents").exit_code == 0
    assert Path("a/b", name).is_file()
    assert run(verb, *arguments, "--out", "c").exit_code == 0
    assert Path("c", name).is_file()


@pytest.mark.slow("compare")
@pytest.mark.parametrize("verb", VERBS)
def test_a_file_of_another_program_is_overwritten_by_force_alone(verb):
    arguments, name = VERBS[verb]
    Path("out").mkdir()
    Path("out", name).write_text("precious")
    Path("out", "beside.txt").write_text("not in the way")
    assert refused(run(verb, *arguments, "--out", "out"), f"out/{name} is there and not from refgi", "--force")
    assert Path("out", name).read_text() == "precious"
    assert sorted(path.name for path in Path("out").iterdir()) == sorted(["beside.txt", name])
    assert run(verb, *arguments, "--out", "out", "--force").exit_code == 0
    assert all(is_from_refgi(path) for path in Path("out").iterdir() if path.name != "beside.txt")
    assert run(verb, *arguments, "--out", "out").exit_code == 0  # its own files it knows again


@pytest.mark.parametrize("verb", VERBS)
def test_a_refused_scene_leaves_no_folder(verb):
    assert refused(run(verb, *REFUSED[verb], "--out", "new"), "no_such.json")
    assert not Path("new").exists()


def test_one_file_by_its_name():
    Path("mine.exr").write_text("precious")
    assert refused(run("render", "cornell_box", "--out", "mine.exr"), "mine.exr", "--force")
    assert refused(run("render", "cornell_box", "--out", "a/b/mine.exr"), "--parents")


@pytest.mark.parametrize("name", ["a.exr", "a.png", "a.json", "a.html", "a.txt"])
def test_what_is_damaged_empty_or_of_another_kind_is_not_from_refgi(name):
    path = Path(name)
    assert not is_from_refgi(path)
    for content in (b"", b"x", b"[]", b"{}", b"\x89PNG\r\n\x1a\n", b"<!DOCTYPE html><p>refgi</p>"):
        path.write_bytes(content)
        assert not is_from_refgi(path)


def test_pictures_of_other_programs_are_not_from_refgi():
    import imageio.v3
    import OpenEXR

    plane = np.ones((4, 4), np.float32)
    OpenEXR.File({"type": OpenEXR.scanlineimage}, {"R": plane}).write("a.exr")
    imageio.v3.imwrite("a.png", np.zeros((4, 4, 3), np.uint8))
    assert not is_from_refgi("a.exr")
    assert not is_from_refgi("a.png")
    write_exr("a.exr", {"R": plane})
    write_png("a.png", np.ones((4, 4, 3), np.float32))
    assert is_from_refgi("a.exr")
    assert is_from_refgi("a.png")


def test_a_folder_is_made_when_there_is_something_to_write():
    files = picture_files("new", "stem", Permission())
    assert [file.name for file in files.files] == ["stem.exr", "stem.png"]
    assert not Path("new").exists()
    files.make_folder()
    make(Path("new"))
    assert Path("new").is_dir()


@pytest.mark.parametrize("verb", VERBS)
def test_an_empty_name_is_refused(verb):
    arguments, _ = VERBS[verb]
    assert refused(run(verb, *arguments, "--out", ""), "--out: expected a name, got ''")
    assert [path.name for path in Path().iterdir()] == ["way.toml"]

"""The command where files are no files, streams are closed, and names are no text: a line each, or the work is done."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from refgi.image import read_exr

ROOT = Path(__file__).parents[2]
TINY = ["cornell_box", "--size", "8x8", "--rsm-resolution", "16"]

pytestmark = pytest.mark.skipif(os.name != "posix", reason="descriptors, pipes and names of POSIX")


def run(*arguments, closed=(), **environment):
    """Run the command as a shell does that closes some of the standard files."""
    shell = f"exec {sys.executable} -m refgi \"$@\" {' '.join(f'{n}>&-' for n in closed)}"
    return subprocess.run(["sh", "-c", shell, "sh", *map(os.fsencode, map(str, arguments))], cwd=ROOT, timeout=100,
                          env=os.environ | {"PYTHONPATH": str(ROOT)} | environment, capture_output=True, check=False)


@pytest.fixture(scope="module")
def rendered(tmp_path_factory):
    """The picture that the command makes with all files open."""
    file = tmp_path_factory.mktemp("rendered") / "a.exr"
    assert run("render", *TINY, "--out", file).returncode == 0
    return file.read_bytes()


@pytest.mark.parametrize("closed", [(2,), (0, 1, 2)])
def test_closed_streams_change_no_picture(rendered, tmp_path, closed):
    done = run("render", *TINY, "--out", tmp_path / "b.exr", closed=closed)
    assert (done.returncode, done.stderr) == (0, b"")
    assert (tmp_path / "b.exr").read_bytes() == rendered


def test_an_error_to_nobody_does_not_go_to_stdout():
    done = run("render", "no_such_scene", "--out", "a.exr", closed=(2,))
    assert (done.returncode, done.stdout, done.stderr) == (2, b"", b"")


@pytest.mark.slow("a.exr-force1", "a.png-force0", "folder/cornell_box_sii.exr-force0")
@pytest.mark.parametrize("force", [[], ["--force"]])
@pytest.mark.parametrize("name", ["a.exr", "a.png", "folder/cornell_box_sii.exr"])
def test_a_pipe_is_no_place_for_results(tmp_path, name, force):
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / name)
    out = tmp_path / name if "/" not in name else tmp_path / "folder"
    done = run("render", *TINY, "--out", out, *force)
    said = done.stderr.decode()
    assert (done.returncode, len(said.splitlines())) == (2, 1)
    assert f"expected a new name or a file, got {tmp_path / name}, which is neither" in said
    assert (tmp_path / name).is_fifo()


@pytest.mark.parametrize("arguments", [["render", "PIPE.json", "--out", "a.exr"], ["render", "--again", "PIPE.exr"],
                                       ["check", "PIPE.exr", "--against", "cornell_box"]])
def test_a_pipe_is_not_waited_for(tmp_path, arguments):
    pipe = next(one for one in arguments if "PIPE" in one)
    os.mkfifo(tmp_path / pipe)
    done = run(*(tmp_path / one if one == pipe else one for one in arguments))
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)


@pytest.mark.parametrize("locale", ["C", "C.UTF-8"])
def test_names_that_are_no_text_are_read_and_not_written(tmp_path, locale):
    mesh, picture = (os.fsdecode(os.fsencode(tmp_path) + b"/gr\xfcn" + end) for end in (b".obj", b".exr"))
    Path(mesh).write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n")
    done = run("render", mesh, "--size", "8x8", "--rsm-resolution", "16", "--out", tmp_path / "a.exr", "--light",
               "point:position=0.5,0.5,1:intensity=1", LC_ALL=locale)
    assert done.returncode == 0, done.stderr
    assert b"gr?n by sii" in done.stdout
    done = run("render", *TINY, "--out", picture, LC_ALL=locale)
    assert (done.returncode, done.stderr) == (2, b"refgi: --out: expected a name in UTF-8, got '" + repr(
        picture)[1:-1].encode() + b"'\n")
    (tmp_path / "a.exr").rename(picture)
    planes, record = read_exr(picture)
    assert {"R", "G", "B"} <= planes.keys()
    assert record["method"] == "sii"

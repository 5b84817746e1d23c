"""Errors under --json: one object with exit code, message, file and key, whatever went wrong and wherever."""

import json
from pathlib import Path

import pytest

from refgi.cli.session import Session
from tests.cli.command import invoke as run

TINY = ["--size", "12x10", "--rsm-resolution", "16", "--set", "lights=16"]


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("bad.json").write_text('{"camera": {"eye": [0, 0], "fov": 3}}')
    Path("bad.toml").write_text("frames = 0\n")
    Path("flat.obj").write_text("v 0 0 0\nv 1 0 nan\nv 1 1 0\nf 1 2 3\n")
    Path("cut.json").write_text('{"schema": 1')


def fault(result):
    told = json.loads(result.stdout)
    assert set(told) == {"error", "warnings"}
    assert set(told["error"]) == {"code", "message", "file", "key"}
    assert told["error"]["code"] == result.exit_code
    assert "Traceback" not in result.output
    spoken = [line.removeprefix("refgi: ") for line in result.stderr.splitlines() if "warning: " not in line]
    assert told["error"]["message"].splitlines() == spoken
    return told["error"]


@pytest.mark.parametrize(("arguments", "file", "key"), [
    (["rendr"], None, None),
    (["render", "--nonsense"], None, "--nonsense"),
    (["render", "--out", "a.exr"], None, "SCENE"),
    (["render", "cornell_box"], None, "--out"),
    (["render", "cornell_box", "--size"], None, "--size"),
    (["render", "cornell_box", "--exposure", "-1", "--out", "a.exr"], None, "--exposure"),
    (["render", "cornell_box", "--out", "a/b/c.exr"], None, "--out"),
    (["render", "cornell_box", "--light", "lamp:x=1", "--out", "a.exr"], None, "--light"),
    (["render", "cornell_box", "--set", "lights=many", "--out", "a.exr"], None, "lights.count"),
    (["render", "cornell_box", "--set", "lights=0", "--set", "ligths=3", "--out", "a.exr"], None,
     "ligths, lights.count"),
    (["render", "cornell_box", "--set", "lights", "--out", "a.exr"], None, "--set"),
    (["render", "cornell_box", "--eye", "nan,0,0", "--out", "a.exr"], None, "camera: eye"),
    (["render", "cornel_box", "--out", "a.exr"], None, "scene"),
    (["render", "atrium:faces=many", "--out", "a.exr"], None, None),
    (["render", "none.json", "--out", "a.exr"], "none.json", None),
    (["render", "bad.json", "--out", "a.exr"], "bad.json", None),
    (["render", "cut.json", "--out", "a.exr"], "cut.json", None),
    (["render", "flat.obj", "--out", "a.exr"], "flat.obj", None),
    (["render", "--again", "none.exr"], "none.exr", "path"),
    (["sequence", "cornell_box", "bad.toml", "--out", "a"], "bad.toml", "frames"),
    (["sequence", "cornell_box", "none.toml", "--out", "a"], "none.toml", None),
    (["compare", "cornell_box", "--methods", "sii,nothing"], None, None),
    (["compare", "cornell_box", "--set", "lights=3"], None, "--set"),
    (["explain", "cornell_box", "--method", "nothing"], None, None),
], ids=str)
def test_every_error_is_one_object_on_stdout(arguments, file, key):
    for places in (["--json", *arguments[1:]], [*arguments[1:], "--json"]):
        result = run(arguments[0], *places)
        assert result.exit_code == 2, result.output
        told = fault(result)
        assert told["file"] == file
        assert file is None or not (told["key"] or "").startswith(file)
        if key is not None:
            assert told["key"] == key
    assert sorted(path.name for path in Path().iterdir()) == ["bad.json", "bad.toml", "cut.json", "flat.obj"]


def test_an_error_has_the_warnings_of_its_run():
    Path("dim.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\nf 1 1 2\n")
    result = run("render", "dim.obj", *TINY, "--eye", "0,0,9", "--target", "0,0,20", "--out", "a.exr", "--json")
    told = json.loads(result.stdout)
    assert told["error"]["key"] == "camera"
    assert any("zero area" in text or "no light" in text for text in told["warnings"])


def test_a_fault_of_refgi_and_an_interrupt_are_objects_too(monkeypatch):
    for error, code, message in ((ZeroDivisionError("by zero"), 1, "unexpected ZeroDivisionError: by zero"),
                                 (KeyboardInterrupt(), 130, "interrupted"),
                                 (MemoryError(), 2, "out of memory")):
        def stop(*_, error=error, **__):
            raise error

        monkeypatch.setattr("refgi.scene.builtin_scenes", stop)
        result = run("scenes", "--json")
        assert result.exit_code == code
        assert fault(result)["message"].startswith(message)


def test_without_json_nothing_goes_to_stdout():
    assert run("render", "cornel_box", "--out", "a.exr").stdout == ""
    assert Session().as_json is False

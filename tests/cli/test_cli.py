"""The command as a whole: verbs, exit codes, what goes to stdout and what to stderr."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import refgi
from refgi.cli import session as module
from refgi.cli.group import VERBS
from refgi.cli.session import progress
from refgi.image import read_exr
from tests.cli.command import TINY
from tests.cli.command import invoke as run
from tests.cli.command import refused_in_a_line as refused

HELP_SECONDS = 0.3  # the aim; the test allows a busy machine three times as much


@pytest.mark.parametrize("arguments", [["--help"], ["--version"], ["render", "--help"]])
def test_help_loads_neither_numpy_nor_numba(arguments, evidence):
    """That of the command has the first line of every verb's, so it loads them all."""
    code = ("import sys; from refgi.cli import main; sys.argv = ['refgi', *sys.argv[1:]]\n"
            "try: main()\n"
            "finally: print([m for m in ('numpy', 'numba', 'rich', 'pydantic', 'jinja2') if m in sys.modules],"
            " file=sys.stderr)")
    seconds = []
    for _ in range(2):
        started = time.perf_counter()
        done = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=False)
        seconds.append(time.perf_counter() - started)
        assert done.returncode == 0
        assert done.stderr == "[]\n"
        assert done.stdout
    assert min(seconds) < 3 * HELP_SECONDS
    evidence(f"refgi {' '.join(arguments)}: {min(seconds):.2f} s")


def test_every_verb_has_a_line_of_help_that_is_not_cut():
    result = run("--help")
    assert result.exit_code == 0
    for verb in VERBS:
        assert f"  {verb} " in result.stdout
        assert f"Usage: refgi {verb} " in run(verb, "-h").stdout
    assert "..." not in result.stdout.partition("Commands:")[2]


def test_version_and_module():
    assert run("-V").stdout == f"refgi {refgi.__version__}\n"
    done = subprocess.run([sys.executable, "-m", "refgi", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout == f"refgi {refgi.__version__}\n"


def test_without_a_verb_the_help_goes_to_stderr():
    result = run()
    assert result.exit_code == 2
    assert "Commands:" in result.stderr
    assert result.stdout == ""


@pytest.mark.parametrize(("arguments", "words"), [
    (["rendr"], ["'rendr'", "Did you mean 'render'"]),
    (["--nonsense"], ["--nonsense"]),
    (["render"], ["SCENE", "render --help"]),
    (["render", "cornell_box"], ["--out"]),
    (["render", "cornell_box", "--out", "a.exr", "--siz", "3"], ["--siz", "--size"]),
])
def test_usage_errors_are_one_line(arguments, words):
    assert refused(run(*arguments), *words)


def test_scenes_as_text_and_as_json():
    text = run("scenes")
    assert text.exit_code == 0
    assert "cornell_box" in text.stdout
    listed = json.loads(run("scenes", "--json").stdout)
    assert listed["scenes"]["cornell_box"]["faces"] == 30
    assert set(listed["scenes"]) >= {"atrium", "ring", "stage"}


def test_files_that_vanish_from_the_cache_are_not_counted(tmp_path, monkeypatch):
    (tmp_path / "kits").mkdir()
    (tmp_path / "kits" / "kernel").write_bytes(b"four")
    (tmp_path / "kits" / "gone").symlink_to(tmp_path / "nowhere")  # listed, but no longer there when its size is asked
    monkeypatch.setenv("REFGI_CACHE_DIR", str(tmp_path))
    told = json.loads(run("info", "--json").stdout)["cache"]
    assert (told["files"], told["bytes"]) == (1, 4)


def test_info_tells_versions_cache_methods_and_the_way_to_embree():
    told = json.loads(run("info", "--json").stdout)
    assert told["versions"]["refgi"] == refgi.__version__
    assert told["versions"]["numpy"] == np.__version__
    assert told["embree"] in ("by address", "embreex's run")
    assert told["cache"]["bytes"] >= 0
    assert told["threads"] >= 1
    assert set(told["methods"]) >= {"sii", "truth"}
    text = run("info").stdout
    assert refgi.__version__ in text
    assert "MiB" in text


def test_an_unexpected_error_is_one_line_and_debug_shows_the_traceback(monkeypatch):
    def broken(*_, **__):
        raise ZeroDivisionError("division\nby zero")

    monkeypatch.setattr("refgi.scene.builtin_scenes", broken)
    plain, debug = run("scenes"), run("scenes", "--debug")
    assert plain.exit_code == debug.exit_code == 1
    assert plain.stderr == ("refgi: unexpected ZeroDivisionError: division by zero"
                            " (a fault of refgi; REFGI_DEBUG=1 shows where)\n")
    assert "Traceback" in debug.stderr
    assert plain.stdout == debug.stdout == ""


@pytest.mark.parametrize(("error", "code", "line"), [
    (KeyboardInterrupt, 130, "interrupted"),
    (MemoryError, 2, "out of memory: try a smaller --size"),
    (RuntimeError("can't start new thread"), 2, "out of memory: can't start new thread"),
    (MemoryError("Embree's tree over 9 triangles does not fit"), 2,
     "out of memory: Embree's tree over 9 triangles does not fit"),
    (refgi.errors.InputError("key: expected a, got b"), 2, "key: expected a, got b"),
])
def test_what_stops_a_run_decides_the_exit_code(error, code, line, monkeypatch):
    def stop(*_, **__):
        raise error

    monkeypatch.setattr("refgi.scene.builtin_scenes", stop)
    result = run("scenes")
    assert result.exit_code == code
    assert result.stderr == f"refgi: {line}\n"


@pytest.mark.skipif(os.name == "nt", reason="SIGINT of a child is POSIX")
def test_ctrl_c_leaves_with_130_and_no_file(tmp_path):
    child = subprocess.Popen(
        [sys.executable, "-m", "refgi", "render", "cornell_box", "--method", "truth", "--size", "64", "--set",
         "samples=100000000", "--out", str(tmp_path / "a.exr")], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))  # a shell's background job ignores it
    child.stderr.readline()  # the first line of progress: it is computing
    child.send_signal(signal.SIGINT)
    out, err = child.communicate(timeout=120)
    assert child.returncode == 130
    assert out == ""
    assert err.strip().endswith("refgi: interrupted")
    assert "Traceback" not in err
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
@pytest.mark.parametrize(("asked", "code", "line", "harm"), [
    ("SIGTERM", 143, "terminated", "os.kill(os.getpid(), signal.SIGSEGV)"),
    ("SIGINT", 130, "interrupted", "del self.handle")])
def test_what_a_signal_leaves_half_made_does_no_harm(asked, code, line, harm):
    victim = f"""
import os, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job ignores it
import refgi.scene, refgi.cli
class Compiler:
    def __init__(self, *_):
        os.kill(os.getpid(), signal.{asked})
        self.handle = 1
    def __del__(self):
        {harm}
kept = Compiler.__new__(Compiler)  # until the interpreter ends
refgi.scene.builtin_scenes = Compiler
sys.argv = ["refgi", "scenes"]
refgi.cli.main()
"""
    child = subprocess.run([sys.executable, "-c", victim], capture_output=True, text=True, timeout=60)
    assert (child.returncode, child.stdout, child.stderr) == (code, "", f"refgi: {line}\n")


@pytest.mark.skipif(os.name == "nt", reason="POSIX pipes")
def test_a_reader_that_leaves_is_no_error():
    child = subprocess.Popen([sys.executable, "-m", "refgi", "scenes"], stdout=subprocess.PIPE,
                             stderr=subprocess.PIPE)
    child.stdout.close()
    err = child.stderr.read()
    child.stderr.close()
    assert child.wait(timeout=60) == 0
    assert err == b""


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_full_disk_behind_stdout_is_told_and_behind_stderr_stops_nothing(tmp_path):
    command = [sys.executable, "-m", "refgi"]
    with Path("/dev/full").open("w") as full:
        told = subprocess.run([*command, "info"], stdout=full, stderr=subprocess.PIPE, text=True, check=False)
        assert told.returncode == 2
        assert told.stderr.startswith("refgi: stdout: cannot be written: ")
        (tmp_path / "one.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
        out = tmp_path / "one.png"
        small = ["--size", "4", "--rsm-resolution", "8", "--out", str(out)]
        warned = [*command, "render", str(tmp_path / "one.obj"), *small]
        assert subprocess.run(warned, stderr=full, stdout=subprocess.DEVNULL, check=False).returncode == 0
        assert out.exists()


def test_compare_writes_everything_and_prints_a_table(tmp_path):
    result = run("compare", "cornell_box", *TINY, "--methods", "sii", "--set", "sii.lights=16", "--set",
                 "truth.samples=24", "--parents", "--out", tmp_path / "new" / "out")
    assert result.exit_code == 0, result.stderr
    folder = tmp_path / "new" / "out"
    assert {"index.html", "results.json", "sii.exr", "sii.png", "sii_error.png", "truth.exr"} <= {
        path.name for path in folder.iterdir()}
    content = json.loads((folder / "results.json").read_text())
    assert content["methods"]["sii"]["settings"]["lights.count"] == 16
    assert content["references"]["truth"]["settings"]["samples"] == 24
    assert content["size"] == [12, 10]
    assert content["methods"]["sii"]["ledger"]["rows"]["arrived"][0] > 0
    assert "truth without visibility" in result.stdout
    assert read_exr(folder / "sii.exr")[0]["R"].shape == (10, 12)


@pytest.mark.parametrize(("arguments", "words"), [
    (["--methods", "sii,nothing"], ["nothing"]), (["--methods", "truth"], ["--methods"]),
    (["--methods", "sii", "--set", "lights=3"], ["METHOD.key=value"]),
    (["--methods", "sii", "--set", "sij.lights=3", "--set", "vpl.x=1"], ["'sij'", "did you mean 'sii'", "'vpl'"]),
    (["--methods", "sii", "--set", "truth.samples=0"], ["samples"]),
])
def test_compare_refuses_what_it_cannot_do(arguments, words):
    assert refused(run("compare", "cornell_box", *TINY, *arguments), *words)


def test_compare_fails_with_1_when_a_method_fails(monkeypatch):
    from refgi.compare import comparison

    def fail(*_, **__):
        raise refgi.errors.InputError("lobes: expected none, got some")

    monkeypatch.setattr(comparison._Runner, "method", fail)
    result = run("compare", "cornell_box", *TINY, "--methods", "sii", "--set", "truth.samples=24")
    assert result.exit_code == 1
    assert "refgi: sii gave no picture: lobes" in result.stderr


def test_lines_come_only_every_few_seconds(monkeypatch, capsys):
    clock = iter([0.0, 1.0, 3.5, 4.0, 7.0])
    monkeypatch.setattr(module.time, "monotonic", lambda: next(clock))
    with progress() as tell:
        for done in (0.1, 0.5, 0.6, 1.0):
            tell("truth", done)
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == "refgi: truth 50%\nrefgi: truth done\n"


def test_a_terminal_gets_a_bar(monkeypatch, capsys):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    with progress() as tell:
        tell("truth", 0.25)
        tell("sii", 0.5)
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "sii" in captured.err

"""Faults of the machine: commands that do not cope are found; a damaged kernel is not run."""

import hashlib
import os
import subprocess
import warnings

import pytest

from benchmarks.stability import cache_faults
from benchmarks.stability.faults import (
    MEMORY_MIB,
    disk_faults,
    memory_faults,
    small_disk,
    tasks,
    unclear,
    writers_faults,
)
from benchmarks.stability.kills import VICTIMS, Victim
from refgi.errors import InputError, RefgiWarning
from refgi.jit import cache, kernelfile

# writes 100 kB, and takes 64 MB for it
COMMAND = """
MODULES.clear()
import pathlib, time
import click
import refgi.image
from refgi.cli.group import VerbGroup
def command(arguments):
    group = VerbGroup("refgi")
    @click.command("work")
    def work():
        write(pathlib.Path("out/a.json"), '"' + "x" * 100_000 + '"')
    VerbGroup.get_command = lambda *_: work
    group.main(["work"])
def write(path, text):
    held = bytearray(64 << 20)
    refgi.image.write_text(path, text)
"""
TORN = "def write(path, text):\n    path.write_text(text)\n"
TRACEBACK = "def write(path, text):\n    try:\n        bytearray(64 << 20)\n    except MemoryError:\n        1 / 0\n"
SHARED = ("def write(path, text):\n    part = path.with_name('.a.part.json')\n    part.write_text(text)\n"
          "    time.sleep(0.5)\n    part.replace(path)\n")


@pytest.fixture(autouse=True)
def _fake(monkeypatch):
    monkeypatch.setitem(VICTIMS, "fake", Victim(["work"], patch=COMMAND))


@pytest.mark.slow
def test_a_full_disk_is_told_and_leaves_nothing(tmp_path):
    faults, means = disk_faults("fake", (16, 4096), tmp_path / "sound")
    assert faults == []
    assert means in ("tmpfs", "RLIMIT_FSIZE")
    faults, _ = disk_faults("fake", (16,), tmp_path / "torn", TORN)
    assert any("torn a.json" in fault for fault in faults)
    assert any("exit 1" in fault for fault in faults)


@pytest.mark.slow
def test_little_memory_is_told(tmp_path):
    assert memory_faults("fake", (8, 1024), tmp_path / "sound") == []
    faults = memory_faults("fake", (8, 1024), tmp_path / "traceback", TRACEBACK)
    assert len(faults) == 1
    assert faults[0].startswith("8 MiB: exit 1")


@pytest.mark.slow
def test_two_writers_of_one_temporary_name_are_found(tmp_path):
    assert writers_faults("fake", tmp_path / "sound") == []
    assert writers_faults("fake", tmp_path / "shared", SHARED) != []


@pytest.mark.slow
@pytest.mark.parametrize(("code", "said", "clear"), [
    (0, "done", True), (2, "refgi: out/a.exr: cannot be written", True), (2, "", False), (2, "no", False),
    (1, "refgi: out: unexpected", False), (-11, "", False), (2, "refgi: elsewhere", False),
    (2, "Traceback\nrefgi: out", False), (2, "refgi: warning: out\nrefgi: out: no", True),
    (2, "refgi: tracing 5 %\nrefgi: out: no", True), (2, "refgi: out\n" * 9, False)])
def test_an_end_is_clear_or_not(code, said, clear):
    assert (unclear(code, said, names="out") == "") is clear


def test_a_read_only_folder_cannot_be_written(tmp_path):
    with small_disk(tmp_path / "disk", 64, closed=True) as means:
        if means == "tmpfs" or os.getuid():
            with pytest.raises(OSError, match=r"Read-only|Permission"):
                (tmp_path / "disk" / "a").write_text("x")
    (tmp_path / "disk" / "a").write_text("x")


NO_DIGEST = "import refgi.jit.kernelfile as k; k.verified = lambda content: memoryview(content)[:-k.DIGEST]"


@pytest.mark.slow
def test_a_damaged_kernel_that_is_not_noticed_is_a_breach(monkeypatch):
    monkeypatch.setitem(cache_faults.DAMAGES, True, 60)
    (row,) = cache_faults.damaged(True, lambda _: None)
    assert (row.figure, row.cases, row.passed) == (0, 60, True)
    (row,) = cache_faults.damaged(True, lambda _: None, NO_DIGEST)
    assert not row.passed  # taken for a kernel, or the end of the process


@pytest.mark.slow
def test_cold_starts_that_do_not_share_are_found():
    (row,) = cache_faults.cold_starts(True, lambda _: None)
    assert row.passed, row.detail
    (row,) = cache_faults.cold_starts(True, lambda _: None, "import refgi.jit.cache as c; "
                                      "c.KernelCache.save_overload = lambda *_: None")
    assert (row.figure, row.detail) == (2, "2 starts compiled; the last start found no kernel")


def test_the_digest_stands_at_the_end_of_a_file():
    content = kernelfile.FORMAT + b"{}\n"
    whole = content + hashlib.sha256(content).digest()
    assert kernelfile.verified(whole) == content
    other = b"another format\n"
    for damaged in (content, b"", whole[:-1], whole + b"\0", b"\0" + whole[1:], whole[:-1] + bytes([whole[-1] ^ 1]),
                    other + hashlib.sha256(other).digest()):
        with pytest.raises(ValueError, match="damaged"):
            kernelfile.verified(damaged)


def test_a_full_disk_leaves_nothing_in_the_cache(tmp_path, monkeypatch):
    class Compiled:
        class library:  # noqa: N801
            has_dynamic_globals = False

    def full(*_):
        raise OSError(28, "No space left on device")

    kept = cache.KernelCache(lambda x: x)
    monkeypatch.setattr(kept, "path", lambda _: tmp_path / "a.kernel")
    monkeypatch.setattr(cache, "packed", lambda _: b"code")
    monkeypatch.setattr(cache.Path, "replace", full)
    with pytest.warns(RefgiWarning, match="cannot be kept"):
        kept.save_overload(None, Compiled())
    assert list(tmp_path.iterdir()) == []
    monkeypatch.undo()
    monkeypatch.setattr(kept, "path", lambda _: tmp_path / "a.kernel")
    monkeypatch.setattr(cache, "packed", lambda _: b"code")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        kept.save_overload(None, Compiled())
    assert [file.name for file in tmp_path.iterdir()] == ["a.kernel"]


@pytest.mark.parametrize(("left", "loaded", "verb", "refused"), [
    (599, False, "render", True), (600, False, "render", False), (63, True, "compare", True),
    (64, True, "compare", False), (None, False, "render", False), (1, False, "scenes", False),
    (-5, True, "warm", True)])
def test_a_limit_of_memory_is_told_before_libraries_are_loaded(monkeypatch, left, loaded, verb, refused):
    from refgi.cli import group

    monkeypatch.setattr(group, "_left", lambda: left if left is None else left << 20)
    monkeypatch.setattr(group.sys, "modules", {"scipy.spatial": None} if loaded else {})
    if refused:
        with pytest.raises(InputError, match=f"leaves {max(0, left)} MiB, {verb} needs"):
            group.require_room(verb)
    else:
        group.require_room(verb)


def test_every_command_has_its_faults():
    names = {task.name for task in tasks(False)}
    assert {f"{fault}-{name}" for fault in ("disk", "closed", "memory", "writers") for name in (
        "render", "compare", "sequence", "checkpoint")} <= names
    assert {"cache", "starts"} <= names
    assert MEMORY_MIB[False][0] == 0


def test_nothing_stays_mounted():
    mounted = subprocess.run(["mount"], capture_output=True, text=True, check=False).stdout
    assert not [line for line in mounted.splitlines() if line.startswith("refgi on")]

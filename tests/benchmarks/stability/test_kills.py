"""Killed commands: what is torn, lost, left or says nothing is found, in commands made for it; and refgi's own way."""

import os
import signal
import subprocess
import sys
import time

import pytest

from benchmarks.stability import kills
from benchmarks.stability.kills import VICTIMS, Found, Victim, asked, killed, prepared, rows_of
from refgi.image import write_text
from refgi.image.whole import TEMPORARY, is_dead, remove_dead, temporary_name, whole_file

# a command of a tenth of a second that writes one file most of that time
COMMAND = """
MODULES.clear()
import pathlib, time
from refgi.image.whole import temporary_name
from refgi.cli.group import VerbGroup
import click
TEXT = '{"a": 1}'
def command(arguments):
    global TEXT
    if arguments == ["old"]:
        TEXT = '{"a": 0}'
    group = VerbGroup("refgi")
    @click.command("work")
    @click.pass_context
    def work(ctx):
        write(pathlib.Path("out/a.json"))
    VerbGroup.get_command = lambda *_: work
    group.main(["work"])
def slowly(file, name):
    for letter in TEXT:
        file.write(letter)
        file.flush()
        time.sleep(0.02)
def write(path):
    from refgi.image import whole_file
    with whole_file(path) as part:
        with part.open("w") as file:
            slowly(file, part)
"""
TORN = """
def write(path):
    with path.open("w") as file:
        slowly(file, path)
"""
LOSES = """
def write(path):
    path.unlink(missing_ok=True)
    time.sleep(0.4)  # most of its time, also beside other work
    path.write_text(TEXT)
"""
LEAVES = """
def write(path):
    part = path.with_name(f".a.{time.monotonic()}.part.json")
    part.write_text(TEXT)
    time.sleep(0.1)
    part.replace(path)
"""
OTHER = """
def write(path):
    turn = pathlib.Path("turn")
    with turn.open("a") as file:
        file.write("x")
    if len(turn.read_text()) < 4:
        path.write_text(TEXT)
"""
DEAF = """
import signal
def write(path):
    time.sleep(0.2)  # in which the host sees that it heeds signals
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, signal.SIG_DFL)
    time.sleep(1.0)
    path.write_text(TEXT)
"""
SPEAKS = """
def write(path):
    try:
        time.sleep(2.5)  # most of its time, also where the host was measured beside other work
    except BaseException:
        raise ValueError("by the way")
    path.write_text(TEXT)
"""


@pytest.fixture(autouse=True)
def _fake(monkeypatch):
    monkeypatch.setitem(VICTIMS, "fake", Victim(["work"], patch=COMMAND, before=("old",)))
    monkeypatch.setattr("benchmarks.stability.kills.digest", lambda file: file.read_text())


@pytest.mark.slow
@pytest.mark.parametrize(("patch", "wrong"), [("", set()), (TORN, {"torn"}), (LOSES, {"lost"}), (LEAVES, {"left"}),
                                              (OTHER, {"other"})], ids=["sound", "torn", "loses", "leaves", "other"])
def test_what_kills_do_is_counted(patch, wrong):
    with prepared("fake", patch) as victim:
        found = killed(victim, 5, 1)
    assert {name for name in ("torn", "lost", "other", "left") if getattr(found, name)} - wrong <= {"other"} & wrong
    assert all(getattr(found, name) for name in wrong), found
    assert found.kills == 5
    assert patch or found.began > 0


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_command_that_heeds_a_signal_and_those_that_do_not(number):
    with prepared("fake") as victim:
        assert asked(victim, number, 2, 1) == []
    with prepared("fake", DEAF) as victim:
        assert asked(victim, number, 3, 1)  # one of them in the second third of its work
    with prepared("fake", SPEAKS) as victim:
        said = asked(victim, number, 4, 1)
    assert said
    assert "by the way" in said[0]


def test_rows_fail_where_files_are_torn_lost_other_or_left():
    rows = list(rows_of("render", Found(9, 1, 0, 0, 0, 3), "again"))
    assert [row.passed for row in rows] == [False, True, True]
    assert [[row.passed for row in rows_of("render", Found(9, *broken, 3), "again")]
            for broken in ((0, 2, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1), (0, 0, 0, 0))] == [
        [False, True, True], [True, False, True], [True, True, False], [True, True, True]]
    assert {row.key for row in rows} == {("kills", row.property, "render", "") for row in rows}


@pytest.mark.slow
def test_full_and_short_runs_have_their_kills():
    assert sum(kills.TIMES.values()) + kills.BATCH_TIMES == 200
    assert sum(kills.SHORT_TIMES.values()) == 4
    assert {task.name for task in kills.tasks(False)} == {*VICTIMS, "batch"} - {"fake"} == {*kills.TIMES, "batch"}
    assert [task.name for task in kills.tasks(True)] == list(kills.SHORT_TIMES)


def test_unfinished_files_of_dead_writers_are_removed_and_no_others(tmp_path):
    path = tmp_path / "a.b.exr"
    living = temporary_name(path)
    code = "import sys; from refgi.image import temporary_name; t = temporary_name(sys.argv[1]); t.touch(); print(t)"
    code = code.replace("sys.argv[1]", "__import__('pathlib').Path(sys.argv[1])")
    done = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True)
    dead = tmp_path / done.stdout.strip().rpartition("/")[2]
    elsewhere = tmp_path / TEMPORARY.sub(lambda m: m[0].replace(m["machine"], "0" * 8), dead.name)
    foreign = [tmp_path / name for name in ("mine.part.exr", ".a.part", ".x.12345678-1-1234567.part", "a.json")]
    for file in (living, elsewhere, *foreign):
        file.touch()
    assert dead.exists()
    assert is_dead(dead.name)
    assert not any(is_dead(file.name) for file in (living, elsewhere, *foreign))
    remove_dead.cache_clear()
    write_text(tmp_path / "new.json", "{}")
    assert sorted(tmp_path.iterdir()) == sorted([living, elsewhere, *foreign, tmp_path / "new.json"])


def test_a_folder_is_searched_for_unfinished_files_once(tmp_path, monkeypatch):
    remove_dead.cache_clear()
    searched, scandir = [], os.scandir
    monkeypatch.setattr(os, "scandir", lambda path: searched.append(path) or scandir(path))
    for _ in range(3):
        with whole_file(tmp_path / "a.json") as part:
            part.write_text("{}")
    assert searched.count(tmp_path) == 1


def test_the_checkpoint_of_a_dead_writer_is_removed(tmp_path):
    from refgi.truth.checkpoint import Checkpoint

    code = ("import os, sys, pathlib; from refgi.truth.checkpoint import _temporary\n"
            "with _temporary(pathlib.Path(sys.argv[1]), b'x'): os._exit(0)")
    subprocess.run([sys.executable, "-c", code, str(tmp_path / "c.truth")], check=True)
    assert [is_dead(file.name) for file in tmp_path.iterdir()] == [True]
    remove_dead.cache_clear()
    Checkpoint(tmp_path / "c.truth", b"n" * 32, 5)
    assert list(tmp_path.iterdir()) == []


def test_sigterm_ends_the_command_in_one_line_and_is_as_before_afterwards(monkeypatch, capsys):
    from refgi.cli.group import VerbGroup

    before = signal.getsignal(signal.SIGTERM)

    def terminate():
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(5)

    monkeypatch.setattr("refgi.scene.builtin_scenes", terminate)
    with pytest.raises(SystemExit) as end:
        VerbGroup.refgi().main(["scenes", "--json"])
    said = capsys.readouterr()
    assert end.value.code == 143
    assert said.err == "refgi: terminated\n"
    assert '"code":143' in said.out.replace(" ", "")
    assert signal.getsignal(signal.SIGTERM) == before

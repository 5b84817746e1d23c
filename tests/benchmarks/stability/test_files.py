"""Spoiled files in processes of their own: a reader that breaks the promise is caught, whatever it does."""

import json
import os
import sys
import time
import warnings

import numpy as np
import pytest

from benchmarks.stability import files, written_promises
from benchmarks.stability.bombs import BOMBS, exr_bytes
from benchmarks.stability.file_child import BOMB, MOST_BYTES, Breach, breach_of, kinds, read_in_children, unclear
from benchmarks.stability.file_formats import FORMATS, Format, mutated
from refgi.errors import LONGEST_MESSAGE, InputError, first_faults
from refgi.image import read_exr
from refgi.scene import load_scene


def faulty(path):
    """Break the promise in another way by number, at the numbers that `NUMBERED` gives."""
    number = int(path.read_text())
    if number in (3, 8):  # 8: behind one that ends the process
        raise ValueError("not refgi's")
    if number == 5:
        os._exit(7)
    if number == 7:
        os.kill(os.getpid(), 11)
    if number == 9:
        while True:  # a hang that no exception ends
            pass
    if number == 11:
        raise InputError("no word of the file")
    if number == 12:
        warnings.warn("of Python", DeprecationWarning, stacklevel=1)
    if number == 13:
        os.write(2, b"from a library")
    if number == 14:
        np.ones(1 << 33)
    if number % 2:
        raise InputError(f"{path}: refused")


def numbered():
    return [str(number).encode() for number in range(16)]


FAULTY = Format("number.txt", numbered, faulty)


@pytest.mark.slow
def test_every_breach_is_found_and_the_others_are_read(monkeypatch):
    monkeypatch.setattr("benchmarks.stability.file_child.CHILD", [
        "-c", "import sys; import benchmarks.stability.file_child as c; c.SECONDS = 1; "
        "c.mutated = lambda content, _: content; sys.exit(c.main(sys.argv[1:]))"])
    found = read_in_children(f"{__name__}:FAULTY", 0, range(1, 16))
    assert [(breach.number, breach.kind) for breach in found] == [
        (3, "ValueError"), (5, "death"), (7, "death"), (8, "ValueError"), (9, "hang"), (11, "unnamed"),
        (12, "DeprecationWarning"), (13, "noise"), (14, "MemoryError")]
    assert "exit 7" in found[1].text
    assert "SIGSEGV" in found[2].text


@pytest.mark.slow
def test_a_reader_that_fails_on_sound_files_is_an_error(monkeypatch):
    monkeypatch.setattr("benchmarks.stability.file_child.CHILD", ["-c", "raise SystemExit(3)"])
    with pytest.raises(RuntimeError, match="cannot be read at all"):
        read_in_children("glb", 0, range(2))


@pytest.mark.slow
@pytest.mark.parametrize(("text", "fault"), [
    ("a.obj: no", ""), ("a.obj: no\na.obj: neither", ""), ("a.obj: no\n... and 7 more", ""), ("no", "unnamed"),
    ("a.obj: no\nand no", "unnamed"), ("", "unnamed"), ("a.obj: " + "x" * MOST_BYTES, "long"),
    ("a.obj: \ud800", "not printable"), ("a.obj: no\u2028line", "unnamed")])
def test_a_refusal_is_clear_or_not(text, fault):
    assert unclear(text, {"a.obj"}) == fault


def test_a_long_warning_is_a_breach(tmp_path):
    from refgi.errors import RefgiWarning

    for length, kind in ((20, None), (3000, "long warning")):
        def read(_, length=length):
            warnings.warn(RefgiWarning("x" * length), stacklevel=1)

        found = breach_of(Format("a", list, read), tmp_path / "a")
        assert (found and found[0]) == kind


@pytest.mark.slow
@pytest.mark.parametrize("name", FORMATS)
def test_mutations_are_the_same_again_and_mostly_others(name):
    for content in FORMATS[name].seeds():
        made = [[mutated(content, np.random.default_rng([1, k])) for k in range(30)] for _ in range(2)]
        assert made[0] == made[1]
        assert len(set(made[0])) > 15


def test_rows_count_breaches_and_say_how_to_see_the_first(monkeypatch):
    breaches = [Breach(4, "hang", "more than 10 s"), Breach(9, "hang", "more than 10 s"), Breach(11, "death", "x")]
    monkeypatch.setattr(files, "read_in_children", lambda *_, **__: breaches)
    (row,) = files.tasks(True)[0].run(lambda _: None)
    assert (row.figure, row.limit, row.passed, row.cases, row.seed) == (3, 0, False, 200, files.SEED)
    assert row.reproduce.endswith("again files glb 4")
    assert row.detail.startswith("2 hang, 1 death; 4: ")
    assert kinds([]) == ""
    promised = {one.name for one in written_promises.PROMISES}
    assert {task.name for task in files.tasks(False)} == {*FORMATS, *(f"{name}-bombs" for name in BOMBS)} | promised


@pytest.mark.slow
def test_again_reads_one_file(capsys):
    from benchmarks.stability.again import of_file as main

    assert main(["gltf", "30"]) == 0
    said = capsys.readouterr()
    assert "refused in" in said.out
    assert "buffers[0].uri" in said.err


# what the mutations found: each in the smallest file that shows it

def refusal(path, content, read=load_scene):
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InputError) as caught:
        read(path)
    assert unclear(str(caught.value), {path.name}) == ""
    return str(caught.value)


def test_a_damaged_picture_of_another_program_is_refused_and_nothing_printed(tmp_path, capfd):
    """Rows that OpenEXR cannot decode it leaves black; it says so on stderr alone."""
    content = FORMATS["exr"].seeds()[2]  # PIZ
    head = content.index(b"screenWindowWidth")
    damaged = bytearray(content)
    damaged[head + 60 : head + 160] = b"\xff" * 100
    refusal(tmp_path / "a.exr", bytes(damaged), read_exr)
    refusal(tmp_path / "b.exr", exr_bytes((0, 0, 99, 99)), read_exr)
    assert capfd.readouterr() == ("", "")


def test_a_picture_of_which_its_library_complains_is_refused(tmp_path, monkeypatch):
    """Whatever is printed while pixels are read is damage, even where no exception comes of it."""
    import OpenEXR

    class Complaining(OpenEXR.File):
        def __init__(self, *args, header_only=False, **kwargs):
            super().__init__(*args, header_only=header_only, **kwargs)
            if not header_only:
                os.write(2, b"cannot decode row 3\n")

    (tmp_path / "a.exr").write_bytes(FORMATS["exr"].seeds()[1])
    read_exr(tmp_path / "a.exr")
    monkeypatch.setattr(OpenEXR, "File", Complaining)
    with pytest.raises(InputError, match=r"a\.exr: not a readable EXR: cannot decode row 3"):
        read_exr(tmp_path / "a.exr")


def test_memory_is_what_a_limit_leaves(monkeypatch):
    import resource

    from refgi.memory import physical_memory

    present = physical_memory()
    monkeypatch.setattr(resource, "getrlimit", lambda _: (12345, 12345))
    assert physical_memory() == 12345.0
    monkeypatch.setattr(resource, "getrlimit", lambda _: (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    assert physical_memory() >= present > 12345


def test_stderr_is_what_it_was_after_a_picture_is_read(tmp_path, capfd):
    (tmp_path / "a.exr").write_bytes(FORMATS["exr"].seeds()[0])
    read_exr(tmp_path / "a.exr")
    os.write(2, b"said")
    assert capfd.readouterr().err == "said"


@pytest.mark.parametrize("text", ["[sii]\nlights = " + "9" * 5000, "[sii]\nlights = " + "9" * 400,
                                  "[sii]\n" + "x" * 5000 + " = 1", "a = " + "[" * 100_000,
                                  "".join(f"[t{k}]\n" for k in range(3000))])
def test_numbers_and_keys_beyond_measure_in_a_grid(tmp_path, text):
    refusal(tmp_path / "grid.toml", text, FORMATS["grid"].read)


def test_keys_with_ends_of_line(tmp_path):
    for key in ("x\ny", "x\u2028y", "x\r", "\x1b[2J"):
        said = refusal(tmp_path / "a.json", json.dumps({key: 1}))
        assert "\x1b" not in said
    assert "square.bin" not in refusal(tmp_path / "a.gltf", FORMATS["gltf"].seeds()[0].replace(b"data:", b"dat:"))


@pytest.mark.filterwarnings("ignore::refgi.errors.RefgiWarning")
def test_a_mesh_too_far_for_a_camera_that_fits_it_is_refused_by_name(tmp_path):
    refusal(tmp_path / "far.obj", "v 9e8 9e8 9e8\nv 1 0 0\nv 1 1 0\nf 1 2 3\n")


@pytest.mark.parametrize("suffix", ["obj", "ply", "gltf", "json"])
def test_a_file_larger_than_memory_is_not_read(tmp_path, suffix):
    path = tmp_path / f"a.{suffix}"
    with path.open("wb") as file:
        file.truncate(1 << 42)
    begin = time.process_time()
    with pytest.raises(InputError, match="fits in memory"):
        load_scene(path)
    assert time.process_time() - begin < 1  # CPU seconds; reading 4 TB would take an hour


def test_no_memory_for_a_scene_is_a_refusal(tmp_path, monkeypatch):
    def none(*_):
        raise MemoryError

    monkeypatch.setattr("refgi.scene.load.read_mesh_file", none)
    with pytest.raises(InputError, match=r"a\.obj: does not fit in memory"):
        load_scene(tmp_path / "a.obj")


def test_faults_fit_in_two_kilobytes_and_the_others_are_counted():
    text = first_faults([f"file: fault {'x' * 300} {k}" for k in range(50)])
    assert len(text.encode()) <= LONGEST_MESSAGE
    shown = text.splitlines()
    assert shown[-1] == f"... and {50 - (len(shown) - 1)} more"
    assert len(str(InputError("é" * 5000)).encode()) <= LONGEST_MESSAGE


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="RLIMIT_AS is Linux's")
def test_a_bomb_in_a_child():
    number = list(BOMBS["checkpoint"]).index("4 TB")
    assert read_in_children("checkpoint", BOMB, range(number, number + 1)) == []

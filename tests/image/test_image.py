"""EXR and PNG files: every bit kept, damage found, a kill leaves whole files or none."""

import json
import os
import signal
import subprocess
import sys
import time

import imageio.v3
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from refgi.errors import InputError, RefgiWarning
from refgi.image import (
    canonical_json,
    read_exr,
    read_png_attributes,
    tone_map,
    whole_file,
    write_exr,
    write_png,
    write_text,
)
from refgi.image.whole import temporary_name


def bits(plane):
    return plane.view(np.uint32)


@pytest.fixture
def planes():
    rng = np.random.default_rng(5)
    return {"R": rng.random((7, 5), np.float32), "deep.distance": np.full((7, 5), np.inf, np.float32),
            "id": rng.integers(0, 2**32, (7, 5), dtype=np.uint32)}


@settings(max_examples=60, deadline=None)
@given(pattern=hnp.arrays(np.uint32, hnp.array_shapes(min_dims=2, max_dims=2, max_side=9)))
def test_every_bit_pattern_survives_an_exr(pattern, tmp_path_factory):
    """Property: NaN payloads, infinities, -0 and subnormals read back as written."""
    path = tmp_path_factory.mktemp("exr") / "a.exr"
    write_exr(path, {"x": pattern.view(np.float32)}, {})
    assert np.array_equal(bits(read_exr(path)[0]["x"]), pattern)


def test_strided_planes_are_written_right(tmp_path):
    """OpenEXR itself writes wrong pixels from a transposed or sliced array."""
    image = np.random.default_rng(1).random((6, 4, 3), np.float32)
    write_exr(tmp_path / "a.exr", {"R": image[..., 0], "G": image[::-1, :, 1], "B": image[..., 2].T.copy().T}, {})
    read, _ = read_exr(tmp_path / "a.exr")
    assert np.array_equal(read["R"], image[..., 0])
    assert np.array_equal(read["G"], image[::-1, :, 1])
    assert np.array_equal(read["B"], image[..., 2])


def test_attributes_come_back_and_are_canonical(planes, tmp_path):
    import OpenEXR

    attributes = {"units": {"R": "W/m^2"}, "big": 2**40, "exact": 0.1, "text": "größe"}
    write_exr(tmp_path / "a.exr", planes, attributes)
    assert read_exr(tmp_path / "a.exr")[1] == attributes
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        text = file.header()["refgi"]
    stored = json.loads(text)
    assert text == json.dumps(stored, sort_keys=True, separators=(",", ":"))
    assert len(stored.pop("sha256")) == 64


def test_equal_input_gives_equal_files(planes, tmp_path):
    write_exr(tmp_path / "a.exr", planes, {"b": 1, "a": 2})
    write_exr(tmp_path / "b.exr", dict(reversed(planes.items())), {"a": 2, "b": 1})
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()


@pytest.mark.parametrize(("channels", "word"), [
    ({}, "at least one"),
    ({"R": np.zeros((2, 2))}, "float64"),
    ({"R": np.zeros((0, 2), np.float32)}, "shape"),
    ({"R": np.zeros((2, 2), np.float32), "G": np.zeros((2, 3), np.float32)}, "'G'"),
    ({"R": np.zeros(4, np.float32)}, "shape"),
])
def test_unusable_planes_are_named(channels, word, tmp_path):
    with pytest.raises(InputError, match=word):
        write_exr(tmp_path / "a.exr", channels, {})
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("attributes", [{"x": float("nan")}, {"x": np.float32(1)}, {"sha256": "mine"}])
def test_unusable_attributes_are_refused(attributes, planes, tmp_path):
    with pytest.raises(InputError, match="attributes"):
        write_exr(tmp_path / "a.exr", planes, attributes)


@pytest.mark.parametrize("name", ["a.tiff", "a.png", "a", "exr"])
def test_other_suffixes_are_refused(name, planes, tmp_path):
    with pytest.raises(InputError, match=r"\.exr"):
        write_exr(tmp_path / name, planes, {})


def test_a_missing_or_foreign_file_is_an_input_error(tmp_path):
    with pytest.raises(InputError, match=r"none\.exr"):
        read_exr(tmp_path / "none.exr")
    (tmp_path / "text.exr").write_text("not an EXR")
    with pytest.raises(InputError, match="not a readable EXR"):
        read_exr(tmp_path / "text.exr")


def test_another_programs_exr_is_read_without_attributes(tmp_path):
    import OpenEXR

    plane = np.arange(6, dtype=np.float32).reshape(2, 3)
    OpenEXR.File({"type": OpenEXR.scanlineimage}, {"Y": plane}).write(str(tmp_path / "a.exr"))
    channels, attributes = read_exr(tmp_path / "a.exr")
    assert np.array_equal(channels["Y"], plane)
    assert attributes == {}


def test_a_file_cut_short_anywhere_is_refused(planes, tmp_path, capfd):
    write_exr(tmp_path / "whole.exr", planes, {"a": 1})
    whole = (tmp_path / "whole.exr").read_bytes()
    for length in {*range(0, len(whole), 23), len(whole) - 1}:
        (tmp_path / "cut.exr").write_bytes(whole[:length])
        with pytest.raises(InputError, match=r"cut\.exr"):
            read_exr(tmp_path / "cut.exr")
    capfd.readouterr()


def test_flipped_bits_are_found_or_harmless(planes, tmp_path, capfd):
    """A flip may hit a header field without meaning for the pixels; wrong pixels never come back."""
    write_exr(tmp_path / "whole.exr", planes, {"a": 1})
    whole = (tmp_path / "whole.exr").read_bytes()
    rng = np.random.default_rng(11)
    for _ in range(200):
        damaged = bytearray(whole)
        damaged[rng.integers(len(whole))] ^= 1 << rng.integers(8)
        (tmp_path / "bad.exr").write_bytes(damaged)
        try:
            channels, _ = read_exr(tmp_path / "bad.exr")
        except InputError:
            continue
        assert {n: c.tobytes() for n, c in channels.items()} == {n: c.tobytes() for n, c in planes.items()}
    capfd.readouterr()


def test_a_write_that_reads_back_different_is_an_error_and_leaves_nothing(planes, tmp_path, monkeypatch):
    monkeypatch.setattr("refgi.image.exr.read_exr", lambda _: ({"R": planes["R"] + 1}, {}))
    with pytest.raises(InputError, match="reads back different"):
        write_exr(tmp_path / "a.exr", planes, {})
    assert not list(tmp_path.iterdir())


def test_srgb_curve_against_the_standard():
    """Analytic: IEC 61966-2-1, both branches, rounding to nearest; 0.18 is the 118 of every grey card."""
    linear = np.array([0.0, 0.0031308, 0.18, 0.2158605, 0.5, 1.0, 7.0, -1.0])
    got = tone_map(np.repeat(linear[:, None], 3, axis=1))[:, 0]
    assert got.tolist() == [0, 10, 118, 128, 188, 255, 255, 0]


@given(st.floats(0, 4), st.floats(0.01, 100))
def test_exposure_is_a_factor_before_the_curve(value, exposure):
    pixel = np.full((1, 3), value)
    assert np.array_equal(tone_map(pixel, exposure), tone_map(pixel * exposure, 1.0))


def test_a_png_holds_the_tone_mapped_pixels(tmp_path):
    image = np.random.default_rng(2).random((5, 4, 3), np.float32)
    write_png(tmp_path / "a.png", image, 0.5)
    assert np.array_equal(imageio.v3.imread(tmp_path / "a.png"), tone_map(image, 0.5))


def test_non_finite_pixels_are_magenta_and_counted(tmp_path):
    image = np.full((4, 5, 3), 0.25)
    image[1, 2, 0], image[3, 3, 2] = np.nan, np.inf
    with pytest.warns(RefgiWarning, match="2 of 20"):
        write_png(tmp_path / "a.png", image)
    read = imageio.v3.imread(tmp_path / "a.png")
    assert [tuple(p) for p in read[[1, 3], [2, 3]].tolist()] == [(255, 0, 255)] * 2


@pytest.mark.parametrize(("name", "image", "exposure"), [
    ("a.jpg", np.zeros((2, 2, 3)), 1), ("a.exr", np.zeros((2, 2, 3)), 1), ("a.png", np.zeros((2, 2)), 1),
    ("a.png", np.zeros((2, 2, 3)), 0.0), ("a.png", np.zeros((2, 2, 3)), float("nan")),
])
def test_unusable_png_arguments_are_refused(name, image, exposure, tmp_path):
    with pytest.raises(InputError):
        write_png(tmp_path / name, image, exposure)
    assert not list(tmp_path.iterdir())


def test_a_folder_that_is_not_there_is_an_input_error(planes, tmp_path):
    with pytest.raises(InputError, match="cannot be written"):
        write_exr(tmp_path / "no" / "a.exr", planes, {})
    with pytest.raises(InputError, match="cannot be written"):
        write_text(tmp_path / "no" / "a.json", "{}")


@pytest.mark.parametrize("name", ["a" * 251 + ".exr", "ß" * 125 + ".exr"])
def test_a_name_as_long_as_the_file_system_takes(name, planes, tmp_path):
    write_exr(tmp_path / name, planes, {})
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_names_that_are_too_long_or_not_text_are_input_errors(planes, tmp_path):
    with pytest.raises(InputError, match="cannot be written"):
        write_text(tmp_path / ("a" * 300), "{}")
    with pytest.raises(InputError, match="UTF-8"):
        write_exr(tmp_path / "a\udcff.exr", planes, {})
    assert not list(tmp_path.iterdir())


def test_a_failed_write_leaves_the_old_file(tmp_path):
    write_text(tmp_path / "a.json", "old")

    def fail_halfway():
        with whole_file(tmp_path / "a.json") as temporary:
            temporary.write_text("half")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail_halfway()
    assert (tmp_path / "a.json").read_text() == "old"
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.skipif(os.name == "nt", reason="Windows does not replace an open file")
def test_a_file_is_replaced_and_never_written_over(tmp_path):
    """Whoever has the old file open reads the old file: no moment shows a mixture."""
    write_text(tmp_path / "a.json", "old")
    with (tmp_path / "a.json").open() as reader:
        write_text(tmp_path / "a.json", "newer")
        assert reader.read() == "old"
    assert (tmp_path / "a.json").read_text() == "newer"


def test_a_png_says_what_it_was_told_and_shows_the_same(tmp_path):
    """Against Pillow, which reads the text and would refuse a chunk of a wrong length or checksum."""
    from PIL import Image

    rgb = np.random.default_rng(1).random((5, 7, 3), np.float32)
    write_png(tmp_path / "a.png", rgb, attributes={"b": [1, None], "a": "größe"})
    with Image.open(tmp_path / "a.png") as picture:
        picture.verify()
        assert picture.info == {"refgi": '{"a":"gr\\u00f6\\u00dfe","b":[1,null]}'}
    assert read_png_attributes(tmp_path / "a.png") == {"a": "größe", "b": [1, None]}
    assert np.array_equal(imageio.v3.imread(tmp_path / "a.png"), tone_map(rgb))


def test_a_damaged_exr_is_refused_without_a_word_on_stdout(tmp_path, capsys):
    write_exr(tmp_path / "a.exr", {"R": np.ones((2, 2), np.float32)})
    (tmp_path / "a.exr").write_bytes((tmp_path / "a.exr").read_bytes()[:-20])
    with pytest.raises(InputError, match=r"a\.exr"):
        read_exr(tmp_path / "a.exr")
    assert capsys.readouterr().out == ""


def test_canonical_json_does_not_depend_on_the_order_of_keys():
    assert canonical_json({"b": [1, 2.5], "a": {"d": None, "c": True}}) == '{"a":{"c":true,"d":null},"b":[1,2.5]}'


WRITER = """
import sys, numpy as np
from refgi.image import write_exr
noise = np.random.default_rng(0).random((256, 256), np.float32)
print("ready", flush=True)
for n in range(10**6):
    write_exr(sys.argv[1], {"R": noise, "n": np.full((256, 256), n, np.float32)}, {"n": n})
"""


@pytest.mark.skipif(os.name == "nt", reason="SIGKILL is POSIX")
def test_a_kill_leaves_a_whole_file(tmp_path, evidence):
    """Killed at twelve moments while it overwrites one file: the file is whole each time."""
    path, seen = tmp_path / "a.exr", []
    for round_ in range(12):
        writer = subprocess.Popen([sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE)
        assert writer.stdout.readline() == b"ready\n"
        time.sleep(0.05 + 0.013 * round_)
        writer.send_signal(signal.SIGKILL)
        writer.wait()
        writer.stdout.close()
        if path.exists():
            channels, attributes = read_exr(path)
            assert (channels["n"] == attributes["n"]).all()
            seen.append(attributes["n"])
    assert seen
    evidence(f"{len(seen)} of {len(seen)} files whole after kill -9")


def test_folders_of_killed_processes_are_removed_and_those_of_living_ones_stay(tmp_path):
    code = ("import os, sys; from pathlib import Path; from refgi.image.whole import temporary_name\n"
            "part = temporary_name(Path(sys.argv[1])); part.mkdir(); (part / 'file').touch(); os.kill(os.getpid(), 9)")
    (mine := temporary_name(tmp_path / "kit")).mkdir()
    for _ in range(2):
        done = subprocess.run([sys.executable, "-c", code, str(tmp_path / "kit")], check=False)
        assert done.returncode == -signal.SIGKILL
        left = set(tmp_path.iterdir())
        assert len(left) == 2
        assert mine in left

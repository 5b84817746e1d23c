"""Checkpoints: a killed run ends with the same bits, a damaged file is one clear error, a full disk loses nothing."""

import dataclasses
import errno
import os
import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import pytest

import refgi
from refgi.errors import InputError, RefgiWarning
from refgi.frame import Frame
from refgi.scene import load_scene
from refgi.truth import TruthSettings, checkpoint, trace_truth
from refgi.truth.checkpoint import DIGEST, FIRST_LINE, Checkpoint, _digest
from refgi.truth.result import add_pass
from refgi.truth.tails import BINS

ROOT, SIZE, VALUES, BLOCKS = Path(__file__).parents[2], 24, 5, 1
NAME = b"n" * DIGEST
HEAD = len(FIRST_LINE) + 2 * DIGEST


@pytest.fixture(scope="module")
def frame():
    return Frame(load_scene("cornell_box"), width=SIZE, height=SIZE)


def passes_in(file):
    return int(np.frombuffer(file.read_bytes(), "<i8", 1, HEAD)[0])


def saved(file, passes=3):
    """Write a checkpoint of a few passes and return its moments."""
    made = Checkpoint(file, NAME, VALUES, BLOCKS)
    random = np.random.default_rng(2)
    for _ in range(passes):
        add_pass(made.moments, random.random((3, VALUES)), np.zeros(3, np.int64))
    made.save()
    return made.moments


KILLED = """
import sys
from refgi.frame import Frame
from refgi.scene import load_scene
from refgi.truth import TruthSettings, checkpoint, trace_truth
checkpoint.SECONDS_BETWEEN = 0
frame = Frame(load_scene("cornell_box"), width=24, height=24)
trace_truth(frame, TruthSettings(samples=24 * 100000, checkpoint=sys.argv[1]))
"""


@pytest.mark.feature("REF-19")
def test_a_killed_run_goes_on_from_its_last_pass(frame, tmp_path, evidence):
    file = tmp_path / "truth.checkpoint"
    child = subprocess.Popen([sys.executable, "-c", KILLED, str(file)], cwd=ROOT)
    deadline = time.monotonic() + 120
    while not file.exists() and time.monotonic() < deadline and child.poll() is None:
        time.sleep(0.02)
    child.send_signal(signal.SIGKILL)
    child.wait()
    done = passes_in(file)
    assert done >= 1
    settings = TruthSettings(samples=24 * (done + 3), checkpoint=file)
    resumed = trace_truth(frame, settings)
    straight = trace_truth(frame, dataclasses.replace(settings, checkpoint=None))
    assert resumed.passes == straight.passes == done + 3
    assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(resumed, straight, strict=True))
    evidence(f"killed after pass {done}, went on for 3: equal bits")


def test_what_is_read_is_what_was_saved(tmp_path):
    file = tmp_path / "c"
    moments = saved(file)
    again = Checkpoint(file, NAME, VALUES, BLOCKS).moments
    assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(moments, again, strict=True))
    assert again.mean.dtype == np.float64
    assert again.mean.flags.writeable
    assert again.mean.flags.c_contiguous
    assert file.stat().st_size == HEAD + 8 * (2 + 27 * VALUES) + 4 * (8 * VALUES + BLOCKS * BINS)
    assert again.tails.sum() == 6  # three values of each pass but the first
    assert again.scale > 0


def test_a_file_of_before_tails_is_refused(tmp_path):
    file = tmp_path / "c"
    moments = saved(file)
    content = b"".join(field.tobytes() for field in moments[:4])
    old = b"refgi truth checkpoint 2\n"
    file.write_bytes(old + NAME + _digest(NAME, content) + content)
    with pytest.raises(InputError, match="expected a checkpoint file of this version"):
        Checkpoint(file, NAME, VALUES, BLOCKS)


@pytest.mark.parametrize("change", [{"seed": 3}, {"interleave": 2}, {"uniform_share": 1.0}, {"light_grid": 16},
                                    {"visibility": False}, {"picks": 8}, {"directions": 4}, {"bound": 0.2},
                                    {"estimator": "light"}, {"emitters": "visible"}, {"bounces": 2},
                                    {"caustics": True}])
def test_a_checkpoint_of_something_else_is_refused(frame, tmp_path, change):
    settings = TruthSettings(samples=48, checkpoint=tmp_path / "c")
    trace_truth(frame, settings)
    with pytest.raises(InputError, match="another's"):
        trace_truth(frame, dataclasses.replace(settings, **change))


def test_a_checkpoint_of_another_picture_or_version_is_refused(frame, tmp_path, monkeypatch):
    settings = TruthSettings(samples=48, checkpoint=tmp_path / "c")
    trace_truth(frame, settings)
    with pytest.raises(InputError, match="another's"):
        trace_truth(Frame(frame.scene, width=SIZE, height=SIZE - 8), settings)
    monkeypatch.setattr(refgi, "__version__", "0.0.9")
    with pytest.raises(InputError, match="version of refgi"):
        trace_truth(frame, settings)


def test_a_folder_keeps_each_truth_once_and_nothing_is_traced_again(frame, tmp_path, monkeypatch):
    module = sys.modules["refgi.truth.truth"]

    settings = TruthSettings(samples=48, checkpoint=tmp_path)
    first = trace_truth(frame, settings)
    other = trace_truth(frame, dataclasses.replace(settings, visibility=False))
    assert len(list(tmp_path.iterdir())) == 2
    for name in ("one_pass", "pilot"):
        monkeypatch.setattr(module, name, lambda *_: pytest.fail("traced again"))
    for visibility, before in ((True, first), (False, other)):
        again = trace_truth(Frame(frame.scene, width=SIZE, height=SIZE),
                            dataclasses.replace(settings, visibility=visibility))
        assert np.array_equal(again.mean, before.mean)
        assert np.array_equal(again.variance_of_mean, before.variance_of_mean)


def test_a_folder_s_truth_goes_on_to_the_same_bits(frame, tmp_path):
    trace_truth(frame, TruthSettings(samples=48, checkpoint=tmp_path))
    more = trace_truth(frame, TruthSettings(samples=96, checkpoint=tmp_path))
    straight = trace_truth(frame, TruthSettings(samples=96))
    assert more.passes == straight.passes == 4
    assert np.array_equal(more.mean, straight.mean)
    assert len(list(tmp_path.iterdir())) == 1


def test_when_it_stops_makes_no_other_computation(frame, tmp_path):
    settings = TruthSettings(samples=48, checkpoint=tmp_path / "c")
    trace_truth(frame, settings)
    more = trace_truth(frame, dataclasses.replace(settings, samples=72, batch=999, target_error=1e-9))
    assert more.passes == 3


def test_every_damage_is_one_clear_error(tmp_path, evidence):
    """Truncations, a flipped bit in each byte, bytes added, other files."""
    file = tmp_path / "c"
    saved(file)
    whole, random = file.read_bytes(), np.random.default_rng(7)
    mutations = [whole[:n] for n in range(len(whole))]
    for place in range(len(whole)):
        mutations.append(whole[:place] + bytes([whole[place] ^ (1 << place % 8)]) + whole[place + 1:])
    for _ in range(200):
        low, high = np.sort(random.integers(0, len(whole), 2))
        mutations += [whole[:low] + random.bytes(high - low) + whole[high:], whole[:low] + whole[high:],
                      whole[:high] + random.bytes(9) + whole[high:]]
    mutations += [b"", b"\0", whole + b"\0", b"PK\x03\x04" + whole[4:], whole[::-1]]
    tried = 0
    for mutation in mutations:
        if mutation == whole:
            continue
        file.write_bytes(mutation)
        with pytest.raises(InputError, match=r"checkpoint .*c: expected"):
            Checkpoint(file, NAME, VALUES, BLOCKS)
        tried += 1
    evidence(f"{tried} damaged files, one InputError each")


@pytest.mark.parametrize("fault", ["passes", "nan", "inf", "negative counts", "counts", "sums", "shape", "scale",
                                   "tails"])
def test_wrong_content_with_a_right_digest(tmp_path, fault):
    file = tmp_path / "c"
    moments = saved(file)
    passes, mean, sums, counts, scale, tails = (np.array(field) for field in moments)
    if fault == "passes":
        passes[...] = -1
    elif fault == "negative counts":
        counts[0, 0] = -1
    elif fault == "counts":
        counts[1, 0] = 2  # three passes: one each of three series
    elif fault == "scale":
        scale[...] = np.nan
    elif fault == "tails":
        tails[0, 3] = -1
    elif fault == "sums":
        sums[1, 0, 0] = np.nan
    elif fault == "shape":
        mean = mean[:, :-1]
    else:
        mean[0, 0] = {"nan": np.nan, "inf": np.inf}[fault]
    content = b"".join(field.tobytes() for field in (passes, mean, sums, counts, scale, tails))
    file.write_bytes(FIRST_LINE + NAME + _digest(NAME, content) + content)
    with pytest.raises(InputError, match="checkpoint"):
        Checkpoint(file, NAME, VALUES, BLOCKS)


def test_a_huge_file_is_not_read(tmp_path):
    file = tmp_path / "c"
    saved(file)
    with file.open("r+b") as handle:
        handle.truncate(1 << 42)  # sparse: 4 TB that nobody could hold
    with pytest.raises(InputError, match="whole file"):
        Checkpoint(file, NAME, VALUES, BLOCKS)


def test_a_place_that_cannot_be_written_is_refused_before_computing(frame, tmp_path, monkeypatch):
    from refgi.truth import passes

    blocking = tmp_path / "file"
    blocking.write_text("not a folder")
    for place in (blocking / "c", tmp_path / "none" / "c"):
        with pytest.raises(InputError, match="checkpoint"):
            trace_truth(frame, TruthSettings(samples=48, checkpoint=place))
    monkeypatch.setattr(passes, "one_pass", lambda *_: pytest.fail("computed first"))
    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(InputError, match="No space left"):
        trace_truth(frame, TruthSettings(samples=48, checkpoint=tmp_path / "c"))
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def full_disk(*_):
    raise OSError(errno.ENOSPC, "No space left on device")


def test_a_full_disk_loses_no_picture(frame, tmp_path, monkeypatch):
    settings = TruthSettings(samples=24 * 5, checkpoint=tmp_path / "c")
    trace_truth(frame, dataclasses.replace(settings, samples=48))
    before, straight = (tmp_path / "c").read_bytes(), trace_truth(frame, dataclasses.replace(settings, checkpoint=None))
    monkeypatch.setattr(checkpoint, "SECONDS_BETWEEN", 0)
    monkeypatch.setattr(Path, "replace", full_disk)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        result = trace_truth(frame, settings)
    assert [w.category for w in said] == [RefgiWarning]
    assert "still holds 2 passes" in str(said[0].message)
    assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(result, straight, strict=True))
    assert (tmp_path / "c").read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["c"]


def test_saves_are_ten_seconds_apart_and_at_the_end(tmp_path, monkeypatch):
    clock, replaced = [0.0], []
    monkeypatch.setattr(checkpoint.time, "monotonic", lambda: clock[0])
    replace = Path.replace
    monkeypatch.setattr(Path, "replace", lambda path, to: (replaced.append(clock[0]), replace(path, to))[1])
    made = Checkpoint(tmp_path / "c", NAME, VALUES, BLOCKS)
    assert not (tmp_path / "c").exists()
    for second in range(25):
        clock[0] = float(second)
        add_pass(made.moments, np.ones((3, VALUES)))
        made.save_when_due()
    made.save()
    made.save()  # nothing new
    assert replaced == [10.0, 20.0, 24.0]
    assert passes_in(tmp_path / "c") == 25


def test_a_folder_that_is_not_there_is_not_made(tmp_path):
    file = tmp_path / "missing" / "deep" / "ck"
    with pytest.raises(InputError, match="expected a file in a folder that is there") as caught:
        Checkpoint(file, NAME, VALUES, BLOCKS)
    assert str(file.parent) in str(caught.value)
    assert not list(tmp_path.iterdir())
    below = tmp_path / "file" / "ck"
    below.parent.write_text("no folder")
    with pytest.raises(InputError, match="expected a file in a folder that is there"):
        Checkpoint(below, NAME, VALUES, BLOCKS)

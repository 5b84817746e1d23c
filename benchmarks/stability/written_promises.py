"""Promises of what refgi writes: changed afterwards it is refused, replaced it is whole for who reads it, and pictures
show what is no light.

A file is replaced by a whole one under its name, so who opened it before reads the old one to its end.
"""

import os
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

import numpy as np
from numba import types

from benchmarks.stability.promise import Case, Promise
from refgi.errors import InputError
from refgi.image import read_exr, tone_map, write_exr, write_png, write_text
from refgi.jit.cache import KernelCache
from refgi.truth.checkpoint import Checkpoint
from refgi.truth.result import SERIES
from refgi.types import Array

COMPUTATION, VALUES = b"c" * 32, 6
MARK = "refgi"
MAGENTA = (255, 0, 255)
NO_LIGHT = (np.nan, np.inf, -np.inf)


def _planes(rng: np.random.Generator) -> dict[str, Array]:
    shape = tuple(rng.integers(1, 9, 2))
    return {name: rng.random(shape).astype(np.float32) for name in "RGB"[: rng.integers(1, 4)]}


def changed_picture(rng: np.random.Generator) -> Case:
    """Return 1 where an EXR is read though a pixel or an attribute is another, as by a program that keeps the rest."""
    import OpenEXR

    planes, attributes = _planes(rng), {"lights": int(rng.integers(1, 1000)), "unit": "W/m^2"}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "picture.exr"
        write_exr(path, planes, attributes)
        with OpenEXR.File(str(path), separate_channels=True) as file:
            header = dict(file.header())
            pixels = {name: np.array(channel.pixels) for name, channel in file.channels().items()}
        name = str(rng.choice(list(planes)))
        at = tuple(rng.integers(0, planes[name].shape))
        if rng.random() < 0.7:
            pixels[name].view(np.uint32)[at] ^= np.uint32(1 << int(rng.integers(0, 32)))
            what = f"pixel {[int(k) for k in at]} of {name}"
        else:
            header[MARK] = header[MARK].replace(f'"lights":{attributes["lights"]}', '"lights":1001')
            what = "an attribute"
        OpenEXR.File(header, pixels).write(str(path))
        return _taken(lambda: read_exr(path), f"EXR with {what} changed")


def changed_checkpoint(rng: np.random.Generator) -> Case:
    """Return 1 where a checkpoint is continued though one bit of its moments is another."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "passes.truth"
        content = bytearray(_saved(rng, path))
        numbers = 3 * VALUES * (1 + SERIES)  # means and sums; behind them counts and the unit of tails
        moments = len(content) - 8 * numbers - 4 * SERIES * VALUES - 8
        bit = int(rng.integers(0, 52)) + 64 * int(rng.integers(0, numbers))  # of a mantissa: numbers stay finite
        content[moments + bit // 8] ^= 1 << bit % 8
        path.write_bytes(content)
        return _taken(lambda: Checkpoint(path, COMPUTATION, VALUES), f"checkpoint with bit {bit} changed")


def _saved(rng: np.random.Generator, path: Path) -> bytes:
    checkpoint = Checkpoint(path, COMPUTATION, VALUES)
    moments = checkpoint.moments
    moments.passes[...] += int(rng.integers(1, 100))
    moments.mean[:], moments.sums[:] = rng.random((3, VALUES)), rng.random((SERIES, 3, VALUES))
    checkpoint.save()
    return path.read_bytes()


def _taken(read: Callable[[], object], what: str) -> Case:
    try:
        read()
    except InputError:
        return Case(0.0, f"{what}: refused")
    return Case(1.0, f"{what}: read")


def magenta(rng: np.random.Generator) -> Case:
    """Return how many pixels of a tone-mapped picture are magenta and show light, or are not and show none."""
    rgb = np.exp(rng.uniform(-20, 20, (16, 16, 3))) * rng.choice([-1.0, 1.0, 1.0], (16, 16, 3))
    rgb = rgb.astype(rng.choice([np.float32, np.float64]))
    wrong = rng.random(rgb.shape) < 0.05
    rgb[wrong] = rng.choice(NO_LIGHT, int(wrong.sum()))
    shown = (tone_map(rgb, 10.0 ** rng.uniform(-3, 3)) == MAGENTA).all(axis=-1)
    counted = int((~shown & wrong.any(axis=-1)).sum())
    return Case(counted, f"{counted} of {int(wrong.any(axis=-1).sum())} pixels without a number do not show")


def _plain(x: float) -> float:
    return 2 * x


def _write_kernel(folder: Path, turn: int) -> Path:
    """Write a compiled kernel, as far as the cache knows."""
    made = SimpleNamespace(library=SimpleNamespace(has_dynamic_globals=False))
    packed = patch("refgi.jit.cache.packed", lambda _: bytes([turn % 256]) * 1000)
    with patch.dict(os.environ, REFGI_CACHE_DIR=str(folder)), packed:
        cache, signature = KernelCache(_plain), types.float64(types.float64)
        cache.save_overload(signature, made)
        return cache.path(signature)


def _write_checkpoint(folder: Path, turn: int) -> Path:
    path = folder / "passes.truth"
    _saved(np.random.default_rng(turn), path)
    return path


def _writer(name: str, write: Callable[[Path, int], None]) -> Callable[[Path, int], Path]:
    def written(folder: Path, turn: int) -> Path:
        write(folder / name, turn)
        return folder / name

    return written


WRITERS: dict[str, Callable[[Path, int], Path]] = {
    "EXR": _writer("a.exr", lambda path, turn: write_exr(path, {"R": np.full((4, 4), turn, np.float32)})),
    "PNG": _writer("a.png", lambda path, turn: write_png(path, np.full((4, 4, 3), turn / 8))),
    "JSON": _writer("a.json", lambda path, turn: write_text(path, f"{turn}\n")),
    "checkpoint": _write_checkpoint,
    "kernel": _write_kernel,
}


def replaced(rng: np.random.Generator) -> Case:
    """Return 1 where who opened a file reads anything but the old one after another took its place, or finds no new."""
    name, turn = str(rng.choice(list(WRITERS))), int(rng.integers(1, 4))
    with tempfile.TemporaryDirectory() as where, warnings.catch_warnings():
        folder = Path(where)
        path = WRITERS[name](folder, turn)
        old = path.read_bytes()
        with path.open("rb") as reader:
            WRITERS[name](folder, turn + 1)
            seen, new = reader.read(), path.read_bytes()
        left = [one.name for one in folder.iterdir() if one != path]
    breach = seen != old or new == old or bool(left)
    return Case(float(breach), f"{name}: its reader saw {len(seen)} of {len(old)} bytes, "
                f"{'the old ones' if seen == old else 'others'}; left {left}")


PROMISES = (
    Promise("exr-changed", "a changed picture is refused", "EXR", "one bit of a pixel, or an attribute, the rest kept",
            changed_picture, "taken", 0.0, "exact", "SHA-256 of pixels and attributes", 2000, 12, adds=True),
    Promise("checkpoint-changed", "a changed checkpoint is refused", "checkpoint",
            "one bit of a mean or a sum, which stays finite", changed_checkpoint, "taken", 0.0, "exact",
            "SHA-256 of its content", 2000, 12, adds=True),
    Promise("png-magenta", "what is no number shows", "PNG", "NaN and either infinity in any channel", magenta,
            "pixels", 0.0, "exact", "magenta stands for it", 5000, 30, adds=True),
    Promise("replaced", "who opened a file reads it whole after it was replaced", ", ".join(WRITERS),
            "a file of that name, replaced by another", replaced, "files torn", 0.0, "exact",
            "written under another name, then renamed", 500, 20, adds=True),
)

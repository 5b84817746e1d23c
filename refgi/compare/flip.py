"""FLIP, the visible difference of two pictures (Andersson et al. 2020, 2021), by the flip-evaluator package.

The package is optional and runs in a child process, because it ends its whole process on input it dislikes. Exposures
are always given: left to itself it derives dozens of absurd ones from the dark references that are usual here.
"""

import importlib.util
import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from refgi.compare.metrics import count_non_finite
from refgi.errors import RefgiError
from refgi.types import Array

EXPOSURES = 3
MOST_STOPS = 8.0  # between the first and the last exposure
SECONDS = 300.0  # a megapixel takes four
LUMINANCE = (0.2126, 0.7152, 0.0722)  # of linear sRGB primaries


class Flip(NamedTuple):
    """What FLIP said, or why it said nothing."""

    mean: float = math.nan  # over covered pixels: 0 equal, 1 as different as can be
    error: Array | None = None  # (h, w) float32
    exposures: tuple[float, float, int] = (0.0, 0.0, 0)  # first and last in stops, and how many
    skipped: str = ""  # the reason, where it did not run


def flip(image: Array, reference: Array, covered: Array) -> Flip:
    """Compare two pictures, (3, h, w), linear radiance, as a viewer would; the mean is over covered pixels."""
    if importlib.util.find_spec("flip_evaluator") is None:
        return Flip(skipped="flip-evaluator is not installed: pip install 'refgi[flip]'")
    if bad := count_non_finite(image, covered) + count_non_finite(reference, covered):
        return Flip(skipped=f"{bad} pixels are NaN or infinite")
    exposures = choose_exposures(reference, covered)
    if exposures is None:
        return Flip(skipped="the reference is black")
    try:
        error = _in_child(image * covered, reference * covered, exposures)
    except RefgiError as problem:
        return Flip(exposures=exposures, skipped=str(problem))
    return Flip(float(error[covered].mean(dtype=np.float64)), error, exposures)


def choose_exposures(reference: Array, covered: Array) -> tuple[float, float, int] | None:
    """Choose exposures from one that keeps the brightest 1 % at white to one that lifts the median there.

    First and last in stops and how many, over covered pixels that are not black; None for a black reference.
    """
    luminance = np.tensordot(LUMINANCE, reference[:, covered].astype(np.float64), 1)
    lit = luminance[luminance > 0]
    if not lit.size:
        return None
    first = -math.log2(float(np.percentile(lit, 99)))
    last = min(-math.log2(float(np.median(lit))), first + MOST_STOPS)
    return (first, last, EXPOSURES) if last > first else (first, first, 1)


def _in_child(image: Array, reference: Array, exposures: tuple[float, float, int]) -> Array:
    with tempfile.TemporaryDirectory(prefix="refgi-flip-") as folder:
        for name, picture in (("image", image), ("reference", reference)):
            interleaved = np.moveaxis(np.maximum(np.nan_to_num(picture), 0), 0, -1)
            np.save(Path(folder, f"{name}.npy"), np.ascontiguousarray(interleaved, np.float32))
        Path(folder, "exposures.json").write_text(json.dumps(exposures))
        try:
            done = subprocess.run([sys.executable, "-m", "refgi.compare.flip", folder], capture_output=True, text=True,
                                  timeout=SECONDS, check=False)
        except subprocess.TimeoutExpired as late:
            raise RefgiError(f"flip-evaluator took more than {SECONDS:g} s") from late
        if done.returncode != 0 or not Path(folder, "error.npy").exists():
            said = (done.stderr or done.stdout).strip().splitlines()
            raise RefgiError(f"flip-evaluator ended with {done.returncode}: {said[-1] if said else 'no message'}")
        error: Array = np.load(Path(folder, "error.npy"))
        return error


def _evaluate(folder: Path) -> None:
    import flip_evaluator

    first, last, count = json.loads((folder / "exposures.json").read_text())
    parameters = {"startExposure": first, "stopExposure": last, "numExposures": count}
    error, _, _ = flip_evaluator.evaluate(np.load(folder / "reference.npy"), np.load(folder / "image.npy"), "HDR",
                                          applyMagma=False, computeMeanError=False, parameters=parameters)
    np.save(folder / "error.npy", np.asarray(error, np.float32)[..., 0])


if __name__ == "__main__":
    _evaluate(Path(sys.argv[1]))

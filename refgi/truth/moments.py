"""Means over passes: running mean and sum of squared deviations, in float64 (Welford's update).

Passes are independent, so the spread of their values gives the variance of the mean, whatever correlation there is
between the samples inside a pass or between pixels. The picture's own mean is followed as one more value: pixels
share lit points, so its error does not follow from theirs. A value that is not a finite number is left out of both
and counted.
"""

import os
import tempfile
import zipfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.errors import InputError
from refgi.jit import kernel, prange

Array = npt.NDArray[Any]


class Moments(NamedTuple):
    """What all passes so far add up to; updated in place."""

    passes: Array  # () int64
    mean: Array  # (3, r + 1) float64; the last column is the mean over receivers
    squares: Array  # (3, r + 1) float64, sums of squared deviations from the mean
    lost: Array  # (r + 1,) int64: passes whose value was not a finite number

    @property
    def variance_of_mean(self) -> Array:
        """Estimated variance of each mean, (3, r + 1); inf before the second pass."""
        n = np.float64(self.passes) - self.lost
        return np.where(n > 1, self.squares / np.maximum(n * (n - 1), 1), np.inf)


def no_passes(receivers: int) -> Moments:
    """Return the moments of no passes.

    Parameters
    ----------
    receivers : int
        How many.

    Returns
    -------
    Moments
        All zero.
    """
    return Moments(np.zeros((), np.int64), np.zeros((3, receivers + 1)), np.zeros((3, receivers + 1)),
                   np.zeros(receivers + 1, np.int64))


def add_pass(moments: Moments, values: Array) -> None:
    """Take one pass into the moments.

    Parameters
    ----------
    moments : Moments
        Updated.
    values : (3, r) float64 ndarray
        The pass's irradiance, W/m^2.
    """
    moments.passes[...] += 1
    finite: Array = np.isfinite(values.sum(axis=0))
    kept = values if finite.all() else values[:, finite]
    picture = kept.sum(axis=1) / max(1, kept.shape[1])
    moments.lost[:-1] += ~finite
    moments.lost[-1] += bool(len(finite)) and not finite.any()
    _add(moments.mean, moments.squares, values, picture, int(moments.passes), moments.lost)


@kernel(parallel=True)
def _add(mean: Array, squares: Array, values: Array, picture: Array, passes: int, lost: Array) -> None:
    last = values.shape[1]
    for i in prange(last + 1):
        if not np.isfinite(values[0, i] + values[1, i] + values[2, i] if i < last else picture[0]) or lost[i] == passes:
            continue
        for c in range(3):
            value = values[c, i] if i < last else picture[c]
            delta = value - mean[c, i]
            mean[c, i] += delta / (passes - lost[i])
            squares[c, i] += delta * (value - mean[c, i])


def save(path: Path, moments: Moments, computation: str) -> None:
    """Write a checkpoint whole or not at all.

    Parameters
    ----------
    path : Path
        The file; replaced.
    moments : Moments
        All passes so far.
    computation : str
        What was computed, so that nothing else continues it.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=path.name, suffix=".part")
    try:
        with os.fdopen(handle, "wb") as file:
            np.savez(file, computation=np.array(computation), **moments._asdict())
            file.flush()
            os.fsync(file.fileno())
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def load(path: Path, computation: str) -> Moments:
    """Read a checkpoint.

    Parameters
    ----------
    path : Path
        The file.
    computation : str
        What is to be continued.

    Returns
    -------
    Moments
        All passes so far.

    Raises
    ------
    InputError
        If the file is damaged or belongs to another computation.
    """
    try:
        with path.open("rb") as handle, np.load(handle) as file:
            found = str(file["computation"])
            moments = Moments(*(np.array(file[name]) for name in Moments._fields))
    except (OSError, ValueError, KeyError, zipfile.BadZipFile, EOFError) as trouble:
        raise InputError(f"checkpoint {path}: expected a whole checkpoint file, got {trouble}") from trouble
    if found != computation:
        raise InputError(f"checkpoint {path}: expected one of this scene and these settings, got another's")
    return moments

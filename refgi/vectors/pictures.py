"""Verdict on a finished picture: against a reference without noise, or one with a standard error. NumPy alone."""

from typing import NamedTuple

import numpy as np

from refgi.errors import expect
from refgi.vectors.bounds import SIGMAS
from refgi.vectors.causes import Difference, explain
from refgi.vectors.judge import judge_estimate
from refgi.vectors.manifest import ArrayEntry
from refgi.vectors.spec import Array

TOLERANCE = 0.01  # of the mean: RMSE of a port's picture by the same method and lights


class PictureVerdict(NamedTuple):
    """What became of a picture."""

    close: bool
    rmse: float  # plain, over all pixels and channels
    mean: float  # of the reference
    noise: float  # RMS of the standard errors of both
    bias: float  # mean of the difference
    worst: tuple[int, ...]  # channel, row, column of the largest difference
    causes: tuple[str, ...]
    said: str  # for people


def judge_picture(
    got: Array, expected: Array, variance: Array | None = None, own: Array | None = None,
    tolerance: float = TOLERANCE,
) -> PictureVerdict:
    """Compare a picture (3, h, w) with a reference, linear values of one unit; InputError if shapes differ.

    `variance` and `own`: of the expected mean and of the port's. Close where the RMSE, less the noise, is within
    `tolerance`, a share of the reference's mean, or where the difference is one of noise alone (tier T3).
    """
    expect(got.shape == expected.shape, "picture", f"shape {expected.shape} as its reference", got.shape)
    difference = np.asarray(got, np.float64) - expected
    finite = np.isfinite(difference)
    rmse = float(np.sqrt(np.mean(np.square(difference)))) if finite.all() else float("inf")
    mean = float(np.mean(np.abs(expected), dtype=np.float64))
    both = sum((np.asarray(one, np.float64) for one in (variance, own) if one is not None), np.zeros(expected.shape))
    noise = float(np.sqrt(both.mean()))
    excess = float(np.sqrt(max(0.0, rmse**2 - noise**2))) if np.isfinite(rmse) else rmse
    close = excess <= tolerance * mean
    if not close and variance is not None and finite.all():
        close = judge_estimate("picture", expected, got, variance, own).verdict.verdict != "out"
    worst = np.unravel_index(int(np.argmax(np.where(finite, np.abs(difference), np.inf))), expected.shape)
    place = tuple(int(k) for k in worst)
    causes = () if close else _causes(got, expected, SIGMAS * np.sqrt(both) + tolerance * mean)
    bias = float(difference.mean()) if finite.all() else float("nan")
    said = (f"RMSE {rmse:.3g}, {rmse / mean if mean else float('inf'):.2%} of the mean {mean:.3g}; noise {noise:.2g}; "
            f"bias {bias:+.2g}; worst at channel {place[0]}, row {place[1]}, column {place[2]}: "
            f"{float(expected[place]):.6g} expected, {float(got[place]):.6g} here")
    return PictureVerdict(close, rmse, mean, noise, bias, place, causes, said)


def _causes(got: Array, expected: Array, limit: Array) -> tuple[str, ...]:
    entry = ArrayEntry(file="", sha256="", dtype="<f4", shape=expected.shape, axes="rgb, row, column", unit="",
                       what="picture", tier="T1")
    with np.errstate(invalid="ignore"):
        out = ~(np.abs(np.asarray(got, np.float64) - expected) <= limit)
    if not out.any():
        return ()
    return tuple(one.cause for one in explain(Difference("picture", entry, expected, got, out, limit), {}, {})[:3])

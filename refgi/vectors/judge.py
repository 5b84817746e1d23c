"""Verdict on one array, or on a finished picture: within its bounds or not, and where it is worst. NumPy alone."""

from typing import NamedTuple

import numpy as np

from refgi.errors import expect
from refgi.types import Array
from refgi.vectors.bounds import FLUSHED, MOST_SPARED, SIGMAS, distance, large_value
from refgi.vectors.causes import Difference, explain
from refgi.vectors.manifest import ArrayEntry, ArrayVerdict, Tolerance, Verdict
from refgi.vectors.port import Few
from refgi.vectors.spec import axes_of

FEW = 0.005  # share of pixels that may be beyond SIGMAS standard errors
WORTH = 1e-3  # of the large values: errors of which size make an element the worst one
STEADY = (0.4, 2.5)  # mean square of z over the pixels of an estimate: right variances, and no structure


class Judged(NamedTuple):
    """A verdict, and the elements that are out."""

    verdict: ArrayVerdict
    out: Array | None = None  # bool, as the array
    limit: Array | None = None  # what was allowed, as the array


def unlike(name: str, tier: str, entry: ArrayEntry, got: Array) -> ArrayVerdict | None:
    """Return the verdict on an array that cannot be compared, saying why; None where it can."""
    said = _dtype_fault(entry, got) or _shape_fault(entry, got)
    return ArrayVerdict(name=name, verdict="invalid", tier=tier, said=said) if said else None


def judge(
    name: str, expected: Array, got: Array, tier: str, limit: Array | None, masked: Array | None,
    tolerance: Tolerance | None, few: Few | None = None,
) -> Judged:
    """Compare an array with what is expected, of one shape, element by element; equal in tier "T0", else within bounds.

    `limit` bounds each element, or `tolerance` the whole array, with a share of outliers; with both, errors of stages
    before and of this one are independent: their squares add. `few` is what storage in few bits allows beside; `masked`
    elements may differ at will. Not judged where MOST_SPARED or more are beyond, but allowed to be. The worst element
    is the farthest beyond its bound; one that is not finite where a finite number is expected is beyond any.
    """
    off = distance(got, expected)
    if tier == "T0" or expected.dtype.kind != "f":
        allowed = np.zeros(expected.shape)
    elif tolerance is not None:
        size = np.where(np.isfinite(expected), np.abs(expected), 0.0) + tolerance.large
        allowed = np.hypot(tolerance.relative * size + FLUSHED, 0.0 if limit is None else limit)
    else:
        allowed = np.zeros(expected.shape) if limit is None else limit.astype(np.float64)
    outliers = 0.0 if tolerance is None else tolerance.outliers
    if few is not None:
        allowed, outliers = allowed + few.more, outliers + few.outliers
    masked = np.zeros(expected.shape, np.bool_) if masked is None else masked
    beyond = off > allowed
    out = beyond & ~masked
    count, every = int(np.count_nonzero(out)), int(np.count_nonzero(beyond))
    large = large_value(expected)
    blunt = bool(large and np.mean(allowed >= large) > MOST_SPARED)
    verdict: Verdict = "exact"
    if off.any():
        fine: Verdict = "within" if every < max(1.0, MOST_SPARED * out.size) and not blunt else "not-judged"
        verdict = fine if count <= outliers * out.size else "out"
    worst, place = _worst(off, allowed, out if count else ~masked, expected)
    said = ArrayVerdict(name=name, verdict=verdict, tier=tier, worst=worst, element=place, outside=count,
                        masked=every - count, said=_spared(verdict, every, out.size, blunt=blunt))
    limit = np.where(masked, np.inf, allowed)
    return Judged(said.model_copy(update=_values(expected, got, allowed, place)), out, limit)


def _spared(verdict: Verdict, count: int, size: int, *, blunt: bool) -> str:
    """Return how many elements beyond their bounds a verdict that is not out spared."""
    if verdict == "not-judged" and blunt:
        return "bounds are as large as the array's values"
    if verdict == "out" or not count:
        return ""
    return f"{count} of {size} elements spared" + (
        ": more than can be judged by rounding" if verdict == "not-judged" else "")


def judge_estimate(
    name: str, expected: Array, got: Array, variance: Array, own: Array | None
) -> Judged:
    """Compare two estimates by the standard error of their difference (tier T3).

    `variance` is that of the expected mean, `own` that of the port's; the expected one's where it gives none. Out where
    the sum over all pixels is SIGMAS standard errors off, more than FEW pixels are, or the mean square of z lies
    outside of STEADY.
    """
    both = np.asarray(variance, np.float64) + (variance if own is None else own)
    off = distance(got, expected)
    sigma = np.sqrt(both)
    z = np.divide(off, sigma, out=np.where(off > 0, np.inf, 0.0), where=sigma > 0)
    out = z > SIGMAS
    steady = float(np.mean(z[sigma > 0] ** 2)) if (sigma > 0).any() else 0.0
    with np.errstate(invalid="ignore"):
        total = abs(float(np.sum(np.asarray(got, np.float64) - expected)))
    bias = total / max(float(np.sqrt(both.sum())), np.finfo(np.float64).tiny)
    few = np.count_nonzero(out) <= FEW * out.size
    fine = bool(few) and bias <= SIGMAS and (STEADY[0] <= steady <= STEADY[1] or not sigma.any())
    verdict: Verdict = "exact" if not off.any() else "within" if fine else "out"
    worst, place = _worst(off, SIGMAS * sigma, z >= z.max(initial=0.0), expected)
    text = f"sum {bias:.1f} standard errors off, mean square of z {steady:.2f}"
    said = ArrayVerdict(name=name, verdict=verdict, tier="T3", worst=worst, element=place, said=text,
                        outside=int(np.count_nonzero(out)))
    return Judged(said.model_copy(update=_values(expected, got, SIGMAS * sigma, place)), out, SIGMAS * sigma)


def _worst(
    off: Array, allowed: Array, among: Array, expected: Array
) -> tuple[float | None, tuple[int, ...] | None]:
    """Return the largest error over its bound, and where it is worst beside the array's large values; of some elements.

    None where there are none.
    """
    if not among.any():
        return None, None
    floor = np.finfo(np.float64).tiny
    with np.errstate(over="ignore"):
        ratio = np.where(off > 0, off / np.maximum(allowed, floor), 0.0)
        beside = off / (allowed + WORTH * large_value(expected) + floor) if expected.dtype.kind == "f" else off
    worst = float(ratio[among].max())
    at = np.unravel_index(int(np.argmax(np.where(among, beside, -1.0))), off.shape)
    return (worst if np.isfinite(worst) and worst < 1e30 else None), tuple(int(k) for k in at)


def _values(expected: Array, got: Array, allowed: Array, place: tuple[int, ...] | None) -> dict[str, float | None]:
    if place is None:
        return {}
    return {key: float(array[place]) if np.isfinite(array[place]) else None
            for key, array in (("expected", expected), ("got", got), ("bound", allowed))}


def _dtype_fault(entry: ArrayEntry, got: Array) -> str:
    kinds = {"<f4": ("f", "floats"), "<i4": ("iu", "whole numbers"), "|b1": ("biu", "true or false, or 0 and 1")}
    kind, words = kinds[entry.dtype]
    if got.dtype.kind not in kind:
        return f"expected {words} ({entry.dtype}), got {got.dtype.name}"
    if entry.dtype == "|b1" and got.dtype.kind != "b" and not np.isin(got, (0, 1)).all():
        return "expected 0 and 1, got other numbers"
    return ""


def _shape_fault(entry: ArrayEntry, got: Array) -> str:
    if got.shape == entry.shape:
        return ""
    said = f"expected shape {entry.shape} ({entry.axes}), got {got.shape}"
    if sorted(got.shape) == sorted(entry.shape):
        return f"{said}: the axes are in another order"
    if got.size == int(np.prod(entry.shape)):
        return f"{said}: as many elements, in another shape"
    if got.ndim == len(entry.shape):
        differing = [k for k in range(got.ndim) if got.shape[k] != entry.shape[k]]
        names = axes_of(entry.axes)
        if len(differing) == 1 and len(names) == got.ndim:
            more = got.shape[differing[0]] - entry.shape[differing[0]]
            return f"{said}: {abs(more)} {'more' if more > 0 else 'fewer'} along {names[differing[0]]}"
    return said


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

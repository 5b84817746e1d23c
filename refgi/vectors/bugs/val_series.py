"""Comparison by the series at pixels as a port writes it, and as it gets it wrong (VAL Sec. 4.1, E-VAL-02 to 05)."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from refgi.cluster.settings import Csm
from refgi.vectors.bugs.val_basis import FREQUENCIES
from refgi.vectors.bugs.val_cone import CONES, Cone, disc_of, seen_from
from refgi.vectors.spec import Array, Arrays, Bug, Run

F_M = "E-VAL-02: 1/2 + sum w_k (cos(c_k d') S_k - sin(c_k d') C_k)"
Z_AVG = "E-VAL-02, E-VAL-04: (Z/2 - sum w_k (cos(c_k d') SZ_k - sin(c_k d') CZ_k)) / (1 - V)"
LEAST = 0.02
Part = Callable[[Any, Any, Any, Any], Any]


class Comparison(NamedTuple):
    """How depths are compared; by default as the stages do."""

    frequency: Callable[[Array], Array] = lambda k: (2 * k - 1) * np.pi
    weight: Callable[[Array, Array], Array] = lambda w, k: w  # noqa: ARG005
    terms: Part = lambda sine, cosine, s, c: cosine * s - sine * c
    bias: float = 1.0  # times b
    constant: float = 0.5
    sign: float = 1.0


def compared(means: Array, t: Array, bias: float, weight: Array, how: Comparison) -> Array:
    """Return sum w_k (...) of means (2 M, ...) at depths t."""
    m = len(weight)
    k = np.arange(1, m + 1)
    angle = np.multiply.outer(how.frequency(k), t - how.bias * bias)
    w = np.asarray(how.weight(weight, k)).reshape(-1, *[1] * t.ndim)
    return np.asarray((w * how.terms(np.sin(angle), np.cos(angle), means[:m], means[m:])).sum(axis=0))


COMPARISONS: Mapping[str, Comparison] = {
    "the bias b is counted twice: t - 2 b": Comparison(bias=2.0),
    "the bias is added to the depth, t + b: wrong sign": Comparison(bias=-1.0),
    "half of the bias": Comparison(bias=0.5),
    "the comparison leaves out the bias: no bias, t without b": Comparison(bias=0.0),
    "sum with the sign of sin(a + b): cos S + sin C, plus in place of minus": Comparison(
        terms=lambda sine, cosine, s, c: cosine * s + sine * c),
    "sines and cosines of the receiver's depth are exchanged: sin S - cos C": Comparison(
        terms=lambda sine, cosine, s, c: sine * s - cosine * c),
    "cos C - sin S: sines and cosines of the map are exchanged": Comparison(
        terms=lambda sine, cosine, s, c: cosine * c - sine * s),
    "cos C + sin S: the cosine of the difference for its sine": Comparison(
        terms=lambda sine, cosine, s, c: cosine * c + sine * s),
    "the sine's term alone, cos S: sin C is left out": Comparison(
        terms=lambda sine, cosine, s, c: cosine * s),  # noqa: ARG005
    "the cosine's term alone, sin C: cos S is left out": Comparison(
        terms=lambda sine, cosine, s, c: -sine * c),  # noqa: ARG005
    "the series' sum is subtracted: sin(d - z) for sin(z - d), wrong sign; 1 - V, the hidden share": Comparison(
        sign=-1.0),
    "weights w_k are missing: all terms count 1": Comparison(weight=lambda w, k: 0 * w + 1),  # noqa: ARG005
    "weights are 1 / c_k: the factor 2 is missing": Comparison(weight=lambda w, k: w / 2),  # noqa: ARG005
    "weights are doubled: a factor 2 too many, 4 / c_k": Comparison(weight=lambda w, k: 2 * w),  # noqa: ARG005
    "all terms have the first term's weight": Comparison(weight=lambda w, k: 0 * k + w[0]),
    "weights are squared": Comparison(weight=lambda w, k: w * w),  # noqa: ARG005
    "weights are in reverse order": Comparison(weight=lambda w, k: w[::-1]),  # noqa: ARG005
    "the first term alone: no sum over k (overwritten terms or a loop that ends)": Comparison(
        weight=lambda w, k: w * (k == 1)),
    "the last term alone: each overwrites the one before, not accumulated": Comparison(
        weight=lambda w, k: w * (k == len(k))),
    "the last term of the series is left out: one term too few": Comparison(weight=lambda w, k: w * (k < len(k))),
    "the first term of the series is left out": Comparison(weight=lambda w, k: w * (k > 1)),
    "the series' constant 1/2 is left out": Comparison(constant=0.0),
    "the series' constant is 1, not 1/2": Comparison(constant=1.0),
    **{f"frequencies are {name}": Comparison(frequency=law) for name, law in FREQUENCIES.items()},
}


class Penumbra(NamedTuple):
    """How the mean depth of blockers follows; by default as the stage does."""

    blocked: Comparison = Comparison()
    behind: Comparison = Comparison()
    cone: Cone = Cone()
    most: bool = True  # depths are cut at the range
    least: float = LEAST
    logarithm: Callable[[Any], Any] = np.log2
    power: Callable[[Any], Any] = np.exp2
    along: Callable[[Any, Any], Any] = lambda t, slope: t / slope
    origin: Callable[[Any, Any], Any] = lambda origin, z: origin * z  # of metres: origin + z
    share: Callable[[Any], Any] = lambda blocked: blocked  # by which the sum is divided
    nearest: bool = True  # z is at least near
    farthest: bool = True  # and at most d
    mean: float = 0.5  # of Z
    metres: bool = False  # depths of the series are distances
    channels: int = 2  # blocks of channels before those that are weighed by depth
    at: Callable[[Any, Any, Any], Any] = lambda z, near, d: z  # noqa: ARG005 - whose cone is the penumbra's
    stored: Callable[[Any, Any], Any] = lambda t, bias: t  # noqa: ARG005


def penumbra_by(csm: Csm, how: Penumbra) -> Run:
    """Return the mean depth of blockers and the penumbra's disc as a port writes them."""
    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
        m, bias = csm.terms, float(arrays["series.bias"][0])
        means, weight = (np.asarray(arrays[name], np.float64) for name in ("search.means", "series.weight"))
        means = np.moveaxis(means, 1, 0)
        origin, slope, near = (np.asarray(arrays[name], np.float64)[:, None, None] for name in (
            "scale.origin", "scale.slope", "maps.near"))
        pending, d = np.asarray(arrays["search.pending"]), seen_from(arrays, how.cone)[1]
        logs = csm.depth_scale == "log_map"
        with np.errstate(all="ignore"):
            beyond = how.logarithm(d / origin) if logs else d - origin
            t = np.maximum(np.nan_to_num(beyond * slope), 0)
            t = np.minimum(t, float(arrays["series.range"][0])) if how.most else t
            blocked = how.blocked.constant - how.blocked.sign * compared(means[: 2 * m], t, bias, weight, how.blocked)
            shaded = pending & (blocked >= how.least)
            by_depth = means[how.channels * m : (how.channels + 2) * m]
            total = how.mean * means[4 * m] - how.behind.sign * compared(by_depth, t, bias, weight, how.behind)
            along = how.along(total / how.share(blocked), slope)
            z = how.origin(origin, how.power(along)) if logs else origin + along
            z = total / how.share(blocked) if how.metres else z
            z = np.maximum(z, near) if how.nearest else z
            z = np.minimum(z, d) if how.farthest else z
            disc = disc_of(arrays, how.cone, how.at(z, near, d))
        return {"penumbra.shaded": shaded, "penumbra.z_avg": np.where(shaded, z, 0),
                "penumbra.region": np.where(shaded[:, None], disc, 0),
                "penumbra.t": np.where(pending, how.stored(t, bias), 0)}

    return run


SEARCHES: Mapping[str, Penumbra] = {
    "the search leaves out the bias in the blocked share alone": Penumbra(blocked=Comparison(bias=0.0)),
    "the search leaves out the bias in the mean depth alone": Penumbra(behind=Comparison(bias=0.0)),
    "depths are not clamped to the range: beyond its far end": Penumbra(most=False),
    "depths by the natural logarithm, ln for log2": Penumbra(logarithm=np.log),
    "distances by e^x in place of 2^x: exp for exp2, the natural base": Penumbra(power=np.exp),
    "distances by 10^x in place of 2^x": Penumbra(power=lambda x: 10**x),
    "distances are not taken out of the logarithm: x in place of 2^x": Penumbra(power=lambda x: x),
    "depths are multiplied by the slope, not divided, on the way back to metres": Penumbra(
        along=lambda t, slope: t * slope),
    "the slope is left out on the way back to metres": Penumbra(along=lambda t, slope: t),  # noqa: ARG005
    "the scale's origin is left out on the way back to metres": Penumbra(origin=lambda origin, z: z + 0 * origin),
    "the scale's origin is added to 2^x, not multiplied": Penumbra(origin=lambda origin, z: origin + z),
    "z_avg is not divided by the blocked share": Penumbra(share=lambda blocked: 1 + 0 * blocked),
    "z_avg is multiplied by the blocked share, not divided": Penumbra(share=lambda blocked: 1 / blocked),
    "z_avg is not clamped to the nearest distance": Penumbra(nearest=False),
    "z_avg is not clamped to the pixel's distance d": Penumbra(farthest=False),
    "z_avg leaves out the mean depth Z": Penumbra(mean=0.0),
    "z_avg reads channels without the depth: S and C for SZ and CZ": Penumbra(channels=0),
    "any blocked share counts: no least share of 0.02, above 0 is shaded": Penumbra(least=0.0),
    "pixels are shaded from a blocked share of one half on, not 0.02": Penumbra(least=0.5),
    "pixels are shaded from a blocked share of 0.2 on, not 0.02": Penumbra(least=0.2),
    "every searched pixel is shaded: the blocked share is not tested": Penumbra(least=-np.inf),
    "the penumbra by the nearest blocker, not by the mean depth": Penumbra(at=lambda z, near, d: near + 0 * d + 0 * z),
    "the penumbra of a blocker half-way to the pixel, not of z_avg": Penumbra(at=lambda z, near, d: d / 2 + 0 * z),  # noqa: ARG005
    "the penumbra has no width: z is the pixel's distance": Penumbra(at=lambda z, near, d: d + 0 * z),  # noqa: ARG005
    "the sum is divided by V, the share that is seen, not by 1 - V": Penumbra(share=lambda blocked: 1 - blocked),
    "the mean depth Z counts whole, not by half": Penumbra(mean=1.0),
    "z_avg of the series' scale is taken for metres": Penumbra(metres=True),
    "means of all depths, blockers or not: Z itself": Penumbra(
        behind=Comparison(weight=lambda w, k: 0 * w), mean=1.0, share=lambda blocked: 1 + 0 * blocked),  # noqa: ARG005
    "the depth is stored less the bias": Penumbra(stored=lambda t, bias: t - bias),
}


def series_search_bugs(csm: Csm) -> tuple[Bug, ...]:
    """Return likely bugs of the mean depth of blockers by the series."""
    return (
        *(Bug(cause, penumbra_by(csm, how), Z_AVG) for cause, how in SEARCHES.items()),
        *(Bug(cause, penumbra_by(csm, Penumbra(how, how)), F_M) for cause, how in COMPARISONS.items()),
        *(Bug(f"{cause}, in the mean depth alone", penumbra_by(csm, Penumbra(behind=how)), Z_AVG)
          for cause, how in COMPARISONS.items() if cause.startswith(("sum with", "sines and", "the series' sum"))),
        *(Bug(cause, penumbra_by(csm, Penumbra(cone=cone)), "E-VAL-07, 08") for cause, cone in CONES.items()))


class Verdict(NamedTuple):
    """How V follows from the series; by default as the stage does."""

    comparison: Comparison = Comparison()
    end: Callable[[Any], Any] = lambda v: np.clip(v, 0, 1)
    other: Callable[[Any], Any] = lambda hard: hard


def verdict_by(csm_gain: float, how: Verdict) -> Run:
    """Return V by the series as a port writes it."""
    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
        shaded = np.asarray(arrays["penumbra.shaded"])
        means, t = (np.asarray(arrays[f"penumbra.{name}"], np.float64) for name in ("means", "t"))
        weight, bias = np.asarray(arrays["series.weight"], np.float64), float(arrays["series.bias"][1])
        test = how.comparison.sign * compared(np.moveaxis(means, 1, 0), t, bias, weight, how.comparison)
        hard = np.asarray(arrays.get("hard.share", np.ones(shaded.shape)), np.float64)
        value = how.end(csm_gain * (how.comparison.constant + test))
        return {"visibility.share": np.where(shaded, value, how.other(hard))}

    return run


VERDICTS: Mapping[str, Verdict] = {
    "V is multiplied by 2 (brighter, a gain of 2) and clamped": Verdict(end=lambda v: np.clip(2 * v, 0, 1)),
    "V is halved": Verdict(end=lambda v: np.clip(v, 0, 1) / 2),
    "V is not clamped to [0, 1]: the series overshoots": Verdict(end=lambda v: v),
    "V is not clamped to at most 1": Verdict(end=lambda v: np.maximum(v, 0)),
    "V is not clamped at 0: negative values": Verdict(end=lambda v: np.minimum(v, 1)),
    "V is squared": Verdict(end=lambda v: np.clip(v, 0, 1) ** 2),
    "V is smoothed by smoothstep": Verdict(end=lambda v: np.clip(v, 0, 1) ** 2 * (3 - 2 * np.clip(v, 0, 1))),
    "V is rounded to hidden or seen: a hard threshold of 0.5": Verdict(end=lambda v: np.where(v < 0.5, 0.0, 1.0)),
    "V is -1 to 1, 2 f - 1, clamped": Verdict(end=lambda v: np.clip(2 * v - 1, 0, 1)),
    "V is 1 where there is no penumbra: hard shadows of area lights without extent are left out": Verdict(
        other=lambda hard: 0 * hard + 1),
    "V is 0 where there is no penumbra (not shaded)": Verdict(other=lambda hard: 0 * hard),
}


def verdict_bugs(gain: float, hard: bool) -> tuple[Bug, ...]:
    """Return likely bugs of V by the series; `hard`: some area lights have hard shadows."""
    return (*(Bug(cause, verdict_by(gain, how), "V, clamped to [0, 1]") for cause, how in VERDICTS.items()
              if hard or "hard shadows" not in cause),
            *(Bug(cause, verdict_by(gain, Verdict(how)), F_M) for cause, how in COMPARISONS.items()))

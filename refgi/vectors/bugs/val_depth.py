"""Depths of the series on each map, basis and mip levels as a port gets them wrong (VAL Sec. 4.1, 6; E-VAL-02, 05)."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from refgi.cluster.filters.basis import INSIDE
from refgi.cluster.settings import Csm
from refgi.vectors.bugs.val_basis import FREQUENCIES, LAW
from refgi.vectors.recipe import writing
from refgi.vectors.spec import Array, Arrays, Bug, Run

MIRROR = "docs/methods/val_visibility: the texel at (s, t) / (s^2 + t^2)"
CHANNELS = "S_1.., C_1.., t S_1.., t C_1.., t"


def depths_by(csm: Csm, **how: Any) -> Run:
    """Return the depths of the series as a port writes them; `how` as in `_depths`."""
    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
        return {"maps.t": _depths(arrays, csm.depth_scale == "log_map", csm.prefilter == "mip", **how)}

    return run


def _depths(
    arrays: Arrays, logs: bool, mirrored: bool, *, logarithm: Callable[[Any], Any] = np.log2, origin: bool = True,
    slope: Callable[[Any], Any] = lambda slope: slope, most: Any = None, least: float = 0.0, empty: float | None = None,
    shrink: Callable[[Any, int], Any] = lambda q, n: np.minimum(1 / np.sqrt(q), 1 - INSIDE / n) / np.sqrt(q),
    first_depth: bool = False, half: float = 0.5, exchanged: bool = False, signs: tuple[int, int] = (1, 1),
    first: bool = False,
) -> Array:
    depth = np.asarray(arrays["maps.depth"], np.float64)
    depth = np.repeat(depth[:1], len(depth), axis=0) if first_depth else depth
    begin, steep = (np.asarray(arrays[f"scale.{name}"], np.float64)[:, None, None] for name in ("origin", "slope"))
    begin, steep = (np.where(steep > 0, one[:1], one) if first else one for one in (begin, steep))
    end = float(arrays["series.range"][0])
    with np.errstate(all="ignore"):
        z = np.where(np.isinf(depth), 1e30, depth)
        beyond = logarithm(z / begin if origin else z) if logs else (z - begin if origin else z)
        t = np.clip(np.nan_to_num(beyond * slope(steep)), least, end if most is None else most)
    t = np.where(np.isinf(depth), end if empty is None else empty, t)
    if mirrored:
        row, column = _mirrors(depth.shape[1], shrink, half, exchanged, signs)
        t = t[:, row, column]
    return np.where(np.asarray(arrays["scale.slope"])[:, None, None] > 0, t, 0)


def _mirrors(
    n: int, shrink: Callable[[Any, int], Any], half: float, exchanged: bool, signs: tuple[int, int]
) -> tuple[Array, Array]:
    """Return from where each texel takes its depth: beyond the disc from another, (n, n) rows and columns."""
    center = 2 * (np.arange(n) + half) / n - 1
    s, t = np.meshgrid(center, center)
    q, rows = s * s + t * t, np.indices((n, n))
    with np.errstate(all="ignore"):
        factor = np.nan_to_num(shrink(q, n), posinf=0)
    column, row = (np.clip((0.5 * (sign * x * factor + 1) * n).astype(int), 0, n - 1)
                   for sign, x in zip(signs, (s, t), strict=True))
    row, column = (column, row) if exchanged else (row, column)
    return np.where(q > 1, row, rows[0]), np.where(q > 1, column, rows[1])


def depth_bugs(csm: Csm) -> tuple[Bug, ...]:
    """Return likely bugs of the depths of the series."""
    logs: Mapping[str, Any] = {
        "the logarithm is to base 10, not log2": {"logarithm": np.log10},
        "no logarithm: the ratio z / origin": {"logarithm": lambda x: x},
        "no logarithm: the ratio z / origin less 1": {"logarithm": lambda x: x - 1},
    } if csm.depth_scale == "log_map" else {}
    plain: Mapping[str, Any] = {
        "distances do not begin at the scale's origin: origin is left out": {"origin": False},
        "the slope is left out": {"slope": lambda slope: 1 + 0 * slope},
        "divided by the slope, not multiplied": {"slope": lambda slope: 1 / slope},
        "depths are not clamped at all: infinite where nothing is": {"most": np.inf, "least": -np.inf, "empty": np.inf},
        "nothing there (inf) is at depth 0, not at the far end of the range": {"empty": 0.0},
        "nothing there (inf) is at depth 1, not at the far end of the range": {"empty": 1.0},
        "the first map's scale for all": {"first": True},
        "the first map's depths for all": {"first_depth": True},
    }
    mirrors: Mapping[str, Any] = {
        "mirrored rows and columns are exchanged (swapped)": {"exchanged": True},
        "mirrored columns run leftwards: wrong sign of s": {"signs": (-1, 1)},
        "mirrored rows run upwards: wrong sign of t": {"signs": (1, -1)},
        "texels beyond the disc hold what lies opposite, at -(s, t) / (s^2 + t^2)": {"signs": (-1, -1)},
        "texels beyond the disc, (s, t) / (s^2 + t^2), come too near to the rim: they may fall on empty texels": {
            "shrink": lambda q, n: 1 / q},  # noqa: ARG005
        "texels beyond the disc by (s, t) (2 - r) / r: folded, not mirrored by 1 / r": {
            "shrink": lambda q, n: (2 - np.sqrt(q)) / np.sqrt(q)},  # noqa: ARG005
        "texels beyond the disc repeat its rim (clamped to the edge): the hemisphere is not mirrored": {
            "shrink": lambda q, n: (1 - INSIDE / n) / np.sqrt(q)},
        "half a texel is left out where texels beyond the disc are mirrored": {"half": 0.0},
    } if csm.prefilter == "mip" else {}
    return tuple(Bug(cause, depths_by(csm, **how), MIRROR if cause in mirrors else "E-VAL-05")
                 for cause, how in {**logs, **plain, **mirrors}.items())


Parts = Callable[[Array, Array, Array], list[Array]]
BASES: Mapping[str, Parts] = {
    "sines where cosines belong, also times the depth": lambda s, c, t: [s, s, t * s, t * s],  # noqa: ARG005
    "cosines where sines belong, also times the depth": lambda s, c, t: [c, c, t * c, t * c],  # noqa: ARG005
    "sines where cosines belong": lambda s, c, t: [s, s, t * s, t * c],
    "cosines where sines belong": lambda s, c, t: [c, c, t * s, t * c],
    "cosine times depth is sine times depth: t sin for t cos": lambda s, c, t: [s, c, t * s, t * s],
    "sine times depth is cosine times depth: t cos for t sin": lambda s, c, t: [s, c, t * c, t * c],
    "sine and cosine times depth are exchanged": lambda s, c, t: [s, c, t * c, t * s],
    "sine and cosine are exchanged, those times depth are right": lambda s, c, t: [c, s, t * s, t * c],
    "cosines times depth are not weighed by the depth": lambda s, c, t: [s, c, t * s, c],
    "sines times depth are not weighed by the depth": lambda s, c, t: [s, c, s, t * c],
    "weighed by the depth squared": lambda s, c, t: [s, c, t * t * s, t * t * c],
    "weighed by 1 - depth": lambda s, c, t: [s, c, (1 - t) * s, (1 - t) * c],
    "sines have the wrong sign: sin(-c_k t)": lambda s, c, t: [-s, c, -t * s, t * c],
    "cosines have the wrong sign": lambda s, c, t: [s, -c, t * s, -t * c],
    "sines and cosines are packed into [0, 1]": lambda s, c, t: [(s + 1) / 2, (c + 1) / 2, t * s, t * c],
    "cosines are left out: they are 0": lambda s, c, t: [s, 0 * c, t * s, 0 * t * c],
    "those times depth come first: wrong order of channels": lambda s, c, t: [t * s, t * c, s, c],
    "the order of channels is S, t S, C, t C": lambda s, c, t: [s, t * s, c, t * c],
}


def basis_by(law: Callable[[Array], Array], terms: int, parts: Parts = lambda s, c, t: [s, c, t * s, t * c],
             finish: Callable[[Array], Array] = lambda a: a) -> Run:
    """Return the basis as a port writes it."""
    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
        t = np.asarray(arrays["maps.t"], np.float64)
        angle = np.multiply.outer(law(np.arange(1.0, terms + 1)), t)
        sine, cosine = (np.moveaxis(of(angle), 0, 1) for of in (np.sin, np.cos))
        made = finish(np.concatenate([*parts(sine, cosine, t[:, None]), t[:, None]], axis=1))
        made[~np.asarray(t.any(axis=(1, 2)))] = 0
        return {"basis.0": made}

    return run


def basis_bugs(run: Run, terms: int) -> tuple[Bug, ...]:
    """Return likely bugs of the basis."""
    def plain(k: Array) -> Array:
        return (2 * k - 1) * np.pi

    def finished(change: Callable[[Array], Array]) -> Run:
        return basis_by(plain, terms, finish=change)

    m, known = terms, ("k pi", "even", "(2k + 1)")
    return (
        *(Bug(cause, basis_by(plain, terms, parts), CHANNELS) for cause, parts in BASES.items()),
        *(Bug(f"frequencies are {name}", basis_by(law, terms), LAW) for name, law in FREQUENCIES.items()
          if not name.startswith(known)),
        Bug("sines and cosines alternate (interleaved), those times depth do not", finished(
            lambda a: a[:, [*(j for k in range(m) for j in (k, m + k)), *range(2 * m, 4 * m + 1)]]), CHANNELS),
        Bug("cosines lie one after each sine, interleaved, and overwrite the next sine; their own channels are empty",
            finished(_overwritten), CHANNELS),
        Bug("channels are in the order of terms: S_k, C_k, t S_k, t C_k of each k", finished(
            lambda a: a[:, [*(k + m * j for k in range(m) for j in range(4)), 4 * m]]), CHANNELS),
        Bug("terms are in reverse order", finished(lambda a: a[:, [*(j * m + m - 1 - k for j in range(4) for k in range(
            m)), 4 * m]]), CHANNELS),
        Bug("the depth comes first, not last", finished(lambda a: np.roll(a, 1, axis=1)), CHANNELS),
        Bug("the last channel is 1, not the depth", finished(
            lambda a: np.concatenate([a[:, :-1], 0 * a[:, -1:] + 1], axis=1)), CHANNELS),
        Bug("the last channel is the depth squared", finished(
            lambda a: np.concatenate([a[:, :-1], a[:, -1:] ** 2], axis=1)), "E-VAL-02: Z"),
        Bug("the last term is left out: one too few", finished(
            lambda a: a * np.array([*([1] * (m - 1) + [0]) * 4, 1])[:, None, None]), CHANNELS),
        Bug("the first map's basis for all", writing(run, basis__0=lambda a: np.repeat(a[:1], len(a), axis=0)), ""),
        Bug("empty maps hold the basis of depth 0, cosines of 1", writing(run, basis__0=_empty_of_0),
            "0 on empty maps"))


def _overwritten(basis: Array) -> Array:
    """Return channels where cosine k was written to place k + 1 in a loop over k, and read from its own as 0."""
    m = basis.shape[1] // 4
    made = basis.copy()
    made[:, m : 2 * m] = made[:, 3 * m : 4 * m] = 0
    for k in range(m):
        made[:, k] = basis[:, k]
        made[:, k + 1] = basis[:, m + k]
    return made


def _empty_of_0(basis: Array) -> Array:
    m, made = basis.shape[1] // 4, basis.copy()
    made[~basis.any(axis=(1, 2, 3)), m : 2 * m] = 1
    return made

"""Stages of convolution shadow maps: series, scale of depths, depths, basis, mip map (VAL Sec. 4.1, 6).

A texel's channels are sin(c_k t) for all k, cos(c_k t), t sin(c_k t), t cos(c_k t), then t, its depth.
"""

from typing import Any

import numpy as np

from refgi.cluster.filters.basis import beyond_disc, fill_basis, fill_beyond, normalise
from refgi.cluster.filters.brute import Brute, brutes
from refgi.cluster.filters.depth_scale import DepthScale
from refgi.cluster.filters.eight import EIGHT
from refgi.cluster.filters.mip_build import halve
from refgi.cluster.filters.prefilter import LEVEL_SHIFT
from refgi.cluster.filters.pyramid import Mip, level_offsets, mip_of, mips
from refgi.cluster.settings import Csm
from refgi.cluster.visibility.search_region import scale_of
from refgi.cluster.visibility.series import Series, frequencies, series
from refgi.settings import replaced
from refgi.vectors.recipe import Recipe, reading, writing
from refgi.vectors.spec import Array, Arrays, Decoy, Spec
from refgi.vectors.stages.val_maps import SHEET, shadow_maps_of

SERIES = ("series.weight", "series.bias", "series.range")
SCALE = ("scale.origin", "scale.slope", "series.range")
CHANNELS = "area light, channel, row, column"


def add_basis(recipe: Recipe, csm: Csm) -> None:
    """Add the series, its scale of depths on each map, depths, basis and mip map."""
    _add_series(recipe, csm)
    _add_scale(recipe, csm)
    _add_series_depths(recipe, csm)
    _add_level_0(recipe, csm)
    if csm.prefilter == "mip":
        _add_levels(recipe, csm.terms)


def _add_series(recipe: Recipe, csm: Csm) -> None:
    def run(arrays: Arrays, real: Any, chain: Series = series(csm)) -> Arrays:  # noqa: ARG001
        return {"series.weight": chain.weight, "series.bias": np.array([chain.search_bias, chain.bias]),
                "series.range": np.array([chain.range])}

    facts = {"terms": csm.terms, "depth_scale": csm.depth_scale, "prefilter": csm.prefilter,
             "gain": series(csm).gain, "least blocked share": 0.02}
    recipe.facts["csm"] = facts
    recipe.add("series", "weights and biases of f_M, and the far end of its depths", run, (), {
        "series.weight": Spec("term", "1", "w_k = 2 / c_k, c_k = (2k - 1) pi", paper="E-VAL-02"),
        "series.bias": Spec("search, comparison", "1", "b*, where f_M is 1 for the first time", paper="E-VAL-03"),
        "series.range": Spec("one", "1", "1 - 2 b*, the depth of what is farthest", paper="E-VAL-05")},
        paper="VAL Sec. 4.1, E-VAL-02, 03, 05", decoys=(
            Decoy("c_k = k pi", writing(run, series__weight=lambda a: 2 / (np.pi * np.arange(1, len(a) + 1))), "E-VAL-02"),
            Decoy("w_k = 1 / c_k", writing(run, series__weight=lambda a: a / 2), "E-VAL-02"),
            Decoy("terms are damped as for CSM with A = 1",
                  lambda a, r: run(a, r, series(replaced(csm, {"attenuation": 1.0}))), "A = 0"),
            Decoy("no bias", writing(run, series__bias=np.zeros_like), "E-VAL-03"),
            Decoy("depths fill the whole period", writing(run, series__range=np.ones_like), "E-VAL-05"),
            Decoy("the bias is that of one term less", lambda a, r: run(a, r, series(
                replaced(csm, {"terms": csm.terms - 1}))) | {"series.weight": series(csm).weight}, "E-VAL-03")))


def _add_scale(recipe: Recipe, csm: Csm) -> None:
    def run(arrays: Arrays, real: Any, kind: Any = csm.depth_scale) -> Arrays:
        maps = shadow_maps_of(arrays, real)
        chain = series(csm)._replace(range=float(arrays["series.range"][0]))
        scales = [scale_of(maps, k, kind, chain) if maps.map_of[k] >= 0 else DepthScale(False, 0.0, 0.0, 0.0)
                  for k in range(len(maps.near))]
        return {"scale.origin": np.array([one.origin for one in scales]),
                "scale.slope": np.array([one.slope for one in scales])}

    every = {"maps__near": lambda a: np.where(np.isfinite(a), a.min(), a), "maps__far": lambda a: np.full_like(a, a.max())}
    unit = "depths per octave" if csm.depth_scale == "log_map" else "1/m"
    recipe.add("scale", "scale on which the depths of each map are compared", run,
               ("maps.near", "maps.far", "maps.scene_far", "series.range"),
               {"scale.origin": Spec("area light", "m", "distance of depth 0; 0 for empty maps"),
                "scale.slope": Spec("area light", unit, "depths per octave of distance, or per metre; 0 for empty maps")},
               paper="E-VAL-05", decoys=(
                   Decoy("depths are linear in metres", lambda a, r: run(a, r, "map"), "E-VAL-05: log depth"),
                   Decoy("depths are shares of the scene's extent", lambda a, r: run(a, r, "scene"), "E-VAL-05"),
                   Decoy("one scale for all maps", reading(run, **every), "E-VAL-05: what each map holds"),
                   Decoy("the farthest depth is the far end of the range",
                         writing(run, scale__slope=lambda a: a * _top(csm)), "b* is left behind the farthest blocker")))


def _top(csm: Csm) -> float:
    end = series(csm).range
    return end / max(2 * end - 1, end / 2)


def scale_at(arrays: Arrays, csm: Csm, k: int) -> DepthScale:
    """Return the scale of one map among arrays."""
    return DepthScale(csm.depth_scale == "log_map", float(arrays["scale.origin"][k]), float(arrays["scale.slope"][k]),
                      float(arrays["series.range"][0]))


def _add_series_depths(recipe: Recipe, csm: Csm) -> None:
    mirrored = csm.prefilter == "mip"

    def run(arrays: Arrays, real: Any, mirror: bool = mirrored) -> Arrays:
        depth = np.ascontiguousarray(arrays["maps.depth"], real)
        made = np.zeros_like(depth)
        for k in np.flatnonzero(arrays["scale.slope"] > 0):
            normalise(depth[k], scale_at(arrays, csm, int(k)), made[k])
            fill_beyond(beyond_disc(depth.shape[1], mirror), made[k])
        return {"maps.t": made}

    def natural(arrays: Arrays, real: Any) -> Arrays:
        return run({**arrays, "scale.slope": arrays["scale.slope"] * np.log(2)}, real)

    recipe.add("maps.t", "depths of the series: log2(z / origin) slope, 0 to the range" + (
        "; beyond the disc the texel at (s, t) / (s^2 + t^2)" if mirrored else ""), run, ("maps.depth", *SCALE),
        {"maps.t": Spec(SHEET, "1", "depth; the range where nothing is; 0 on empty maps", paper="E-VAL-05")},
        paper="E-VAL-05", exact=("maps.depth",), decoys=(
            Decoy("natural logarithms", natural, "log2"),
            Decoy("texels without surface are at depth 1", writing(run, maps__t=_empty_at_1), "E-VAL-05: wrap-around"),
            Decoy("depths are not cut at the range", reading(run, series__range=lambda a: a * 2), "E-VAL-05"),
            Decoy("the square beyond the disc " + ("holds nothing" if mirrored else "mirrors the disc"),
                  lambda a, r: run(a, r, not mirrored), "docs/methods/val_visibility")))


def _empty_at_1(t: Array) -> Array:
    return np.where(t == t.max(), 1, t).astype(t.dtype)


def _add_level_0(recipe: Recipe, csm: Csm) -> None:
    def run(arrays: Arrays, real: Any) -> Arrays:
        t = np.ascontiguousarray(arrays["maps.t"], real)
        made = np.zeros((len(t), 4 * csm.terms + 1, *t.shape[1:]), real)
        for k in np.flatnonzero(t.any(axis=(1, 2))):
            parts = [np.zeros((*t.shape[1:], 2 * csm.terms + extra), real) for extra in (0, 1)]
            fill_basis(t[k], csm.terms, False, *parts)
            made[k] = np.moveaxis(np.concatenate(parts, axis=2), 2, 0)
        return {"basis.0": made}

    def literal(c: Array, weigh: bool = True) -> Any:
        def altered(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
            t = np.asarray(arrays["maps.t"], np.float64)
            sine, cosine = (np.moveaxis(of(np.multiply.outer(t, c)), 3, 1) for of in (np.sin, np.cos))
            by = t[:, None] if weigh else 1
            made = np.concatenate([sine, cosine, by * sine, by * cosine, t[:, None]], axis=1)
            return {"basis.0": np.where(t.any(axis=(1, 2))[:, None, None, None], made, 0)}

        return altered

    k, right = np.arange(1, csm.terms + 1), frequencies(csm.terms)
    recipe.add("basis", "sines and cosines of each texel's depth, and the same times the depth", run, ("maps.t",), {
        "basis.0": Spec(CHANNELS, "1", "S_1.., C_1.., t S_1.., t C_1.., t; 0 on empty maps", paper="E-VAL-02")},
        paper="VAL Sec. 4.1, E-VAL-02", exact=("maps.t",), decoys=(
            Decoy("c_k = k pi", literal(k * np.pi), "c_k = (2k - 1) pi"),
            Decoy("c_k = 2 k pi", literal(2 * k * np.pi), "c_k = (2k - 1) pi"),
            Decoy("c_k = (2k + 1) pi", literal(right + 2 * np.pi), "k from 1 on"),
            Decoy("sines and cosines are not weighed by the depth", literal(right, weigh=False), "E-VAL-02"),
            Decoy("sines and cosines are exchanged", writing(run, basis__0=_exchanged), "E-VAL-02"),
            Decoy("sines and cosines take turns", writing(run, basis__0=_in_turns), "order of channels"),
            Decoy("the mean depth itself is left out",
                  writing(run, basis__0=lambda a: np.concatenate([a[:, :-1], 0 * a[:, -1:]], axis=1)), "E-VAL-02: Z")))


def _exchanged(basis: Array) -> Array:
    m = basis.shape[1] // 4
    return basis[:, [*range(m, 2 * m), *range(m), *range(3 * m, 4 * m), *range(2 * m, 3 * m), 4 * m]]


def _in_turns(basis: Array) -> Array:
    m = basis.shape[1] // 4
    return basis[:, [j + half for half in (0, 2 * m) for k in range(m) for j in (k, m + k)] + [4 * m]]


def level_names(recipe: Recipe) -> tuple[str, ...]:
    """Return the names of the basis and of its mip levels."""
    return tuple(name for name in recipe.specs if name.startswith("basis."))


def _add_levels(recipe: Recipe, terms: int) -> None:
    side = recipe.facts["maps"]["texels a side"]
    sides = [side]
    while sides[-1] > 1:
        sides.append((sides[-1] + 1) // 2)
    names = [f"basis.{level}" for level in range(1, len(sides))]

    def run(arrays: Arrays, real: Any) -> Arrays:
        level, made = np.ascontiguousarray(arrays["basis.0"], real), {}
        for name in names:
            level = made[name] = _halved(level, terms)
        return made

    def chained(half: Any) -> Any:
        def altered(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
            level, made = arrays["basis.0"], {}
            for name in names:
                level = made[name] = half(level)
            return made

        return altered

    recipe.facts["basis.sides"] = sides
    recipe.add("mip", "each level halves the one before by the mean of 2 x 2 texels; of an odd side the last counts twice",
               run, ("basis.0",), {name: Spec(CHANNELS, "1", f"means over {2**level} x {2**level} texels")
                                   for level, name in enumerate(names, 1)},
               paper="VAL Sec. 6", decoys=(
                   Decoy("one texel of four", chained(lambda a: a[:, :, ::2, ::2]), "means"),
                   Decoy("sums of four texels", chained(lambda a: 4 * _mean_of_four(a, "edge")), "means"),
                   Decoy("beyond an odd side is 0", chained(lambda a: _mean_of_four(a, "constant")), "docs/methods"),
                   Decoy("columns are halved alone, then rows shifted", chained(
                       lambda a: _mean_of_four(np.roll(a, -1, axis=2), "edge")), "texels 2 i and 2 i + 1"),
                   Decoy("the depth is that of the nearest texel, not the mean",
                         chained(lambda a: np.concatenate([_mean_of_four(a, "edge")[:, :-1], _least_of_four(a)], axis=1)),
                         "E-VAL-02: Z = w * z")))


def _halved(level: Array, terms: int) -> Array:
    """Return the next level by the kernel of the mip maps, whose texels are rows of channels."""
    count, _, side, _ = level.shape
    half, width = (side + 1) // 2, -(-2 * terms // EIGHT) * EIGHT
    made = np.zeros((count, level.shape[1], half, half), level.dtype)
    for k in range(count):
        texels = np.moveaxis(level[k].reshape(-1, side * side), 0, 1)
        parts = [np.zeros((side * side + half * half + EIGHT, width), level.dtype) for _ in range(2)]
        depth = np.zeros(len(parts[0]), level.dtype)
        for part, first in zip(parts, (0, 2 * terms), strict=True):
            part[: side * side, : 2 * terms] = texels[:, first : first + 2 * terms]
        depth[: side * side] = texels[:, -1]
        halve(*parts, depth, 0, side * side, side)
        new = slice(side * side, side * side + half * half)
        channels = np.concatenate([*(part[new, : 2 * terms] for part in parts), depth[new, None]], axis=1)
        made[k] = channels.T.reshape(-1, half, half)
    return made


def _padded(level: Array, mode: Any) -> Array:
    odd = level.shape[2] % 2
    return np.pad(level, ((0, 0), (0, 0), (0, odd), (0, odd)), mode=mode)


def _mean_of_four(level: Array, mode: str) -> Array:
    a = _padded(level, mode)
    return np.asarray(a[:, :, ::2, ::2] + a[:, :, ::2, 1::2] + a[:, :, 1::2, ::2] + a[:, :, 1::2, 1::2]) / 4


def _least_of_four(level: Array) -> Array:
    a = _padded(level[:, -1:], "edge")
    return np.asarray(a.reshape(*a.shape[:2], a.shape[2] // 2, 2, -1, 2).min(axis=(3, 5)))


def filters_of(arrays: Arrays, csm: Csm, k: int, real: Any, boxes: bool) -> Any:
    """Return the filtered map of area light k among arrays."""
    levels = [np.asarray(arrays[name][k], real) for name in sorted(
        (name for name in arrays if name.startswith("basis.")), key=lambda name: int(name[6:]))]
    n, basis = levels[0].shape[1], 2 * csm.terms
    if csm.prefilter == "brute":
        brute: Brute = brutes(n, csm.terms, real, box=boxes)
        brute.depth[:], brute.basis[:] = levels[0][-1], np.moveaxis(levels[0][:basis], 0, 2)
        brute.basis_z[:] = np.moveaxis(levels[0][basis:], 0, 2)
        return brute
    mip: Mip = mip_of(mips(1, n, csm.terms, real, shift=LEVEL_SHIFT), 0)
    mip.depth[:] = levels[0][-1]
    first = level_offsets(n)[0]
    for start, level in zip(first[1:], levels[1:], strict=True):
        texels = slice(start, start + level[0].size)
        flat = level.reshape(len(level), -1).T
        mip.basis[texels, :basis], mip.basis_z[texels, :basis] = flat[:, :basis], flat[:, basis : 2 * basis]
        mip.mean_depth[texels] = flat[:, -1]
    return mip

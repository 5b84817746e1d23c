"""Stages of the maps of convolution shadow maps: depths of the series, basis, mip map (VAL Sec. 4.1, 6).

A texel's channels are sin(c_k t) for all k, cos(c_k t), t sin(c_k t), t cos(c_k t), then t, its depth.
"""

from typing import Any

import numpy as np

from refgi.cluster.filters.basis import beyond_disc, fill_basis, fill_beyond, normalise
from refgi.cluster.filters.brute import Brute, brutes
from refgi.cluster.filters.eight import EIGHT
from refgi.cluster.filters.mip_build import halve
from refgi.cluster.filters.prefilter import LEVEL_SHIFT
from refgi.cluster.filters.pyramid import Mip, level_offsets, mip_of, mips
from refgi.cluster.settings import Csm
from refgi.literal import val_filters
from refgi.literal import val_maps as literal
from refgi.vectors.recipe import Recipe
from refgi.vectors.rows import Form
from refgi.vectors.spec import Array, Arrays, Spec
from refgi.vectors.stages.val_maps import SHEET
from refgi.vectors.stages.val_series import SCALE, add_scale, add_series, scale_at

CHANNELS = "area light, channel, row, column"


def add_basis(recipe: Recipe, csm: Csm) -> None:
    """Add the series and its scale on each map, then depths, basis and mip map."""
    add_series(recipe, csm)
    add_scale(recipe, csm)
    _add_series_depths(recipe, csm)
    _add_level_0(recipe, csm)
    if csm.prefilter == "mip":
        _add_levels(recipe, csm)


def _add_series_depths(recipe: Recipe, csm: Csm) -> None:
    mirrored = csm.prefilter == "mip"

    def run(arrays: Arrays, real: Any) -> Arrays:
        depth = np.ascontiguousarray(arrays["maps.depth"], real)
        made = np.zeros_like(depth)
        for k in np.flatnonzero(arrays["scale.slope"] > 0):
            normalise(depth[k], scale_at(arrays, csm, int(k)), made[k])
            fill_beyond(beyond_disc(depth.shape[1], mirrored), made[k])
        return {"maps.t": made}

    logs = csm.depth_scale == "log_map"
    form = Form(literal.map_depths, {"depth": "maps.depth", "origin": SCALE[0], "slope": SCALE[1], "end": SCALE[2]},
                ("maps.t",), {"logarithmic": logs, "mirrored": mirrored})
    lists = ("map_depths/log_map" if logs else "map_depths/linear", *(("map_depths/mirrored",) if mirrored else ()))
    recipe.add("maps.t", "depths of the series: log2(z / origin) slope, 0 to the range" + (
        "; beyond the disc the texel at (s, t) min(1 / r, 1 - 1.5 / n) / r" if mirrored else ""), run,
        ("maps.depth", *SCALE),
        {"maps.t": Spec(SHEET, "1", "depth; the range where nothing is; 0 on empty maps", paper="E-VAL-05")},
        paper="E-VAL-05", exact=("maps.depth",), bugs=form.bugs("map_depths", *lists), variants=(form,))


def _add_level_0(recipe: Recipe, csm: Csm) -> None:
    quantised = csm.quantisation == "published"

    def run(arrays: Arrays, real: Any) -> Arrays:
        t = np.ascontiguousarray(arrays["maps.t"], real)
        made = np.zeros((len(t), 4 * csm.terms + 1, *t.shape[1:]), real)
        for k in np.flatnonzero(t.any(axis=(1, 2))):
            parts = [np.zeros((*t.shape[1:], 2 * csm.terms + extra), real) for extra in (0, 1)]
            fill_basis(t[k], csm.terms, quantised, *parts)
            made[k] = np.moveaxis(np.concatenate(parts, axis=2), 2, 0)
        return {"basis.0": made}

    form = Form(literal.basis, {"t": "maps.t"}, ("basis.0",), {"terms": csm.terms, "in_bytes": quantised})
    if quantised:
        recipe.facts["basis.stored"] = {"sines and cosines": "8 bits: floor((x + 1) 127.5 + 0.5001) / 127.5 - 1",
                                        "times the depth, and the depth": "half floats"}
    recipe.add("basis", "sines and cosines of each texel's depth, and the same times the depth" + (
        ", in 8 and 16 bits" if quantised else ""), run, ("maps.t",), {
        "basis.0": Spec(CHANNELS, "1", "S_1.., C_1.., t S_1.., t C_1.., t; 0 on empty maps", paper="E-VAL-02")},
        paper="VAL Sec. 4.1, E-VAL-02" + (", 6" if quantised else ""), exact=("maps.t",), variants=(form,),
        bugs=form.bugs("basis", *(("basis/bytes",) if quantised else ())))


def level_names(recipe: Recipe) -> tuple[str, ...]:
    """Return the names of the basis and of its mip levels."""
    return tuple(name for name in recipe.specs if name.startswith("basis."))


def _add_levels(recipe: Recipe, csm: Csm) -> None:
    terms, quantised = csm.terms, csm.quantisation == "published"
    side = recipe.facts["maps"]["texels a side"]
    sides = [side]
    while sides[-1] > 1:
        sides.append((sides[-1] + 1) // 2)
    names = [f"basis.{level}" for level in range(1, len(sides))]

    def run(arrays: Arrays, real: Any) -> Arrays:
        level, made = np.ascontiguousarray(arrays["basis.0"], real), {}
        for name in names:
            level = _halved(level, terms)
            level = made[name] = literal.rounded_level(level) if quantised else level
        return made

    form = Form(val_filters.mip_levels, {"basis": "basis.0"}, tuple(names), {"in_bytes": quantised})
    recipe.facts["basis.sides"] = sides
    recipe.add("mip", "each level halves the one before by means of 2 x 2 texels; of an odd side the last counts twice",
               run, ("basis.0",), {name: Spec(CHANNELS, "1", f"means over {2**level} x {2**level} texels")
                                   for level, name in enumerate(names, 1)},
               paper="VAL Sec. 6", variants=(form,),
               bugs=form.bugs("mip_levels", *(("mip_levels/bytes",) if quantised else ())))


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
        halve(parts[0], parts[1], depth, 0, side * side, side)
        new = slice(side * side, side * side + half * half)
        channels = np.concatenate([*(part[new, : 2 * terms] for part in parts), depth[new, None]], axis=1)
        made[k] = channels.T.reshape(-1, half, half)
    return made


def filters_of(arrays: Arrays, csm: Csm, k: int, real: Any, boxes: bool) -> Any:
    """Return the filtered map of area light k among arrays."""
    levels = [np.asarray(arrays[name][k], real) for name in sorted(
        (name for name in arrays if name.startswith("basis.")), key=lambda name: int(name[6:]))]
    n, basis = levels[0].shape[1], 2 * csm.terms
    quantised = csm.quantisation == "published"
    if csm.prefilter == "brute":
        brute: Brute = brutes(n, csm.terms, real, box=boxes)
        brute.depth[:], brute.basis[:] = levels[0][-1], np.moveaxis(levels[0][:basis], 0, 2)
        brute.basis_z[:] = np.moveaxis(levels[0][basis:], 0, 2)
        return brute
    mip: Mip = mip_of(mips(1, n, csm.terms, real, shift=LEVEL_SHIFT, quantised=quantised), 0)
    mip.depth[:] = arrays["maps.t"][k] if quantised else levels[0][-1]  # of which the kernel makes the basis
    first = level_offsets(n)[0]
    for start, level in zip(first[1:], levels[1:], strict=True):
        texels = slice(start, start + level[0].size)
        flat = level.reshape(len(level), -1).T
        mip.basis[texels, :basis], mip.basis_z[texels, :basis] = flat[:, :basis], flat[:, basis : 2 * basis]
        mip.mean_depth[texels] = flat[:, -1]
    return mip

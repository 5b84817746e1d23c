"""From subsplats to pixels, coarsest level first (AMS Sec. 3.5: Nichols and Wyman 2009; E-AMS-09); the whole method.

Each layer of the illumination buffer holds all of a cell's light or none: interpolated by itself it makes halos and
rings (Fig. 7). So the light of the coarser level is doubled, cells that were evaluated at this level (leaves) are
inserted, the result is filtered among the cells that hold light, down to the pixels. At an edge of depth only
the cells that were refined there keep light apart: no weight knows depths or normals.

Symbols: C light of a cell, W/m^2; m 1 where it holds any; w weight; level, row, column (n,) and irradiance (3, n) of
the list of subsplats; `at` the level at hand; `top` the coarsest level, `finest` that which is never refined. A test
against a threshold that is None is not made.
"""

from typing import Any

import numpy as np

from refgi.literal.multires import (
    curvatures,
    depth_ranges,
    discontinuities,
    grid,
    normal_ranges,
    of_cells,
    representatives,
    slopes,
    states,
    subsplats,
)
from refgi.literal.multires_lights import detail, lists, points, samples, splits, subsplat_irradiance

TENT = (1, 2, 1)


def upsample(
    triangle_id: Any, level: Any, row: Any, column: Any, irradiance: Any, top: int, mode: str,
    filter_all: bool = False, corner_rule: bool = True,
) -> Any:
    """Return E (3, h, w) at every pixel, 0 without surface, of subsplats of levels 0 to top.

    Modes: "tent", "demo"; "nearest": each pixel has the light of its subsplat; "naive_bilinear": Fig. 7.
    """
    subsplats = level, row, column, irradiance
    if mode == "nearest":
        return nearest(triangle_id, *subsplats)
    if mode == "naive_bilinear":
        return naive_bilinear(triangle_id, *subsplats, top)
    light, known = None, None
    for at in range(top, -1, -1):
        light, known = upsample_level(triangle_id, *subsplats, at, mode, filter_all, corner_rule, light, known)
    return light


def sum_of_pictures(
    triangle_id: Any, first: Any, level: Any, row: Any, column: Any, irradiance: Any, top: int, mode: str,
    filter_all: bool = False, corner_rule: bool = True,
) -> Any:
    """Return E (3, h, w) of all lights, each light's own list upsampled by itself (Sec. 3.3.1).

    first: (N + 1,), where each light's list begins.
    """
    total = np.zeros((3, *triangle_id.shape), irradiance.dtype)
    for k in range(len(first) - 1):
        own = slice(first[k], first[k + 1])
        listed = level[own], row[own], column[own], irradiance[:, own]
        total = total + upsample(triangle_id, *listed, top, mode, filter_all, corner_rule)
    return total


def upsample_level(
    triangle_id: Any, level: Any, row: Any, column: Any, irradiance: Any, at: int, mode: str, filter_all: bool,
    corner_rule: bool, coarse: Any = None, coarse_known: Any = None,
) -> tuple[Any, Any]:
    """Return light C (3, h_l, w_l) and mask m of a level from those of the level above; None above the coarsest.

    `filter_all`: leaves are filtered as well, as published; `corner_rule`: a cell across a corner counts only beside
    one that counts.
    """
    shown = of_cells(lambda cell: cell.any(), triangle_id >= 0, at)
    own, leaf = layer(level, row, column, irradiance, at, shown.shape)
    if coarse is None:
        filter_all = filter_all and mode == "tent"  # the demo's coarsest level is its layer as it is
        coarse, coarse_known = np.zeros((3, *grid(shown.shape, 1)), own.dtype), np.zeros(grid(shown.shape, 1), bool)
    i, j = np.indices(shown.shape) // 2  # a cell lies in cell i / 2, j / 2 of the level above
    inherited = coarse_known[i, j] & shown
    known = inherited | leaf
    texels = np.where(leaf, own, coarse[:, i, j]) * known
    filtered = tent(texels, known, corner_rule) if mode == "tent" else demo(own, leaf, coarse, coarse_known)
    copied = leaf & (not filter_all)
    return np.where(known, np.where(copied, texels, filtered), 0), known


def layer(level: Any, row: Any, column: Any, irradiance: Any, at: int, shape: Any) -> tuple[Any, Any]:
    """Return the light of a level's own subsplats (3, h_l, w_l), 0 elsewhere, and where they are."""
    here = level == at
    own, leaf = np.zeros((3, *shape), irradiance.dtype), np.zeros(shape, bool)
    own[:, row[here], column[here]] = irradiance[:, here]
    leaf[row[here], column[here]] = True
    return own, leaf


def tent(texels: Any, known: Any, corner_rule: bool) -> Any:
    """Return sum m w C / sum m w of the 3 x 3 texels around each, w = (1, 2, 1) x (1, 2, 1), clamped at the border.

    Where the light comes from the coarser level alone this is its bilinear interpolation (E-AMS-09).
    """
    rows, columns = known.shape
    around, m = np.pad(texels, ((0, 0), (1, 1), (1, 1)), mode="edge"), np.pad(known, 1, mode="edge")
    light, weight = np.zeros_like(texels), np.zeros(known.shape, texels.dtype)
    for y, x in np.ndindex(3, 3):
        there = (..., slice(y, y + rows), slice(x, x + columns))
        counts = m[there]
        above, left = m[y : y + rows, 1:-1], m[1:-1, x : x + columns]
        if corner_rule and y != 1 and x != 1:
            counts = counts & (above | left)
        w = (TENT[y] * TENT[x] * counts).astype(texels.dtype)
        light = light + w * around[there]
        weight = weight + w
    return np.divide(light, weight, out=np.zeros_like(light), where=weight > 0)


def demo(own: Any, leaf: Any, coarse: Any, coarse_known: Any) -> Any:
    """Return the filter of the authors' demo: weights (1 - f, 1, f) on the level above, f the place in its cell.

    Where that holds nothing the neighbour at the texel's own level counts, a corner only beside a tap that counts.
    """
    i, j = np.indices(leaf.shape)
    down, across = np.where(i % 2, 0.75, 0.25).astype(own.dtype), np.where(j % 2, 0.75, 0.25).astype(own.dtype)
    taps, known = {}, {}
    for y, x in np.ndindex(3, 3):
        above = tuple(np.clip(k // 2 + step - 1, 0, size - 1) for k, step, size in
                      zip((i, j), (y, x), coarse_known.shape, strict=True))
        beside = tuple(np.clip(k + step - 1, 0, size - 1) for k, step, size in
                       zip((i, j), (y, x), leaf.shape, strict=True))
        known[y, x] = coarse_known[above] | leaf[beside]
        taps[y, x] = np.where(coarse_known[above], coarse[:, *above], own[:, *beside])
    total, weights = np.zeros_like(own), np.zeros(leaf.shape, own.dtype)
    for y, x in np.ndindex(3, 3):
        counts = known[y, x] & (known[y, 1] | known[1, x] | (y == 1) | (x == 1))
        w = ((1 - down, 1, down)[y] * (1 - across, 1, across)[x] * counts).astype(own.dtype)
        total = total + w * taps[y, x]
        weights = weights + w
    return np.divide(total, weights, out=np.zeros_like(total), where=weights > 0)


# without levels: Fig. 7


def nearest(triangle_id: Any, level: Any, row: Any, column: Any, irradiance: Any) -> Any:
    """Return E (3, h, w): each pixel that shows a surface has the light of its subsplat."""
    shown, picture = triangle_id >= 0, np.zeros((3, *triangle_id.shape), irradiance.dtype)
    for k in range(len(level)):
        side = 1 << level[k]
        y, x = row[k] * side, column[k] * side
        cell = slice(y, y + side), slice(x, x + side)
        picture[:, *cell][:, shown[cell]] = irradiance[:, k, None]
    return picture


def naive_bilinear(triangle_id: Any, level: Any, row: Any, column: Any, irradiance: Any, top: int) -> Any:
    """Return E (3, h, w): the sum of all levels, each interpolated as if it were black where it holds nothing."""
    picture = np.zeros((3, *triangle_id.shape), irradiance.dtype)
    for at in range(top + 1):
        own, _ = layer(level, row, column, irradiance, at, grid(triangle_id.shape, at))
        down, across = (hats(pixels, texels, at).astype(own.dtype)
                        for pixels, texels in zip(triangle_id.shape, own.shape[1:], strict=True))
        picture = picture + down @ own @ across.T
    return np.where(triangle_id >= 0, picture, 0)


def hats(pixels: int, texels: int, at: int) -> Any:
    """Return the weights (pixels, texels) of linear interpolation between centres of a level, clamped at the border."""
    place = np.clip((np.arange(pixels) + 0.5) / 2**at - 0.5, 0, texels - 1)
    return np.maximum(0, 1 - np.abs(place[:, None] - np.arange(texels)))


def multires(
    position: Any, normal: Any, depth: Any, triangle_id: Any, camera: Any, light_position: Any, light_normal: Any,
    flux: Any, lobe_flux: Any = None, lobe_axis: Any = None, lobe_exponent: Any = None, area: Any = None, *, top: int,
    finest: int, mean: bool, mode: str, filter_all: bool, corner_rule: bool, a: float, **tests: Any,
) -> Any:
    """Return E (3, h, w), W/m^2, by one list of subsplats for all lights; `tests` are those of `geometry_list`."""
    # Sec. 3.2 and 3.3: which cells of the picture are subsplats
    level, row, column, pixel = geometry_list(position, normal, depth, triangle_id, top=top, finest=finest, **tests)
    # Sec. 3.4: their light
    place, up = points(position, normal, triangle_id, level, row, column, pixel, mean)
    light = subsplat_irradiance(place, up, light_position, light_normal, flux, lobe_flux, lobe_axis, lobe_exponent,
                                area)
    # Sec. 3.5: from subsplats to pixels
    picture = upsample(triangle_id, level, row, column, light, top, mode, filter_all, corner_rule)
    return detail(picture, position, normal, triangle_id, camera, a)


def multires_of_lights(
    position: Any, normal: Any, triangle_id: Any, camera: Any, light_position: Any, light_normal: Any, flux: Any,
    lobe_flux: Any = None, lobe_axis: Any = None, lobe_exponent: Any = None, area: Any = None, *, top: int,
    finest: int, threshold: float, form: str, mode: str, filter_all: bool, corner_rule: bool, a: float,
) -> Any:
    """Return E (3, h, w), W/m^2, by a list for each light, refined by its own irradiance (Sec. 3.3.1)."""
    pixels = representatives(triangle_id, top)
    sampled = samples(position, normal, pixels, light_position, light_normal, flux, lobe_flux, lobe_axis,
                      lobe_exponent, area)
    split = splits(pixels, sampled, finest, threshold, form)
    listed: tuple[Any, Any, Any, Any, Any] = lists(pixels, sampled, split)
    picture = sum_of_pictures(triangle_id, *listed, top, mode, filter_all, corner_rule)
    return detail(picture, position, normal, triangle_id, camera, a)


def geometry_list(
    position: Any, normal: Any, depth: Any, triangle_id: Any, *, top: int, finest: int, rim: int, diagonal: str,
    depth_threshold: float | None = None, depth_measure: str = "", slope_threshold: float | None = None,
    slope_measure: str = "", normal_threshold: float | None = None, components: int = 3,
    curvature_threshold: float | None = None, rate: bool = False,
) -> tuple[Any, ...]:
    """Return level, row, column and representative pixel (n,) of the subsplats that geometry asks for (Sec. 3.2)."""
    tests: dict[str, Any] = {}
    if depth_threshold is not None:
        both = depth_ranges(depth, triangle_id, top, rim)
        tests |= {"depth_least": both[:top], "depth_largest": both[top:], "depth_threshold": depth_threshold,
                  "depth_measure": depth_measure}
    if slope_threshold is not None:
        tests |= {"slope": slopes(depth, triangle_id, top, slope_measure != "absolute"),
                  "slope_threshold": slope_threshold, "slope_measure": slope_measure}
    if normal_threshold is not None:
        both = normal_ranges(normal, triangle_id, top, rim, components)
        tests |= {"normal_least": both[:top], "normal_largest": both[top:], "normal_threshold": normal_threshold}
    if curvature_threshold is not None:
        tests |= {"curvature": curvatures(normal, position, triangle_id, top, rate),
                  "curvature_threshold": curvature_threshold}
    marked = discontinuities(top, finest, **tests)
    return subsplats(triangle_id, states(marked, triangle_id, diagonal), finest)

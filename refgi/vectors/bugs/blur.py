"""Likely bugs of the blur along surfaces: the stage written out, with a keyword for each bug."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from refgi.sssil.settings import GeometryBlur
from refgi.vectors.spec import Array, Arrays, Bug

BLUR = "docs/methods/hssil: mean over a tile's texels on one plane (after Keller and Heidrich 2001)"
BOX, SURFACE = "a box of n texels about the centre", "|n . (x' - x)| <= tolerance z and n . n' >= cosine"
Box = dict[int, float]


class Texels(NamedTuple):
    """A texel and one of its window, for all texels; NaN where there is none."""

    d: Array  # from one to the other, xyz
    normal: Array
    other: Array  # normal of the other
    depth: Array
    other_depth: Array
    tolerance: float
    cosine: float

    @property
    def limit(self) -> Array:
        """Distance from the plane that is allowed."""
        return np.asarray(self.tolerance * self.depth)


def box_of(size: int) -> Box:
    """Return the weights of a window of `size` texels by their place: the rim of an even one is cut in half."""
    half = size // 2
    return {k: 0.5 if 2 * abs(k) == size else 1.0 for k in range(-half, half + 1)}


def offset(t: Texels) -> Array:
    """Return the distance from the texel's tangent plane."""
    return np.asarray(np.abs((t.normal * t.d).sum(axis=0)))


def facing(t: Texels) -> Array:
    """Return the cosine between the normals."""
    return np.asarray((t.normal * t.other).sum(axis=0))


def one_surface(t: Texels) -> Array:
    """Return whether both are of one surface."""
    return np.asarray((offset(t) <= t.limit) & (facing(t) >= t.cosine))


def boxed(
    arrays: Arrays, light: str, planes: tuple[str, ...], settings: GeometryBlur, *, box: Box | None = None,
    same: Callable[[Texels], Array] = one_surface, dark: bool = False, axes: str = "rows, columns",
    edge: str = "none", void: bool = False, soft: Callable[[Texels], Array] | None = None, restart: bool = False,
    contiguous: bool = False, own: bool = True,
) -> Array:
    """Return means over windows, in float64, with a bug; `box`: weights of the texels by their place in the window."""
    values = start = np.asarray(arrays[light], np.float64)
    place, normal, depth = (np.asarray(arrays[name], np.float64) for name in planes)
    seen, box = np.isfinite(depth), box_of(settings.size) if box is None else box
    rows, columns = {(0, k): w for k, w in box.items()}, {(k, 0): w for k, w in box.items()}
    both = {(i, j): v * w for i, v in box.items() for j, w in box.items()}
    for window in {"rows, columns": [rows, columns], "columns, rows": [columns, rows], "rows": [rows],
                   "columns": [columns], "both": [both]}[axes]:
        total, count = np.zeros_like(values), np.zeros_like(depth)
        source, broken = start if restart else values, {1: ~seen, -1: ~seen}
        for step, weight in sorted(window.items(), key=lambda one: abs(one[0][0]) + abs(one[0][1])):
            t = Texels(_beside(place, step, edge) - place, normal, _beside(normal, step, edge),
                       np.where(seen, depth, 0), _beside(depth, step, edge), settings.plane_tolerance,
                       settings.cosine)
            inside = ~np.isnan(t.other_depth)
            on = same(t)
            on = np.asarray(on & inside & (void | np.isfinite(t.other_depth)))
            if step == (0, 0):
                on = np.full(on.shape, own)
            elif contiguous:
                side = 1 if sum(step) > 0 else -1
                broken[side] = broken[side] | ~on
                on = ~broken[side]
            share = weight * (soft(t) if soft else 1.0)
            total += np.where(on, share * np.nan_to_num(_beside(source, step, edge)), 0)
            count += np.where(on | dark, np.nan_to_num(np.broadcast_to(share, depth.shape)), 0)
        values = np.where(seen & (count > 0), total / np.where(count > 0, count, 1), 0)
    return values


def blur_bugs(light: str, name: str, planes: tuple[str, ...], settings: GeometryBlur) -> list[Bug]:
    """Return the bugs of the blur of a level; it makes `name` of `light` and the level's planes."""
    def bug(cause: str, paper: str, **knobs: Any) -> Bug:
        return Bug(cause, lambda arrays, real: {name: boxed(arrays, light, planes, settings, **knobs)},  # noqa: ARG005
                   paper)

    size, half = settings.size, settings.size // 2
    ones: Callable[[int, int], Box] = lambda first, last: dict.fromkeys(range(first, last + 1), 1.0)  # noqa: E731
    box = box_of(size)
    bugs = [
        bug("the window is twice as wide: its size is taken for its radius (reach)", BOX, box=box_of(2 * size)),
        bug("the window is twice as wide: its size is taken for its radius (reach), halved where its rim should be",
            BOX, box=ones(-size, size) | box),
        bug("the window is half as wide: half the size, the radius too small", BOX, box=box_of(half)),
        bug("the window is one texel wider on each side: reach + 1", BOX, box=ones(-half - 1, half + 1)),
        bug("the last texel of the window is left out: < in place of <=", BOX, box={
            k: w for k, w in box.items() if k < half}),
        bug("the first texel of the window is left out", BOX, box={k: w for k, w in box.items() if k > -half}),
        bug("the window lies on one side of the texel alone", BOX, box=ones(0, size - 1)),
        bug("the texel itself is left out of its window", BOX, own=False),
        bug("the window's weights fall off like a tent, no box", BOX, box={
            k: 1 - abs(k) / (half + 1) for k in box}),
        bug("nothing is averaged", BLUR, box={0: 1.0}),
        bug("along rows alone: the pass along columns is missing", "rows, then columns", axes="rows"),
        bug("along columns alone: the pass along rows is missing", "rows, then columns", axes="columns"),
        bug("along columns first, then rows: the order of the passes", "rows, then columns", axes="columns, rows"),
        bug("one window of rows and columns together", "rows, then columns", axes="both"),
        bug("the second pass reads the light before the first one: the passes do not follow each other",
            "rows, then columns", restart=True),
        bug("what is left out counts as dark: divided by the whole window, not normalised by the sum of the weights "
            "that count", BLUR, dark=True),
        bug("beyond the edge the texel at the border is repeated: clamped", "texels outside do not count", edge="edge"),
        bug("beyond the edge the picture starts again from the other side: wrapped", "texels outside do not count",
            edge="wrap"),
        bug("the window ends at the first texel of another surface", BLUR, contiguous=True),
        bug("weights are the cosines between normals", BLUR, soft=lambda t: np.maximum(facing(t), 0)),
    ]
    if size % 2 == 0:
        bugs += [
            bug("texels that the window's rim halves count whole", BOX, box=ones(-half, half)),
            bug("texels that the window's rim halves are left out", BOX, box=ones(-half + 1, half - 1)),
            bug("the window lies half a texel beside the texel: one more after it than before", BOX, box=ones(
                -half + 1, half)),
            bug("the window lies half a texel beside the texel: one more before it than after", BOX, box=ones(
                -half, half - 1)),
        ]
    surfaces: list[tuple[str, Callable[[Texels], Array]]] = [
        ("planes are not compared", lambda t: facing(t) >= t.cosine),
        ("normals are not compared", lambda t: offset(t) <= t.limit),
        ("neither planes nor normals are compared: a plain box", lambda t: facing(t) >= -2),
        ("the plane or the normals must agree, not both", lambda t: (
            (offset(t) <= t.limit) | (facing(t) >= t.cosine))),
        ("the tolerance is in metres, not a share of the depth", lambda t: (
            (offset(t) <= t.tolerance) & (facing(t) >= t.cosine))),
        ("the tolerance is a share of the other texel's depth, not of the texel's own", lambda t: (
            (offset(t) <= t.tolerance * t.other_depth) & (facing(t) >= t.cosine))),
        ("the tolerance is twice as large", lambda t: (
            (offset(t) <= 2 * t.limit) & (facing(t) >= t.cosine))),
        ("the tolerance is half as large", lambda t: (
            (offset(t) <= 0.5 * t.limit) & (facing(t) >= t.cosine))),
        ("distances of points in place of distances from the tangent plane", lambda t: (
            (np.sqrt((t.d**2).sum(axis=0)) <= t.limit) & (facing(t) >= t.cosine))),
        ("differences of depth in place of distances from the tangent plane", lambda t: (
            (np.abs(t.other_depth - t.depth) <= t.limit) & (facing(t) >= t.cosine))),
        ("the other texel's tangent plane in place of the texel's own", lambda t: (
            (np.abs((t.other * t.d).sum(axis=0)) <= t.limit) & (facing(t) >= t.cosine))),
        ("the sign of the distance from the plane counts: no absolute value", lambda t: (
            ((t.normal * t.d).sum(axis=0) <= t.limit) & (facing(t) >= t.cosine))),
        ("the distance from the plane is squared before it is compared", lambda t: (
            (offset(t) ** 2 <= t.limit) & (facing(t) >= t.cosine))),
        ("normals must be equal", lambda t: (
            (offset(t) <= t.limit) & (facing(t) >= 1 - 1e-6))),
        ("normals agree below the cosine, not above: < in place of >=", lambda t: (
            (offset(t) <= t.limit) & (facing(t) < t.cosine))),
    ]
    return [*bugs, *(bug(cause, SURFACE, same=same) for cause, same in surfaces)]


def _beside(array: Array, step: tuple[int, int], edge: str) -> Array:
    """Return each texel's neighbour some rows down and columns to the right; NaN beyond the edge, or as `edge` says."""
    (dy, dx), (h, w) = step, array.shape[-2:]
    i, j = np.arange(h)[:, None] + dy, np.arange(w) + dx
    outside = (i < 0) | (i >= h) | (j < 0) | (j >= w)
    if edge == "wrap":
        return np.asarray(array[..., i % h, j % w])
    there = array[..., np.clip(i, 0, h - 1), np.clip(j, 0, w - 1)]
    return np.asarray(there if edge == "edge" else np.where(outside, np.nan, there))

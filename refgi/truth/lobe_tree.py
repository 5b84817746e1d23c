"""A tree of groups of four over lobes of senders: each group a ball of places and cones of axes and normals.

Lobes are sorted like a kd-tree, by the coordinate of place or axis in which they are furthest apart, into halves of
halves: group j of level l holds the lobes of ranks j n / 4^l to (j + 1) n / 4^l, its children are 4j to 4j + 3.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]

TOP_LEVEL = 5  # 1024 groups: what a receiver looks at before it goes into one
FLAT = 0.5  # blur of a mirror's image of the light, in widths of its lobes, below which it counts as plane
ROWS = 14


class Lobe(NamedTuple):
    """Lobes, or groups of them."""

    position: Array  # (m, 3) m
    radius: Array  # (m,) m
    axis: Array  # (m, 3)
    spread: Array  # (m,) rad: half-angle of the axes' cone
    width: Array  # (m,) w^2, rad^2
    power: Array  # (m,) flux over pi, W/sr
    facing: Array  # (m, 3) face normal
    tilt: Array  # (m,) rad: half-angle of the face normals' cone
    thick: Array  # (m,) m: off the plane across that normal
    normal: Array  # (m, 3) shading normal
    bend: Array  # (m,) rad: half-angle of the shading normals' cone
    offset: Array  # (m,) m: off the plane across that normal
    height: Array  # (m,) m: of the light above that plane; inf for a directional light
    light: Array  # (m,) which; -1: several

    @classmethod
    def dark(cls, count: int) -> "Lobe":
        """Return lobes without power."""
        shapes = [(count, 3) if name in ("position", "axis", "facing", "normal") else (count,) for name in cls._fields]
        return cls(*(np.zeros(shape) for shape in shapes))


class LobeTree(NamedTuple):
    """The groups of all levels from the top one down, level by level; the last level's have one lobe or none."""

    lobes: int
    top: int  # level of the first groups
    deepest: int
    row: Array  # (n, ROWS) float32: position, radius, axis, w^2 + spread^2, power, face normal, thickness, sine of tilt
    columns: Array  # (ROWS, t) float32: of the top level alone, for SIMD lanes
    mirror: Array  # (n, 8) float64: a point and the normal of the plane that mirrors the light, exponent + 1 of what is
    #                sent by that, 1 where that may be used


def tree_of(lobes: Lobe) -> tuple[Array, LobeTree]:
    """Return the order (m,) of lobes, and their tree."""
    count = len(lobes.power)
    deepest = 0
    while 4**deepest < count:
        deepest += 1
    order = _sorted(lobes, 2 * deepest)
    top = min(TOP_LEVEL, deepest)
    levels = [_spaced(Lobe(*(field[order] for field in lobes)), 4**deepest)]
    while len(levels[0].power) > 4**top:
        levels.insert(0, _groups(levels[0]))
    whole = Lobe(*(np.concatenate(fields) for fields in zip(*levels, strict=True)))
    spread, tilt = np.minimum(whole.spread, 2) ** 2 + whole.width, np.sin(np.minimum(whole.tilt, 0.5 * np.pi))
    row = np.column_stack([whole.position, whole.radius, whole.axis, spread, whole.power, whole.facing, whole.thick,
                           tilt]).astype(np.float32)
    single = np.arange(len(spread)) >= len(spread) - 4**deepest
    return order, LobeTree(count, top, deepest, row, np.ascontiguousarray(row[: 4**top].T), _mirrors(whole, single))


def _sorted(lobes: Lobe, halvings: int) -> Array:
    """Return the order of the lobes: halved again and again by the coordinate in which they are furthest apart."""
    count = len(lobes.power)
    order = np.arange(count)
    if not count:
        return order
    extent = max(float(np.ptp(lobes.position, axis=0).max()), 1e-30)
    place = np.column_stack([lobes.position / extent, lobes.axis])
    for level in range(halvings):
        starts = np.arange(2**level + 1) * count // 2**level
        sizes = np.diff(starts)
        some = starts[:-1][sizes > 0]
        sorted_place = place[order]
        far = np.maximum.reduceat(sorted_place, some) - np.minimum.reduceat(sorted_place, some)
        segment = np.repeat(np.arange(len(some)), sizes[sizes > 0])
        order = order[np.lexsort((sorted_place[np.arange(count), far.argmax(axis=1)[segment]], segment))]
    return order


def _spaced(lobes: Lobe, places: int) -> Lobe:
    """Put lobes where a last level of so many groups has them."""
    count, found = len(lobes.power), Lobe.dark(places)
    at = (np.arange(1, count + 1) * places - 1) // max(1, count)
    for field, filled in zip(lobes, found, strict=True):
        filled[at] = field
    found.width[found.power == 0] = 1
    return found


def _groups(lobes: Lobe) -> Lobe:
    """Describe each four by a ball and cones around theirs."""
    four = Lobe(*(field.reshape(-1, 4, *field.shape[1:]) for field in lobes))
    total, lit = four.power.sum(axis=1), four.power > 0
    share = four.power / np.where(total > 0, total, 1)[:, None]
    position, axis, facing, normal = ((share[..., None] * field).sum(axis=1) for field in
                                      (four.position, four.axis, four.facing, four.normal))
    for mean in (axis, facing, normal):
        mean /= np.maximum(np.linalg.norm(mean, axis=1), 1e-30)[:, None]
    apart = four.position - position[:, None]

    def most(values: Array) -> Array:
        return np.asarray(np.where(lit, values, 0).max(axis=1))

    def cone(vectors: Array, mean: Array, spread: Array) -> Array:
        return most(2 * np.arcsin(np.minimum(0.5 * np.linalg.norm(vectors - mean[:, None], axis=2), 1)) + spread)

    def slab(vectors: Array, mean: Array, thick: Array) -> Array:
        lean = np.minimum(1, np.linalg.norm(vectors - mean[:, None], axis=2))
        return most(np.abs((apart * mean[:, None]).sum(axis=2)) + thick + four.radius * lean)

    first = np.where(lit, four.light, np.inf).min(axis=1)
    return Lobe(position, most(np.linalg.norm(apart, axis=2) + four.radius), axis, cone(four.axis, axis, four.spread),
                np.where(total > 0, (share * four.width).sum(axis=1), 1), total,
                facing, cone(four.facing, facing, four.tilt), slab(four.facing, facing, four.thick),
                normal, cone(four.normal, normal, four.bend), slab(four.normal, normal, four.offset),
                np.where(lit, four.height, np.inf).min(axis=1), np.where(first == most(four.light), first, -1))


def _mirrors(lobes: Lobe, single: Array) -> Array:
    """Return the plane mirror that each group nearly is; where it is none, its children are asked instead."""
    known = (lobes.power > 0) & (lobes.height > 0) & (lobes.light >= 0)
    height = np.where(known, lobes.height, 1)
    blur = (2 * lobes.bend) ** 2 + (2 * lobes.offset / height) ** 2
    usable = known & (single | (blur < FLAT**2 * lobes.width))
    return np.column_stack([lobes.position, lobes.normal, 1 / (lobes.width + blur), usable])

"""A binary tree of groups over lobes of senders: each group a ball of places and cones of axes and normals.

Groups are split in the middle of the coordinate in which they are furthest apart: place, axis, face normal or light. So
faces part early, and what differs little stays together.
"""

import heapq
from typing import Any, NamedTuple

import numpy as np

from refgi.types import Array

TOPS = 1024  # groups that a receiver looks at before it goes into one
HALVED = 40  # level from which groups are split by number: lobes of one place and axis
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
    """The groups; node 0 is all."""

    child: Array  # (n,) int32: first of two; -1: one lobe
    parent: Array  # (n,) int32; -1 for top groups
    lobe: Array  # (n,) int32: rank of its first lobe
    single: Array  # (m,) int32: the node of each lobe, by rank
    row: Array  # (n, ROWS) float32: position, radius, axis, w^2 + spread^2, power, face normal, thickness, sine of tilt
    top: Array  # (t,) int32: groups that hold every lobe once, each small enough to be told from the others
    columns: Array  # (ROWS, t) float32: `row` of those, for SIMD lanes
    top_of: Array  # (n,) int32: which of them a node is; -1
    plane: Array  # (t, 3) int32: the largest group around each that mirrors the light, and its first top group and one
    #               past its last; -1 where it is smaller than the top group
    mirror: Array  # (n, 8) float64: a point and the normal of the plane that mirrors the light, exponent + 1 of what is
    #                sent by that, 1 where that may be used


class _Groups(NamedTuple):
    start: Array  # (g,) int64: first lobe in the order
    size: Array  # (g,)


def tree_of(lobes: Lobe) -> tuple[Array, LobeTree]:
    """Return the order (m,) of lobes, and their tree; of at least one lobe."""
    order, levels = _split(lobes)
    ordered = Lobe(*(field[order] for field in lobes))
    starts = np.cumsum([0] + [len(level.size) for level in levels])
    whole = Lobe.dark(int(starts[-1]))
    child, parent = np.full(len(whole.power), -1, np.int32), np.full(len(whole.power), -1, np.int32)
    single = np.zeros(len(order), np.int32)
    for level in range(len(levels) - 1, -1, -1):
        groups, nodes = levels[level], np.arange(starts[level], starts[level + 1])
        one = groups.size == 1
        _put(whole, nodes[one], Lobe(*(field[groups.start[one]] for field in ordered)))
        single[groups.start[one]] = nodes[one]
        if not one.all():
            below = starts[level + 1] + 2 * np.arange((~one).sum())
            child[nodes[~one]], parent[below], parent[below + 1] = below, nodes[~one], nodes[~one]
            _put(whole, nodes[~one], _pairs(Lobe(*(field[below[0] : below[-1] + 2] for field in whole))))
    spread, tilt = np.minimum(whole.spread, 2) ** 2 + whole.width, np.sin(np.minimum(whole.tilt, 0.5 * np.pi))
    row = np.column_stack([whole.position, whole.radius, whole.axis, spread, whole.power, whole.facing, whole.thick,
                           tilt]).astype(np.float32)
    first = np.concatenate([level.start for level in levels]).astype(np.int32)
    top = _tops(child, whole)
    top = top[np.argsort(first[top])]
    mirror, top_of = _mirrors(whole, child < 0), np.full(len(child), -1, np.int32)
    top_of[top] = np.arange(len(top))
    tree = LobeTree(child, parent, first, single, row, top, np.ascontiguousarray(row[top].T), top_of,
                    _planes(parent, top, mirror[:, 7] > 0), mirror)
    parent[top] = -1
    return order, tree


def _planes(parent: Array, top: Array, flat: Array) -> Array:
    """Return `LobeTree.plane`: the highest flat group above or at each top group, and the top groups in it."""
    plane, node = np.full(len(top), -1, np.int32), top.astype(np.int64)
    while (node >= 0).any():
        plane = np.where((node >= 0) & flat[node], node, plane)
        node = np.where(node >= 0, parent[node], -1)
    change = np.flatnonzero(np.diff(plane)) + 1
    starts = np.concatenate([[0], change, [len(top)]])
    run = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    return np.stack([plane, starts[run], starts[run + 1]], axis=1).astype(np.int32)


def _split(lobes: Lobe) -> tuple[Array, list[_Groups]]:
    """Return the order of the lobes, and the groups of every level: two for each of the last that holds several."""
    count = len(lobes.power)
    extent = max(float(np.ptp(lobes.position, axis=0).max()), 1e-30)
    place = np.column_stack([lobes.position / extent, lobes.axis, lobes.facing, 4 * lobes.light])
    order, levels = np.arange(count), [_Groups(np.zeros(1, np.int64), np.array([count]))]
    while (levels[-1].size > 1).any():
        several = levels[-1].size > 1
        start, size = levels[-1].start[several], levels[-1].size[several]
        member = np.repeat(start - np.cumsum(size) + size, size) + np.arange(size.sum())
        group, cuts = np.repeat(np.arange(len(size)), size), np.cumsum(size) - size
        found = place[order[member]]
        low, high = np.minimum.reduceat(found, cuts), np.maximum.reduceat(found, cuts)
        axis = (high - low).argmax(axis=1)
        each = np.arange(len(size))
        upper = found[np.arange(len(found)), axis[group]] > (0.5 * (low + high))[each, axis][group]
        left = size - np.add.reduceat(upper.astype(np.int64), cuts)
        alike = (left == 0) | (left == size) | (len(levels) >= HALVED)
        upper = np.where(alike[group], np.arange(len(group)) - cuts[group] >= (size // 2)[group], upper)
        left = np.where(alike, size // 2, left)
        order[member] = order[member][np.lexsort((upper, group))]
        levels.append(_Groups(*(np.stack(two, axis=1).ravel() for two in ((start, start + left), (left, size - left)))))
    return order, levels


def _put(lobes: Lobe, at: Array, found: Lobe) -> None:
    for field, value in zip(lobes, found, strict=True):
        field[at] = value


def _tops(child: Array, lobes: Lobe) -> Array:
    """Open the group whose power is the most spread out, until there are enough."""
    extent = max(float(np.ptp(lobes.position[child < 0], axis=0).max()), 1e-30)
    loose = lobes.power * (np.minimum(lobes.spread, 2) ** 2 + (lobes.radius / extent) ** 2)
    heap: list[tuple[Any, int]] = [(-loose[0], 0)]
    done: list[int] = []
    while heap and len(heap) + len(done) < TOPS:
        _, node = heapq.heappop(heap)
        if child[node] < 0:
            done.append(node)
            continue
        for c in (int(child[node]), int(child[node]) + 1):
            heapq.heappush(heap, (-loose[c], c))
    return np.array([*done, *(node for _, node in heap)], np.int32)


def _pairs(lobes: Lobe) -> Lobe:
    """Describe each two by a ball and cones around theirs."""
    two = Lobe(*(field.reshape(-1, 2, *field.shape[1:]) for field in lobes))
    total = two.power.sum(axis=1)
    share = two.power / total[:, None]
    position, axis, facing, normal = ((share[..., None] * field).sum(axis=1) for field in
                                      (two.position, two.axis, two.facing, two.normal))
    for mean in (axis, facing, normal):
        mean /= np.maximum(np.linalg.norm(mean, axis=1), 1e-30)[:, None]
    apart = two.position - position[:, None]

    def cone(vectors: Array, mean: Array, spread: Array) -> Array:
        angle = 2 * np.arcsin(np.minimum(0.5 * np.linalg.norm(vectors - mean[:, None], axis=2), 1))
        return np.asarray((angle + spread).max(axis=1))

    def slab(vectors: Array, mean: Array, thick: Array) -> Array:
        lean = np.minimum(1, np.linalg.norm(vectors - mean[:, None], axis=2))
        return np.asarray((np.abs((apart * mean[:, None]).sum(axis=2)) + thick + two.radius * lean).max(axis=1))

    return Lobe(position, (np.linalg.norm(apart, axis=2) + two.radius).max(axis=1), axis,
                cone(two.axis, axis, two.spread), (share * two.width).sum(axis=1), total, facing,
                cone(two.facing, facing, two.tilt), slab(two.facing, facing, two.thick), normal,
                cone(two.normal, normal, two.bend), slab(two.normal, normal, two.offset), two.height.min(axis=1),
                np.where(two.light[:, 0] == two.light[:, 1], two.light[:, 0], -1))


def _mirrors(lobes: Lobe, single: Array) -> Array:
    """Return the plane mirror that each group nearly is; where it is none, its children are asked instead."""
    known = (lobes.power > 0) & (lobes.height > 0) & (lobes.light >= 0)
    height = np.where(known, lobes.height, 1)
    blur = (2 * lobes.bend) ** 2 + (2 * lobes.offset / height) ** 2
    usable = known & (single | (blur < FLAT**2 * lobes.width))
    return np.column_stack([lobes.position, lobes.normal, 1 / (lobes.width + blur), usable])

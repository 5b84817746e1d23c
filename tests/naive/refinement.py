"""Slow literal twins of adaptive refinement (Nichols and Wyman 2009, Sec. 3.2 and 3.3): cell by cell, list by list."""

import math

import numpy as np

SIDES = ((-1, 0), (0, -1), (0, 1), (1, 0))
CORNERS = ((-1, -1), (-1, 1), (1, -1), (1, 1))


def pixels_of(shape, level, i, j, rim=0):
    """Rows and columns of a cell, cut by the picture, as slices."""
    side = 2**level
    return tuple(slice(max(0, k * side - rim), min(size, (k + 1) * side + rim))
                 for k, size in zip((i, j), shape, strict=True))


def grid(shape, level):
    return tuple(math.ceil(size / 2**level) for size in shape)


def span(channel, covered, level, i, j, rim=0):
    """Least and largest value of a cell over the pixels that show a surface."""
    cell = pixels_of(covered.shape, level, i, j, rim)
    values = channel[cell][covered[cell]]
    return (min(values), max(values)) if len(values) else (math.inf, -math.inf)


def neighbours(shape, i, j):
    return [(i + di, j + dj) for di, dj in SIDES if 0 <= i + di < shape[0] and 0 <= j + dj < shape[1]]


def slope(depth, covered, i, j, relative=True):
    """sqrt((dz/dx)^2 + (dz/dy)^2), or that over z, with the larger of both one-sided differences."""
    if not covered[i, j]:
        return 0.0
    z, steps = depth[i, j], [0.0, 0.0]
    for y, x in neighbours(depth.shape, i, j):
        if covered[y, x]:
            axis = 0 if y == i else 1
            steps[axis] = max(steps[axis], abs(depth[y, x] - z))
    return math.hypot(*steps) / (z if relative else 1)


def bend(one, other):
    """Eq. 1: kappa = 2 sin(arccos(N1 . N2) / 2)."""
    return 2 * math.sin(math.acos(min(1.0, max(-1.0, float(one @ other)))) / 2)


def curvature(normal, position, covered, i, j, rate=False):
    """Largest bend to a neighbour, over the distance for a rate."""
    if not covered[i, j]:
        return 0.0
    pairs = [0.0]
    for y, x in neighbours(covered.shape, i, j):
        if covered[y, x]:
            away = np.linalg.norm(position[:, y, x] - position[:, i, j]) if rate else 1.0
            pairs.append(bend(normal[:, y, x], normal[:, i, j]) / away)
    return max(pairs)


def discontinuities(shape, top, finest, test):
    """For each level, where `test(level, i, j)` says that a cell must be refined."""
    found = []
    for level in range(top + 1):
        rows, columns = grid(shape, level)
        found.append(np.array([[level > finest and test(level, i, j) for j in range(columns)] for i in range(rows)]))
    return found


def is_refined(need, covered, level, i, j, rule):
    """Whether a cell with a surface is refined by its own need or its neighbours'."""
    if not covered[pixels_of(covered.shape, level, i, j)].any():
        return False

    def has(di, dj):
        rows, columns = need[level].shape
        return 0 <= i + di < rows and 0 <= j + dj < columns and bool(need[level][i + di, j + dj])

    if rule == "corner":
        others = any(has(di, dj) and not has(di, 0) and not has(0, dj) for di, dj in CORNERS)
    else:
        asked = {"off": (), "literal": CORNERS, "full8": CORNERS + SIDES}[rule]
        others = any(has(*step) for step in asked)
    return has(0, 0) or others


def refine(need, covered, rule):
    """The paper's list: in each pass every subsplat either stays or gives way to its four children."""
    top = len(need) - 1
    rows, columns = need[top].shape
    listed = [(top, i, j) for i in range(rows) for j in range(columns)]
    for _ in range(top):
        output = []
        for level, i, j in listed:
            if is_refined(need, covered, level, i, j, rule):
                output += [(level - 1, 2 * i, 2 * j), (level - 1, 2 * i, 2 * j + 1),
                           (level - 1, 2 * i + 1, 2 * j + 1), (level - 1, 2 * i + 1, 2 * j)]
            else:
                output.append((level, i, j))
        listed = output
    return [one for one in listed if covered[pixels_of(covered.shape, *one)].any()]


def by_levels(need, covered, rule):
    """Each level by itself: a cell is a subsplat if it is not refined and the cell around it is."""
    top = len(need) - 1
    listed = []
    for level in range(top + 1):
        for i, j in np.ndindex(need[level].shape):
            around = level == top or is_refined(need, covered, level + 1, i // 2, j // 2, rule)
            if around and not is_refined(need, covered, level, i, j, rule):
                listed.append((level, i, j))
    return [one for one in listed if covered[pixels_of(covered.shape, *one)].any()]


def times_covered(listed, shape):
    """How many subsplats cover each pixel."""
    times = np.zeros(shape, int)
    for one in listed:
        times[pixels_of(shape, *one)] += 1
    return times


def in_order(listed, top, columns):
    """Cells of the coarsest level row by row, within them top left, top right, bottom left, bottom right."""

    def place(one):
        level, i, j = one
        path = [(i >> above & 1, j >> above & 1) for above in reversed(range(top - level))]
        return (i >> (top - level)) * columns + (j >> (top - level)), path

    return sorted(listed, key=place)

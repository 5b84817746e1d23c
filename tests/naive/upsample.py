"""Slow literal twin of the upsampling of multiresolution splats, texel by texel in float64.

Leaves are a mapping {(level, i, j): value}; a cell (level, i, j) has the pixels of rows 2^level i .. 2^level (i+1) - 1.
Outside the picture lies a copy of its outermost texels.
"""

import math

EDGES = {(-1, 0), (1, 0), (0, -1), (0, 1)}
AROUND = [(di, dj) for di in (-1, 0, 1) for dj in (-1, 0, 1)]


def shape(covered, level):
    """Rows and columns of a level."""
    return -(-len(covered) // 2**level), -(-len(covered[0]) // 2**level)


def filled(covered, level, i, j):
    """Whether any pixel of the cell has a surface."""
    side = 2**level
    return any(covered[y][x] for y in range(i * side, min((i + 1) * side, len(covered)))
               for x in range(j * side, min((j + 1) * side, len(covered[0]))))  # fmt: skip


def clamped(i, count):
    """The index nearest to i that exists."""
    return min(max(i, 0), count - 1)


def tent(leaves, covered, top, *, filter_all=False, corner_rule=True):
    """P7 from the coarsest level to the pixels: {(i, j): value} of the covered pixels."""
    above = {}
    for level in range(top, -1, -1):
        height, width = shape(covered, level)
        texels = {}  # C where m = 1
        for i in range(height):
            for j in range(width):
                if (level, i, j) in leaves:
                    texels[i, j] = leaves[level, i, j]
                elif (i // 2, j // 2) in above and filled(covered, level, i, j):
                    texels[i, j] = above[i // 2, j // 2]
        result = {}
        for (i, j), value in texels.items():
            if (level, i, j) in leaves and not filter_all:
                result[i, j] = value
                continue
            total = weights = 0.0
            for di, dj in AROUND:
                row, column = clamped(i + di, height), clamped(j + dj, width)
                if (row, column) not in texels:
                    continue
                if corner_rule and di and dj and (row, j) not in texels and (i, column) not in texels:
                    continue
                weight = (2 - abs(di)) * (2 - abs(dj))
                total, weights = total + weight * texels[row, column], weights + weight
            result[i, j] = total / weights
        above = result
    return above


def demo(leaves, covered, top, *, filter_all=False):
    """As the authors' demo: neighbours are coarse texels where there are such, else texels evaluated at this level."""
    above = {place[1:]: value for place, value in leaves.items() if place[0] == top}
    for level in range(top - 1, -1, -1):
        height, width = shape(covered, level)
        coarse_height, coarse_width = shape(covered, level + 1)
        result = {}
        for i in range(height):
            for j in range(width):
                if (level, i, j) in leaves and not filter_all:
                    result[i, j] = leaves[level, i, j]
                    continue
                if (level, i, j) not in leaves and not ((i // 2, j // 2) in above and filled(covered, level, i, j)):
                    continue
                taps = {}
                for di, dj in AROUND:
                    coarse = clamped(i // 2 + di, coarse_height), clamped(j // 2 + dj, coarse_width)
                    fine = level, clamped(i + di, height), clamped(j + dj, width)
                    if coarse in above:
                        taps[di, dj] = above[coarse]
                    elif fine in leaves:
                        taps[di, dj] = leaves[fine]
                # f: place of the texel's centre within the coarse texel
                down, across = (0.75 if k % 2 else 0.25 for k in (i, j))
                total = weights = 0.0
                for (di, dj), value in taps.items():
                    if di and dj and (di, 0) not in taps and (0, dj) not in taps:
                        continue
                    weight = (1 - down, 1.0, down)[di + 1] * (1 - across, 1.0, across)[dj + 1]
                    total, weights = total + weight * value, weights + weight
                result[i, j] = total / weights
        above = result
    return {place: value for place, value in above.items() if covered[place[0]][place[1]]}


def nearest(leaves, covered):
    """The value of the leaf that a pixel lies in."""
    result = {}
    for (level, i, j), value in leaves.items():
        for y in range(i * 2**level, min((i + 1) * 2**level, len(covered))):
            for x in range(j * 2**level, min((j + 1) * 2**level, len(covered[0]))):
                if covered[y][x]:
                    result[y, x] = value
    return result


def naive_bilinear(leaves, covered, top):
    """The sum of all levels, each interpolated with zeros where it has no leaf."""
    result = {}
    for y in range(len(covered)):
        for x in range(len(covered[0])):
            if not covered[y][x]:
                continue
            total = 0.0
            for level in range(top + 1):
                height, width = shape(covered, level)
                v, u = ((k + 0.5) / 2**level - 0.5 for k in (y, x))
                i, j = math.floor(v), math.floor(u)
                for row, down in ((i, 1 - (v - i)), (i + 1, v - i)):
                    for column, across in ((j, 1 - (u - j)), (j + 1, u - j)):
                        cell = level, clamped(row, height), clamped(column, width)
                        total += down * across * leaves.get(cell, 0.0)
            result[y, x] = total
    return result

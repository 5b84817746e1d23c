"""Slow literal twins of cells of filtered pixel lights, and of mirrored directions."""

import math

import numpy as np

from refgi.literal import lights as literal


def radical_inverse(index, base):
    """Return the digits of one number mirrored at the point."""
    return float(literal.radical_inverse(np.array([index]), base)[0])


def grid_cell_sums(flux, n):
    """Flux of n x n equal cells: each texel belongs to the cell that holds its centre."""
    height, width = len(flux[0]), len(flux[0][0])
    sums = [[0.0] * (n * n) for _ in flux]
    for row in range(height):
        for column in range(width):
            cell = math.floor((row + 0.5) * n / height) * n + math.floor((column + 0.5) * n / width)
            for channel in range(len(flux)):
                sums[channel][cell] += float(flux[channel][row][column])
    return sums


def nearest_cell_sums(flux, texels):
    """Flux of the texels nearest to each chosen one; of equally near ones the first gets it."""
    height, width = len(flux[0]), len(flux[0][0])
    sums = [[0.0] * len(texels) for _ in flux]
    for row in range(height):
        for column in range(width):
            squares = [(r - row) ** 2 + (c - column) ** 2 for r, c in texels]
            cell = squares.index(min(squares))
            for channel in range(len(flux)):
                sums[channel][cell] += float(flux[channel][row][column])
    return sums


def mirror(direction, normal):
    """r = d - 2 (n . d) n."""
    dot = sum(d * n for d, n in zip(direction, normal, strict=True))
    return [d - 2 * dot * n for d, n in zip(direction, normal, strict=True)]

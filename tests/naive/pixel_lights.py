"""Slow literal twin of the choice of pixel lights."""

import math


def radical_inverse(index, base):
    value, scale = 0.0, 1.0 / base
    while index:
        value += (index % base) * scale
        index //= base
        scale /= base
    return value


def grid_texels(n, height, width):
    """uv = ((i + 1/2)/n, (j + 1/2)/n), texel = floor(uv * resolution), row by row."""
    return [
        (math.floor((j + 0.5) / n * height), math.floor((i + 0.5) / n * width)) for j in range(n) for i in range(n)
    ]


def halton_texels(count, height, width):
    return [
        (math.floor(radical_inverse(k, 3) * height), math.floor(radical_inverse(k, 2) * width)) for k in range(count)
    ]


def lights(flux, texels):
    """Phi_i = Phi_t / (N q_t) with q = 1/T; those without flux left out."""
    height, width = len(flux[0]), len(flux[0][0])
    chosen = []
    for row, column in texels:
        phi = [channel[row][column] * (height * width) / len(texels) for channel in flux]
        if any(phi):
            chosen.append((row, column, phi))
    return chosen


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

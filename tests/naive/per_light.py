"""Slow literal twin of refinement by illumination (Nichols and Wyman 2009, Sec. 3.3.1), with lists as published."""

import numpy as np


def representative(covered, level, i, j):
    """Return (row, column) of the pixel that stands for a cell, or None: the nearest covered one to its centre."""
    half, (height, width) = 2**level // 2, covered.shape
    center = min(2**level * i + half, height - 1), min(2**level * j + half, width - 1)
    inside = [(y, x) for y in range(2**level * i, min(2**level * (i + 1), height))
              for x in range(2**level * j, min(2**level * (j + 1), width)) if covered[y, x]]
    return min(inside, key=lambda p: ((p[0] - center[0]) ** 2 + (p[1] - center[1]) ** 2, p)) if inside else None


def children(cell):
    """Return the four cells of the next finer level."""
    level, i, j = cell
    return [(level - 1, 2 * i + a, 2 * j + b) for a in (0, 1) for b in (0, 1)]


def samples_differ(samples, threshold):
    """Compare max - min of each channel with T, as the paper's pseudo-code does."""
    return bool((np.max(samples, axis=0) - np.min(samples, axis=0) > threshold).any())


def subsplats(covered, irradiance_at, top, finest, threshold, shared=None, place_of=representative):
    """Return {cell: irradiance} of one light.

    `irradiance_at(place)` is the light's irradiance (3,) at the place of a cell, its pixel (row, column) unless
    `place_of` says otherwise; None for a cell without surface. `threshold(largest)` is T, given the largest channel of
    all samples up to this pass. `shared` is a set of cells that a shared list refines, which are refined whatever the
    samples say.
    """
    def sample(cell):
        place = place_of(covered, *cell)
        return None if place is None else irradiance_at(place)

    height, width = covered.shape
    cells = [(top, i, j) for i in range(-(-height // 2**top)) for j in range(-(-width // 2**top))]
    values = {cell: sample(cell) for cell in cells}
    current = {cell: value for cell, value in values.items() if value is not None}
    largest = max((float(value.max()) for value in current.values()), default=0.0)
    for level in range(top, finest, -1):
        quadrants = {}
        for cell in (c for c in current if c[0] == level):
            known = {child: sample(child) for child in children(cell)}
            quadrants[cell] = {child: value for child, value in known.items() if value is not None}
            largest = max([largest, *(float(value.max()) for value in quadrants[cell].values())])
        output = {}
        for cell, value in current.items():
            inside = quadrants.get(cell)
            if inside is None:
                output[cell] = value
                continue
            differ = samples_differ(np.array(list(inside.values())), threshold(largest))
            if differ or (shared is not None and cell in shared):
                output.update(inside)
            else:
                output[cell] = value
        current = output
    return current

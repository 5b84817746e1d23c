"""Slow literal twin of `gather` as a whole: discs of texels around each pixel's own place, map by map, in float64."""

import math

import numpy as np

from tests.naive.draws import draw
from tests.naive.eq2 import van_der_corput

LEAST_SIMILAR = 3  # of four coarse neighbours
PERSPECTIVE, ORTHOGRAPHIC, PARABOLOID = 0, 1, 2  # kinds of projections


def gather(frame, settings):
    """Return the irradiance (3, h, w), and how many pixels ran the sum."""
    buffer, coarsely = frame.gbuffer, settings.interpolation
    sums = every_sum(buffer, frame.rsms, settings.disc)
    if coarsely is None or coarsely.grid >= max(frame.width, frame.height):
        return sums, np.count_nonzero(buffer.covered)
    rows, columns = (middles(size, coarsely.grid) for size in buffer.covered.shape)
    result, ran = np.zeros(sums.shape), 0
    for i, j in np.argwhere(buffer.covered):
        mean = None if i in rows and j in columns else interpolated(frame, coarsely, sums, rows, columns, i, j)
        ran += mean is None
        result[:, i, j] = sums[:, i, j] if mean is None else mean
    return result, ran


def middles(size, grid):
    """Return the middle pixels of the cells along one side."""
    cells = min(size, grid)
    return [math.floor((k + 0.5) * size / cells) for k in range(cells)]


def interpolated(frame, coarsely, sums, rows, columns, i, j):
    """Return the bilinear mean of the coarse neighbours similar to a pixel; None where fewer than three are."""
    similar, total, weights = 0, np.zeros(3), 0.0
    for row, down in neighbours(rows, i):
        for column, across in neighbours(columns, j):
            if is_similar(frame, coarsely, (row, column), (i, j)):
                similar += 1
                weights, total = weights + down * across, total + down * across * sums[:, row, column]
    return total / weights if similar >= LEAST_SIMILAR and weights > 0 else None


def neighbours(middle, i):
    """Return the coarse pixels around pixel i with their linear weights: the outermost two beyond the outermost."""
    before = max([k for k in middle[:-1] if k <= i], default=middle[0])
    after = min([k for k in middle if k > before], default=before)
    t = min(1.0, max(0.0, (i - before) / max(1, after - before)))
    return (before, 1 - t), (after, t)


def is_similar(frame, coarsely, one, other):
    """Tell whether two pixels see surfaces that are near and face alike."""
    buffer, reach = frame.gbuffer, coarsely.reach * visible_diagonal(frame)
    near = np.linalg.norm(buffer.position[:, *one] - buffer.position[:, *other]) <= reach
    return buffer.covered[one] and near and buffer.normal[:, *one] @ buffer.normal[:, *other] >= coarsely.least_cosine


def visible_diagonal(frame):
    """Return the diagonal of the box of all visible points."""
    return np.linalg.norm(np.ptp(frame.gbuffer.position[:, frame.gbuffer.covered], axis=1))


def every_sum(receivers, rsms, disc):
    """Run the sum at every covered pixel, over all maps, (3, h, w)."""
    pattern, result = disc_pattern(disc), np.zeros(receivers.position.shape)
    for i, j in np.argwhere(receivers.covered):
        x, normal = receivers.position[:, i, j], receivers.normal[:, i, j]
        result[:, i, j] = sum(disc_sum(rsm, disc, pattern, x, normal) for rsm in rsms)
    return result


def disc_pattern(disc):
    """Return rows down, columns right and the weight of each sample, radii in map widths: Halton points from 1 on."""
    shift = [draw(disc.seed, 5, c) if disc.seed else 0.0 for c in (0, 1)]
    points = []
    for s in range(1, disc.samples + 1):
        xi1, xi2 = ((van_der_corput(s, base) + by) % 1 for base, by in zip((2, 3), shift, strict=True))
        weight = 1.5 * xi1**2 if "rsm_weight_squared" in disc.as_published else xi1
        rho = disc.radius * xi1
        points.append((rho * math.cos(2 * math.pi * xi2), rho * math.sin(2 * math.pi * xi2), weight))
    return np.array(points)


def disc_sum(rsm, disc, pattern, x, normal):
    """E = (2 pi r_max^2 T / S) sum xi_1 E_t at one receiver, T the texels of one map; texels off the sheet count 0."""
    height, width = rsm.projection.height, rsm.projection.width
    row, column = place(rsm.projection, x)
    rows = np.floor(row + pattern[:, 0] * height).astype(int)
    columns = np.floor(column + pattern[:, 1] * width).astype(int)
    sheet = rsm.flux.shape[1:]
    inside = (rows >= 0) & (rows < sheet[0]) & (columns >= 0) & (columns < sheet[1])
    p, n, flux = (part[:, rows[inside], columns[inside]] for part in (rsm.position, rsm.normal, rsm.flux))
    light = flux * pair(x, normal, p - disc.offset * n, n)
    return 2 * math.pi * disc.radius**2 * height * width / disc.samples * (light @ pattern[inside, 2])


def pair(x, normal, p, n):
    """Return E / Phi of texels at p (3, m): both cosines over pi r^2 (Eq. 2)."""
    d = x[:, None] - p
    r = np.linalg.norm(d, axis=0)
    w = d / r
    return np.maximum(0, (n * w).sum(axis=0)) * np.maximum(0, -(normal @ w)) / (math.pi * r**2)


def place(projection, x):
    """Return the row and column of a point on the stacked maps; outside, where the way in meets its border."""
    local = [view @ (x - origin) for view, origin in zip(projection.frame, projection.origin, strict=True)]
    face = max(range(projection.maps), key=lambda k: local[k][2])
    right, down, forward = local[face]
    depth = {PERSPECTIVE: forward, ORTHOGRAPHIC: 1.0, PARABOLOID: np.linalg.norm(local[face]) + forward}[
        projection.kind]
    across = np.array([down / projection.half[1], right / projection.half[0]])
    farthest = np.abs(across).max()
    on_map = farthest <= depth and (forward > 0 or projection.kind == ORTHOGRAPHIC)
    row, column = (across / (depth if on_map else farthest) + 1) / 2 * (projection.height, projection.width)
    return face * projection.height + row, column

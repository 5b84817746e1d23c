"""Crowns: points of a sequence, samples of a receiver, the light that they send it (HSS Sec. 3.1, 3.2, Eq. 1 to 4).

Symbols: r inner radius of the crown, texels; (u, v) point of the unit square: u says how far from the receiver, 2 pi v
in which direction; x, n receiver and its normal; y, m sender and its normal; L its radiance, W/m^2/sr; ds surface that
a sample stands for, m^2; E irradiance, W/m^2. Offsets are (right, down), in texels of the level, r the same on all of
them; the finest alone also has the disc within r.
"""

import math
from typing import Any

import numpy as np

FIRST_STEP, SECOND_STEP = 0.7548776662466927, 0.5698402909980532  # 1/g and 1/g^2, g^3 = g + 1
BELOW_1 = 1 - 2.0**-24  # largest number below 1 that float32 holds
LEAST = 1e-30  # square of a distance, m^2, that is divided by


def sample_points(inner: int, crown: int) -> Any:
    """Return the points (u, cos 2 pi v, sin 2 pi v) of disc and crown, (inner + crown, 3), by a Kronecker sequence."""
    j = np.concatenate([np.arange(inner), np.arange(crown)])
    u, v = (0.5 + j * FIRST_STEP) % 1, (0.5 + j * SECOND_STEP) % 1
    angle = 2 * np.pi * v
    return np.stack([u, np.cos(angle), np.sin(angle)], axis=1)


def tile_shifts(start: Any, rows: int, columns: int, crown: int) -> Any:
    """Return what each texel of a tile adds to (u, v) modulo 1, (rows, columns, 2); `start` (2,) is random.

    Texels of a tile, row by row, take stretches of one sequence that follow each other.
    """
    row, column = np.indices((rows, columns))
    texel = row * columns + column
    skipped = texel * crown
    s, t = start[0] + skipped * FIRST_STEP, start[1] + skipped * SECOND_STEP
    return np.minimum(np.stack([s, t], axis=-1) % 1, BELOW_1)


def points_and_shifts(start: Any, inner: int, crown: int, rows: int, columns: int) -> tuple[Any, Any]:
    """Return the points that all texels share, and the shifts of the texels of a tile."""
    return sample_points(inner, crown), tile_shifts(start, rows, columns, crown)


def crown_samples(points: Any, shifts: Any, inner: int, radius: float, density: str) -> tuple[Any, Any]:
    """Return offsets (rows, columns, n, 2) of samples and how many texels each stands for (HSS Sec. 3.2).

    The first `inner` of n points lie in the disc of radius r, the others in the crown from r to 2 r. Of the density
    "uniform" a sample stands for as many texels at each receiver: those weights are (1, 1, n).
    """
    ring = np.where(np.arange(len(points)) < inner, 0.0, 1.0)[None, None]  # 0 in the disc, 1 in the crown
    number = np.where(ring > 0, len(points) - inner, inner)
    x, y = points[:, 1], points[:, 2]
    u = (points[:, 0] + shifts[..., :1]) % 1
    turn = 2 * np.pi * shifts[..., 1:]
    far = distance(u, ring, radius, density)
    right = far * (x * np.cos(turn) - y * np.sin(turn))
    down = far * (x * np.sin(turn) + y * np.cos(turn))
    column, row = np.floor(right + 0.5), np.floor(down + 0.5)  # E-HSS-10: the texel whose centre is nearest
    weight = texels_of(far, ring, number, radius, density)
    return np.stack([column, row], axis=-1).astype(np.int32), weight


def distance(u: Any, ring: Any, radius: float, density: str) -> Any:
    """Return how far from the receiver a point lies: equal areas, or rings of equal width, get equally many."""
    if density == "uniform":
        return radius * np.sqrt(ring + (1 + 2 * ring) * u)
    return radius * (ring + u)


def texels_of(far: Any, ring: Any, number: Any, radius: float, density: str) -> Any:
    """Return how many texels points stand for, E-HSS-06: the area of disc or crown over its own number of points."""
    if density == "uniform":
        return (1 + 2 * ring) * np.pi * radius**2 / number
    return 2 * np.pi * radius * far / number  # 2 pi d dd over the points in dd


def mirrored_samples(start: Any, inner: int, crown: int, radius: float, density: str) -> tuple[Any, Any]:
    """Return offsets (1, 1, n, 2) and weights of a set that all receivers share: points on the right, mirror images.

    Pairs of the disc, of the crown, then the odd point of each, straight above or below.
    """
    pairs, middles = [], []
    for count, ring in ((inner, 0.0), (crown, 1.0)):
        j = np.arange((count + 1) // 2)
        u, v = (0.5 + j * FIRST_STEP + start[0]) % 1, (0.5 + j * SECOND_STEP + start[1]) % 1
        far = distance(u, ring, radius, density)
        angle = np.pi * (v - 0.5)
        weight = texels_of(far, ring, max(count, 1), radius, density) + 0 * far
        right, down = np.floor(far * np.cos(angle) + 0.5), np.floor(far * np.sin(angle) + 0.5)
        middle = np.floor(np.copysign(far, np.sin(angle)) + 0.5)
        even = count // 2
        both = np.stack([right, down, weight, -right, down, weight], axis=1)
        pairs.append(both[:even].reshape(-1, 3))
        middles.append(np.stack([0 * middle, middle, weight], axis=1)[even:])
    samples = np.concatenate([*pairs, *middles])[None, None]
    return samples[..., :2].astype(np.int32), samples[..., 2]


def every_texel(low: float, high: float) -> tuple[Any, Any]:
    """Return the offsets (1, 1, n, 2) of all texels at a distance of `low` to below `high`, and their weights: 1.

    Row by row, each followed by its mirror image to the left; then those straight above and below.
    """
    reach = math.ceil(high)
    row, column = np.mgrid[-reach : reach + 1, 0 : reach + 1]
    far = np.hypot(row, column)
    within = (far >= low) & (far < high) & (far > 0)
    here = np.stack([column, row], axis=-1)
    half, middle = here[within & (column > 0)], here[within & (column == 0)]
    both = np.stack([half, half * (-1, 1)], axis=1).reshape(-1, 2)
    offsets = np.concatenate([both, middle]).astype(np.int32)
    return offsets[None, None], np.ones((1, 1, len(offsets)))


def gather(position: Any, normal: Any, radiance: Any, area: Any, offsets: Any, weight: Any) -> Any:
    """Return E (3, h, w) of the texels of a level by their samples (HSS Eq. 1); places are relative to one point."""
    i, j, texels = samples_at(area.shape, offsets, weight)
    light = radiance[:, i, j]
    ds = area[i, j] * texels  # E-HSS-06
    form = disc_form_factor(position[..., None], normal[..., None], position[:, i, j], normal[:, i, j], ds)
    # Eq. (1)
    return (form * light).sum(axis=-1)


def gather_shared(
    position: Any, normal: Any, sender_position: Any, sender_normal: Any, radiance: Any, area: Any, offsets: Any,
    weight: Any, share: float,
) -> Any:
    """Return E (3, h, w) of texels by samples of the same texels as senders, whose discs cover a share of their texels.

    Senders may stand elsewhere than the receivers of their texels.
    """
    i, j, texels = samples_at(area.shape, offsets, weight)
    y, m = sender_position[:, i, j], sender_normal[:, i, j]
    form = shared_disc_form_factor(position[..., None], normal[..., None], y, m, area[i, j], texels, share)
    # Eq. (1)
    return (form * radiance[:, i, j]).sum(axis=-1)


def samples_at(shape: tuple[int, int], offsets: Any, weight: Any) -> tuple[Any, Any, Any]:
    """Return row, column and number of texels (h, w, n) of the samples of each texel, by its place in its tile.

    E-HSS-08: those outside the picture or on the texel itself stand for none, the others for as many as before.
    """
    (h, w), (rows, columns) = shape, offsets.shape[:2]
    row, column = np.arange(h)[:, None], np.arange(w)
    tile_row, tile_column = row % rows, column % columns
    own = offsets[tile_row, tile_column]
    texels = weight[tile_row % weight.shape[0], tile_column % weight.shape[1]]
    row, column = row[..., None], column[..., None]
    i, j = row + own[..., 1], column + own[..., 0]
    inside = (i >= 0) & (i < h) & (j >= 0) & (j < w)
    i, j = np.clip(i, 0, h - 1), np.clip(j, 0, w - 1)
    return i, j, texels * (inside & ((i != row) | (j != column)))


def disc_form_factor(x: Any, n: Any, y: Any, m: Any, ds: Any) -> Any:
    """Return what L of samples is multiplied by to be E: each is a disc of radius R that faces x (HSS Eq. 4)."""
    d = y - x
    square = (d**2).sum(axis=0)
    r = np.sqrt(np.maximum(square, LEAST))
    cos_i = np.maximum(0, (n * d).sum(axis=0) / r)
    cos_j = np.maximum(0, -(m * d).sum(axis=0) / r)
    disc = cos_j * ds / np.pi  # R^2
    # Eq. (4), E-HSS-04: with its pi
    return np.pi * cos_i * disc / np.maximum(square + disc, LEAST)


def point_form_factor(x: Any, n: Any, y: Any, m: Any, ds: Any) -> Any:
    """Return what L of samples is multiplied by to be E where each is a point (HSS Eq. 3)."""
    d = y - x
    square = np.maximum((d**2).sum(axis=0), LEAST)
    r = np.sqrt(square)
    cos_i, cos_j = np.maximum(0, (n * d).sum(axis=0) / r), np.maximum(0, -(m * d).sum(axis=0) / r)
    # Eq. (3)
    return cos_i * cos_j * ds / square


def shared_disc_form_factor(x: Any, n: Any, y: Any, m: Any, area: Any, texels: Any, share: float) -> Any:
    """Return the form factor of samples whose discs cover a share of their texels, one at least, as often as needed.

    The disc of all that a sample stands for is too dark where it is near (E-HSS-05).
    """
    covered = np.maximum(share * texels, np.minimum(texels, 1))
    times = np.divide(texels, covered, out=np.zeros_like(covered), where=covered > 0)
    return times * disc_form_factor(x, n, y, m, area * covered)

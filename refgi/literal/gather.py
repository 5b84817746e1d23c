"""Gathering from reflective shadow maps (Dachsbacher, Stamminger 2005, Sec. 4; SII Sec. 2, Fig. 12).

Each receiver sums Eq. 2 over a disc of texels around its own place on the map. Symbols: xi_1, xi_2 random numbers of a
sample, radius and turn; R radius of the disc in widths of the map; T texels of one map, S samples; E_t what one texel
gives. Maps of one lamp (six of a cube) are stacked along rows; a texel is row * columns + column, -1 outside.
Receivers are (3, h, w) with triangle_id (h, w), -1 without surface.
"""

from typing import Any

import numpy as np

from refgi.literal.pairs import pair

LEAST_SIMILAR = 3  # of the four coarse pixels around one


def pattern(xi: Any, weight_squared: bool = False) -> Any:
    """Return offsets (S, 2), down and right, in a disc of radius 1, and weights (S,) whose mean is its area, pi.

    The samples' density is 1 / (2 pi xi_1); `weight_squared`: weights as xi_1^2, as is often done.
    """
    radius, turn = xi.T
    angle = 2 * np.pi * turn
    offset = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    weight = 2 * np.pi * (1.5 * radius**2 if weight_squared else radius)
    return offset, weight


def centers(
    position: Any, triangle_id: Any, origin: Any, frame: Any, half: Any, rows: int, columns: int,
    kind: str,
) -> Any:
    """Return where on the stacked maps each receiver lies, (2, h, w) row and column, and its depth (h, w), m.

    k maps of rows x columns, "perspective", "orthographic" or "paraboloid": origin (k, 3), frame (k, 3, 3) right, down,
    forward, half (2,) extent right and down. Outside: where the straight way to the middle of the first map meets its
    border, at depth inf.
    """
    covered, x = triangle_id >= 0, position.reshape(3, -1)
    right, down, ahead = in_frame(x, origin[0], frame[0])
    plane = np.stack([down / half[1], right / half[0]])
    away = np.ones_like(ahead) if kind == "orthographic" else np.maximum(ahead, 1e-30)  # behind: as far out as can be
    place = share_of_map(plane / np.maximum(np.abs(plane).max(axis=0), away)) * [[rows], [columns]]
    depth = np.full(x.shape[1], np.inf, x.dtype)
    for k in reversed(range(len(origin))):  # of several maps that see a point the first one
        right, down, ahead = in_frame(x, origin[k], frame[k])
        plane = np.stack([down / half[1], right / half[0]])
        distance = np.sqrt(right**2 + down**2 + ahead**2)
        far = distance if kind == "paraboloid" else ahead
        z = {"perspective": ahead, "orthographic": np.ones_like(ahead), "paraboloid": distance + ahead}[kind]
        sees = (np.abs(plane) <= z).all(axis=0) & (z > 0) & ((ahead >= 0) | (kind == "orthographic"))
        on_map = share_of_map(plane / np.where(sees, z, 1)) * [[rows], [columns]] + [[k * rows], [0]]
        place = np.where(sees, on_map, place)
        depth = np.where(sees, far, depth)
    place, depth = place.reshape(2, *covered.shape), depth.reshape(covered.shape)
    return np.where(covered, place, 0), np.where(covered, depth, np.inf)


def in_frame(x: Any, origin: Any, frame: Any) -> Any:
    """Return points (3, n) along right, down and forward of a view, m."""
    return frame @ (x - origin[:, None])


def share_of_map(plane: Any) -> Any:
    """Return places on the image plane, -1 to 1 over the map, as shares of its sides."""
    return (plane + 1) / 2


def disc_texels(
    center: Any, offset: Any, triangle_id: Any, radius: float, maps: int, rows: int, columns: int
) -> Any:
    """Return the texel (S, h, w) that each sample of each receiver's disc falls on; -1 outside and without surface."""
    down, right = offset.T[:, :, None, None]
    row = np.floor(center[0] + radius * rows * down).astype(np.int64)
    column = np.floor(center[1] + radius * columns * right).astype(np.int64)
    inside = (row >= 0) & (row < maps * rows) & (column >= 0) & (column < columns)
    return np.where(inside & (triangle_id >= 0), row * columns + column, -1)


def disc_sum(
    position: Any, normal: Any, triangle_id: Any, texel: Any, weight: Any, surface: Any, surface_normal: Any,
    flux: Any, radius: float, texels: int, offset: float = 0.0,
) -> Any:
    """Return E = R^2 T / S sum weight E_t over a disc, (3, h, w), W/m^2, without albedo/pi; texels outside count 0.

    The map holds surface, its normal and flux, (3, H, W); its texels are moved by `offset` m into the surface.
    """
    p, m, phi = (plane.reshape(3, -1)[:, texel] for plane in (surface - offset * surface_normal, surface_normal, flux))
    # SII Eq. (2)
    each = pair(position[:, None], normal[:, None], p, m, phi)
    total = (np.where(texel >= 0, each, 0) * weight[:, None, None]).sum(axis=1)
    samples = len(weight)
    return np.where(triangle_id >= 0, radius**2 * texels / samples * total, 0)


def all_maps(irradiance: Any) -> Any:
    """Return the light of all lamps' maps, (3, h, w), W/m^2."""
    total = np.zeros_like(irradiance[0])
    for one in irradiance:
        total = total + one
    return total


def interpolate(
    position: Any, normal: Any, triangle_id: Any, irradiance: Any, visible: Any, grid: int, least_cosine: float,
    reach: float,
) -> Any:
    """Return where light is interpolated between coarse pixels, (h, w), and the light, (3, h, w): else the pixel's sum.

    Coarse pixels are the middles of grid x grid cells; three of the four around a pixel must be similar: the cosine
    of the normals at least `least_cosine`, the distance at most `reach` diagonals of `visible`: the least and largest
    coordinates of what is seen.
    """
    covered = triangle_id >= 0
    limit = reach * np.sqrt(((visible[1] - visible[0]) ** 2).sum())
    rows, columns = middles(covered.shape[0], grid), middles(covered.shape[1], grid)
    similar, weights, mean = np.zeros(covered.shape, int), np.zeros(covered.shape), np.zeros_like(irradiance)
    for row, wy in around(rows, covered.shape[0]):
        for column, wx in around(columns, covered.shape[1]):
            at = np.ix_(range(3), row, column)
            facing = (normal * normal[at]).sum(axis=0) >= least_cosine
            near = ((position - position[at]) ** 2).sum(axis=0) <= limit**2
            alike = facing & near & covered[np.ix_(row, column)]
            weight = np.outer(wy, wx) * alike
            similar, weights, mean = similar + alike, weights + weight, mean + weight * irradiance[at]
    chosen = covered & (similar >= LEAST_SIMILAR) & (weights > 0)
    light = np.where(chosen, mean / np.where(chosen, weights, 1), irradiance)
    coarse = np.ix_(rows, columns)
    chosen[coarse] = covered[coarse]
    light[:, *coarse] = irradiance[:, *coarse]
    return chosen, light


def middles(size: int, grid: int) -> Any:
    """Return the middle pixels of the cells of a side, one a pixel at most."""
    cells = min(grid, size)
    return ((np.arange(cells) + 0.5) * size / cells).astype(int)


def around(coarse: Any, size: int) -> Any:
    """Return the coarse pixels before and after each pixel of a side, and their linear weights."""
    pixel = np.arange(size)
    first = np.clip(np.searchsorted(coarse, pixel, side="right") - 1, 0, max(0, len(coarse) - 2))
    low, high = coarse[first], coarse[np.minimum(first + 1, len(coarse) - 1)]
    t = np.clip((pixel - low) / np.maximum(high - low, 1), 0, 1)
    return (low, 1 - t), (high, t)

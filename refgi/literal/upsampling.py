"""What joins levels: a blur along surfaces, joint bilateral upsampling, the sum of levels (HSS Sec. 3.2, 5).

Symbols: z depth, m, inf without surface; 1/z nearness, linear in the picture along planes; g its change from pixel to
pixel; t place of a pixel within its texel, -1/2 to 1/2; delta difference of depth, over the depth; n, n' normals of
pixel and texel. Light is (3, h, w), W/m^2, 0 without surface. Weights are none of the paper's (E-HSS-12).
"""

from typing import Any

import numpy as np

LEAST_WEIGHT = 1e-20  # sum of weights that is too small to divide by


def level_sum(
    coarse: Any, below_depth: Any, below_normal: Any, depth: Any, normal: Any, own: Any, factor: int,
    depth_sigma: float, normal_power: float, nearest: bool,
) -> Any:
    """Return the light of a level and of all coarser ones: crowns do not overlap, so that levels add (HSS Sec. 3.2)."""
    carried = upsample(coarse, below_depth, below_normal, depth, normal, factor, depth_sigma, normal_power, nearest)
    return carried + own


def upsample(
    coarse: Any, below_depth: Any, below_normal: Any, depth: Any, normal: Any, factor: int, depth_sigma: float,
    normal_power: float, nearest: bool,
) -> Any:
    """Carry light of texels to pixels `factor` times as fine: means of 3 x 3 texels by tent, depth and normal.

    A texel's depth is compared with that of the pixel's plane there; `nearest`: it is that of the nearest of the
    texel's pixels, which lies at a corner, not at the centre.
    """
    (h, w), (rows, columns) = depth.shape, below_depth.shape
    row, column = np.arange(h)[:, None, None], np.arange(w)[:, None]
    own_row, own_column = row // factor, column // factor
    seen = np.isfinite(depth)[..., None]
    z = np.where(seen, depth[..., None], 1)
    nearness = np.where(np.isfinite(depth), 1 / depth, 0)
    gy = slope(nearness, 0)[..., None]
    gx = slope(nearness, 1)[..., None]
    ty = (row % factor + 0.5) / factor - 0.5  # E-HSS-10: centres at + 1/2
    tx = (column % factor + 0.5) / factor - 0.5
    corner = (factor - 1) / (2 * factor) if nearest else 0
    ty = ty - corner * np.sign(gy)
    tx = tx - corner * np.sign(gx)
    dy, dx = np.indices((3, 3)).reshape(2, 9) - 1
    i, j = own_row + dy, own_column + dx
    there = (i >= 0) & (i < rows) & (j >= 0) & (j < columns)
    i, j = np.clip(i, 0, rows - 1), np.clip(j, 0, columns - 1)
    there = there & np.isfinite(below_depth[i, j]) & seen
    far = np.where(there, below_depth[i, j], 1)
    plane = 1 / z + factor * ((dy - ty) * gy + (dx - tx) * gx)
    delta = z * (1 / far - plane)
    cosine = (normal[..., None] * below_normal[:, i, j]).sum(axis=0)
    spread = tent(dy, ty) * tent(dx, tx) * there
    close = np.maximum(0, 1 - delta**2 / (32 * depth_sigma**2)) ** 16  # exp(-delta^2 / (2 sigma^2)), nearly
    alike = np.maximum(0, cosine) ** normal_power
    weight = spread * close * alike
    light, total = coarse[:, i, j], weight.sum(axis=-1)
    mean = (weight * light).sum(axis=-1) / np.where(total > LEAST_WEIGHT, total, 1)
    # of texels as near in depth the closest: by rows, then by columns
    order = np.broadcast_arrays(np.abs(dx - tx), np.abs(dy - ty), np.where(there, np.abs(delta), np.inf))
    in_depth = np.take_along_axis(light * there, np.lexsort(order, axis=-1)[None, ..., :1], -1)[..., 0]
    return np.where(seen[..., 0], np.where(total > LEAST_WEIGHT, mean, in_depth), 0)


def bilinear(coarse: Any, below_depth: Any, depth: Any, factor: int) -> Any:
    """Carry light of texels to pixels: bilinear means of the four texels around, of those that have a surface."""
    (h, w), (rows, columns) = depth.shape, below_depth.shape
    y, x = (np.arange(h)[:, None] + 0.5) / factor - 0.5, (np.arange(w) + 0.5) / factor - 0.5
    total, weight = np.zeros((3, h, w)), np.zeros((h, w))
    for down, right in ((0, 0), (0, 1), (1, 0), (1, 1)):
        i, j = np.floor(y).astype(int) + down, np.floor(x).astype(int) + right
        share = (1 - np.abs(y - i)) * (1 - np.abs(x - j)) * ((i >= 0) & (i < rows) & (j >= 0) & (j < columns))
        i, j = np.clip(i, 0, rows - 1), np.clip(j, 0, columns - 1)
        share = share * np.isfinite(below_depth[i, j])
        total, weight = total + share * coarse[:, i, j], weight + share
    return np.where(np.isfinite(depth), total / np.where(weight > 0, weight, 1), 0)


def joint_bilateral(position: Any, normal: Any, covered: Any, light: Any, least_weight: float = 0.05) -> Any:
    """Return light (3, h, w) as it is made from one pixel of each 2 x 2, the first with a surface (SII Table 3).

    Bilinear weights of the four blocks around times max(0, n . n_k)^8 (1 - sine to the plane)^2.
    """
    h, w = covered.shape
    index = np.pad(np.arange(h * w).reshape(h, w), ((0, h % 2), (0, w % 2)), constant_values=-1)
    blocks = np.swapaxes(index.reshape(index.shape[0] // 2, 2, -1, 2), 1, 2).reshape(-1, index.shape[1] // 2, 4)
    there = (blocks >= 0) & covered.reshape(-1)[blocks]
    chosen = np.take_along_axis(blocks, there.argmax(axis=-1)[..., None], -1)[..., 0]
    chosen = np.pad(np.where(there.any(axis=-1), chosen, -1), ((0, 1), (0, 1)), constant_values=-1)
    i, j = np.arange(h)[:, None], np.arange(w)
    total, weights = np.zeros_like(light), np.zeros((h, w))
    for below, right in ((0, 0), (0, 1), (1, 0), (1, 1)):
        down, across = np.abs(1 - below - i % 2 / 2), np.abs(1 - right - j % 2 / 2)
        at = chosen[i // 2 + below, j // 2 + right]
        step = position.reshape(3, -1)[:, at] - position
        away = np.sqrt((step**2).sum(axis=0))
        sine = np.minimum(1, np.abs((normal * step).sum(axis=0)) / np.where(away > 0, away, 1))
        cosine = np.maximum(0, (normal * normal.reshape(3, -1)[:, at]).sum(axis=0))
        weight = np.where(at >= 0, down * across * cosine**8 * (1 - sine) ** 2, 0)
        total, weights = total + weight * light.reshape(3, -1)[:, at], weights + weight
    own = (chosen[i // 2, j // 2] == i * w + j) | (weights < least_weight)
    return np.where(covered, np.where(own, light, total / np.where(weights > 0, weights, 1)), 0)


def tent(step: Any, t: Any) -> Any:
    """Return the weight of the texel `step` places on, -1 to 1, for a place t: (1 - 2|t|)/6, (2 - |t|)/3, ..."""
    half = np.where(np.abs(t) < 0.5, (4 + np.abs(t)) / 3, 1)
    before, middle, after = (np.maximum(0, 1 - np.abs(t - place) / half) for place in (-1, 0, 1))
    return np.where(step < 0, before, np.where(step > 0, after, middle)) / (before + middle + after)


def slope(nearness: Any, axis: int) -> Any:
    """Return g along an axis: the smaller of two differences, 0 where they disagree or a neighbour sees nothing."""
    rows = np.moveaxis(nearness, axis, 0)
    padded = np.pad(rows, ((1, 1), (0, 0)), mode="reflect", reflect_type="odd")  # beyond the rim the slope goes on
    before, after = padded[:-2], padded[2:]
    first, second = rows - before, after - rows
    known = (before > 0) & (after > 0) & (rows > 0)
    agree = first * second > 0
    smaller = np.abs(first) < np.abs(second)
    g = np.where(smaller, first, second) * agree
    return np.moveaxis(np.where(known, g, 0), 0, axis)


def blur(
    light: Any, position: Any, normal: Any, depth: Any, size: int, plane_tolerance: float, cosine: float,
) -> Any:
    """Return means over `size` texels of the same surface along rows, then along columns (Keller and Heidrich 2001)."""
    half = size // 2
    box = [(k, 0.5 if 2 * abs(k) == size else 1.0) for k in range(-half, half + 1)]  # an even window cuts its rim
    along_row, along_column = [(0, k, w) for k, w in box], [(k, 0, w) for k, w in box]
    first = window_mean(light, along_row, position, normal, depth, plane_tolerance, cosine)
    return window_mean(first, along_column, position, normal, depth, plane_tolerance, cosine)


def window_mean(
    light: Any, window: Any, position: Any, normal: Any, depth: Any, plane_tolerance: float, cosine: float,
) -> Any:
    """Return means over a window of (rows down, columns right, weight), of texels of the texel's own surface."""
    total, weight = np.zeros_like(light), np.zeros_like(depth)
    for down, right, share in window:
        other = np.isfinite(beside(depth, down, right))
        inside = np.isfinite(beside(np.zeros_like(depth), down, right))
        same = one_surface(down, right, position, normal, depth, plane_tolerance, cosine)
        counts = inside & other & same
        if (down, right) == (0, 0):
            counts = np.isfinite(depth)
        part = share * counts
        total = total + part * np.nan_to_num(beside(light, down, right))
        weight = weight + part
    return np.where(np.isfinite(depth), total / np.where(weight > 0, weight, 1), 0)


def one_surface(
    down: int, right: int, position: Any, normal: Any, depth: Any, plane_tolerance: float, cosine: float,
) -> Any:
    """Return whether texels some rows down and columns right lie on the texel's tangent plane and face as it does."""
    away = beside(position, down, right) - position
    off = np.abs((normal * away).sum(axis=0))
    facing = (normal * beside(normal, down, right)).sum(axis=0)
    limit = plane_tolerance * np.where(np.isfinite(depth), depth, 0)
    return (off <= limit) & (facing >= cosine)


def beside(plane: Any, down: int, right: int) -> Any:
    """Return each texel's neighbour some rows down and columns to the right; NaN beyond the rim."""
    (h, w), row, column = plane.shape[-2:], np.arange(plane.shape[-2])[:, None], np.arange(plane.shape[-1])
    i, j = row + down, column + right
    inside = (i >= 0) & (i < h) & (j >= 0) & (j < w)
    return np.where(inside, plane[..., np.clip(i, 0, h - 1), np.clip(j, 0, w - 1)], np.nan)

"""Mip levels of what a camera sees: sample areas, the closest of finer texels or their means (HSS Sec. 3.1, 4, Eq. 2).

Symbols: z depth along the view direction, m, inf without surface; d ray through a pixel's centre, of depth 1; n normal;
L radiance, W/m^2/sr; ds surface that a texel stands for, m^2. A texel of level k covers 2^k x 2^k pixels or, at the
rim, those that there are. Places are relative to the eye; a texel without surface is 0, its depth inf, its pixel -1.
"""

from typing import Any

import numpy as np

GRAZING = 1e-6  # least ratio of the cosines that an area is divided by


def first_level(depth: Any, normal: Any, albedo: Any, irradiance: Any, frame: Any, half: Any, number: int) -> Any:
    """Return place, depth, normal, L, ds and kept pixel of a level: of each texel's pixels the closest (HSS Sec. 4).

    G-buffer (h, w) and (3, h, w), direct irradiance; `frame` (1, 3, 3): right, down, ahead; `half`: tangents of half
    the angles of view across and down.
    """
    size, side = depth.shape, 1 << number
    y, x, void = closest(depth, np.arange(depth.size).reshape(size), side, size[1])
    row, column = np.indices(y.shape)
    z, n = np.where(void, 0, depth[y, x]), normal[:, y, x]
    d = pixel_ray(y + 0.5, x + 0.5, frame, half, size)  # E-HSS-10: through the pixel's centre
    place = z * d
    radiance = albedo[:, y, x] / np.pi * irradiance[:, y, x]
    area = sample_area(z, np.where(void, -d, n), d, half, covered(row, column, number, size), size)
    return with_void(void, place, depth[y, x], n, radiance, area, y * size[1] + x)


def coarser_level(
    place: Any, depth: Any, normal: Any, radiance: Any, area: Any, pixel: Any, number: int, size: tuple[int, int],
) -> Any:
    """Return the planes of level `number`: of four texels of the finer level the closest with all that it has.

    E-HSS-09: its own place, normal and colour. E-HSS-06: it stands for the pixels of all four; `size`: the picture's.
    """
    y, x, void = closest(depth, pixel, 2, size[1])
    row, column = np.indices(y.shape)
    pixels, finer = covered(row, column, number, size), covered(y, x, number - 1, size)
    return with_void(void, place[:, y, x], depth[y, x], normal[:, y, x], radiance[:, y, x],
                     area[y, x] * pixels / finer, pixel[y, x])


def closest(depth: Any, pixel: Any, side: int, width: int) -> tuple[Any, Any, Any]:
    """Return row and column of the closest of side x side finer texels, (h, w), and whether none has a surface.

    Of equally near ones that is kept which is nearest to the picture's vertical centre line, then the upper, the left.
    """
    rows, columns = depth.shape
    top, left = np.indices((-(-rows // side), -(-columns // side)))[..., None] * side
    part = np.arange(side**2)
    i, j = top + part // side, left + part % side
    inside = (i < rows) & (j < columns)
    at = np.where(inside, i * columns + j, 0)
    z, kept = depth.reshape(-1)[at], pixel.reshape(-1)[at]
    seen = inside & np.isfinite(z)
    near = np.where(seen, z, np.inf)
    aside = np.abs(2 * (kept % width) + 1 - width)
    best = np.lexsort((kept, aside, near), axis=-1)[..., :1]
    y, x = np.divmod(np.take_along_axis(at, best, -1)[..., 0], columns)
    return y, x, ~np.take_along_axis(seen, best, -1)[..., 0]


def pixel_ray(v: Any, u: Any, frame: Any, half: Any, size: tuple[int, int]) -> Any:
    """Return d (3, h, w), of length 1 along the view direction, through the place (row v, column u) of a picture."""
    across, down, ahead = frame[0][:, :, None, None]
    return ahead + half[0] * (2 * u / size[1] - 1) * across + half[1] * (2 * v / size[0] - 1) * down


def sample_area(z: Any, n: Any, d: Any, half: Any, pixels: Any, size: tuple[int, int]) -> Any:
    """Return ds (h, w), m^2, of a number of pixels at depth z on a surface of normal n (HSS Eq. 2)."""
    length = np.sqrt((d**2).sum(axis=0))
    cos_alpha = 1 / length  # between ray and view direction
    facing = -(n * d).sum(axis=0)
    cos_beta = np.maximum(facing, GRAZING) / length  # E-HSS-02: at the surface that is seen
    tangents = half[0] * half[1]  # E-HSS-03: of half the angles
    # Eq. (2)
    area = pixels * z**2 * 4 * tangents / (size[0] * size[1]) * cos_alpha / cos_beta
    return np.where(facing > 0, area, 0)  # seen from behind it sends nothing


def covered(row: Any, column: Any, number: int, size: tuple[int, int]) -> Any:
    """Return how many pixels of the picture texels of a level cover."""
    side = 1 << number
    down, across = np.minimum(side, size[0] - row * side), np.minimum(side, size[1] - column * side)
    return down * across


def with_void(void: Any, place: Any, depth: Any, normal: Any, radiance: Any, area: Any, pixel: Any) -> Any:
    """Return the planes of a level with what they are where there is no surface."""
    return (np.where(void, 0, place), np.where(void, np.inf, depth), np.where(void, 0, normal),
            np.where(void, 0, radiance), np.where(void, 0, area), np.where(void, -1, pixel))


def first_mean(depth: Any, normal: Any, albedo: Any, irradiance: Any, frame: Any, half: Any, number: int) -> Any:
    """Return place, depth, normal, L and ds of a level of means of pixels (HSS Sec. 4: average)."""
    place, z, n, radiance, area, _ = first_level(depth, normal, albedo, irradiance, frame, half, 0)
    return level_of_means(place, z, n, radiance, area, 1 << number)


def level_of_means(place: Any, depth: Any, normal: Any, radiance: Any, area: Any, side: int = 2) -> Any:
    """Return the means by area of side x side finer texels and the sum of their areas: what these send, it sends."""
    ds, there = parts(area, side), parts(np.isfinite(depth), side)
    z, x = parts(np.where(np.isfinite(depth), depth, 0), side), parts(place, side)
    near = np.arange(ds.shape[-1]) == np.where(there, z, np.inf).argmin(axis=-1)[..., None]
    weight = np.where(ds.any(axis=-1)[..., None], ds, there & near)  # where none has an area the closest alone
    void, total = ~there.any(axis=-1), weight.sum(axis=-1)
    up, light = parts(normal, side), parts(radiance, side)
    divisor = np.where(void, 1, total)
    mean_place = (weight * x).sum(axis=-1) / divisor
    mean_depth = (weight * z).sum(axis=-1) / divisor
    mean_normal = (weight * up).sum(axis=-1) / divisor
    mean_radiance = (weight * light).sum(axis=-1) / divisor
    length = np.sqrt((mean_normal**2).sum(axis=0))
    unit = mean_normal / np.where(length > 0, length, 1)
    return with_void(void, mean_place, mean_depth, unit, mean_radiance, ds.sum(axis=-1), 0)[:5]


def first_mean_radiance(
    depth: Any, normal: Any, albedo: Any, irradiance: Any, frame: Any, half: Any, number: int,
) -> Any:
    """Return the planes of the closest level, with the mean L of all its pixels with a surface, and their number."""
    kept = first_level(depth, normal, albedo, irradiance, frame, half, number)
    pixels = first_level(depth, normal, albedo, irradiance, frame, half, 0)
    mean, count = mean_radiance(pixels[3], (pixels[5] >= 0).astype(np.int32), 1 << number)
    return *kept[:3], np.where(kept[5] < 0, 0, mean), *kept[4:], count


def coarser_mean_radiance(
    place: Any, depth: Any, normal: Any, radiance: Any, area: Any, pixel: Any, count: Any, number: int,
    size: tuple[int, int],
) -> Any:
    """Return the planes of the closest of four, with the mean L of all pixels with a surface, and their number."""
    kept = coarser_level(place, depth, normal, radiance, area, pixel, number, size)
    mean, count = mean_radiance(radiance, count, 2)
    return *kept[:3], np.where(kept[5] < 0, 0, mean), *kept[4:], count


def mean_radiance(radiance: Any, count: Any, side: int) -> tuple[Any, Any]:
    """Return the mean of side x side texels by the pixels with a surface that each has, and the sum of these."""
    light, share = parts(radiance, side), parts(count, side)
    mean = (light * share).sum(axis=-1) / np.maximum(share.sum(axis=-1), 1)
    return mean, share.sum(axis=-1)


def parts(plane: Any, side: int) -> Any:
    """Return the side x side finer texels of each texel along the last axis, row by row; 0 beyond the rim."""
    rows, columns = (-(-size // side) for size in plane.shape[-2:])
    beyond = [(0, 0)] * (plane.ndim - 2) + [(0, rows * side - plane.shape[-2]), (0, columns * side - plane.shape[-1])]
    blocks = np.pad(plane, beyond).reshape(*plane.shape[:-2], rows, side, columns, side)
    return np.swapaxes(blocks, -3, -2).reshape(*plane.shape[:-2], rows, columns, side * side)


def resampled_level(closest_planes: Any, finer: Any, u: Any, side: int) -> Any:
    """Return a level as senders: each stands where one of its parts does, drawn by flux, and sends the flux of all.

    The part is the last that sends before which less than a share u (h, w), random, of all is sent; where none sends
    the closest. `closest_planes` (six planes) are of this level, `finer` of the senders of the finer one, or of pixels.
    """
    ds, light = parts(finer[4], side), parts(finer[3], side)
    flux = ds * light.sum(axis=0)
    total, before = flux.sum(axis=-1), np.cumsum(flux, axis=-1) - flux
    last = (flux > 0) & (before <= (u * total)[..., None])
    k = side**2 - 1 - last[..., ::-1].argmax(axis=-1)[..., None]
    place, depth, normal, pixel = (
        np.where(total > 0, np.take_along_axis(parts(plane, side), k if plane.ndim == 2 else k[None], -1)[..., 0], own)
        for plane, own in ((finer[n], closest_planes[n]) for n in (0, 1, 2, 5)))
    area = ds.sum(axis=-1)
    radiance = (ds * light).sum(axis=-1) / np.where(area > 0, area, 1)
    return with_void(closest_planes[5] < 0, place, depth, normal, radiance, area, pixel)

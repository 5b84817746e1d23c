"""Levels of what a camera sees one after the other: the first of pixels, each further one of the finer one's texels.

Of each texel's pixels the closest is kept, or all are averaged, or radiance alone is.

- depth (h, w): Depth along the view direction of the picture's pixels, m; inf without surface.
- normal (3, h, w): Their unit normals on the side that is seen.
- irradiance (3, h, w): Their direct irradiance, W/m^2.
- number: Level k: a texel covers 2^k x 2^k pixels or, at the rim, those that there are.
- as_published: "hss_tan_f": sample areas as printed.
- size: Rows and columns of the picture.
"""


import numpy as np

from refgi.rsm.pool import plane
from refgi.rsm.raster.projection import Projection
from refgi.sssil.pyramid.fill import fill_coarser_level, fill_first_level
from refgi.sssil.pyramid.levels import empty_level
from refgi.sssil.pyramid.mean import average_pixels, average_texels
from refgi.sssil.pyramid.view import Level, Picture, View, view_of
from refgi.stages import stage
from refgi.types import Array

Size = tuple[int, int]  # rows and columns of the picture
Closest = tuple[Array, Array, Array, Array, Array, Array]
Means = tuple[Array, Array, Array, Array, Array]
Counted = tuple[Array, Array, Array, Array, Array, Array, Array]
PRINTED = frozenset[str]()


@stage("sssil.first_level", kept=False)
def first_level(
    depth: Array, normal: Array, albedo: Array, irradiance: Array, projection: Projection, number: int,
    as_published: frozenset[str] = PRINTED,
) -> Closest:
    """Keep the nearest surface to each texel, what it reflects and the surface it stands for (HSS Sec. 4, E-HSS-09).

    -> position (3, h_l, w_l): Surface point from the eye, along the axes of the world, m: depth times the ray of depth
        1 through the pixel's centre (E-HSS-10); 0 without surface.
    -> depth (h_l, w_l): Depth along the view direction, m; inf without surface.
    -> normal (3, h_l, w_l): Its unit normal on the side that is seen; 0 without surface.
    -> radiance (3, h_l, w_l): Diffusely reflected direct light, albedo/pi E, W/m^2/sr; 0 without surface.
    -> area (h_l, w_l): Surface ds that the texel stands for, Eq. 2 with tan(f / 2) (E-HSS-03) and dP = 4^k pixels
        (E-HSS-06), m^2; 0 without surface.
    -> pixel (h_l, w_l) int32: Pixel that was kept, row * columns + column; of equally near ones that nearest to the
        vertical centre line, then the upper, then the left; -1 without surface.
    """
    level = empty_level(number, depth.shape, depth.dtype)
    fill_first_level(Picture(depth, normal, albedo, irradiance), view_of(projection, as_published), level)
    return level[1:]


@stage("sssil.coarser_level", kept=False, each="level")
def coarser_level(
    position: Array, depth: Array, normal: Array, radiance: Array, area: Array, pixel: Array, number: int, size: Size
) -> Closest:
    """Keep the nearest of four texels of the finer level, or of the two or one that there are (HSS Sec. 4, E-HSS-09).

    position (3, h, w): Surface points of the finer level, from the eye, m.
    depth (h, w): Their depth, m; inf without surface.
    radiance (3, h, w): Their radiance, W/m^2/sr.
    area (h, w): What they stand for, m^2.
    pixel (h, w) int32: Pixels that they show.
    number: Level k, the coarser one.
    -> position (3, h_l, w_l): Surface point from the eye, along the axes of the world, m; 0 without surface.
    -> depth (h_l, w_l): Depth along the view direction, m; inf without surface.
    -> normal (3, h_l, w_l): Its unit normal; 0 without surface.
    -> radiance (3, h_l, w_l): Diffusely reflected direct light, W/m^2/sr; 0 without surface.
    -> area (h_l, w_l): Surface that the texel stands for: as often its own as it covers more pixels (E-HSS-06), m^2.
    -> pixel (h_l, w_l) int32: Pixel that was kept, row * columns + column; of equally near ones that nearest to the
        vertical centre line, then the upper, then the left; -1 without surface.
    """
    return _next(Level(number - 1, position, depth, normal, radiance, area, pixel), size)[1:]


@stage("sssil.first_mean", kept=False)
def first_mean(
    depth: Array, normal: Array, albedo: Array, irradiance: Array, projection: Projection, number: int,
    as_published: frozenset[str] = PRINTED,
) -> Means:
    """Average the pixels of each texel by area, add their areas, make normals unit vectors (HSS Sec. 4: average).

    -> position (3, h_l, w_l): Mean surface point from the eye, along the axes of the world, m; 0 without surface.
    -> depth (h_l, w_l): Mean depth along the view direction, m; inf without surface.
    -> normal (3, h_l, w_l): Mean normal, a unit vector again; 0 without surface.
    -> radiance (3, h_l, w_l): Mean of diffusely reflected direct light, albedo/pi E, W/m^2/sr; 0 without surface.
    -> area (h_l, w_l): Sum of the pixels' surface ds, Eq. 2 with tan(f / 2) (E-HSS-03), m^2.
    """
    picture, view = Picture(depth, normal, albedo, irradiance), view_of(projection, as_published)
    return _averaged_pixels(picture, view, number, by_surface=True)[0][1:6]


@stage("sssil.level_of_means", kept=False, each="level")
def level_of_means(
    position: Array, depth: Array, normal: Array, radiance: Array, area: Array, number: int, size: Size
) -> Means:
    """Average four finer texels, or those that there are, by area, and add their areas (HSS Sec. 4: average).

    position (3, h, w): Mean surface points of the finer level, from the eye, m.
    depth (h, w): Their depth, m; inf without surface.
    radiance (3, h, w): Their radiance, W/m^2/sr.
    area (h, w): Their surface, m^2.
    number: Level k, the coarser one.
    -> position (3, h_l, w_l): Mean surface point from the eye, m; 0 without surface.
    -> depth (h_l, w_l): Mean depth along the view direction, m; inf without surface.
    -> normal (3, h_l, w_l): Mean normal, a unit vector again; 0 without surface.
    -> radiance (3, h_l, w_l): Mean radiance, W/m^2/sr; 0 without surface.
    -> area (h_l, w_l): Sum of areas, m^2.
    """
    fine = Level(number - 1, position, depth, normal, radiance, area, np.zeros(depth.shape, np.int32))
    coarse = _next(fine, size)
    average_texels(fine, area, True, coarse, coarse.area)
    return coarse[1:6]


@stage("sssil.first_mean_radiance", kept=False)
def first_mean_radiance(
    depth: Array, normal: Array, albedo: Array, irradiance: Array, projection: Projection, number: int,
    as_published: frozenset[str] = PRINTED,
) -> Counted:
    """Keep the nearest surface to each texel, with the mean radiance of all its pixels (HSS Sec. 4: average).

    -> position (3, h_l, w_l): Surface point from the eye, along the axes of the world, m; 0 without surface.
    -> depth (h_l, w_l): Depth along the view direction, m; inf without surface.
    -> normal (3, h_l, w_l): Its unit normal; 0 without surface.
    -> radiance (3, h_l, w_l): Mean over the texel's pixels with a surface of albedo/pi E, W/m^2/sr.
    -> area (h_l, w_l): Surface ds that the texel stands for, m^2; 0 without surface.
    -> pixel (h_l, w_l) int32: Pixel that was kept, row * columns + column; -1 without surface.
    -> count (h_l, w_l) int32: Pixels with a surface that the texel covers.
    """
    picture, view = Picture(depth, normal, albedo, irradiance), view_of(projection, as_published)
    level, count = _averaged_pixels(picture, view, number, by_surface=False)
    return *level[1:], count.astype(np.int32)


@stage("sssil.coarser_mean_radiance", kept=False, each="level")
def coarser_mean_radiance(
    position: Array, depth: Array, normal: Array, radiance: Array, area: Array, pixel: Array, count: Array, number: int,
    size: Size,
) -> Counted:
    """Keep the nearest of four finer texels, with the mean radiance of all their pixels (HSS Sec. 4: average).

    position (3, h, w): Surface points of the finer level, from the eye, m.
    depth (h, w): Their depth, m; inf without surface.
    radiance (3, h, w): Mean radiance of their pixels, W/m^2/sr.
    area (h, w): What they stand for, m^2.
    pixel (h, w) int32: Pixels that they show.
    count (h, w) int32: Their pixels with a surface.
    number: Level k, the coarser one.
    -> position (3, h_l, w_l): Surface point from the eye, m; 0 without surface.
    -> depth (h_l, w_l): Depth along the view direction, m; inf without surface.
    -> normal (3, h_l, w_l): Its unit normal; 0 without surface.
    -> radiance (3, h_l, w_l): Mean over all pixels with a surface, W/m^2/sr.
    -> area (h_l, w_l): Surface that the texel stands for, m^2; 0 without surface.
    -> pixel (h_l, w_l) int32: Pixel that was kept, row * columns + column; -1 without surface.
    -> count (h_l, w_l) int32: Pixels with a surface that the texel covers.
    """
    fine = Level(number - 1, position, depth, normal, radiance, area, pixel)
    coarse, pixels = _next(fine, size), plane(empty_level(number, size, depth.dtype).shape, depth.dtype)
    average_texels(fine, count.astype(depth.dtype), False, coarse, pixels)
    return *coarse[1:], pixels.astype(np.int32)


def levels_steps(
    depth: Array, normal: Array, albedo: Array, direct: Array, projection: Projection, first: int, count: int,
    downsample: str = "closest", as_published: frozenset[str] = PRINTED,
) -> tuple[dict[str, Array], ...]:
    """Return the planes of levels of a picture, made by steps."""
    size, picture = depth.shape, (depth, normal, albedo, direct, projection, first, as_published)
    begin, go_on = {"closest": (first_level, coarser_level), "average": (first_mean, level_of_means),
                    "closest_average": (first_mean_radiance, coarser_mean_radiance)}[downsample]
    made: list[tuple[Array, ...]] = [begin(*picture)]
    while len(made) < count:
        made.append(go_on(*made[-1], first + len(made), size))  # type: ignore[operator]
    return tuple(dict(zip(Level._fields[1:], planes, strict=False)) for planes in made)


def _next(fine: Level, size: Size) -> Level:
    coarse = empty_level(fine.number + 1, size, fine.depth.dtype)
    fill_coarser_level(fine, *size, coarse)
    return coarse


def _averaged_pixels(picture: Picture, view: View, number: int, by_surface: bool) -> tuple[Level, Array]:
    """Return a first level of means of all, or of radiance alone, and the sums of its weights."""
    level = empty_level(number, (view.height, view.width), picture.depth.dtype)
    fill_first_level(picture, view, level)
    weight = level.area if by_surface else plane(level.shape, level.area.dtype)
    average_pixels(picture, view, by_surface, level, weight)
    return level, weight

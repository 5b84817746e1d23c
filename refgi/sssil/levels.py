"""Pyramid of what a camera sees: position, normal, direct radiance and sample area (Sec. 4, hierarchical maps).

Of each texel's pixels the closest is kept, or all are averaged, or radiance alone is; by steps the first level is made
of pixels, each further one of the finer one's texels.

- depth (h, w): Depth along the view direction of the picture's pixels, m; inf without surface.
- normal (3, h, w): Their unit normals on the side that is seen.
- irradiance (3, h, w): Their direct irradiance, W/m^2.
- number: Level k: a texel covers 2^k x 2^k pixels or, at the rim, those that there are.
- as_published: "hss_tan_f": sample areas as printed.
- size: Rows and columns of the picture.
"""

import itertools
import math
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.rsm.pool import plane
from refgi.rsm.raster.projection import Projection
from refgi.skips import left_out
from refgi.sssil.closest import NO_PIXEL, fill_coarser_level, fill_first_level
from refgi.sssil.resample import draw_pixels, draw_texels
from refgi.sssil.settings import HssilSettings, SamplingSettings
from refgi.sssil.view import Level, Picture, View, average_pixels, average_texels, view_of
from refgi.stages import skip, stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.frame import Frame


def pyramid(frame: "Frame", settings: HssilSettings) -> list[Level]:
    """Return what a camera sees at the resolutions at which light is gathered.

    Parameters
    ----------
    frame : Frame
        Scene, camera and lights.
    settings : HssilSettings
        First level, number of levels and downsampling.

    Returns
    -------
    list of Level
        Finest first; fewer than asked for where the samples of the last ones would all lie outside the picture.
    """
    buffer = frame.gbuffer
    # positions, which direct light needs, come from the same pass
    depth, normal, _, _ = buffer.resolve("depth", "normal", "albedo", "position")
    sampling = settings.sampling
    count = useful_levels((frame.height, frame.width), sampling)
    if not left_out("sssil.levels", lambda: (sampling.levels - count, sampling.levels)):
        count = sampling.levels
    if count < sampling.levels:
        skip("sssil.level", f"no texel of level {sampling.first_level + count} has another in its crown")
    downsample = settings.senders.downsample
    return list(levels(depth, normal, frame.sent_albedo, frame.direct, buffer.projection, sampling.first_level, count,
                       "closest" if downsample == "resampled" else downsample, settings.as_published & {"hss_tan_f"}))


def sender_pyramid(frame: "Frame", receivers: list[Level], settings: HssilSettings) -> list[Level]:
    """Return the levels as senders, as many and as large: the receivers' (`pyramid`) unless senders are drawn."""
    if settings.senders.downsample != "resampled":
        skip("sssil.senders", "receivers are the senders")
        return receivers
    buffer = frame.gbuffer
    depth, normal = buffer.resolve("depth", "normal")
    return list(drawn_senders(depth, normal, frame.sent_albedo, frame.direct, buffer.projection, tuple(receivers),
                              settings.sampling.seed, settings.as_published & {"hss_tan_f"}))


def useful_levels(shape: tuple[int, int], sampling: SamplingSettings) -> int:
    """Return how many levels, 1 or more, have texels within each other's crown in a picture of this shape."""
    if sampling.radius is None:  # chosen so that all reach
        return sampling.levels
    for index in range(1, sampling.levels):
        height, width = level_shape(shape, sampling.first_level + index)
        if sampling.radius >= math.hypot(height, width):
            return index
    return sampling.levels


def level_shape(shape: tuple[int, int], number: int) -> tuple[int, int]:
    """Return rows and columns of level k: as many texels of 2^k x 2^k pixels as cover the picture."""
    return -(-shape[0] >> number), -(-shape[1] >> number)


@stage("sssil.pyramid", steps="refgi.sssil.levels.levels_steps")
def levels(
    depth: Array, normal: Array, albedo: Array, direct: Array, projection: Projection, first: int, count: int,
    downsample: str = "closest", as_published: frozenset[str] = frozenset(),
) -> tuple[Level, ...]:
    """Return levels of a picture, the first from its pixels, each further one from that before.

    direct (3, H, W): Direct irradiance, W/m^2.
    first, count: Number of the first level, and how many.
    downsample {"closest", "average", "closest_average"}: How texels become one.
    -> tuple of Level: Finest first.

    Raises
    ------
    InputError
        If shapes do not fit, or "hss_tan_f" meets a field of view of 90 degrees or more.

    Notes
    -----
    The paper keeps depth alone and finds x and y from the texel's centre, up to half a texel beside the pixel that was
    kept; here position, normal and radiance are that pixel's own. Nearer pixels win whatever their share: one that
    covers q of the picture covers ``1 - (1 - q)^(4^k)`` of level k, and the light it sends grows with that. "average"
    keeps the light; its positions may lie between two surfaces.
    """
    shape = (projection.height, projection.width)
    picture, view = _picture(shape, depth, normal, albedo, direct), view_of(projection, as_published)
    levels_made = [empty_level(number, shape, depth.dtype) for number in range(first, first + count)]
    fill_first_level(picture, view, levels_made[0])
    for fine, coarse in itertools.pairwise(levels_made):
        fill_coarser_level(fine, *shape, coarse)
    if downsample != "closest":
        _average(picture, view, downsample == "average", levels_made)
    return tuple(levels_made)


@stage("sssil.senders")
def drawn_senders(
    depth: Array, normal: Array, albedo: Array, direct: Array, projection: Projection, closest: tuple[Level, ...],
    seed: int = 0, as_published: frozenset[str] = frozenset(),
) -> tuple[Level, ...]:
    """Return levels whose texels stand where one of four does, drawn in proportion to flux, and send the flux of all.

    direct (3, H, W): Direct irradiance, W/m^2.
    closest: Levels of the closest texels: those that a texel which sends nothing is like.
    seed: Seed of the draws.
    -> tuple of Level: Area is the sum over pixels, radiance times area the flux over pi, to rounding. `depth` is that
        of `closest`.

    Raises
    ------
    InputError
        As `levels`.

    Notes
    -----
    Not the published method, which keeps the closest of four as a sender too. The expectation of Eq. 3 is that of
    the sum over all pixels; where they differ in hue, that of the mean of the channels.
    """
    shape = (projection.height, projection.width)
    picture, view = _picture(shape, depth, normal, albedo, direct), view_of(projection, as_published)
    drawn = [empty_level(level.number, shape, depth.dtype)._replace(depth=level.depth) for level in closest]
    if closest[0].number == 0:
        drawn[0] = closest[0]  # pixels stand for themselves
    else:
        draw_pixels(picture, view, seed, closest[0], drawn[0])
    for (fine, coarse), nearest in zip(itertools.pairwise(drawn), closest[1:], strict=True):
        draw_texels(fine, seed, nearest, coarse)
    return tuple(drawn)


def _picture(shape: tuple[int, int], depth: Array, normal: Array, albedo: Array, direct: Array) -> Picture:
    """Return the buffers in one type and order, or raise `InputError` if they do not have the camera's shape."""
    expect(depth.shape == shape, "depth", f"shape {shape}", depth.shape)
    for name, array in (("normal", normal), ("albedo", albedo), ("direct", direct)):
        expect(array.shape == (3, *shape), name, f"shape {(3, *shape)}", array.shape)
    expect(depth.size < NO_PIXEL, "picture", f"fewer than {NO_PIXEL:,} pixels", f"{depth.size:,}")
    return Picture(np.ascontiguousarray(depth), *(np.ascontiguousarray(array, depth.dtype)
                                                  for array in (normal, albedo, direct)))


def _average(picture: Picture, view: View, by_surface: bool, levels_made: list[Level]) -> None:
    """Put means into levels that hold the closest pixels."""
    weights = [level.area if by_surface else plane(level.shape, level.area.dtype) for level in levels_made]
    average_pixels(picture, view, by_surface, levels_made[0], weights[0])
    for finer, coarser in itertools.pairwise(range(len(levels_made))):
        average_texels(levels_made[finer], weights[finer], by_surface, levels_made[coarser], weights[coarser])


def empty_level(number: int, shape: tuple[int, int], dtype: npt.DTypeLike) -> Level:
    """Return a level of a picture of `shape` rows and columns, to be filled."""
    h, w = level_shape(shape, number)
    three = (3, h, w)
    return Level(number, plane(three, dtype), plane((h, w), dtype), plane(three, dtype), plane(three, dtype),
                 plane((h, w), dtype), plane((h, w), np.int32))


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

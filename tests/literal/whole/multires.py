"""`MultiresSettings` as arguments of the literal stages, put together as the documentation says.

`light_at(x, normal)` is the irradiance (N, 3, n) of each light at places (3, n). What the literal text has no word for:
rays, albedo within splats as printed.
"""

import math

import numpy as np

from refgi.literal.multires import grid, representatives
from refgi.literal.multires_lights import detail, lists, points, splits
from refgi.literal.multires_upsample import geometry_list, sum_of_pictures, upsample
from tests.literal.whole.pairs import irradiance_of
from tests.naive.crossings import LIFT, corners_of, free


def picture(buffer, eye, light_at, settings):
    """Return the irradiance (3, h, w) of lights in a G-buffer, at its own size."""
    how, printed, ids = settings.subsplats, settings.as_published, ids_of(buffer.covered)
    top = coarsest_level(ids.shape, how.coarsest)
    form = top, how.upsampling, "ams_filter_all" in printed, "ams_all_corners" not in printed
    if how.name() == "irradiance":
        light = sum_of_pictures(ids, *lists_of_lights(buffer, light_at, how, top), *form)
    else:
        *cells, pixel = shared_list(buffer, how.criteria, top, how.finest)
        values = light_at(*points(buffer.position, buffer.normal, ids, *cells, pixel, how.representative == "mean"))
        values = values.sum(axis=0)
        if "ams_rho_in_splat" in printed:  # what the camera sees is the picture as printed, 0 where albedo is
            values = values * buffer.albedo.reshape(3, -1)[:, pixel]
        light = upsample(ids, *cells, values, *form)
        if "ams_rho_in_splat" in printed:
            light = np.divide(light, buffer.albedo, out=np.zeros_like(light), where=buffer.albedo > 0)
    return detail(light, buffer.position, buffer.normal, ids, np.asarray(eye)[None], settings.detail)


def ids_of(covered):
    """Return 0 where there is a surface, -1 where not."""
    return np.where(covered, 0, -1)


def coarsest_level(shape, cells):
    """Return the first level whose longer side has no more than so many cells."""
    level = 0
    while max(grid(shape, level)) > cells:
        level += 1
    return level


def shared_list(buffer, criteria, top, finest):
    """Return the subsplats that geometry asks for: level, row, column, pixel."""
    tests = {"rim": criteria.rim, "diagonal": criteria.diagonal}
    if criteria.depth is not None:
        tests |= {"depth_threshold": criteria.depth.threshold, "depth_measure": criteria.depth.measure}
    if criteria.derivative is not None:
        tests |= {"slope_threshold": criteria.derivative.threshold, "slope_measure": criteria.derivative.measure}
    if criteria.normal is not None:
        tests |= {"normal_threshold": criteria.normal.threshold, "components": len(criteria.normal.components)}
    if criteria.curvature is not None:
        tests |= {"curvature_threshold": criteria.curvature.threshold, "rate": criteria.curvature.name() == "rate"}
    return geometry_list(buffer.position, buffer.normal, buffer.depth, ids_of(buffer.covered), top=top, finest=finest,
                         **tests)


def lists_of_lights(buffer, light_at, how, top):
    """Return the lists of all lights, each refined by its own irradiance (Sec. 3.3.1), as `lists` does."""
    ids, sampled = ids_of(buffer.covered), []
    pixels = representatives(ids, top)
    for level, pixel in enumerate(pixels):
        row, column = np.nonzero(pixel >= 0)
        cells = np.full_like(row, level), row, column, pixel[row, column]
        light = light_at(*points(buffer.position, buffer.normal, ids, *cells, how.representative == "mean"))
        sampled.append(np.zeros((*light.shape[:2], *pixel.shape)))
        sampled[-1][..., row, column] = light
    start = None if how.criteria is None else shared_list(buffer, how.criteria, top, how.finest)[:3]
    return lists(pixels, sampled, splits(pixels, sampled, how.finest, how.threshold, how.form, start))


def upsampled(covered, top, mode, values):
    """Return the picture (3, h, w) of {cell: (3,)}; 0 where there is no surface."""
    columns = np.array(list(values), int).reshape(-1, 3).T
    return upsample(ids_of(covered), *columns, np.array(list(values.values())).reshape(-1, 3).T, top, mode)


# how lights light places


def light_of(lights, areas, pairs, geometry=None):
    """Return `light_at` of pixel lights of areas (N,) or None; where there is geometry with a ray for each pair."""
    def at(x, normal):
        each = np.moveaxis(sum(irradiance_of(x, normal, lights, pairs, areas)), 0, 1)
        return each if geometry is None else each * visible(corners_of(geometry), x, normal, lights)[:, None]

    return at


def visible(corners, x, normal, lights):
    """Return V (N, n): rays between both surfaces, lifted off them so that neither hides itself."""
    found = []
    for p, m in zip(lights.position.T, lights.normal.T, strict=True):
        away = p - x.T
        start = x.T + LIFT * normal.T * np.where((away * normal.T).sum(axis=1) > 0, 1, -1)[:, None]
        end = p + LIFT * m * np.where(away @ m < 0, 1, -1)[:, None]
        found.append(free(corners, start, end))
    return np.array(found)


def demo_areas(position, source, drawn):
    """Return pi L^2 / (1.5 N): lights at (3, n) drawn with N - n dark ones from the map of a source at (3,)."""
    return math.pi * ((position - np.asarray(source)[:, None]) ** 2).sum(axis=0) / (1.5 * drawn)

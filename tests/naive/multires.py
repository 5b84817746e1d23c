"""Slow literal twin of adaptive multiresolution splatting (Nichols and Wyman 2009) as a whole, in float64.

The literal text of each stage, put together as the documentation says. A cell is (level, i, j); a place is the
(position, normal) of a receiver. A light is a function of a place: its irradiance there, (3,) W/m^2.
"""

import math
from collections.abc import Mapping
from functools import partial
from types import SimpleNamespace

import numpy as np

from refgi.literal import multires as literal
from refgi.literal.multires_lights import detail
from refgi.literal.multires_upsample import upsample
from tests.naive import pair_term, per_light
from tests.naive.truth import nearest_hit

LIFT = 1e-6  # m: of a shadow ray's ends


def picture(view, eye, lights, settings):
    """Return the irradiance (3, h, w) of the lights in a view, at the view's own size."""
    how, covered = settings.subsplats, view.covered
    top = coarsest_level(covered.shape, how.coarsest)
    at = partial(surface, view, how.representative, covered)
    enlarge = partial(upsampled, covered, top, how.upsampling, settings.as_published)
    if how.name() == "irradiance":
        light = sum(enlarge(values) for values in lists_of_lights(view, lights, at, how, top))
    else:
        listed = shared_list(view, how.criteria, top, how.finest)
        values = {cell: sum(light(at(*cell)) for light in lights) for cell in listed}
        weight = albedo_of_subsplats(view, listed) if "ams_rho_in_splat" in settings.as_published else None
        light = enlarge(values) if weight is None else without_albedo(view, enlarge(times(values, weight)))
    return light * surface_detail(view, eye, settings.detail)


def view_of(gbuffer):
    """Return the channels of a G-buffer that the twin reads."""
    return SimpleNamespace(**{name: getattr(gbuffer, name) for name in
                              ("position", "normal", "depth", "covered", "albedo", "triangle_id")})


def coarsest_level(shape, cells):
    """Return the first level whose longer side has no more than so many cells."""
    level = 0
    while max(literal.grid(shape, level)) > cells:
        level += 1
    return level


def shared_list(view, criteria, top, finest):
    """Return the subsplats that geometry asks for."""
    ids, tests = np.where(view.covered, 0, -1), {}
    if criteria.depth is not None:
        both = literal.depth_ranges(view.depth, ids, top, criteria.rim)
        tests |= {"depth_least": both[:top], "depth_largest": both[top:], "depth_threshold": criteria.depth.threshold,
                  "depth_measure": criteria.depth.measure}
    if criteria.derivative is not None:
        relative = criteria.derivative.measure != "absolute"
        tests |= {"slope": literal.slopes(view.depth, ids, top, relative), "slope_measure": criteria.derivative.measure,
                  "slope_threshold": criteria.derivative.threshold}
    if criteria.normal is not None:
        both = literal.normal_ranges(view.normal, ids, top, criteria.rim, len(criteria.normal.components))
        tests |= {"normal_least": both[:top], "normal_largest": both[top:],
                  "normal_threshold": criteria.normal.threshold}
    if criteria.curvature is not None:
        rate = criteria.curvature.name() == "rate"
        tests |= {"curvature": literal.curvatures(view.normal, view.position, ids, top, rate),
                  "curvature_threshold": criteria.curvature.threshold}
    marks = literal.discontinuities(top, finest, **tests)
    listed = literal.subsplats(ids, literal.states(marks, ids, criteria.diagonal), finest)
    return list(zip(*(column.tolist() for column in listed[:3]), strict=True))


# where a subsplat is evaluated


def surface(view, how, covered, *cell):
    """Return the place of a subsplat: of the pixel right and below of its centre, or the mean of its surface."""
    level, i, j = cell
    inside = np.s_[i << level : (i + 1) << level, j << level : (j + 1) << level]
    shown = covered[inside]
    if not shown.any():
        return None
    if how == "pixel":
        y, x = per_light.representative(covered, *cell)
        return view.position[:, y, x], view.normal[:, y, x]
    position, normal = (channels[:, *inside][:, shown].mean(axis=1) for channels in (view.position, view.normal))
    return position, normal / np.linalg.norm(normal)


# lists of each light (Sec. 3.3.1)


def lists_of_lights(view, lights, at, how, top):
    """Return {cell: irradiance} of each light, refined by its own irradiance."""
    covered, start = view.covered, None
    if how.criteria is not None:
        listed = shared_list(view, how.criteria, top, how.finest)
        start = {(level + up, i >> up, j >> up) for level, i, j in listed for up in range(1, top - level + 1)}
    places = [at(top, i, j) for i, j in np.ndindex(*literal.grid(covered.shape, top))]
    brightest = max(float(sum(light(place) for light in lights).max()) for place in places if place is not None)
    threshold = {"relative": lambda largest: how.threshold * largest, "absolute": lambda _: how.threshold,
                 "brightest": lambda _: how.threshold * brightest / len(lights)}[how.form]
    return [per_light.subsplats(covered, light, top, how.finest, threshold, start, lambda _, *cell: at(*cell))
            for light in lights]


# from subsplats to pixels (Sec. 3.5)


def upsampled(covered, top, how, as_published, values):
    """Return the picture (3, h, w) of {cell: (3,)}; 0 where there is no surface."""
    columns = np.array(list(values), int).reshape(-1, 3).T
    light = np.array(list(values.values())).reshape(-1, 3).T
    return upsample(np.where(covered, 0, -1), *columns, light, top, how, "ams_filter_all" in as_published,
                    "ams_all_corners" not in as_published)


def albedo_of_subsplats(view, listed):
    """Return {cell: albedo of the pixel that stands for it}."""
    return {cell: view.albedo[:, *per_light.representative(view.covered, *cell)] for cell in listed}


def times(values: Mapping, others: Mapping):
    """Multiply cell by cell."""
    return {cell: values[cell] * others[cell] for cell in values}


def without_albedo(view, light):
    """Divide by the albedo of each pixel: what the camera sees is the picture as printed. 0 where that is black."""
    return np.divide(light, view.albedo, out=np.zeros_like(light), where=view.albedo > 0)


def surface_detail(view, eye, a):
    """Eq. 3: a <V, N> + 1 - a at each pixel."""
    ids = np.where(view.covered, 0, -1)
    return detail(np.ones_like(view.position), view.position, view.normal, ids, np.asarray(eye)[None], a)


# how one light lights one place (Eq. 2)


def lights_of(lights, areas, pairs, blocked=None):
    """Return each pixel light as a function of a place.

    `lights` are arrays as `PixelLights`, `areas` (N,) what they stand for or None. `blocked(x, n, p, n_p)` says whether
    anything lies between two places.
    """
    of_light = [[] for _ in range(lights.flux.shape[1])]
    for part in pair_term.parts(lights, pairs, areas):
        of_light[part.light].append(part)
    return [partial(one_light, parts, pairs, blocked) for parts in of_light if parts]


def one_light(parts, pairs, blocked, place):
    """Return the irradiance (3,) of a pixel light at a place, its diffuse part and its lobe."""
    x, normal = place
    if blocked is not None and blocked(x, normal, parts[0].position, parts[0].normal):
        return np.zeros(3)
    return sum(part.flux * pair_term.received(part, x[:, None], normal[:, None], pairs)[0] for part in parts)


def demo_areas(position, source, drawn):
    """Return pi L^2 / (1.5 N): lights at (3, n) drawn with N - n dark ones from the map of a source at (3,)."""
    return math.pi * ((position - np.asarray(source)[:, None]) ** 2).sum(axis=0) / (1.5 * drawn)


def blocked_by(vertices, faces):
    """Return the function of two places and their normals that says whether a triangle lies between them."""
    def blocked(x, normal_x, p, normal_p):
        # lifted off both surfaces, so that neither hides itself
        start, end = x + LIFT * side(normal_x, p - x), p + LIFT * side(normal_p, x - p)
        return nearest_hit(vertices, faces, start, end - start)[1] < 1

    return blocked


def side(normal, away):
    """Return the normal or its opposite, on the side that a direction points to."""
    return normal if normal @ away > 0 else -normal

"""Slow literal twin of adaptive multiresolution splatting (Nichols and Wyman 2009) as a whole, in float64.

Written from the paper, its errata and the documentation. A cell is (level, i, j); a place is the (position, normal) of
a receiver. A light is a function of a place: its irradiance there, (3,) W/m^2.
"""

import math
from collections.abc import Mapping
from functools import partial
from types import SimpleNamespace

import numpy as np

from tests.naive import eq2, per_light, refinement, upsample
from tests.naive.sphere import spherical_pair
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
    while max(refinement.grid(shape, level)) > cells:
        level += 1
    return level


# which cells are refined for all lights (Sec. 3.2 and 3.3)


def shared_list(view, criteria, top, finest):
    """Return the subsplats that geometry asks for."""
    tests = [test for test in (depth_range(view, criteria), depth_slope(view, criteria), normal_range(view, criteria),
                               curvature(view, criteria)) if test is not None]
    need = refinement.discontinuities(view.covered.shape, top, finest, lambda *cell: any(test(*cell) for test in tests))
    return refinement.refine(need, view.covered, criteria.diagonal)


def depth_range(view, criteria):
    """Return the test max - min > t of the depth, t a length or a share of min."""
    if criteria.depth is None:
        return None

    def test(*cell):
        low, high = refinement.span(view.depth, view.covered, *cell, criteria.rim)
        unit = 1 if criteria.depth.measure == "absolute" else low
        return high - low > level_threshold(criteria.depth, cell[0]) * unit

    return test


def depth_slope(view, criteria):
    """Return the test of the largest sqrt((dz/dx)^2 + (dz/dy)^2) among a cell's pixels, or of that over z."""
    if criteria.derivative is None:
        return None
    relative = criteria.derivative.measure != "absolute"
    slopes = everywhere(view, lambda *pixel: refinement.slope(view.depth, view.covered, *pixel, relative))
    return lambda *cell: (slopes[refinement.pixels_of(slopes.shape, *cell)].max()
                          > level_threshold(criteria.derivative, cell[0]))


def level_threshold(criterion, level):
    """Return the threshold of a level's cells: the authors' demo has 3 / level of it."""
    return criterion.threshold * 3 / level if criterion.measure == "demo" else criterion.threshold


def normal_range(view, criteria):
    """Return the test max - min > t of any component that counts."""
    if criteria.normal is None:
        return None

    def test(*cell):
        spans = [refinement.span(view.normal["xyz".index(axis)], view.covered, *cell, criteria.rim)
                 for axis in criteria.normal.components]
        return any(high - low > criteria.normal.threshold for low, high in spans)

    return test


def curvature(view, criteria):
    """Return the test of the largest Eq. 1 among a cell's pixels, or of that over the distance."""
    if criteria.curvature is None:
        return None
    rate = criteria.curvature.name() == "rate"
    bends = everywhere(view, lambda *pixel: refinement.curvature(view.normal, view.position, view.covered, *pixel,
                                                                 rate=rate))
    return lambda *cell: bends[refinement.pixels_of(bends.shape, *cell)].max() > criteria.curvature.threshold


def everywhere(view, function):
    """Return a function of a pixel's row and column for all of them."""
    height, width = view.covered.shape
    return np.array([[function(i, j) for j in range(width)] for i in range(height)])


# where a subsplat is evaluated


def surface(view, how, covered, *cell):
    """Return the place of a subsplat: of the pixel right and below of its centre, or the mean of its surface."""
    inside = refinement.pixels_of(covered.shape, *cell)
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
    places = [at(top, i, j) for i, j in np.ndindex(*refinement.grid(covered.shape, top))]
    brightest = max(float(sum(light(place) for light in lights).max()) for place in places if place is not None)
    threshold = {"relative": lambda largest: how.threshold * largest, "absolute": lambda _: how.threshold,
                 "brightest": lambda _: how.threshold * brightest / len(lights)}[how.form]
    return [per_light.subsplats(covered, light, top, how.finest, threshold, start, lambda _, *cell: at(*cell))
            for light in lights]


# from subsplats to pixels (Sec. 3.5)


def upsampled(covered, top, how, as_published, values):
    """Return the picture (3, h, w) of {cell: (3,)}; 0 where there is no surface."""
    filters = {"filter_all": "ams_filter_all" in as_published}
    if how == "tent":
        pixels = upsample.tent(values, covered, top, **filters, corner_rule="ams_all_corners" not in as_published)
    elif how == "demo":
        pixels = upsample.demo(values, covered, top, **filters)
    elif how == "nearest":
        pixels = upsample.nearest(values, covered)
    else:
        pixels = upsample.naive_bilinear(values, covered, top)
    light = np.zeros((3, *covered.shape))
    for (y, x), value in pixels.items():
        light[:, y, x] = value
    return light


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
    to_eye = np.asarray(eye)[:, None, None] - view.position
    to_eye = to_eye / np.linalg.norm(to_eye, axis=0)
    return a * np.maximum(0, (to_eye * view.normal).sum(axis=0)) + 1 - a


def halved(light, covered_large, covered):
    """Return a picture at half the size: the mean of those of four pixels that show a surface (Sec. 4).

    Where none of the four does, the mean of such means of the pixels around.
    """
    means = {}
    for i, j in np.ndindex(*covered.shape):
        four = np.s_[2 * i:2 * i + 2, 2 * j:2 * j + 2]
        if covered_large[four].any():
            means[i, j] = light[:, *four][:, covered_large[four]].mean(axis=1)
    small = np.zeros((3, *covered.shape))
    for i, j in zip(*np.nonzero(covered), strict=True):
        around = [means[i + a, j + b] for a in (-1, 0, 1) for b in (-1, 0, 1) if (i + a, j + b) in means]
        small[:, i, j] = means[i, j] if (i, j) in means else np.mean(around, axis=0)
    return small


# how one light lights one place (Eq. 2)


def lights_of(lights, areas, pairs, clamp, blocked=None):
    """Return each pixel light as a function of a place.

    `lights` are arrays as `PixelLights`, `areas` (N,) what they stand for or None. `blocked(x, n, p, n_p)` says whether
    anything lies between two places.
    """
    return [partial(one_light, lights, k, 0.0 if areas is None else areas[k], pairs, clamp, blocked)
            for k in range(lights.flux.shape[1])]


def one_light(lights, k, area, pairs, clamp, blocked, place):
    """Return the irradiance (3,) of a pixel light at a place, its diffuse part and its lobe."""
    (x, normal_x), p, normal_p = place, lights.position[:, k], lights.normal[:, k]
    if blocked is not None and blocked(x, normal_x, p, normal_p):
        return np.zeros(3)
    p, flux = p - pairs.offset * normal_p, lights.flux[:, k]
    if "sii_no_pi" in pairs.as_published:
        flux = math.pi * flux
    if clamp is not None and clamp.name() == "sphere":
        # pi r^2 = value A
        return spherical_pair(x, normal_x, p, normal_p, flux, radius=math.sqrt(clamp.value * area / math.pi))
    near = near_terms(clamp, area)
    light = eq2.clamped_pair(x, normal_x, p, normal_p, flux, **near)
    if lights.lobe_flux is None or not lights.lobe_flux[:, k].any():
        return light
    lobe = lights.lobe_axis[:, k], float(lights.lobe_exponent[k]), lights.lobe_flux[:, k]
    return light + clamped_lobe(x, normal_x, p, normal_p, *lobe, pairs.lobe, **near)


def near_terms(clamp, area):
    """Return what keeps near pairs finite, in the words of `eq2.clamped_pair`."""
    if clamp is None:
        return {}
    if clamp.name() == "disc":
        return {"area": area}
    return {{"distance": "least", "geometry": "bound"}[clamp.name()]: clamp.value}


def clamped_lobe(x, normal_x, p, normal_p, axis, exponent, flux, lobe, least=0.0, bound=math.inf, area=0.0):
    """Eq. 3 of SII with a bounded <n_x . -w> / r^2, for a lobe has no emitter's cosine."""
    r = float(np.linalg.norm(x - p))
    here = exponent * min(1.0, r / lobe.widening) if lobe.widening else exponent
    intensity = eq2.lobe_intensity((x - p) / r, normal_p, axis, here, flux, lobe.norm)
    cosine = max(0.0, float(normal_x @ (p - x)) / r)
    return intensity * min(bound, cosine / (max(r, least) ** 2 + area / math.pi))


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

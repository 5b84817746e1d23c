"""Slow literal twin of `sii` as a whole: pairs light by light, ranges, meshes of bounds, half resolution, in float64.

Each part of a pixel light has a range. Arrays over receivers come last.
"""

import math
from collections.abc import Iterator

import numpy as np

from refgi.literal.upsampling import joint_bilateral
from refgi.settings import replaced
from tests.naive import raster
from tests.naive.draws import draw
from tests.naive.pair_term import Part, diffuse_peak, intensity, lobe_norms, parts, received, towards


def sii(frame, settings, lights, footprint=None):
    """Return the irradiance (3, h, w) of a frame by its pixel lights; `footprint` is the area (N,) of each."""
    picture = np.zeros((3, *frame.gbuffer.covered.shape))
    picture[:, frame.gbuffer.covered] = irradiance(frame, settings, lights, footprint)
    surfaces = frame.gbuffer.position, frame.gbuffer.normal, frame.gbuffer.covered
    return joint_bilateral(*surfaces, picture) if settings.half_resolution else picture


def cut_irradiance(frame, settings, lights, footprint=None):
    """Return the pairs out of range, at full resolution, (3, h, w), whatever the bound."""
    settings = replaced(settings, {"reach.bound": "full"})
    picture = np.zeros((3, *frame.gbuffer.covered.shape))
    picture[:, frame.gbuffer.covered] = irradiance(frame, settings, lights, footprint, outside=True)
    return picture


def fragments(frame, settings, lights):
    """Return how many parts count at each pixel (h, w), and at how many pixels the parts of each light do (N,)."""
    overdraw, of_light = np.zeros(frame.gbuffer.covered.shape, int), np.zeros(lights.flux.shape[1], int)
    for part, weight in weighted(frame, settings, lights):
        overdraw[frame.gbuffer.covered] += weight > 0
        of_light[part.light] += np.count_nonzero(weight)
    return overdraw, of_light


def irradiance(frame, settings, lights, footprint, *, outside=False):
    """Sum the weighted pairs, or what the weights leave out, at the n covered pixels, (3, n)."""
    buffer, total = frame.gbuffer, np.zeros((3, np.count_nonzero(frame.gbuffer.covered)))
    x, normal = covered_points(frame), buffer.normal[:, buffer.covered]
    for part, weight in weighted(frame, settings, lights, footprint):
        share = 1 - weight if outside else weight
        total += np.outer(part.flux, share * received(part, x, normal, settings.pairs))
    return total


# ranges


def weighted(frame, settings, lights, footprint=None) -> Iterator[tuple[Part, np.ndarray]]:
    """Yield each part and by how much its pairs count at the n covered pixels: 0 out of range, else 1 or more."""
    x, reach, found = covered_points(frame), settings.reach, parts(lights, settings.pairs, footprint)
    if reach.cut is None:
        yield from ((part, np.ones(x.shape[1])) for part in found)
        return
    strengths = [strength(part, x, settings.pairs) for part in found]
    for part, b, low in zip(found, strengths, thresholds(x, settings, lights, found, strengths), strict=True):
        xi = 1 - draw(reach.seed, 3 if part.exponent is None else 3 + 256, part.xi) if reach.stochastic else 1.0
        weight = np.where(b >= xi * low, np.maximum(1, low / np.maximum(b, xi * low)), 0.0)
        if reach.bound.name() == "mesh" and not reach.bound.inflate:
            weight *= drawn(frame, settings, part, peak(part, settings.pairs) / (xi * low))
        yield part, weight


def covered_points(frame):
    """Return the points that the covered pixels see, (3, n)."""
    return frame.gbuffer.position[:, frame.gbuffer.covered]


def strength(part, x, pairs):
    """Return B = I(w) / r^2, the irradiance that a part causes at most."""
    w, r = towards(part, x)
    return part.flux.max() * intensity(part, w, r, pairs) / r**2


def thresholds(x, settings, lights, found, strengths):
    """Return I_low of each part: one for all, share max I_0 / L^2, unless each has its own as published."""
    cut, peaks = settings.reach.cut, [peak(part, settings.pairs) for part in found]
    if cut.name() == "absolute":
        return [cut.irradiance] * len(found)
    length = cut.reference_length or reference_length(x, lights, max(peaks), strengths)
    own = "per_light_ilow" in cut.as_published
    return [cut.share * (one if own else max(peaks)) / length**2 for one in peaks]


def peak(part, pairs):
    """Return I_0, the largest channel's peak intensity."""
    if part.exponent is None:
        return part.flux.max() * diffuse_peak(pairs)
    return part.flux.max() * float(lobe_norms(part, np.array([part.exponent]), pairs.lobe.norm)[0])


def reference_length(x, lights, brightest, strengths):
    """Return L at which x = 5 % leaves 125 of 768 pairs of drawn lights and pixels, at most ten diagonals."""
    kept = round(125 / 768 * lights.drawn * x.shape[1])
    positive = sorted((b for of_part in strengths for b in of_part if b > 0), reverse=True)
    longest = 10 * np.linalg.norm(np.ptp(np.concatenate([x, lights.position], axis=1), axis=1))
    return min(longest, math.sqrt(0.05 * brightest / positive[kept - 1])) if kept <= len(positive) else longest


# what the drawing of a bound covers


def drawn(frame, settings, part, square):
    """Return at which covered pixels the line of sight meets the mesh of a part's bound, R_0^2 = `square`."""
    vertices, faces = sphere_mesh(settings.reach.bound.faces)
    radius, exponent = math.sqrt(square), part.exponent or 1.0
    # Eq. (8)
    center = (exponent / (exponent + 2)) ** ((exponent + 2) / 4)
    half_width = max(center, 1 - center)
    height = (exponent / (exponent + 2)) ** (exponent / 4) * math.sqrt(2 / (exponent + 2))
    along = np.outer(vertices @ part.axis, part.axis)
    bodies = [part.position + radius * (center * part.axis + half_width * along + height * (vertices - along))]
    widening = settings.pairs.lobe.widening
    if part.exponent is not None and widening:  # the exponent is P from a on, but as printed falls without end
        ball = radius if "sii_widening" in settings.pairs.as_published else min(widening, radius)
        bodies.append(part.position + ball * vertices)
    return np.any([met(frame, body, faces) for body in bodies], axis=0)


def met(frame, vertices, faces):
    """Return at which covered pixels the ray through the pixel's centre meets any triangle."""
    camera, (height, width) = frame.scene.camera, frame.gbuffer.covered.shape
    view = raster.look(np.subtract(camera.target, camera.eye), camera.up)
    half = math.tan(camera.vfov / 2) * np.array([width / height, 1.0])
    rays = (raster.perspective_ray(camera.eye, view, half, height, width, row, column)
            for row, column in np.argwhere(frame.gbuffer.covered))
    return np.array([raster.nearest(*ray, vertices, faces)[0] >= 0 for ray in rays])


def sphere_mesh(count):
    """Return the octahedron of 8 faces or the icosahedron of 20, each cut in four until there are enough."""
    if count == 8:
        corners = np.concatenate([np.eye(3), -np.eye(3)])
        return corners, np.array([(a, b, c) for a in (0, 3) for b in (1, 4) for c in (2, 5)])
    golden = (1 + math.sqrt(5)) / 2
    corners = [np.roll((0, s, t * golden), turn) for turn in range(3) for s in (-1, 1) for t in (-1, 1)]
    triangles = [(p, q, r) for i, p in enumerate(corners) for j, q in enumerate(corners[:i]) for r in corners[:j]
                 if all(abs(np.linalg.norm(u - v) - 2) < 1e-9 for u, v in ((p, q), (q, r), (r, p)))]
    triangles = [tuple(unit(corner) for corner in triangle) for triangle in triangles]
    while len(triangles) < count:
        triangles = [four for triangle in triangles for four in cut_in_four(*triangle)]
    return np.array(triangles).reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3)


def cut_in_four(p, q, r):
    """Cut a triangle at the middles of its edges, moved out to the ball."""
    pq, qr, rp = unit(p + q), unit(q + r), unit(r + p)
    return (p, pq, rp), (pq, q, qr), (rp, qr, r), (pq, qr, rp)


def unit(vector):
    return vector / np.linalg.norm(vector)

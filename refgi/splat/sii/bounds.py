"""Ellipsoids and screen rectangles that bound where a pixel light is significant (SII Sec. 3.4, appendix, Eq. 7, 8).

A light of exponent n (1: diffuse) sends B = I_0 cos^n(alpha) / r^2, so B >= I_low inside r^2 = R_0^2 cos^n(alpha),
R_0^2 = I_0 / I_low. Lengths are shares of R_0: x along the light's axis (normal or lobe axis), rho across it, F(x) the
radius of the region; an ellipse has its centre at (c, 0), half axes w along and h across. Quadrilaterals are the exact
rectangle of the ball of radius R_0. A mesh of a coarse sphere (Sec. 4; E-SII-14 i) has its faces within the unit ball,
so as published it misses pixels; scaled by one over the distance of its nearest face it encloses the ball.
"""

import math
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.pairs.ranged_sum import LANES
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.rsm import Projection

TANGENT_POINT = 0.71  # E-SII-13: 0.70 to 0.72 wastes least


class Ellipsoid(NamedTuple):
    """Ellipsoids of revolution about the lights' axes, in units of R_0."""

    center: Array  # (...) along the axis
    half_width: Array  # (...) along the axis
    height: Array  # (...) half axis across it


class Solids(NamedTuple):
    """The bounds of some lights in the world; a light's is the union of its ellipsoid and its half ball."""

    position: Array  # (3, N) of the lights, m
    axis: Array  # (3, N) unit vectors
    square: Array  # (N,) R_0^2, m^2
    ellipsoid: Ellipsoid  # (N,) each
    ball: Array | None  # (N,) radii of half balls, m; None: no lobe is widened


def appendix_ellipsoid(exponent: npt.ArrayLike) -> Ellipsoid:
    """Return the paper's ellipsoid: centred where F is largest, as high as F there and wide enough for [0, 1].

    It encloses the significant region for every exponent n >= 0 (E-SII-13). Eq. 8 reads n/(n+2) (n+2)/4 in print; the
    second fraction is an exponent.

    >>> [round(float(value), 6) for value in appendix_ellipsoid(2.0)]  # the sphere of diameter R_0
    [0.5, 0.5, 0.5]
    """
    n = np.asarray(exponent, np.float64)
    share = n / (n + 2)
    # Eq. (8)
    center = share ** ((n + 2) / 4)
    # Eq. (7) at the centre
    height = share ** (n / 4) * np.sqrt(2 / (n + 2))
    return Ellipsoid(center, np.maximum(center, 1 - center), height)


def tangent_ellipsoid(exponent: npt.ArrayLike, tangent_point: float = TANGENT_POINT) -> Ellipsoid:
    """Return the ellipsoid through the light that touches the significant region at x_0; Eq. 8's for n < 2.

    It encloses the region for every exponent n >= 0; `tangent_point` x_0 lies in (0.4, 1], in R_0. With b = 2n / (n +
    2), F^2 = x g(x) and g = x^(b-1) - x is concave for n >= 2: it lies below its tangent g(x_0) - k (x - x_0), k = 1 -
    (b - 1) x_0^(b-2), and x times a falling line is an ellipse through the origin (E-SII-13).
    """
    n = np.asarray(exponent, np.float64)
    plain = appendix_ellipsoid(n)
    steep = np.maximum(n, 2.0)
    below = -4 / (steep + 2)  # b - 2; what follows keeps its digits for large n, where k falls as 1 / n
    power = below * math.log(tangent_point)  # of e, for x_0^(b - 2)
    slope = -np.expm1(power) - below * np.exp(power)  # k
    value = tangent_point * np.expm1(power)  # g(x_0)
    center = (tangent_point + value / slope) / 2
    height = center * np.sqrt(slope)
    return Ellipsoid(*(np.where(n < 2, old, new) for old, new in zip(plain, (center, center, height), strict=True)))


def half_ball_radius(square_range: Array, widening: float, literal: bool = False) -> Array:
    """Return the radius (m) of the half ball that, with the ellipsoid of P, holds the region of a widened lobe.

    min(a, R_0): beyond a = `widening` (m) the exponent is P, and beyond R_0 nothing is significant (E-SII-14). With
    `literal` the exponent falls as printed, without end away from the light.
    """
    radius: Array = np.sqrt(square_range)
    return radius if literal and widening > 0 else np.minimum(radius, widening)


def light_solids(
    position: Array, axis: Array, exponent: npt.ArrayLike, square: Array, tangent: bool, widening: float = 0.0,
    literal: bool = False,
) -> Solids:
    """Return the bounds of lights at `position` (3, N, m) about `axis` (3, N: normal or lobe axis), in float64.

    `exponent` (N,) is n, one 1 for diffuse lights, `square` (N,) R_0^2 in m^2; `tangent` picks tangent ellipsoids over
    those of the appendix. Exponents fall within `widening` (m), with `literal` as printed.
    """
    square = np.asarray(square, np.float64)
    ellipsoid = Ellipsoid(*(np.broadcast_to(part, square.shape) for part in (
        tangent_ellipsoid if tangent else appendix_ellipsoid)(exponent)))
    ball = half_ball_radius(square, widening, literal) if widening > 0 else None
    return Solids(np.asarray(position, np.float64), np.asarray(axis, np.float64), square, ellipsoid, ball)


SLACK = 0.01  # pixels that a receiver may be away from its pixel's centre
DEPTH_SLACK = 1e-5  # of the depth: of the mesh it is float32, of receivers their rounding
ROUNDING = 1e-4  # of the axes, that receivers may be off: where a face touches the ball nothing else is to spare


def screen_quads(projection: "Projection", position: Array, radius: Array) -> Array:
    """Return the rectangles of pixels that see into balls: top, bottom, left, right, (4, N) float64.

    Centres (3, N) and radii (N,), m. In texel coordinates (centres at + 1/2); infinite where the eye is inside the
    ball, top > bottom for a ball behind the eye. `InputError` unless the map is a single perspective one.
    """
    from refgi.rsm.raster.projection import PERSPECTIVE

    expect(projection.kind == PERSPECTIVE and projection.maps == 1, "projection", "one perspective map",
           f"kind {projection.kind}, {projection.maps} maps")
    right, down, ahead = projection.frame[0] @ (position - projection.origin[0][:, None])
    quads = []
    for across, half, size in ((down, projection.half[1], projection.height),
                               (right, projection.half[0], projection.width)):
        low, high = _tangents(across, ahead, radius)
        quads += [(low / half + 1) * 0.5 * size, (high / half + 1) * 0.5 * size]
    return np.stack(quads)


def _tangents(across: Array, ahead: Array, radius: Array) -> tuple[Array, Array]:
    """Return the slopes of the two tangents to a circle; low > high when it lies behind the eye."""
    distance = np.hypot(across, ahead)
    outside = distance > radius
    angle = np.arctan2(across, ahead)
    half = np.arcsin(np.minimum(1, radius / np.maximum(distance, np.finfo(np.float64).tiny)))
    low, high = angle - half, angle + half
    straight = np.pi / 2
    unseen = outside & ((low >= straight) | (high <= -straight))
    with np.errstate(invalid="ignore"):
        left = np.where(outside & (low > -straight), np.tan(np.clip(low, -straight, straight)), -np.inf)
        right = np.where(outside & (high < straight), np.tan(np.clip(high, -straight, straight)), np.inf)
    return np.where(unseen, np.inf, left), np.where(unseen, -np.inf, right)


def tiles_of_quads(quads: Array, places: Array, width: int) -> Array:
    """Return which tiles of LANES receivers have pixels in which rectangles (4, N), (ceil(n / LANES), N) bool.

    `places` (n,) are the flat indices of the receivers' pixels in a picture `width` pixels wide, tile after tile.
    """
    starts = np.arange(0, len(places), LANES)
    (top, bottom), (left, right) = ((np.minimum.reduceat(part, starts)[:, None] + 0.5 - SLACK,
                                     np.maximum.reduceat(part, starts)[:, None] + 0.5 + SLACK)
                                    for part in np.divmod(places, width))
    meet: Array = (quads[0] <= bottom) & (quads[1] >= top) & (quads[2] <= right) & (quads[3] >= left)
    return meet


def tiles_of_pixels(mask: Array, places: Array) -> Array:
    """Return which tiles of LANES receivers have pixels in a mask (h, w), (ceil(n / LANES),) bool.

    `places` (n,) are the flat indices of the receivers' pixels, tile after tile.
    """
    tiles: Array = np.logical_or.reduceat(mask.reshape(-1)[places], np.arange(0, len(places), LANES))
    return tiles


def inverse_depths(projection: "Projection", position: Array, places: Array) -> Array:
    """Return 1 / depth (h, w), 1/m, of receivers (3, n) at pixels of flat indices (n,); 0 at others."""
    inverse_depth = np.zeros(projection.shape)
    inverse_depth.reshape(-1)[places] = 1 / (projection.frame[0, 2] @ (position - projection.origin[0][:, None]))
    return inverse_depth


@cache
def sphere_mesh(faces: int) -> tuple[Array, Array]:
    """Return a mesh of unit vectors (n, 3) on the unit ball and its triangles (faces, 3), int32.

    8 faces: the octahedron; 20: the icosahedron; 80, 320, 1280: that with each face cut in four, the new vertices moved
    out to the ball.
    """
    if faces == 8:
        vertices = np.concatenate([np.eye(3), -np.eye(3)])
        return vertices, np.array([[a, b, c] for a in (0, 3) for b in (1, 4) for c in (2, 5)], np.int32)
    vertices, triangles = _icosahedron()
    while len(triangles) < faces:
        vertices, triangles = _cut_in_four(vertices, triangles)
    return vertices, triangles


def inflation(vertices: Array, triangles: Array) -> float:
    """Return the factor by which a mesh about the origin must grow to enclose the unit ball: 1 / its nearest plane.

    >>> [round(inflation(*sphere_mesh(faces)), 4) for faces in (8, 20, 80, 320, 1280)]
    [1.7321, 1.2584, 1.0705, 1.0181, 1.0045]
    """
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    normal = np.cross(b - a, c - a)
    distance = np.abs((normal * a).sum(axis=1)) / np.linalg.norm(normal, axis=1)
    return float(1 / distance.min())


def covered_pixels(
    projection: "Projection", solids: Solids, k: int, faces: int, inflate: bool, seen: Array | None = None
) -> Array:
    """Rasterize the mesh bound of light k and return the pixels whose line of sight meets it, (h, w) bool.

    `faces` triangles are made to enclose the ellipsoid by `inflate`. All pixels when the eye is inside. With `seen`
    (h, w), 1 / depth, 1/m (0: nothing), only those where the surface at that depth lies in the mesh.
    """
    vertices, triangles = sphere_mesh(faces)
    grown = vertices * ((inflation(vertices, triangles) * (1 + ROUNDING)) if inflate else 1.0)
    radius, (center, half_width, height) = math.sqrt(solids.square[k]), (part[k] for part in solids.ellipsoid)
    axis = solids.axis[:, k]
    # stretched along the axis: w where the vector has its share of the axis, h for the rest
    along = np.outer(grown @ axis, axis)
    bodies = [solids.position[:, k] + radius * (center * axis + height * (grown - along) + half_width * along)]
    if solids.ball is not None:
        bodies.append(solids.position[:, k] + solids.ball[k] * grown)
    covered = np.zeros(projection.shape, np.bool_)
    for body in bodies:
        far, near = _sides(projection, body, triangles)
        drawn = (far > 0) | (near > 0)
        if seen is not None:
            drawn &= (far <= seen * (1 + DEPTH_SLACK)) & ((near >= seen * (1 - DEPTH_SLACK)) | (near == 0))
        covered |= drawn
    return covered


def _sides(projection: "Projection", body: Array, triangles: Array) -> list[Array]:
    """Return 1 / depth (h, w), 1/m, of the faces of a convex mesh that look away from the eye and of those towards it.

    0 where there is none: the eye is inside, or the line of sight misses the mesh.
    """
    from refgi.rsm import rasterize
    from refgi.scene.model import Geometry

    a, b, c = (body[triangles[:, corner]] for corner in range(3))
    normal = np.cross(b - a, c - a)
    outward = np.sign((normal * (a - body.mean(axis=0))).sum(axis=1))
    towards = outward * (normal * (projection.origin[0] - a)).sum(axis=1) > 0
    return [rasterize(Geometry(body, some, np.zeros(len(some), np.int32)), projection).inverse_depth
            for some in (triangles[~towards], triangles[towards])]


def _icosahedron() -> tuple[Array, Array]:
    golden = (1 + math.sqrt(5)) / 2
    base = [(0, s, t * golden) for s in (-1, 1) for t in (-1, 1)]
    vertices = np.array([np.roll(v, turn) for turn in range(3) for v in base], np.float64)
    side = np.linalg.norm(vertices[:, None] - vertices, axis=2)
    near = (side > 0) & (side < 2.1)  # edges have length 2
    triangles = [(a, b, c) for a in range(12) for b in range(a) for c in range(b) if near[a, b] and near[b, c]
                 and near[a, c]]
    return vertices / math.hypot(1, golden), np.array(triangles, np.int32)


def _cut_in_four(vertices: Array, triangles: Array) -> tuple[Array, Array]:
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]], axis=2)
    distinct, of_edge = np.unique(edges.reshape(-1, 2), axis=0, return_inverse=True)
    middle = vertices[distinct].sum(axis=1)
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    ab, bc, ca = (of_edge.reshape(-1, 3) + len(vertices)).T
    a, b, c = triangles.T
    cut = np.stack([np.stack(part, axis=1) for part in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    return np.concatenate([vertices, middle]), cut.reshape(-1, 3).astype(np.int32)

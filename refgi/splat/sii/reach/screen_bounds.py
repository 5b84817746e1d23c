"""Bounds on the screen: the rectangle around a light's ball, and pixels that a bound's drawing covers (SII Sec. 3.2).

The paper's first bound is a quadrilateral in screen space. Here it is the exact rectangle of the ball of radius R_0
around the light: the tangents from the eye, horizontally and vertically.

Ellipsoids as low-polygon meshes, drawn to find the pixels a light may reach (SII Sec. 3.4 and 4; E-SII-14 i).

Graphics hardware draws a coarse sphere, scaled and turned into each light's ellipsoid. The sphere's vertices lie on
the unit ball and its faces within it, so as published it misses pixels; scaled by one over the distance of its
nearest face it encloses the ball. A pixel comes into question where the drawing covers its centre.
"""

import math
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.pairs.ranged_sum import LANES
from refgi.splat.sii.reach.bounds import Solids

if TYPE_CHECKING:
    from refgi.rsm import Projection

Array = npt.NDArray[Any]

SLACK = 0.01  # pixels that a receiver may be away from its pixel's centre
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


def covered_pixels(projection: "Projection", solids: Solids, k: int, faces: int, inflate: bool) -> Array:
    """Rasterize the mesh bound of light k and return the pixels whose line of sight meets it, (h, w) bool.

    `faces` triangles are made to enclose the ellipsoid by `inflate`. All pixels when the eye is inside.
    """
    from refgi.rsm import rasterize
    from refgi.scene.model import Geometry

    vertices, triangles = sphere_mesh(faces)
    grown = vertices * ((inflation(vertices, triangles) * (1 + ROUNDING)) if inflate else 1.0)
    radius, (center, half_width, height) = math.sqrt(solids.square[k]), (part[k] for part in solids.ellipsoid)
    axis = solids.axis[:, k]
    # stretched along the axis: w where the vector has its share of the axis, h for the rest
    along = np.outer(grown @ axis, axis)
    parts = [solids.position[:, k] + radius * (center * axis + height * (grown - along) + half_width * along)]
    if solids.ball is not None:
        parts.append(solids.position[:, k] + solids.ball[k] * grown)
    corners = np.concatenate([triangles + i * len(vertices) for i in range(len(parts))])
    shape = Geometry(np.concatenate(parts), corners, np.zeros(len(corners), np.int32))
    covered: Array = rasterize(shape, projection).triangle_id >= 0
    return covered


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

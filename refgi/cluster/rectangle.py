"""Virtual area lights (VALs, Sec. 4, 5, 6): the bounding rectangle of each cluster's lights, projected onto its plane.

It lies along fixed axes, those of the lights, or those of least area; the paper names none.
"""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from refgi.cluster.kmeans import Clustering
from refgi.cluster.settings import AreaLightSettings, Axes
from refgi.cluster.settings import Extent as Size
from refgi.errors import expect
from refgi.pairs.pixel_lights import PixelLights
from refgi.stages import stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.lights import PixelLights

ROUND = 1e-9  # a spread this near to that of a disc has no direction
# (area light, points (3, n), facing (3, n)) -> V (n,); one with a parameter `shading` takes the cosines' normals
VisibilityFunction = Callable[..., Array]
UPRIGHT = 0.999  # |y| of a normal from which a map's up is -z, as for all maps
FLAT = 1e-5  # of a cluster's radius: a narrower rectangle is a line, of no width but the rounding of its lights


def turn_of(flat: Array, axes: Axes) -> float:
    """Return the angle of axes of points (2, n), m, from the first to the second; 0 where no direction stands out."""
    if axes == "fixed" or flat.shape[1] < 2:
        return 0.0
    return _of_spread(flat) if axes == "pca" else _of_least_area(flat)


def _of_spread(flat: Array) -> float:
    s, t = flat - flat.mean(axis=1, keepdims=True)
    difference, product, sum_ = float(s @ s - t @ t), float(2 * (s @ t)), float(s @ s + t @ t)
    if math.hypot(difference, product) <= ROUND * sum_:
        return 0.0
    return 0.5 * math.atan2(product, difference)


def _of_least_area(flat: Array) -> float:
    """One side of the rectangle of least area lies along an edge of the hull (Freeman and Shapira 1975)."""
    corners = _hull(flat)
    edges = np.roll(corners, -1, axis=1) - corners
    length = np.hypot(*edges)
    if len(length) < 2 or not length.any():
        return 0.0
    (c, d), proper = (edges / np.where(length > 0, length, 1)), length > 0
    c, d = c[proper, None], d[proper, None]
    along, across = c * corners[0] + d * corners[1], c * corners[1] - d * corners[0]
    best = int(np.argmin(np.ptp(along, axis=1) * np.ptp(across, axis=1)))
    return math.atan2(float(d[best, 0]), float(c[best, 0]))


def _hull(flat: Array) -> Array:
    """Return the corners of the convex hull, (2, h), counter-clockwise (Andrew 1979)."""
    points = [(float(s), float(t)) for s, t in flat[:, np.lexsort(flat[::-1])].T]
    chains = [_chain(points), _chain(points[::-1])]
    return np.array([*chains[0][:-1], *chains[1][:-1]] or points[:1]).T


def _chain(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
    chain: list[tuple[float, float]] = []
    for s, t in points:
        while len(chain) > 1:
            (a, b), (c, d) = chain[-2:]
            if (c - a) * (t - b) > (d - b) * (s - a):
                break
            chain.pop()
        chain.append((s, t))
    return chain


class AreaLights(NamedTuple):
    """M rectangles; those of empty clusters have no `members` and are of no use."""

    center: Array  # (3, M) float64, m
    normal: Array  # (3, M) float64, unit vectors
    frame: Array  # (M, 3, 3) float64: rows right, down, forward of its map, unit vectors; forward is the normal
    side: Array  # (2, M) float64, m: of the bounding rectangle, along its own axes
    axes: Array  # (M, 2, 3) float64: unit vectors along the sides, in the plane of the normal
    offset: Array  # (2, M) float64, m: the rectangle's middle, along the axes from `center`
    delta: Array  # (M,) float64, m: Delta, the size of the light as a filter sees it; 0: a point
    radius: Array  # (M,) float64, m: from the centre to the farthest light of the cluster
    members: Array  # (M,) int64: lights of the cluster
    of: Array  # (N,) int32: C(i), the area light of each pixel light


@stage("cluster.area_lights", steps="refgi.cluster.rectangle.area_steps")
def area_lights(lights: "PixelLights", clusters: Clustering, settings: AreaLightSettings) -> AreaLights:
    """Return the rectangle that stands for each cluster.

    -> AreaLights: M rectangles around the projections of their lights. A cluster of no lights, of one, or of lights in
        one place has sides of 0; one of lights in a row along an axis has one side of 0.

    Raises
    ------
    InputError
        If lights and clusters do not fit.

    Notes
    -----
    The paper says neither along which axes the rectangle lies nor what single size Delta the filter takes from its
    sides s and t: here the fixed frame of the map and (s t)^(1/2), or as the settings say. A rectangle around n lights
    drawn evenly from a rectangle of area A has a mean area of ((n - 1) / (n + 1))^2 A; `unbiased_area` divides that
    out, (n + 1) / (n - 1) a side.
    """
    position = np.asarray(lights.position, np.float64)
    total = position.shape[1]
    expect(clusters.of.shape == (total,), "clusters.of", f"shape ({total},)", clusters.of.shape)
    return rectangles(position, clusters, settings)


def rectangles(position: Array, clusters: Clustering, settings: AreaLightSettings) -> AreaLights:
    """Return the rectangles around lights at places (3, N) float64, m."""
    frames, count = map_frames(clusters.normal), clusters.center.shape[1]
    used, away, starts = _grouped(position, clusters)
    axes = _axes(away, frames, clusters, settings.axes)
    side, offset, radius = np.zeros((2, count)), np.zeros((2, count)), np.zeros(count)
    if position.shape[1]:
        flat = np.einsum("nac,cn->an", np.repeat(axes[used], clusters.members[used], axis=0), away)
        low, high = np.minimum.reduceat(flat, starts, axis=1), np.maximum.reduceat(flat, starts, axis=1)
        side[:, used], offset[:, used] = high - low, (low + high) / 2
        radius[used] = np.sqrt(np.maximum.reduceat((away**2).sum(axis=0), starts))
    side[side < FLAT * radius] = 0.0
    n = clusters.members
    side *= np.where(n > 1, (n + 1) / np.maximum(n - 1, 1), 1.0) if settings.unbiased_area else 1.0
    delta = {"root": np.sqrt(side[0] * side[1]), "longer": side.max(axis=0),
             "shorter": side.min(axis=0)}[settings.extent]
    return AreaLights(clusters.center, clusters.normal, frames, side, axes, offset, delta, radius, clusters.members,
                      clusters.of)


def map_frames(normal: Array) -> Array:
    """Return the frames of paraboloid maps along unit normals (3, M): (M, 3, 3), rows right, down, forward."""
    forward = np.ascontiguousarray(normal.T)
    up = np.where(np.abs(forward[:, 1:2]) < UPRIGHT, (0.0, 1.0, 0.0), (0.0, 0.0, -1.0))
    right = np.cross(forward, up)
    right /= np.sqrt((right**2).sum(axis=1, keepdims=True))
    return np.stack([right, np.cross(forward, right), forward], axis=1)


def _grouped(position: Array, clusters: Clustering) -> tuple[Array, Array, Array]:
    """Return the clusters in use, the lights of each in turn from its centre, and where each begins."""
    order = np.argsort(clusters.of, kind="stable")
    used = np.flatnonzero(clusters.members)
    starts = np.cumsum(clusters.members[used]) - clusters.members[used]
    return used, position[:, order] - clusters.center[:, clusters.of[order]], starts


def _axes(away: Array, frames: Array, clusters: Clustering, axes: Axes) -> Array:
    """Return the axes of every rectangle, (M, 2, 3)."""
    turned = frames[:, :2].copy()
    if axes == "fixed":
        return turned
    first = 0
    for m, members in enumerate(clusters.members):
        turn = turn_of(frames[m, :2] @ away[:, first : first + members], axes)
        c, s = math.cos(turn), math.sin(turn)
        turned[m] = np.array([[c, s], [-s, c]]) @ turned[m]
        first += members
    return turned


@stage("cluster.areas", kept=False)
def areas(
    position: Array, center: Array, normal: Array, of: Array, axes: Axes, extent: Size, unbiased: bool
) -> tuple[Array, Array, Array, Array, Array, Array, Array]:
    """Bound each cluster's lights by a rectangle in its plane (VAL Sec. 6, E-VAL-10).

    position (3, light): Places of the lights, m.
    center (3, cluster): Centres, m.
    normal (3, cluster): Their unit normals.
    of (light,) int: C(i): cluster of each light.
    axes: Axes of the rectangle: the map's, of the lights' spread, of least area.
    extent: Delta: root of the area, longer or shorter side.
    unbiased: Whether sides grow by (n + 1) / (n - 1), n lights.
    -> frame (cluster, right down forward, 3): Axes of the map, unit vectors.
    -> axes (cluster, side, 3): Axes of the rectangle, unit vectors, the first at most a quarter turn from right.
    -> side (side, cluster): How long it is along its axes, m.
    -> offset (side, cluster): Its middle from the centre, along its axes, m.
    -> delta (cluster,): Delta, its size, m; 0: a point.
    -> radius (cluster,): From the centre to its farthest light, m.
    -> members (cluster,) int: How many lights it has.
    """
    x, c, n = (np.asarray(one, np.float64) for one in (position, center, normal))
    clusters = Clustering(c, n, np.bincount(of, minlength=c.shape[1]), of, 0, np.zeros(1))
    made = rectangles(x, clusters, AreaLightSettings(axes, extent, unbiased))
    return made.frame, made.axes, made.side, made.offset, made.delta, made.radius, made.members


def area_steps(lights: PixelLights, clusters: Clustering, settings: AreaLightSettings) -> dict[str, Array]:
    """Return the rectangles of clusters, made by a step."""
    made = areas(lights.position, clusters.center, clusters.normal, clusters.of, settings.axes, settings.extent,
                 settings.unbiased_area)
    return dict(zip(("frame", "axes", "side", "offset", "delta", "radius", "members"), made, strict=True))

"""Clusters of lights by k-means over position and normal (VAL Sec. 5): the mapping C(i) from light to area light.

- position (3, light): Places of the lights, m.
- normal (3, light): Their unit normals.
- axis (3, cluster): Their unit normals.
"""

import math
from typing import NamedTuple

import numpy as np

from refgi.cluster.rounds import LINES, TILE, Metric, Rounds, iterate, move_to_means, sort_lights
from refgi.cluster.settings import Clusters, Distance
from refgi.errors import expect
from refgi.jit import thread_count, threads
from refgi.rsm.buffers.extent import Extent
from refgi.skips import left_out
from refgi.stages import skip, stage
from refgi.types import Array

SMALL = 1 << 20  # pairs of lights and area lights up to which waking other threads costs more than it brings
SLACK = 1e-12  # share of the largest distance: thousands of roundings


class Clustering(NamedTuple):
    """M clusters of N lights; those without members stand where they last had some."""

    center: Array  # (3, M) float64, m
    normal: Array  # (3, M) float64, unit vectors
    members: Array  # (M,) int64
    of: Array  # (N,) int32: C(i)
    rounds: int  # of means
    objective: Array  # (rounds + 1,) float64: sum of all distances, at the start and after each round


@stage("cluster.kmeans", steps="refgi.cluster.kmeans.kmeans_steps")
def clusters_of(
    position: Array, normal: Array, settings: Clusters, illuminated: "Extent"
) -> Clustering:
    """Group lights by k-means as settings say (VAL Sec. 5.1).

    position (3, light): Lights, m.
    normal (3, light): Their normals.
    settings: `count` is M; no more than N are made.
    illuminated: Box of what reflects direct light, in shares of whose diagonal distances are.
    -> Clustering: As of `cluster`.
    """
    return cluster(position, normal, settings.count, distance=settings.distance,
                   weights=(settings.position_weight, settings.normal_weight), diagonal=illuminated.diagonal,
                   rounds=settings.rounds)


def cluster(
    position: Array, normal: Array, count: int, *, distance: Distance = "normalised",
    weights: tuple[float, float] = (0.7, 0.3), diagonal: float, rounds: int = 50, start: Clustering | None = None,
) -> Clustering:
    """Group lights by k-means with ``d = w_x |x - c| + w_a angle(n, n_c)``.

    Parameters
    ----------
    position : (3, N) ndarray
        Lights, m.
    normal : (3, N) ndarray
        Their normals, any length but 0.
    count : int
        M; no more than N are made.
    distance : {"normalised", "raw", "squared"}
        The distance in shares of `diagonal` and of pi; in metres and radians, as printed; or
        ``w_x |x - c|^2 / diagonal^2 + w_a |n - n_c|^2``.
    weights : tuple of 2 floats
        w_x and w_a.
    diagonal : float
        Of the scene, m; not used when raw.
    rounds : int
        Most rounds; fewer when no light changes its cluster any more.
    start : Clustering, optional
        Where the clusters begin, M of them; light floor(k N / M) for cluster k where absent.

    Returns
    -------
    Clustering
        C(i) is the cluster at least distance, the lowest on ties.

    Raises
    ------
    InputError
        If shapes do not fit or numbers are not finite.

    Notes
    -----
    The paper weighs metres against radians, which depends on the unit of length; "normalised" does not. Means minimise
    the "squared" distances alone: there the objective never rises, with the others it may. The number of rounds is not
    published. A cluster without lights keeps its values, and one whose normals cancel keeps its normal. A `start` from
    the frame before loses clusters for good (Sec. 5.2). With M = N each light is a cluster, coincident ones too.

    Examples
    --------
    >>> walls = np.array([[0.0, 0.1, 1.0, 1.1], [0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0]])
    >>> up = np.repeat([[0.0], [1.0], [0.0]], 4, axis=1)
    >>> cluster(walls, up, 2, diagonal=1.0).of.tolist()
    [0, 0, 1, 1]
    """
    lights = _lights(position, normal)
    total = lights.shape[1]
    expect(count >= 1, "count", "1 or more clusters", count)
    expect(rounds >= 1, "rounds", "1 or more", rounds)
    expect(0 < diagonal < math.inf or total == 0, "diagonal", "a length above 0 m", diagonal)
    if start is not None:
        expect(start.center.shape[1] == count, "start", f"{count} clusters", start.center.shape[1])
        areas = np.vstack([start.center, start.normal]).astype(np.float64, order="C")
    else:
        if count > total:
            skip("cluster.kmeans", f"{count - total} of {count} area lights: there are {total} pixel lights")
        count = min(count, total)
        areas = np.ascontiguousarray(lights[:, first_lights(total, count)])
        if count == total:  # each its own
            return Clustering(areas[:3].copy(), areas[3:].copy(), np.ones(count, np.int64),
                              np.arange(count, dtype=np.int32), 0, np.zeros(1))
    with threads(1 if total * areas.shape[1] <= SMALL else None):
        state = _state(lights, areas, thread_count())
        objective = np.zeros(rounds + 1)
        done = iterate(state, _metric(distance, weights, diagonal, _span(state)), rounds, objective)
    return Clustering(areas[:3].copy(), areas[3:].copy(), state.members, state.of, done, objective[: done + 1])


def first_lights(total: int, count: int) -> Array:
    """Return the light that each of `count` clusters of `total` lights begins at: floor(k N / M)."""
    return np.arange(count) * total // max(count, 1)


def _lights(position: Array, normal: Array) -> Array:
    """Return positions and unit normals, (6, N)."""
    lights = np.ascontiguousarray(np.vstack([_finite(position, "position"), _finite(normal, "normal")]))
    length = np.sqrt((lights[3:] ** 2).sum(axis=0))
    lights[3:] /= np.where(length > 0, length, 1)
    return lights


def _finite(values: Array, name: str) -> Array:
    array = np.asarray(values, np.float64)
    expect(array.ndim == 2 and len(array) == 3, name, "shape (3, N)", array.shape)
    expect(bool(np.isfinite(array).all()), name, "finite numbers", "NaN or infinity")
    return array


def _state(lights: Array, areas: Array, workers: int) -> Rounds:
    total, count = lights.shape[1], areas.shape[1]
    most = count + total // TILE
    return Rounds(
        lights, areas, np.zeros(total, np.int32), np.zeros(count, np.int64), np.zeros(total), np.empty(total, np.int64),
        np.empty((3, most), np.int64), np.empty(most, np.int64), np.empty((workers, LINES, TILE)),
        np.empty((workers, count)), np.empty((workers, 2, TILE), np.int64))


def _span(state: Rounds) -> float:
    """Return a length, m, that no two of all lights and area lights are farther apart than."""
    return float(np.ptp(np.hstack([state.lights, state.areas])[:3], axis=1).sum())


def _metric(distance: Distance, weights: tuple[float, float], diagonal: float, span: float) -> Metric:
    """Return the distance with its units taken in; no two lights are farther apart than `span`, m."""
    # Sec. 5.1: d = w_x dx + w_a da
    position, angle = float(weights[0]), float(weights[1])
    if distance == "normalised":
        position, angle = position / diagonal, angle / math.pi
    elif distance == "squared":
        position, span = position / diagonal**2, span * span
    slack = SLACK * float(position * span + angle * math.pi)
    if not left_out("cluster.distances", lambda: (1, 1)):
        slack = math.inf  # no distance is so large that it rules an area light out
    return Metric(position, angle, distance == "squared", slack)


def mean_angle(normal: Array, clusters: Clustering) -> float:
    """Return the mean angle between a light's normal, (3, N), and its cluster's, radians; 0 without lights."""
    if normal.shape[1] == 0:
        return 0.0
    ours, own = np.asarray(normal, np.float64), clusters.normal[:, clusters.of]
    across, along = np.linalg.norm(np.cross(ours, own, axis=0), axis=0), (ours * own).sum(axis=0)
    return float(np.arctan2(across, along).mean())


def in_use(clusters: Clustering) -> int:
    """Return how many clusters have lights, 0 to M."""
    return int(np.count_nonzero(clusters.members))


ROUNDS = 2  # of k-means that are shown one by one


@stage("cluster.kmeans_start", kept=False)
def kmeans_start(position: Array, normal: Array, count: int) -> tuple[Array, Array]:
    """Begin cluster k at light floor(k N / M) (VAL Sec. 5.1; docs/methods/val).

    count: Clusters, M.
    -> center (3, cluster): Centres at which clusters begin, m.
    -> axis (3, cluster): Their unit normals.
    """
    first = first_lights(position.shape[1], count)
    return position[:, first], normal[:, first]


@stage("cluster.kmeans_assign", kept=False, each="round")
def kmeans_assign(
    position: Array, normal: Array, illuminated: Extent, center: Array, axis: Array, distance: Distance, w_x: float,
    w_a: float,
) -> tuple[Array, Array]:
    """Find each light's nearest cluster, the lowest index of equally near ones (VAL Sec. 5.1, E-VAL-11).

    illuminated: Box of what reflects direct light, in shares of whose diagonal distances are.
    center (3, cluster): Centres, m.
    distance: d = w_x dx / diagonal + w_a angle / pi; in metres and radians; by squares.
    w_x, w_a: Weights of distance and of angle.
    -> of (light,) int: Nearest cluster.
    -> distance (light,): Its distance d.
    """
    state = _state(_lights(position, normal), np.vstack([center, axis]).astype(np.float64, order="C"), 1)
    iterate(state, _metric(distance, (w_x, w_a), _diagonal(illuminated), _span(state)), 0, np.zeros(1))
    return state.of, state.own


@stage("cluster.kmeans_means", kept=False, each="round")
def kmeans_means(position: Array, normal: Array, of: Array, center: Array, axis: Array) -> tuple[Array, Array]:
    """Move clusters to the means of their lights; without lights a cluster stays (VAL Sec. 5.1; docs/methods/val).

    of (light,) int: C(i): cluster of each light.
    center (3, cluster): Centres before, m.
    -> center (3, cluster): Means of the lights' places, m.
    -> axis (3, cluster): Mean directions of their normals, unit vectors.
    """
    state = _state(_lights(position, normal), np.vstack([center, axis]).astype(np.float64, order="C"), 1)
    state.of[:] = of
    sort_lights(state)
    move_to_means(state)
    return state.areas[:3], state.areas[3:]


@stage("cluster.kmeans_rounds", kept=False)
def kmeans_rounds(
    position: Array, normal: Array, illuminated: Extent, center: Array, axis: Array, distance: Distance, w_x: float,
    w_a: float, rounds: int,
) -> tuple[Array, Array, Array]:
    """Run further rounds until no light changes its cluster (VAL Sec. 5.1; docs/methods/val).

    illuminated: Box of what reflects direct light.
    center (3, cluster): Centres before, m.
    distance: As in the rounds before.
    w_x, w_a: Weights of distance and of angle.
    rounds: Most of them.
    -> center (3, cluster): Mean of each cluster's lights, m.
    -> normal (3, cluster): Mean direction of their normals, unit vectors.
    -> of (light,) int: C(i): cluster of each light.
    """
    count, total = center.shape[1], position.shape[1]
    start = Clustering(np.asarray(center, np.float64), np.asarray(axis, np.float64), np.zeros(count, np.int64),
                       np.zeros(total, np.int32), 0, np.zeros(1))
    made = cluster(position, normal, count, distance=distance, weights=(w_x, w_a),
                          diagonal=_diagonal(illuminated), rounds=rounds, start=start)
    return made.center, made.normal, made.of


@stage("cluster.kmeans_each", kept=False)
def kmeans_each(position: Array, normal: Array) -> tuple[Array, Array, Array]:
    """Let each light be a cluster, coincident ones too, where as many are asked for as there are (VAL Sec. 5.1).

    -> center (3, cluster): Place of each cluster's light, m.
    -> normal (3, cluster): Its unit normal.
    -> of (light,) int: C(i): cluster of each light.
    """
    made = cluster(position, normal, position.shape[1], diagonal=1.0)
    return made.center, made.normal, made.of


def kmeans_steps(
    position: Array, normal: Array, settings: Clusters, illuminated: Extent
) -> dict[str, Array]:
    """Return clusters, made by steps."""
    if settings.count >= position.shape[1]:
        center, axis, of = kmeans_each(position, normal)
    else:
        metric = settings.distance, settings.position_weight, settings.normal_weight
        center, axis = kmeans_start(position, normal, settings.count)
        shown = min(ROUNDS, settings.rounds - 1)
        for _ in range(shown):
            of, _ = kmeans_assign(position, normal, illuminated, center, axis, *metric)
            center, axis = kmeans_means(position, normal, of, center, axis)
        center, axis, of = kmeans_rounds(position, normal, illuminated, center, axis, *metric,
                                         settings.rounds - shown)
    return {"center": center, "normal": axis, "of": of}


def _diagonal(box: Extent) -> float:
    return Extent(np.asarray(box.low, np.float64), np.asarray(box.high, np.float64)).diagonal

"""Area lights one step after the other: the first rounds of k-means, the rest of them, rectangles (VAL Sec. 5.1, 6).

- position (3, light): Places of the lights, m.
- normal (3, light): Their unit normals.
- axis (3, cluster): Their unit normals.
"""


import numpy as np

from refgi.cluster.clustering.kmeans import Clustering, assigned, cluster, first_lights, moved
from refgi.cluster.settings import Distance, KMeansSettings
from refgi.rsm.buffers.extent import Extent
from refgi.stages import stage
from refgi.types import Array

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
    return assigned(position, normal, center, axis, distance, (w_x, w_a), _diagonal(illuminated))


@stage("cluster.kmeans_means", kept=False, each="round")
def kmeans_means(position: Array, normal: Array, of: Array, center: Array, axis: Array) -> tuple[Array, Array]:
    """Move clusters to the means of their lights; without lights a cluster stays (VAL Sec. 5.1; docs/methods/val).

    of (light,) int: C(i): cluster of each light.
    center (3, cluster): Centres before, m.
    -> center (3, cluster): Means of the lights' places, m.
    -> axis (3, cluster): Mean directions of their normals, unit vectors.
    """
    return moved(position, normal, of, center, axis)


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
    position: Array, normal: Array, count: int, settings: KMeansSettings, illuminated: Extent
) -> dict[str, Array]:
    """Return clusters, made by steps."""
    if count >= position.shape[1]:
        center, axis, of = kmeans_each(position, normal)
    else:
        metric = settings.distance, settings.position_weight, settings.normal_weight
        center, axis = kmeans_start(position, normal, count)
        shown = min(ROUNDS, settings.rounds - 1)
        for _ in range(shown):
            of, _ = kmeans_assign(position, normal, illuminated, center, axis, *metric)
            center, axis = kmeans_means(position, normal, of, center, axis)
        center, axis, of = kmeans_rounds(position, normal, illuminated, center, axis, *metric,
                                         settings.rounds - shown)
    return {"center": center, "normal": axis, "of": of}


def _diagonal(box: Extent) -> float:
    return Extent(np.asarray(box.low, np.float64), np.asarray(box.high, np.float64)).diagonal

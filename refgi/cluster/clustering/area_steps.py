"""Steps."""

import numpy as np

from refgi.cluster.clustering.kmeans import Clustering
from refgi.cluster.clustering.rectangle import rectangles
from refgi.cluster.settings import AreaLightSettings, Axes
from refgi.cluster.settings import Extent as Size
from refgi.pairs.pixel_lights import PixelLights
from refgi.stages import stage
from refgi.types import Array


@stage("cluster.areas", kept=False)
def areas(
    position: Array, center: Array, normal: Array, of: Array, axes: Axes, extent: Size, unbiased: bool,
    footprint: Array | None = None,
) -> tuple[Array, Array, Array, Array, Array, Array, Array]:
    """Bound each cluster's lights by a rectangle in its plane (VAL Sec. 6, E-VAL-10).

    center (3, cluster): Centres, m.
    normal (3, cluster): Their unit normals.
    of (light,) int: C(i): cluster of each light.
    axes: Axes of the rectangle: the map's, of the lights' spread, of least area.
    extent: Delta: root of the area, longer or shorter side.
    unbiased: Whether sides grow by (n + 1) / (n - 1), n lights.
    footprint (light,): Surface each light stands for, m^2, where a cluster of one light is a square of that area.
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
    made = rectangles(x, clusters, AreaLightSettings(
        axes, extent, unbiased, single_light="point" if footprint is None else "footprint"), footprint)
    return made.frame, made.axes, made.side, made.offset, made.delta, made.radius, made.members


def area_steps(
    lights: PixelLights, clusters: Clustering, settings: AreaLightSettings, footprint: Array | None = None
) -> dict[str, Array]:
    """Return the rectangles of clusters, made by a step."""
    made = areas(lights.position, clusters.center, clusters.normal, clusters.of, settings.axes, settings.extent,
                 settings.unbiased_area, footprint if settings.single_light == "footprint" else None)
    return dict(zip(("frame", "axes", "side", "offset", "delta", "radius", "members"), made, strict=True))

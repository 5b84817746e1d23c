"""Stage of area lights: the bounding rectangle of each cluster (VAL Sec. 6)."""

from typing import Any

import numpy as np

from refgi.cluster.clustering.kmeans import Clustering
from refgi.cluster.clustering.rectangle import AreaLights, area_lights
from refgi.cluster.settings import AreaLightSettings
from refgi.literal import val_areas as literal
from refgi.pairs.pixel_lights import PixelLights
from refgi.vectors.forms import area_lists
from refgi.vectors.recipe import Recipe
from refgi.vectors.rows import Form
from refgi.vectors.spec import Arrays, Spec
from refgi.vectors.stages.buffers import VECTOR
from refgi.vectors.stages.val_clusters import LIGHTS

AREA = ("frame", "axes", "side", "offset", "delta", "radius", "members")


def add_areas(recipe: Recipe, settings: AreaLightSettings) -> None:
    """Add the rectangle of each cluster."""
    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
        made = _areas(arrays, settings)
        return {f"areas.{key}": getattr(made, key) for key in AREA}

    reads = {"position": LIGHTS[0], "center": "clusters.center", "normal": "clusters.normal", "of": "clusters.of"}
    form = Form(literal.areas, reads, tuple(f"areas.{key}" for key in AREA),
                {"axes": settings.axes, "extent": settings.extent, "unbiased": settings.unbiased_area})
    recipe.facts["areas"] = {"axes": settings.axes, "extent": settings.extent, "up": [0, 1, 0],
                             "up where |y| of the normal >= 0.999": [0, 0, -1], "flat below, of the radius": 1e-5}
    recipe.add("areas", "bounding rectangle of each cluster's lights in its plane", run,
               (LIGHTS[0], "clusters.center", "clusters.normal", "clusters.of"), {
                   "areas.frame": Spec("cluster, (right, down, forward), xyz", VECTOR, "axes of the map", "world"),
                   "areas.axes": Spec("cluster, side, xyz", VECTOR, "axes of the rectangle, the first at most a "
                                      "quarter turn from right", "world"),
                   "areas.side": Spec("side, cluster", "m", "how long it is along its axes"),
                   "areas.offset": Spec("side, cluster", "m", "its middle from the centre, along its axes"),
                   "areas.delta": Spec("cluster", "m", "Delta, its size; 0: a point", paper="VAL Sec. 6, E-VAL-10"),
                   "areas.radius": Spec("cluster", "m", "from the centre to its farthest light"),
                   "areas.members": Spec("cluster", "1", "how many lights it has", tier="T0")},
               paper="VAL Sec. 6, E-VAL-10", exact=(LIGHTS[0], "clusters.center"),
               bugs=form.bugs("areas", *area_lists(settings)), variants=(form,))


def _areas(arrays: Arrays, settings: AreaLightSettings) -> AreaLights:
    position, of = np.asarray(arrays[LIGHTS[0]], np.float64), np.asarray(arrays["clusters.of"])
    center, normal = (np.asarray(arrays[f"clusters.{key}"], np.float64) for key in ("center", "normal"))
    clusters = Clustering(center, normal, np.bincount(of, minlength=center.shape[1]), of, 0, np.zeros(1))
    lights = PixelLights(position, position, position, None, None, None, position.shape[1])
    return area_lights(lights, clusters, settings)

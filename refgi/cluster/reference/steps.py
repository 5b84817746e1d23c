"""Visibility of area lights by more than a lookup around the pixel: back projection of maps (docs/methods/val)."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.cluster.reference.back_projection import back_projection_visibility
from refgi.cluster.visibility.steps import Places, maps_of, planes
from refgi.stages import stage

Array = npt.NDArray[Any]


@stage("cluster.back_projection", kept=False)
def back_projection(
    places: Places, facing: Array, depth: Array, axes: Array, side: Array, offset: Array, center: Array, normal: Array,
    scene_far: Array,
) -> Array:
    """Project texels back onto the rectangle: V is the share of cells that none hides (docs/methods/val_visibility).

    depth (area light, row, column): Distances to the nearest blocker, m.
    axes (area light, side, 3): Axes of the rectangles, unit vectors.
    side (side, area light): How long they are, m.
    offset (side, area light): Their middles from the centres, m.
    center (3, area light): Centres of clusters, m.
    normal (3, area light): Their unit normals.
    scene_far (area light,): To the farthest place there is, m.
    -> (area light, h, w): V of the cells above the pixel's plane, 0 hidden to 1 seen; 1 behind the light's plane, on
        empty maps, without surface.
    """
    areas: Any = SimpleNamespace(**{name: np.asarray(one, np.float64) for name, one in (
        ("axes", axes), ("side", side), ("offset", offset), ("center", center), ("normal", normal))})
    maps = maps_of(places, np.asarray(depth, np.float64))._replace(scene_far=np.asarray(scene_far, np.float64))
    visible = back_projection_visibility(areas, maps)
    points, normals = (np.ascontiguousarray(one.reshape(3, -1), np.float64) for one in (places.position, facing))
    covered, made = places.covered.reshape(-1), planes(places, fill=1)
    for k in range(len(made)):
        made[k].reshape(-1)[covered] = visible(k, points[:, covered], normals[:, covered])
    return made

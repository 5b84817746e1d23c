"""Stages of visibility beyond one map read around a pixel: a second map behind the light, back projection (VAL 4.2)."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from refgi.cluster.maps.shadow_maps import BACKWARD
from refgi.cluster.reference.back_projection import CELLS, back_projection_visibility
from refgi.literal import val_back_projection as literal
from refgi.vectors.recipe import Recipe
from refgi.vectors.rows import Form
from refgi.vectors.spec import Arrays, Run
from refgi.vectors.stages.facing import FACING
from refgi.vectors.stages.val_maps import shadow_maps_of
from refgi.vectors.stages.val_search import LIGHT, PIXELS, share_spec

BEHIND = "maps.behind"
AREAS = ("areas.axes", "areas.side", "areas.offset", "clusters.center", "clusters.normal", "maps.scene_far")
PAPER = "Guennebaud et al. 2006; docs/methods/val_visibility"


def turned(arrays: Arrays) -> Arrays:
    """Return arrays whose maps are those of the hemispheres behind: right and forward turned round."""
    behind = np.asarray(arrays[BEHIND])
    return {**arrays, "maps.depth": behind, "maps.near": behind.min(axis=(1, 2)),
            "areas.frame": np.einsum("ij,kjc->kic", BACKWARD, arrays["areas.frame"]).astype(behind.dtype)}


def of_both(run: Run, name: str) -> Run:
    """Return V of maps ahead and behind by a stage that reads those ahead."""
    def both(arrays: Arrays, real: Any) -> Arrays:
        return {name: np.minimum(run(arrays, real)[name], run(turned(arrays), real)[name])}

    return both


def add_back_projection(recipe: Recipe) -> None:
    """Add V by the texels of the map, projected back onto the rectangle."""
    form = Form(literal.back_projection, {
        "position": PIXELS[0], "triangle_id": PIXELS[1], "facing": FACING, "depth": "maps.depth",
        "map_center": "maps.center", "frame": "areas.frame", "axes": "areas.axes", "side": "areas.side",
        "offset": "areas.offset", "center": "clusters.center", "normal": "clusters.normal",
        "scene_far": "maps.scene_far"}, ("visibility.share",))

    def run(arrays: Arrays, real: Any) -> Arrays:
        maps = shadow_maps_of(arrays, np.float64)
        areas: Any = SimpleNamespace(**{key: np.asarray(arrays[f"areas.{key}"], np.float64) for key in (
            "axes", "side", "offset")}, **{key: np.asarray(arrays[f"clusters.{key}"], np.float64) for key in (
                "center", "normal")})
        visible = back_projection_visibility(areas, maps)
        points, facing = (np.ascontiguousarray(arrays[one], np.float64).reshape(3, -1) for one in (PIXELS[0], FACING))
        covered = np.asarray(arrays[PIXELS[1]]).reshape(-1) >= 0
        made = np.ones((len(maps.near), *np.asarray(arrays[PIXELS[1]]).shape), real)
        for k in range(len(made)):
            made[k].reshape(-1)[covered] = visible(k, points[:, covered], facing[:, covered])
        return {"visibility.share": made}

    recipe.facts["visibility.test"] = {"cells along a side of the rectangle": CELLS, "slack, of the distance": 1e-3,
                                       "least side, of the farthest place": 1e-9}
    recipe.add("visibility", f"V: share of {CELLS} x {CELLS} cells of the rectangle, those above the pixel's plane, "
               "whose centres no texel hides; a texel is a patch at its depth, before the pixel's plane", run,
               (*PIXELS, FACING, "maps.depth", *LIGHT, *AREAS), {"visibility.share": share_spec()}, paper=PAPER,
               exact=("maps.center",), variants=(form,), bugs=form.bugs("back_projection"))

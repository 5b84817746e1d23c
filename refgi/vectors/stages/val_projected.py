"""Stages of visibility beyond one map read around a pixel: a second map behind the light, back projection (VAL 4.2)."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from refgi.cluster.maps.shadow_maps import BACKWARD
from refgi.cluster.reference.back_projection import CELLS, back_projection_visibility
from refgi.vectors.recipe import Recipe, reading, writing
from refgi.vectors.spec import Array, Arrays, Bug, Run
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


def second_map_bugs(run: Run, name: str) -> tuple[Bug, ...]:
    """Return likely bugs of the second map."""
    def joined(by: Any, second: Any = turned) -> Run:
        return lambda arrays, real: {name: by(run(arrays, real)[name], run(second(arrays), real)[name])}

    def framed(signs: tuple[int, int, int]) -> Any:
        return lambda arrays: {**turned(arrays), "areas.frame": np.asarray(arrays["areas.frame"]) * np.array(signs)[
            :, None]}

    paper = "docs/methods/val_visibility: right and forward turned round"
    return (
        Bug("pixels behind the light see it whole: the second map is not read", run, paper),
        Bug("the first map alone for pixels behind: the second one in its place ahead", joined(
            lambda ahead, behind: behind), paper),  # noqa: ARG005
        Bug("the larger of both: nothing is hidden", joined(np.maximum), paper),
        Bug("the map behind is looked up by the axes ahead", joined(np.minimum, framed((1, 1, 1))), paper),
        Bug("right of the map behind is not turned round", joined(np.minimum, framed((1, 1, -1))), paper),
        Bug("down of the map behind is turned round in place of right", joined(np.minimum, framed((1, -1, -1))), paper))


def add_back_projection(recipe: Recipe) -> None:
    """Add V by the texels of the map, projected back onto the rectangle."""
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

    depth, side = "maps__depth", "areas__side"
    recipe.facts["visibility.test"] = {"cells along a side of the rectangle": CELLS, "slack, of the distance": 1e-3,
                                       "least side, of the farthest place": 1e-9}
    recipe.add("visibility", f"V: share of {CELLS} x {CELLS} cells of the rectangle, those above the pixel's plane, "
               "whose centres no texel hides; a texel is a patch at its depth, before the pixel's plane", run,
               (*PIXELS, FACING, "maps.depth", *LIGHT, *AREAS), {"visibility.share": share_spec()}, paper=PAPER,
               exact=("maps.center",), bugs=(
                   Bug("rows of the map run upwards", reading(run, **{depth: lambda a: a[:, ::-1]}), "rows downwards"),
                   Bug("columns of the map run leftwards", reading(run, **{depth: lambda a: a[:, :, ::-1]}), ""),
                   Bug("rows and columns of the map are exchanged", reading(run, **{depth: lambda a: a.swapaxes(
                       1, 2)}), ""),
                   Bug("a texel too far left", reading(run, **{depth: lambda a: np.roll(a, 1, axis=2)}), ""),
                   Bug("pixels' normals point inwards", reading(run, gbuffer__facing=lambda a: -a), "pixel's plane"),
                   Bug("the rectangle lies around the centre: its offset is left out",
                       reading(run, areas__offset=np.zeros_like), "VAL Sec. 6"),
                   Bug("the rectangle lies on the other side of the centre: the offset's sign",
                       reading(run, areas__offset=lambda a: -a), "VAL Sec. 6"),
                   Bug("sides are twice as long: half sides are taken for sides", reading(
                       run, **{side: lambda a: 2 * a}), "sides"),
                   Bug("sides are half as long: sides are taken for half sides", reading(
                       run, **{side: lambda a: a / 2}), "sides"),
                   Bug("both sides are exchanged", reading(run, **{side: lambda a: a[::-1]}), "along the axes"),
                   Bug("the rectangle's axes are exchanged", reading(run, areas__axes=lambda a: a[:, ::-1]), ""),
                   Bug("the rectangle is a point: a hard shadow", reading(run, **{side: np.zeros_like}), "a rectangle"),
                   Bug("V is the hidden share", writing(run, visibility__share=lambda a: 1 - a), "V = 1 - hidden"),
                   Bug("V of one test: hidden or not", writing(run, visibility__share=np.floor), "a share"),
                   Bug("the nearest texel's depth for all of a map", reading(run, **{depth: _nearest}), "own depth")))


def _nearest(depth: Array) -> Array:
    return np.where(np.isfinite(depth), depth.min(axis=(1, 2), keepdims=True), np.inf)

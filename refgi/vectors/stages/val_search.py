"""Stages of the visibility of area lights: the search region of each pixel (VAL Sec. 4.2), and what later stages share.

Arrays hold every area light and every pixel, lit or not; regions are discs of a map's units, [-1, 1].
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from refgi.cluster.settings import ValSettings
from refgi.cluster.visibility.search_region import (
    DEPTH,
    RADIUS,
    SCRATCH_ROWS,
    D,
    S,
    Scratch,
    filter_sizing,
    find_search_regions,
    light_constants,
)
from refgi.cluster.visibility.series import Series
from refgi.literal import val_visibility as literal
from refgi.vectors.recipe import Recipe
from refgi.vectors.rows import Form
from refgi.vectors.spec import Array, Arrays, Spec
from refgi.vectors.stages.val_maps import VIEW, shadow_maps_of

PIXELS = ("gbuffer.position", "gbuffer.triangle_id")
PLACE = "area light, row, column"
REGION = Spec("area light, (s, t, radius), row, column", "1", "disc of the map, [-1, 1] units; 0 where none")
LIGHT = (*VIEW, "areas.delta", "maps.near")
PLACES = {"position": "gbuffer.position", "center": "maps.center", "frame": "areas.frame"}  # literal: pixels and maps
SIZES = {"delta": "areas.delta", "near": "maps.near"}


class Lane(NamedTuple):
    """One area light and all pixels, as kernels take them."""

    k: int
    points: Array  # (3, n) m
    active: Array  # (n,) bool
    scratch: Scratch
    visible: Array  # (n,)
    constants: Array


def lanes(arrays: Arrays, real: Any, channels: int = 0, chain: Series | None = None) -> Iterator[Lane]:
    """Return the area lights that have an extent and something on their map."""
    maps, delta = shadow_maps_of(arrays, real), np.asarray(arrays["areas.delta"])
    points = np.ascontiguousarray(arrays["gbuffer.position"], real).reshape(3, -1)
    covered = np.asarray(arrays["gbuffer.triangle_id"]).reshape(-1) >= 0
    count = points.shape[1]
    for k in np.flatnonzero((maps.map_of >= 0) & (delta > 0)):
        scratch = Scratch(np.zeros(count, np.bool_), np.zeros((SCRATCH_ROWS, count), real),
                          np.zeros((channels, count), real))
        yield Lane(int(k), points, covered.copy(), scratch, np.ones(count, real),
                   light_constants(maps, int(k), float(delta[k]), chain))


def searched(lane: Lane, settings: ValSettings) -> None:
    """Fill rows and `pending` of the search."""
    find_search_regions(lane.constants, filter_sizing(settings), lane.points, len(lane.active), lane.active,
                        lane.scratch.pending, lane.visible, lane.scratch.rows)


class Planes:
    """Output arrays (area light, ..., row, column), filled light by light; nothing where a flag is not set."""

    def __init__(self, arrays: Arrays, real: Any) -> None:
        self.lights, self.shape, self.real = len(arrays["areas.delta"]), arrays["gbuffer.triangle_id"].shape, real
        self.made: dict[str, Array] = {}

    def new(self, name: str, *axes: int, fill: Any = 0, kind: Any = None) -> None:
        """Add an array with axes between those of area lights and of pixels."""
        self.made[name] = np.full((self.lights, *axes, *self.shape), fill, self.real if kind is None else kind)

    def put(self, name: str, k: int, values: Array, flags: Array) -> None:
        """Set an area light's values, (..., n), where flags (n,) are set."""
        here = self.made[name][k].reshape(*values.shape[:-1], -1)
        here[..., flags] = values[..., flags]


def sizing(settings: ValSettings) -> dict[str, bool]:
    """Return by which printed forms the literal penumbra is sized."""
    return {"alpha": "val_alpha" in settings.as_published, "squares": "val_alpha_over_pi" in settings.as_published,
            "foreshortened": settings.area.foreshortened}


def by_default(settings: ValSettings) -> bool:
    """Tell whether discs are found as errata say: by no printed form, nor by the light's foreshortened size."""
    return not settings.as_published and not settings.area.foreshortened


def share_spec() -> Spec:
    """Return what V is."""
    return Spec(PLACE, "1", "V, 0 hidden to 1 seen; 1 behind the light's plane, on empty maps, without surface")


def penumbra_specs() -> dict[str, Spec]:
    """Return what a search for blockers finds."""
    return {"penumbra.shaded": Spec(PLACE, "1", "whether there are blockers; V is 1 elsewhere", tier="T0"),
            "penumbra.z_avg": Spec(PLACE, "m", "mean distance of the blockers; 0 where not shaded"),
            "penumbra.region": REGION}


def penumbra_planes(arrays: Arrays, real: Any) -> Planes:
    """Return arrays for what a search for blockers finds."""
    out = Planes(arrays, real)
    out.new("penumbra.shaded", kind=np.bool_)
    out.new("penumbra.z_avg")
    out.new("penumbra.region", 3)
    return out


def put_penumbra(out: Planes, lane: Lane) -> None:
    """Set what the search of an area light found."""
    flags, rows = lane.scratch.pending, lane.scratch.rows
    out.put("penumbra.shaded", lane.k, flags, flags)
    out.put("penumbra.z_avg", lane.k, rows[DEPTH], flags)
    out.put("penumbra.region", lane.k, rows[S : RADIUS + 1], flags)


def add_search(recipe: Recipe, settings: ValSettings) -> None:
    """Add the disc in which each pixel searches for blockers."""
    printed = {"solid_angle": "val_search_solid_angle" in settings.as_published,
               "squares": "val_alpha_over_pi" in settings.as_published, "foreshortened": settings.area.foreshortened}
    form = Form(literal.search, {**PLACES, **SIZES, "triangle_id": "gbuffer.triangle_id"},
                ("search.pending", "search.region", "search.distance"), printed)

    def run(arrays: Arrays, real: Any) -> Arrays:
        out = Planes(arrays, real)
        out.new("search.pending", kind=np.bool_)
        out.new("search.region", 3)
        out.new("search.distance")
        for lane in lanes(arrays, real):
            searched(lane, settings)
            flags, rows = lane.scratch.pending, lane.scratch.rows
            out.put("search.pending", lane.k, flags, flags)
            out.put("search.region", lane.k, rows[S : RADIUS + 1], flags)
            out.put("search.distance", lane.k, rows[D], flags)
        return out.made

    recipe.facts["search"] = {"steepest, degrees": 80, "printed forms": sorted(settings.as_published)}
    recipe.add("search", "the disc in which each pixel's blockers may lie: tan a = Delta (d - near) / (2 d near)", run,
               (*PIXELS, *LIGHT), {
                   "search.pending": Spec(PLACE, "1", "whether the pixel lies before the light's plane and farther "
                                          "than the nearest distance; no others are shadowed", tier="T0"),
                   "search.region": REGION,
                   "search.distance": Spec(PLACE, "m", "d, from the map's centre; 0 where not pending")},
               paper="VAL Sec. 4.2, E-VAL-09; disc: E-VAL-08", exact=("maps.center",),
               variants=(form,),
               bugs=form.bugs("search", "region", *(("search/exact", "cone") if by_default(settings) else ())))

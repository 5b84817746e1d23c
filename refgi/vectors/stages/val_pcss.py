"""Stages of depth tests at pixels: blockers texel by texel, V by PCSS, PCF and the hard test (VAL Sec. 4.1; A.6 P4)."""

from typing import Any

import numpy as np

from refgi.cluster.filters.depth_scale import DepthScale
from refgi.cluster.settings import Pcss, ValSettings
from refgi.cluster.visibility.pcf import pcf_shadow, pcf_tile
from refgi.cluster.visibility.pcss import PcssShadow, blocker_test, filter_texels, find_blockers
from refgi.cluster.visibility.search_region import RADIUS, S, filter_sizing
from refgi.vectors.recipe import Recipe
from refgi.vectors.spec import Array, Arrays
from refgi.vectors.stages.val_decoys import blocker_decoys, binary_decoys, counted_decoys
from refgi.vectors.stages.val_maps import shadow_maps_of
from refgi.vectors.stages.val_search import (
    FACING,
    LIGHT,
    PIXELS,
    Lane,
    lanes,
    penumbra_planes,
    penumbra_specs,
    put_penumbra,
    searched,
    share_spec,
)


def add_pcss(recipe: Recipe, settings: ValSettings, pcss: Pcss) -> None:
    """Add V by percentage closer soft shadows."""
    def shadow_at(arrays: Arrays, real: Any, lane: Lane, how: ValSettings, kind: Pcss) -> PcssShadow:
        return PcssShadow(lane.constants, filter_sizing(how), blocker_test(kind, DepthScale(False, 0.0, 1.0, 1.0)),
                          np.ascontiguousarray(arrays["maps.depth"][lane.k], real))

    def facing_of(arrays: Arrays, real: Any) -> Array:
        return np.ascontiguousarray(arrays[FACING], real).reshape(3, -1)

    def penumbra(arrays: Arrays, real: Any, how: ValSettings = settings, kind: Pcss = pcss) -> Arrays:
        out = penumbra_planes(arrays, real)
        for lane in lanes(arrays, real):
            searched(lane, how)
            flags, rows = lane.scratch.pending, lane.scratch.rows
            flags[:] = np.asarray(arrays["search.pending"])[lane.k].reshape(-1)
            rows[S : RADIUS + 1] = arrays["search.region"][lane.k].reshape(3, -1)
            find_blockers(shadow_at(arrays, real, lane, how, kind), facing_of(arrays, real), len(flags), flags, rows)
            put_penumbra(out, lane)
        return out.made

    own = ("maps.depth", FACING)
    recipe.add("penumbra", "mean depth of the texels in the search disc that lie before the pixel's plane and within the "
               "cone from it to the light, and the disc of the penumbra", penumbra,
               (*PIXELS, *LIGHT, *own, "search.pending", "search.region"), penumbra_specs(),
               paper="A.6 P4, E-VAL-14", decoys=blocker_decoys(penumbra, settings, pcss))
    hard = ("hard.share",) if "hard.share" in recipe.specs else ()

    def share(arrays: Arrays, real: Any, kind: Pcss = pcss) -> Arrays:
        made = np.array(arrays["hard.share"], real) if hard else np.ones(arrays["penumbra.shaded"].shape, real)
        for lane in lanes(arrays, real):
            searched(lane, settings)
            flags = np.asarray(arrays["penumbra.shaded"])[lane.k].reshape(-1)
            lane.scratch.rows[S : RADIUS + 1] = arrays["penumbra.region"][lane.k].reshape(3, -1)
            filter_texels(shadow_at(arrays, real, lane, settings, kind), facing_of(arrays, real), len(flags), flags,
                          lane.visible, lane.scratch.rows)
            made[lane.k].reshape(-1)[flags] = lane.visible[flags]
        return {"visibility.share": made}

    recipe.add("visibility", "V: share of the texels of the penumbra's disc that do not hide the pixel, where shaded",
               share, (*PIXELS, *LIGHT, *own, "penumbra.shaded", "penumbra.region", *hard),
               {"visibility.share": share_spec()}, paper="A.6 P4, E-VAL-14", decoys=counted_decoys(share, pcss))


def add_binary(recipe: Recipe, name: str, texels: int) -> None:
    """Add V by a square of depth tests; `hard`: of area lights without extent alone."""
    def run(arrays: Arrays, real: Any, side: int = texels) -> Arrays:
        maps, delta = shadow_maps_of(arrays, real), np.asarray(arrays["areas.delta"])
        points, facing = (np.ascontiguousarray(arrays[one], real).reshape(3, -1) for one in (PIXELS[0], FACING))
        covered = np.asarray(arrays["gbuffer.triangle_id"]).reshape(-1) >= 0
        made = np.ones((len(delta), *arrays["gbuffer.triangle_id"].shape), real)
        for k in np.flatnonzero(maps.map_of >= 0):
            if delta[k] == 0 or name != "hard":
                shadow = pcf_shadow(maps, int(k), side if delta[k] > 0 else 1)
                pcf_tile(shadow, points, facing, len(covered), covered.copy(), made[k].reshape(-1), None)
        return {f"{name}.share": made}

    recipe.facts[f"{name}.test"] = {"side of the kernel, texels": texels, "slack, of the distance": 1e-3,
                                    "of lights without extent, texels": 1}
    recipe.add(name, "V by one depth test, of area lights without extent; 1 elsewhere" if name == "hard" else
               f"V: share of {texels} x {texels} texels that do not hide the pixel; of one for lights without extent",
               run, (*PIXELS, FACING, "maps.depth", *LIGHT), {f"{name}.share": share_spec()},
               paper="VAL-03; A.6 P4: receiver's plane, E-VAL-14", decoys=binary_decoys(run, name, texels))

"""Stages of depth tests at pixels: blockers texel by texel, V by PCSS, PCF and the hard test (VAL Sec. 4.1)."""

from typing import Any

import numpy as np

from refgi.cluster.filters.depth_scale import DepthScale
from refgi.cluster.settings import Pcss, ValSettings
from refgi.cluster.visibility.pcf import pcf_shadow, pcf_tile
from refgi.cluster.visibility.pcss import PcssShadow, blocker_test, filter_texels, find_blockers
from refgi.cluster.visibility.search_region import RADIUS, S, filter_sizing
from refgi.literal import val_visibility as literal
from refgi.vectors.recipe import Recipe
from refgi.vectors.rows import Form
from refgi.vectors.spec import Array, Arrays
from refgi.vectors.stages.facing import FACING
from refgi.vectors.stages.val_maps import shadow_maps_of
from refgi.vectors.stages.val_projected import BEHIND, of_both
from refgi.vectors.stages.val_search import (
    LIGHT,
    PIXELS,
    PLACES,
    SIZES,
    Lane,
    by_default,
    lanes,
    penumbra_planes,
    penumbra_specs,
    put_penumbra,
    searched,
    share_spec,
    sizing,
)


def add_pcss(recipe: Recipe, settings: ValSettings, pcss: Pcss) -> None:
    """Add V by percentage closer soft shadows."""
    places = {**PLACES, "facing": FACING, "depth": "maps.depth"}
    form = Form(literal.pcss_penumbra, {**places, **SIZES, "pending": "search.pending", "region": "search.region"},
                ("penumbra.shaded", "penumbra.z_avg", "penumbra.region"), sizing(settings))

    def shadow_at(arrays: Arrays, real: Any, lane: Lane) -> PcssShadow:
        return PcssShadow(lane.constants, filter_sizing(settings), blocker_test(pcss, DepthScale(False, 0.0, 1.0, 1.0)),
                          np.ascontiguousarray(arrays["maps.depth"][lane.k], real))

    def facing_of(arrays: Arrays, real: Any) -> Array:
        return np.ascontiguousarray(arrays[FACING], real).reshape(3, -1)

    def penumbra(arrays: Arrays, real: Any) -> Arrays:
        out = penumbra_planes(arrays, real)
        for lane in lanes(arrays, real):
            searched(lane, settings)
            flags, rows = lane.scratch.pending, lane.scratch.rows
            flags[:] = np.asarray(arrays["search.pending"])[lane.k].reshape(-1)
            rows[S : RADIUS + 1] = arrays["search.region"][lane.k].reshape(3, -1)
            find_blockers(shadow_at(arrays, real, lane), facing_of(arrays, real), len(flags), flags, rows)
            put_penumbra(out, lane)
        return out.made

    own = ("maps.depth", FACING)
    recipe.add("penumbra", "mean depth of the texels in the search disc that lie before the pixel's plane and within "
               "the cone from it to the light, and the disc of the penumbra", penumbra,
               (*PIXELS, *LIGHT, *own, "search.pending", "search.region"), penumbra_specs(),
               paper="E-VAL-14; docs/methods/val_visibility", variants=(form,), bugs=form.bugs(
                   "pcss_penumbra", "penumbra", "region", *(("cone",) if by_default(settings) else ())))
    hard = ("hard.share",) if "hard.share" in recipe.specs else ()

    final = Form(literal.pcss, {**places, "shaded": "penumbra.shaded", "region": "penumbra.region",
                                **({"hard": "hard.share"} if hard else {})}, ("visibility.share",))

    def share(arrays: Arrays, real: Any) -> Arrays:
        made = np.array(arrays["hard.share"], real) if hard else np.ones(arrays["penumbra.shaded"].shape, real)
        for lane in lanes(arrays, real):
            searched(lane, settings)
            flags = np.asarray(arrays["penumbra.shaded"])[lane.k].reshape(-1)
            lane.scratch.rows[S : RADIUS + 1] = arrays["penumbra.region"][lane.k].reshape(3, -1)
            filter_texels(shadow_at(arrays, real, lane), facing_of(arrays, real), len(flags), flags,
                          lane.visible, lane.scratch.rows)
            made[lane.k].reshape(-1)[flags] = lane.visible[flags]
        return {"visibility.share": made}

    recipe.add("visibility", "V: share of the texels of the penumbra's disc that do not hide the pixel, where shaded",
               share, (*PIXELS, *LIGHT, *own, "penumbra.shaded", "penumbra.region", *hard),
               {"visibility.share": share_spec()}, paper="E-VAL-14; docs/methods/val_visibility", variants=(final,),
               bugs=final.bugs("pcss"))


def add_binary(recipe: Recipe, name: str, texels: int) -> None:
    """Add V by a square of depth tests; `hard`: of area lights without extent alone."""
    share, second = f"{name}.share", {"behind": BEHIND} if BEHIND in recipe.specs else {}
    form = Form(literal.two_maps if second else literal.depth_tests, {
        **PLACES, **SIZES, "triangle_id": PIXELS[1], "facing": FACING, "depth": "maps.depth", **second}, (share,),
        {"texels": texels, **({} if second else {"points_only": name == "hard"})})

    def run(arrays: Arrays, real: Any) -> Arrays:
        maps, delta = shadow_maps_of(arrays, real), np.asarray(arrays["areas.delta"])
        points, facing = (np.ascontiguousarray(arrays[one], real).reshape(3, -1) for one in (PIXELS[0], FACING))
        covered = np.asarray(arrays["gbuffer.triangle_id"]).reshape(-1) >= 0
        made = np.ones((len(delta), *arrays["gbuffer.triangle_id"].shape), real)
        for k in np.flatnonzero(maps.map_of >= 0):
            if delta[k] == 0 or name != "hard":
                shadow = pcf_shadow(maps, int(k), texels if delta[k] > 0 or texels == 1 else 1)
                pcf_tile(shadow, points, facing, len(covered), covered.copy(), made[k].reshape(-1), None)
        return {f"{name}.share": made}

    recipe.facts[f"{name}.test"] = {"side of the kernel, texels": texels, "slack, of the distance": 1e-3,
                                    "of lights without extent, texels": 1}
    recipe.add(name, "V by one depth test, of area lights without extent; 1 elsewhere" if name == "hard" else
               f"V: share of {texels} x {texels} texels that do not hide the pixel; of one for lights without extent",
               of_both(run, share) if second else run, (*PIXELS, FACING, "maps.depth", *LIGHT, *second.values()),
               {share: share_spec()}, paper="E-VAL-14; docs/methods/val_visibility: PCF", variants=(form,),
               bugs=form.bugs("depth_tests", *(("kernel", f"kernel {texels}") if texels > 1 else ("texel",)),
                              *(("two_maps",) if second else ()), *(("hard",) if name == "hard" else ())))

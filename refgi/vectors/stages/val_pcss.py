"""Stages of depth tests at pixels: blockers texel by texel, V by PCSS, PCF and the hard test (VAL Sec. 4.1; A.6 P4)."""

from typing import Any

import numpy as np

from refgi.cluster.filters.depth_scale import DepthScale
from refgi.cluster.settings import ConstantBias, Pcss, ValSettings
from refgi.cluster.visibility.pcf import pcf_shadow, pcf_tile
from refgi.cluster.visibility.pcss import PcssShadow, blocker_test, filter_texels, find_blockers
from refgi.cluster.visibility.search_region import RADIUS, S, filter_sizing
from refgi.settings import replaced
from refgi.vectors.bugs.val import dark_where_1, local_of, scaled, size_bugs
from refgi.vectors.bugs.val_cone import cone_bugs
from refgi.vectors.bugs.val_pcf import pcf_bugs
from refgi.vectors.recipe import Recipe, reading, writing
from refgi.vectors.spec import Array, Arrays, Bug, Run
from refgi.vectors.stages.facing import FACING
from refgi.vectors.stages.val_maps import shadow_maps_of
from refgi.vectors.stages.val_projected import BEHIND, of_both, second_map_bugs
from refgi.vectors.stages.val_search import (
    LIGHT,
    PIXELS,
    Lane,
    by_default,
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
    recipe.add("penumbra", "mean depth of the texels in the search disc that lie before the pixel's plane and within "
               "the cone from it to the light, and the disc of the penumbra", penumbra,
               (*PIXELS, *LIGHT, *own, "search.pending", "search.region"), penumbra_specs(),
               paper="A.6 P4, E-VAL-14", bugs=_blocker_bugs(penumbra, settings, pcss))
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
               {"visibility.share": share_spec()}, paper="A.6 P4, E-VAL-14", bugs=_counted_bugs(share, pcss))


def add_binary(recipe: Recipe, name: str, texels: int) -> None:
    """Add V by a square of depth tests; `hard`: of area lights without extent alone."""
    def run(arrays: Arrays, real: Any, side: int = texels) -> Arrays:
        maps, delta = shadow_maps_of(arrays, real), np.asarray(arrays["areas.delta"])
        points, facing = (np.ascontiguousarray(arrays[one], real).reshape(3, -1) for one in (PIXELS[0], FACING))
        covered = np.asarray(arrays["gbuffer.triangle_id"]).reshape(-1) >= 0
        made = np.ones((len(delta), *arrays["gbuffer.triangle_id"].shape), real)
        for k in np.flatnonzero(maps.map_of >= 0):
            if delta[k] == 0 or name != "hard":
                shadow = pcf_shadow(maps, int(k), side if delta[k] > 0 or texels == 1 else 1)
                pcf_tile(shadow, points, facing, len(covered), covered.copy(), made[k].reshape(-1), None)
        return {f"{name}.share": made}

    share, second = f"{name}.share", (BEHIND,) if BEHIND in recipe.specs else ()
    bugs = _binary_bugs(run, name, texels)
    if second:
        bugs = (*(Bug(one.cause, of_both(one.run, share), one.paper) for one in bugs), *second_map_bugs(run, share))
    recipe.facts[f"{name}.test"] = {"side of the kernel, texels": texels, "slack, of the distance": 1e-3,
                                    "of lights without extent, texels": 1}
    recipe.add(name, "V by one depth test, of area lights without extent; 1 elsewhere" if name == "hard" else
               f"V: share of {texels} x {texels} texels that do not hide the pixel; of one for lights without extent",
               of_both(run, share) if second else run, (*PIXELS, FACING, "maps.depth", *LIGHT, *second),
               {share: share_spec()}, paper="VAL-03; A.6 P4: receiver's plane, E-VAL-14", bugs=bugs)


def _blocker_bugs(run: Any, settings: ValSettings, pcss: Pcss) -> tuple[Bug, ...]:
    """Return likely bugs of the mean depth of blockers and of the penumbra's disc, by depth tests."""
    return (
        Bug("depths are compared with the pixel's distance, not with its plane", _with(run, settings, _plain(pcss)),
            "E-VAL-14"),
        Bug("blockers outside the cone to the light count", _with(run, settings, replaced(pcss, {"cone": False})),
            "E-VAL-14"),
        Bug("normals point inwards within the map", reading(run, maps__depth=lambda a: a[:, ::-1]), "rows downwards"),
        Bug("z_avg is the nearest distance", writing(run, penumbra__z_avg=_least), "the mean"),
        *(cone_bugs(run) if by_default(settings) else ()),
        *size_bugs(run, settings))


def _with(run: Any, *how: Any) -> Run:
    return lambda arrays, real: run(arrays, real, *how)


def _plain(pcss: Pcss) -> Pcss:
    return replaced(pcss, {"constant_bias": ConstantBias(0.0)})


def _least(z_avg: Array) -> Array:
    least = np.where(z_avg > 0, z_avg, np.inf).min(axis=(1, 2), keepdims=True)
    return np.where(z_avg > 0, least, 0)


def _counted_bugs(run: Any, pcss: Pcss) -> tuple[Bug, ...]:
    """Return likely bugs of V by depth tests of a disc."""
    return (
        Bug("depths are compared with the pixel's distance, not with its plane", _with(run, _plain(pcss)),
            "E-VAL-14"),
        Bug("V is the hidden share", writing(run, visibility__share=lambda a: 1 - a), "V = 1 - blocked / tested"),
        Bug("V of one test: hidden or not", writing(run, visibility__share=np.floor), "a share"),
        Bug("one texel alone", reading(run, penumbra__region=scaled(0.0)), "all texels of the disc"),
        Bug("half of the disc's radius", reading(run, penumbra__region=scaled(0.5)), "radius, not diameter"),
        Bug("rows run upwards", reading(run, maps__depth=lambda a: a[:, ::-1]), "rows downwards"),
        Bug("pixels without blockers are dark", writing(run, visibility__share=dark_where_1), "1"))


def _binary_bugs(run: Any, name: str, texels: int) -> tuple[Bug, ...]:
    """Return likely bugs of depth tests of a square of texels, or of one."""
    facing, share = "gbuffer__facing", f"{name}__share"
    return (
        Bug("depths are compared with the pixel's distance, not with its plane",
            reading(run, **{facing: np.zeros_like}), "E-VAL-14"),
        Bug("the kernel is two texels wider" if texels > 1 else "3 x 3 texels in place of one",
            _with(run, texels + 2), f"{texels} x {texels}"),
        Bug("V is the hidden share", writing(run, **{share: lambda a: 1 - a}), "V = 1 - blocked / tested"),
        Bug("rows run upwards", reading(run, maps__depth=lambda a: a[:, ::-1]), "rows downwards"),
        Bug("a texel too far left", reading(run, maps__depth=lambda a: np.roll(a, 1, axis=2)), "floor(s n)"),
        Bug("pixels behind the light's plane are hidden", _hidden_behind(run, name), "E-VAL-12: V = 1"),
        *pcf_bugs(name, texels))


def _hidden_behind(run: Any, name: str) -> Run:
    def altered(arrays: Arrays, real: Any) -> Arrays:
        behind = (local_of(arrays)[0][2] <= 0) & np.isfinite(arrays["maps.near"])[:, None, None]
        return {f"{name}.share": np.where(behind, 0, run(arrays, real)[f"{name}.share"])}

    return altered

"""Light of all area lights one step after the other: V, light without it, their sum (VAL Sec. 4 and 6)."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from refgi.cluster.back_projection import back_projection
from refgi.cluster.clustered import asks_shading, visibility_by
from refgi.cluster.interleave import (
    add_members,
    assigned_subsets,
    gather_pixels,
    member_lights,
    scatter_pixels,
    subsets,
)
from refgi.cluster.maps import ShadowMaps
from refgi.cluster.rectangle import AreaLights, VisibilityFunction
from refgi.cluster.settings import Assignment, BackProjection, Csm, Hard, Pcf, Pcss, ValSettings
from refgi.cluster.visibility.csm import series, visibility_of_map
from refgi.cluster.visibility.search_region import filter_sizing
from refgi.cluster.visibility.shadow import Shadows
from refgi.cluster.visibility.steps import Places, depth_tests, of_both, pcss, pcss_penumbra, search
from refgi.pairs.irradiance import Receivers, checked
from refgi.pairs.pixel_lights import PixelLights
from refgi.pairs.settings import PairSettings
from refgi.stages import of_steps, stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.rays import Tracer


@stage("cluster.interleaving", kept=False)
def subset_of_lights(of: Array, side: int, assignment: Assignment) -> Array:
    """Deal lights out to n^2 subsets, of which a pixel sums (row mod n) n + column mod n (VAL Sec. 6, E-VAL-13).

    of (light,) int: C(i): cluster of each light.
    side: n, pixels along a side of a block.
    assignment: Every n^2-th light, or runs of lights by cluster.
    -> (light,) int: Subset of each light, 0 to n^2 - 1.
    """
    return assigned_subsets(of, side, assignment)


@stage("cluster.parts", kept=False)
def parts(
    receivers: Receivers, light_position: Array, light_normal: Array, flux: Array, of: Array, center: Array,
    subset: Array | None, side: int, pairs: PairSettings, lobe_flux: Array | None = None,
    lobe_axis: Array | None = None, lobe_exponent: Array | None = None, area: Array | None = None,
) -> Array:
    """Sum the light of each area light's members, n^2 times those of a pixel's subset (VAL Sec. 4, E-VAL-01, 13).

    flux (3, light): Flux that the diffuse part reflects, W.
    of (light,) int: C(i): cluster of each light.
    center (3, area light): Centres of clusters, of which their number alone counts, m.
    subset (light,) int: Subset of each light; None: every pixel sums all.
    side: n, pixels along a side of a block.
    lobe_flux (3, light): Flux that the lobe reflects, W.
    lobe_axis (3, light): Unit vectors.
    area (light,): Surface that each light stands for, m^2.
    -> (area light, 3, h, w): Irradiance of the cluster's lights without visibility, W/m^2.
    """
    lights = PixelLights(light_position, light_normal, flux, lobe_flux, lobe_axis, lobe_exponent, len(of))
    packed, count, real = checked(receivers, lights, pairs, area), center.shape[1], receivers.position.dtype
    pixels = subsets(np.asarray(receivers.covered, np.bool_), side)
    own = np.zeros(len(of), np.int64) if subset is None else np.asarray(subset, np.int64)
    members = member_lights(packed, of, count, own, side**2)
    position, normal = (np.empty((3, len(pixels.places)), real) for _ in range(2))
    gather_pixels(receivers.position.reshape(3, -1), pixels, position)
    gather_pixels(receivers.normal.reshape(3, -1), pixels, normal)
    made = np.zeros((count, *receivers.position.shape), real)
    for m in range(count):
        sums = np.zeros_like(position)
        add_members(position, normal, pixels, members, m, sums)
        scatter_pixels(sums, pixels, real.type(side**2), made[m].reshape(3, -1))
    return made


@stage("cluster.shadowed", kept=False)
def shadowed(irradiance: Array, share: Array | None) -> Array:
    """Add up the light of area lights under their visibility: E = sum V_m E_m (VAL Sec. 4).

    irradiance (area light, 3, h, w): Light of each one's members, W/m^2.
    share (area light, h, w): V; None: all is seen.
    -> (3, h, w): Indirect irradiance, W/m^2; of interleaved pixels not blurred.
    """
    made = np.zeros(irradiance.shape[1:], irradiance.dtype)
    for m, part in enumerate(irradiance):
        made += part if share is None else part * share[m]
    return made


@stage("cluster.traced_share", kept=False)
def traced_share(
    receivers: Receivers, facing: Array, areas: AreaLights, maps: Mapping[str, Array] | None, settings: ValSettings,
    visibility_of: VisibilityFunction | None, rays: "Tracer | None",
) -> Array:
    """Find V of each area light by rays, or by what is no test of a map's texels alone (docs/methods/val_visibility).

    maps mapping of str to (area light, ...): Maps of the area lights, where they are read.
    visibility_of: V from elsewhere.
    rays: The scene's triangles, for points behind an area light.
    -> (area light, h, w): V, 0 hidden to 1 seen; 1 without surface.
    """
    visible_from = visibility_by(areas, None if maps is None else _shadow_maps(maps), settings, visibility_of, rays)
    covered = np.asarray(receivers.covered, np.bool_).reshape(-1)
    position, normal, face = (np.ascontiguousarray(one.reshape(3, -1)[:, covered]) for one in (
        receivers.position, receivers.normal, facing))
    beside = {"shading": normal} if asks_shading(visible_from, receivers.normal, facing) else {}
    made = np.ones((len(areas.members), *receivers.covered.shape), receivers.position.dtype)
    for m, share in enumerate(made):
        share.reshape(-1)[covered] = visible_from(m, position, face, **beside)
    return made


def _shadow_maps(maps: Mapping[str, Array]) -> ShadowMaps:
    """Return maps of all area lights as one."""
    held = np.isfinite(maps["near"]) | np.isfinite(maps.get("near_behind", np.inf))
    chosen: dict[str, Any] = {name: array for name, array in maps.items() if name in ShadowMaps._fields}
    return ShadowMaps(map_of=np.where(held, np.arange(len(held)), -1), **chosen)


def irradiance_steps(
    receivers: Receivers, facing: Array, lights: PixelLights, areas: AreaLights, maps: ShadowMaps | None,
    settings: ValSettings, footprint: Array | None = None, visibility_of: VisibilityFunction | None = None,
    interleaving: int = 1, rays: "Tracer | None" = None, kept: Shadows | None = None,  # noqa: ARG001
) -> Array:
    """Return the irradiance of all area lights, made by steps."""
    subset = subset_of_lights(areas.of, interleaving, settings.interleaving.assignment) if interleaving > 1 else None
    share = _visibility(receivers, facing, areas, of_steps(maps), settings, visibility_of, rays)
    glossy = {name: getattr(lights, name) for name in ("lobe_flux", "lobe_axis", "lobe_exponent")}
    return shadowed(parts(receivers, lights.position, lights.normal, lights.flux, areas.of, areas.center, subset,
                          interleaving,
                          settings.pairs, **glossy, area=footprint if settings.pairs.needs_footprints else None), share)


def _visibility(
    receivers: Receivers, facing: Array, areas: AreaLights, maps: Any, settings: ValSettings,
    visibility_of: VisibilityFunction | None, rays: "Tracer | None",
) -> Array | None:
    """Return V of each area light at each pixel, (M, h, w), made by steps; None: 1 everywhere."""
    kind = settings.visibility
    if kind is None or (maps is None and visibility_of is None):
        return None
    if isinstance(kind, BackProjection) and maps is not None:
        told = settings.maps.behind == "visible"
    else:
        biased = isinstance(kind, Pcss) and kind.constant_bias is not None
        told = visibility_of is None and rays is None and not biased
    if not told:
        read = None if maps is None else {name: one for name, one in maps.items() if name in ShadowMaps._fields}
        return traced_share(receivers, facing, areas, read, settings, visibility_of, rays)
    ahead = Places(receivers.position, receivers.covered, maps["center"], maps["frame"], areas.delta, maps["near"])
    if isinstance(kind, BackProjection):
        return back_projection(ahead, facing, maps["depth"], areas.axes, areas.side, areas.offset, areas.center,
                               areas.normal, maps["scene_far"],
                               None if np.may_share_memory(receivers.normal, facing) else receivers.normal)
    share = _by_map(ahead, facing, maps["depth"], maps["far"], maps["scene_far"], settings)
    if "behind" not in maps:
        return share
    behind = ahead._replace(frame=maps["frame_behind"], near=maps["near_behind"])
    return of_both(share, _by_map(behind, facing, maps["behind"], maps["far_behind"], maps["scene_far"], settings))


def _by_map(
    places: Places, facing: Array, depth: Array, far: Array, scene_far: Array, settings: ValSettings
) -> Array:
    """Return V of each area light by one map of it."""
    kind, sizing = settings.visibility, filter_sizing(settings)
    if isinstance(kind, Pcf | Hard) or not places.delta.any():
        return depth_tests(places, facing, depth, kind.texels if isinstance(kind, Pcf) else 1, points_only=False)
    hard = depth_tests(places, facing, depth, 1, points_only=True) if (places.delta == 0).any() else None
    printed = sizing.alpha_over_pi, sizing.foreshortened
    chain = series(kind.terms, kind.attenuation, kind.rescale, kind.bias) if isinstance(kind, Csm) else None
    pending, region, _ = search(places, sizing.solid_angle, *printed, sizing.axial)
    if isinstance(kind, Csm):
        assert chain is not None
        return visibility_of_map(places, depth, far, scene_far, (pending, region), kind, chain, sizing, hard)
    assert isinstance(kind, Pcss)
    shaded, _, final = pcss_penumbra(places, facing, depth, pending, region, sizing.alpha, *printed, sizing.axial,
                                     kind.cone)
    return pcss(places, facing, depth, shaded, final, hard)

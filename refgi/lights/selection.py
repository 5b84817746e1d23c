"""Which pixel lights a splatting method uses (SII Sec. 3.1, 3.5 to 3.7), and openness in place of visibility (Sec. 7).

The paper scales the flux "by the ambient occlusion term" on an unwarped pattern. With O the share of free directions
the intended factor is 1 - O: `scale_flux` darkens lights in the open and loses the sum of Phi O; `roulette` removes
them at random and lets the survivors make up for it. By the paper's own O (Sec. 3.5) the printed factor is O, which
darkens the lights near other surfaces, against its aim: `as_printed`.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from refgi.diagnostics import is_due
from refgi.errors import expect
from refgi.lights.importance import importance as importance_of
from refgi.lights.pixel_lights import Drawn, draw_texels, footprints_of, lights_of
from refgi.lights.refraction import refracted
from refgi.lights.settings import LightSettings, MapLights, Openness, PathLights
from refgi.lights.shares import MapShare, map_shares, with_equal_solid_angles
from refgi.lights.walk import walk_lights
from refgi.lights.warp import Warp
from refgi.pairs.estimates import lost_share, warn_of_loss
from refgi.sampling import ROULETTE, draws
from refgi.scene import light_table, material_table
from refgi.scene.material import as_senders
from refgi.stages import skip, stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.frame import Frame
    from refgi.pairs.pixel_lights import PixelLights
    from refgi.pairs.settings import PairSettings
    from refgi.rsm import Rsm


def occluded(frame: "Frame", irradiance: Array, settings: Openness | None, seed: int) -> Array:
    """Return a picture's irradiance (3, h, w), W/m^2, times the openness of its receivers, if the settings have it."""
    if settings is None:
        return irradiance
    return occlude(irradiance, openness_of(frame, *frame.gbuffer.resolve("position", "normal", "covered"),
                                           settings=settings, seed=seed))


@stage("lights.occlude")
def occlude(irradiance: Array, openness: Array) -> Array:
    """Scale what each receiver gets by its openness, E O, in place of visibility (SII Sec. 7, AMS Sec. 5).

    irradiance (3, h, w): Indirect irradiance, W/m^2, without visibility.
    openness (h, w): Share O of unoccluded directions of each pixel, 0 to 1.
    -> (3, h, w): Indirect irradiance, W/m^2, without albedo/pi.
    """
    return irradiance * openness


def openness_of(
    frame: "Frame", position: Array, normal: Array, covered: Array | None = None, *, settings: Openness, seed: int
) -> Array:
    """Return how open points (3, ...) are, (...), 0 to 1; a radius of 0 is a tenth of what is lit."""
    from refgi.rays import openness

    radius = settings.radius or frame.illuminated_extent.diagonal / 10
    return openness(frame.tracer, position, normal, covered, radius=radius, rays=settings.rays, seed=seed)


@stage("lights.scale_flux")
def scale_flux(
    lights: "PixelLights", openness: Array, as_printed: bool = False
) -> "tuple[PixelLights, Array]":
    """Scale each light's flux by 1 - O.

    openness (light,): Share O of unoccluded directions of each light, 0 to 1.
    as_printed: Scale by O, the ambient occlusion term as the paper defines it.
    -> lights PixelLights: All of them, in the same order; those with O = 1, as printed O = 0, are dark.
    -> lost (3,) float64: Flux removed, W, diffuse and lobe together.

    Raises `InputError` if openness does not fit.
    """
    _check(lights, openness)
    factor = (openness if as_printed else 1 - openness).astype(lights.flux.dtype)
    scaled = lights._replace(flux=lights.flux * factor)
    if lights.lobe_flux is not None:
        scaled = scaled._replace(lobe_flux=lights.lobe_flux * factor)
    return scaled, power(lights) - power(scaled)


@stage("lights.roulette")
def roulette(lights: "PixelLights", openness: Array, floor: float, seed: int) -> "PixelLights":
    """Keep each light with chance p = max(floor, 1 - O) and divide its flux by p.

    openness (light,): Share O of unoccluded directions of each light, 0 to 1.
    floor: Least chance, above 0 to 1: no light's flux grows by more than 1 / floor.
    seed: Which random choice: one number a light, in their order.
    -> PixelLights: The survivors, in order. Sums over them have the mean of sums over `lights`.

    Raises `InputError` if openness does not fit or a number is out of range.
    """
    _check(lights, openness)
    expect(0 < floor <= 1, "floor", "above 0, up to 1", floor)
    chance = np.maximum(1 - np.asarray(openness, np.float64), floor)
    survives = draws(seed, ROULETTE, len(chance)) < chance
    gain = (1 / chance[survives]).astype(lights.flux.dtype)
    survivors = lights.selected(survives)
    survivors = survivors._replace(flux=survivors.flux * gain)
    if survivors.lobe_flux is not None:
        survivors = survivors._replace(lobe_flux=survivors.lobe_flux * gain)
    return survivors


def _check(lights: "PixelLights", openness: Array) -> None:
    count = lights.flux.shape[1]
    expect(np.shape(openness) == (count,), "openness", f"shape ({count},), one for each light", np.shape(openness))
    expect(bool(((openness >= 0) & (openness <= 1)).all()), "openness", "numbers from 0 to 1", "others")


def power(lights: "PixelLights") -> Array:
    """Return the flux of all lights, diffuse and lobe together, (3,) W in float64."""
    flux: Array = lights.flux.sum(axis=1, dtype=np.float64)
    return flux if lights.lobe_flux is None else flux + lights.lobe_flux.sum(axis=1, dtype=np.float64)


def choose_lights(frame: "Frame", settings: LightSettings) -> "PixelLights":
    """Return the pixel lights of a frame, with their share of the flux."""
    source = settings.source
    if isinstance(source, PathLights):
        scene = frame.scene
        lights = walk_lights(frame.tracer, scene.geometry, material_table(as_senders(scene.materials)),
                             light_table(scene.lights), settings.count, source.bounces, settings.seed)
    else:
        rsms = light_maps(frame, source)
        lights = pixel_lights(rsms, settings, importance_maps(frame, rsms, settings))
        if "sii_no_tn" in source.as_published:
            lights = _without_weight(lights, rsms, settings)
    return with_openness(frame, lights, settings)


def light_maps(frame: "Frame", settings: MapLights) -> "tuple[Rsm, ...]":
    """Return the maps that lights are taken from, one a lamp of the shape asked for, with what glass lets through."""
    rsms = frame.rsms_as(settings.projection)
    if settings.refraction is not None:
        mode: Any = settings.refraction.name()
        traced = mode == "two_interface" and frame.materials.ior.any()
        tracer = frame.tracer if traced else None
        rsms = tuple(refracted(rsm, frame.scene.geometry, frame.materials, mode, settings.refraction.exponent,
                               tracer=tracer) for rsm in rsms)
    # after refraction: what leaves glass has the solid angle of its texel too
    return tuple(map(with_equal_solid_angles, rsms)) if "equal_solid_angle" in settings.as_published else rsms


def importance_maps(frame: "Frame", rsms: "Sequence[Rsm]", settings: LightSettings) -> list[Array] | None:
    """Return the importance of each texel for the warp (Sec. 3.5), (H, W) a map; None where no pattern is warped.

    The frame's triangles block what is not open.
    """
    warp = _map_lights(settings).warp
    if warp is None:
        skip("lights.warp", "lights follow their pattern alone")
        return None
    maps = []
    for rsm in rsms:
        free = None
        if warp.importance == "openness":
            free = openness_of(frame, rsm.position, rsm.normal, _has_flux(rsm), settings=settings.openness,
                               seed=settings.seed)
        maps.append(importance_of(rsm, warp.importance, free, settings.openness.floor, warp.defensive,
                                  as_printed="sii_peak" in _map_lights(settings).as_published))
    return maps


def with_openness(frame: "Frame", lights: "PixelLights", settings: LightSettings) -> "PixelLights":
    """Return lights scaled by 1 - openness or thinned by roulette with it, if the settings ask for it (Sec. 3.6)."""
    if settings.openness.flux == "none":
        return lights
    free = openness_of(frame, lights.position, lights.normal, settings=settings.openness, seed=settings.seed)
    if settings.openness.flux == "scale":
        scaled = scale_flux(lights, free, "sii_openness" in settings.openness.as_published)[0]
        if is_due("lights.openness_loss"):
            warn_of_loss(lost_share(power(lights).sum(), power(scaled).sum()), "openness_flux 'scale'")
        return scaled
    return roulette(lights, free, settings.openness.floor, settings.seed)


def pixel_lights(
    rsms: "Sequence[Rsm]", settings: LightSettings, importance: "Sequence[Array] | None" = None
) -> "PixelLights":
    """Choose pixel lights from maps, one a lamp, as the settings say, with their share of the flux.

    `importance`, (H, W) a map, steers the warp.
    """
    return lights_of(rsms, _drawn(rsms, settings, importance))


def _drawn(rsms: "Sequence[Rsm]", settings: LightSettings, importance: "Sequence[Array] | None") -> list[Drawn]:
    source = _map_lights(settings)
    count = None if source.pattern == "all" else settings.count
    method: Any = source.warp and source.warp.name()
    warp = None if source.warp is None else Warp(method, source.warp.levels)
    return draw_texels(rsms, count=count, pattern=source.pattern, seed=settings.seed, filtered=source.filtered,
                       warp=warp, importance=importance,
                       renormalise=source.warp is not None and source.warp.renormalise_weights)


def _map_lights(settings: LightSettings) -> MapLights:
    """Return how lights are taken from maps; the defaults where they are ends of paths."""
    return settings.source if isinstance(settings.source, MapLights) else MapLights()


def drawn_from_maps(rsms: "Sequence[Rsm]", settings: LightSettings) -> list[MapShare]:
    """Return how many texels the settings draw from each map."""
    pattern = _map_lights(settings).pattern
    return map_shares(rsms, None if pattern == "all" else settings.count, pattern, settings.seed)


def _without_weight(lights: "PixelLights", rsms: "Sequence[Rsm]", settings: LightSettings) -> "PixelLights":
    """Return lights as the paper has them: each with its texel's flux, T/N left out."""
    if _map_lights(settings).pattern == "all" or lights.map_index is None:
        return lights
    drawn = drawn_from_maps(rsms, settings)
    share = np.array([one.drawn / rsm.texels / one.gain for one, rsm in zip(drawn, rsms, strict=True)],
                     lights.flux.dtype)
    factor = share[lights.map_index]
    lobe = None if lights.lobe_flux is None else lights.lobe_flux * factor
    return lights._replace(flux=lights.flux * factor, lobe_flux=lobe)


def footprints(frame: "Frame", settings: LightSettings, pairs: "PairSettings") -> Array | None:
    """Return the surface area (N,), m^2, of each light of `choose_lights` where the clamp needs it, else None."""
    return light_areas(frame, settings) if pairs.needs_footprints else None


def light_areas(frame: "Frame", settings: LightSettings) -> Array:
    """Return the surface that each light of `choose_lights` from maps stands for, (N,), m^2."""
    rsms = light_maps(frame, _map_lights(settings))
    return footprints_of(rsms, _drawn(rsms, settings, importance_maps(frame, rsms, settings)))


def _has_flux(rsm: "Rsm") -> Array:
    """Return where a map reflects anything, (H, W) bool."""
    diffuse: Array = np.asarray(rsm.flux.any(axis=0))
    return diffuse if rsm.lobe_flux is None else diffuse | rsm.lobe_flux.any(axis=0)

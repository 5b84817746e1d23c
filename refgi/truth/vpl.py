"""Pixel lights (VPLs) with ray-traced visibility, the limit of every method of pixel lights.

E(x) = sum_i Phi_i / pi <n_i.w> <n_x.-w> / r^2 V(x, x_i), and the same with a lobe (SII Eq. 2 and 3, calibrated).
"""

import dataclasses
from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from refgi.diagnostics import SamplingError, asked
from refgi.lights.settings import LightSettings, MapLights, most_lights
from refgi.method import Approximation, Extent, Method
from refgi.pairs.estimates import UNREACHED, error_of_halves, warn_of_mirrors, warn_of_sampling, with_seen_light
from refgi.pairs.irradiance import Receivers
from refgi.pairs.pixel_lights import pack
from refgi.pairs.sample import sample_peaks
from refgi.pairs.settings import PairSettings
from refgi.pairs.shadow_rays import BATCH, Hidden, receivers, shadowed_sum
from refgi.rays import Tracer
from refgi.scene import Geometry
from refgi.settings import Settings, setting
from refgi.stages import stage
from refgi.truth.imperfect import Imperfect, ImperfectDepth, fill_hidden, imperfect_maps
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.frame import Frame
    from refgi.lights import PixelLights

FLOAT32 = 4  # bytes
SAMPLED = 512  # pixels of which the sampling error is estimated


@dataclasses.dataclass(frozen=True)
class VplSettings(Settings):
    """Which pixel lights `vpl` uses, and whether they are shadowed."""

    lights: LightSettings = setting(LightSettings(), "pixel lights")
    visibility: bool = setting(True, "a shadow ray for each pair of light and receiver, or a map for each light")
    maps: Imperfect | None = setting(None, "maps in place of rays; none: rays")
    batch: int = setting(BATCH, "pairs held at a time: memory, never a bit of the result", least=1, most=2**30,
                         study=True)

    @property
    def traces_rays(self) -> bool:
        """Whether the method traces rays: without visibility it takes from their tracer how far receivers are moved."""
        return True


def vpl(frame: "Frame", settings: VplSettings | None = None) -> Array:
    """Sum pixel lights at every pixel, with a shadow ray for each pair or an imperfect shadow map for each light.

    Parameters
    ----------
    frame : Frame
        The view of the scene.
    settings : VplSettings, optional
        Which lights; the defaults where absent.

    Returns
    -------
    (3, h, w) ndarray
        Indirect irradiance in the frame's dtype, W/m^2, linear RGB. Excludes the receiver's albedo/pi.
    """
    settings = settings or VplSettings()
    lights, maps = _lights(frame, settings)
    position, normal = frame.gbuffer.resolve("position", "normal")
    irradiance = light_of_pixel_lights(frame.scene.geometry, position, normal, frame.gbuffer.triangle_id, lights, maps,
                                       settings.visibility, frame.tracer, settings.batch)
    warn_of_mirrors(frame, lights, "vpl")
    found = asked("vpl.sampling_error")
    if found is not None:
        found.sampling_error = with_seen_light(vpl_sampling_error(frame, lights, settings), frame,
                                               Receivers(*frame.gbuffer.resolve("position", "normal", "covered")),
                                               lights)
        warn_of_sampling(found.sampling_error, "vpl")
    return irradiance


@stage("vpl.light", kept=False, steps="refgi.truth.steps.light_steps")
def light_of_pixel_lights(
    geometry: Geometry, position: Array, normal: Array, triangle_id: Array, lights: "PixelLights",
    maps: ImperfectDepth | None, visibility: bool, tracer: Tracer, batch: int = BATCH,
) -> Array:
    """Sum the irradiance of pixel lights at every pixel, with their visibility by rays or maps (SII Eq. 2, 3).

    maps: A map of each light in place of rays.
    visibility: Whether anything blocks.
    batch: Pairs held at a time; changes no bit of the result.
    -> (3, h, w): Indirect irradiance, W/m^2; 0 without surface.
    """
    points = receivers(geometry, position, normal, triangle_id, tracer.grain)
    irradiance = np.zeros_like(normal)
    # with visibility V(x, x_i)
    irradiance.reshape(3, -1)[:, points.pixel] = shadowed_sum(tracer, points, lights, visibility=visibility,
                                                              batch=batch, hidden=_hidden(maps))
    return irradiance


@stage("vpl.sampling_error")
def vpl_sampling_error(frame: "Frame", lights: "PixelLights", settings: VplSettings) -> SamplingError | None:
    """Return how much the light of a picture depends on which lights were drawn, from two halves of them.

    settings: Whether they are shadowed; imperfect maps, which shadow all lights together, are left out here.
    -> SamplingError: At sampled pixels; None where every texel is a light, or there is no light.
    """
    if lights.half is None:
        return None
    seen = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))
    sample = sample_peaks(seen, pack(lights, PairSettings(clamp=UNREACHED), None, seen.position.dtype), SAMPLED)
    points = receivers(frame.scene.geometry, sample.position, sample.normal,
                       frame.gbuffer.triangle_id.reshape(-1)[sample.place], frame.tracer.grain)
    shadowed = settings.visibility and settings.maps is None
    first, second = (shadowed_sum(frame.tracer, points, lights.selected(lights.half == later), visibility=shadowed,
                                  batch=settings.batch) for later in (False, True))
    return error_of_halves(first, second, lights.drawn, weight=sample.weight)


def vpl_lobes(frame: "Frame", settings: VplSettings) -> Array:
    """Sum pixel lights at every glossy pixel's lobe, with a shadow ray or an imperfect shadow map for each pair.

    (3, h, w) radiance towards the eye in the frame's dtype, W/m^2/sr, linear RGB; 0 where there is no lobe.
    """
    from refgi.pairs.shadow_rays import shadowed_radiance
    from refgi.rsm.buffers.leaving import spread_over_picture

    lights, maps = _lights(frame, settings)
    points = frame.glossy_points
    to = receivers(frame.scene.geometry, points.position, points.normal,
                   frame.gbuffer.triangle_id.reshape(-1)[points.pixel], frame.tracer.grain)
    radiance = shadowed_radiance(frame.tracer, to, points, lights, visibility=settings.visibility,
                                 batch=settings.batch, hidden=_hidden(maps))
    return spread_over_picture(points, radiance, (frame.height, frame.width))


def _lights(frame: "Frame", settings: VplSettings) -> "tuple[PixelLights, ImperfectDepth | None]":
    """Return pixel lights, and their maps in place of rays."""
    from refgi.lights.selection import choose_lights

    lights, maps = choose_lights(frame, settings.lights), None
    if settings.visibility and settings.maps is not None:
        maps = imperfect_maps(frame.scene.geometry, lights, settings.maps, settings.lights.seed)
    return lights, maps


def _hidden(maps: ImperfectDepth | None) -> Hidden | None:
    return None if maps is None else partial(fill_hidden, maps)


def _every_texel(settings: VplSettings, _: Mapping[str, Any]) -> VplSettings:
    return dataclasses.replace(settings, lights=LightSettings(source=MapLights(pattern="all")))


def _by_rays(settings: VplSettings, _: Mapping[str, Any]) -> VplSettings:
    return dataclasses.replace(settings, maps=None)


APPROXIMATIONS = (
    Approximation("visibility", "nothing blocks indirect light",
                  limit=lambda settings: {} if settings.visibility else {"visibility": False}),
    Approximation("light sampling", "N pixel lights for all texels of the reflective shadow map", _every_texel,
                  from_truth=lambda settings: settings.visibility),
    Approximation("imperfect maps", "a depth map of few points for the rays of each light", _by_rays))


def _map_bytes(settings: VplSettings, extent: Extent) -> int:
    if settings.maps is None or not settings.visibility:
        return 0
    return FLOAT32 * most_lights(settings.lights, extent.maps, extent.texels) * settings.maps.resolution**2


METHOD = Method("vpl", "the same pixel lights with visibility by rays or imperfect shadow maps", vpl, VplSettings,
                visibility=lambda settings: settings.visibility, memory=_map_bytes, approximations=APPROXIMATIONS,
                lobes=vpl_lobes)

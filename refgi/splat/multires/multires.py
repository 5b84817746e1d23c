"""Adaptive multiresolution splatting (Nichols and Wyman 2009): the method."""

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.lights.footprints import demo_footprints
from refgi.lights.selection import choose_lights, drawn_from_maps, footprints
from refgi.pairs.irradiance import Receivers
from refgi.pairs.loss import warn_of_clamp
from refgi.splat.multires.error_target.error_driven import error_driven
from refgi.splat.multires.light_lists.per_light import per_light
from refgi.splat.multires.refinement.criteria import needs
from refgi.splat.multires.refinement.grid import Subsplats, top_level
from refgi.splat.multires.refinement.refine import refine
from refgi.splat.multires.settings import MultiresSettings
from refgi.splat.multires.subsplats.detail import surface_detail
from refgi.splat.multires.subsplats.evaluate import at_subsplats, evaluate, evaluate_visible
from refgi.splat.multires.subsplats.upsample import upsample

if TYPE_CHECKING:
    from refgi.frame import Frame
    from refgi.lights import PixelLights
    from refgi.rsm import GBuffer

Array = npt.NDArray[Any]


def multires(frame: "Frame", settings: MultiresSettings) -> Array:
    """Light every pixel by pixel lights that are evaluated at subsplats.

    Parameters
    ----------
    frame : Frame
        The scene, seen and lit.
    settings : MultiresSettings
        Which lights, where subsplats are refined and how they become a picture.

    Returns
    -------
    (3, h, w) ndarray
        Indirect irradiance, W/m^2, linear RGB, without visibility unless by rays.
    """
    lights = choose_lights(frame, settings.lights)  # Sec. 3.1
    footprint = _footprints(frame, lights, settings)
    if not settings.supersampled:
        return _indirect(frame, frame.gbuffer, lights, footprint, settings)
    double = _doubled(frame)  # Sec. 4: rendered at 2048^2 for 1024^2
    return _halved(_indirect(frame, double, lights, footprint, settings), double.covered, frame.gbuffer.covered)


def _indirect(
    frame: "Frame", buffer: "GBuffer", lights: "PixelLights", footprint: Array | None, settings: MultiresSettings
) -> Array:
    """Light the pixels of one buffer: steps 3 to 6 of the paper's overview, and Eq. 3."""
    _resolve(buffer, settings)
    receivers = Receivers(buffer.position, buffer.normal, buffer.covered)
    warn_of_clamp(receivers, lights, settings.effective_pairs, footprint, "multires")
    if settings.target_error is not None:
        light = error_driven(buffer, lights, settings, footprint).irradiance
    elif settings.per_light == "light":
        light = per_light(buffer, lights, settings, footprint, None)  # Sec. 3.3.1
    elif settings.per_light == "shared_then_light":
        start = shared_subsplats(buffer, settings)
        light = per_light(buffer, lights, settings, footprint, start)  # Sec. 6
    else:
        subsplats = shared_subsplats(buffer, settings)  # Sec. 3.2, 3.3
        light = _upsampled(frame, buffer, subsplats, lights, footprint, settings)  # Sec. 3.4, 3.5
    if settings.detail == 0:
        return light
    eye = frame.scene.camera.eye
    return surface_detail(light, buffer.position, buffer.normal, buffer.covered, eye, settings.detail)  # Eq. (3)


def _resolve(buffer: "GBuffer", settings: MultiresSettings) -> None:
    """Compute in one pass what the steps will ask for one by one; depth only where a criterion looks at it."""
    by_geometry = settings.target_error is None and settings.per_light != "light"
    looks_at_depth = by_geometry and not settings.criteria.isdisjoint({"depth", "derivative"})
    buffer.resolve("position", "normal", *(("depth",) if looks_at_depth else ()))


def shared_subsplats(buffer: "GBuffer", settings: MultiresSettings) -> Subsplats:
    """Refine by geometry, once for all lights (Sec. 3.2 and 3.3).

    Parameters
    ----------
    buffer : GBuffer
        What the camera sees.
    settings : MultiresSettings
        Criteria, thresholds, coarsest and finest level.

    Returns
    -------
    Subsplats
        The leaves.
    """
    top = top_level(buffer.height, buffer.width, settings.coarsest)
    return refine(needs(buffer, settings, top), buffer.covered, settings)


def _upsampled(
    frame: "Frame", buffer: "GBuffer", subsplats: Subsplats, lights: "PixelLights", footprint: Array | None,
    settings: MultiresSettings,
) -> Array:
    if settings.visibility == "rays":
        values = evaluate_visible(frame.tracer, frame.scene.geometry, buffer, subsplats, lights)
    else:
        points = at_subsplats(buffer, subsplats, settings.representative)
        values = evaluate(*points, lights, settings.effective_pairs, footprint)
    rho_in_splat = "ams_rho_in_splat" in settings.as_published
    if rho_in_splat:
        values = values * buffer.albedo.reshape(3, -1)[:, subsplats.pixel]
    light = upsample(values, subsplats, buffer.covered, settings.upsampling,
                     filter_all="ams_filter_all" in settings.as_published)
    if rho_in_splat:  # the picture's albedo is multiplied in again later
        light = np.divide(light, buffer.albedo, out=np.zeros_like(light), where=buffer.albedo > 0)
    return light


def _footprints(frame: "Frame", lights: "PixelLights", settings: MultiresSettings) -> Array | None:
    """Return the area of each light: exact, or as the authors' demo has it."""
    if "ams_disc" not in settings.as_published:
        return footprints(frame, settings.lights, settings.effective_pairs)
    return demo_footprints(lights, frame.scene.lights, drawn_from_maps(frame.rsms, settings.lights))


def _doubled(frame: "Frame") -> "GBuffer":
    """Return what the camera sees at twice the width and height."""
    from refgi.rsm import gbuffer

    scene = frame.scene
    return gbuffer(scene.geometry, frame.materials, scene.camera, 2 * frame.width, 2 * frame.height, frame.dtype)


def _halved(light: Array, fine: Array, covered: Array) -> Array:
    """Return means over those of four pixels that show a surface, at pixels that do."""
    height, width = covered.shape
    four = (3, height, 2, width, 2)
    shown = fine.reshape(four[1:]).sum(axis=(1, 3))
    mean = light.reshape(four).sum(axis=(2, 4)) / np.maximum(shown, 1).astype(light.dtype)
    halved: Array = np.where(covered, mean, light.dtype.type(0))
    for i, j in zip(*np.nonzero(covered & (shown == 0)), strict=True):  # slivers: as the pixels around them
        around = np.s_[max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2]
        lit = shown[around] > 0
        if lit.any():
            halved[:, i, j] = mean[:, *around][:, lit].mean(axis=1)
    return halved

"""Real-time Indirect Illumination with Clustered Visibility (Dong, Grosch, Ritschel, Kautz and Seidel 2009)."""

from typing import TYPE_CHECKING, Any

import numpy.typing as npt

from refgi.cluster.adaptive import enough_area_lights, grouped
from refgi.cluster.clustering.rectangle import AreaLights
from refgi.cluster.lighting.blur import blur
from refgi.cluster.lighting.clustered import clustered_irradiance
from refgi.cluster.maps.shadow_maps import ShadowMaps
from refgi.cluster.reference import reference_visibility
from refgi.cluster.settings import ValSettings
from refgi.lights.selection import choose_lights, footprints, light_footprints, light_maps
from refgi.lights.settings import MapLights
from refgi.pairs.irradiance import Receivers
from refgi.pairs.loss import warn_of_clamp
from refgi.rsm import facing_normals
from refgi.stages import skip

if TYPE_CHECKING:
    from refgi.frame import Frame
    from refgi.lights import PixelLights

Array = npt.NDArray[Any]

PAIRS_IN_FULL = 1 << 30  # about a quarter of a second on two cores
PUBLISHED_BLOCK = 8  # pixels


def val(frame: "Frame", settings: ValSettings) -> Array:
    """Light every pixel by pixel lights whose visibility is that of the area light they belong to.

    Parameters
    ----------
    frame : Frame
        The scene, seen and lit.
    settings : ValSettings
        Which lights, how they are clustered and how an area light's visibility is found.

    Returns
    -------
    (3, h, w) ndarray
        Indirect irradiance, W/m^2, linear RGB.
    """
    lights = choose_lights(frame, settings.lights)  # Sec. 6, VPL generation
    areas, maps = clustered(frame, lights, settings)
    block = block_side(frame, lights, settings)
    light = lit(frame, lights, areas, maps, settings, block)  # Sec. 4 and 6
    if block == 1 or settings.blur == "none":
        skip("cluster.blur", "every pixel sums all lights" if block == 1 else "left out by the settings")
        return light
    return blur(light, surface(frame), block, settings, frame.visible_extent.diagonal)  # Sec. 6, geometry-aware blur


def lit(
    frame: "Frame", lights: "PixelLights", areas: AreaLights, maps: ShadowMaps | None, settings: ValSettings, block: int
) -> Array:
    """Light every pixel by pixel lights that are grouped already.

    Parameters
    ----------
    frame : Frame
        The scene, seen.
    lights : PixelLights
        The pixel lights.
    areas : AreaLights
        Their area lights.
    maps : ShadowMaps or None
        What each sees.
    settings : ValSettings
        How visibility is found.
    block : int
        Side of the blocks of pixels that share the lights out among themselves.

    Returns
    -------
    (3, h, w) ndarray
        Indirect irradiance, W/m^2, not blurred.
    """
    footprint = footprints(frame, settings.lights, settings.pairs)
    warn_of_clamp(surface(frame), lights, settings.pairs, footprint, "val")
    return clustered_irradiance(
        surface(frame), facing(frame), lights, areas, maps, settings, footprint=footprint,
        given=reference_visibility(frame, lights, areas, maps, settings), interleaving=block,
        rays=frame.tracer if settings.behind == "raytrace" else None)


def clustered(frame: "Frame", lights: "PixelLights", settings: ValSettings) -> tuple[AreaLights, ShadowMaps | None]:
    """Group pixel lights into as many area lights as asked for, or as an error asks for, and draw their maps.

    Parameters
    ----------
    frame : Frame
        The scene.
    lights : PixelLights
        The pixel lights.
    settings : ValSettings
        Number and kind of clusters, and of their maps.

    Returns
    -------
    AreaLights
        One for each cluster.
    ShadowMaps or None
        What each sees; None where nothing asks for it.
    """
    if settings.target_error is not None:
        chosen = enough_area_lights(frame, lights, settings, areas_of_lights(frame, settings))
        return chosen.areas, chosen.maps
    skip("cluster.adaptive", "the number of area lights is given")
    return grouped(frame, lights, settings, settings.area_lights, areas_of_lights(frame, settings))  # Sec. 5


def areas_of_lights(frame: "Frame", settings: ValSettings) -> Array | None:
    """Return the surface that each pixel light stands for, where a cluster of one light has its light's size.

    Parameters
    ----------
    frame : Frame
        The scene, lit.
    settings : ValSettings
        What the lights were chosen by.

    Returns
    -------
    (N,) ndarray or None
        Area, m^2.
    """
    if settings.single_light == "point" or not isinstance(settings.lights.source, MapLights):
        return None
    return light_footprints(light_maps(frame, settings.lights.source), settings.lights)


def block_side(frame: "Frame", lights: "PixelLights", settings: ValSettings) -> int:
    """Return the side of the blocks of pixels that share the lights out among themselves; 1: each sums all.

    Parameters
    ----------
    frame : Frame
        Says how many pixels there are.
    lights : PixelLights
        Says how many lights.
    settings : ValSettings
        May say the side.

    Returns
    -------
    int
        Pixels.
    """
    if settings.interleaving is not None:
        return settings.interleaving
    return 1 if frame.width * frame.height * lights.flux.shape[1] <= PAIRS_IN_FULL else PUBLISHED_BLOCK


def surface(frame: "Frame") -> Receivers:
    """Return the points that a frame's pixels see.

    Parameters
    ----------
    frame : Frame
        The scene, seen.

    Returns
    -------
    Receivers
        Positions and shading normals.
    """
    return Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))


def facing(frame: "Frame") -> Array:
    """Return the normals of the triangles that a frame's pixels see.

    Parameters
    ----------
    frame : Frame
        The scene, seen.

    Returns
    -------
    (3, h, w) ndarray
        Unit vectors on the side of the shading normals.
    """
    buffer = frame.gbuffer
    return facing_normals(frame.scene.geometry, buffer.triangle_id, buffer.normal)

"""Pictures by clusters that a figure made itself: warm-started ones, one alone, a light of a figure's own."""

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.cluster.lighting.clustered import clustered_irradiance
from refgi.cluster.maps.occluders import ends_of
from refgi.cluster.maps.shadow_maps import ShadowMaps, shadow_maps
from refgi.cluster.reference import reference_visibility
from refgi.cluster.settings import ValSettings
from refgi.cluster.val import face_normals
from refgi.pairs.irradiance import Receivers
from refgi.papers.val.subjects import Clustered

if TYPE_CHECKING:
    from refgi.frame import Frame

Array = npt.NDArray[Any]


def maps_of(frame: "Frame", found: Clustered, settings: ValSettings) -> ShadowMaps:
    """Draw what each area light sees.

    Parameters
    ----------
    frame : Frame
        The scene.
    found : Clustered
        Area lights.
    settings : ValSettings
        Kind of maps.

    Returns
    -------
    ShadowMaps
        One for each area light that may be occluded.
    """
    tracer = frame.tracer if settings.maps == "rays" else None
    return shadow_maps(frame.scene.geometry, found.areas, settings, frame.dtype, tracer, ends_of(frame, found.lights))


def lit(frame: "Frame", found: Clustered, settings: ValSettings, maps: ShadowMaps | None = None) -> Array:
    """Light every pixel by given lights and clusters.

    Parameters
    ----------
    frame : Frame
        The scene, seen.
    found : Clustered
        Lights and area lights.
    settings : ValSettings
        Kind of visibility.
    maps : ShadowMaps, optional
        What `maps_of` gave; drawn where absent.

    Returns
    -------
    (3, h, w) ndarray
        Irradiance of all lights at every pixel, W/m^2.
    """
    maps = maps_of(frame, found, settings) if maps is None else maps
    receivers = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))
    given = reference_visibility(frame, found.lights, found.areas, maps, settings)
    return clustered_irradiance(receivers, face_normals(frame), found.lights, found.areas, maps, settings,
                                visibility_of=given)


def alone(found: Clustered, number: int) -> Clustered:
    """Return the same lights, all dark but those of one cluster.

    Parameters
    ----------
    found : Clustered
        Lights and area lights.
    number : int
        Which one.

    Returns
    -------
    Clustered
        Its lights shine as before.
    """
    shines = found.clusters.of == number
    lights = found.lights
    glossy = {} if lights.lobe_flux is None else {"lobe_flux": lights.lobe_flux * shines}
    return found._replace(lights=lights._replace(flux=lights.flux * shines, **glossy))


def without_visibility(settings: ValSettings) -> ValSettings:
    """Return settings by which nothing is occluded.

    Parameters
    ----------
    settings : ValSettings
        Any.

    Returns
    -------
    ValSettings
        All else the same.
    """
    return dataclasses.replace(settings, visibility="none")


def strongest(found: Clustered, count: int) -> list[int]:
    """Return the clusters of the largest flux.

    Parameters
    ----------
    found : Clustered
        Lights and clusters.
    count : int
        How many.

    Returns
    -------
    list of int
        Their numbers, the strongest first.
    """
    flux = np.bincount(found.clusters.of, found.lights.flux.sum(axis=0), len(found.clusters.members))
    return [int(number) for number in np.argsort(-flux, kind="stable")[:count] if found.clusters.members[number] > 0]

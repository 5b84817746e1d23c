"""Ambient occlusion of receivers in place of indirect visibility (SII Sec. 7, AMS Sec. 5).

E' = O E, O the openness of the receiver (SII Sec. 3.5): what blocks is taken to be near, and light to arrive evenly
from all directions. Receivers' lobes, whose light comes from few directions, are left as they are.
"""

from typing import TYPE_CHECKING

from refgi.lights.settings import Openness
from refgi.stages import stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.frame import Frame


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

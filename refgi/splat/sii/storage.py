"""What the paper's textures keep of receivers and lights (SII Sec. 4, 6): half floats and 8 bits, `quantisation`.

Positions are half floats, of 11 significant bits rounded to nearest, ties to even. Directions are 8 bits a component
(4 x 8-bit textures; 24 bits a light), which store [-1, 1] as 0 .. 255, and are made unit vectors again when read. Flux
is 24 bits, of which the paper says no more: here 8 a channel, as shares of the largest of all lights and parts; less
than 1/510 of that is nothing. Exponents stay as they are, and so do the colours of receivers, which are not the sum's.
"""

from typing import TYPE_CHECKING

import numpy as np

from refgi.errors import expect
from refgi.stages import stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.lights import PixelLights
    from refgi.pairs.irradiance import Receivers
    from refgi.splat.sii.settings import SiiSettings

STEPS = 255
LARGEST_HALF = 65504.0  # m


def as_stored(
    receivers: "Receivers", lights: "PixelLights", settings: "SiiSettings"
) -> "tuple[Receivers, PixelLights]":
    """Return receivers and lights as the settings store them."""
    if settings.quantisation == "none":
        return receivers, lights
    position, normal = stored_surface(receivers.position, receivers.normal)
    return receivers._replace(position=position, normal=normal), stored_lights(lights)


@stage("sii.stored_surface")
def stored_surface(position: Array, normal: Array) -> tuple[Array, Array]:
    """Round places to half floats and normals to 8 bits a component (SII Sec. 4).

    -> position (3, h, w): Surface points, m.
    -> normal (3, h, w): Unit normals; 0 without surface.
    """
    return half_floats(position), directions(normal)


@stage("sii.stored_lights")
def stored_lights(lights: "PixelLights") -> "PixelLights":
    """Round what is read of each light to half floats and 8 bits (SII Sec. 6).

    -> PixelLights: All of them, in the same order.
    """
    position, normal = half_floats(lights.position), directions(lights.normal)
    largest = lights.flux.max(initial=0)
    if lights.lobe_flux is None or lights.lobe_axis is None:
        return lights._replace(position=position, normal=normal, flux=shares(lights.flux, largest))
    largest = max(largest, lights.lobe_flux.max(initial=0))
    return lights._replace(position=position, normal=normal, flux=shares(lights.flux, largest),
                           lobe_flux=shares(lights.lobe_flux, largest), lobe_axis=directions(lights.lobe_axis))


def half_floats(position: Array) -> Array:
    """Return the nearest half floats, in the array's own dtype."""
    expect(bool((np.abs(position) <= LARGEST_HALF).all()), "quantisation", "'none' beyond 65504 m of the origin, "
           "where half floats end", "'published'")
    return position.astype(np.float16).astype(position.dtype)


def directions(vectors: Array) -> Array:
    """Return unit vectors (3, ...) of 8 bits a component, to 0.4 degrees; 0 stays 0."""
    bits = np.floor((vectors + 1) * (STEPS / 2) + 0.5) * (2 / STEPS) - 1
    length = np.sqrt((bits**2).sum(axis=0, keepdims=True))
    found: Array = np.where(vectors.any(axis=0), bits / length, 0).astype(vectors.dtype)
    return found


def shares(flux: Array, largest: float) -> Array:
    """Return the nearest of 256 even shares of the largest flux, W."""
    if largest == 0:
        return flux
    found: Array = (np.floor(flux / largest * STEPS + 0.5) * (largest / STEPS)).astype(flux.dtype)
    return found

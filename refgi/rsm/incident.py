"""What arrives from a light through each texel of its maps, whatever is met there."""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.rsm.projection import Projection
from refgi.rsm.solid_angle import sampled_spot_share, spot_power, spot_power_at, texel_solid_angles
from refgi.scene.model import DirectionalLight, Light, SpotLight

Array = npt.NDArray[Any]


def texel_shares(
    light: Light, maps: Projection, solid_angle: Array | None = None, texel: Array | None = None
) -> Array:
    """Return how much of a light each texel of its maps takes in.

    Parameters
    ----------
    light : Light
        Whose maps.
    maps : Projection
        The maps.
    solid_angle : (H, W) ndarray, optional
        `texel_solid_angles(maps)`, where it is known.
    texel : (n,) ndarray of int, optional
        Texels of the flattened maps; all where absent.

    Returns
    -------
    (H, W) or (n,) ndarray
        What the intensity on the axis is multiplied by, sr: the solid angle, weighed by a spot's falloff. Directional:
        the area perpendicular to the light, m^2.
    """
    if isinstance(light, SpotLight):
        angles = light.inner_half_angle, light.outer_half_angle
        if maps.maps == 1:
            return spot_power(maps, *angles) if texel is None else spot_power_at(maps, *angles, texel)
    share = texel_solid_angles(maps) if solid_angle is None else solid_angle
    if isinstance(light, SpotLight):
        axis = np.asarray(light.direction) / np.linalg.norm(light.direction)
        share = share * sampled_spot_share(maps, axis, *angles)
    return share if texel is None else share.reshape(-1)[texel]


def incident_flux(
    light: Light, maps: Projection, solid_angle: Array | None, dtype: npt.DTypeLike, texel: Array | None = None
) -> Array:
    """Return the flux that arrives through each texel of a light's maps.

    Parameters
    ----------
    light : Light
        Whose maps.
    maps : Projection
        The maps.
    solid_angle : (H, W) ndarray, optional
        `texel_solid_angles(maps)`, where it is known.
    dtype : dtype
        Of the result.
    texel : (n,) ndarray of int, optional
        Texels of the flattened maps; all where absent.

    Returns
    -------
    (3, H, W) or (3, n) ndarray
        W, whatever is met.
    """
    share = texel_shares(light, maps, solid_angle, texel)
    strength = light.irradiance if isinstance(light, DirectionalLight) else light.intensity
    incident = np.empty((3, *share.shape), dtype)
    for channel, one in zip(incident, strength, strict=True):
        np.multiply(share, one, out=channel, casting="same_kind")  # in the dtype of the share, rounded once
    return incident

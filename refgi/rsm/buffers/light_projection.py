"""Shadow-map projections of a light, and the flux that arrives through each texel.

A spot gets one perspective or paraboloid map, a point light a cube or two paraboloid maps, a directional light an
orthographic map.
"""

import math
from collections.abc import Callable
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.rsm.buffers.solid_angle import sampled_spot_share, spot_power, spot_power_at, texel_solid_angles
from refgi.rsm.raster.projection import (
    Projection,
    cube_projection,
    directional_projection,
    dual_paraboloid_projection,
    paraboloid_projection,
    spot_projection,
)
from refgi.scene.model import DirectionalLight, Geometry, Light, PointLight, SpotLight
from refgi.types import Array

MapShape = Literal["auto", "perspective", "cube", "paraboloid", "orthographic"]

WIDEST_PERSPECTIVE = math.radians(75)  # beyond, texels on the axis span over 60 times the solid angle of the rim's


def light_projection(light: Light, geometry: Geometry, resolution: int, shape: MapShape = "auto") -> Projection:
    """Return the maps that enclose what a light shines on.

    `geometry`: what a directional light must enclose. `resolution`: texels along a side of one map. Raises `InputError`
    if the resolution or shape does not suit the light.
    """
    expect(isinstance(resolution, int | np.integer) and 1 <= resolution <= 16384, "resolution",
           "1 to 16384 texels", resolution)  # fmt: skip
    expect(shape in get_args(MapShape), "projection", " or ".join(get_args(MapShape)), shape)
    makers: dict[str, Callable[[], Projection]]
    if isinstance(light, DirectionalLight):
        usual = "orthographic"
        makers = {usual: lambda: directional_projection(light, geometry.bounds, resolution)}
    elif isinstance(light, PointLight):
        usual = "cube"
        makers = {
            usual: lambda: cube_projection(light.position, resolution),
            "paraboloid": lambda: dual_paraboloid_projection(light.position, resolution),
        }
    else:
        half = math.tan(light.outer_half_angle / 2)
        usual = "perspective" if light.outer_half_angle <= WIDEST_PERSPECTIVE else "paraboloid"
        flat = {"perspective": lambda: spot_projection(light, resolution)} if _has_plane(light) else {}
        makers = {
            **flat,
            "cube": lambda: cube_projection(light.position, resolution),
            "paraboloid": lambda: paraboloid_projection([light.position], [light.direction], resolution, half),
        }
    name = usual if shape == "auto" else shape
    expect(name in makers, "projection", f"one that suits {_described(light)}: {', '.join(makers)}", shape)
    return makers[name]()


def _has_plane(light: SpotLight) -> bool:
    """Return whether a plane before the spot meets all of its cone: a half-angle of 90 degrees has none."""
    return light.outer_half_angle < math.pi / 2


def _described(light: Light) -> str:
    wide = isinstance(light, SpotLight) and not _has_plane(light)
    return f"a {type(light).__name__}{' of 90 degrees' if wide else ''}"


def texel_shares(
    light: Light, maps: Projection, solid_angle: Array | None = None, texel: Array | None = None
) -> Array:
    """Return the integral of a light's falloff over each texel of its maps.

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
            return spot_power(maps, *angles, light.falloff) if texel is None else spot_power_at(
                maps, *angles, texel, light.falloff)
    share = texel_solid_angles(maps) if solid_angle is None else solid_angle
    if isinstance(light, SpotLight):
        axis = np.asarray(light.direction) / np.linalg.norm(light.direction)
        share = share * sampled_spot_share(maps, axis, *angles, light.falloff)
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

"""The maps that enclose what a light shines on."""

import math
from collections.abc import Callable
from typing import Literal, get_args

import numpy as np

from refgi.errors import expect
from refgi.rsm.projection import (
    Projection,
    cube_projection,
    directional_projection,
    dual_paraboloid_projection,
    paraboloid_projection,
    spot_projection,
)
from refgi.scene.model import DirectionalLight, Geometry, Light, PointLight, SpotLight

MapShape = Literal["auto", "perspective", "cube", "paraboloid", "orthographic"]

WIDEST_PERSPECTIVE = math.radians(75)  # beyond, texels on the axis span over 60 times the solid angle of the rim's


def light_projection(light: Light, geometry: Geometry, resolution: int, shape: MapShape = "auto") -> Projection:
    """Return the maps that enclose what a light shines on.

    Parameters
    ----------
    light : Light
        Whose view.
    geometry : Geometry
        What a directional light must enclose.
    resolution : int
        Texels along a side of one map.
    shape : str
        As in `reflective_shadow_map`.

    Returns
    -------
    Projection
        The maps.

    Raises
    ------
    InputError
        If the resolution or shape does not suit the light.
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

"""The reflective shadow map: the scene from a light, with the flux that each texel's surface reflects.

Phi_t = albedo * (integral of I over the texel's directions), W, without cosine or distance (papers.md section 0); a
directional light gives albedo * E_perp * A_perp. Glass reflects nothing here. The Phong lobe of a material leaves in
the mirror direction r = d - 2 (n . d) n of the incoming direction d, with its own flux.
"""

import math
from collections.abc import Callable
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.jit import kernel, prange
from refgi.rsm.attributes import texel_ray
from refgi.rsm.gbuffer import GBuffer
from refgi.rsm.projection import (
    Projection,
    cube_projection,
    directional_projection,
    dual_paraboloid_projection,
    paraboloid_projection,
    project,
    spot_projection,
)
from refgi.rsm.raster import rasterize
from refgi.rsm.solid_angle import sampled_spot_share, spot_power, texel_solid_angles
from refgi.scene.model import DirectionalLight, Geometry, Light, MaterialTable, PointLight, SpotLight
from refgi.stages import stage

Array = npt.NDArray[Any]
MapShape = Literal["auto", "perspective", "cube", "paraboloid", "orthographic"]

WIDEST_PERSPECTIVE = math.radians(75)  # beyond, texels on the axis span over 60 times the solid angle of the rim's


class Rsm(NamedTuple):
    """What one light sees and reflects, on H x W texels (stacked maps)."""

    light: Light
    projection: Projection
    triangle_id: Array  # (H, W) int32, -1: nothing
    depth: Array  # (H, W) m: axial, or distance on a paraboloid map; inf: nothing
    position: Array  # (3, H, W) m, world space
    normal: Array  # (3, H, W) unit vector on the lit side
    solid_angle: Array  # (H, W) sr of the whole texel; directional: perpendicular area, m^2
    flux: Array  # (3, H, W) W, reflected by the diffuse part
    covered: Array  # (H, W) bool
    lobe_flux: Array | None = None  # (3, H, W) W, reflected by the lobe; None: no material has one
    lobe_axis: Array | None = None  # (3, H, W) unit vector, mirror direction
    lobe_exponent: Array | None = None  # (H, W)

    @property
    def texels(self) -> int:
        """Number of texels, those without surface included."""
        return self.depth.size

    def project(self, position: Array) -> tuple[Array, Array, Array]:
        """Return continuous row, column and depth of points on the stacked maps, nan outside.

        Parameters
        ----------
        position : (3, ...) ndarray
            World space, m.

        Returns
        -------
        row, column, depth : (...) ndarray
            As in `refgi.rsm.projection.project`.
        """
        return project(self.projection, position)


@stage("rsm.reflective_shadow_map")
def reflective_shadow_map(
    geometry: Geometry,
    materials: MaterialTable,
    light: Light,
    resolution: int,
    dtype: npt.DTypeLike = np.float32,
    projection: MapShape = "auto",
) -> Rsm:
    """Look at the scene from a light and find what each texel reflects.

    Parameters
    ----------
    geometry : Geometry
        The triangles.
    materials : MaterialTable
        Their materials.
    light : Light
        Whose view.
    resolution : int
        Texels along a side of one map.
    dtype : dtype
        Float32 or float64.
    projection : {"auto", "perspective", "cube", "paraboloid", "orthographic"}
        Shape of the map. "auto": spot one perspective map around the cone, or one paraboloid map where the half-angle
        is over 75 degrees; point a cube; directional orthographic around the scene. "cube" suits spots too,
        "paraboloid" is one map for a spot and two for a point light.

    Returns
    -------
    Rsm
        All of its channels.

    Raises
    ------
    InputError
        If the resolution, type or shape does not suit the light.

    Notes
    -----
    A spot's falloff is integrated over each texel, not taken at its centre, so the fluxes sum to
    albedo * (integral of I) to rounding however few the texels.
    """
    expect(np.dtype(dtype) in (np.float32, np.float64), "dtype", "float32 or float64", np.dtype(dtype).name)
    maps = light_projection(light, geometry, resolution, projection)
    view = GBuffer(geometry, materials, maps, rasterize(geometry, maps), dtype)
    glossy = bool((materials.specular.any(axis=1) & (materials.ior == 0)).any())
    channels = ("depth", "position", "normal", "albedo", *(("material_id",) if glossy or materials.ior.any() else ()))
    depth, position, normal, albedo, *material = view.resolve(*channels)
    solid_angle = texel_solid_angles(maps)
    incident = incident_flux(light, maps, solid_angle, dtype)
    lobe: tuple[Array, ...] = ()
    if material:
        incident *= (materials.ior == 0)[material[0]]
        if glossy:
            lobe = _lobe(materials, maps, material[0], normal, incident * view.covered)
    incident *= albedo
    return Rsm(light, maps, view.triangle_id, depth, position, normal, solid_angle.astype(dtype), incident,
               view.covered, *lobe)  # fmt: skip


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
        makers = {
            "perspective": lambda: spot_projection(light, resolution),
            "cube": lambda: cube_projection(light.position, resolution),
            "paraboloid": lambda: paraboloid_projection([light.position], [light.direction], resolution, half),
        }
    name = usual if shape == "auto" else shape
    expect(name in makers, "projection", f"one that suits a {type(light).__name__}: {', '.join(makers)}", shape)
    return makers[name]()


def texel_shares(light: Light, maps: Projection, solid_angle: Array | None = None) -> Array:
    """Return how much of a light each texel of its maps takes in.

    Parameters
    ----------
    light : Light
        Whose maps.
    maps : Projection
        The maps.
    solid_angle : (H, W) ndarray, optional
        `texel_solid_angles(maps)`, where it is known.

    Returns
    -------
    (H, W) ndarray
        What the intensity on the axis is multiplied by, sr: the solid angle, weighed by a spot's falloff. Directional:
        the area perpendicular to the light, m^2.
    """
    if isinstance(light, SpotLight):
        cosines = math.cos(light.inner_half_angle), math.cos(light.outer_half_angle)
        if maps.maps == 1:
            return spot_power(maps, *cosines)
    share = texel_solid_angles(maps) if solid_angle is None else solid_angle
    if isinstance(light, SpotLight):
        axis = np.asarray(light.direction) / np.linalg.norm(light.direction)
        share = share * sampled_spot_share(maps, axis, *cosines)
    return share


def incident_flux(light: Light, maps: Projection, solid_angle: Array | None, dtype: npt.DTypeLike) -> Array:
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

    Returns
    -------
    (3, H, W) ndarray
        W, whatever is met.
    """
    share = texel_shares(light, maps, solid_angle)
    strength = light.irradiance if isinstance(light, DirectionalLight) else light.intensity
    incident = np.empty((3, *share.shape), dtype)
    for channel, one in zip(incident, strength, strict=True):
        np.multiply(share, one, out=channel, casting="same_kind")  # in the dtype of the share, rounded once
    return incident


def _lobe(
    materials: MaterialTable, maps: Projection, material: Array, normal: Array, incident: Array
) -> tuple[Array, Array, Array]:
    """Return flux, axis and exponent of the lobes."""
    flux = np.moveaxis(materials.specular.astype(normal.dtype)[material], -1, 0) * incident
    has_lobe: Array = np.asarray(flux.any(axis=0))
    exponent = materials.exponent.astype(normal.dtype)[material] * has_lobe
    axis = np.zeros_like(normal)
    _mirror(maps, normal, has_lobe, axis)
    return np.ascontiguousarray(flux), axis, exponent


@kernel(parallel=True)
def _mirror(maps: Projection, normal: Array, has_lobe: Array, axis: Array) -> None:
    for row in prange(has_lobe.shape[0]):
        for column in range(has_lobe.shape[1]):
            if has_lobe[row, column]:
                _, _, _, dx, dy, dz = texel_ray(maps, row, column)
                nx, ny, nz = normal[0, row, column], normal[1, row, column], normal[2, row, column]
                twice = 2.0 * (dx * nx + dy * ny + dz * nz)
                rx, ry, rz = dx - twice * nx, dy - twice * ny, dz - twice * nz
                scale = 1.0 / math.sqrt(rx * rx + ry * ry + rz * rz)
                axis[0, row, column], axis[1, row, column], axis[2, row, column] = rx * scale, ry * scale, rz * scale

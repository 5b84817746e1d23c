"""Views one step after the other: which triangle each texel sees, what it is, what flux is reflected, extents seen."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.rsm.buffers.direct import ShadowMap, SurfacePoints, looked_up
from refgi.rsm.buffers.extent import SAMPLES, Extent, bounds_of, texel_grid
from refgi.rsm.buffers.gbuffer import GBuffer
from refgi.rsm.buffers.light_projection import MapShape, light_projection
from refgi.rsm.buffers.reflective import Rsm
from refgi.rsm.raster.projection import Projection, camera_projection
from refgi.rsm.raster.visibility_buffer import Visibility, rasterize
from refgi.scene.light import Lamp, lamp_of, light_of
from refgi.scene.material import MaterialTable
from refgi.scene.model import Camera, Geometry, Light
from refgi.stages import stage
from refgi.types import Array


def _visible_triangles(geometry: Geometry, projection: Projection) -> Array:
    """Find the nearest triangle at each texel's centre (docs/rasterizer).

    projection: The view: one map, or several stacked.
    -> (h, w) int32: Nearest triangle, -1 for none.
    """
    return rasterize(geometry, projection).triangle_id


def _surface(
    geometry: Geometry, materials: MaterialTable, projection: Projection, triangle_id: Array, dtype: Any
) -> tuple[Array, Array, Array, Array]:
    """Compute what each texel sees (SII Sec. 3.1).

    -> depth (h, w): Depth along the view's axis, m; inf without surface.
    -> position (3, h, w): Surface point, m; 0 without surface.
    -> normal (3, h, w): Unit normal on the side that is seen; 0 without surface.
    -> albedo (3, h, w): Diffuse reflectance; 0 without surface.
    """
    depth, position, normal, albedo = _view(geometry, materials, projection, triangle_id, dtype).resolve(
        "depth", "position", "normal", "albedo")
    return depth, position, normal, albedo


# of the camera, and of a lamp's map
visible_triangles = stage("rsm.visible_triangles", kept=False)(_visible_triangles)
surface = stage("rsm.surface", kept=False)(_surface)
map_triangles = stage("rsm.map_triangles", kept=False, each="lamp")(_visible_triangles)
map_surface = stage("rsm.map_surface", kept=False, each="lamp")(_surface)


@stage("rsm.reflected_flux", kept=False, each="lamp")
def reflected_flux(
    geometry: Geometry, materials: MaterialTable, projection: Projection, lamp: Lamp, triangle_id: Array, dtype: Any
) -> tuple[Array, Array, Array | None, Array | None, Array | None]:
    """Compute the flux that each texel of a lamp's map reflects (SII Sec. 3.1; docs/radiometry).

    projection: The lamp's view: one map, or several stacked.
    -> solid_angle (h, w): Solid angle of the whole texel, sr; of a directional lamp its area across the light, m^2.
    -> flux (3, h, w): Flux that the diffuse part of the surface reflects, W: Phi_t = albedo int_t I dw.
    -> lobe_flux (3, h, w): Flux that the lobe reflects, W; absent without glossy materials.
    -> lobe_axis (3, h, w): Mirror direction r = d - 2 (n . d) n, a unit vector; 0 without lobe or light.
    -> lobe_exponent (h, w): Phong exponent; 0 without lobe or light.
    """
    rsm = Rsm(light_of(lamp), _view(geometry, materials, projection, triangle_id, dtype), materials)
    return rsm.solid_angle, rsm.flux, rsm.lobe_flux, rsm.lobe_axis, rsm.lobe_exponent


@stage("rsm.shadow_map", kept=False, each="lamp")
def shadow_map(
    position: Array, normal: Array, covered: Array, projection: Projection, depth: Array, map_position: Array,
    lamp: Lamp, bias: float | None, interpolated: bool,
) -> Array:
    """Test where a lamp arrives: the nearest texel's point does not lie above the receiver's plane (docs/rasterizer).

    normal (3, h, w): Unit normals of the pixels' faces.
    depth (H, W): Depth that the lamp sees, m.
    map_position (3, H, W): Points that it sees, m.
    bias: A constant bias in place of the plane's, m.
    interpolated: Whether receivers whose faces are turned away from the lamp may have normals that face it; they are in
        shadow.
    -> (h, w) bool: Whether the lamp reaches the receiver; false without surface.
    """
    seen = ShadowMap(depth, map_position, -1.0 if bias is None else bias)
    return looked_up(SurfacePoints(position, normal, covered), projection, seen, light_of(lamp), interpolated)


def _view(
    geometry: Geometry, materials: MaterialTable, projection: Projection, triangle_id: Array, dtype: Any
) -> GBuffer:
    seen = Visibility(triangle_id, (triangle_id >= 0).astype(np.float32))
    return GBuffer(geometry, materials, projection, seen, dtype)


def gbuffer_steps(
    geometry: Geometry, materials: MaterialTable, camera: Camera, width: int | None = None, height: int | None = None,
    dtype: npt.DTypeLike = np.float32,
) -> dict[str, Array]:
    """Return the channels of a camera's view, made by steps."""
    projection = camera_projection(camera, width, height)
    triangle_id = visible_triangles(geometry, projection)
    return _channels(triangle_id, *surface(geometry, materials, projection, triangle_id, np.dtype(dtype)))


def shadow_steps(
    position: Array, normal: Array, covered: Array, rsm: Rsm, bias: float | None = None, interpolated: bool = False
) -> Array:
    """Return which receivers a light reaches, made by steps."""
    depth, map_position = rsm.resolve("depth", "position")
    return shadow_map(position, normal, covered, rsm.projection, depth, map_position, lamp_of(rsm.light), bias,
                      interpolated)


def _channels(*made: Array) -> dict[str, Array]:
    return dict(zip(("triangle_id", "depth", "position", "normal", "albedo"), made, strict=True))


def map_steps(
    geometry: Geometry, materials: MaterialTable, light: Light, resolution: int, dtype: npt.DTypeLike = np.float32,
    projection: MapShape = "auto",
) -> dict[str, Array | None]:
    """Return the channels of a lamp's map, made by steps."""
    maps = light_projection(light, geometry, resolution, projection)
    triangle_id = map_triangles(geometry, maps)
    seen = _channels(triangle_id, *map_surface(geometry, materials, maps, triangle_id, np.dtype(dtype)))
    made = reflected_flux(geometry, materials, maps, lamp_of(light), seen["triangle_id"], np.dtype(dtype))
    return {**seen, **dict(zip(("solid_angle", "flux", "lobe_flux", "lobe_axis", "lobe_exponent"), made, strict=True))}


@stage("rsm.visible_extent", kept=False)
def visible_extent(position: Array, covered: Array) -> tuple[Array, Array]:
    """Bound what the camera sees (docs/methods/val).

    position (3, h, w): Surface points of pixels, m.
    -> low (3,): Least coordinates of the pixels' surface points, m.
    -> high (3,): Greatest ones, m.
    """
    low, high = bounds_of(position, covered)
    return low, high


@stage("rsm.illuminated_extent", kept=False)
def illuminated_extent(
    map_positions: tuple[Array, ...], map_fluxes: tuple[Array, ...], map_lobe_fluxes: tuple[Array | None, ...]
) -> tuple[Array, Array]:
    """Bound what reflects direct light, of all lamps, by a grid of 96 x 96 texels of each map (docs/methods/val).

    map_positions tuple of (3, h, w): Surface points of each lamp's map, m.
    map_fluxes tuple of (3, h, w): Flux that diffuse surfaces reflect, W.
    map_lobe_fluxes tuple of (3, h, w): Flux that lobes reflect, W; none where no material has one.
    -> low (3,): Least coordinates of texels with flux, m.
    -> high (3,): Greatest ones, m.
    """
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for position, flux, lobe_flux in zip(map_positions, map_fluxes, map_lobe_fluxes, strict=True):
        reflects = np.asarray(flux.any(axis=0) if lobe_flux is None else flux.any(axis=0) | lobe_flux.any(axis=0))
        texel = texel_grid(reflects, SAMPLES)
        shown = position.reshape(3, -1)[:, texel[reflects.reshape(-1)[texel]]]
        low, high = np.minimum(low, shown.min(axis=1, initial=np.inf)), np.maximum(
            high, shown.max(axis=1, initial=-np.inf))
    return low, high


def visible_steps(buffer: GBuffer) -> Extent:
    """Return the box of what a camera sees, made by steps."""
    return Extent(*visible_extent(*buffer.resolve("position", "covered")))


def illuminated_steps(rsms: Sequence[Rsm]) -> Extent:
    """Return the box of what reflects direct light, made by steps."""
    return Extent(*illuminated_extent(*(tuple(getattr(rsm, name) for rsm in rsms) for name in (
        "position", "flux", "lobe_flux"))))

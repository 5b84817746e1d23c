"""Reflective shadow maps (RSM): G-buffer of a light, with the flux that each texel's surface reflects.

Phi_t = albedo * (integral of I over the texel's directions), W, without cosine or distance (docs/radiometry); a
directional light gives albedo * E_perp * A_perp. Glass reflects nothing here. The Phong lobe of a material leaves in
the mirror direction r = d - 2 (n . d) n of the incoming direction d, with its own flux.
"""

import math
from collections.abc import Mapping
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.jit import kernel, prange
from refgi.rsm.buffers.gbuffer import MANY, GBuffer, values_at
from refgi.rsm.buffers.light_projection import MapShape, incident_flux, light_projection
from refgi.rsm.buffers.solid_angle import texel_solid_angles, texel_solid_angles_at
from refgi.rsm.buffers.surfaces import texel_ray
from refgi.rsm.pool import plane
from refgi.rsm.raster.projection import Projection, project
from refgi.rsm.raster.visibility_buffer import rasterize
from refgi.scene.model import Geometry, Light, MaterialTable
from refgi.stages import stage
from refgi.types import Array

__all__ = ["Rsm", "reflective_shadow_map"]

VIEW_CHANNELS = ("depth", "position", "normal")  # channels of the light's view
LOBE = ("lobe_flux", "lobe_axis", "lobe_exponent")
LOBE_READS = ("normal", "material_id")


class Rsm:
    """The reflective shadow map of one light, H x W texels (stacked maps); a channel is computed on first use.

    Parameters
    ----------
    light : Light
        The light source.
    view : GBuffer
        Its G-buffer.
    materials : MaterialTable
        The scene's materials.
    overrides : mapping of str to ndarray or None, optional
        Channels that replace those of the view.
    """

    def __init__(
        self, light: Light, view: GBuffer, materials: MaterialTable, overrides: Mapping[str, Array | None] | None = None
    ) -> None:
        self.light = light
        self.projection = view.projection
        self._view = view
        self._materials = materials
        self._known = dict(overrides or {})
        self._glossy = bool((materials.specular.any(axis=1) & (materials.ior == 0)).any())

    def _replace(self, **channels: Array | None) -> "Rsm":
        """Return the map with other channels."""
        return Rsm(self.light, self._view, self._materials, {**self._known, **channels})

    @property
    def triangle_id(self) -> Array:
        """Visible triangle, (H, W) int32, -1 for none."""
        return self._view.triangle_id

    @property
    def covered(self) -> Array:
        """Whether a surface is visible, (H, W) bool."""
        return self._view.covered

    @property
    def depth(self) -> Array:
        """Axial depth, or distance on a paraboloid map, (H, W), m; inf without surface."""
        return self.resolve("depth")[0]

    @property
    def position(self) -> Array:
        """Surface point, (3, H, W), world space, m."""
        return self.resolve("position")[0]

    @property
    def normal(self) -> Array:
        """Unit normal on the side of the light, (3, H, W)."""
        return self.resolve("normal")[0]

    @property
    def albedo(self) -> Array:
        """Diffuse reflectance, (3, H, W): of a texture its mean over the texel, where its filter is trilinear."""
        return self._view.albedo

    @property
    def solid_angle(self) -> Array:
        """Solid angle of the whole texel, (H, W), sr; directional: its area perpendicular to the light, m^2."""
        return self.resolve("solid_angle")[0]

    @property
    def flux(self) -> Array:
        """Flux that the diffuse part reflects, (3, H, W), W."""
        return self.resolve("flux")[0]

    @property
    def lobe_flux(self) -> Array | None:
        """Flux that the lobe reflects, (3, H, W), W; None where no material has one."""
        return self._lobe("lobe_flux")

    @property
    def lobe_axis(self) -> Array | None:
        """Mirror direction, (3, H, W) unit vectors."""
        return self._lobe("lobe_axis")

    @property
    def lobe_exponent(self) -> Array | None:
        """Phong exponent of the lobe, (H, W)."""
        return self._lobe("lobe_exponent")

    def resolve(self, *names: str) -> tuple[Array, ...]:
        """Return channels by name, in the order asked for, computing in one pass those of the view not yet known.

        Names: depth, position, normal, solid_angle, flux.
        """
        self._view.resolve(*(name for name in names if name in VIEW_CHANNELS and name not in self._known))
        return tuple(self._whole(name) for name in names)

    def recorded(self) -> dict[str, Any]:
        """Return the light and every channel by name, as logs keep them."""
        names = ("triangle_id", "covered", "depth", "position", "normal", "solid_angle", "flux", *LOBE)
        return {"light": self.light} | {name: getattr(self, name) for name in names}

    def with_channels(self, channels: Mapping[str, Any], dtype: np.dtype[Any]) -> "Rsm":
        """Return the map with other channels, by name."""
        view = self._view.with_channels({**self._view.recorded(), **{
            name: channels[name] for name in (*VIEW_CHANNELS, "triangle_id")}}, dtype)
        return Rsm(self.light, view, self._materials, {
            name: channels[name] for name in ("solid_angle", "flux", *LOBE)})

    def at(self, texel: Array, *names: str) -> tuple[Any, ...]:
        """Return channels at some texels alone, (n,) or (3, n), with the bits that they have on the whole map.

        `texel`: (n,) row * W + column; `names` as for `resolve`, and those of lobes, None where no material has one.
        What is not yet known is computed there.
        """
        absent = [name for name in names if name not in self._known]
        lobes = self._glossy and any(name in LOBE for name in absent)
        needed = dict.fromkeys([*(name for name in absent if name in VIEW_CHANNELS),
                                *(self._reflecting if "flux" in absent else ()), *(LOBE_READS if lobes else ())])
        if MANY * len(texel) > self.texels:
            self._view.resolve(*needed)
            channels = [getattr(self, name) for name in names]
            return tuple(None if channel is None else values_at(channel, texel) for channel in channels)
        surface: dict[str, Any] = dict(zip(needed, self._view.at(texel, *needed), strict=True))
        if lobes or "flux" in absent:
            incident = incident_flux(self.light, self.projection, None, self._view.dtype, texel)
            surface.update(self._lobes(texel, surface, incident) if lobes else {})
            surface["flux"] = self._flux(incident, surface) if "flux" in absent else None
        if "solid_angle" in absent:
            surface["solid_angle"] = texel_solid_angles_at(self.projection, texel).astype(self._view.dtype)
        surface |= {name: None if channel is None else values_at(channel, texel)
                    for name, channel in self._known.items() if name in names}
        return tuple(surface.get(name) for name in names)

    @cached_property
    def _incident(self) -> Array:
        """Flux that arrives through each texel, (3, H, W), W."""
        return incident_flux(self.light, self.projection, None, self._view.dtype)

    @property
    def _reflecting(self) -> tuple[str, ...]:
        """Channels of the view that the flux depends on."""
        return ("albedo", "material_id") if self._glossy or self._materials.ior.any() else ("albedo",)

    def _flux(self, incident: Array, surface: Mapping[str, Array]) -> Array:
        """Return what the diffuse part reflects of the incident flux."""
        if self._materials.ior.any():
            incident = incident * (self._materials.ior == 0)[surface["material_id"]]
        return incident * surface["albedo"]  # Phi_t = albedo I(w) solid_angle_t (SII Sec. 3.1, calibrated)

    def _whole(self, name: str) -> Array:
        if name in VIEW_CHANNELS and name not in self._known:
            return self._view.resolve(name)[0]
        if name not in self._known:
            if name == "solid_angle":
                self._known[name] = texel_solid_angles(self.projection).astype(self._view.dtype)
            else:
                surface = zip(self._reflecting, self._view.resolve(*self._reflecting), strict=True)
                self._known[name] = self._flux(self._incident, dict(surface))
        channel = self._known[name]
        assert channel is not None
        return channel

    def _lobe(self, name: str) -> Array | None:
        if name not in self._known and not self._glossy:
            return None
        if name not in self._known:
            self._view.resolve("depth", "position", *LOBE_READS)  # in one pass with what lights and shadows read next
            planes = zip(LOBE_READS, self._view.resolve(*LOBE_READS), strict=True)
            surface = {key: plane.reshape(*plane.shape[:-2], -1) for key, plane in planes}
            lobes = self._lobes(np.arange(self.texels), surface, self._incident.reshape(3, -1))
            whole = {key: lobe.reshape(*lobe.shape[:-1], *self.projection.shape) for key, lobe in lobes.items()}
            self._known = {**whole, **self._known}
        return self._known[name]

    def _lobes(self, texel: Array, surface: Mapping[str, Array], incident: Array) -> dict[str, Array]:
        """Return flux, axis and exponent of the lobes at texels (n,), by name."""
        lobe = _lobe(self._materials, self.projection, texel, surface["material_id"], surface["normal"], incident)
        return dict(zip(LOBE, lobe, strict=True))

    @property
    def texels(self) -> int:
        """Number of texels, those without surface included."""
        return self.triangle_id.size

    def project(self, position: Array) -> tuple[Array, Array, Array]:
        """Return continuous row, column and depth, (...), on the stacked maps of points, (3, ...), m; nan outside."""
        return project(self.projection, position)


@stage("rsm.reflective_shadow_map", steps="refgi.rsm.buffers.steps.map_steps")
def reflective_shadow_map(
    geometry: Geometry,
    materials: MaterialTable,
    light: Light,
    resolution: int,
    dtype: npt.DTypeLike = np.float32,
    projection: MapShape = "auto",
) -> Rsm:
    """Rasterize the scene from a light; channels of flux are computed on first use.

    resolution: Texels along a side of one map.
    projection: Shape of the map. "auto": spot one perspective map around the cone, or one paraboloid map where the
        half-angle is over 75 degrees; point a cube; directional orthographic around the scene. "cube" suits spots too,
        "paraboloid" is one map for a spot and two for a point light.
    -> Rsm: Its visibility is known, its channels are computed when asked for.

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
    return Rsm(light, GBuffer(geometry, materials, maps, rasterize(geometry, maps), dtype), materials)


class Lobes(NamedTuple):
    """Lobes of n texels."""

    flux: Array  # (3, n) W
    axis: Array  # (3, n) unit vectors, 0 without lobe
    exponent: Array  # (n,) 0 without lobe


def _lobe(
    materials: MaterialTable, maps: Projection, texel: Array, material: Array, normal: Array, incident: Array
) -> Lobes:
    """Return the lobes at texels (n,)."""
    specular = np.append(np.where(materials.ior == 0, materials.specular.T, 0.0), np.zeros((3, 1)), axis=1)
    lobes = Lobes(*(plane(shape, normal.dtype) for shape in (normal.shape, normal.shape, texel.shape)))
    _fill_lobes(maps, texel, material, normal, incident, specular.astype(normal.dtype),
                materials.exponent.astype(normal.dtype), lobes)
    return lobes


@kernel(parallel=True)
def _fill_lobes(
    maps: Projection, texel: Array, material: Array, normal: Array, incident: Array, specular: Array, exponent: Array,
    lobes: Lobes,
) -> None:
    """Fill lobes from the flux (3, n) that arrives; `specular` (3, materials + 1) is black for glass and no surface."""
    zero = normal.dtype.type(0.0)
    for i in prange(len(texel)):
        m, has_lobe = material[i], False
        for c in range(3):
            lobes.flux[c, i] = specular[c, m] * incident[c, i]
            has_lobe |= lobes.flux[c, i] != zero
        lobes.exponent[i] = exponent[m] if has_lobe else zero
        lobes.axis[0, i] = lobes.axis[1, i] = lobes.axis[2, i] = zero
        if has_lobe:
            _, _, _, dx, dy, dz = texel_ray(maps, texel[i] // maps.width, texel[i] % maps.width)
            nx, ny, nz = normal[0, i], normal[1, i], normal[2, i]
            # r = d - 2 (n . d) n
            twice = 2.0 * (dx * nx + dy * ny + dz * nz)
            rx, ry, rz = dx - twice * nx, dy - twice * ny, dz - twice * nz
            scale = 1.0 / math.sqrt(rx * rx + ry * ry + rz * rz)
            lobes.axis[0, i], lobes.axis[1, i], lobes.axis[2, i] = rx * scale, ry * scale, rz * scale

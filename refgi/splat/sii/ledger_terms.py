"""Terms of the energy ledger: what the first surface does with a light's power, and what the visible surface gets.

What a light emits has a closed form: 2 pi I (1 - (cos inner + cos outer) / 2) for a spot, whose falloff in the cosine
is even about its middle, 4 pi I for a point, and E_perp times the area of the map that encloses the scene for a
directional light, which has no power of its own. The lines are sums over the texels of its reflective shadow map, each
by itself, so that they give the closed form again only where solid angles, falloff, albedo and lobes are all right.

What pixel lights send to the visible surface: sums over pixels of irradiance times the area that a pixel sees.

The area of surface that a pixel sees turns irradiance at pixels into flux on the visible surface.
"""

import dataclasses
import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.lights.selection import footprints
from refgi.pairs.irradiance import Receivers, irradiance
from refgi.settings import replaced
from refgi.splat.sii.settings import MeshBound
from refgi.splat.sii.sii import cut_irradiance, sii

if TYPE_CHECKING:
    from refgi.frame import Frame
    from refgi.lights import PixelLights
    from refgi.rsm import GBuffer, Projection, Rsm
    from refgi.scene import Geometry, MaterialTable
    from refgi.scene.model import Light
    from refgi.splat.sii.settings import SiiSettings

Array = npt.NDArray[Any]
PRINTED_WIDENINGS = frozenset({"sii_widening", "sii_widening_unnorm"})


class LightTerms(NamedTuple):
    """Power of one light by where it goes, (3,) float64 each, W."""

    emitted: Array  # closed form
    missed: Array  # met no surface
    absorbed: Array  # by opaque surfaces: 1 - diffuse - specular reflectance
    glass: Array  # met glass that did not hand it on
    reflected: Array  # by opaque surfaces, diffusely and in lobes
    refracted: Array  # by glass, in lobes


def light_terms(rsm: "Rsm", geometry: "Geometry", materials: "MaterialTable") -> LightTerms:
    """Return what the first surface does with a light's power: sums over all texels of its map, in float64.

    Where glass refracts, `rsm` is the map that has its lobes.
    """
    strength = _strength(rsm.light)
    glass = np.asarray(materials.ior) > 0
    absorption = 1.0 - np.asarray(materials.diffuse, np.float64) - materials.specular
    met, missed = _shares(rsm, geometry, len(glass))
    refracted, reflected = _refracted_and_reflected(rsm, geometry, glass)
    return LightTerms(
        emitted=emitted_power(rsm.light, rsm.projection),
        missed=missed * strength,
        absorbed=(met[~glass] @ absorption[~glass]) * strength,
        glass=met[glass].sum() * strength - refracted,
        reflected=reflected,
        refracted=refracted,
    )


def emitted_power(light: "Light", projection: "Projection") -> Array:
    """Return the power of a light in closed form, (3,) W; a directional light's is that through its map's area."""
    from refgi.scene import DirectionalLight, SpotLight

    if isinstance(light, DirectionalLight):
        share = 4.0 * float(np.prod(projection.half))
    elif isinstance(light, SpotLight):
        # 1 - cos a = 2 sin^2(a / 2), which keeps the digits of narrow cones
        squares = (math.sin(angle / 2) ** 2 for angle in (light.inner_half_angle, light.outer_half_angle))
        share = 2.0 * math.pi * sum(squares)
    else:
        share = 4.0 * math.pi
    return share * _strength(light)


def _strength(light: "Light") -> Array:
    """Return W/sr on the axis, or W/m^2 of a directional light."""
    from refgi.scene import DirectionalLight

    return np.asarray(light.irradiance if isinstance(light, DirectionalLight) else light.intensity, np.float64)


def _shares(rsm: "Rsm", geometry: "Geometry", materials: int) -> tuple[Array, float]:
    """Return the summed shares of the texels that met each material, and of those that met nothing."""
    from refgi.rsm import texel_shares

    met, share = rsm.covered, texel_shares(rsm.light, rsm.projection)
    material = geometry.material_of_face[rsm.triangle_id[met]]
    return np.bincount(material, share[met], minlength=materials), float(share[~met].sum())


def _refracted_and_reflected(rsm: "Rsm", geometry: "Geometry", glass: Array) -> tuple[Array, Array]:
    """Return what glass and what opaque surfaces send on, W."""
    met = rsm.covered
    is_glass = np.zeros(met.shape, np.bool_)
    is_glass[met] = glass[geometry.material_of_face[rsm.triangle_id[met]]]
    fluxes = [flux for flux in (rsm.flux, rsm.lobe_flux) if flux is not None]
    through, back = (sum((flux.sum(axis=(1, 2), dtype=np.float64, where=texels) for flux in fluxes), np.zeros(3))
                     for texels in (is_glass, ~is_glass))
    return through, back


def pixel_areas(buffer: "GBuffer", geometry: "Geometry") -> Array:
    """Return the area of surface behind every pixel: solid angle times d^2 / cos.

    Parameters
    ----------
    buffer : GBuffer
        What a camera sees.
    geometry : Geometry
        The triangles that it sees.

    Returns
    -------
    (h, w) ndarray
        Area, m^2, float64; 0 where there is no surface.

    Notes
    -----
    The pixel's solid angle is exact; distance and cosine are those of its centre, so the areas add up to a face's own
    up to the pixels on its edge. The cosine is that of the triangle: a normal interpolated for shading has no area.
    """
    from refgi.rsm.buffers.solid_angle import texel_solid_angles

    areas = np.zeros(buffer.covered.shape)
    covered = buffer.covered
    corners = geometry.vertices[geometry.faces[buffer.triangle_id[covered]]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    view = buffer.position[:, covered].T - buffer.projection.origin[0]
    square = (view**2).sum(axis=1)
    facing = np.abs((normal * view).sum(axis=1))  # |n| d cos
    length = np.sqrt((normal**2).sum(axis=1) * square)
    slant = np.divide(length, facing, out=np.zeros_like(length), where=facing > 0)
    areas[covered] = texel_solid_angles(buffer.projection)[covered] * square * slant
    return areas


class ScreenTerms(NamedTuple):
    """Flux at the visible surface, (3,) float64 each, W."""

    full: Array  # from the front, within any range, without clamp and with the calibrated widening
    behind: Array  # the same on the other side of every visible surface
    arrived: Array  # in the picture
    interpolated: Array  # lost between evaluated and interpolated pixels
    cut: Array  # of pairs that the range leaves out
    clamped: Array  # removed by the clamp
    printed: Array  # removed by a widening as printed


def screen_terms(frame: "Frame", lights: "PixelLights", settings: "SiiSettings") -> ScreenTerms:
    """Return what arrives on the visible surface and what each setting keeps from it.

    Each term is a sum of its own; that of a setting not in use is 0 and costs nothing.
    """
    screen = _Screen(frame, lights, settings)
    full, none = screen.pairs(), np.zeros(3)
    printed, clamped, interpolated = none, none, none
    if settings.pairs.lobe.widening > 0 and settings.pairs.as_published & PRINTED_WIDENINGS:
        printed = full - screen.pairs(widening=True)
    if settings.pairs.clamps:
        clamped = screen.pairs(widening=True) - screen.pairs(widening=True, clamp=True)
    arrived = screen.picture()
    if settings.half_resolution:
        interpolated = screen.picture(half_resolution=False) - arrived
    cut = none if settings.reach.cut is None else screen.cut()
    return ScreenTerms(full, screen.pairs(turned=True), arrived, interpolated, cut, clamped, printed)


class _Screen:
    """The pixels of one picture, and sums over them."""

    def __init__(self, frame: "Frame", lights: "PixelLights", settings: "SiiSettings") -> None:
        self.frame, self.lights, self.settings = frame, lights, settings
        self.receivers = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))
        self.area = pixel_areas(frame.gbuffer, frame.scene.geometry)
        self.footprint = footprints(frame, settings.lights, settings.pairs)

    def pairs(self, *, turned: bool = False, clamp: bool = False, widening: bool = False) -> Array:
        """Sum all pairs within any range: with receivers turned round, with the clamp, with widenings as printed."""
        settings = dataclasses.replace(
            self.settings.pairs, clamp=self.settings.pairs.clamp if clamp else None,
            as_published=self.settings.pairs.as_published - (frozenset() if widening else PRINTED_WIDENINGS))
        receivers = self.receivers._replace(normal=-self.receivers.normal) if turned else self.receivers
        return self._flux(irradiance(receivers, self.lights, settings, self.footprint))

    def picture(self, **changes: Any) -> Array:
        """Sum the picture, or what it would be with other settings."""
        return self._flux(sii(self.frame, replaced(self.settings, changes)))

    def cut(self) -> Array:
        """Sum what the range leaves out, and what a mesh that does not enclose it leaves out besides."""
        cut = self._flux(cut_irradiance(self.receivers, self.lights, self.settings, self.footprint))
        bound = self.settings.reach.bound
        if isinstance(bound, MeshBound) and not bound.inflate:
            cut += self.picture(bound_inflate=True) - self.picture()
        return cut

    def _flux(self, values: Array) -> Array:
        return np.asarray(np.einsum("chw,hw->c", values, self.area, dtype=np.float64))

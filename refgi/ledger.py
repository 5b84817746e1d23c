"""Energy ledger: an account in watts whose lines sum to what the lights emit (REF-04), for methods with pixel lights.

Light, exact, over the texels of a light's map (`light_terms`):

    emitted = missed + absorbed + glass + reflected + refracted

Pixel lights. N draws estimate what is handed on (without T/N, `sii_no_tn`, they lose most of it), later bounces of a
walk and openness change it:

    reflected + refracted - sampling - bounced - scaled = sum of Phi_i

What they send. A light sends Phi_i above its surface, but for norms that are not calibrated (K, P as in SII Eq. 3):
with `sii_no_pi` pi Phi_i, with `lobe_norm` "full_lobe" K Phi_i and (1 - K) Phi_i into its own surface, with "none"
2 pi / (P + 1) of both:

    sum of Phi_i = sent + into its own surface + printed

What meets the visible surface, as a sum over pixels: irradiance times A, the area that the pixel sees. With no limit on
range, no clamp and no shadow that is `full`, and `full` with all receivers turned round is what meets their other
terms. What is left of `sent` meets no visible pixel:

    sent = full + (behind - into its own surface) + off_screen

    full = arrived + clamped + what the method loses: cut, shadowed, interpolated, darkened

`arrived` is of the picture itself. The first equation is a check, and so is the last for `sii`, which sums the pairs
that its range leaves out by a kernel of their own; `Ledger.difference` is what both are off by. The losses of
`multires` and `val` are differences of pictures on the way and add up by construction. `off_screen` is negative where
light is counted on several surfaces one behind the other, and where a pixel light lies nearer to a surface than a pixel
is wide: a sum over pixel centres is no integral there.

All lines say where power went; `sampling`, `bounced`, `scaled`, `printed`, `interpolated`, `clamped` and, with the
stochastic range, `cut` are signed, below 0 where power was added. The cut of the stochastic range has the mean 0.
"""

import dataclasses
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from refgi.lights.selection import choose_lights, light_maps
from refgi.lights.settings import MapLights, PathLights
from refgi.pairs.irradiance import Receivers, irradiance
from refgi.radiometry import lobe_fraction
from refgi.settings import replaced
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.frame import Frame
    from refgi.lights import PixelLights
    from refgi.lights.settings import LightSettings
    from refgi.pairs.settings import PairSettings
    from refgi.rsm import GBuffer, Projection, Rsm
    from refgi.scene import Geometry, MaterialTable
    from refgi.scene.model import Light

__all__ = ["Ledger", "Row", "account", "pixel_areas"]


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
    absorbed = met[~glass] @ absorption[~glass]
    if materials.textures is not None or geometry.colours is not None:
        absorbed = _absorbed_by_texels(rsm, geometry, materials)
    refracted, reflected = _refracted_and_reflected(rsm, geometry, glass)
    return LightTerms(
        emitted=emitted_power(rsm.light, rsm.projection),
        missed=missed * strength,
        absorbed=absorbed * strength,
        glass=met[glass].sum() * strength - refracted,
        reflected=reflected,
        refracted=refracted,
    )


def emitted_power(light: "Light", projection: "Projection") -> Array:
    """Return the power of a light in closed form, (3,) W; a directional light's is that through its map's area."""
    from refgi.scene import DirectionalLight, SpotLight
    from refgi.scene.light import MEANS

    if isinstance(light, DirectionalLight):
        share = 4.0 * float(np.prod(projection.half))
    elif isinstance(light, SpotLight):
        # 1 - cos a = 2 sin^2(a / 2), which keeps the digits of narrow cones
        inner, outer = (2.0 * math.sin(angle / 2) ** 2 for angle in (light.inner_half_angle, light.outer_half_angle))
        share = 2.0 * math.pi * (inner + MEANS[light.falloff] * (outer - inner))
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


def _absorbed_by_texels(rsm: "Rsm", geometry: "Geometry", materials: "MaterialTable") -> Array:
    """Return what opaque surfaces absorb of a light's share of power, (3,), where reflectances vary over a surface."""
    from refgi.rsm import texel_shares

    met, share = rsm.covered, texel_shares(rsm.light, rsm.projection)
    material = geometry.material_of_face[rsm.triangle_id[met]]
    opaque = np.asarray(materials.ior)[material] == 0
    reflectance = rsm.albedo[:, met].astype(np.float64) + np.asarray(materials.specular, np.float64)[material].T
    return np.asarray(((1.0 - reflectance) * (share[met] * opaque)).sum(axis=1))


def _refracted_and_reflected(rsm: "Rsm", geometry: "Geometry", glass: Array) -> tuple[Array, Array]:
    """Return what glass and what opaque surfaces send on, W."""
    met = rsm.covered
    is_glass = np.zeros(met.shape, np.bool_)
    is_glass[met] = glass[geometry.material_of_face[rsm.triangle_id[met]]]
    fluxes = [flux for flux in (rsm.flux, rsm.lobe_flux) if flux is not None]
    through, back = (sum((flux.sum(axis=(1, 2), dtype=np.float64, where=texels) for flux in fluxes), np.zeros(3))
                     for texels in (is_glass, ~is_glass))
    return through, back


PRINTED_WIDENINGS = frozenset({"sii_widening", "sii_widening_unnorm"})
MEANING = {
    "emitted": "by all lights", "missed": "met no surface", "absorbed": "by the first surface",
    "glass": "met glass that did not hand it on", "reflected": "handed on by the first surface",
    "refracted": "handed on by glass", "sampling": "lost by drawing pixel lights",
    "bounced": "sent again by later bounces", "scaled": "removed by openness", "lights": "flux of the pixel lights",
    "printed": "left out by norms as printed", "arrived": "on visible surfaces",
    "interpolated": "lost between what is evaluated and pixels", "cut": "out of range",
    "clamped": "removed by the clamp", "shadowed": "blocked", "darkened": "removed for surface detail",
    "behind": "behind a light's or a visible surface", "off_screen": "met no visible surface, less what met several",
}
SUBTOTALS = ("reflected", "refracted", "lights")


class Row(NamedTuple):
    """One row of a ledger as it is shown."""

    name: str
    watts: Array  # (3,)
    meaning: str
    is_part: bool  # of the sum; else the whole, or a subtotal on the way


@dataclasses.dataclass(frozen=True)
class Ledger:
    """The account: (3,) float64 each, W, in the order in which light takes its way; `MEANING` says what each is.

    `emitted` is the whole; `reflected`, `refracted` and `lights` are subtotals on the way; all others are its parts.
    Losses that a method does not know are None.
    """

    emitted: Array
    missed: Array
    absorbed: Array
    glass: Array
    reflected: Array
    refracted: Array
    sampling: Array
    bounced: Array
    scaled: Array
    lights: Array
    printed: Array
    arrived: Array
    clamped: Array
    behind: Array
    off_screen: Array
    cut: Array | None = None
    shadowed: Array | None = None
    interpolated: Array | None = None
    darkened: Array | None = None

    @property
    def rows(self) -> list[Row]:
        """All rows, in order."""
        return [Row(name, getattr(self, name), meaning, name not in ("emitted", *SUBTOTALS))
                for name, meaning in MEANING.items() if getattr(self, name) is not None]

    @property
    def difference(self) -> Array:
        """`emitted` less the sum of its parts: what the account is off by, (3,) W."""
        return np.asarray(self.emitted - sum(row.watts for row in self.rows if row.is_part))


def account(
    frame: "Frame", light_settings: "LightSettings", pairs: "PairSettings", footprint: Array | None, picture: Array,
    losses: Mapping[str, Array | None],
) -> Ledger:
    """Account for the power of the lights under a method with pixel lights.

    Parameters
    ----------
    frame : Frame
        The scene and its buffers.
    light_settings : LightSettings
        Which pixel lights the method has.
    pairs : PairSettings
        How one lights one receiver.
    footprint : (N,) ndarray or None
        Surface area of each light, m^2, where the clamp needs it.
    picture : (3, h, w) ndarray
        The method's irradiance, W/m^2.
    losses : mapping
        What the method loses on the way from every unshadowed pair to its picture, by the line's name: irradiance
        (3, h, w), W/m^2, or None for 0.

    Returns
    -------
    Ledger
        Its lines sum to `emitted` but for the rounding of the frame's dtype.

    Notes
    -----
    Lines after `sampling` are as good as the sum over pixels is as an integral over the visible surface.
    """
    terms = _light_terms(frame, light_settings)
    first, drawn, lights = _pixel_lights(frame, light_settings)
    flux = _flux(lights)
    sent, inwards, printed = _sent(lights, pairs)
    screen = _Screen(frame, lights, pairs, footprint)
    full, behind, none = screen.pairs(), screen.pairs(turned=True), np.zeros(3)
    clamped = none
    if pairs.lobe.widening > 0 and pairs.as_published & PRINTED_WIDENINGS:
        printed = printed + full - screen.pairs(widening=True)
    if pairs.clamps:
        clamped = screen.pairs(widening=True) - screen.pairs(widening=True, clamp=True)
    return Ledger(
        *terms[:4], reflected=terms.reflected, refracted=terms.refracted,
        sampling=terms.reflected + terms.refracted - first, bounced=first - drawn, scaled=drawn - flux, lights=flux,
        printed=printed, arrived=screen.flux(picture), clamped=clamped, behind=inwards + behind,
        off_screen=sent - full - behind,
        **{name: none if lost is None else screen.flux(lost) for name, lost in losses.items()})


def _light_terms(frame: "Frame", settings: "LightSettings") -> LightTerms:
    """Return the account of all lights together."""
    source = settings.source
    maps = light_maps(frame, source) if isinstance(source, MapLights) else frame.rsms
    terms = [light_terms(rsm, frame.scene.geometry, frame.senders) for rsm in maps]
    return LightTerms(*(sum(line, np.zeros(3)) for line in zip(*terms, strict=True)))


def _pixel_lights(frame: "Frame", settings: "LightSettings") -> "tuple[Array, Array, PixelLights]":
    """Return the flux of the first bounce and of all bounces before openness, W, and a method's lights."""
    lights = choose_lights(frame, settings)
    drawn, whole = _flux(lights), replaced(settings, {"openness.flux": "none"})
    if settings.openness.flux != "none":
        drawn = _flux(choose_lights(frame, whole))
    if not isinstance(settings.source, PathLights) or settings.source.bounces == 1:
        return drawn, drawn, lights
    once = replaced(whole, {"source.bounces": 1})
    return _flux(choose_lights(frame, once)), drawn, lights


def _flux(lights: "PixelLights") -> Array:
    parts = (part for part in (lights.flux, lights.lobe_flux) if part is not None)
    return sum((part.sum(axis=1, dtype=np.float64) for part in parts), np.zeros(3))


def _sent(lights: "PixelLights", pairs: "PairSettings") -> tuple[Array, Array, Array]:
    """Return what lights send above their surface and into it, and what printed norms leave out, W."""
    diffuse = lights.flux.sum(axis=1, dtype=np.float64)
    scale = math.pi if "sii_no_pi" in pairs.as_published else 1.0
    sent, inwards, printed = scale * diffuse, np.zeros(3), (1.0 - scale) * diffuse
    if lights.lobe_flux is not None:
        lobe, whole, above = np.asarray(lights.lobe_flux, np.float64), *_lobe_shares(lights, pairs)
        sent += lobe @ above
        inwards += lobe @ (whole - above)
        printed += lobe @ (1.0 - whole)
    return sent, inwards, printed


def _lobe_shares(lights: "PixelLights", pairs: "PairSettings") -> tuple[Array, Array]:
    """Return the integral of each lobe of unit flux over all directions and over those above the surface, (N,)."""
    count = lights.flux.shape[1]
    if pairs.lobe.norm == "clamped" or lights.lobe_axis is None or lights.lobe_exponent is None:
        return np.ones(count), np.ones(count)  # what lies below the surface is never sent
    cosine = np.asarray((lights.normal * lights.lobe_axis).sum(axis=0), np.float64)
    exponent = np.asarray(lights.lobe_exponent, np.float64)
    above = np.array([lobe_fraction(c, p) for c, p in zip(cosine, exponent, strict=True)])
    whole = np.ones(count) if pairs.lobe.norm == "full_lobe" else 2.0 * math.pi / (exponent + 1.0)
    return whole, above * whole


class _Screen:
    """The pixels of one picture, and sums of pairs over them."""

    def __init__(
        self, frame: "Frame", lights: "PixelLights", settings: "PairSettings", footprint: Array | None
    ) -> None:
        self.lights, self.settings, self.footprint = lights, settings, footprint
        self.receivers = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))
        self.area = pixel_areas(frame.gbuffer, frame.scene.geometry)

    def pairs(self, *, turned: bool = False, clamp: bool = False, widening: bool = False) -> Array:
        """Sum all pairs within any range: with receivers turned round, with the clamp, with widenings as printed."""
        settings = dataclasses.replace(
            self.settings, clamp=self.settings.clamp if clamp else None,
            as_published=self.settings.as_published - (frozenset() if widening else PRINTED_WIDENINGS))
        receivers = self.receivers._replace(normal=-self.receivers.normal) if turned else self.receivers
        return self.flux(irradiance(receivers, self.lights, settings, self.footprint))

    def flux(self, values: Array) -> Array:
        """Return irradiance times the area that each pixel sees, (3,) W."""
        return np.asarray(np.einsum("chw,hw->c", values, self.area, dtype=np.float64))


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

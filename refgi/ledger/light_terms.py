"""Terms of the energy ledger on the lights' side: what the first surface does with a light's power.

What a light emits has a closed form: 2 pi I (1 - cos inner + m (cos inner - cos outer)) for a spot, whose falloff is m
in the mean over the cosine, 4 pi I for a point, and E_perp times the area of the map that encloses the scene for a
directional light, which has no power of its own. The lines are sums over the texels of its reflective shadow map, each
by itself, so that they give the closed form again only where solid angles, falloff, albedo and lobes are all right.
"""

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from refgi.types import Array

if TYPE_CHECKING:
    from refgi.rsm import Projection, Rsm
    from refgi.scene import Geometry, MaterialTable
    from refgi.scene.model import Light


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

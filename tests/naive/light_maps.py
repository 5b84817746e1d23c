"""Slow literal twin of the maps that pixel lights are taken from: glass, equal solid angles, the surface of a texel."""

import dataclasses
from functools import cached_property
from typing import Any

import numpy as np

from tests.naive.glass import direction_of, exit_of

STEEPEST = 1e-3  # least cosine between light and normal of an area


@dataclasses.dataclass
class LightMap:
    """The reflective shadow map of one lamp: a row a texel, square maps stacked below each other."""

    lamp: Any
    width: int
    position: Any  # (T, 3) m
    normal: Any  # (T, 3) unit
    flux: Any  # (T, 3) W, diffuse
    lobe_flux: Any  # (T, 3) W; 0 without a lobe
    lobe_axis: Any  # (T, 3) unit
    lobe_exponent: Any  # (T,)
    solid_angle: Any  # (T,) sr, or m^2 across a directional light

    @property
    def texels(self):
        """T, those without surface included."""
        return len(self.position)

    @property
    def height(self):
        """Rows of all stacked maps."""
        return self.texels // self.width

    @property
    def stacked(self):
        """How many maps: 6 of a point light."""
        return self.height // self.width

    @cached_property
    def area(self):
        """Surface behind each texel that reflects anything: Omega d^2 / cos, directional Omega / cos; (T,) m^2."""
        areas = np.zeros(self.texels)
        for texel in np.flatnonzero(self.flux.any(axis=1) | self.lobe_flux.any(axis=1)):
            cosine = abs(self.normal[texel] @ direction_of(self.lamp, self.position[texel]))
            away = self.position[texel] - getattr(self.lamp, "position", 0.0)
            square = away @ away if hasattr(self.lamp, "position") else 1.0
            areas[texel] = self.solid_angle[texel] * square / max(cosine, STEEPEST)
        return areas


def maps_of(frame, arriving, source):
    """Return the maps of a frame as the source of lights has them; `arriving` as (3, H, W) W each."""
    maps = []
    for rsm, incident in zip(frame.rsms, (rows(plane) for plane in arriving), strict=True):
        here = raw(rsm)
        if source.refraction is not None:
            send_through_glass(here, frame.scene, rsm.triangle_id.ravel(), incident, source.refraction)
        if "equal_solid_angle" in source.as_published:
            equalise(here, incident)
        maps.append(here)
    return maps


def rows(plane):
    """Return a plane (3, H, W) as a row a texel."""
    return np.array(plane).reshape(3, -1).T


def raw(rsm):
    """Return a map of a frame as it is."""
    dark = np.zeros_like(rsm.flux)
    lobe_flux, lobe_axis, lobe_exponent = (
        (dark, dark, dark[0]) if rsm.lobe_flux is None else (rsm.lobe_flux, rsm.lobe_axis, rsm.lobe_exponent))
    return LightMap(rsm.light, rsm.flux.shape[2], rows(rsm.position), rows(rsm.normal), rows(rsm.flux),
                    rows(lobe_flux), rows(lobe_axis), np.array(lobe_exponent).ravel(), rsm.solid_angle.ravel().copy())


def send_through_glass(here, scene, triangle, incident, refraction):
    """Let glass texels send what arrives on from where it leaves, in a lobe."""
    for texel in np.flatnonzero(triangle >= 0):
        if not scene.materials[scene.geometry.material_of_face[triangle[texel]]].ior:
            continue
        found = exit_of(scene, here.lamp, here.position[texel], refraction.name())
        if found is not None and found[3] > 0:
            here.position[texel], here.normal[texel], here.lobe_axis[texel], share = found
            here.lobe_flux[texel], here.lobe_exponent[texel] = share * incident[texel], refraction.exponent


def equalise(here, incident):
    """As printed: all texels that light falls on subtend the same solid angle, together what they did."""
    reached = incident.any(axis=1)
    mean = here.solid_angle[reached].mean()
    factor = mean / here.solid_angle[reached][:, None]
    here.flux[reached] *= factor
    here.lobe_flux[reached] *= factor
    here.solid_angle[reached] = mean

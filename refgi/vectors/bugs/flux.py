"""Flux that a map's texels reflect, as a port finds it, and as it gets it wrong (SII Sec. 3.1; docs/radiometry)."""

from typing import Any

import numpy as np

from refgi.rsm.raster.projection import ORTHOGRAPHIC, PARABOLOID, Projection
from refgi.scene import SpotLight
from refgi.scene.model import Light
from refgi.vectors.bugs.falloffs import CONE, falloffs_of
from refgi.vectors.bugs.flux_form import EVERY, literal_flux
from refgi.vectors.bugs.views import CENTRES, CUBE, ViewChange, view_changes, view_of
from refgi.vectors.spec import Arrays, Bug, Run

PHI, MIRROR = "Phi_t = albedo I(w) Omega_t, calibrated: no cosine, no distance", "r = d - 2 (n . d) n"
OWN, ANGLE = "reflectance of the triangle's material", "solid angle: density cos^3 on the image plane"
BLIND = "extent", "origin", "face's down"  # what no mirror direction tells
LAST, FIRST = slice(-1, None), slice(0, 1)


def flux_family(name: str, lamp: str, light: Light, maps: Projection, glossy: bool) -> tuple[Bug, ...]:
    """Return likely bugs of a map's flux: measure of texels, falloff, materials, lobes."""
    if maps.kind == PARABOLOID:
        return ()

    def literal(change: ViewChange | None = None, **bugs: Any) -> Run:
        def altered(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001 in float64
            seen = view_of(arrays, name, maps)
            made = literal_flux(arrays, name, (lamp, light), change(seen) if change else seen, **bugs)
            return {f"{name}.{key}": one for key, one in made.items() if glossy or not key.startswith("lobe")}

        return altered

    found = [
        Bug("all triangles have the first material", literal(paint="first"), OWN),
        Bug("all triangles have the last material", literal(paint="last"), OWN),
        Bug("the triangle's number picks the material", literal(paint="triangle"), OWN),
        Bug("materials are one off: each triangle has the next one's", literal(paint="next"), OWN),
        Bug("texels without a surface reflect as the last triangle does: background with id -1", literal(holes=True),
            "0 without surface"),
        Bug("flux leaves out the reflectance of the diffuse part: incident flux", literal(table="white"), PHI),
        Bug("the cosine at the surface counts: irradiance and not flux", literal(times="cosine"), PHI),
        Bug("flux is divided by the squared distance", literal(times="distance"), PHI),
        Bug("flux is multiplied by the cosine over the squared distance: irradiance at the surface",
            literal(times="both"), PHI),
        Bug("the first channel of the lamp's strength for all: red", literal(strength="red"), "linear RGB"),
        Bug("channels of the lamp's strength are in reverse order: bgr", literal(strength="reverse"), "linear RGB"),
        Bug("all channels have the mean of the lamp's strength", literal(strength="grey"), "linear RGB"),
    ]
    found += _parallel(literal) if maps.kind == ORTHOGRAPHIC else _perspective(literal, light)
    if glossy:
        found += [Bug("diffuse and specular reflectance are exchanged", literal(table="exchanged"), OWN),
                  Bug("the diffuse part reflects the sum of both reflectances", literal(table="sum"), OWN),
                  *_lobes(literal)]
        found += [Bug(cause, literal(change), paper) for cause, change, paper in view_changes(maps)
                  if not any(word in cause for word in BLIND)]
    if maps.maps > 1:
        found += [Bug("the row counts on over all faces of a cube in place of within one: rows of one map",
                      literal(modulo=False), "rows of one map"),
                  Bug("only the first map of a cube has flux", literal(maps=1), "all faces"),
                  *(Bug(f"axes of lobes by the {which}", literal(lobe_frame=change), CUBE) for which, change in (
                      ("frame of a cube's first face: the first map's rays", lambda v: v._replace(
                          frame=np.broadcast_to(v.frame[:1], v.frame.shape))),) if glossy)]
    return tuple(found)


def _parallel(literal: Any) -> list[Bug]:
    paper = "area perpendicular to the light"
    return [
        Bug("a directional light's flux leaves out the texel's area: 1 in place of its size", literal(area="one"),
            paper),
        Bug("the area of a directional light's flux alone is left out", literal(area="flux"), paper),
        Bug("a directional light's texels have the area of the whole map", literal(area="whole"), paper),
        Bug("a texel's area from half extents that are not doubled: a quarter of it", literal(area="quarter"), paper),
        Bug("a directional light's texel has the solid angle of a perspective one", literal(area="angle"), paper),
        Bug("the width of a texel in place of its area", literal(area="width"), paper),
    ]


def _perspective(literal: Any, spot: Light) -> list[Bug]:
    found = [
        Bug("the area on the image plane in place of the solid angle", literal(angle=0.0), ANGLE),
        *(Bug(f"the solid angle is area times cos^{power} at the texel's centre", literal(angle=float(power)), ANGLE)
          for power in (1, 2, 3, 4)),
        Bug("the first texel's solid angle for all", literal(angle=-1.0), ANGLE),
        Bug("image coordinates of texels run from 0 and not from the centre", literal(corner=True), ANGLE)]
    if not isinstance(spot, SpotLight):
        return found
    found += [Bug(f"the falloff's integral has density cos^{power} of solid angle in place of cos^3",
                  literal(power=float(power)), ANGLE) for power in (1, 2, 4, 5)]
    return [*found, *(Bug(cause, literal(falloff=one), CONE) for cause, one in falloffs_of([spot]).items()),
        Bug("the area on the image plane in place of the solid angle, in the falloff's integral alone",
            literal(power=0.0), ANGLE),
        Bug("the area on the image plane in place of the solid angle, in the falloff's integral too",
            literal(power=0.0, angle=0.0), ANGLE),
        Bug("inner and outer half-angle of the cone are exchanged", literal(angles=(1, 0)), CONE),
        Bug("the outer half-angle for both: the cone's edge is hard", literal(angles=(1, 1)), CONE),
        Bug("the inner half-angle for both: no light between inner and outer cone", literal(angles=(0, 0)), CONE),
        Bug("whole angles in place of half-angles: the cone is half as wide", literal(widened=0.5), "half-angles"),
        Bug("the inner half-angle is left out: light falls off from the axis on", literal(angles=(None, 1)), CONE),
        Bug("the falloff is taken at the texel's centre and not integrated", literal(sample=True), "the integral of I"),
        Bug("the integral over a texel is that of its last piece: overwritten, not accumulated", literal(pieces=(
            LAST, EVERY)), "all pieces"),
        Bug("the integral over a texel is that of its first piece: the others are not added", literal(pieces=(
            FIRST, EVERY)), "all pieces"),
        Bug("the integral along a column is that of its last piece: overwritten, not accumulated", literal(pieces=(
            EVERY, LAST)), "all pieces"),
        Bug("the intensity is divided by the cone's solid angle 2 pi (1 - cos o): taken for the spot's power",
            literal(strength="cone"), "radiant intensity on the axis"),
    ]


def _lobes(literal: Any) -> list[Bug]:
    ways = {
        "lobes are around the direction from the light: not mirrored": "d",
        "lobes are around the direction to the light: retroreflection": "-d",
        "lobes are around the surface's normal": "n",
        "the mirror direction leaves out the factor 2: d - (n . d) n, along the surface": "d - n",
        "the mirror direction has the wrong sign: d + 2 (n . d) n": "d + 2n",
        "the half vector of light and normal in place of the mirror direction": "half",
    }
    return [
        *(Bug(cause, literal(mirror=how), MIRROR) for cause, how in ways.items()),
        Bug("the direction that lobes mirror is the map's forward axis for all texels", literal(lobe_axis=True),
            MIRROR),
        *(Bug(f"lobes: {cause}", literal(lobe_centre=centre), MIRROR) for cause, centre in CENTRES.items()),
        Bug("lobes are there where the material has none: axis and exponent everywhere", literal(everywhere=True),
            "0 without a lobe"),
        Bug("lobes have the diffuse reflectance", literal(table="diffuse lobes"), OWN),
        Bug("the lobe's exponent is the first material's for all", literal(exponent="first"), "own exponent"),
        Bug("the flux of a lobe holds its norm (P + 1) / 2 pi already", literal(norm=1), "flux is W"),
        Bug("the flux of a lobe holds the norm (P + 2) / 2 pi", literal(norm=2), "flux is W"),
        Bug("the flux of a lobe is divided by pi", literal(norm=0), "flux is W"),
    ]

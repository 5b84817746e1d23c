"""Settings of `sii`: pixel lights, the pair term, and how far each light reaches (SII Sec. 3.4 and appendix).

A pair of light and receiver counts where B = I_0 cos^n / r^2 is at least I_low, one irradiance for all lights.
"""

import dataclasses
from typing import ClassVar, Literal

from refgi.errors import expect
from refgi.jit import most_threads
from refgi.lights.settings import (
    OCCLUSION,
    LightSettings,
    MapLights,
    Openness,
    clamped_pairs,
    expect_footprints,
    most_lights,
)
from refgi.method import Extent
from refgi.pairs.lightcuts.tree import tree_bytes
from refgi.pairs.settings import (
    LEAST_LIGHTS,
    AutoLightcuts,
    GeometryClamp,
    Lightcuts,
    PairSettings,
    SphereClamp,
)
from refgi.scene.values import LARGEST
from refgi.settings import LAST_SEED, Settings, setting


@dataclasses.dataclass(frozen=True)
class RelativeCut(Settings):
    """I_low is a share of the largest peak intensity I_0 over the square of a reference length (the paper's: 0.05)."""

    NAME = "relative"
    SWITCHES: ClassVar[frozenset[str]] = frozenset({"per_light_ilow"})

    share: float = setting(0.05, "share of the largest peak intensity", above=0.0, most=LARGEST)
    reference_length: float | None = setting(
        None, "length of the share; none: under which 0.05 leaves the paper's share of the pairs", least=1 / LARGEST,
        most=LARGEST, unit="m")
    as_published: frozenset[str] = setting(frozenset(), "forms of the cut to use as printed", study=True)


@dataclasses.dataclass(frozen=True)
class AbsoluteCut(Settings):
    """I_low is given in W/m^2."""

    NAME = "absolute"

    irradiance: float | None = setting(None, "irradiance under which pairs are cut; must be given", above=0.0,
                                       unit="W/m^2")


@dataclasses.dataclass(frozen=True)
class FullBound(Settings):
    """Every pixel is tested."""

    NAME = "full"


@dataclasses.dataclass(frozen=True)
class QuadBound(Settings):
    """The screen rectangle of the sphere of radius R_0 (SII Sec. 3.2)."""

    NAME = "quad"


@dataclasses.dataclass(frozen=True)
class EllipsoidBound(Settings):
    """The ellipsoid of the appendix (SII Eq. 8)."""

    NAME = "ellipsoid"


@dataclasses.dataclass(frozen=True)
class TangentBound(Settings):
    """The ellipsoid through the light that touches its region: the least waste."""

    NAME = "tangent"


@dataclasses.dataclass(frozen=True)
class MeshBound(Settings):
    """The ellipsoid of the appendix as a mesh of triangles, drawn by the rasterizer (SII Sec. 4)."""

    NAME = "mesh"

    faces: Literal[8, 20, 80, 320, 1280] = setting(80, "triangles of the mesh", study=True)
    inflate: bool = setting(True, "the mesh encloses its ellipsoid; else pixels at its rim are lost", study=True)


@dataclasses.dataclass(frozen=True)
class ReachSettings(Settings):
    """How far a pixel light reaches (SII Sec. 3.4 and appendix)."""

    cut: RelativeCut | AbsoluteCut | None = setting(None, "threshold under which pairs are left out")
    bound: TangentBound | EllipsoidBound | QuadBound | MeshBound | FullBound = setting(
        TangentBound(), "geometry that finds candidate pixels; changes no bit of the picture", study=True)
    stochastic: bool = setting(False, "cut at a random share of I_low and weight what is left: no bias", study=True)
    seed: int = setting(0, "of the random shares", least=0, most=LAST_SEED, study=True)

    def check(self) -> None:
        """Check that an absolute cut has its threshold."""
        if isinstance(self.cut, AbsoluteCut):
            expect(self.cut.irradiance is not None, "cut.irradiance", "a number > 0 for the cut 'absolute', W/m^2",
                   None)

    @property
    def on_screen(self) -> bool:
        """Whether the bound is one on the screen, not in space."""
        return isinstance(self.bound, QuadBound | MeshBound)


@dataclasses.dataclass(frozen=True)
class SiiSettings(Settings):
    """Settings of `sii`; by default nothing is cut, and every light reaches every pixel.

    The sum of all lights takes at most 1.7 times as long as the paper's cut of 5 % (Fig. 12), which removes up to a
    third of the light. `pairs.clamp` "auto" is the form factor of the disc that a light stands for, where lights have
    footprints.
    """

    lights: LightSettings = setting(LightSettings(), "pixel lights")
    pairs: PairSettings = setting(PairSettings(), "how one light lights one receiver")
    reach: ReachSettings = setting(ReachSettings(), "how far a light reaches")
    half_resolution: bool = setting(False, "evaluate one pixel of 2 x 2 and upsample by a joint bilateral filter")
    lightcuts: AutoLightcuts | Lightcuts | None = setting(
        AutoLightcuts(), "diffuse lights are summed by clusters, to an error; auto: where that pays")
    quantisation: Literal["none", "published"] = setting(
        "none", "half floats and 8 bits of the published textures of lights and receivers", study=True)
    compensation: Literal["none", "screen"] = setting(
        "none", "what the clamp 'geometry' takes is given back by pixels nearby (Novak et al. 2011)", study=True)
    ambient_occlusion: Openness | None = setting(None, OCCLUSION)

    def check(self) -> None:
        """Check what fields ask of each other."""
        expect_footprints(self.lights, self.pairs)
        bounded = isinstance(self.lightcuts, Lightcuts)
        expect(not bounded or self.reach.cut is None, "reach.cut", "none with lightcuts", self.reach.cut
               and self.reach.cut.name())
        expect(not bounded or not isinstance(self.pairs.clamp, SphereClamp), "pairs.clamp",
               "another one with lightcuts, which bound no spheres", "sphere")
        expect(self.compensation == "none" or isinstance(self.pairs.clamp, GeometryClamp), "compensation",
               "none without the clamp 'geometry'", self.compensation)
        expect(not (self.half_resolution and self.reach.on_screen), "reach.bound",
               "one in space, not on the screen, at half resolution", self.reach.bound.name())

    @property
    def traces_rays(self) -> bool:
        """Whether the method traces rays."""
        return self.lights.traces_rays or self.ambient_occlusion is not None

    @property
    def effective_pairs(self) -> PairSettings:
        """The pairs in use: the clamp "auto" is "disc", and none where lights have no footprints."""
        return clamped_pairs(self.lights, self.pairs)


def extra_bytes(settings: SiiSettings, extent: Extent) -> int:
    """Estimate the bytes that lightcuts add to a picture, rather too many than too few."""
    count = most_lights(settings.lights, extent.maps, extent.texels)
    return tree_bytes(count, extent.float_bytes, most_threads()) if may_cluster(settings, count) else 0


def may_cluster(settings: SiiSettings, count: int) -> bool:
    """Return whether so many lights may be summed by clusters."""
    many = isinstance(settings.lightcuts, Lightcuts) or count >= LEAST_LIGHTS
    return settings.lightcuts is not None and settings.reach.cut is None and many


# 768 lights by a filtered look-up of the flux (Sec. 4), a cut of 5 % (Fig. 12), the ellipsoids of the appendix
PRESETS = {"paper": SiiSettings(lights=LightSettings(source=MapLights(filtered=True)), pairs=PairSettings(clamp=None),
                                reach=ReachSettings(cut=RelativeCut(), bound=EllipsoidBound()), lightcuts=None)}

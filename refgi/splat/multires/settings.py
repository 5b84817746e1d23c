"""Settings of `multires`: lights, pairs and how subsplats are refined (Nichols and Wyman 2009).

The defaults are the paper's, the authors' demo's where the paper is silent; `PRESETS` has the printed values.
"""

import dataclasses
import math
from typing import ClassVar, Literal

from refgi.cluster.settings import ClusteredShadows, ValSettings
from refgi.error_target.grid import LEAST_TARGET, MOST_CELLS, ErrorTarget
from refgi.errors import expect
from refgi.lights.settings import OCCLUSION, LightSettings, MapLights, Openness, clamped_pairs, expect_footprints
from refgi.pairs.settings import (
    LEAST_LIGHTS,
    AutoClamp,
    AutoLightcuts,
    DiscClamp,
    Lightcuts,
    PairSettings,
    SphereClamp,
)
from refgi.scene.values import BRIGHTEST
from refgi.settings import Settings, of, setting

Diagonal = Literal["off", "corner", "literal", "full8"]
Traversal = Literal["single_pass", "list"]
Representative = Literal["pixel", "mean"]
Upsampling = Literal["tent", "demo", "nearest", "naive_bilinear"]
Measure = Literal["relative", "absolute", "demo"]

FINEST = 16  # level
SEEN = "which lights subsplats see: all, by shadow rays (the pairs of vpl), or by soft shadows of clusters"


def _threshold(default: float, about: str, *, unit: str = "", study: bool = False) -> float:
    value: float = setting(default, about, least=0.0, most=math.inf, unit=unit, study=study)
    return value


def _expect_threshold(threshold: float) -> None:
    expect(threshold <= BRIGHTEST or threshold == math.inf, "threshold", f"0 to {BRIGHTEST:g}, or inf", threshold)


@dataclasses.dataclass(frozen=True)
class Criterion(Settings):
    """A mipmap whose cells are discontinuous beyond a threshold."""

    threshold: float = _threshold(0.1, "cells beyond it are refined")

    def check(self) -> None:
        """Check that the threshold is a number in float32 as well."""
        _expect_threshold(self.threshold)


@dataclasses.dataclass(frozen=True)
class DepthCriterion(Criterion):
    """A mipmap of depths.

    Its threshold t is a share of the depth ("relative"), a length in metres ("absolute", as published), or a share that
    is 3 t / l for cells of level l ("demo", the authors').
    """

    measure: Measure = setting("relative", "t times the depth; t metres, as published; or 3 t / level times the depth",
                               study=True)


@dataclasses.dataclass(frozen=True)
class DepthRange(DepthCriterion):
    """Min-max mipmap of depth (Sec. 3.2.1)."""

    NAME = "range"

    threshold: float = _threshold(0.1, "t: max - min of the depth over min, see measure")


@dataclasses.dataclass(frozen=True)
class DepthSlope(DepthCriterion):
    """Max mipmap of the depth derivative (Sec. 3.2.1)."""

    NAME = "slope"

    threshold: float = _threshold(0.05, "t: change of the depth a pixel over the depth, see measure", unit="1/pixel",
                                  study=True)


@dataclasses.dataclass(frozen=True)
class NormalRange(Criterion):
    """Min-max mipmap of the normals' components (Sec. 3.2.2)."""

    NAME = "range"

    threshold: float = _threshold(0.25, "max - min of a component of the normals, up to 2")
    components: Literal["xyz", "xy"] = setting("xyz", "components that count; the authors' demo: x and y", study=True)


@dataclasses.dataclass(frozen=True)
class Chord(Criterion):
    """Max mipmap of Eq. 1: the chord between neighbouring normals."""

    threshold: float = _threshold(0.1, "chord between neighbouring normals, up to 2", study=True)


@dataclasses.dataclass(frozen=True)
class Rate(Criterion):
    """Max mipmap of Eq. 1 over the distance of the two points: a curvature."""

    threshold: float = _threshold(0.1, "chord between neighbouring normals over their distance", unit="1/m", study=True)


@dataclasses.dataclass(frozen=True)
class Criteria(Settings):
    """What makes a cell discontinuous, for all lights (Sec. 3.2 and 5.2)."""

    NAME = "geometry"

    depth: DepthRange | None = setting(DepthRange(), "min-max mipmap of depth", study=True)
    derivative: DepthSlope | None = setting(None, "max mipmap of the depth derivative", study=True)
    normal: NormalRange | None = setting(NormalRange(), "min-max mipmap of normals", study=True)
    curvature: Chord | Rate | None = setting(None, "max mipmap of Eq. 1, or of it over the distance", study=True)
    rim: Literal[0, 1] = setting(0, "pixels around a cell whose depths and normals count in it (Fig. 15 top)")
    diagonal: Diagonal = setting("corner", "neighbours across a corner that count (Fig. 15 bottom)", study=True)
    traversal: Traversal = setting("single_pass", "depth first, or pass by pass as published: same list", study=True)


@dataclasses.dataclass(frozen=True)
class Rays(Settings):
    """Visibility by a shadow ray from each subsplat to each light."""


@dataclasses.dataclass(frozen=True)
class ByGeometry(Settings):
    """Subsplats for all lights, refined where depth or normals change (Sec. 3.2 and 3.3)."""

    NAME = "geometry"

    coarsest: int = setting(16, "cells of the coarsest level along the longer side", least=1, most=MOST_CELLS)
    finest: int = setting(0, "finest level: cells of 2^finest pixels", least=0, most=FINEST, study=True)
    criteria: Criteria = setting(Criteria(), "discontinuities")
    representative: Representative = setting("pixel", "where a subsplat is evaluated: one pixel, or the mean surface",
                                             study=True)
    visibility: Rays | ClusteredShadows | None = setting(None, SEEN)
    upsampling: Upsampling = setting("tent", "filter from subsplats to pixels (Sec. 3.5, Fig. 7)", study=True)

    def check(self) -> None:
        """Check that what has shadows lies on a triangle."""
        expect(self.visibility is None or self.representative == "pixel", "representative",
               "'pixel' with visibility", self.representative)


@dataclasses.dataclass(frozen=True)
class ByIrradiance(Settings):
    """Subsplats of each light's own, refined where its irradiance changes (Sec. 3.3.1)."""

    NAME = "irradiance"

    coarsest: int = setting(16, "cells of the coarsest level along the longer side", least=1, most=MOST_CELLS)
    finest: int = setting(0, "finest level: cells of 2^finest pixels", least=0, most=FINEST, study=True)
    threshold: float = _threshold(0.1, "T: max - min over a cell's quadrants, see form")
    form: Literal["relative", "absolute", "brightest"] = setting(
        "relative", "T over this light's largest irradiance; W/m^2; or over the largest sum of all lights / N",
        study=True)
    criteria: Criteria | None = setting(None, "begin with the list that geometry refines (Sec. 6)", study=True)
    representative: Representative = setting("pixel", "where a subsplat is evaluated: one pixel, or the mean surface",
                                             study=True)
    upsampling: Upsampling = setting("tent", "filter from subsplats to pixels (Sec. 3.5, Fig. 7)", study=True)

    def check(self) -> None:
        """Check that the threshold is a number in float32 as well."""
        _expect_threshold(self.threshold)

    @property
    def start(self) -> ByGeometry | None:
        """The shared list that each light goes on to refine, if any."""
        return None if self.criteria is None else ByGeometry(self.coarsest, self.finest, self.criteria)


@dataclasses.dataclass(frozen=True)
class ByError(ErrorTarget):
    """Subsplats refined until the picture is as near to the full sum as asked for; beyond the paper."""

    NAME = "error"

    target: float = setting(0.05, "RMSE to the full sum over its mean; saves pairs, and time from about 1000 lights on "
                                  "or, on most scenes, with shadow rays", least=LEAST_TARGET)
    visibility: Rays | ClusteredShadows | None = setting(None, SEEN)


@dataclasses.dataclass(frozen=True)
class MultiresSettings(Settings):
    """Settings of adaptive multiresolution splatting.

    `pairs.clamp` "auto" is the form factor of a disc: the paper clamps as well (Sec. 5), at a value that it does not
    give. It is none for lights that have no footprints (`source` "walk", `openness.flux` "roulette") and with shadow
    rays. `lights.seed` also draws the samples that estimate the error of subsplats "error".
    """

    SWITCHES: ClassVar[frozenset[str]] = frozenset({"ams_disc", "ams_rho_in_splat", "ams_filter_all",
                                                   "ams_all_corners"})

    lights: LightSettings = setting(LightSettings(count=256, source=MapLights(pattern="grid")), "pixel lights")
    pairs: PairSettings = setting(PairSettings(), "how one light lights one subsplat")
    subsplats: ByGeometry | ByIrradiance | ByError = setting(ByGeometry(), "what subsplats are refined by")
    detail: float = setting(0.0, "a of Eq. 3: darkens what turns away from the camera", least=0.0, most=1.0, study=True)
    supersampled: bool = setting(False, "rendered at twice the width and height (Sec. 4)")
    as_published: frozenset[str] = setting(frozenset(), "forms of the method to use as printed", study=True)
    lightcuts: AutoLightcuts | Lightcuts | None = setting(
        AutoLightcuts(), "diffuse lights are summed by clusters, to an error; auto: where that pays")
    ambient_occlusion: Openness | None = setting(None, OCCLUSION)

    def check(self) -> None:
        """Check what lights, pairs and subsplats ask of each other."""
        clamp = self.effective_pairs.clamp
        chosen = clamp and clamp.name()
        expect_footprints(self.lights, self.effective_pairs)
        if self.shadow_rays is not None:
            bare = PairSettings(clamp=self.pairs.clamp)
            expect(self.pairs == bare, "pairs", "defaults with visibility 'rays'", self.pairs)
            expect(clamp is None, "pairs.clamp", "none with visibility 'rays'", chosen)
        _ = self.shadows  # refuses what shadows cannot be made of
        expect(self.ambient_occlusion is None or self.visibility is None, "ambient_occlusion", "none with visibility",
               self.ambient_occlusion and self.ambient_occlusion.name())
        by_error = isinstance(self.subsplats, ByError)
        if isinstance(self.lightcuts, Lightcuts):
            expect(not isinstance(clamp, SphereClamp), "pairs.clamp",
                   "another one with lightcuts, which bound no spheres", chosen)
            expect(not isinstance(self.subsplats, ByIrradiance), "lightcuts",
                   "none with subsplats 'irradiance', which are of each light's own", self.lightcuts.name())
            expect(self.visibility is None, "lightcuts", "none where subsplats have shadows", self.lightcuts.name())
        expect(not (by_error and isinstance(clamp, SphereClamp)), "pairs.clamp",
               "another one with subsplats 'error', which splits the peaks of points off", chosen)
        allowed = {"ams_disc": isinstance(clamp, DiscClamp), "ams_filter_all": not by_error,
                   "ams_rho_in_splat": isinstance(self.subsplats, ByGeometry),
                   "ams_all_corners": not isinstance(self.subsplats, ByError) and self.subsplats.upsampling == "tent"}
        wrong = sorted(name for name in self.as_published if not allowed[name])
        expect(not wrong, "as_published",
               f"no {' or '.join(wrong)} with the clamp {chosen!r}, subsplats {self.subsplats.name()!r} and the "
               f"upsampling {getattr(self.subsplats, 'upsampling', None)!r}", sorted(self.as_published))

    def may_cluster(self, count: int) -> bool:
        """Return whether so many lights may be summed by clusters."""
        own = isinstance(self.subsplats, ByIrradiance) or self.visibility is not None
        many = isinstance(self.lightcuts, Lightcuts) or count >= LEAST_LIGHTS
        return self.lightcuts is not None and not own and many

    @property
    def traces_rays(self) -> bool:
        """Whether the method traces rays."""
        return (self.lights.traces_rays or self.shadow_rays is not None or self.ambient_occlusion is not None
                or (self.shadows is not None and self.shadows.traces_rays))

    @property
    def visibility(self) -> Rays | ClusteredShadows | None:
        """How subsplats find which lights they see, if they do."""
        return None if isinstance(self.subsplats, ByIrradiance) else self.subsplats.visibility

    @property
    def shadow_rays(self) -> Rays | None:
        """How subsplats find by rays which lights they see, if they do."""
        return self.visibility if isinstance(self.visibility, Rays) else None

    @property
    def shadows(self) -> ValSettings | None:
        """The settings of `val` that sum the lights at subsplats, if these take its shadows."""
        if not isinstance(self.visibility, ClusteredShadows):
            return None
        return self.visibility.of_lights(self.lights, self.effective_pairs)

    @property
    def effective_pairs(self) -> PairSettings:
        """The pairs in use: the clamp "auto" is "disc", and none where lights have no footprints or rays are traced."""
        if self.shadow_rays is not None and isinstance(self.pairs.clamp, AutoClamp):
            return dataclasses.replace(self.pairs, clamp=None)
        return clamped_pairs(self.lights, self.pairs)


# Sec. 3.3, 4, 5.2 and Fig. 11 a: pictures of 2048^2 shown at 1024^2, all diagonal neighbours, lists pass by pass
PRESETS = {"paper": of(MultiresSettings, lights=256, pattern="grid", coarsest=16, normal_threshold=0.25,
                       diagonal="literal", traversal="list", supersampled=True, lightcuts=None)}

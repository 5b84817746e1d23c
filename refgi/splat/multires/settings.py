"""What `multires` can be set to (Nichols and Wyman 2009)."""

import dataclasses
import math
from typing import ClassVar, Literal

from refgi.errors import expect
from refgi.lights.settings import LightSettings, MapLights, expect_footprints
from refgi.pairs.settings import AutoClamp, DiscClamp, PairSettings, SphereClamp
from refgi.scene.values import BRIGHTEST, is_count
from refgi.settings import Settings, setting

Refinement = Literal["single_pass", "list"]
PerLight = Literal["shared", "light", "shared_then_light"]
Threshold = Literal["absolute", "relative", "brightest"]
Diagonal = Literal["off", "corner", "literal", "full8"]
Upsampling = Literal["tent", "demo", "nearest", "naive_bilinear"]

LEAST_TARGET = 1e-6  # about what rounding to float32 leaves of the full sum
THRESHOLDS = ("depth_threshold", "derivative_threshold", "normal_threshold", "curvature_threshold", "light_threshold")
# settings and printed forms that a mode would not heed: pairs with rays are those of `vpl`, an error sets its own cells
UNHEEDED = {
    "visibility": (("representative", "per_light", "target_error"), frozenset()),
    "target_error": (("finest", "criteria", *THRESHOLDS, "normal_components", "curvature", "rim", "diagonal",
                      "refinement", "per_light", "threshold_form", "representative", "upsampling"),
                     {"ams_rho_in_splat", "ams_filter_all"}),
    "per_light": ((), {"ams_rho_in_splat"}),
}


@dataclasses.dataclass(frozen=True)
class MultiresSettings(Settings):
    """What `multires` can be set to; the defaults are the paper's, the authors' demo's where the paper is silent.

    `clamp` "auto" is the form factor of a disc: the paper clamps as well (Sec. 5), at a value that it does not give. It
    is none for lights that have no footprints (`source` "walk", `openness_flux` "roulette") and with `visibility`.

    Subsplats: from `coarsest` cells along the longer side down to cells of 2^`finest` pixels. A cell is refined where
    one of the `criteria` says so: "depth", (max - min) / min over `depth_threshold`; "derivative", its change a pixel
    over `derivative_threshold` of the depth; "normal", the range of a component (`normal_components`) over
    `normal_threshold`; "curvature", the chord between neighbouring normals (or "rate": over their distance, 1/m) over
    `curvature_threshold`. Ranges take in `rim` pixels around a cell, `diagonal` says what neighbours across a corner
    do, `refinement` whether cells are classified in a single pass or in the published list.

    `per_light`: refine by the geometry once for all lights ("shared"), for each light by its own irradiance
    ("light"), or so from the shared list on. `light_threshold` is then "absolute" (W/m^2), "relative" to what this
    light was seen to reach, or a share of the "brightest" sum over all lights, over N. A subsplat is lit at its
    `representative` pixel, or at the mean over its surface, with `visibility` by shadow rays or without. `upsampling`
    makes a picture of the subsplats; `detail` is a of Eq. 3.

    `target_error` refines until the picture is that near to the full sum, as a share of its mean (RMSE); `seed` draws
    the pixels that tell. `supersampled` renders at twice the size (Sec. 4).
    """

    lights: LightSettings = setting(LightSettings(count=256, source=MapLights(pattern="grid")), "pixel lights")
    pairs: PairSettings = setting(PairSettings(clamp=AutoClamp()), "how one light lights one subsplat")
    coarsest: int = 16
    finest: int = 0
    criteria: frozenset[Literal["depth", "derivative", "normal", "curvature"]] = frozenset({"depth", "normal"})
    depth_threshold: float = setting(0.1, "threshold", least=0.0, most=math.inf)
    derivative_threshold: float = setting(0.05, "threshold", least=0.0, most=math.inf)
    normal_threshold: float = setting(0.25, "threshold", least=0.0, most=math.inf)
    normal_components: Literal["xyz", "xy"] = "xyz"
    curvature_threshold: float = setting(0.1, "threshold", least=0.0, most=math.inf)
    curvature: Literal["chord", "rate"] = "chord"
    rim: int = 0
    diagonal: Diagonal = "corner"
    refinement: Refinement = "single_pass"
    per_light: PerLight = "shared"
    light_threshold: float = setting(0.1, "threshold", least=0.0, most=math.inf)
    threshold_form: Threshold = "relative"
    representative: Literal["pixel", "mean"] = "pixel"
    visibility: Literal["none", "rays"] = "none"
    upsampling: Upsampling = "tent"
    detail: float = 0.0
    target_error: float | None = None
    supersampled: bool = False
    as_published: frozenset[str] = setting(frozenset(), "forms to use as printed", study=True)

    SWITCHES: ClassVar[frozenset[str]] = frozenset({"ams_disc", "ams_rho_in_splat", "ams_filter_all"})

    def check(self) -> None:
        """Check what fields ask of each other."""
        expect(is_count(self.coarsest) and 1 <= self.coarsest <= 65536, "coarsest", "1 to 65536 cells", self.coarsest)
        expect(is_count(self.finest) and 0 <= self.finest <= 16, "finest", "a level, 0 to 16", self.finest)
        expect(self.rim in (0, 1) and is_count(self.rim), "rim", "0 or 1 pixels", self.rim)
        for key in THRESHOLDS:
            expect(0 <= getattr(self, key) <= BRIGHTEST or getattr(self, key) == math.inf, key,
                   f"0 to {BRIGHTEST:g}, or inf", getattr(self, key))
        expect(0 <= self.detail <= 1, "detail", "a share from 0 to 1", self.detail)
        expect(self.target_error is None or LEAST_TARGET <= self.target_error < math.inf, "target_error",
               f"none or a share of the mean from {LEAST_TARGET:g} on", self.target_error)
        self._expect_heeded()

    def _expect_heeded(self) -> None:
        left = {field.name: field.default for field in dataclasses.fields(self)}
        for mode, (keys, switches) in UNHEEDED.items():
            chosen = getattr(self, mode)
            if chosen == left[mode]:
                continue
            for key in keys:
                expect(getattr(self, key) == left[key], key, f"{left[key]!r} with {mode} {chosen!r}",
                       getattr(self, key))
            expect(self.as_published.isdisjoint(switches), "as_published",
                   f"none of {sorted(switches)} with {mode} {chosen!r}", sorted(self.as_published))
        expect_footprints(self.lights, self.effective_pairs)
        clamp = self.effective_pairs.clamp
        if self.visibility == "rays":
            bare = dataclasses.replace(PairSettings(), clamp=self.pairs.clamp)
            expect(self.pairs == bare, "pairs", "defaults with visibility 'rays'", self.pairs)
            expect(clamp is None, "pairs.clamp", "none with visibility 'rays'", clamp and clamp.name())
        expect(not isinstance(clamp, SphereClamp) or self.target_error is None, "pairs.clamp",
               "another one with target_error, which takes peaks of points alone apart", clamp and clamp.name())
        expect(isinstance(clamp, DiscClamp) or "ams_disc" not in self.as_published, "as_published",
               "'ams_disc' with the clamp 'disc' alone", sorted(self.as_published))

    @property
    def traces_rays(self) -> bool:
        """Whether the method traces rays."""
        return self.lights.traces_rays or self.visibility == "rays"

    @property
    def effective_pairs(self) -> PairSettings:
        """The pairs in use: the clamp "auto" is "disc", and none where lights have no footprints or rays are traced."""
        if not isinstance(self.pairs.clamp, AutoClamp):
            return self.pairs
        bare = not self.lights.has_footprints or self.visibility == "rays"
        return dataclasses.replace(self.pairs, clamp=None if bare else DiscClamp())

"""Adaptive multiresolution splatting (Nichols and Wyman 2009): settings and method."""

import dataclasses
import math
from typing import Any, ClassVar, Literal

import numpy.typing as npt

from refgi.errors import expect
from refgi.scene.values import is_count
from refgi.splat.lights.settings import LightSettings, Pattern, expect_choices

Array = npt.NDArray[Any]
Refinement = Literal["single_pass", "list"]
PerLight = Literal["shared", "light", "shared_then_light"]
Threshold = Literal["absolute", "relative", "brightest"]
Diagonal = Literal["off", "corner", "literal", "full8"]
Upsampling = Literal["tent", "demo", "nearest", "naive_bilinear"]

CRITERIA = frozenset({"depth", "derivative", "normal", "curvature"})
CHOICES: dict[str, Any] = {
    "normal_components": Literal["xyz", "xy"], "curvature": Literal["chord", "rate"], "diagonal": Diagonal,
    "refinement": Refinement, "per_light": PerLight, "threshold_form": Threshold, "upsampling": Upsampling,
    "representative": Literal["pixel", "mean"], "visibility": Literal["none", "rays"]}
THRESHOLDS = ("depth_threshold", "derivative_threshold", "normal_threshold", "curvature_threshold", "light_threshold")


@dataclasses.dataclass(frozen=True)
class MultiresSettings(LightSettings):
    """What `multires` can be set to; the defaults are the paper's, the authors' demo's where the paper is silent.

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

    lights: int = 256
    pattern: Pattern = "grid"
    coarsest: int = 16
    finest: int = 0
    criteria: frozenset[str] = frozenset({"depth", "normal"})
    depth_threshold: float = 0.1
    derivative_threshold: float = 0.05
    normal_threshold: float = 0.25
    normal_components: Literal["xyz", "xy"] = "xyz"
    curvature_threshold: float = 0.1
    curvature: Literal["chord", "rate"] = "chord"
    rim: int = 0
    diagonal: Diagonal = "corner"
    refinement: Refinement = "single_pass"
    per_light: PerLight = "shared"
    light_threshold: float = 0.1
    threshold_form: Threshold = "relative"
    representative: Literal["pixel", "mean"] = "pixel"
    visibility: Literal["none", "rays"] = "none"
    upsampling: Upsampling = "tent"
    detail: float = 0.0
    target_error: float | None = None
    supersampled: bool = False

    SWITCHES: ClassVar[frozenset[str]] = LightSettings.SWITCHES | {"ams_disc", "ams_rho_in_splat", "ams_filter_all"}

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "criteria", frozenset(self.criteria))
        expect(self.criteria <= CRITERIA, "criteria", f"names out of {sorted(CRITERIA)}", sorted(self.criteria))
        expect(is_count(self.coarsest) and 1 <= self.coarsest <= 65536, "coarsest", "1 to 65536 cells", self.coarsest)
        expect(is_count(self.finest) and 0 <= self.finest <= 16, "finest", "a level, 0 to 16", self.finest)
        expect(self.rim in (0, 1) and is_count(self.rim), "rim", "0 or 1 pixels", self.rim)
        for key in THRESHOLDS:
            expect(getattr(self, key) >= 0, key, "0 or more", getattr(self, key))
        expect_choices(self, CHOICES)
        expect(0 <= self.detail <= 1, "detail", "a share from 0 to 1", self.detail)
        expect(self.target_error is None or (math.isfinite(self.target_error) and self.target_error > 0),
               "target_error", "none or a share of the mean above 0", self.target_error)
        self._expect_together()

    def _expect_together(self) -> None:
        by_rays = self.visibility == "rays"
        expect(not by_rays or self.clamp == "none", "visibility", f"'none' with the clamp {self.clamp!r}", "rays")
        for special in ("per_light", "target_error"):
            unused = getattr(self, special) in ("shared", None)
            expect(unused or not by_rays, "visibility", f"'none' with {special}", self.visibility)
            expect(unused or "ams_rho_in_splat" not in self.as_published, "as_published",
                   f"no 'ams_rho_in_splat' with {special}", sorted(self.as_published))
        expect(self.target_error is None or self.per_light == "shared", "per_light", "'shared' with target_error",
               self.per_light)
        expect(self.clamp == "disc" or "ams_disc" not in self.as_published, "as_published",
               "'ams_disc' with the clamp 'disc' alone", sorted(self.as_published))

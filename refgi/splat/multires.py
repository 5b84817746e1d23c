"""Adaptive multiresolution splatting (Nichols and Wyman 2009): settings and method."""

import dataclasses
import math
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.lights.footprints import demo_footprints
from refgi.lights.selection import choose_lights, drawn_from_maps, footprints
from refgi.lights.settings import LightSettings, Pattern, expect_choices
from refgi.pairs.irradiance import Receivers
from refgi.pairs.loss import warn_of_clamp
from refgi.pairs.settings import ClampMode, PairSettings
from refgi.scene.values import BRIGHTEST, is_count
from refgi.splat.error_target.error_driven import error_driven
from refgi.splat.light_lists.per_light import per_light
from refgi.splat.refinement.criteria import needs
from refgi.splat.refinement.grid import Subsplats, top_level
from refgi.splat.refinement.refine import refine
from refgi.splat.subsplats.detail import surface_detail
from refgi.splat.subsplats.evaluate import at_subsplats, evaluate
from refgi.splat.subsplats.upsample import upsample
from refgi.splat.subsplats.visible import evaluate_visible

if TYPE_CHECKING:
    from refgi.frame import Frame
    from refgi.lights import PixelLights
    from refgi.rsm import GBuffer

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
LEAST_TARGET = 1e-6  # about what rounding to float32 leaves of the full sum
THRESHOLDS = ("depth_threshold", "derivative_threshold", "normal_threshold", "curvature_threshold", "light_threshold")
# settings and printed forms that a mode would not heed: pairs with rays are those of `vpl`, an error sets its own cells
UNHEEDED = {
    "visibility": (("offset", "lobe_norm", "widening", "representative", "per_light", "target_error"),
                   PairSettings.SWITCHES),
    "target_error": (("finest", "criteria", *THRESHOLDS, "normal_components", "curvature", "rim", "diagonal",
                      "refinement", "per_light", "threshold_form", "representative", "upsampling"),
                     {"ams_rho_in_splat", "ams_filter_all"}),
    "per_light": ((), {"ams_rho_in_splat"}),
}


@dataclasses.dataclass(frozen=True)
class MultiresSettings(LightSettings):
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

    lights: int = 256
    pattern: Pattern = "grid"
    clamp: ClampMode = "auto"
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
            expect(0 <= getattr(self, key) <= BRIGHTEST or getattr(self, key) == math.inf, key,
                   f"0 to {BRIGHTEST:g}, or inf", getattr(self, key))
        expect_choices(self, CHOICES)
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
        expect(self.effective_clamp == "none" or self.visibility == "none", "clamp",
               f"'none' with visibility {self.visibility!r}", self.clamp)
        expect(self.clamp != "sphere" or self.target_error is None, "clamp",
               "another one with target_error, which takes peaks of points alone apart", self.clamp)
        expect(self.effective_clamp == "disc" or "ams_disc" not in self.as_published, "as_published",
               "'ams_disc' with the clamp 'disc' alone", sorted(self.as_published))

    @property
    def traces_rays(self) -> bool:
        """Whether the method traces rays."""
        return super().traces_rays or self.visibility == "rays"

    @property
    def effective_clamp(self) -> ClampMode:
        """The clamp in use: "auto" is "disc", and none where lights have no footprints or pairs are those of `vpl`."""
        if self.clamp != "auto":
            return self.clamp
        bare = self.source == "walk" or self.openness_flux == "roulette" or self.visibility == "rays"
        return "none" if bare else "disc"


def multires(frame: "Frame", settings: MultiresSettings) -> Array:
    """Light every pixel by pixel lights that are evaluated at subsplats.

    Parameters
    ----------
    frame : Frame
        The scene, seen and lit.
    settings : MultiresSettings
        Which lights, where subsplats are refined and how they become a picture.

    Returns
    -------
    (3, h, w) ndarray
        Indirect irradiance, W/m^2, linear RGB, without visibility unless by rays.
    """
    lights = choose_lights(frame, settings)  # Sec. 3.1
    footprint = _footprints(frame, lights, settings)
    if not settings.supersampled:
        return _indirect(frame, frame.gbuffer, lights, footprint, settings)
    double = _doubled(frame)  # Sec. 4: rendered at 2048^2 for 1024^2
    return _halved(_indirect(frame, double, lights, footprint, settings), double.covered, frame.gbuffer.covered)


def _indirect(
    frame: "Frame", buffer: "GBuffer", lights: "PixelLights", footprint: Array | None, settings: MultiresSettings
) -> Array:
    """Light the pixels of one buffer: steps 3 to 6 of the paper's overview, and Eq. 3."""
    _resolve(buffer, settings)
    warn_of_clamp(Receivers(buffer.position, buffer.normal, buffer.covered), lights, settings, footprint, "multires")
    if settings.target_error is not None:
        light = error_driven(buffer, lights, settings, footprint).irradiance
    elif settings.per_light == "light":
        light = per_light(buffer, lights, settings, footprint, None)  # Sec. 3.3.1
    elif settings.per_light == "shared_then_light":
        start = shared_subsplats(buffer, settings)
        light = per_light(buffer, lights, settings, footprint, start)  # Sec. 6
    else:
        subsplats = shared_subsplats(buffer, settings)  # Sec. 3.2, 3.3
        light = _upsampled(frame, buffer, subsplats, lights, footprint, settings)  # Sec. 3.4, 3.5
    if settings.detail == 0:
        return light
    eye = frame.scene.camera.eye
    return surface_detail(light, buffer.position, buffer.normal, buffer.covered, eye, settings.detail)  # Eq. (3)


def _resolve(buffer: "GBuffer", settings: MultiresSettings) -> None:
    """Compute in one pass what the steps will ask for one by one; depth only where a criterion looks at it."""
    by_geometry = settings.target_error is None and settings.per_light != "light"
    looks_at_depth = by_geometry and not settings.criteria.isdisjoint({"depth", "derivative"})
    buffer.resolve("position", "normal", *(("depth",) if looks_at_depth else ()))


def shared_subsplats(buffer: "GBuffer", settings: MultiresSettings) -> Subsplats:
    """Refine by geometry, once for all lights (Sec. 3.2 and 3.3).

    Parameters
    ----------
    buffer : GBuffer
        What the camera sees.
    settings : MultiresSettings
        Criteria, thresholds, coarsest and finest level.

    Returns
    -------
    Subsplats
        The leaves.
    """
    top = top_level(buffer.height, buffer.width, settings.coarsest)
    return refine(needs(buffer, settings, top), buffer.covered, settings)


def _upsampled(
    frame: "Frame", buffer: "GBuffer", subsplats: Subsplats, lights: "PixelLights", footprint: Array | None,
    settings: MultiresSettings,
) -> Array:
    if settings.visibility == "rays":
        values = evaluate_visible(frame.tracer, frame.scene.geometry, buffer, subsplats, lights)
    else:
        points = at_subsplats(buffer, subsplats, settings.representative)
        values = evaluate(*points, lights, settings, footprint)
    rho_in_splat = "ams_rho_in_splat" in settings.as_published
    if rho_in_splat:
        values = values * buffer.albedo.reshape(3, -1)[:, subsplats.pixel]
    light = upsample(values, subsplats, buffer.covered, settings.upsampling,
                     filter_all="ams_filter_all" in settings.as_published)
    if rho_in_splat:  # the picture's albedo is multiplied in again later
        light = np.divide(light, buffer.albedo, out=np.zeros_like(light), where=buffer.albedo > 0)
    return light


def _footprints(frame: "Frame", lights: "PixelLights", settings: MultiresSettings) -> Array | None:
    """Return the area of each light: exact, or as the authors' demo has it."""
    if "ams_disc" not in settings.as_published:
        return footprints(frame, settings)
    return demo_footprints(lights, frame.scene.lights, drawn_from_maps(frame.rsms, settings))


def _doubled(frame: "Frame") -> "GBuffer":
    """Return what the camera sees at twice the width and height."""
    from refgi.rsm import gbuffer

    scene = frame.scene
    return gbuffer(scene.geometry, frame.materials, scene.camera, 2 * frame.width, 2 * frame.height, frame.dtype)


def _halved(light: Array, fine: Array, covered: Array) -> Array:
    """Return means over those of four pixels that show a surface, at pixels that do."""
    height, width = covered.shape
    four = (3, height, 2, width, 2)
    shown = fine.reshape(four[1:]).sum(axis=(1, 3))
    mean = light.reshape(four).sum(axis=(2, 4)) / np.maximum(shown, 1).astype(light.dtype)
    halved: Array = np.where(covered, mean, light.dtype.type(0))
    for i, j in zip(*np.nonzero(covered & (shown == 0)), strict=True):  # slivers: as the pixels around them
        around = np.s_[max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2]
        lit = shown[around] > 0
        if lit.any():
            halved[:, i, j] = mean[:, *around][:, lit].mean(axis=1)
    return halved

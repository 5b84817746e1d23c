"""What is varied: a row varies one setting, with the companions without which it has no effect.

Here of pixel lights and pairs, which three methods share, of `sii`, `multires` and the baselines.
"""

import math
from typing import Any, NamedTuple

USUAL = ("cornell_box", "stage")  # diffuse, and with a glossy vase


class Row(NamedTuple):
    """One setting, its other values, and where they are tried."""

    field: str
    values: tuple[Any, ...]
    companions: dict[str, Any]
    on: tuple[str, ...]
    same: str  # why a value may leave the picture as it is; empty: it must not


class Table(NamedTuple):
    """All cases of one method."""

    base: dict[str, Any]  # what the rows start from, for speed
    rows: list[Row]
    excluded: dict[str, str] = {}  # setting: why no case has it  # noqa: RUF012
    borrowed: tuple[str, ...] = ()  # starts of keys of parts that are another method's, whose table has their cases


def vary(field: str, *values: Any, on: tuple[str, ...] = USUAL, same: str = "", **companions: Any) -> Row:
    """Return a row of a table."""
    return Row(field, values, companions, on, same)


GLOSSY = ("stage", "ring")
GLASS = ("glass_ball",)
LAMPS = ("cornell_box", "stage", "two_lamps")
DIFFUSE = ("cornell_box", "cornell_sphere")

OPENNESS: list[Row] = [
    vary("ambient_occlusion", "openness"),
    vary("ambient_occlusion.radius", 0.3, ambient_occlusion="openness"),
    vary("ambient_occlusion.rays", 8, ambient_occlusion="openness"),
]

PAIRS: list[Row] = [
    vary("clamp", "distance", clamp_value=0.2),
    vary("clamp", "geometry", clamp_value=2.0),
    vary("clamp", "sphere", on=DIFFUSE),
    vary("clamp_value", 0.1, 0.3, clamp="distance"),
    vary("clamp_value", 0.5, 3.0, clamp="geometry"),
    vary("clamp_value", 4.0, on=DIFFUSE, clamp="sphere"),
    vary("offset", 0.02, -0.02),
    vary("lobe_norm", "none", on=GLOSSY),
    vary("lobe_norm", "full_lobe", on=("stage", "two_lamps")),
    vary("widening", 0.3, on=GLOSSY),
    vary("widening", 0.3, on=GLOSSY, lobe_norm="full_lobe"),
    vary("as_published", "sii_no_pi"),
    vary("as_published", "sii_widening", "sii_widening_unnorm", on=GLOSSY, widening=0.3),
]

LIGHTS: list[Row] = [
    vary("lights", 64, 200, on=LAMPS),
    vary("projection", "cube", "paraboloid", on=LAMPS),
    vary("pattern", "grid", "halton", "all", "random", on=LAMPS),
    vary("filtered", True, on=LAMPS),
    vary("filtered", True, pattern="random"),
    vary("filtered", True, pattern="grid"),
    vary("filtered", True, warp="B"),
    vary("source", "walk", on=LAMPS),
    vary("source", "walk", on=GLASS),
    vary("bounces", 3, on=LAMPS, source="walk"),
    vary("seed", 7, on=LAMPS, pattern="halton"),
    vary("seed", 7, pattern="random"),
    vary("seed", 7, source="walk"),
    vary("seed", 7, openness_flux="roulette"),
    vary("warp", "A", "B", on=LAMPS),
    vary("warp", "A", "B", pattern="grid"),
    vary("warp_levels", 0, 1, 5, warp="B"),
    vary("warp_levels", 0, 1, 5, warp="A"),
    vary("importance", "peak", on=GLOSSY, warp="A"),
    vary("importance", "peak", on=GLOSSY, warp="B"),
    vary("importance", "openness", warp="A"),
    vary("importance", "openness", warp="B"),
    vary("defensive", 0.4, warp="A"),
    vary("defensive", 0.4, warp="B"),
    vary("renormalise_weights", True, warp="B"),
    vary("openness_radius", 0.3, warp="B", importance="openness"),
    vary("openness_radius", 0.3, openness_flux="scale"),
    vary("openness_rays", 64, warp="B", importance="openness"),
    vary("openness_rays", 64, openness_flux="scale"),
    vary("openness_floor", 0.6, warp="B", importance="openness"),
    vary("openness_floor", 0.6, openness_flux="roulette"),
    vary("openness_flux", "scale", "roulette"),
    vary("openness_flux", "scale", source="walk"),
    vary("refraction", "none", "two_interface", on=GLASS),
    vary("refraction_exponent", 60.0, on=GLASS),
    vary("refraction_exponent", 60.0, on=GLASS, refraction="two_interface"),
    vary("as_published", "sii_no_tn", "equal_solid_angle", on=LAMPS),
    vary("as_published", "sii_peak", on=GLOSSY, warp="A", importance="peak"),
    vary("as_published", "sii_openness", openness_flux="scale"),
    vary("as_published", "sii_no_tn+equal_solid_angle", pattern="grid", warp="A"),
]


BOUNDS = "a bound changes no bit of the picture"
CUT = {"i_low": 0.05}

SII = Table({"lights": 96, "clamp": "none"}, [
    *PAIRS, *LIGHTS, *OPENNESS,
    vary("clamp", "none", same="what the cases start from"),
    vary("clamp", "disc"),
    vary("clamp", "auto"),
    vary("i_low", 0.05, 0.3),
    vary("reference_length", 0.3, **CUT),
    vary("irradiance_low", 0.02),
    vary("bound", "full", "quad", "ellipsoid", "mesh", same=BOUNDS, **CUT),
    vary("bound", "full", "ellipsoid", same=BOUNDS, half_resolution=True, **CUT),
    vary("mesh_faces", 8, 20, 320, 1280, same=BOUNDS, bound="mesh", **CUT),
    vary("mesh_faces", 8, 20, 320, bound="mesh", inflate=False, i_low=0.3),
    vary("mesh_faces", 1280, bound="mesh", inflate=False, i_low=0.3, same="hardly differs from 320 faces"),
    vary("inflate", False, bound="mesh", mesh_faces=20, **CUT),
    vary("stochastic_range", True, **CUT),
    vary("stochastic_range", True, irradiance_low=0.02),
    vary("seed", 7, pattern="grid", stochastic_range=True, **CUT),
    vary("as_published", "per_light_ilow", **CUT),
    vary("as_published", "per_light_ilow", stochastic_range=True, **CUT),
    vary("widening", 0.3, on=("stage", "ring"), **CUT),
    vary("lightcuts", "bounded", lights=500),
    vary("lightcuts.error", 0.3, lights=500, lightcuts="bounded"),
    vary("lightcuts", "none", same="few lights are summed in full in any case"),
    vary("quantisation", "published"),
    vary("compensation", "screen", clamp="geometry", clamp_value=2.0),
    vary("half_resolution", True),
    vary("half_resolution", True, **CUT),
])


CURVED = ("cornell_sphere", "stage")
SUBSPLATS = "both ways find the same subsplats"

MULTIRES = Table({"lights": 96, "coarsest": 6}, [
    *PAIRS, *LIGHTS, *OPENNESS,
    vary("clamp", "none"),
    vary("clamp", "disc", same="a disc is the default of auto"),
    vary("as_published", "ams_disc", "ams_rho_in_splat", "ams_filter_all", on=("cornell_box", "stage", "two_lamps")),
    vary("as_published", "ams_filter_all", per_light="light"),
    vary("as_published", "ams_all_corners", on=("cornell_box",)),
    vary("as_published", "ams_all_corners", per_light="light"),
    vary("coarsest", 16),
    vary("coarsest", 3, 16, criteria=""),
    vary("finest", 1, 2),
    vary("criteria", "", "depth", "normal", "derivative", "curvature", "depth+derivative+normal+curvature"),
    vary("depth_threshold", 0.02, math.inf, criteria="depth"),
    vary("depth.measure", "absolute", "demo", criteria="depth"),
    vary("derivative.measure", "absolute", "demo", criteria="derivative"),
    vary("derivative_threshold", 0.01, 0.2, criteria="derivative"),
    vary("normal_threshold", 0.05, 0.8, on=CURVED, criteria="normal"),
    vary("normal_components", "xy", on=CURVED, criteria="normal"),
    vary("curvature_threshold", 0.5, 1.2, criteria="curvature"),
    vary("curvature", "rate", criteria="curvature", curvature_threshold=10.0),
    vary("rim", 1),
    vary("diagonal", "off", "literal", "full8"),
    vary("refinement", "list", same=SUBSPLATS),
    *(vary("refinement", "list", same=SUBSPLATS, diagonal=how) for how in ("off", "literal", "full8")),
    vary("per_light", "light", "shared_then_light"),
    vary("light_threshold", 0.02, 0.5, per_light="light"),
    vary("light_threshold", 0.02, 0.5, per_light="shared_then_light"),
    vary("threshold_form", "absolute", "brightest", per_light="light"),
    vary("threshold_form", "absolute", "brightest", per_light="shared_then_light"),
    vary("representative", "mean"),
    vary("representative", "mean", per_light="light"),
    vary("visibility", "rays"),
    vary("visibility", "rays", supersampled=True),
    vary("visibility", "val"),
    vary("visibility", "val", supersampled=True),
    vary("shadow", "pcss", "rays_vpls", visibility="val"),
    vary("clusters", 7, visibility="val"),
    vary("as_published", "val_alpha", "val_alpha_over_pi", "val_search_solid_angle", visibility="val"),
    vary("upsampling", "demo", "nearest", "naive_bilinear"),
    vary("upsampling", "demo", "nearest", "naive_bilinear", per_light="light"),
    vary("lightcuts", "bounded", lights=500),
    vary("lightcuts.error", 0.3, lights=500, lightcuts="bounded"),
    vary("lightcuts", "none", "auto", same="few lights are summed in full in any case"),
    vary("detail", 0.5),
    vary("target_error", 0.02, 0.2),
    vary("seed", 7, target_error=0.02),
    vary("supersampled", True),
    vary("supersampled", True, per_light="light"),
], borrowed=("subsplats.visibility.",))


BATCH = "pairs or rays held at a time change no bit"
CAUSTIC = ("glass_ball", "ring")
CAUSTICS = {"caustics": True, "photons": 4096}

GATHER = Table({"samples": 96}, [
    vary("samples", 40),
    vary("radius", 0.1, 2.0),
    vary("seed", 7),
    vary("grid", 0, same="64 pixels are more than the picture has"),
    vary("grid", 8, 16, reach=0.3),
    vary("least_cosine", 0.5, 0.9999, grid=16, reach=0.3),
    vary("reach", 0.1, 0.3, grid=16),
    vary("offset", 0.02, -0.02),
    vary("as_published", "rsm_weight_squared"),
])

VPL = Table({"lights": 96}, [
    vary("lights", 64, 200, on=("cornell_box", "stage", "two_lamps")),
    vary("pattern", "grid", "all", "random", on=("cornell_box", "stage", "two_lamps")),
    vary("seed", 7),
    vary("seed", 7, pattern="random"),
    vary("filtered", True),
    vary("filtered", True, pattern="grid"),
    vary("visibility", False, on=("cornell_box", "stage", "ring")),
    vary("batch", 5000, same=BATCH),
    vary("maps", "imperfect", on=("cornell_box", "stage", "ring")),
    vary("points", 500, 3000, maps="imperfect"),
    vary("resolution", 32, maps="imperfect"),
    vary("splat", 0.3, maps="imperfect"),
    vary("levels", 2, maps="imperfect"),
    vary("bias", 0.5, maps="imperfect"),
    vary("seed", 7, maps="imperfect"),
    vary("batch", 5000, maps="imperfect", same=BATCH),
], {"as_published": "forms of the maps that `sii` has cases of"}, ("lights.source", "lights.openness"))

TRUTH = Table({"samples": 24}, [
    vary("estimator", "hemisphere", "light"),
    vary("samples", 72),
    vary("target_error", 0.9, samples=96),
    vary("visibility", False),
    vary("visibility", False, estimator="hemisphere"),
    vary("emitters", "seen"),
    vary("emitters", "seen", estimator="light"),
    vary("bounces", 3),
    vary("bounces", 3, estimator="hemisphere"),
    vary("caustics", True, on=CAUSTIC, photons=4096),
    vary("photons", 2048, on=CAUSTIC, **CAUSTICS),
    vary("bounces", 3, on=CAUSTIC, **CAUSTICS),
    vary("seed", 7),
    vary("seed", 7, on=CAUSTIC, **CAUSTICS),
    vary("light_grid", 16),
    vary("interleave", 2),
    vary("uniform_share", 0.9),
    vary("picks", 4),
    vary("directions", 3),
    vary("directions", 3, estimator="hemisphere"),
    vary("bound", 0.5, on=("cornell_box", *GLOSSY)),
    vary("batch", 5000, same=BATCH),
    vary("batch", 5000, on=CAUSTIC, same=BATCH, **CAUSTICS),
], {"seconds": "depends on the time that passes", "checkpoint": "writes a file and changes no picture"})

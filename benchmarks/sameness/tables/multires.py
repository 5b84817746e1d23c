"""What is varied of `multires`."""

import math

from benchmarks.sameness.rows import Table, vary
from benchmarks.sameness.tables.lights import LIGHTS, OPENNESS, PAIRS

CURVED = ("cornell_sphere", "stage")
SUBSPLATS = "both ways find the same subsplats"

TABLE = Table({"lights": 96, "coarsest": 6}, [
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

"""Settings of pixel lights and of pairs, which three methods share."""

from benchmarks.sameness.rows import Row, vary

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

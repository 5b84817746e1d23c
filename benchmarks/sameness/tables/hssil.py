"""What is varied of `hssil`, and of the temporal filter."""

from benchmarks.sameness.rows import Table, vary

VIEWS = (("cornell_box", "cornell_side"), ("stage", "stage_side"))
SLICED = {"visibility": "bitmask"}
TRACED = {"visibility": "rays"}

TABLE = Table({"radius": 3.0, "levels": 3, "samples": 16}, [
    vary("radius", 2.0, None),
    vary("levels", 1, 2),
    vary("samples", 40),
    vary("samples", 40, pattern="pixel"),
    vary("samples", 40, **SLICED),
    vary("inner_samples", 0, 16),
    vary("inner_samples", 0, 16, **SLICED),
    vary("start", "full", "quarter"),
    *(vary("pattern", "row", "pixel", "fixed", "all", form_factor=how) for how in ("disc", "point")),
    vary("pattern", "row", "pixel", "fixed", **SLICED),
    vary("pattern", "row", "pixel", "fixed", "all", **TRACED),
    vary("tile", 1, 2, 8),
    *(vary("density", "uniform", pattern=how) for how in ("interleaved", "row", "pixel", "fixed")),
    vary("density", "uniform", **SLICED),
    vary("density", "uniform", **TRACED),
    vary("blur", None),
    vary("blur", None, pattern="row", density="uniform"),
    vary("blur", None, pattern="pixel", density="uniform"),
    vary("blur", None, density="uniform", **SLICED),
    vary("blur", None, density="uniform", pattern="row", **TRACED),
    vary("blur.size", 3, 8),
    vary("blur.plane_tolerance", 0.001),
    vary("blur.cosine", -1.0),
    vary("seed", 7),
    vary("seed", 7, pattern="pixel"),
    vary("seed", 7, **SLICED),
    vary("seed", 7, pattern="pixel", **SLICED),
    vary("seed", 7, **TRACED),
    vary("downsample", "average", "closest_average"),
    vary("form_factor", "point"),
    vary("form_factor", "point", **SLICED),
    vary("form_factor", "point", **TRACED),
    vary("only_level", 0, 1, 2),
    vary("upsampling", "bilinear", "nearest"),
    vary("depth_sigma", 0.2),
    vary("normal_power", 3.0),
    vary("visibility", "bitmask", "rays"),
    vary("slices", 2, **SLICED),
    vary("thickness", 0.2, **SLICED),
    vary("cameras", 1, 2),
    *(vary("views", view, on=(scene,)) for scene, view in VIEWS),
    *(vary("views", view, on=(scene,), **TRACED) for scene, view in VIEWS),
    vary("depth_tolerance", 0.0001, 0.5, cameras=1, normal_cosine=-1.0),
    vary("normal_cosine", -1.0, cameras=1),
    vary("as_published", "hss_tan_f", "hss_disc_pi", "hss_level_factor"),
    vary("as_published", "hss_tan_f", "hss_disc_pi", "hss_level_factor", **SLICED),
])

TEMPORAL = Table({}, [
    vary("weight", 0.0, 0.5),
    vary("form", "printed"),
    vary("depth_tolerance", 0.0005),
    vary("normal_cosine", 0.999999),
    vary("speed", 1.0),
    vary("fetch", "nearest"),
])

"""What is varied of `hssil`, and of the temporal filter."""

from benchmarks.sameness.rows import Table, vary

VIEWS = (("cornell_box", "cornell_side"), ("stage", "stage_side"))
SLICED = {"visibility": "bitmask"}
TRACED = {"visibility": "rays"}

TABLE = Table({"radius": 3.0, "levels": 3, "samples": 16, "downsample": "closest"}, [
    vary("radius", 2.0, None),
    vary("levels", 1, 2),
    vary("samples", 40),
    vary("samples", 40, pattern="pixel"),
    vary("samples", 40, **SLICED),
    vary("inner_samples", 0, 16),
    vary("inner_samples", 0, 16, **SLICED),
    vary("start", "full", "quarter"),
    *(vary("pattern", "pixel", "fixed", "all", form_factor=how) for how in ("disc", "point")),
    vary("pattern", "pixel", "fixed", **SLICED),
    vary("pattern", "pixel", "fixed", "all", **TRACED),
    vary("seed", 7),
    vary("seed", 7, pattern="pixel"),
    vary("seed", 7, **SLICED),
    vary("seed", 7, pattern="pixel", **SLICED),
    vary("seed", 7, **TRACED),
    vary("downsample", "average", "closest_average", "resampled"),
    vary("downsample", "resampled", **SLICED),
    vary("downsample", "resampled", **TRACED),
    vary("downsample", "resampled", start="full"),
    vary("downsample", "resampled", start="quarter"),
    vary("seed", 7, downsample="resampled", pattern="all"),
    vary("form_factor", "texel", "point"),
    vary("form_factor", "texel", **SLICED),
    vary("form_factor", "texel", **TRACED),
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

TEMPORAL = Table({"warm_up": False}, [
    vary("warm_up", True),
    vary("entering_speed", 4.0),
    vary("clamp", 0.5),
    vary("clamp_radius", 1, clamp=0.5),
    vary("weight", 0.0, 0.5),
    vary("form", "printed"),
    vary("depth_tolerance", 0.0005),
    vary("normal_cosine", 0.999999),
    vary("speed", 1.0),
    vary("fetch", "nearest"),
])

"""What is varied of `val`, of `hssil` and of the temporal filter."""

from benchmarks.sameness.splat_tables import LIGHTS, PAIRS, Table, vary

BEHIND = ("cornell_box", "ring")  # with receivers behind area lights; the ring is glossy
BIASED_STEP = {"visibility": "step", "receiver_plane": False, "bias": 0.05}
BLOCKS = {"interleaving": 3}

CLUSTERS = [
    vary("area_lights", 3, 20),
    vary("distance", "raw"),
    vary("distance", "squared"),
    vary("position_weight", 0.1),
    vary("normal_weight", 0.9),
    vary("rounds", 1),
    vary("axes", "pca", "min_area"),
    vary("extent", "longer", "shorter"),
    vary("unbiased_area", True),
    vary("foreshortened", True),
]
MAPS = [
    vary("map_resolution", 33),
    vary("maps", "rays"),
    vary("near_geometry", "keep", "planes"),
    vary("near_geometry", "keep", "planes", maps="rays"),
    vary("near_geometry", "keep", "planes", visibility="rectangle"),
    vary("near_distance", 0.1),
    vary("near_distance", 0.1, near_geometry="planes"),
    vary("near_distance", 0.1, visibility="rectangle"),
    vary("occluders_alone", False),
    vary("occluders_alone", False, maps="rays"),
    vary("behind", "dual_paraboloid", "raytrace", on=BEHIND),
    *(vary("behind", "dual_paraboloid", "raytrace", on=BEHIND, visibility=how)
      for how in ("step", "hard", "back_projection")),
    vary("behind", "dual_paraboloid", on=BEHIND, visibility="rectangle"),
    vary("behind", "raytrace", on=BEHIND, visibility="rectangle"),
]
VISIBILITY = [
    vary("visibility", "step", "pcf", "hard", "back_projection", "rectangle", "members", "none"),
    vary("texels", 3, 9, visibility="pcf"),
    vary("terms", 1, 8),
    vary("depth_scale", "map", "scene"),
    vary("depth_scale", "map", "scene", **BIASED_STEP),
    vary("prefilter", "brute"),
    vary("bias", 0.0, 0.05),
    vary("bias", 0.05, 0.2, visibility="step", receiver_plane=False),
    vary("attenuation", 0.5),
    vary("rescale", "scale2", "plateau", attenuation=0.5),
    vary("quantisation", "published"),
    vary("quantisation", "published", prefilter="brute"),
    vary("receiver_plane", False, visibility="step"),
    vary("cone", False, visibility="step"),
    vary("blocker_depth", "axial", visibility="step"),
    *(vary("as_published", "val_alpha", "val_alpha_over_pi", "val_search_solid_angle", prefilter=how)
      for how in ("mip", "brute")),
    vary("as_published", "val_alpha", "val_search_solid_angle", visibility="step"),
]
LIGHTING = [
    vary("interleaving", 2, 4),
    vary("dealing", "cluster", **BLOCKS),
    vary("blur", "none", "box", **BLOCKS),
    vary("blur_extent", 0.02, **BLOCKS),
    vary("every_subset", False, **BLOCKS),
    vary("blur_cosine", 0.99, -1.0, on=("cornell_sphere", "stage"), **BLOCKS),
    vary("subsplats.target", 0.5, clamp="disc", visibility="none"),
    vary("subsplats.coarsest", 4, clamp="disc", visibility="none"),
    vary("clamp", "none", same="what the cases start from"),
    vary("clamp", "disc"),
    vary("clamp", "auto"),
]

VAL = Table({"lights": 96, "area_lights": 8, "map_resolution": 64, "clamp": "none"},
              [*PAIRS, *LIGHTS, *CLUSTERS, *MAPS, *VISIBILITY, *LIGHTING],
              {"visibility.constant_bias": "receiver_plane=False chooses it",
               "visibility.constant_bias.value": "bias is it with visibility=step",
               "visibility.constant_bias.scale": "depth_scale is it with visibility=step"})


VIEWS = (("cornell_box", "cornell_side"), ("stage", "stage_side"))
SLICED = {"visibility": "bitmask"}
TRACED = {"visibility": "rays"}

HSSIL = Table({"radius": 3.0, "levels": 3, "samples": 16, "downsample": "closest"}, [
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
    vary("blur", "none"),
    vary("blur", "none", pattern="row", density="uniform"),
    vary("blur", "none", pattern="pixel", density="uniform"),
    vary("blur", "none", density="uniform", **SLICED),
    vary("blur", "none", density="uniform", pattern="row", **TRACED),
    vary("blur.size", 3, 8),
    vary("blur.plane_tolerance", 0.001),
    vary("blur.cosine", -1.0),
    vary("seed", 7),
    vary("seed", 7, pattern="pixel"),
    vary("seed", 7, **SLICED),
    vary("seed", 7, pattern="pixel", **SLICED),
    vary("seed", 7, **TRACED),
    vary("downsample", "closest", same="what the cases start from"),
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
    vary("disc_share", 0.0, 0.5, 1.0),
    vary("disc_share", 0.5, pattern="pixel"),
    vary("disc_share", 0.5, **SLICED),
    vary("disc_share", 0.5, **TRACED),
    vary("only_level", 0, 1, 2),
    vary("upsampling", "bilinear", "nearest"),
    vary("depth_sigma", 0.2),
    vary("normal_power", 3.0),
    vary("visibility", "bitmask", "rays"),
    vary("slices", 2, **SLICED),
    vary("thickness", 0.2, **SLICED),
    *(vary("views", view, on=(scene,)) for scene, view in VIEWS),
    *(vary("views", view, on=(scene,), **TRACED) for scene, view in VIEWS),
    *(vary("depth_tolerance", 0.0001, 0.5, on=(scene,), views=view, normal_cosine=-1.0) for scene, view in VIEWS),
    *(vary("normal_cosine", -1.0, on=(scene,), views=view) for scene, view in VIEWS),
    vary("as_published", "hss_tan_f", "hss_disc_pi", "hss_level_factor"),
    vary("as_published", "hss_tan_f", "hss_disc_pi", "hss_level_factor", **SLICED),
])

TEMPORAL = Table({"warm_up": False}, [
    vary("warm_up", False, same="what the cases start from"),
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

"""What is varied of `val`."""

from benchmarks.sameness.rows import Table, vary
from benchmarks.sameness.tables.lights import LIGHTS, PAIRS

BEHIND = ("cornell_box", "ring")  # with receivers behind area lights; the ring is glossy
BIASED_STEP = {"visibility": "step", "receiver_plane": False, "bias": 0.05}
BLOCKS = {"interleaving": 3}

CLUSTERS = [
    vary("area_lights", 3, 20),
    vary("target_error", 0.3, 0.1, area_lights=30),
    vary("seed", 7, on=("stage",), area_lights=30, target_error=0.1, pattern="grid"),
    vary("distance", "raw"),
    vary("distance", "squared"),
    vary("position_weight", 0.1),
    vary("normal_weight", 0.9),
    vary("rounds", 1),
    vary("axes", "pca", "min_area"),
    vary("extent", "longer", "shorter"),
    vary("unbiased_area", True),
    vary("foreshortened", True),
    vary("single_light", "footprint", area_lights=96),
    vary("single_light", "footprint", area_lights=96, visibility="step"),
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

TABLE = Table({"lights": 96, "area_lights": 8, "map_resolution": 64, "clamp": "none"},
              [*PAIRS, *LIGHTS, *CLUSTERS, *MAPS, *VISIBILITY, *LIGHTING],
              {"clusters": "target_error chooses it", "visibility.constant_bias": "receiver_plane=False chooses it",
               "visibility.constant_bias.value": "bias is it with visibility=step",
               "visibility.constant_bias.scale": "depth_scale is it with visibility=step"})

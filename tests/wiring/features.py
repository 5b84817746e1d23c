"""Which features of docs/features.md a case of wiring shows: those whose setting it has under test."""

from collections.abc import Mapping
from typing import Any

import pytest

from tests.wiring.cases import Case

# a setting by its last words, or a choice of one: features that it belongs to
PAIRS = {
    "clamp": "SII-27 REF-08", "clamp = sphere": "REF-09", "pairs.offset": "SII-27", "lobe.norm": "SII-05",
    "lobe.widening": "SII-07", "as_published = sii_no_pi": "SII-04 REF-20", "as_published = sii_widening": "REF-20",
    "as_published = sii_widening_unnorm": "REF-20",
}
LIGHTS = {
    "count": "SII-10 SII-26", "seed": "SII-10 SII-14 SII-16 SII-17", "source.projection": "SII-02",
    "source.pattern": "SII-10", "source.filtered": "SII-03",
    "source.warp = A": "SII-11", "source.warp = B": "SII-12", "source.warp.levels": "SII-11 SII-12",
    "source.warp.importance": "SII-14", "source.warp.defensive": "REF-13", "source.warp.renormalise_weights": "SII-13",
    "source.refraction": "SII-09", "source = walk": "SII-17", "source.bounces": "REF-16", "openness.flux": "SII-16",
    "openness.radius": "SII-15", "openness.rays": "SII-15", "openness.floor": "SII-14 SII-16",
    "as_published = sii_no_tn": "SII-13 REF-20", "as_published = equal_solid_angle": "AMS-16 REF-20",
    "as_published = sii_peak": "REF-20", "as_published = sii_openness": "SII-16 REF-20",
}
SII = PAIRS | {
    "reach.cut": "SII-21", "reach.bound": "SII-18", "bound.faces": "SII-20", "bound.inflate": "SII-20",
    "reach.stochastic": "REF-12", "reach.seed": "REF-12", "half_resolution": "SII-22", "quantisation": "SII-31",
    "compensation": "REF-11", "as_published = per_light_ilow": "SII-21 REF-20", "ambient_occlusion": "SII-32",
}
SHADOWS = {
    "clusters.count": "VAL-04", "clusters.distance": "VAL-05", "clusters.normal_weight": "VAL-08",
    "clusters.position_weight": "VAL-08", "clusters.rounds": "VAL-05 VAL-06",
    "area": "VAL-09", "maps.resolution": "VAL-03 VAL-11", "maps.renderer": "VAL-03", "maps.near_geometry": "VAL-22",
    "maps.near_distance": "VAL-22", "maps.occluders_alone": "VAL-22", "maps.behind": "VAL-21",
    "visibility = hard": "VAL-03", "visibility = rays_vpls": "VAL-02", "visibility = back_projection": "REF-15",
    "visibility = rays_rectangle": "REF-15 VAL-19", "visibility = pcss": "VAL-13 VAL-14", "visibility = pcf": "VAL-12",
    "visibility.terms": "VAL-12", "visibility.bias": "VAL-18", "visibility.depth_scale": "VAL-12",
    "visibility.prefilter": "VAL-16", "visibility.attenuation": "VAL-18", "visibility.rescale": "VAL-18",
    "visibility.quantisation": "VAL-17", "visibility.cone": "VAL-14", "visibility.blocker_depth": "VAL-14",
    "visibility.constant_bias": "VAL-14", "visibility.texels": "VAL-12", "as_published = val_alpha": "VAL-15 REF-20",
    "as_published = val_alpha_over_pi": "VAL-15 REF-20", "as_published = val_search_solid_angle": "VAL-14 REF-20",
}
VAL = SHADOWS | {"visibility = none": "VAL-01", "interleaving": "VAL-23", "blur": "VAL-24"}
MULTIRES = PAIRS | {
    "lights.count": "AMS-01", "pairs.clamp": "AMS-17",
    "criteria.depth": "AMS-02", "criteria.derivative": "AMS-03", "criteria.normal": "AMS-04",
    "criteria.curvature": "AMS-05", "subsplats.coarsest": "AMS-06 AMS-07", "subsplats.finest": "AMS-06 AMS-07",
    "criteria.traversal": "AMS-09", "criteria.rim": "AMS-12", "criteria.diagonal": "AMS-12",
    "subsplats = irradiance": "AMS-08", "subsplats.threshold": "AMS-08", "subsplats.form": "AMS-08",
    "subsplats.upsampling": "AMS-11", "detail": "AMS-14", "supersampled": "AMS-15",
    "as_published = ams_disc": "AMS-17 REF-20", "as_published = ams_rho_in_splat": "AMS-10 REF-20",
    "as_published = ams_filter_all": "AMS-11 REF-20", "as_published = ams_all_corners": "AMS-11 REF-20",
    "subsplats.visibility = rays": "AMS-18 REF-02", "subsplats.criteria = geometry": "AMS-08",
    "subsplats.representative": "AMS-10", "ambient_occlusion": "SII-32",
}
HSSIL = {
    "samples": "HSS-06", "pattern": "HSS-05 HSS-06", "tile": "HSS-06", "inner_samples": "HSS-05", "blur": "HSS-06",
    "radius": "HSS-05 HSS-07", "levels": "HSS-07 HSS-08 HSS-12", "start": "HSS-07", "only_level": "HSS-07",
    "density": "HSS-05", "downsample": "HSS-09", "form_factor": "HSS-04", "disc_share": "HSS-04",
    "depth_sigma": "HSS-11 HSS-12", "normal_power": "HSS-11 HSS-12", "upsampling": "HSS-11 HSS-12",
    "visibility": "HSS-17",
    "visibility = rays": "REF-02", "cameras": "HSS-15", "as_published = hss_tan_f": "HSS-02 REF-20",
    "as_published = hss_disc_pi": "HSS-04 REF-20", "as_published = hss_level_factor": "HSS-08 REF-20",
}
TEMPORAL = {
    "weight": "HSS-13", "form": "HSS-13", "depth_tolerance": "HSS-13", "normal_cosine": "HSS-13", "speed": "HSS-14",
    "fetch": "HSS-13", "warm_up": "HSS-13", "entering_speed": "HSS-13", "clamp": "HSS-13",
}
GATHER = {"disc": "SII-25", "interpolation": "SII-25", "as_published = rsm_weight_squared": "SII-25 REF-20"}
VPL = {"lights": "REF-02 REF-03 VAL-02", "visibility": "REF-02 VAL-02", "maps": "REF-17"}


def featured(cases: Mapping[str, Case], features: Mapping[str, str]) -> list[Any]:
    """Return the names of cases as parameters, marked with the features whose settings they have under test."""
    shown = {name: sorted({feature for word, several in features.items() for feature in several.split()
                           if any(_holds(word, *item) for item in case.values.items())})
             for name, case in cases.items()}
    return [pytest.param(name, marks=[pytest.mark.feature(*own)] if own else []) for name, own in shown.items()]


def _holds(word: str, key: str, value: Any) -> bool:
    setting, _, choice = word.partition(" = ")
    if not choice:
        return f".{setting}." in f".{key}."
    chosen = choice in value if isinstance(value, set | frozenset) else value == choice
    return f".{key}".endswith(f".{setting}") and chosen

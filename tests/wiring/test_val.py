"""Every setting of `val`: the picture is that of the loops, and heeding the setting shows."""

import numpy as np
import pytest

from refgi.cluster.settings import ValSettings
from refgi.cluster.val import val
from refgi.lights.settings import LightSettings
from refgi.pairs.settings import PairSettings
from tests.naive import clustered
from tests.wiring.cases import Case, needed, uncovered

ROUNDING = 1e-9  # of the brightest pixel: float64 in another order
FLOAT32_RAYS = 2e-6  # the same, where depths come from rays in float32: a few times 6e-8
COUNTS = 1e-3  # of the brightest pixel: a key that is not heeded

SHARED = {*needed(LightSettings), *needed(PairSettings)}  # cases of those that several methods have stand elsewhere
BASE = {"lights": 48, "maps": 16, "interleaving": 1}
FEW, ONE = {"clusters.count": 4}, {"clusters.count": 1, "maps.near_distance": 0.1}
ADAPTIVE = {"clusters": "adaptive", "clusters.target_error": 0.09, "visibility": "pcss"}
PCSS, BACK, BLOCKS = {"visibility": "pcss"}, {"visibility": "back_projection"}, {"interleaving": 4}


def few(values, over=None, **options):
    """Return a case with four area lights."""
    return Case(values, FEW | (over or {}), **options)


CASES = {
    "fewer lights": few({"lights": 31}),
    "lights behind their surface": few({"pairs.offset": 0.05}, {"pairs.clamp": "distance", "pairs.clamp.value": 0.6}),
    "more clusters": Case({"clusters.count": 7}),
    "distances as printed": Case({"clusters.distance": "raw"}, {"clusters.count": 5}),
    "distances squared": few({"clusters.distance": "squared"}),
    "positions alone": few({"clusters.normal_weight": 0.0}),
    "normals first": few({"clusters.position_weight": 0.05}),
    "one round": few({"clusters.rounds": 1}),
    "as many as it takes": Case({"clusters": "adaptive"}),
    "adaptive, a lower target": Case({"clusters.target_error": 0.05}, ADAPTIVE),
    "adaptive, as printed": Case({"clusters.distance": "raw"}, ADAPTIVE),
    "adaptive, squared": Case({"clusters.distance": "squared"}, ADAPTIVE),
    "adaptive, positions alone": Case({"clusters.normal_weight": 0.0}, ADAPTIVE),
    "adaptive, normals first": Case({"clusters.position_weight": 0.05}, ADAPTIVE),
    "adaptive, one round": Case({"clusters.rounds": 1}, ADAPTIVE),
    "principal axes": few({"area.axes": "pca"}),
    "least area": few({"area.axes": "min_area"}),
    "the longer side": few({"area.extent": "longer"}),
    "the shorter side": few({"area.extent": "shorter"}),
    "unbiased areas": few({"area.unbiased_area": True}),
    "foreshortened": few({"area.foreshortened": True}),
    "single lights with their footprint": Case({"area.single_light": "footprint"}, {"clusters.count": 40, **PCSS}),
    "finer maps": few({"maps.resolution": 24}),
    "maps by rays": few({"maps.renderer": "rays"}, same="both renderers find the same distances"),
    "near geometry kept": few({"maps.near_geometry": "keep"}),
    "near planes left out": few({"maps.near_geometry": "planes"}),
    "a larger ball": few({"maps.near_distance": 0.9}),
    "walls in the maps": few({"maps.occluders_alone": False}),
    "a map behind": Case({"maps.behind": "dual_paraboloid"}, ONE),
    "rays from behind": Case({"maps.behind": "raytrace"}, ONE),
    "a map behind, PCSS": Case({"maps.behind": "dual_paraboloid"}, ONE | PCSS),
    "a map behind, back projection": Case({"maps.behind": "dual_paraboloid"}, ONE | BACK),
    "rays from behind, back projection": Case({"maps.behind": "raytrace"}, ONE | BACK),
    "rays from behind, rays to the rectangle": Case({"maps.behind": "raytrace"},
                                                    {"clusters.count": 2, "visibility": "rays_rectangle"}),
    "near planes do not stop rays to the rectangle": few({"maps.near_geometry": "planes"},
                                                         {"visibility": "rays_rectangle"}),
    "PCSS": few(PCSS),
    "PCF": few({"visibility": "pcf"}),
    "hard": few({"visibility": "hard"}),
    "back projection": few({"visibility": "back_projection"}),
    "rays to the rectangle": few({"visibility": "rays_rectangle"}),
    "rays to pixel lights": few({"visibility": "rays_vpls"}),
    "no shadows": few({"visibility": "none"}),
    "two terms": few({"visibility.terms": 2}),
    "depths in metres": few({"visibility.depth_scale": "map"}),
    "depths to the scene's end": few({"visibility.depth_scale": "scene"}),
    "exact means": few({"visibility.prefilter": "brute"}),
    "a bias": few({"visibility.bias": 0.12}),
    "attenuated": few({"visibility.attenuation": 1.0}),
    "twice the series": few({"visibility.rescale": "scale2"}),
    "a plateau of one": few({"visibility.rescale": "plateau"}, {"visibility.attenuation": 1.0}),
    "8 and 16 bits": Case({"visibility.quantisation": "published"}, {"clusters.count": 5}),
    "8 and 16 bits, exact means": few({"visibility.quantisation": "published"}, {"visibility.prefilter": "brute"}),
    "blockers beside the cone": few({"visibility.cone": False}, PCSS),
    "a constant bias": few({"visibility.constant_bias": "constant_bias"}, PCSS),
    "a larger constant bias": few({"visibility.constant_bias.value": 0.1},
                                  PCSS | {"visibility.constant_bias": "constant_bias"}),
    "a constant bias in metres": few({"visibility.constant_bias.scale": "map"}, PCSS | {
        "visibility.constant_bias": "constant_bias", "visibility.constant_bias.value": 0.03}),
    "a constant bias of the scene": few({"visibility.constant_bias.scale": "scene"}, PCSS | {
        "visibility.constant_bias": "constant_bias", "visibility.constant_bias.value": 0.1}),
    "a small kernel": few({"visibility.texels": 3}, {"visibility": "pcf"}),
    "blocks": few(BLOCKS),
    "blocks by cluster": few({"interleaving.assignment": "cluster"}, BLOCKS),
    "a box": few({"blur": "box"}, BLOCKS),
    "not blurred": few({"blur": "none"}, BLOCKS),
    "a wide blur": few({"blur.extent": 0.4}, BLOCKS),
    "a blur around corners": few({"blur.cosine": -1.0}, BLOCKS | {"blur.extent": 0.4}),
    "the printed angle": few({"as_published": {"val_alpha"}}),
    "the printed square": few({"as_published": {"val_alpha_over_pi"}}),
    "the printed square, exact means": few({"as_published": {"val_alpha_over_pi"}}, {"visibility.prefilter": "brute"}),
    "the printed search": few({"as_published": {"val_search_solid_angle"}}),
}

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # what a clamp takes


def test_every_field_has_a_case():
    assert uncovered(ValSettings, CASES, BASE) - SHARED == set()


@pytest.fixture(scope="module", params=CASES)
def made(request):
    """Return the case with its frame, settings and picture."""
    case = CASES[request.param]
    frame, settings = case.seen(), case.settings(ValSettings, BASE)
    return case, frame, settings, val(frame, settings)


def test_the_twin(made, evidence):
    case, frame, settings, picture = made
    expected = clustered.picture(frame, settings)
    off = np.abs(picture - expected).max() / expected.max()
    evidence(f"{case.values}: off by {off:.0e} of the brightest pixel")
    assert off < (FLOAT32_RAYS if settings.maps.renderer == "rays" else ROUNDING)


def test_each_key_counts(made, evidence):
    case, frame, _, picture = made
    for key, settings in case.without(ValSettings, BASE):
        change = np.abs(picture - val(frame, settings)).max() / picture.max()
        evidence(f"{key}: {change:.1e} of the brightest pixel")
        assert (change > COUNTS) == (not case.same)

"""Every setting of `hssil`: the picture is that of the loops, and heeding the setting shows."""

import math

import numpy as np
import pytest

from refgi.scene import Camera
from refgi.sssil.hssil import hssil
from refgi.sssil.settings import HssilSettings
from tests.literal.whole.hssil import picture as by_hand
from tests.wiring.cases import Case, assert_each_key_counts, uncovered
from tests.wiring.features import HSSIL, featured
from tests.wiring.fold import fold

ROUNDING = 1e-9  # of the brightest pixel: float64 in another order

BASE = {"levels": 3, "radius": 2.0, "samples": 9}
SIDES = (Camera((-0.6, 1.2, 0.9), (0.3, 0.4, -0.6), (0.0, 1.0, 0.1), math.radians(80)),
         Camera((0.9, 0.8, 0.7), (-0.5, 0.2, -0.6), (0.1, 1.0, 0.0), math.radians(75)))
VIEWS = {"cameras.views": SIDES}
MASK = {"visibility": "bitmask", "visibility.thickness": 0.05}

CASES = {
    "more samples": Case({"samples": 14}),
    "wider crowns": Case({"radius": 3.0}),
    "the smallest radius": Case({"radius": None}, {"levels": 2}),
    "two levels": Case({"levels": 2}, {"radius": 1.0}),
    "from full resolution": Case({"start": "full"}),
    "from quarter resolution": Case({"start": "quarter"}, {"levels": 2}),
    "a row's samples": Case({"pattern": "row"}),
    "tiles of two": Case({"tile": 2}),
    "uniform": Case({"density": "uniform"}),
    "uniform, a row's samples": Case({"density": "uniform"}, {"pattern": "row"}),
    "uniform, a pixel's samples": Case({"density": "uniform"}, {"pattern": "pixel"}),
    "uniform, fixed samples": Case({"density": "uniform"}, {"pattern": "fixed", "samples": 11}),
    "uniform, past a bitmask": Case({"density": "uniform"}, MASK),
    "uniform, past rays": Case({"density": "uniform"}, {"visibility": "rays"}),
    "no blur": Case({"blur": None}),
    "no blur, a pixel's samples": Case({"blur": None}, {"pattern": "pixel"}),
    "no blur past a bitmask": Case({"blur": None}, MASK),
    "no blur past rays": Case({"blur": None}, {"visibility": "rays"}),
    "a blur over three texels": Case({"blur.size": 3}),
    "a blur across steps": Case({"blur.plane_tolerance": 0.3}),
    "a blur around edges": Case({"blur.cosine": -1.0}, {"blur.plane_tolerance": 0.3}),
    "a pixel's samples": Case({"pattern": "pixel"}),
    "fixed samples": Case({"pattern": "fixed"}, {"samples": 11}),
    "every texel": Case({"pattern": "all"}),
    "a seed": Case({"seed": 5}),
    "a seed, a pixel's samples": Case({"seed": 5}, {"pattern": "pixel"}),
    "a seed, fixed samples": Case({"seed": 5}, {"pattern": "fixed"}),
    "five inner samples": Case({"inner_samples": 5}, {"pattern": "fixed"}),
    "no inner samples": Case({"inner_samples": 0}),
    "averages": Case({"downsample": "average"}),
    "closest places, average light": Case({"downsample": "closest_average"}),
    "closest senders": Case({"downsample": "closest"}),
    "closest senders, from full resolution": Case({"downsample": "closest"}, {"start": "full"}),
    "closest senders, from quarter resolution": Case({"downsample": "closest"}, {"start": "quarter", "levels": 2}),
    "a seed, every texel": Case({"seed": 5}, {"pattern": "all", "downsample": "resampled"}),
    "closest senders, a pixel's samples": Case({"downsample": "closest"}, {"pattern": "pixel"}),
    "closest senders past a bitmask": Case({"downsample": "closest"}, MASK),
    "closest senders, a pixel's samples past a bitmask": Case({"downsample": "closest"}, MASK | {"pattern": "pixel"}),
    "closest senders past rays": Case({"downsample": "closest"}, {"visibility": "rays"}),
    "drawn senders, the tangents of whole angles": Case({"as_published": {"hss_tan_f"}}, {"downsample": "resampled"}),
    "points": Case({"form_factor": "point"}),
    "discs of half their samples": Case({"disc_share": 0.5}),
    "discs of all, a pixel's samples": Case({"disc_share": 1.0}, {"pattern": "pixel"}),
    "discs of half, a pixel's samples": Case({"disc_share": 0.5}, {"pattern": "pixel"}),
    "discs of all past a bitmask": Case({"disc_share": 1.0}, MASK),
    "discs of half past a bitmask, a pixel's samples": Case({"disc_share": 0.5}, MASK | {"pattern": "pixel"}),
    "discs of half past rays": Case({"disc_share": 0.5}, {"visibility": "rays"}),
    "discs of half past rays, a pixel's samples": Case({"disc_share": 0.5}, {"visibility": "rays", "pattern": "pixel"}),
    "discs of texels": Case({"form_factor": "texel"}),
    "discs of texels, a pixel's samples": Case({"form_factor": "texel"}, {"pattern": "pixel"}),
    "discs of texels past a bitmask": Case({"form_factor": "texel"}, MASK),
    "discs of texels past rays": Case({"form_factor": "texel"}, {"visibility": "rays"}),
    "discs of texels, no pi": Case({"as_published": {"hss_disc_pi"}}, {"form_factor": "texel"}),
    "the second level alone": Case({"only_level": 1}),
    "wide in depth": Case({"depth_sigma": 0.3}),
    "wide in normals": Case({"normal_power": 2.0}, {"depth_sigma": 0.3}, scene="smooth"),
    "any normal": Case({"normal_power": 0.0}),
    "bilinear": Case({"upsampling": "bilinear"}),
    "nearest": Case({"upsampling": "nearest"}),
    "a bitmask": Case({"visibility": "bitmask"}),
    "thick surfaces": Case({"visibility.thickness": 0.2}, MASK),
    "two slices": Case({"visibility.slices": 2}, MASK),
    "a bitmask, fixed samples": Case({"pattern": "fixed"}, MASK),
    "a bitmask, a pixel's samples": Case({"pattern": "pixel"}, MASK),
    "a bitmask, points": Case({"form_factor": "point"}, MASK),
    "a bitmask, a seed": Case({"seed": 3}, MASK),
    "a bitmask, no inner samples": Case({"inner_samples": 0}, MASK),
    "a bitmask, the smallest radius": Case({"radius": None}, MASK | {"levels": 2}),
    "rays": Case({"visibility": "rays"}),
    "rays, tiles of two": Case({"tile": 2}, {"visibility": "rays"}),
    "rays, a row's samples": Case({"pattern": "row"}, {"visibility": "rays"}),
    "rays, fixed samples": Case({"pattern": "fixed"}, {"visibility": "rays"}),
    "rays, a pixel's samples": Case({"pattern": "pixel"}, {"visibility": "rays"}),
    "rays, points": Case({"form_factor": "point"}, {"visibility": "rays"}),
    "rays, the smallest radius": Case({"radius": None}, {"visibility": "rays", "levels": 2}),
    "rays, on a smooth ball": Case({"visibility": "rays"}, scene="smooth"),
    # texels of one plane may be equally near where bilateral weights vanish: rounding decides between them, so that
    # views beside others are bilinear
    "further views": Case(VIEWS),
    "views, a larger tolerance": Case({"cameras.depth_tolerance": 0.2},
                                      VIEWS | {"cameras.normal_cosine": -1.0, "upsampling": "bilinear"}),
    "views, any normal": Case({"cameras.normal_cosine": -1.0}, VIEWS | {"cameras.depth_tolerance": 0.2}),
    "the tangents of whole angles": Case({"as_published": {"hss_tan_f"}}),
    "no pi": Case({"as_published": {"hss_disc_pi"}}),
    "levels count twice": Case({"as_published": {"hss_level_factor"}}),
    "no pi past a bitmask": Case({"as_published": {"hss_disc_pi"}}, MASK),
    "no pi past rays": Case({"as_published": {"hss_disc_pi"}}, {"visibility": "rays"}),
    "levels count twice past a bitmask": Case({"as_published": {"hss_level_factor"}}, MASK),
    "levels count twice past rays": Case({"as_published": {"hss_level_factor"}}, {"visibility": "rays"}),
}


def known(settings):
    """Tell whether there is a picture: tan f ends below the angle of other cameras, some levels alone are dark."""
    alone = settings.senders.only_level is not None and settings.sampling.first_level != 1
    return not ("hss_tan_f" in settings.as_published and settings.cameras.views) and not alone


FOLDED = fold(HssilSettings, CASES, BASE, fits=known)

pytestmark = pytest.mark.filterwarnings("ignore:radius")  # crowns that end before the picture does


def test_every_field_has_a_case():
    assert uncovered(HssilSettings, CASES, BASE) == set()


@pytest.mark.parametrize("name", featured(FOLDED, HSSIL))
def test_the_literal_text(name, evidence):
    case = FOLDED[name]
    frame, settings = case.seen(), case.settings(HssilSettings, BASE)
    expected = by_hand(frame, settings)
    off = np.abs(hssil(frame, settings) - expected).max() / expected.max()
    evidence(f"{case.parts}: off by {off:.0e} of the brightest pixel")
    assert off < ROUNDING


@pytest.mark.parametrize("name", CASES)
def test_each_key_counts(name):
    assert_each_key_counts(CASES[name], HssilSettings, hssil, BASE)

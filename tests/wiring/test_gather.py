"""Wiring of `gather`: every setting reaches the picture as the whole-method twin has it."""

import math

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.scene import DirectionalLight, SpotLight
from refgi.splat import GatherSettings, Receivers, gather
from refgi.splat.gather.gather import gather_counted, gather_irradiance
from tests.literal.whole import gather as naive
from tests.wiring.cases import LAMPS, SCENES, Case, assert_each_key_counts, uncovered
from tests.wiring.features import GATHER, featured
from tests.wiring.fold import fold

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # that is told: tests/pairs/test_loss

ROUNDING = 1e-9  # of the brightest pixel

BASE = {"disc.samples": 24, "interpolation.grid": 5}
EVERY = {"interpolation.grid": 17}  # every pixel runs the sum

CASES = {
    "samples": Case({"disc.samples": 40}),
    "a wider disc": Case({"disc.radius": 0.6}, over=EVERY),
    "the whole map": Case({"disc.radius": 1.5}, over=EVERY, scene="smooth"),
    "shifted samples": Case({"disc.seed": 3}),
    "texels behind their surface": Case({"disc.offset": 0.15}, over=EVERY),
    "the printed weight": Case({"disc.as_published": {"rsm_weight_squared"}}),
    "the printed weight, shifted": Case({"disc.as_published": {"rsm_weight_squared"}, "disc.seed": 7,
                                         "disc.radius": 0.8}, scene="spot"),
    "a coarse grid": Case({"interpolation.grid": 7}, over={"interpolation.reach": 0.3}),
    "likeness of normals": Case({"interpolation.least_cosine": -0.5}, over={"interpolation.reach": 0.5}),
    "likeness of places": Case({"interpolation.reach": 0.3}),
    "likeness of a ball": Case({"interpolation.reach": 0.4, "interpolation.least_cosine": 0.3}, scene="smooth"),
}
FOLDED = fold(GatherSettings, CASES, BASE)
EXACT = Case({"interpolation": "none"}, over={"disc.samples": 8}, frame={"width": 70, "height": 66})


def test_every_field_has_a_case():
    assert not uncovered(GatherSettings, CASES, BASE) - {"GatherSettings.interpolation = none"}
    assert "GatherSettings.interpolation = none" not in uncovered(GatherSettings, {"exact": EXACT})


@pytest.mark.parametrize("name", featured(FOLDED, GATHER))
def test_the_literal_text(name):
    check(FOLDED[name].seen(), FOLDED[name].settings(GatherSettings, BASE))


@pytest.mark.parametrize("name", CASES)
def test_each_key_counts(name):
    assert_each_key_counts(CASES[name], GatherSettings, gather, BASE)


def test_without_interpolation():
    """The default's grid has 64 places a side, so the picture has more."""
    check(EXACT.seen(), EXACT.settings(GatherSettings))
    assert_each_key_counts(EXACT, GatherSettings, gather)


def check(frame, settings):
    """Compare the picture, and how many pixels ran the sum, with those by the literal text."""
    got = gather_counted(frame, settings)
    expected, ran = naive.gather(frame, settings)
    np.testing.assert_allclose(got.irradiance, expected, rtol=0, atol=ROUNDING * expected.max())
    np.testing.assert_array_equal(gather(frame, settings), got.irradiance)
    assert got.evaluated == ran
    assert got.covered == np.count_nonzero(frame.gbuffer.covered)


def test_likeness_is_a_share_of_what_is_seen():
    """Of the visible points' box, which in a narrow view is smaller than that of the lit ones."""
    scene = SCENES["lamps"]().with_camera(vfov=math.radians(25))
    frame = Frame(scene, width=17, height=13, rsm_resolution=16, dtype=np.float64)
    assert frame.visible_extent.diagonal < 0.8 * frame.extent.diagonal
    check(frame, CASES["likeness of places"].settings(GatherSettings, BASE))


SPOTS = {
    "a spot beside the view": SpotLight((0.5, 1.5, 0.6), (-0.9, -0.8, -0.3), 0.2, 0.3, (4.0, 2.6, 1.3)),
    "a spot that most receivers lie behind": SpotLight((0.1, 0.8, -0.3), (-1.0, -0.2, -0.4), 0.5, 0.7, (3.0, 2.0, 1.0)),
    "a wide spot": SpotLight((0.5, 1.5, 0.6), (-0.9, -0.8, -0.3), 1.2, 1.4, (4.0, 2.6, 1.3)),
}


@pytest.mark.parametrize("name", SPOTS)
def test_receivers_off_the_map(name):
    """They gather at a place on its border."""
    scene = SCENES["lamps"]().with_lights(SPOTS[name], LAMPS[1])
    frame = Frame(scene, width=17, height=13, rsm_resolution=16, dtype=np.float64)
    check(frame, CASES["a wider disc"].settings(GatherSettings, BASE))


def test_receivers_off_a_map_of_unequal_sides():
    """A directional light's map holds the whole scene, so these receivers have left it."""
    light = DirectionalLight((-0.7, -0.1, -0.6), (0.5, 0.3, 0.9))
    frame = Frame(SCENES["lamps"]().with_lights(light), width=17, height=13, rsm_resolution=16, dtype=np.float64)
    across, down = frame.rsms[0].projection.half
    assert max(across, down) > 1.2 * min(across, down)
    outwards = np.array([1.5, 2.0, 2.5])[:, None, None]
    receivers = Receivers(frame.gbuffer.position * outwards, frame.gbuffer.normal, frame.gbuffer.covered)
    disc = CASES["a wider disc"].settings(GatherSettings, BASE).disc
    expected = naive.every_sum(receivers, frame.rsms, disc)
    np.testing.assert_allclose(gather_irradiance(receivers, frame.rsms, disc), expected, rtol=0,
                               atol=ROUNDING * expected.max())

"""Every setting of `val`: the picture is that of the loops, and heeding the setting shows."""

import numpy as np
import pytest

from refgi.cluster.settings import ValSettings
from refgi.cluster.val import val
from refgi.lights.settings import LightSettings
from tests.literal.whole import val as clustered
from tests.literal.whole.pairs import with_clamp
from tests.wiring.cases import Case, needed, uncovered, under
from tests.wiring.features import VAL, featured
from tests.wiring.fold import fold
from tests.wiring.pair_cases import PAIR_CASES
from tests.wiring.shadow_cases import FEW, few, shadow_cases

ROUNDING = 1e-9  # of the brightest pixel: float64 in another order
FLOAT32_RAYS = 2e-6  # the same, where depths come from rays in float32: a few times 6e-8
SLICES = 1e-5  # the same: the Gauss rule of cut cones is off by up to 1e-4 of a light on its axis
COUNTS = 1e-3  # of the brightest pixel: a key that is not heeded

BASE = {"lights": 48, "maps": 16, "interleaving": 1}
BLOCKS = {"interleaving": 4}

CASES = {
    "fewer lights": few({"lights": 31}),
    **under("pairs", PAIR_CASES, FEW),
    **shadow_cases("visibility"),
    "warped lights with their footprint": Case(  # by seed 3 the middle of a light's texel meets the block's very edge
        {"area.single_light": "footprint"},
        {"clusters.count": 40, "warp": "A", "warp.levels": 4, "lights.seed": 1, "visibility": "pcss"}),
    "no shadows": few({"visibility": "none"}),
    "blocks": few(BLOCKS),
    "blocks by cluster": few({"interleaving.assignment": "cluster"}, BLOCKS),
    "a box": few({"blur": "box"}, BLOCKS),
    "not blurred": few({"blur": "none"}, BLOCKS),
    "a wide blur": few({"blur.extent": 0.4}, BLOCKS),
    "subsets left out": few({"blur.every_subset": False}, BLOCKS | {"blur.extent": 0.4}),
    "a blur around corners": few({"blur.cosine": -1.0}, BLOCKS | {"blur.extent": 0.4}),
}

FOLDED = fold(ValSettings, CASES, BASE, elsewhere=("pairs.",))

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # what a clamp takes


def test_every_field_has_a_case():
    assert not uncovered(ValSettings, CASES, BASE) - set(needed(LightSettings))  # those: test_lights, test_shared


@pytest.fixture(scope="module", params=CASES)
def made(request):
    """Return the case with its frame, settings and picture."""
    case = CASES[request.param]
    frame, settings = case.seen(), case.settings(ValSettings, BASE)
    return case, frame, settings, val(frame, settings)


@pytest.mark.parametrize("name", featured(FOLDED, VAL))
def test_the_literal_text(name, evidence):
    case = FOLDED[name]
    frame, settings = case.seen(), case.settings(ValSettings, BASE)
    expected = clustered.picture(frame, with_clamp(settings))
    off = np.abs(val(frame, settings) - expected).max() / expected.max()
    evidence(f"{case.parts}: off by {off:.0e} of the brightest pixel")
    assert off < tolerance(settings)


def tolerance(settings):
    if settings.maps.renderer == "rays":
        return FLOAT32_RAYS
    return SLICES if settings.pairs.clamp is not None and settings.pairs.clamp.name() == "sphere" else ROUNDING


def test_each_key_counts(made, evidence):
    case, frame, _, picture = made
    for key, settings in case.without(ValSettings, BASE):
        change = np.abs(picture - val(frame, settings)).max() / picture.max()
        evidence(f"{key}: {change:.1e} of the brightest pixel")
        assert (change > COUNTS) == (not case.same)

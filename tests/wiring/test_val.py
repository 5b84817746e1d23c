"""Every setting of `val`: the picture is that of the loops, and heeding the setting shows."""

import sys

import numpy as np
import pytest

from refgi.cluster.settings import ValSettings
from refgi.cluster.val import val
from refgi.lights.settings import LightSettings
from refgi.stages import observe
from tests.literal.whole import val as clustered
from tests.literal.whole.multires import coarsest_level
from tests.literal.whole.pairs import with_clamp
from tests.wiring.cases import Case, assert_each_key_counts, needed, uncovered, under
from tests.wiring.features import VAL, featured
from tests.wiring.fold import fold
from tests.wiring.part_cases import FEW, PAIR_CASES, few, shadow_cases

ROUNDING = 1e-9  # of the brightest pixel: float64 in another order
FLOAT32_RAYS = 2e-6  # the same, where depths come from rays in float32: a few times 6e-8
SLICES = 1e-5  # the same: the Gauss rule of cut cones is off by up to 1e-4 of a light on its axis

BASE = {"lights": 48, "maps": 16, "interleaving": 1}
BLOCKS = {"interleaving": 4}

CASES = {
    "fewer lights": few({"lights": 31}),
    **under("pairs", PAIR_CASES, FEW),
    **shadow_cases("visibility"),
    "no shadows": few({"visibility": "none"}),
    "blocks": few(BLOCKS),
    "blocks by cluster": few({"interleaving.assignment": "cluster"}, BLOCKS),
    "a box": few({"blur": "box"}, BLOCKS),
    "not blurred": few({"blur": "none"}, BLOCKS),
    "a wide blur": few({"blur.extent": 0.4}, BLOCKS),
    "subsets left out": few({"blur.every_subset": False}, BLOCKS | {"blur.extent": 0.4}),
    "a blur around corners": few({"blur.cosine": -0.5}, BLOCKS | {"blur.extent": 0.4}),
}

# pictures of so many pixels that not all are samples of the error
WIDE = {"width": 112, "height": 84}
SUBSPLATS = {"interleaving": None, "visibility": "pcf", "clusters.count": 4}
PROMISES = {
    "subsplats": Case({"subsplats.target": 0.02}, SUBSPLATS, frame=WIDE),
    "coarser subsplats": Case({"subsplats.coarsest": 7}, SUBSPLATS, frame=WIDE),
    "subsplats, another seed": Case({"lights.seed": 2}, SUBSPLATS | {"subsplats.target": 0.02}, frame=WIDE),
}

FOLDED = fold(ValSettings, CASES, BASE, elsewhere=("pairs.",))

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # what a clamp takes


def test_every_field_has_a_case():
    elsewhere = set(needed(LightSettings))  # test_lights
    assert not uncovered(ValSettings, CASES | PROMISES, BASE) - elsewhere


@pytest.fixture(autouse=True)
def subsplats_in_small_pictures(monkeypatch):
    monkeypatch.setattr(sys.modules["refgi.cluster.val"], "FEW_PIXELS", 0)


@pytest.mark.parametrize("name", featured(FOLDED, VAL))
def test_the_literal_text(name, evidence):
    case = FOLDED[name]
    frame, settings = case.seen(), case.settings(ValSettings, BASE)
    expected = clustered.picture(frame, with_clamp(settings))
    off = np.abs(val(frame, settings) - expected).max() / expected.max()
    evidence(f"{case.parts}: off by {off:.0e} of the brightest pixel")
    assert off < tolerance(settings)


@pytest.mark.parametrize("name", PROMISES)
def test_the_promise(name, evidence):
    """Oracle: the RMSE to the literal text is within the target, and pixels evaluated one by one are that text's."""
    frame, settings = PROMISES[name].seen(), PROMISES[name].settings(ValSettings, BASE)
    full, covered = clustered.picture(frame, with_clamp(settings)), frame.gbuffer.covered
    with observe(record=True) as log:
        off = val(frame, settings) - full
    found = next(run.output for run in log.runs if run.name == "error_target.error_driven")
    error = np.sqrt((off[:, covered] ** 2).mean()) / full[:, covered].mean()
    evidence(f"{name}: {error:.2%} off every light at every pixel, {found.pairs / found.full_pairs:.0%} of the pairs")
    assert error <= settings.subsplats.target
    assert len(found.split) - 1 == coarsest_level(covered.shape, settings.subsplats.coarsest)
    finest = np.kron(found.split[1], np.ones((2, 2), bool))[:84, :112] & covered
    assert 0 < finest.sum() < covered.sum()
    assert np.abs(off[:, finest]).max() <= ROUNDING * full.max()


def tolerance(settings):
    if settings.maps.renderer == "rays":
        return FLOAT32_RAYS
    return SLICES if settings.pairs.clamp is not None and settings.pairs.clamp.name() == "sphere" else ROUNDING


@pytest.mark.parametrize("name", CASES | PROMISES)
def test_each_key_counts(name):
    assert_each_key_counts((CASES | PROMISES)[name], ValSettings, val, BASE, same=FLOAT32_RAYS)

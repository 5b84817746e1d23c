"""Every setting of `vpl`: the picture is that of the loops, and heeding the setting shows."""

import dataclasses

import numpy as np
import pytest

from refgi.lights.selection import choose_lights
from refgi.lights.settings import LightSettings
from refgi.truth.vpl import VplSettings, vpl
from tests.literal.whole.vpl import picture as twin
from tests.wiring.cases import Case, assert_each_key_counts, needed, uncovered
from tests.wiring.features import VPL, featured
from tests.wiring.fold import fold

SINGLE = 2e-6  # of the brightest pixel: rays and what they carry are float32, some 30 roundings of 6e-8
BASE = {"lights": 60}
FEW_POINTS = {"maps.points": 300, "maps.resolution": 16}  # for the twin's loops

CASES = {
    "fewer lights": Case({"lights": 31}),
    "on glossy surfaces and a smooth ball": Case({"lights": 90}, scene="smooth"),
    "a grid": Case({"lights.source.pattern": "grid"}),
    "at random": Case({"lights.source.pattern": "random"}),
    "at random, a seed": Case({"lights.seed": 4}, {"lights.source.pattern": "random"}),
    "every texel": Case({"lights.source.pattern": "all"}, frame={"rsm_resolution": 5}),
    "a seed": Case({"lights.seed": 3}),
    "light paths": Case({"lights.source": "walk"}),
    "behind glass": Case({"lights.source.refraction": None}, {"lights": 200}, scene="glass"),
    "filtered": Case({"lights.source.filtered": True}),
    "not shadowed": Case({"visibility": False}),
    "not shadowed, on a smooth ball": Case({"visibility": False}, scene="smooth"),
    "imperfect maps": Case({"maps": "imperfect"}, {"lights": 6}),
    "imperfect maps, a seed": Case({"lights.seed": 3}, {"maps": "imperfect", **FEW_POINTS}),
    "fewer points": Case({"maps.points": 150}, {"maps": "imperfect", "maps.resolution": 16}),
    "a coarser map": Case({"maps.resolution": 8}, {"maps": "imperfect", "maps.points": 300}),
    "narrower boxes": Case({"maps.splat": 0.5}, {"maps": "imperfect", **FEW_POINTS}),
    "filled holes": Case({"maps.levels": 2}, {"maps": "imperfect", "maps.splat": 0.3, **FEW_POINTS}),
    "another bias": Case({"maps.bias": 0.5}, {"maps": "imperfect", **FEW_POINTS}),
    "few pairs at a time": Case({"batch": 1000}, same="memory alone"),
}


def known(settings):
    """Tell whether maps matter if there are any: without visibility nobody looks them up."""
    return settings.visibility or settings.maps is None


ROUND = "lights and maps on a smooth ball"  # which the fold leaves to a case without visibility
FOLDED = fold(VplSettings, CASES, BASE, fits=known) | {
    ROUND: Case({"lights": 20, "maps": "imperfect"}, FEW_POINTS, scene="smooth")}


def test_every_field_has_a_case():
    assert not uncovered(VplSettings, CASES, BASE) - set(needed(LightSettings))  # those: test_lights


@pytest.mark.parametrize("name", featured(FOLDED, VPL))
def test_the_literal_text(name, evidence):
    case = FOLDED[name]
    frame, settings = case.seen(), case.settings(VplSettings, BASE)
    lights = choose_lights(frame, settings.lights)
    expected = twin(frame, lights, settings.visibility, settings.maps, settings.lights.seed)
    off = np.abs(vpl(frame, settings) - expected).max() / expected.max()
    evidence(f"{case.parts}: off by {off:.0e} of the brightest pixel")
    assert off < SINGLE


@pytest.mark.parametrize("name", CASES)
def test_each_key_counts(name):
    assert_each_key_counts(CASES[name], VplSettings, vpl, BASE)


def test_no_more_pairs_are_held_than_asked_for():
    case = CASES["few pairs at a time"]
    frame, settings, sizes = case.seen(), case.settings(VplSettings, BASE), []
    vars(frame)["tracer"] = Counting(frame.tracer, sizes)
    vpl(frame, settings)
    assert len(sizes) > 1
    assert max(sizes) <= settings.batch


@dataclasses.dataclass
class Counting:
    """A tracer that keeps how many shadow rays each call traces."""

    tracer: object
    sizes: list

    def __getattr__(self, name):
        return getattr(self.tracer, name)

    def fill_occluded(self, origin, direction, reach, occluded):
        self.sizes.append(len(reach))
        self.tracer.fill_occluded(origin, direction, reach, occluded)

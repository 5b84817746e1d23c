"""How a choice is timed and judged: by several seeds, without the truth's noise."""

import math

import numpy as np
import pytest

from refgi import stages
from refgi.bench import choose
from refgi.bench.grid import Choice
from refgi.bench.measure import Reference, Timed
from refgi.methods import METHODS
from refgi.scene import load_scene
from refgi.truth import TruthSettings


def test_pictures_have_a_seed_each_and_are_judged_without_the_truth_s_noise(monkeypatch):
    seeds, times = [], iter((3.0, 1.0, 2.0))
    light = np.ones((3, 12, 16))

    def timed(_, __, settings):
        seeds.append(settings.lights.seed)
        return Timed(1.5 * light, next(times), stages.Log())

    monkeypatch.setattr(choose, "timed", timed)
    monkeypatch.setattr(choose, "traced", lambda *_: Reference(light, 0.09 * light, light, "known", light, {}))
    size = {"width": 16, "height": 12, "rsm_resolution": 16}
    pictures = choose.Pictures(load_scene("cornell_box"), TruthSettings(), 3, lambda *_: None, size)
    one = Choice("sii", (), METHODS["sii"].settings())
    assert pictures.error(one) == pytest.approx(math.sqrt(0.5**2 - 0.09))
    assert pictures.seconds(one) == 2.0
    assert seeds == [0, 1, 2]  # and not again for the second question

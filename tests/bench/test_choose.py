"""How a choice is timed and judged: by several seeds, without the truth's noise."""

import math

import numpy as np
import pytest

from refgi import stages
from refgi.bench import choose
from refgi.bench.choose import FURTHEST, JUDGED, MARGIN, TIME_MARGIN, for_error, for_time
from refgi.bench.grid import Choice, Track
from refgi.bench.measure import Timed
from refgi.compare.outcome import Reference
from refgi.methods import METHODS
from refgi.scene import load_scene
from refgi.settings import Settings
from refgi.truth import TruthSettings


def test_pictures_have_a_seed_each_and_are_judged_without_the_truth_s_noise(monkeypatch):
    seeds, times = [], iter((3.0, 1.0, 2.0))
    light = np.ones((3, 12, 16))

    def timed(_, __, settings):
        seeds.append(settings.lights.seed)
        return Timed(1.5 * light, next(times), stages.Log())

    monkeypatch.setattr(choose, "timed", timed)
    truth = Reference("truth", None, light, 0.09 * light, light[:, 0, 0], light, light, 1.0, (),
                      {"estimate": {"statement": "known"}})
    monkeypatch.setattr(choose, "traced", lambda *_: truth)
    size = {"width": 16, "height": 12, "rsm_resolution": 16}
    pictures = choose.Pictures(load_scene("cornell_box"), TruthSettings(), 3, lambda *_: None, size)
    one = Choice("sii", (), METHODS["sii"].settings())
    assert pictures.error(one) == pytest.approx(math.sqrt(0.5**2 - 0.09))
    assert pictures.seconds(one) == 2.0
    assert seeds == [0, 1, 2]  # and not again for the second question


VALUES = tuple(dict.fromkeys(round(16 * math.sqrt(2) ** step) for step in range(25)))
AT_MOST = 2.0  # times the best of a full search


class Model:
    """Tracks as formulas: error^2 = bias^2 + noise^2 / n^power, time = fixed + each n."""

    def __init__(self, laws, scale=1.0, off=1.0):
        self.laws, self.scale, self.off, self.ran = laws, scale, off, set()

    def _at(self, choice):
        self.ran.add(choice)
        return self.laws[choice.method], int(choice.changes[0])

    def seconds(self, choice):
        (_, _, _, fixed, each), n = self._at(choice)
        return self.scale * (fixed + each * n)

    def error(self, choice):
        (bias, noise, power, _, _), n = self._at(choice)
        return self.off * math.sqrt(bias**2 + noise**2 / n**power)


def tracks_of(laws):
    return [Track(tuple(Choice(name, (str(n),), Settings()) for n in VALUES), VALUES) for name in laws]


def laws_of(seed, count=8):
    random = np.random.default_rng(seed)
    return {f"m{i}": (random.choice([0.0, 0.02, 0.2, 0.5]) * random.uniform(0.5, 1.5), 10 ** random.uniform(-0.5, 1),
                      random.choice([0.5, 1.0, 1.5]), 10 ** random.uniform(-3, -1), 10 ** random.uniform(-6, -3))
            for i in range(count)}


def everything(tracks, model):
    return [(model.seconds(rung), model.error(rung)) for track in tracks for rung in track.rungs]


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("wish", [0.4, 0.1, 0.03])
def test_an_error_is_met_at_the_cost_of_a_full_search(seed, wish):
    """Small pictures take a twentieth of the time and are off by a tenth."""
    laws = laws_of(seed)
    tracks, full, small = tracks_of(laws), Model(laws), Model(laws, scale=0.05, off=1.1)
    best = min((seconds for seconds, error in everything(tracks, Model(laws)) if error <= wish * MARGIN),
               default=math.inf)
    found = for_error(tracks, wish, small, full)
    if not math.isfinite(best):
        assert found.best is None
        return
    assert found.best is not None
    assert found.best.error == full.error(found.best.choice) <= wish
    assert found.best.seconds <= AT_MOST * best
    assert len(full.ran) < 0.25 * len(tracks) * len(VALUES)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("wish", [0.005, 0.03, 0.2])
def test_a_time_is_kept_with_the_least_error(seed, wish):
    laws = laws_of(seed)
    tracks, full, small = tracks_of(laws), Model(laws), Model(laws, scale=0.05, off=1.1)
    all_of_them = everything(tracks, Model(laws))
    limit = next((limit for limit in (TIME_MARGIN * wish, wish) if any(s <= limit for s, _ in all_of_them)), 0.0)
    best = min((error for seconds, error in all_of_them if seconds <= limit), default=math.inf)
    found = for_time(tracks, wish, small, full)
    if not math.isfinite(best):
        assert found.best is None
        return
    assert found.best.seconds <= limit <= wish
    assert found.best.error == pytest.approx(best)
    assert len(found.judged) <= JUDGED


def test_what_is_within_a_time_by_little_is_taken_where_nothing_else_is():
    laws = {"one": (0.0, 1.0, 1.0, 0.0945, 1e-6)}
    assert TIME_MARGIN * 0.1 < 0.0945 < for_time(tracks_of(laws), 0.1, Model(laws), Model(laws)).best.seconds <= 0.1


def test_the_cheapest_probe_goes_first_and_what_takes_longer_is_not_run():
    laws = {"slow": (0.0, 1.0, 1.0, 10.0, 1e-3), "fast": (0.0, 1.0, 1.0, 1e-3, 1e-6)}
    small = Model(laws)
    for_error(tracks_of(laws), 0.05, small, Model(laws))
    assert {choice.changes for choice in small.ran if choice.method == "slow"} == {("16",)}


@pytest.mark.parametrize(("wish", "tried"), [(0.2, False), (0.01, True)])
def test_a_track_that_waits_is_tried_from_where_another_of_its_method_misses_the_wish(wish, tried):
    """It is the fastest there; on few lights, which meet the wish, it is not run."""
    laws = {"plain": (0.0, 1.0, 1.0, 1e-3, 1e-4), "cut": (0.0, 1.0, 1.0, 1e-3, 1e-5),
            "other": (0.5, 1.0, 1.0, 1.0, 1.0)}

    def choices(name, values):
        return tuple(Choice("sii" if name == "cut" else name, (str(n), name), Settings()) for n in values)

    class Named(Model):
        def _at(self, choice):
            self.ran.add(choice)
            return self.laws[choice.changes[1]], int(choice.changes[0])

    plain = Track(tuple(one._replace(method="sii") for one in choices("plain", VALUES)), VALUES)
    waiting = Track(choices("cut", VALUES[12:]), VALUES[12:], waits=True)
    tracks, small, full = [waiting, plain, Track(choices("other", VALUES), VALUES)], Named(laws, 0.05), Named(laws)
    found = for_error(tracks, wish, small, full)
    assert (found.best.choice.changes[1] == "cut") == tried
    assert any(one.changes[1] == "cut" for one in small.ran | full.ran) == tried
    assert for_error([waiting], 0.01, small, full).best is not None  # nobody to wait for


@pytest.mark.parametrize(("wish", "tried"), [(0.01, False), (0.11, False), (0.12, True), (0.2, True)])
def test_a_track_that_waits_is_timed_where_another_of_its_method_comes_to_it(wish, tried):
    laws = {"sii": (0.0, 1.0, 1.0, 1e-3, 1e-4)}
    (plain,), full = tracks_of(laws), Model(laws)
    waiting = plain._replace(rungs=tuple(one._replace(changes=(*one.changes, "cut")) for one in plain.rungs[12:]),
                             values=plain.values[12:], waits=True)
    found = for_time([waiting, plain], wish, Model(laws), full)
    assert found.best.seconds <= wish
    assert any("cut" in one.changes for one in full.ran) == tried


def test_a_track_whose_first_errors_are_alike_is_not_left():
    """16 and 64 lights may err alike by chance."""
    class Alike(Model):
        def error(self, choice):
            return 0.125 if int(choice.changes[0]) == 16 else super().error(choice)

    laws = {"one": (0.0, 1.0, 1.0, 1e-3, 1e-6)}
    assert for_error(tracks_of(laws), 0.01, Alike(laws), Model(laws)).best is not None


def test_a_track_whose_bias_is_above_the_wish_is_left_soon():
    laws = {"biased": (0.3, 1.0, 1.0, 1e-3, 1e-6), "sound": (0.0, 20.0, 1.0, 1.0, 1e-2)}
    small = Model(laws)
    found = for_error(tracks_of(laws), 0.1, small, Model(laws))
    assert found.best.choice.method == "sound"
    assert sum(choice.method == "biased" for choice in small.ran) <= 4


def test_what_the_small_picture_flatters_moves_up_at_full_size():
    laws = {"one": (0.0, 1.0, 1.0, 1e-3, 1e-6)}
    found = for_error(tracks_of(laws), 0.05, Model(laws, off=0.2), Model(laws))
    right = min(n for n in VALUES if 1 / math.sqrt(n) <= 0.05 * MARGIN)
    assert found.best.choice.changes == (str(right),)
    assert len(found.judged) <= 2 * FURTHEST


def test_what_gives_no_picture_is_never_the_best():
    class Refusing(Model):
        def seconds(self, choice):
            return math.inf if choice.method == "fast" else super().seconds(choice)

        def error(self, choice):
            return math.inf if choice.method == "fast" else super().error(choice)

    laws = {"slow": (0.0, 1.0, 1.0, 1.0, 1e-3), "fast": (0.0, 1.0, 1.0, 1e-3, 1e-6)}
    for_full = for_error(tracks_of(laws), 0.1, Model(laws), Refusing(laws))
    assert for_full.best.choice.method == "slow"
    assert for_error(tracks_of(laws), 0.1, Refusing(laws), Refusing(laws)).best.choice.method == "slow"
    assert for_time(tracks_of(laws), 5.0, Refusing(laws), Refusing(laws)).best.choice.method == "slow"


def test_nothing_meets_what_cannot_be():
    laws = {"biased": (0.3, 1.0, 1.0, 1e-3, 1e-6)}
    assert for_error(tracks_of(laws), 0.1, Model(laws), Model(laws)).best is None
    assert for_time(tracks_of(laws), 1e-4, Model(laws), Model(laws)).best is None

"""As many area lights as an error asks for: the estimate is the picture's error, and more are taken for less of it."""

import math

import numpy as np
import pytest

from refgi.cluster.adaptive import Trial, _double_and_step_back, _estimate, count_for_error
from refgi.cluster.clustered import clustered_irradiance
from refgi.cluster.settings import ValSettings
from refgi.errors import InputError, RefgiWarning
from refgi.frame import Frame
from refgi.lights.selection import choose_lights
from refgi.pairs.irradiance import Receivers
from refgi.rsm import facing_normals
from refgi.scene import load_scene
from refgi.settings import of, replaced
from refgi.truth.vpl import VplSettings, vpl

SETTINGS = of(ValSettings, lights=96, maps_resolution=64, clusters="adaptive", target_error=0.1)
ROUNDING = 1e-4  # of the error: float32 sums, and rays that graze an edge from either way of setting them up


@pytest.fixture(scope="module")
def frame():
    return Frame(load_scene("cornell_sphere"), width=32, height=32)


@pytest.fixture(scope="module")
def lights(frame):
    return choose_lights(frame, SETTINGS.lights)


def error_of_picture(frame, lights, areas, maps, settings):
    """RMSE over the mean against a shadow ray for each light, over all pixels."""
    buffer = frame.gbuffer
    exact = vpl(frame, of(VplSettings, lights=settings.lights.count)).astype(np.float64)
    facing = facing_normals(frame.scene.geometry, buffer.triangle_id, buffer.normal)
    made = clustered_irradiance(Receivers(buffer.position, buffer.normal, buffer.covered), facing, lights, areas, maps,
                                settings)
    missed = (made - exact)[:, buffer.covered]
    return math.sqrt((missed**2).mean()) / exact[:, buffer.covered].mean()


@pytest.mark.feature("VAL-04")
def test_a_lower_target_takes_more_area_lights_and_is_met(frame, lights, evidence):
    chosen = []
    for target in (0.3, 0.1, 0.04):
        settings = replaced(SETTINGS, {"target_error": target})
        found = count_for_error(frame, lights, settings)
        error = error_of_picture(frame, lights, found.areas, found.maps, settings)
        # 32 x 32 pixels are all looked at: the estimate is the picture's error
        assert error == pytest.approx(found.error, rel=ROUNDING)
        assert error <= target
        assert found.error in [trial.error for trial in found.trail if trial.area_lights == len(found.areas.members)]
        chosen.append((target, len(found.areas.members), round(float(error), 4)))
    evidence(f"(target, area lights, error of the picture): {chosen}")
    assert chosen[0][1] < chosen[1][1] < chosen[2][1]


@pytest.mark.feature("VAL-04")
def test_a_sample_of_the_pixels_bounds_the_error_of_all(frame, lights, monkeypatch, evidence):
    monkeypatch.setattr("refgi.cluster.adaptive.SAMPLES", 200)
    met, figures = 0, []
    for seed in range(4):
        found = count_for_error(frame, lights, replaced(SETTINGS, {"target_error": 0.3, "seed": seed}))
        error = error_of_picture(frame, lights, found.areas, found.maps, SETTINGS)
        trial = found.trail[-1]
        met += error <= trial.bound
        figures.append(round(float(trial.error / error), 3))
        assert trial.bound > trial.error
    evidence(f"200 of 1024 pixels: estimate over true error {figures}; the bound held {met} times of 4")
    assert met >= 3  # 95 % each


def test_what_cannot_be_reached_comes_as_near_as_it_can(frame, lights):
    total = lights.position.shape[1]
    with pytest.warns(RefgiWarning, match=f"of {total} come nearest"):
        found = count_for_error(frame, lights, replaced(SETTINGS, {"target_error": 1e-4}))
    assert [trial.area_lights for trial in found.trail] == [1, 2, 4, 8, 16, 32, 64, total]
    assert found.error == min(trial.error for trial in found.trail)


def test_reruns_are_the_same_bits(frame, lights):
    runs = [count_for_error(frame, lights, replaced(SETTINGS, {"target_error": 0.2})) for _ in range(2)]
    assert runs[0].trail == runs[1].trail
    np.testing.assert_array_equal(runs[0].areas.of, runs[1].areas.of)
    np.testing.assert_array_equal(runs[0].maps.depth, runs[1].maps.depth)


def test_the_settings_of_the_picture_are_those_of_the_trials(frame, lights):
    trails = {}
    for key, value in (("behind", "visible"), ("behind", "raytrace"), ("visibility", "rays_vpls"), ("clamp", "disc")):
        settings = replaced(SETTINGS, {key: value})
        trails[value] = [trial.error for trial in count_for_error(frame, lights, settings).trail]
    usual = trails.pop("visible")
    assert all(trail != usual for trail in trails.values())
    assert trails["rays_vpls"][0] < usual[0]  # the share of the lights seen, weighed by flux, is nearer than any map


def test_a_target_is_needed(frame, lights):
    with pytest.raises(InputError, match="clusters: expected adaptive"):
        count_for_error(frame, lights, replaced(SETTINGS, {"clusters": "fixed"}))


def test_no_light_has_no_error(frame, lights):
    dark = lights._replace(position=lights.position[:, :0], normal=lights.normal[:, :0], flux=lights.flux[:, :0])
    found = count_for_error(frame, dark, SETTINGS)
    assert found.error == 0
    assert found.areas.delta.shape == (0,)


class Known:
    """Attempts whose error is known: 1 / area lights."""

    def __init__(self):
        self.tried = []

    def __call__(self, count):
        self.tried.append(count)
        return type("Attempt", (), {"trial": Trial(count, 1 / count, 1.25 / count)})()


@pytest.mark.feature("VAL-04")
@pytest.mark.parametrize(("target", "tried", "best"), [
    (2.0, [1], 1), (0.7, [1, 2], 2), (0.35, [1, 2, 4, 3], 4), (0.43, [1, 2, 4, 3], 3), (0.1, [1, 2, 4, 8, 16, 12], 16),
    (0.01, [1, 2, 4, 8, 16, 32, 50], 50)])  # fmt: skip
def test_doubling_and_one_step_back(target, tried, best):
    attempt = Known()
    found, trail = _double_and_step_back(attempt, 50, target)
    assert attempt.tried == tried == [trial.area_lights for trial in trail]
    assert found.trial.area_lights == best


def test_the_error_of_known_differences():
    def samples(exact, share):
        return type("Samples", (), {"exact": np.array(exact), "share": share})()

    exact = np.full((3, 4), 2.0)
    made = exact + np.array([1.0, -1.0, 1.0, -1.0])
    assert _estimate(made, samples(exact, 1.0), 5) == Trial(5, 0.5, 0.5)
    half = exact + np.array([2.0, 0.0, 0.0, 0.0])  # squares 4, 0, 0, 0: mean 1, standard deviation 2
    trial = _estimate(half, samples(exact, 0.5), 5)
    assert trial.error == 0.5
    assert trial.bound == pytest.approx(math.sqrt(1 + 1.645 * 2 * math.sqrt(0.5 / 4)) / 2)
    assert _estimate(made, samples(np.zeros((3, 4)), 1.0), 5).error == math.inf
    assert _estimate(exact, samples(exact, 1.0), 5).error == 0.0

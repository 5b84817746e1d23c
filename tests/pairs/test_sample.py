"""Pixels at which errors are looked for, more of them where lights are near; what is stated from these holds at all."""

import dataclasses
import functools
import importlib
import math
import warnings

import numpy as np
import pytest

from refgi.diagnostics import diagnosing
from refgi.errors import RefgiWarning
from refgi.frame import Frame
from refgi.lights.selection import choose_lights, footprints
from refgi.lights.settings import LightSettings, with_clamp
from refgi.literal.pairs import pair
from refgi.methods import find_method, render
from refgi.pairs import estimates
from refgi.pairs.estimates import (
    FEW_SAMPLED,
    LEAST_SAMPLED,
    QUANTILE,
    RUNS,
    error_of_halves,
    report_sampling,
    sampling_error,
)
from refgi.pairs.irradiance import Receivers, summed
from refgi.pairs.pixel_lights import pack
from refgi.pairs.sample import REACH, near_variance, sample_peaks
from refgi.pairs.settings import DiscClamp, LobeSettings, PairSettings, SphereClamp
from refgi.scene import load_scene
from refgi.settings import of
from refgi.splat import SiiSettings
from refgi.truth.vpl import VplSettings, vpl_sampling_error
from tests.pairs.sets import random_directions, room

SIDE, SEEDS = 48, 4
COVERED = 0.95
AS_ALL = 0.1  # of the RMS over all pixels


@pytest.mark.parametrize("clamped", [True, False])
def test_near_variance_is_that_of_lights_within_reach(clamped):
    """Oracle: squares of literal pairs, at least of those within reach and at most of all."""
    points, lights = room(np.random.default_rng(7), 1500)
    area = np.linspace(0.001, 0.01, 1500)
    packed = pack(lights, PairSettings(clamp=DiscClamp() if clamped else None), area if clamped else None, np.float64)
    x, n = points.position[:, 0], points.normal[:, 0]
    found = near_variance(x, n, packed.diffuse, packed.clamp)
    each = (pair(x[:, :, None], n[:, :, None], lights.position[:, None], lights.normal[:, None], lights.flux[:, None],
                 area=area if clamped else 0.0) ** 2).sum(axis=0)
    width = np.ptp(lights.position, axis=1).max()
    away = np.linalg.norm(x[:, :, None] - lights.position[:, None], axis=0)
    near, every = np.where(away < REACH * width / math.sqrt(1500), each, 0).sum(axis=1), each.sum(axis=1)
    assert (found >= near * (1 - 1e-9)).all()
    assert (found <= every * (1 + 1e-9)).all()
    assert np.count_nonzero(found < 0.5 * every) > 700
    assert (near > 0).sum() > 20


def test_a_part_of_packed_lights_is_that_part_packed():
    rng = np.random.default_rng(3)
    _, lights = room(rng, 40)
    glossy = np.arange(40) % 3 == 0
    lights = lights._replace(flux=lights.flux * (np.arange(40) % 4 > 0), lobe_flux=rng.random((3, 40)) * glossy,
                             lobe_axis=random_directions(rng, 40), lobe_exponent=np.linspace(2.0, 90.0, 40))
    settings = PairSettings(clamp=DiscClamp(), lobe=LobeSettings(widening=0.3))
    area, chosen = rng.random(40), rng.random(40) < 0.5
    some = pack(lights, settings, area, np.float32).part(chosen)
    alone = pack(lights.selected(chosen), settings, area[chosen], np.float32)
    for a, b in ((some.diffuse, alone.diffuse), (some.clamp.softness, alone.clamp.softness),
                 (some.lobes.lights, alone.lobes.lights), (some.lobes.clamp.softness, alone.lobes.clamp.softness),
                 (some.lobes.widening.cos_theta, alone.lobes.widening.cos_theta)):
        np.testing.assert_array_equal(a, b)
    assert some.terms == alone.terms
    assert pack(lights, settings, area, np.float32).part(~glossy).lobes is None
    spheres, diffuse = PairSettings(clamp=SphereClamp()), lights._replace(lobe_flux=None)
    np.testing.assert_array_equal(pack(diffuse, spheres, area, np.float32).part(chosen).spheres,
                                  pack(diffuse.selected(chosen), spheres, area[chosen], np.float32).spheres)


@pytest.mark.parametrize(("all_summed", "lobes", "pixels"), [
    (True, False, LEAST_SAMPLED), (False, False, FEW_SAMPLED), (False, True, LEAST_SAMPLED)])
def test_few_pixels_are_sampled_where_clusters_stand_for_all_light(monkeypatch, all_summed, lobes, pixels):
    """Lobes are summed in full also where diffuse lights are not, and no near light tells where they peak."""
    asked = []
    monkeypatch.setattr(estimates, "sampling_error", lambda *given: asked.append(given[-1]))
    points, lights = room(np.random.default_rng(2), 9)
    if lobes:
        lights = lights._replace(lobe_flux=lights.flux, lobe_axis=lights.normal, lobe_exponent=np.full(9, 5.0))
    with diagnosing():
        report_sampling(None, points, lights, PairSettings(), None, "sii", all_summed=all_summed)
    assert asked == [pixels]


@pytest.mark.parametrize(("common", "parts"), [(False, 4 * RUNS), (True, 1 / (1 / (4 * RUNS) + 1 / RUNS))])
def test_the_bound_by_hand(common, parts):
    """Errors of one size, of either sign in turn or all alike: m is their number, or about that of the runs."""
    off = np.where(np.arange(4 * RUNS) % 2, -1.0, 1.0) ** (1 - common)
    found = error_of_halves(2 + off[None] / 2, 2 - off[None] / 2, 2)
    assert found.pixel == pytest.approx(1 / 4)
    assert found.most == pytest.approx(found.pixel * math.exp(QUANTILE / math.sqrt(parts)))


def test_weights_stand_for_pixels():
    off = np.array([[1.0, 3.0, 3.0]])
    some = error_of_halves(2 + off[:, :2], 2 - off[:, :2], 2, weight=np.array([1.0, 2.0]))
    assert some[:2] == pytest.approx(error_of_halves(2 + off, 2 - off, 2)[:2])


@functools.cache
def drawn(name, count, seed):
    """Return receivers, lights, pairs, areas and the halves' sums at all pixels."""
    at = Frame(load_scene(name), width=SIDE, height=SIDE, rsm_resolution=256)
    settings = with_clamp(of(SiiSettings, lights=count, seed=seed))
    to = Receivers(*at.gbuffer.resolve("position", "normal", "covered"))
    lights, area = choose_lights(at, settings.lights), footprints(at, settings.lights, settings.pairs)
    halves = [summed(to, lights.selected(part), settings.pairs, area[part])[:, to.covered].astype(np.float64)
              for part in (~lights.half, lights.half)]
    return (to, lights, settings.pairs, area), halves


CASES = [(name, count) for name in ("cornell_box", "wedge", "leaf_grid", "parallel_plates")
         for count in (768, 20000)]


@pytest.mark.parametrize(("name", "count"), CASES)
def test_some_pixels_tell_what_all_pixels_do(name, count, evidence):
    for seed in range(SEEDS):
        given, (first, second) = drawn(name, count, seed)
        stated = sampling_error(*given, FEW_SAMPLED)
        true = error_of_halves(first, second, count)
        assert stated.pixel == pytest.approx(true.pixel, rel=AS_ALL)
        assert stated.most >= true.pixel
    evidence(f"{name}, {count} lights: {stated.pixel:.2%} stated, {true.pixel:.2%} at all pixels")


def test_some_pixels_tell_what_all_pixels_do_where_rays_shadow(monkeypatch):
    frame = Frame(load_scene("cornell_box"), width=SIDE, height=SIDE, rsm_resolution=64)
    settings = of(VplSettings, lights=2048)
    lights = choose_lights(frame, settings.lights)
    some = vpl_sampling_error(frame, lights, settings)
    monkeypatch.setattr(importlib.import_module("refgi.truth.vpl"), "SAMPLED", SIDE**2)
    assert some.pixel == pytest.approx(vpl_sampling_error(frame, lights, settings).pixel, rel=AS_ALL)


def test_the_stated_bound_covers_the_spread_of_draws(evidence):
    """Statistical: each draw's RMS distance to the mean of several, at all pixels."""
    covered = []
    for name, count in CASES:
        pictures = np.array([sum(drawn(name, count, seed)[1]) for seed in range(SEEDS)])
        mean = pictures.mean(axis=0)
        for seed, picture in enumerate(pictures):
            true = math.sqrt(((picture - mean) ** 2).mean() * SEEDS / (SEEDS - 1)) / mean.mean()
            covered.append(true <= sampling_error(*drawn(name, count, seed)[0], FEW_SAMPLED).most)
    assert np.mean(covered) >= COVERED
    evidence(f"{np.mean(covered):.0%} of {len(covered)} draws")


def test_sampled_pixels_hold_the_largest_variance_and_stand_for_all():
    (to, lights, pairs, area), _ = drawn("cornell_box", 20000, 0)
    packed = pack(lights, pairs, area, np.float32)
    sample = sample_peaks(to, packed, 128)
    places = np.flatnonzero(to.covered)
    whole = near_variance(*(np.ascontiguousarray(part.reshape(3, -1)[:, places]) for part in to[:2]), packed.diffuse,
                          packed.clamp)
    assert 90 <= len(sample.place) <= 128
    assert set(places[np.argsort(whole)[-8:]]) <= set(sample.place.tolist())
    at = np.searchsorted(places, sample.place)
    assert sample.weight.sum() == pytest.approx(len(places), rel=0.2)
    assert (whole[at] * sample.weight).sum() == pytest.approx(whole.sum(), rel=0.05)
    everything = sample_peaks(Receivers(*to), packed, to.covered.size)
    assert everything.weight is None
    assert len(everything.place) == len(places)


@pytest.mark.parametrize("flux", [0.0, 1.0, 1e38])
def test_lights_at_one_place_and_extreme_ones_leave_a_sample(flux):
    points, lights = room(np.random.default_rng(1), 900, np.float32)
    same = lights._replace(position=np.zeros_like(lights.position), flux=np.full_like(lights.flux, flux))
    packed = pack(same, PairSettings(), None, np.float32)
    sample = sample_peaks(points, packed, 100)
    assert 50 <= len(sample.place) <= 101
    assert sample.weight.sum() == pytest.approx(900, rel=0.2)


@pytest.mark.parametrize("method", ["sii", "vpl"])
def test_lights_without_flux_are_no_scene_without_indirect_light(method):
    """Of the first seed the one light lies beside the spot's cone; a lamp that lights nothing gives no warning."""
    options = {"width": 16, "height": 12, "rsm_resolution": 32}
    settings = find_method(method).settings(lights=LightSettings(count=1))
    with pytest.warns(RefgiWarning, match="none of 1 pixel lights has flux"):
        assert not render("cornell_box", method, settings, **options).irradiance.any()
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # also what pytest's settings ignore
        scene = load_scene("cornell_box")
        outside = dataclasses.replace(scene.lights[0], position=(0.0, 9.0, 0.0), direction=(0.0, 1.0, 0.0))
        render(scene.with_lights(outside), method, settings, **options)

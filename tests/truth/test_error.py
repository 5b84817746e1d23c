"""The error that the truth reports, and that its bits depend on nothing but the seed."""

import dataclasses
import itertools
import math
import sys
import time
import types

import numpy as np
import pytest
from scipy.stats import f, t

from refgi import jit
from refgi.errors import InputError
from refgi.frame import Frame
from refgi.scene import load_scene
from refgi.truth import TruthResult, TruthSettings, trace_truth, truth
from refgi.truth.passes import one_pass
from refgi.truth.result import add_pass, no_passes, with_means

SIZE = 48


@pytest.fixture(scope="module")
def frame():
    return Frame(load_scene("cornell_box"), width=SIZE, height=SIZE)


@pytest.fixture(scope="module")
def long_run(frame):
    return trace_truth(frame, TruthSettings(samples=24 * 100, seed=99))


def test_moments_are_mean_and_variance_of_the_passes():
    values = np.random.default_rng(1).normal(3.0, 2.0, size=(7, 3, 50))
    block = np.arange(50) // 20  # two blocks of 20 and one of 10; a fourth has nobody
    moments = no_passes(55)
    for value in values:
        add_pass(moments, with_means(value, block, 4))
    blocks = np.stack([values[..., block == b].mean(axis=2) for b in range(3)] + [np.zeros((7, 3))], axis=2)
    expected = np.concatenate([values, blocks, values.mean(axis=2, keepdims=True)], axis=2)
    assert moments.mean == pytest.approx(expected.mean(axis=0), rel=1e-13)
    assert moments.variance_of_mean == pytest.approx(expected.var(axis=0, ddof=1) / 7, rel=1e-11)


def test_the_variance_of_many_passes_is_that_of_eight_series():
    """Passes of a series that cancel say nothing; series that differ do. By hand, for 8 series of 2 or 3 passes."""
    random, passes = np.random.default_rng(4), 20
    values = random.normal(1.0, 1.0, (passes, 3, 6))
    moments = no_passes(6)
    for value in values:
        add_pass(moments, value)
    mean = values.mean(axis=0)
    sums = [(values[s::8] - mean).sum(axis=0) for s in range(8)]
    assert moments.mean == pytest.approx(mean, rel=1e-13)
    assert moments.variance_of_mean == pytest.approx(
        sum(one**2 for one in sums) / (20**2 - 4 * 3**2 - 4 * 2**2), rel=1e-11)
    opposite = no_passes(1)
    for number in range(16):
        add_pass(opposite, np.full((3, 1), 5.0 + number % 8 * (1 if number < 8 else -1)))
    assert opposite.variance_of_mean == pytest.approx(np.zeros((3, 1)), abs=1e-24)


STUDENT = np.array([0.649, 0.914, 0.980])  # shares within 1, 2, 3 sigma at 7 degrees of freedom: 32 passes
# Pixels share the light's rays, so the shares of one run scatter by 0.03; three runs are averaged. Alone, either side
# has rare large terms (corners; small bright patches) that a short run may not have met.
FARTHEST = float(t.isf(2e-4, 7))  # standard errors: beyond once in 2,500 means, as 4 of them at 29 degrees of freedom
SCATTER = {"combined": (0.06, 0.03, 0.008), "hemisphere": (0.06, 0.04, 0.03), "light": (0.06, 0.04, 0.03)}


@pytest.mark.slow("light")
@pytest.mark.parametrize("estimator", ["combined", "hemisphere", "light"])
def test_pixels_lie_within_their_standard_error(frame, long_run, estimator, evidence):
    settings = TruthSettings(estimator=estimator, directions=8 if estimator != "light" else None)
    shares, pictures = [], []
    for seed in (5, 6, 7):
        result = trace_truth(frame, dataclasses.replace(settings, seed=seed, samples=32 * per_pass(settings)))
        seen = result.samples > 0
        z = np.abs(result.mean - long_run.mean)[:, seen] / np.sqrt(
            result.variance_of_mean + long_run.variance_of_mean)[:, seen]
        shares.append([(z < k).mean() for k in (1, 2, 3)])
        pictures.append(np.abs(result.picture_mean - long_run.picture_mean) / np.sqrt(
            result.picture_variance + long_run.picture_variance))
    within = np.mean(shares, axis=0)
    evidence(f"{estimator}: within 1, 2, 3 sigma {', '.join(f'{share:.1%}' for share in within)} (Student's t: "
             f"64.9, 91.4, 98.0 %); picture's mean off by at most {np.max(pictures):.1f} sigma")
    assert (np.abs(within - STUDENT) < SCATTER[estimator]).all()
    assert np.max(pictures) < FARTHEST


def per_pass(settings):
    return settings.picks_per_pass + settings.directions_per_pass


@pytest.mark.slow
def test_scene_means_lie_within_their_own_standard_error(frame, long_run, evidence):
    sigmas = []
    for seed in range(16):
        result = trace_truth(frame, TruthSettings(samples=24 * 16, seed=1000 + seed))
        sigmas.append((result.picture_mean - long_run.picture_mean)[1]
                      / math.sqrt(result.picture_variance[1] + long_run.picture_variance[1]))
    spread = float(np.sqrt(np.mean(np.square(sigmas))))
    evidence(f"16 runs of 16 passes: the scene's mean is off by {spread:.2f} of its standard error (rms)")
    assert 0.6 < spread < 1.6  # rms of 16 values of Student's t (7 degrees): 1.2, give or take 0.25


CERTAIN = 1e-4  # a chi-square value beyond the quantiles of this tail comes once in 5,000 runs


@pytest.mark.slow
@pytest.mark.parametrize(("seeds", "passes"), [(24, 6), (48, 16)])
def test_stated_block_and_picture_errors_are_the_spread_over_seeds(frame, seeds, passes, evidence):
    """Chi-square: squared deviations of runs over the variance that they state on average; of 16 passes by series."""
    runs = [trace_truth(frame, TruthSettings(samples=24 * passes, seed=2000 + seed)) for seed in range(seeds)]
    figures = {}
    for name in ("picture", "block"):
        means = np.stack([getattr(run, f"{name}_mean") for run in runs]).reshape(seeds, 3, -1)
        stated = np.stack([getattr(run, f"{name}_variance") for run in runs]).reshape(seeds, 3, -1).mean(axis=0)
        chi2 = ((means - means.mean(axis=0)) ** 2).sum(axis=0) / stated
        figures[name] = chi2[1]
    # the stated variance is a mean of estimates: F, of as many times their degrees of freedom
    low, high = (seeds - 1) * f.ppf([CERTAIN, 1 - CERTAIN], seeds - 1, seeds * runs[0].degrees_of_freedom)
    assert low < figures["picture"][0] < high
    ratio = figures["block"].mean() / (seeds - 1)
    assert 0.9 < ratio < 1.1  # of 36 blocks, whose errors go together: 0.3 / 6 apart if they did not
    assert (figures["block"] < high * 1.3).all()
    evidence(f"{seeds} runs of {passes} passes: variance over seeds is {figures['picture'][0] / (seeds - 1):.2f} "
             f"(picture) and {ratio:.2f} (blocks) of what is stated")


@pytest.mark.parametrize("name", ["cornell_box", pytest.param("atrium", marks=pytest.mark.slow)])
def test_the_default_knows_the_pictures_mean_to_a_thousandth(name, evidence):
    result = trace_truth(Frame(load_scene(name), width=256, height=192), TruthSettings())
    evidence(f"{name} at 256x192: {result.error_statement}")
    assert result.passes == 8
    assert result.picture_error < 1e-3
    assert result.picture_error < result.block_error / 4 < result.pixel_error / 8


def test_blocks_are_means_of_pixels(frame):
    found = Frame(frame.scene, width=44, height=20)
    result = trace_truth(found, TruthSettings(samples=48))
    seen = result.samples > 0
    assert result.block_mean.shape == result.block_variance.shape == (3, 3, 6)
    assert result.block_pixels.shape == (3, 6)
    for row in range(3):
        for column in range(6):
            part = np.s_[8 * row : 8 * row + 8, 8 * column : 8 * column + 8]
            count = int(seen[part].sum())
            assert result.block_pixels[row, column] == count
            expected = result.mean[(slice(None), *part)].sum(axis=(1, 2)) / max(1, count)
            assert result.block_mean[:, row, column] == pytest.approx(expected, rel=1e-12)


def made(passes, pixel, block, picture):
    """Return a result of 2 x 16 pixels and two blocks with given variances and a mean of 2."""
    ones, blocks = np.ones((3, 2, 16)), np.ones((3, 1, 2))
    return TruthResult(2 * ones, pixel * ones, np.full((2, 16), 24), np.full(3, 2.0), np.full(3, picture), passes,
                       2 * blocks, block * blocks, np.full((1, 2), 16))


def test_errors_are_relative_and_say_how_sure_they_are():
    result = made(2, 0.16, 0.04, 0.01)
    assert (result.pixel_error, result.block_error, result.picture_error) == pytest.approx((0.2, 0.1, 0.05))
    assert result.degrees_of_freedom == 1
    assert result.confidence_factor() == pytest.approx(math.tan(0.95 * math.pi / 2), rel=1e-9)  # one degree: Cauchy
    assert made(3, 1, 1, 1).confidence_factor(0.8) == pytest.approx(2 * 0.4 * math.sqrt(2 / (4 * 0.9 * 0.1)), rel=1e-9)
    assert "1 degree of freedom (2 passes)" in result.error_statement
    assert "+-63.53% the picture's mean" in result.error_statement
    assert "7 degrees of freedom (8 passes)" in made(8, 1, 1, 1).error_statement
    assert "6 degrees of freedom (12 passes in 8 series)" in made(12, 1, 1, 1).error_statement  # 144 / 20 = 7.2
    assert [made(n, 1, 1, 1).degrees_of_freedom for n in (9, 15, 16, 100, 1000)] == [6, 7, 7, 7, 7]
    assert result.errors == {"pixel": result.pixel_error, "block": result.block_error, "picture": result.picture_error,
                             "passes": 2, "degrees_of_freedom": 1, "statement": result.error_statement,
                             "confidence_factor_95": result.confidence_factor(), "tail_index": None, "trusted": None,
                             "blocks_in_doubt": 0.0}
    uneven = result._replace(block_variance=np.array([[[0.04, 0.36]]] * 3), block_pixels=np.array([[30, 2]]))
    assert uneven.block_error == pytest.approx(math.sqrt((30 * 0.04 + 2 * 0.36) / 32) / 2)


def test_nothing_lit_has_no_error():
    dark = made(8, 0.0, 0.0, 0.0)._replace(picture_mean=np.zeros(3))
    assert [dark.errors[name] for name in ("pixel", "block", "picture")] == [0, 0, 0]


def test_seconds_count_from_the_end_of_compiling(frame, monkeypatch):
    """The first pass of a process compiles; here it sleeps instead."""
    module, slow = sys.modules["refgi.truth.truth"], [1.5]

    def pass_after_compiling(*arguments):
        time.sleep(slow.pop() if slow else 0)
        return one_pass(*arguments)

    monkeypatch.setattr(module, "one_pass", pass_after_compiling)
    assert trace_truth(frame, TruthSettings(samples=10**9, seconds=1.2)).passes > 2


@pytest.mark.feature("REF-19")
def test_same_bits_for_threads_and_batches(frame, evidence):
    settings = TruthSettings(samples=72, bounces=2)
    first = trace_truth(frame, settings)
    for threads, batch in ((1, 1 << 18), (2, 1001), (1, 117)):
        with jit.threads(threads):
            again = trace_truth(frame, dataclasses.replace(settings, batch=batch))
        assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(first, again, strict=True))
    assert not np.array_equal(first.mean, trace_truth(frame, dataclasses.replace(settings, seed=1)).mean)
    evidence("equal bits with 1 and 2 threads and batches of 117 to 262,144 rays")


@pytest.mark.feature("REF-19")
def test_both_backends_give_the_same_picture(frame, monkeypatch, evidence):
    settings = TruthSettings(samples=48)
    monkeypatch.setenv("REFGI_EMBREE", "run")
    by_run = trace_truth(Frame(frame.scene, width=SIZE, height=SIZE), settings)
    assert np.array_equal(by_run.mean, trace_truth(frame, settings).mean)
    evidence("embreex's run and Embree by address: equal bits")


@pytest.mark.feature("REF-05")
@pytest.mark.parametrize("estimator", ["combined", "hemisphere", "light"])
def test_twice_the_light_is_twice_the_picture(frame, estimator, evidence):
    light = frame.scene.lights[0]
    brighter = dataclasses.replace(light, intensity=tuple(2 * c for c in light.intensity))
    settings = TruthSettings(estimator=estimator, samples=48)
    double = trace_truth(Frame(frame.scene.with_lights(brighter), width=SIZE, height=SIZE), settings)
    assert np.array_equal(double.mean, 2 * trace_truth(frame, settings).mean)
    evidence(f"{estimator}: equal to the bit")


def test_when_it_stops(frame):
    assert trace_truth(frame, TruthSettings(samples=24 * 5)).passes == 5
    assert trace_truth(frame, TruthSettings(samples=1)).passes == 2  # one pass has no spread
    good = trace_truth(frame, TruthSettings(samples=10**9, target_error=0.05))
    assert 0.025 < np.sqrt(good.variance_of_mean[:, good.samples > 0].mean()) / good.picture_mean.mean() <= 0.05


def test_it_stops_after_the_time_given(frame, monkeypatch):
    """A clock that goes on by 2 s a look: the first look starts it, one comes after each pass."""
    looks = itertools.count()
    clock = types.SimpleNamespace(perf_counter=lambda: 2.0 * next(looks))
    monkeypatch.setattr(sys.modules[trace_truth.__module__], "time", clock)
    for seconds, passes in ((13.0, 6), (14.0, 6), (14.1, 7), (0.1, 2)):  # looked at at 2, 4, ..., before the first too
        looks = itertools.count()
        assert trace_truth(frame, TruthSettings(samples=10**9, seconds=seconds)).passes == passes


def test_what_comes_back(frame):
    result = trace_truth(frame, TruthSettings(samples=48))
    assert result.mean.shape == result.variance_of_mean.shape == (3, SIZE, SIZE)
    assert result.mean.dtype == np.float64
    assert np.isfinite(result.mean).all()
    assert np.array_equal(result.samples > 0, frame.gbuffer.covered)
    assert set(np.unique(result.samples)) <= {0, 48}
    assert (result.mean[:, result.samples == 0] == 0).all()
    picture = truth(frame, TruthSettings(samples=48))
    assert picture.dtype == frame.dtype
    assert np.array_equal(picture, result.mean.astype(np.float32))


@pytest.mark.parametrize(("key", "value"), [
    ("estimator", "magic"), ("samples", 0), ("seconds", -1.0), ("seconds", math.nan), ("target_error", 0.0),
    ("bounces", 0), ("seed", -1), ("light_grid", 0), ("interleave", 0), ("uniform_share", 0.0), ("picks", 0),
    ("directions", 0), ("bound", 0.0), ("batch", 0),
])
def test_unusable_settings_are_refused(key, value):
    with pytest.raises(InputError, match=key):
        TruthSettings(**{key: value})


def test_settings_that_do_not_go_together():
    with pytest.raises(InputError, match="bounces"):
        TruthSettings(estimator="light", bounces=2)
    with pytest.raises(InputError, match="visibility"):
        TruthSettings(bounces=2, visibility=False)

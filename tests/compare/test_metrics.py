"""The figures of error against loop twins, by hand, and against simulated noise of the reference."""

import importlib.util
import math
import sys

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from refgi.compare import metrics
from refgi.compare.metrics import choose_exposures, flip, ssim_of_noise
from refgi.compare.outcome import measure
from refgi.errors import InputError
from tests.naive import metrics as naive

ROUND_OFF = 1e-9  # relative; sums of < 300 float64 terms lose 1e-14, SSIM's one-pass variances up to 1e-10
NAMES = list(metrics.METRICS)

values = st.floats(0, 1e4, width=32)


@st.composite
def pictures(draw):
    shape = (3, draw(st.integers(1, 7)), draw(st.integers(1, 8)))
    image, reference = (draw(hnp.arrays(np.float32, shape, elements=values)) for _ in range(2))
    covered = draw(hnp.arrays(bool, shape[1:]))
    assume(covered.any())
    return image, reference, draw(st.sampled_from([None, covered]))


@pytest.mark.feature("REF-21")
@pytest.mark.parametrize("name", NAMES)
def test_each_figure_equals_its_loop_twin(name, evidence):
    """Oracle: over random pictures with and without a mask."""
    worst = 0.0

    @settings(max_examples=40, deadline=None, derandomize=True)
    @given(pictures())
    def compare(case):
        nonlocal worst
        fast, slow = metrics.METRICS[name](*case), getattr(naive, name)(*case)
        assert fast == pytest.approx(slow, rel=ROUND_OFF, abs=ROUND_OFF, nan_ok=True)
        if math.isfinite(slow) and slow:
            worst = max(worst, abs(fast - slow) / max(abs(slow), 1.0))

    compare()
    evidence(f"{name}: max difference {worst:.1e} over 40 random pictures")


@pytest.mark.feature("REF-18", "REF-21")
@settings(max_examples=40, deadline=None)
@given(hnp.arrays(np.float32, (4, 3, 3, 5), elements=values), hnp.arrays(np.float32, (4, 3, 3, 5), elements=values))
def test_flicker_equals_its_loop_twin(images, references):
    for reference in (None, references):
        fast, slow = metrics.flicker(list(images), None if reference is None else list(reference)), naive.flicker(
            images, reference)
        assert fast == pytest.approx(slow, rel=ROUND_OFF, nan_ok=True)


@pytest.mark.feature("REF-21")
def test_by_hand():
    """Analytic: two pixels, errors (1, 1, 1) and (-2, 0, 0) against references 1 and 4."""
    reference = np.array([[[1.0, 4.0]]] * 3)
    image = np.array([[[2.0, 2.0]], [[2.0, 4.0]], [[2.0, 4.0]]])
    assert metrics.mse(image, reference) == pytest.approx(7 / 6)
    assert metrics.rmse(image, reference) == pytest.approx(math.sqrt(7 / 6))
    assert metrics.mae(image, reference) == pytest.approx(5 / 6)
    assert metrics.bias(image, reference) == pytest.approx(1 / 6)
    assert metrics.smape(image, reference) == pytest.approx((3 * (1 / 3) + 2 / 6) / 6)
    assert metrics.relmse(image, reference) == pytest.approx((3 * 1 / 1.0625 + 4 / 16.0625) / 6)
    assert metrics.psnr(image, reference) == pytest.approx(10 * math.log10(16 / (7 / 6)))
    assert metrics.ssim(reference, reference) == pytest.approx(1.0)


@pytest.mark.feature("REF-18", "REF-21")
def test_flicker_by_hand():
    still = np.full((3, 2, 2), 2.0)
    assert metrics.flicker([still, still + 1, still]) == pytest.approx(1 / (7 / 3))
    assert metrics.flicker([still + 1, still + 3], [still, still + 2]) == 0.0


@pytest.mark.feature("REF-21")
@pytest.mark.parametrize("name", NAMES)
def test_only_covered_pixels_count(name):
    rng = np.random.default_rng(3)
    image, reference = rng.random((2, 3, 12, 12))
    covered = np.zeros((12, 12), bool)
    covered[2:9, 3:10] = True
    changed = image.copy()
    changed[:, ~covered] = np.nan
    figure = metrics.METRICS[name]
    assert figure(changed, reference, covered) == figure(image, reference, covered)
    assert figure(changed, reference, covered) == pytest.approx(
        figure(image[:, 2:9, 3:10], reference[:, 2:9, 3:10], None), rel=ROUND_OFF)


@pytest.mark.parametrize("name", NAMES)
def test_non_finite_pixels_are_refused_with_their_count(name):
    for which, bad in (("image", np.nan), ("reference", np.inf), ("image", -np.inf)):
        pair = {"image": np.ones((3, 4, 4)), "reference": np.ones((3, 4, 4))}
        pair[which][1, 2, 2] = pair[which][0, 0, 3] = bad
        with pytest.raises(InputError, match=f"{which}: expected finite pixels, got 2"):
            metrics.METRICS[name](pair["image"], pair["reference"], None)


def test_measure_counts_non_finite_pixels_and_hides_no_figure_behind_them():
    image, reference = np.ones((2, 3, 4, 4))
    image[:, 0, 0] = np.nan
    reference[2, 1, 1] = np.inf
    got = measure(image, reference, np.ones((3, 4, 4)))
    assert (got.non_finite, got.non_finite_reference, got.pixels) == (1, 1, 16)
    assert all(math.isnan(f.value) and not f.is_noise for f in got.figures.values())


@pytest.mark.parametrize(("image", "reference", "covered", "word"), [
    (np.ones((3, 2, 2)), np.ones((3, 2, 3)), None, "image"),
    (np.ones((2, 2, 3)), np.ones((2, 2, 3)), None, "reference"),
    (np.ones((3, 2, 2)), np.ones((3, 2, 2)), np.zeros((2, 2), bool), "at least one"),
    (np.ones((3, 2, 2)), np.ones((3, 2, 2)), np.ones((3, 3), bool), "covered"),
])
def test_unusable_arrays_are_named(image, reference, covered, word):
    with pytest.raises(InputError, match=word):
        metrics.mse(image, reference, covered)


def test_a_black_reference_leaves_relative_figures_undefined():
    image, black = np.ones((3, 4, 4)), np.zeros((3, 4, 4))
    figures = measure(image, black, np.zeros((3, 4, 4))).figures
    assert all(math.isnan(figures[name].value) for name in ("relmse", "psnr", "ssim"))
    assert figures["mse"].value == figures["smape"].value == 1.0


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**31), st.integers(-8, 8))
def test_scaling_both_pictures(seed, power):
    """Property: a power of two scales the absolute figures exactly and leaves the relative ones."""
    image, reference = np.random.default_rng(seed).random((2, 3, 5, 6))
    k = 2.0**power
    for name, f in metrics.METRICS.items():
        factor = {"mse": k * k, "rmse": k, "mae": k, "bias": k}.get(name, 1.0)
        assert f(k * image, k * reference, None) == pytest.approx(factor * f(image, reference, None), rel=1e-12)


NOISE_TOLERANCE = 0.02  # 3 x 128^2 samples: an MSE of noise scatters by 0.6 %; normal noise, small beside r
SSIM_TOLERANCE = 0.05  # of 1 - SSIM: luminance is taken as equal and windows as wide


@pytest.fixture
def noisy():
    rng = np.random.default_rng(8)
    y, x = np.mgrid[0:128, 0:128] / 16
    perfect = 1.5 + np.sin(x + np.arange(3)[:, None, None]) * np.cos(y)
    variance = (0.02 + 0.02 * rng.random(perfect.shape)) ** 2
    return perfect, perfect + rng.standard_normal(perfect.shape) * np.sqrt(variance), variance


@pytest.mark.feature("REF-21")
def test_a_perfect_picture_scores_the_noise_of_the_reference(noisy, evidence):
    """Statistical: simulated normal noise of known variance; every figure is marked as noise."""
    got = measure(*noisy).figures
    for name in ("mse", "rmse", "relmse", "mae", "smape"):
        assert got[name].value == pytest.approx(got[name].noise, rel=NOISE_TOLERANCE)
    assert got["psnr"].value == pytest.approx(got["psnr"].noise, abs=10 * math.log10(1 + NOISE_TOLERANCE))
    assert 1 - got["ssim"].value == pytest.approx(1 - got["ssim"].noise, rel=SSIM_TOLERANCE)
    assert all(figure.is_noise for figure in got.values())
    evidence("; ".join(f"{n} {f.value:.4g} vs noise {f.noise:.4g}" for n, f in got.items()))


def test_a_real_error_is_not_marked_as_noise(noisy):
    perfect, reference, variance = noisy
    got = measure(perfect * 1.5, reference, variance).figures
    assert not any(figure.is_noise for figure in got.values())


def test_the_mean_bias_scatters_by_its_standard_error(noisy):
    """Statistical: z over 40 draws has a variance of 1; chi-square bounds at 1e-4 either side."""
    perfect, _, variance = noisy
    rng = np.random.default_rng(21)
    z = []
    for _ in range(40):
        reference = perfect + rng.standard_normal(perfect.shape) * np.sqrt(variance)
        figure = measure(perfect, reference, variance).figures["bias"]
        z.append(figure.value / figure.noise)
    assert 14.0 < sum(v * v for v in z) < 84.0


def test_the_variance_of_the_mean_decides_over_the_bias(noisy):
    """Analytic: standard errors 0.1, 0.2 and 0.3 of channels that share their samples average to 0.2."""
    got = measure(*noisy, mean_variance=np.array([0.01, 0.04, 0.09])).figures["bias"]
    assert got.noise == pytest.approx(0.2)
    assert got.is_noise


def test_without_variance_nothing_is_called_noise():
    figures = measure(np.ones((3, 2, 2)), np.ones((3, 2, 2))).figures
    assert all(math.isnan(f.noise) and not f.is_noise for f in figures.values())


@pytest.mark.parametrize("variance", [np.full((3, 2, 2), -1.0), np.full((3, 2, 2), np.nan), np.ones((2, 2))])
def test_an_unusable_variance_is_refused(variance):
    with pytest.raises(InputError, match="variance"):
        measure(np.ones((3, 2, 2)), np.ones((3, 2, 2)), variance)


def test_ssim_of_a_noiseless_reference_is_one(noisy):
    assert ssim_of_noise(noisy[0], np.zeros_like(noisy[0]), np.ones((128, 128), bool)) == 1.0


@pytest.fixture
def picture():
    y, x = np.mgrid[0:24, 0:32] / 8
    return np.stack([1 + np.sin(x), 1 + np.cos(y), np.full_like(x, 0.5)]).astype(np.float32)


@pytest.fixture
def everywhere():
    return np.ones((24, 32), bool)


@pytest.mark.slow
def test_a_larger_error_is_seen_more(picture, everywhere):
    means = [flip(picture * factor, picture, everywhere).mean for factor in (1.1, 1.5, 3.0)]
    assert 0 < means[0] < means[1] < means[2] <= 1


def test_a_black_picture_does_not_end_this_process(picture, everywhere):
    assert flip(picture, 0 * picture, everywhere).skipped == "the reference is black"
    assert flip(0 * picture, picture, everywhere).mean > 0.3


def test_non_finite_pixels_are_a_reason(picture, everywhere):
    picture[1, 3, 4] = np.nan
    assert "1 pixels are NaN" in flip(picture, np.ones_like(picture), everywhere).skipped


def test_pixels_outside_the_mask_do_not_count(picture, everywhere):
    everywhere[:, 16:] = False
    changed = picture.copy()
    changed[:, :, 16:] = np.nan
    got = flip(changed, picture, everywhere)
    assert (got.mean, got.skipped, got.error.shape) == (0.0, "", (24, 32))


def test_without_the_package_it_says_so(picture, everywhere, monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    assert "pip install" in flip(picture, picture, everywhere).skipped


def test_a_child_that_dies_is_a_reason(picture, everywhere, monkeypatch):
    monkeypatch.setattr(metrics.sys, "executable", sys.executable)
    monkeypatch.setattr(metrics, "choose_exposures", lambda *_: (5.0, -5.0, 3))  # it refuses start > stop by exit()
    assert "flip-evaluator ended with" in flip(picture, picture, everywhere).skipped


def test_exposures_by_hand(everywhere):
    """Analytic: grey 2^-3 with 5 % at 2^2 shows white at -2 stops and grey at +3."""
    grey = np.full((3, 24, 32), 2.0**-3)
    grey[:, :2] = 4.0
    assert choose_exposures(grey, everywhere) == pytest.approx((-2.0, 3.0, 3))
    assert choose_exposures(np.full((3, 24, 32), 0.5), everywhere) == pytest.approx((1.0, 1.0, 1))
    assert math.isclose(choose_exposures(np.where(grey > 1, 4.0, 1e-9), everywhere)[1], 6.0)
    assert choose_exposures(0 * grey, everywhere) is None

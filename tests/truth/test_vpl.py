"""Pixel lights with a shadow ray each, against the truth and against the full sum."""

import itertools
import math

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.frame import Frame
from refgi.scene import load_scene
from refgi.settings import of
from refgi.truth import TruthSettings, VplSettings, trace_truth, vpl

ROUNDING = 2e-5  # float32 sum of the full Eq. 2 against a float64 one: terms near edges carry float32 positions
RESOLUTIONS = (16, 32, 64, 128)
SAMPLED_EDGES = 0.02  # of the mean: a fixed grid of 128 texels samples the edges of the lit area once


def relative_error(picture, reference, seen):
    """Return the rms relative error of the best 99 % of pixels: the others lie on a texel, where it has no bound."""
    error = np.abs(picture - reference) / np.maximum(reference, 0.1 * reference[:, seen].mean())
    best = np.sort(error.max(axis=0)[seen])
    return math.sqrt(np.mean(best[: int(0.99 * len(best))] ** 2))


@pytest.mark.slow("cornell_box")
@pytest.mark.feature("REF-02", "REF-03")
@pytest.mark.parametrize("name", ["cornell_box", pytest.param("atrium", marks=pytest.mark.slow)])
def test_all_texels_converge_to_the_truth(name, evidence):
    found = load_scene(name)
    reference = trace_truth(Frame(found, width=32, height=32), TruthSettings(samples=24 * 100))
    seen = reference.samples > 0
    noise = math.sqrt(np.mean(reference.variance_of_mean)) / reference.picture_mean.mean()
    errors = []
    for resolution in RESOLUTIONS:
        picture = vpl(Frame(found, width=32, height=32, rsm_resolution=resolution), of(VplSettings, pattern="all"))
        errors.append(relative_error(picture, reference.mean, seen))
    slope = -np.polyfit(np.log(RESOLUTIONS), np.log(errors), 1)[0]
    mean = picture[:, seen].mean() / reference.mean[:, seen].mean()
    evidence(f"{name}: rms error {', '.join(f'{e:.4f}' for e in errors)} with maps of {RESOLUTIONS}, order {slope:.2f} "
             f"in texels along a side (truth's noise {noise:.4f}); mean {mean:.4f} of the truth's")
    assert slope > 0.5  # between 1/2 (edges of light and shadow) and 1 or more (smooth light)
    assert all(finer < coarser for coarser, finer in itertools.pairwise(errors))
    assert abs(mean - 1) < SAMPLED_EDGES


@pytest.mark.slow
@pytest.mark.feature("REF-03")
def test_the_full_sum_without_visibility_is_that_of_sii_and_of_the_truth(evidence):
    from refgi.splat.sii.settings import SiiSettings
    from refgi.splat.sii.sii import sii

    frame = Frame(load_scene("cornell_box"), width=32, height=32, rsm_resolution=128)
    ours = vpl(frame, of(VplSettings, pattern="all", visibility=False))
    theirs = sii(frame, of(SiiSettings, pattern="all", clamp="none"))
    reference = trace_truth(frame, TruthSettings(samples=24 * 80, visibility=False))
    sums = np.abs(ours - theirs).max() / ours.max()
    mean = ours[:, frame.gbuffer.covered].mean() / reference.mean[:, frame.gbuffer.covered].mean()
    error = relative_error(ours, reference.mean, frame.gbuffer.covered)
    evidence(f"vpl and sii differ by {sums:.1e} of the maximum; their mean is {mean:.4f} of truth(visibility=False), "
             f"rms error {error:.4f}")
    assert sums < ROUNDING
    assert abs(mean - 1) < SAMPLED_EDGES
    assert error < 0.05  # as with visibility at this resolution


def test_shadows_only_take_light_away_and_batches_change_nothing():
    frame = Frame(load_scene("cornell_box"), width=32, height=32, rsm_resolution=64)
    shadowed, free = vpl(frame, of(VplSettings, lights=200)), vpl(frame, of(VplSettings, lights=200, visibility=False))
    assert (shadowed <= free).all()
    assert 0.5 < shadowed.mean() / free.mean() < 0.95
    assert np.array_equal(shadowed, vpl(frame, of(VplSettings, lights=200, batch=3000)))
    assert (shadowed[:, ~frame.gbuffer.covered] == 0).all()


@pytest.mark.feature("REF-05")
def test_light_is_additive():
    found = load_scene("cornell_box")
    single = Frame(found, width=24, height=24, rsm_resolution=32)
    double = Frame(found.with_lights(*found.lights, *found.lights), width=24, height=24, rsm_resolution=32)
    settings = of(VplSettings, pattern="all")
    assert vpl(double, settings) == pytest.approx(2 * vpl(single, settings), rel=1e-6)


@pytest.mark.parametrize(("key", "value"), [("lights", 0), ("pattern", "spiral"), ("seed", -1), ("batch", 0)])
def test_unusable_settings_are_refused(key, value):
    with pytest.raises(InputError, match=key):
        of(VplSettings, **{key: value})

"""What each approximation costs: every step against the pictures of literal loops, from many lights to the blur."""

import math
from itertools import pairwise

import numpy as np
import pytest

from refgi.cluster.reference.split import STEPS, exact_shadows, split_error, steps_between
from refgi.cluster.settings import ValSettings
from refgi.errors import InputError
from refgi.frame import Frame
from refgi.lights.selection import choose_lights
from refgi.scene import load_scene
from refgi.settings import of, replaced
from refgi.truth import TruthSettings, VplSettings, trace_truth, vpl
from tests.naive import clustered

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # that is told: tests/pairs/test_loss

# near pairs clamped at a twentieth of the scene's metre: else the error of sampling is that of a pixel beside a light
# the scale of depths that the limits below were measured with
SETTINGS = of(ValSettings, lights=128, clusters_count=12, maps_resolution=64, clamp="distance", clamp_value=0.1,
                       depth_scale="scene", near_distance=0.5)
FEW = replaced(SETTINGS, {"lights": 48, "clusters.count": 4, "maps.resolution": 16, "interleaving": 1})
# What each picture is by the literal twin; "lights" has as many area lights as lights.
LITERAL = {
    "lights": {"visibility": "rays_vpls", "clusters.count": 48}, "rays_vpls": {"visibility": "rays_vpls"},
    "rays_rectangle": {"visibility": "rays_rectangle"}, "back_projection": {"visibility": "back_projection"},
    "pcss": {"visibility": "pcss"}, "csm": {"visibility.prefilter": "brute"}, "mip": {}, "interleaved": {
        "interleaving": 4}}
# every texel a light with a ray of its own, and not clamped
MANY = {"lights.source.pattern": "all", "visibility": "rays_vpls", "clusters.count": 1 << 20, "pairs.clamp": None}
ROUNDING = 2e-6  # of the maximum: float32 sums of a hundred terms against float64 ones
GRAZING = 5e-4  # of a step: a ray of float32 that meets an edge of the ball or not, one of 256 to a rectangle
# How the steps of visibility add up: the root of their squares over the error of all six, 1 where they are independent,
# 6^-1/2 where they are alike, more where some take back what others did: 3 on cornell_horse, whose rectangle darkens
# what one view from its centre brightens.
ROOTS, AROUND = {"cornell_box": 1.01, "cornell_sphere:faces=600": 1.32}, 0.1
LEAST_ROOT, MOST_ROOT = 1.0, 3.5


@pytest.fixture(scope="module", params=["cornell_box", "cornell_sphere:faces=80"])
def literal(request):
    """Return a scene's frame and its pictures by plain loops, the first one of many lights."""
    frame = Frame(load_scene(request.param), width=8, height=8, rsm_resolution=16, dtype=np.float64)
    pictures = {name: clustered.picture(frame, replaced(FEW, keys)) for name, keys in LITERAL.items()}
    return frame, {"many": clustered.picture(frame, replaced(FEW, MANY)), **pictures}


def rms(values):
    return math.sqrt((values**2).mean())


def changes(frame, pictures):
    """Return what each picture changes at pixels that see a surface, over the mean of the first."""
    values = [light[:, frame.gbuffer.covered] for light in pictures]
    return [(after - before) / values[0].mean() for before, after in pairwise(values)]


@pytest.mark.feature("VAL-27", "REF-15")
def test_each_step_is_the_change_between_literal_pictures(literal, evidence):
    """Oracle: from many lights to few, their clusters, rectangles, one view, one blocker, series, levels and blocks."""
    frame, expected = literal
    found, steps = split_error(frame, FEW, expected["many"], block=4), changes(frame, expected.values())
    assert [step.name for step in found.steps] == list(LITERAL) == ["lights", *STEPS, "interleaved"]
    evidence(f"{frame.scene.name}: " + ", ".join(f"{step.name} {step.rmse:.3f} (loops {rms(change):.3f})"
                                                 for step, change in zip(found.steps, steps, strict=True)))
    for k, (step, change) in enumerate(zip(found.steps, steps, strict=True)):
        assert step.rmse == pytest.approx(rms(change), rel=GRAZING)
        assert step.shift == pytest.approx(change.mean(), abs=GRAZING)
        assert step.so_far == pytest.approx(rms(sum(steps[: k + 1])), rel=GRAZING)
    whole, root = found.together("rays_vpls", "mip")
    assert whole == pytest.approx(rms(sum(steps[1:7])), rel=GRAZING)
    assert root == pytest.approx(math.hypot(*map(rms, steps[1:7])), rel=GRAZING)
    assert found.whole == pytest.approx(rms(sum(steps)), rel=GRAZING)
    assert found.root_of_squares == pytest.approx(math.hypot(*map(rms, steps)), rel=GRAZING)


@pytest.mark.feature("VAL-02", "VAL-27")
def test_the_picture_of_exact_shadows_is_that_of_vpl(evidence):
    frame = Frame(load_scene("cornell_box"), width=20, height=20, rsm_resolution=64)
    settings = of(ValSettings, lights=100)
    exact = exact_shadows(frame, choose_lights(frame, settings.lights), settings)
    reference = vpl(frame, of(VplSettings, lights=100))
    off = np.abs(exact - reference).max() / reference.max()
    evidence(f"100 area lights of one light each, V by rays: {off:.1e} of the maximum off the method vpl")
    assert off < ROUNDING


def judge(name, frame, settings, samples, evidence):
    """Split a frame's error and return the root of the squares of the steps of visibility over their error."""
    found = split_error(frame, settings, trace_truth(frame, TruthSettings(samples=samples)).mean, block=4)
    whole, root = found.together("rays_vpls", "mip")
    evidence(f"{name}, rmse / mean of truth: " + ", ".join(f"{step.name} {step.rmse:.3f}" for step in found.steps)
             + f"; steps of visibility together {whole:.3f}, root of their squares {root:.3f} ({root / whole:.2f}); "
             f"all {found.whole:.3f}, root {found.root_of_squares:.3f}")
    assert all(0 < step.rmse < 1 for step in found.steps[1:])  # of few lights in a large scene more may be missing
    return root / whole


@pytest.mark.feature("VAL-27", "REF-15")
@pytest.mark.parametrize("name", ROOTS)
def test_steps_of_visibility_are_independent_or_take_back_some_of_each_other(name, evidence):
    frame = Frame(load_scene(name), width=32, height=32, rsm_resolution=64)
    assert judge(name, frame, SETTINGS, 384, evidence) == pytest.approx(ROOTS[name], abs=AROUND)


@pytest.mark.slow
@pytest.mark.feature("VAL-27", "REF-15")
@pytest.mark.parametrize("name", ["cornell_horse", "sponza", "kitchen"])
def test_steps_in_real_scenes(name, data_dir, evidence):
    found = load_scene(data_dir / f"{name}.json")
    frame = Frame(found, width=24, height=24, rsm_resolution=128)
    settings = of(ValSettings, lights=256, clamp="distance", clamp_value=0.05 * found.geometry.diagonal)
    assert LEAST_ROOT < judge(name, frame, settings, 384, evidence) < MOST_ROOT


def test_steps_of_known_pictures():
    first = np.full((3, 2, 2), 2.0)
    second, third = first + np.array([[1.0, -1.0], [9.0, 9.0]]), first + np.array([[1.0, 1.0], [9.0, 9.0]])
    covered = np.array([[True, True], [False, False]])
    one, two = steps_between({"a": first, "b": second, "c": third}, covered)
    assert (one.name, one.rmse, one.shift, one.so_far) == ("b", 0.5, 0.0, 0.5)
    assert (two.name, two.shift, two.so_far) == ("c", 0.5, 0.5)
    assert two.rmse == pytest.approx(math.sqrt(0.5))
    with pytest.raises(InputError, match="black"):
        steps_between({"a": 0 * first, "b": second}, covered)


def test_without_truth_and_with_rays_behind():
    frame = Frame(load_scene("cornell_box"), width=8, height=8, rsm_resolution=32)
    settings = replaced(SETTINGS, {"lights": 32, "clusters_count": 3, "maps_resolution": 16, "behind": "raytrace"})
    found = split_error(frame, settings, block=2)
    assert next(iter(found.pictures)) == "lights"
    assert all(np.isfinite(picture).all() and (picture >= 0).all() for picture in found.pictures.values())

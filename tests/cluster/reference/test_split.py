"""What each approximation costs: steps that add up, from exact shadows to the published picture."""

import math

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

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # that is told: tests/pairs/test_loss

# near pairs clamped at a twentieth of the scene's metre: else the error of sampling is that of a pixel beside a light
# the scale of depths that the limits below were measured with
SETTINGS = of(ValSettings, lights=128, clusters_count=12, maps_resolution=64, clamp="distance", clamp_value=0.1,
                       depth_scale="scene", near_distance=0.5)
ROUNDING = 2e-6  # of the maximum: float32 sums of a hundred terms against float64 ones
# the root of summed squares over the error of all six steps of visibility: 1 for independent ones, 6^-1/2 where all
# are alike (Cauchy and Schwarz), without bound where they cancel: 3.1 on cornell_horse, whose rectangle darkens what
# one view from its centre brightens
LEAST_ROOT = 6**-0.5 - ROUNDING
MOST_ROOT = 2.0  # in the boxes, where blockers are simple


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
    """Split a frame's error, record it and check how the steps add up."""
    reference = trace_truth(frame, TruthSettings(samples=samples)).mean
    found = split_error(frame, settings, reference, block=4)
    whole, root = found.together("rays_vpls", "mip")
    evidence(f"{name}, rmse / mean of truth: " + ", ".join(f"{step.name} {step.rmse:.3f}" for step in found.steps)
             + f"; steps of visibility together {whole:.3f}, root of their squares {root:.3f} ({root / whole:.2f}); "
             f"all {found.whole:.3f}, root {found.root_of_squares:.3f}")
    assert [step.name for step in found.steps] == ["lights", *STEPS, "interleaved"]
    assert all(0 < step.rmse < 1 for step in found.steps[1:])  # of few lights in a large scene more may be missing
    assert whole <= sum(found.steps[i].rmse for i in range(1, 1 + len(STEPS))) + ROUNDING  # triangle inequality
    assert root / whole > LEAST_ROOT
    return found, root / whole


@pytest.mark.feature("VAL-27", "REF-15")
@pytest.mark.parametrize("name", ["cornell_box", "cornell_sphere:faces=600"])
def test_errors_of_the_steps_add_up_plausibly(name, evidence):
    frame = Frame(load_scene(name), width=32, height=32, rsm_resolution=64)
    found, root = judge(name.partition(":")[0], frame, SETTINGS, 384, evidence)
    assert 1 / MOST_ROOT < root < MOST_ROOT
    mean = found.pictures["truth"][:, found.covered].mean()
    changes = sum(step.shift for step in found.steps)
    assert changes == pytest.approx(found.pictures["interleaved"][:, found.covered].mean() / mean - 1, abs=1e-6)


@pytest.mark.slow
@pytest.mark.feature("VAL-27", "REF-15")
@pytest.mark.parametrize("name", ["cornell_horse", "sponza", "kitchen"])
def test_errors_of_real_scenes(name, data_dir, evidence):
    found = load_scene(data_dir / f"{name}.json")
    frame = Frame(found, width=24, height=24, rsm_resolution=128)
    settings = of(ValSettings, lights=256, clamp="distance", clamp_value=0.05 * found.geometry.diagonal)
    judge(name, frame, settings, 384, evidence)


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

"""How steady the picture is under a lamp that moves: filtered fluxes, and patterns that are fixed to the map."""

import dataclasses
import math

import numpy as np
import pytest

from refgi.compare.metrics import flicker
from refgi.frame import Frame
from refgi.lights.selection import pixel_lights
from refgi.lights.settings import LightSettings
from refgi.scene import load_scene
from refgi.settings import of, replaced
from refgi.splat import SiiSettings, sii

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # that is told: tests/pairs/test_loss

ALL = of(SiiSettings, pattern="all")  # the sum without a cut


@pytest.fixture(scope="module")
def box():
    return Frame(load_scene("cornell_box"), width=48, height=48, rsm_resolution=128)


@pytest.mark.feature("SII-03")
def test_filtered_flux_is_steadier_under_a_moving_light(box, evidence):
    """The light turns by a quarter of a texel a step. A texel enters or leaves the grid's choice at once, a cell's
    sum by little."""
    scene, light = box.scene, box.scene.lights[0]
    step = 2 * math.tan(light.outer_half_angle) / 128 / 4
    means = {False: [], True: []}
    for k in range(24):
        turned = np.asarray(light.direction) / np.linalg.norm(light.direction) + [k * step, 0, 0]
        moved = scene.with_lights(dataclasses.replace(light, direction=tuple(turned)))
        frame = Frame(moved, width=16, height=16, rsm_resolution=128)
        for filtered in means:
            how = of(SiiSettings, lights=64, pattern="grid", filtered=filtered, clamp="distance", clamp_value=0.05)
            means[filtered].append(sii(frame, how).mean(axis=(1, 2)))

    def unsteady(values):
        return float(np.diff(values, 2, axis=0).std() / np.mean(values))  # what is left of a smooth change: nothing

    plain, steady = unsteady(means[False]), unsteady(means[True])
    assert steady < plain / 2
    sums = [pixel_lights(box.rsms, of(LightSettings, count=64, pattern="grid", filtered=True)).flux.sum(axis=1),
            box.rsms[0].flux.sum(axis=(1, 2))]
    np.testing.assert_allclose(*sums, rtol=1e-5)  # float32 sums
    evidence(f"std of the second difference of E over 24 quarter-texel steps: {plain:.3%} unfiltered, "
             f"{steady:.3%} filtered; flux sum kept")


@pytest.mark.feature("REF-18")
def test_lights_that_hold_their_places_on_the_map_flicker_less(box, evidence):
    """The flicker metric against every texel's pictures, of a lamp that glides by 1 mm a frame.

    Errors of fresh patterns know nothing of each other, so that theirs is the root of 2 times the error itself.
    """
    light, clamp = box.scene.lights[0], {"clamp": "distance", "clamp_value": 0.05}
    x, y, z = light.position
    moved = [box.scene.with_lights(dataclasses.replace(light, position=(x + 1e-3 * k, y, z))) for k in range(12)]
    frames = [Frame(scene, width=24, height=24, rsm_resolution=128) for scene in moved]
    exact = [sii(frame, replaced(ALL, clamp)) for frame in frames]
    found, error = {}, {}
    for name, how in (("fresh", {"pattern": "random"}), ("fixed", {}), ("filtered", {"filtered": True})):
        seeds = range(len(frames)) if name == "fresh" else [1] * len(frames)
        pictures = [sii(frame, of(SiiSettings, lights=256, seed=seed, **clamp, **how))
                    for frame, seed in zip(frames, seeds, strict=True)]
        found[name] = flicker(pictures, exact)
        error[name] = math.sqrt(np.mean([(one - other) ** 2 for one, other in zip(pictures, exact, strict=True)]))
    mean = np.mean(exact)
    assert found["fresh"] == pytest.approx(math.sqrt(2) * error["fresh"] / mean, rel=0.15)
    assert found["filtered"] < found["fixed"] < 0.1 * found["fresh"]
    evidence("flicker, and error: " + ", ".join(f"{name} {value:.1%}, {error[name] / mean:.1%}"
                                                for name, value in found.items()))

"""`Sequence`: seeds, what it keeps of earlier frames, what it refuses, and that `hssil` runs in it."""

import dataclasses
import gc
import weakref

import numpy as np
import pytest

from refgi import stages
from refgi.errors import InputError
from refgi.scene import load_scene
from refgi.settings import LAST_SEED, of, replaced
from refgi.sssil.settings import HssilSettings
from refgi.sssil.temporal import Sequence, TemporalSettings

QUICK = {"rsm_resolution": 8}


@pytest.fixture(scope="module")
def room():
    return load_scene("cornell_box").with_camera(width=24, height=20)


def white(frame, settings):
    """Noise of the settings' seed."""
    return np.random.default_rng(settings.sampling.seed).random((3, frame.height, frame.width), dtype=np.float32)


def test_the_seed_advances(room):
    seeds = []

    def light(frame, settings):
        seeds.append(settings.sampling.seed)
        return white(frame, settings)

    list(Sequence([room] * 3, of(HssilSettings, seed=LAST_SEED - 1), method=light, **QUICK))
    assert seeds == [LAST_SEED - 1, LAST_SEED, 0]


def test_a_method_without_seed_is_asked_as_it_is(room):
    @dataclasses.dataclass(frozen=True)
    class Plain:
        brightness: float = 2.0

    def light(frame, settings):
        assert settings is plain
        return np.full((3, frame.height, frame.width), settings.brightness, np.float32)

    plain = Plain()
    assert len(list(Sequence([room] * 2, plain, method=light, **QUICK))) == 2


@pytest.mark.slow
@pytest.mark.feature("HSS-13")
def test_only_what_the_next_frame_needs_is_kept(room, evidence):
    x, y, z = room.camera.eye
    scenes = (room.with_camera(eye=(x + 0.01 * i, y, z)) for i in range(5))
    frames, lights, alive = [], [], []
    for step in Sequence(scenes, method=white, **QUICK):
        frames.append(weakref.ref(step.frame))
        lights.append(weakref.ref(step.radiance))
        del step
        gc.collect()
        alive.append(sum(ref() is not None for ref in (*frames, *lights)))
    assert max(alive[1:]) <= 2  # the frame at hand, as the generator stands on it; none before it
    gc.collect()
    assert not any(ref() is not None for ref in (*frames, *lights))
    sequence = Sequence([], method=white, **QUICK)
    _, history = sequence._step(room, 0, None)
    kept = history.light[:3].nbytes + history.view.depth.nbytes + history.view.normal.nbytes
    pixels = 24 * 20
    assert kept == 7 * 4 * pixels
    assert history.geometry is room.geometry
    evidence(f"{kept / pixels:.0f} bytes a pixel are kept of a frame (light, depth, normal), and the triangles")


def test_without_a_filter_each_frame_is_by_itself(room):
    settings = of(HssilSettings, seed=5)
    for number, step in enumerate(Sequence([room] * 3, settings, None, method=white, **QUICK)):
        assert np.array_equal(step.irradiance, white(step.frame, replaced(settings, {"seed": 5 + number})))
        assert step.reused == 0


def test_the_printed_form_averages_two_frames(room):
    settings = of(HssilSettings, seed=3)
    steps = list(Sequence([room] * 3, settings, TemporalSettings(weight=0.75, form="printed"), method=white, **QUICK))
    one, two = (white(steps[2].frame, of(HssilSettings, seed=seed)) for seed in (4, 5))
    covered = steps[2].frame.gbuffer.covered
    assert np.allclose(steps[2].irradiance[:, covered], (0.75 * one + 0.25 * two)[:, covered], atol=1e-6)


@pytest.mark.feature("HSS-16")
def test_radiance_is_that_of_the_filtered_light(room):
    for step in Sequence([room] * 2, method=white, **QUICK):
        assert np.array_equal(step.radiance, step.frame.radiance(step.irradiance))


def test_a_list_of_scenes_can_be_rendered_twice(room):
    sequence = Sequence([room] * 2, method=white, **QUICK)
    first, second = [[step.irradiance for step in sequence] for _ in range(2)]
    assert all(map(np.array_equal, first, second))


@pytest.mark.parametrize("own", [False, True])
def test_under_a_memory_resting_frames_share_their_buffers(room, own):
    memory = stages.Memory()
    with stages.observe(memory=None if own else memory) as log:
        list(Sequence([room, room], method=white, memory=memory if own else None, **QUICK))
    for shared in ("rsm.gbuffer", "rsm.reflective_shadow_map"):
        assert log.status(shared) == ["ran", "reused"]


def test_what_is_refused(room):
    with pytest.raises(InputError, match="temporal"):
        Sequence([room], temporal=0.9)
    with pytest.raises(InputError, match="scene of frame 1: expected a Scene, got 'str'"):
        list(Sequence([room, "cornell_box"], method=white, **QUICK))


@pytest.mark.feature("HSS-13")
def test_hssil_grows_calm(evidence):
    """The noise of few samples, from frame to frame, before the filter and after it."""
    scene = load_scene("cornell_box").with_camera(width=48, height=40)
    settings = of(HssilSettings, samples=8, radius=None, levels=2, start="full")
    changes = {}
    for temporal in (None, TemporalSettings(weight=0.7)):
        steps = list(Sequence([scene] * 12, settings, temporal, rsm_resolution=64))
        covered = steps[0].frame.gbuffer.covered
        late = np.stack([step.irradiance[:, covered] for step in steps[-4:]])
        changes[temporal] = np.square(np.diff(late, axis=0)).mean()
        mean = late.mean()
    plain, filtered = changes.values()
    # differences of successive filtered frames have (1 - a)^2 2 / (1 + a) of the variance, of unfiltered ones 2
    expected = 0.3**2 / 1.7
    assert filtered / plain == pytest.approx(expected, rel=0.5)
    assert mean > 0
    evidence(f"hssil with 8 samples: change from frame to frame falls to {filtered / plain:.4f}, in theory "
             f"{expected:.4f}")

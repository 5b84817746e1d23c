"""Frames of a scene that changes: the picture of a fresh render to the bit, and nothing that rests made twice."""

import dataclasses
import gc
import resource
import weakref

import numpy as np
import pytest

import refgi
from refgi.errors import InputError
from refgi.methods import METHODS, render
from refgi.settings import of
from refgi.stages import Memory, observe

pytestmark = pytest.mark.filterwarnings("ignore::refgi.errors.RefgiWarning")

SMALL = {"width": 40, "height": 32, "rsm_resolution": 48}
QUICK = {"truth": {"samples": 4}, "vpl": {"lights": 16}, "val": {"lights": 32, "clusters": 3, "maps": 16}}
MOVES = {"nothing": (), "camera": ("camera",), "light": ("light",), "both": ("camera", "light")}
STEPS = 3


@pytest.fixture(scope="module")
def scene():
    return refgi.load_scene("cornell_box")


def moved(scene, moves, step):
    if "camera" in moves:
        x, y, z = scene.camera.eye
        scene = scene.with_camera(eye=(x + 0.01 * step, y, z))
    if "light" in moves:
        x, y, z = scene.lights[0].position
        scene = scene.with_lights(dataclasses.replace(scene.lights[0], position=(x + 0.01 * step, y, z)))
    return scene


def settings_of(method):
    return of(METHODS[method].settings, **QUICK.get(method, {}))


def reused(animation):
    return {run.name for run in animation.runs if run.status == "reused"}


@pytest.mark.parametrize("method", ["sii", "multires", "val", "hssil", "gather", "vpl", "truth"])
def test_frames_are_those_of_fresh_renders(scene, method):
    animation = refgi.frames(scene, method, settings_of(method), **SMALL)
    scenes = [moved(scene, MOVES[name], step) for step, name in enumerate(["both", "camera", "light", "nothing"])]
    for one, picture in zip(scenes, animation.along(scenes), strict=True):
        fresh = render(one, method, settings_of(method), **SMALL)
        np.testing.assert_array_equal(picture.irradiance, fresh.irradiance)
        np.testing.assert_array_equal(picture.radiance, fresh.radiance)
        assert animation.scene is one


@pytest.mark.parametrize("name", MOVES)
def test_what_rests_is_not_made_again(scene, name):
    """Table 1 of SII: the light's map while the light rests, what the camera sees while the camera does."""
    moves, animation = MOVES[name], refgi.frames(scene, "sii", **SMALL)
    for step in range(STEPS):
        animation.render(moved(scene, moves, step))
    assert (not animation.runs) == (not moves)
    if not moves:
        return
    assert ("rsm.reflective_shadow_map" in reused(animation)) == ("light" not in moves)
    assert ("lights.choose" in reused(animation)) == ("light" not in moves)
    assert ("rsm.gbuffer" in reused(animation)) == ("camera" not in moves)


@pytest.mark.parametrize("method", [*METHODS])
def test_a_scene_that_rests_is_not_rendered_again(scene, method):
    animation = refgi.frames(scene, method, settings_of(method), **SMALL)
    first = animation.render()
    assert animation.runs
    second, third = animation.render(), animation.render(scene.with_camera(eye=scene.camera.eye))
    assert second is first
    assert third is first
    assert not animation.runs


@pytest.mark.parametrize(("method", "changed"), [("val", {}), ("multires", {"visibility": "val", "lights": 32})])
def test_maps_of_area_lights_are_kept_while_light_and_what_can_block_it_rest(method, changed):
    """A camera that moves draws none of them again, though it sees other pixels."""
    shown = refgi.load_scene("cornell_sphere:faces=10000")
    settings = of(METHODS[method].settings, **QUICK.get(method, {}), **changed)
    ran = {}
    for name in ("camera", "light", "both"):
        animation = refgi.frames(shown, method, settings, **SMALL)
        for step in range(STEPS):
            animation.render(moved(shown, MOVES[name], step))
        ran[name] = {run.name for run in animation.runs if run.status == "ran"}
    assert "rsm.resolve" in ran["camera"]
    assert "cluster.distances" not in ran["camera"]
    assert "cluster.distances" in ran["light"] & ran["both"]
    assert "cluster.blockers" not in ran["camera"] | ran["light"] | ran["both"]


@pytest.mark.parametrize("method", ["multires", "hssil"])
def test_memory_is_that_of_two_frames(scene, method):
    """A frame's buffers are gone when the frame after the next begins, and no new memory is asked for."""
    animation = refgi.frames(scene, method, width=512, height=512)
    buffers, faults = [], []
    for step in range(8):
        before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
        picture = animation.render(moved(scene, MOVES["both"], step))
        faults.append(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
        buffers.append(weakref.ref(picture.frame.gbuffer))
        del picture
    gc.collect()
    assert [buffer() is None for buffer in buffers] == [True] * 6 + [False] * 2
    pages = 512 * 512 * 3 * 4 / resource.getpagesize()  # of one plane of three channels; a frame makes ten
    assert sorted(faults[4:])[1] < pages / 4


def test_a_refused_frame_is_followed_by_others(scene):
    animation = refgi.frames(scene, "sii", **SMALL)
    expected = animation.render().radiance
    with pytest.raises(InputError, match="at least one light"):
        animation.render(scene.with_lights())
    np.testing.assert_array_equal(animation.render(scene).radiance, expected)


def test_whoever_observes_goes_on_observing(scene):
    heard, own = [], Memory()
    with observe(memory=own, progress=lambda name, share: heard.append((name, share))) as log:
        refgi.frames(scene, "sii", **SMALL).render()
        refgi.frames(scene, "sii", **SMALL).render()  # another one's frames are not these
        first, second = refgi.frames(scene, "sii", **SMALL), refgi.frames(scene, "hssil", **SMALL)
        first.render()
        second.render()
    assert [name for name, share in heard if share == 0].count("rsm.gbuffer") == 4
    assert "pairs.sum" in {run.name for run in first.runs} - {run.name for run in second.runs}
    assert len(log.runs) > len(first.runs) + len(second.runs)


def test_bad_scenes_and_methods_are_named(scene):
    with pytest.raises(InputError, match="no_such"):
        refgi.frames("no_such_scene")
    with pytest.raises(InputError, match="method: expected one of"):
        refgi.frames(scene, "no_such").render()

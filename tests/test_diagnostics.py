"""What pictures say of their own errors: of sampling, of lobes that vanish, of few samples; once for frames."""

import dataclasses
import json
import math
import re
import warnings

import numpy as np
import pytest
from click.testing import CliRunner

import refgi
from refgi.cli.group import VerbGroup
from refgi.errors import RefgiWarning
from refgi.lights import choose_pixel_lights
from refgi.methods import METHODS, render
from refgi.pairs.estimates import LEAST_ERROR, error_of_halves
from refgi.scene import Camera, DirectionalLight, Scene, load_scene, merge
from refgi.settings import of
from refgi.sssil.temporal import Sequence
from refgi.stages import Memory, observe
from tests.lights.test_pixel_lights import box_map, cube_map
from tests.truth.scenes import WHITE, rectangle

SMALL = {"width": 48, "height": 48, "rsm_resolution": 64}
BOX = load_scene("cornell_box")
DIAGNOSTICS = ("pairs.seen_light", "pairs.clamp_loss", "sii.cut_loss", "gather.loss", "pairs.sampling_error",
               "gather.sampling_error", "vpl.sampling_error", "sssil.sample_loss")
FRAMES = {"sii": {"cut": "relative"}, "multires": {}, "val": {"maps": 16, "clusters": 3},
          "gather": {}, "vpl": {"lights": 16}, "hssil": {"samples": 4}}
# of the RMS error over pixels against all texels, of two halves that differ by chance: measured 0.6 to 1.1
LOW, HIGH = 0.5, 1.5


def told(scene, method, **settings):
    """Return the picture, and what was warned of."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", RefgiWarning)
        picture = render(scene, method, of(METHODS[method].settings, **settings), **SMALL)
    return picture, [str(each.message) for each in caught]


def slab(side):
    """Return a sunlit slab with a block of 1 m before the camera."""
    block = [rectangle((0, 0, 0), (0, 0, 1), (0, 1, 0), WHITE), rectangle((1, 0, 0), (0, 0, 1), (0, 1, 0), WHITE),
             rectangle((0, 0, 1), (1, 0, 0), (0, 1, 0), WHITE), rectangle((0, 1, 0), (1, 0, 0), (0, 0, 1), WHITE)]
    geometry, materials = merge([rectangle((-side / 2, 0, side / 2), (side, 0, 0), (0, 0, -side), WHITE), *block])
    camera = Camera((1.0, 2.5, 7.0), (0.5, 0.3, 0.0), (0, 1, 0), math.radians(40), 48, 48)
    return Scene("slab", geometry, materials, camera, (DirectionalLight((-0.4, -1.0, -0.3), (1.0, 1.0, 1.0)),))


@pytest.mark.parametrize("pattern", ["halton", "random", "grid"])
def test_each_half_of_a_draw_is_a_sample_of_the_whole_map(pattern):
    """A half, doubled, has the map's flux in each quarter of the map, as far as so many texels can tell."""
    rsm = box_map(64)
    lights = choose_pixel_lights([rsm._replace(flux=np.ones_like(rsm.flux))], count=1024, pattern=pattern, seed=3)
    row, column = np.divmod(lights.texel, 64)
    quarter = row // 32 * 2 + column // 32
    for second in (False, True):
        counts = np.bincount(quarter[lights.half == second], minlength=4)
        assert counts.sum() == 512
        assert np.abs(counts - 128).max() <= (4 if pattern != "random" else 45)  # random: 4.5 standard deviations


def test_halves_of_a_grid_are_the_colours_of_a_chessboard():
    rsm = box_map(64)
    lights = choose_pixel_lights([rsm._replace(flux=np.ones_like(rsm.flux))], count=64, pattern="grid")
    row, column = np.divmod(lights.texel, 64)
    np.testing.assert_array_equal(lights.half, (row // 8 + column // 8) % 2 == 1)


def test_odd_lights_go_to_either_half_in_turn():
    lights = choose_pixel_lights([box_map()] * 4, count=4, pattern="halton", seed=5)
    alone = [lights.half[lights.map_index == k].tolist() for k in range(4)]
    assert [one for one in alone if one] == [[k % 2 == 0] for k, one in enumerate(alone) if one]
    assert choose_pixel_lights([cube_map()], count=None, pattern="all").half is None


def test_halves_by_hand():
    """Halves 1 and 3, 2 and 2: 4 on the average, off by 2 and 0; by halves of no light nothing is told."""
    found = error_of_halves(np.array([[1.0, 2.0]]), np.array([[3.0, 2.0]]), 9)
    assert (found.pixel, found.mean) == pytest.approx((math.sqrt(2) / 4, 1 / 4))
    assert error_of_halves(np.zeros((3, 4)), np.zeros((3, 4)), 9) is None


@pytest.mark.parametrize(("method", "change"), [
    ("sii", {}), ("sii", {"lights": 96}), ("sii", {"pattern": "grid"}), ("sii", {"pattern": "random"}),
    ("sii", {"warp": "A"}), ("sii", {"filtered": True}), ("val", {"maps": 16}), ("multires", {"pattern": "halton"})])
@pytest.mark.filterwarnings("ignore::refgi.errors.RefgiWarning")
def test_the_sampling_error_is_that_against_all_texels(method, change, evidence):
    """Picture: the RMS difference of the method's lights and all texels, summed by sii at every pixel."""
    settings = of(METHODS[method].settings, **{"lights": 384} | change)
    stated = render(BOX, method, settings, **SMALL).sampling_error
    how = of(METHODS["sii"].settings, **{"lights": 384} | (change if method != "val" else {}))
    drawn, every = (render(BOX, "sii", one, **SMALL) for one in (how, of(METHODS["sii"].settings, pattern="all")))
    assert every.sampling_error is None
    covered = drawn.frame.gbuffer.covered
    off = (drawn.irradiance - every.irradiance)[:, covered]
    true = float(np.sqrt((off**2).mean()) / every.irradiance[:, covered].mean())
    assert LOW * true < stated.pixel < HIGH * true
    assert stated.samples == settings.lights.count or "grid" in change.values()
    evidence(f"{method} {change}: {stated.pixel:.1%} stated, {true:.1%} against all texels")


@pytest.mark.parametrize("method", ["sii", "multires", "val", "gather", "vpl"])
@pytest.mark.parametrize("side", [100.0, 1000.0])
def test_a_large_slab_with_small_things_is_told(side, method):
    """Pixel lights hardly meet what the camera sees: 0.005 in place of 0.04 W/m^2 at 768 lights."""
    picture, said = told(slab(side), method)
    assert picture.sampling_error.pixel > LEAST_ERROR
    assert sum("sampling error" in text for text in said) == 1
    words = rf"{method}: sampling error: \d+ % of the indirect light, at most \d+ % in 95 of 100 draws \(RMS"
    assert any(re.match(words, text) for text in said)


def test_a_small_sampling_error_gives_no_warning():
    picture, said = told(BOX, "sii", lights=3072)
    assert 0 < picture.sampling_error.pixel < LEAST_ERROR
    assert not any("sampling" in text for text in said)


@pytest.mark.parametrize("method", ["sii", "multires", "val", "vpl"])
@pytest.mark.parametrize(("exponent", "vanishes"), [(1e12, True), (50.0, False)])
def test_sharp_mirrors_are_told(method, exponent, vanishes):
    sharp = tuple(dataclasses.replace(one, specular=(0.5,) * 3, diffuse=tuple(0.4 * x for x in one.diffuse),
                                      exponent=exponent if one.name == "white" else 20.0) for one in BOX.materials)
    _, said = told(dataclasses.replace(BOX, materials=sharp), method)
    found = [text for text in said if "too sharp" in text]
    assert len(found) == vanishes
    if vanishes:
        assert found[0].startswith(f"{method}: the lobes of 1 material(s), 'white', are too sharp (exponent 1e+12")


def test_few_samples_of_hssil_are_told(evidence):
    """The share against 256 samples of the whole picture, in points of 100."""
    whole, said = told(BOX, "hssil", samples=256)
    assert not any("samples" in text for text in said)
    for change in ({"samples": 4}, {"samples": 4, "pattern": "fixed"}, {"samples": 16}):
        picture, said = told(BOX, "hssil", **change)
        lost = 100 * (1 - picture.irradiance.sum() / whole.irradiance.sum())
        (text,) = [one for one in said if "sampling.samples" in one]
        assert float(re.search(r"takes (\d+) %", text)[1]) == pytest.approx(lost, abs=10)  # of so few texels
        evidence(f"{change}: {lost:.0f} % lost; {text}")
    _, said = told(BOX, "hssil", pattern="all", samples=4)
    assert not any("samples 4" in text for text in said)


def ran(runs):
    """Return how often each diagnostic stage ran."""
    return {name: sum(run.name == name and run.status == "ran" for run in runs) for name in DIAGNOSTICS}


@pytest.mark.parametrize("method", FRAMES)
@pytest.mark.filterwarnings("ignore::refgi.errors.RefgiWarning")
def test_frames_of_a_scene_are_diagnosed_once(method):
    """Camera and lamps may move; other materials, meshes or another lamp ask for diagnostics anew."""
    animation = refgi.frames(BOX, method, of(METHODS[method].settings, **FRAMES[method]), **SMALL)
    first = animation.render()
    once = ran(animation.runs)
    assert any(once.values())
    x, y, z = BOX.camera.eye
    lamp = dataclasses.replace(BOX.lights[0], position=(0.2, 0.5, -0.2))
    for scene in (BOX.with_camera(eye=(x + 0.01, y, z)), BOX.with_lights(lamp),
                  BOX.with_camera(eye=(x + 0.02, y, z)).with_lights(lamp)):
        picture = animation.render(scene)
        assert not any(ran(animation.runs).values())
        assert any(run.status == "skipped" and "earlier frame" in run.reason for run in animation.runs)
        assert picture.sampling_error == first.sampling_error
    grey = tuple(dataclasses.replace(one, diffuse=(0.5,) * 3) for one in BOX.materials)
    geometry = dataclasses.replace(BOX.geometry, vertices=BOX.geometry.vertices * 1.01)
    more = BOX.with_lights(lamp, *BOX.lights)
    painted = dataclasses.replace(more, materials=grey)
    for scene in (more, painted, dataclasses.replace(painted, geometry=geometry)):
        animation.render(scene)
        assert ran(animation.runs).keys() == once.keys()
        assert all(ran(animation.runs)[name] >= bool(count) for name, count in once.items())


def test_warnings_are_given_once_for_frames_of_a_scene():
    x, y, z = BOX.camera.eye
    animation = refgi.frames(BOX, "sii", of(METHODS["sii"].settings, lights=16), **SMALL)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", RefgiWarning)
        for step in range(3):
            animation.render(BOX.with_camera(eye=(x + 0.01 * step, y, z)))
    texts = [str(each.message) for each in caught]
    assert len(texts) == len(set(texts)) == 2, texts  # of the clamp and of sampling


@pytest.mark.filterwarnings("ignore::refgi.errors.RefgiWarning")
def test_sequences_are_diagnosed_once():
    x, y, z = BOX.camera.eye
    scenes = [BOX.with_camera(eye=(x + 0.01 * step, y, z)) for step in range(3)]
    settings = of(METHODS["sii"].settings, lights=16)
    with observe() as log:
        for _ in Sequence(scenes, settings, None, method=METHODS["sii"].function, memory=Memory(), **SMALL):
            pass
    assert ran(log.runs)["pairs.clamp_loss"] == 1


@pytest.mark.filterwarnings("ignore::refgi.errors.RefgiWarning")
def test_the_command_says_and_records_the_sampling_error(tmp_path):
    from refgi.provenance import read_record

    out = tmp_path / "a.exr"
    base = ["render", "cornell_box", "--size", "32x32", "--rsm-resolution", "32", "--out", str(out), "--set"]
    said = CliRunner().invoke(VerbGroup.refgi(), [*base, "lights=64", "--json"])
    content = json.loads(said.stdout)
    stated = content["sampling_error"]
    picture = render("cornell_box", "sii", of(METHODS["sii"].settings, lights=64), width=32, height=32,
                     rsm_resolution=32)
    assert (stated["pixel"], stated["mean"]) == pytest.approx(picture.sampling_error[:2])
    assert stated["samples"] == 64
    assert any(picture.sampling_error.statement in text for text in content["warnings"])
    assert read_record(out)["sampling_error"] == stated
    plain = CliRunner().invoke(VerbGroup.refgi(), [*base, "lights=64", "--force"])
    assert picture.sampling_error.statement in plain.stdout.splitlines()
    every = CliRunner().invoke(VerbGroup.refgi(), [*base, "pattern=all", "--json", "--force"])
    assert "sampling_error" not in json.loads(every.stdout)

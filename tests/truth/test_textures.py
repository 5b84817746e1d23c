"""Textures at the hits of rays: colour that a wall throws, by paths, by pixel lights and by hand."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.frame import Frame
from refgi.lights.walk import walk_lights
from refgi.rays import Tracer
from refgi.scene import Image, light_table, material_table
from refgi.settings import of
from refgi.truth import TruthSettings
from refgi.truth.result import TruthResult
from refgi.truth.surfaces import surfaces
from refgi.truth.truth import trace_truth
from refgi.truth.vpl import VplSettings, vpl
from tests.naive import textures as naive
from tests.textured import room

CONFIDENCE = 0.9999  # of each of 75 block means
MAP = 4e-3  # of a map of 128 texels a side
SUM = 1e-12  # float64


@pytest.mark.slow("bilinear", "nearest")
@pytest.mark.feature("REF-24")
@pytest.mark.parametrize("chosen", ["nearest", "bilinear", "trilinear"])
def test_colour_bleeds_as_every_texel_of_the_map_says(chosen: str, evidence: Callable[[str], None]) -> None:
    """Blocks of the picture: those on the left and on the right see one colour of the wall more."""
    frame = Frame(room(chosen), rsm_resolution=128)
    found = trace_truth(frame, TruthSettings(samples=512))
    lights = vpl(frame, of(VplSettings, pattern="all"))
    blocks = lights.astype(np.float64).reshape(3, 5, 8, 5, 8).mean(axis=(2, 4))
    error = np.sqrt(found.block_variance) * found.confidence_factor(CONFIDENCE)
    away = np.abs(blocks - found.block_mean)
    evidence(f"{chosen}: blocks of 8 x 8 pixels off by {(away / found.block_mean).max():.2%} at most, error "
             f"{(error / found.block_mean).max():.2%}; the picture by "
             f"{abs(blocks.mean() / found.block_mean.mean() - 1):.2%}")
    assert (away <= error + MAP * found.block_mean).all()
    left, right = found.block_mean[:, 4, 0], found.block_mean[:, 4, 4]
    assert left[0] > 1.3 * left[2]
    assert right[2] > 1.3 * right[0]


@pytest.mark.feature("REF-24")
def test_both_estimators_and_several_bounces_see_the_texture() -> None:
    """A texture of one colour is that colour as the material's, to the bit of float64 reflectances."""
    grey = Image(np.full((3, 5, 3), 0.5, np.float32))
    scene = room(image=grey)
    paint = scene.materials[1]
    plain = dataclasses.replace(scene, materials=(scene.materials[0], dataclasses.replace(
        paint, diffuse=(0.5, 0.5, 0.5), texture=None)))
    for options in ({"samples": 16}, {"samples": 16, "bounces": 3}):
        one, other = (trace_truth(Frame(each, width=16, height=16), TruthSettings(**options)).mean
                      for each in (scene, plain))
        np.testing.assert_allclose(one, other, rtol=1e-6)


@pytest.mark.feature("REF-24")
def test_light_paths_take_the_colour_of_the_point_they_meet() -> None:
    picture = np.random.default_rng(2).random((6, 9, 3)).astype(np.float32)
    scene = room("trilinear", Image(picture))
    lights = walk_lights(Tracer(scene.geometry), scene.geometry, material_table(scene.materials),
                         light_table(scene.lights), 64)
    white = walk_lights(Tracer(scene.geometry), scene.geometry, material_table([
        dataclasses.replace(one, texture=None) for one in scene.materials]), light_table(scene.lights), 64)
    on_wall = np.flatnonzero(lights.position[2] < -1 + 1e-5)
    assert len(on_wall) > 40
    for k in on_wall:
        x, y = lights.position[:2, k]
        expected = white.flux[:, k] * naive.bilinear(picture, ("clamp", "clamp"), (x + 1) / 2, 1 - y / 2)
        np.testing.assert_allclose(lights.flux[:, k], expected, rtol=1e-6)
    others = np.setdiff1d(np.arange(64), on_wall)
    np.testing.assert_array_equal(lights.flux[:, others], white.flux[:, others])


def test_scenes_without_textures_have_none_in_their_kernels() -> None:
    scene = room()
    assert surfaces(scene).textures is not None
    plain = dataclasses.replace(scene, materials=tuple(
        dataclasses.replace(one, texture=None) for one in scene.materials))
    assert surfaces(plain).textures is None
    assert surfaces(plain).uv is None
    assert Frame(plain).materials.textures is None


def test_a_checkpoint_of_another_texture_is_not_gone_on_from(tmp_path: Path) -> None:
    def traced(codes: np.ndarray) -> TruthResult:
        scene = room(image=Image(codes)).with_camera(width=6, height=5)
        return trace_truth(Frame(scene), TruthSettings(samples=48, checkpoint=str(tmp_path / "passes.truth")))

    codes = np.full((2, 2, 3), 200, np.uint8)
    passes = traced(codes).passes
    assert traced(codes.copy()).passes == passes
    codes = codes.copy()
    codes[1, 1, 2] += 1
    with pytest.raises(InputError, match="checkpoint"):
        traced(codes)

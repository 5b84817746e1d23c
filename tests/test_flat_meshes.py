"""A flat mesh has no indirect light but for rounding: it counts as none, and no setting is said to take a share."""

import warnings

import numpy as np
import pytest

from refgi.cli.render import _say_aloud
from refgi.methods import render
from refgi.scene import Camera, DirectionalLight, Geometry, Material, PointLight, Scene
from refgi.scene.repair import faintest_irradiance


def flat_scene(seed: int) -> Scene:
    """Return a triangle at some slant, seen and lit from the same side."""
    vertices = np.random.default_rng(seed).normal(size=(3, 3))
    geometry = Geometry(vertices, np.array([[0, 1, 2]], np.int32), np.zeros(1, np.int32))
    across = np.cross(vertices[1] - vertices[0], vertices[2] - vertices[0])
    middle = vertices.mean(axis=0)
    eye = middle + 5 * across / np.linalg.norm(across)
    lamp = PointLight(tuple(eye + np.array((0.5, 0, 0))), (50, 50, 50))
    camera = Camera(tuple(eye), tuple(middle), up=(0.1, 0.9, 0.3), width=48, height=48)
    return Scene("flat", geometry, (Material(),), camera, (lamp,))


@pytest.mark.parametrize("method", ["sii", "hssil"])
def test_what_is_rounding_is_no_light(method: str, capsys: pytest.CaptureFixture[str]) -> None:
    for seed in range(4):
        scene = flat_scene(seed)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.filterwarnings("ignore", ".*sampling error")
            warnings.filterwarnings("ignore", r"hssil. sampling\.samples")
            picture = render(scene, method, rsm_resolution=64)
        content = {"non_finite_pixels": 0, "covered_pixels": 9, "brightest_radiance": float(picture.radiance.max()),
                   "mean_indirect_irradiance": float(picture.irradiance.mean())}
        _say_aloud(content, scene)
        assert "there is no indirect light in the picture" in capsys.readouterr().err


def test_black_is_measured_against_the_lamps() -> None:
    scene = flat_scene(0)
    bright = scene.with_lights(PointLight((0, 0, 0), (5e6, 5e6, 5e6)))
    sun = scene.with_lights(DirectionalLight((0, -1, 0), (2, 3, 1)))
    least, brighter, sunny = (faintest_irradiance(one.lights, one.geometry) for one in (scene, bright, sun))
    distance = np.linalg.norm(np.subtract(scene.lights[0].position, np.mean(scene.geometry.bounds, axis=0)))
    assert np.isclose(least, 1e-9 * 50 / distance**2)
    assert brighter > 1e4 * least
    assert np.isclose(sunny, 3e-9)

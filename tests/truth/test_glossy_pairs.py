"""Pairs of scenes whose one-bounce light is the same: the truth's means agree within the errors that it states."""

import dataclasses
import math
from functools import cache

import numpy as np
import pytest
from scipy.stats import chi2

from refgi.frame import Frame
from refgi.scene import DirectionalLight, PointLight, SpotLight
from refgi.truth import TruthSettings, trace_truth
from tests.naive.face_quadrature import receivers_of
from tests.truth.glossy_scenes import EXPONENTS, SCENES
from tests.truth.scenes import cells_kept

SEEDS, PASSES = 20, 3
SIGMAS = 3  # joint standard errors of the picture's mean
CERTAIN = 1e-4
TURN = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])  # a rotation about no axis of the scenes


def lamps(scene, change):
    """Return the scene with each lamp replaced by those that `change` returns."""
    return scene.with_lights(*(new for lamp in scene.lights for new in change(lamp)))


def half_spheres(lamp):
    """A point lamp as two spots of 90 degrees, back to back."""
    if not isinstance(lamp, PointLight):
        return [lamp]
    return [SpotLight(lamp.position, axis, math.pi / 2, math.pi / 2, lamp.intensity)
            for axis in ((0.1, 1.0, 0.2), (-0.1, -1.0, -0.2))]


def wide_spot(lamp):
    """A point lamp as a spot of 89.9 degrees that looks at the middle of the scene; all must lie inside."""
    if not isinstance(lamp, PointLight):
        return [lamp]
    wide = math.radians(89.9)
    return [SpotLight(lamp.position, tuple(-np.asarray(lamp.position)), wide, wide, lamp.intensity)]


def halved(lamp):
    """A lamp as two of half its power."""
    name = "irradiance" if isinstance(lamp, DirectionalLight) else "intensity"
    half = dataclasses.replace(lamp, **{name: tuple(0.5 * c for c in getattr(lamp, name))})
    return [half, half]


def moved(scene, matrix):
    """Return the scene turned and scaled by a matrix: irradiance stays as it is."""
    matrix, scale = np.asarray(matrix, float), np.linalg.det(matrix) ** (1 / 3)
    geometry, camera = scene.geometry, scene.camera
    normals = None if geometry.vertex_normals is None else geometry.vertex_normals @ matrix.T / scale
    geometry = dataclasses.replace(geometry, vertices=geometry.vertices @ matrix.T, vertex_normals=normals)
    camera = dataclasses.replace(camera, eye=tuple(matrix @ camera.eye), target=tuple(matrix @ camera.target),
                                 up=tuple(matrix @ camera.up / scale))
    lights = []
    for lamp in scene.lights:
        changes = {}
        if hasattr(lamp, "direction"):
            changes["direction"] = tuple(matrix @ lamp.direction)
        if hasattr(lamp, "position"):
            changes["position"] = tuple(matrix @ lamp.position)
            changes["intensity"] = tuple(scale**2 * c for c in lamp.intensity)
        lights.append(dataclasses.replace(lamp, **changes))
    return dataclasses.replace(scene, geometry=geometry, camera=camera, lights=tuple(lights))


def split(scene):
    """Return the scene with each face cut in four; normals between vertices are as long as interpolation has them."""
    geometry = scene.geometry
    corners = [field[geometry.faces] for field in (geometry.vertices, geometry.vertex_normals) if field is not None]
    parts = []
    for a, b, c in (np.moveaxis(field, 1, 0) for field in corners):
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        parts.append(np.stack([np.stack(t, 1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))], 1))
    vertices, normals = parts[0].reshape(-1, 3), parts[1].reshape(-1, 3) if len(parts) > 1 else None
    return dataclasses.replace(scene, geometry=dataclasses.replace(
        geometry, vertices=vertices, faces=np.arange(len(vertices), dtype=np.int32).reshape(-1, 3),
        vertex_normals=normals, material_of_face=np.repeat(geometry.material_of_face, 4)))


CHANGES = {
    "a point is two half spheres": lambda s: lamps(s, half_spheres),
    "a point is a wide spot": lambda s: lamps(s, wide_spot),
    "a lamp is two of half its power": lambda s: lamps(s, halved),
    "faces split": split,
    "turned": lambda s: moved(s, TURN),
    "scaled by 1e-3": lambda s: moved(s, 1e-3 * np.eye(3)),
    "scaled by 1e3": lambda s: moved(s, 1e3 * np.eye(3)),
}
# scenes with a point lamp; of the second, those that lie before it
OF_POINTS = ("corner", "corner_600_900", "lamp_close", "lamp_close_1000", "small_ball", "ball_and_block",
             "sun_on_blocks", "mirror_floor")
BEFORE_IT = ("ball_and_block",)
ONLY = {"a point is two half spheres": OF_POINTS, "a point is a wide spot": BEFORE_IT}
FAST = {("ball_and_block", "a point is a wide spot")}
CASES = [pytest.param(name, change, marks=() if (name, change) in FAST else pytest.mark.slow)
         for change in CHANGES for name in ONLY.get(change, SCENES)]


@cache
def means(name, change):
    """Return means and variances of blocks and picture over all seeds, and the frame."""
    scene = SCENES[name](name)
    frame = Frame(CHANGES[change](scene) if change else scene, dtype=np.float64)
    first = 500 * (1 + list(CHANGES).index(change)) if change else 0  # no seed serves both
    with cells_kept():
        shortest = trace_truth(frame, TruthSettings(samples=1))
        samples = PASSES * (int(shortest.samples.max()) // shortest.passes)
        runs = [trace_truth(frame, TruthSettings(samples=samples, seed=first + seed)) for seed in range(SEEDS)]
    sums = [np.mean([getattr(run, field) for run in runs], axis=0)
            for field in ("block_mean", "block_variance", "picture_mean", "picture_variance")]
    return *sums[:2], *sums[2:], frame


@pytest.mark.feature("REF-03")
@pytest.mark.parametrize(("name", "change"), CASES)
def test_the_same_light(name, change, evidence):
    a, b = means(name, None), means(name, change)
    to, other = (receivers_of(found[4]) for found in (a, b))
    assert len(to.position) == len(other.position)
    variance = [(x + y) / SEEDS for x, y in ((a[1], b[1]), (a[3], b[3]))]
    z = np.abs(a[2] - b[2]) / np.sqrt(variance[1])
    counts = np.minimum(a[0], b[0]) > 1e-3 * a[2][:, None, None]
    z2 = ((a[0] - b[0])[counts] ** 2 / variance[0][counts])
    evidence(f"{name}, P = {EXPONENTS[name]}, {change}: the picture {z.max():.1f} joint standard errors apart, "
             f"chi-square of a block {z2.mean():.2f}")
    assert z.max() < SIGMAS
    assert z2.mean() < chi2.isf(CERTAIN, 6) / 6  # of 27 that go together, as if there were 6


def test_all_lies_before_the_wide_spot():
    for name in BEFORE_IT:
        scene = SCENES[name](name)
        lamp = scene.lights[0]
        away = scene.geometry.vertices - lamp.position
        cosine = away @ -np.asarray(lamp.position) / np.linalg.norm(away, axis=1) / np.linalg.norm(lamp.position)
        assert cosine.min() > math.cos(math.radians(89))


@pytest.mark.parametrize(("change", "matrix"), [("faces split", np.eye(3)), ("turned", TURN),
                                                ("scaled by 1e3", 1e3 * np.eye(3))])
def test_a_changed_scene_shows_the_same(change, matrix):
    """The same pixels with the same normals and places, moved."""
    scene = SCENES["coarse_ball"]("coarse_ball")
    to, other = (receivers_of(Frame(s, dtype=np.float64)) for s in (scene, CHANGES[change](scene)))
    np.testing.assert_allclose(other.position, to.position @ matrix.T, atol=1e-5 * np.abs(matrix).max())
    np.testing.assert_allclose(other.normal, to.normal @ matrix.T / np.linalg.det(matrix) ** (1 / 3), atol=1e-5)

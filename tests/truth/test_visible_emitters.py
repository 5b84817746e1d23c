"""The truth when only what the camera sees lights anything: closed forms, and what it must have in common with all."""

import dataclasses
import math

import numpy as np
import pytest

from refgi import jit
from refgi.errors import InputError
from refgi.frame import Frame
from refgi.rays import Tracer
from refgi.scene import Camera, DirectionalLight, Geometry, Material, PointLight, Scene, load_scene, merge
from refgi.truth import TruthSettings, trace_truth
from refgi.truth.truth import accumulate
from tests.form_factors import polygon_form_factor
from tests.truth.scenes import WHITE, rectangle

ALL = ["combined", "hemisphere", "light"]
ESTIMATORS = ["combined", *(pytest.param(alone, marks=pytest.mark.slow) for alone in ALL[1:])]
SIGMAS, BIAS = 4.0, 1e-4  # a mean of a few dozen passes lies outside once in some 5,000 runs; float32 rays
BLACK = Material("black", (0.0, 0.0, 0.0))
SUN = DirectionalLight((0.1, -1.0, 0.0), (3.0, 2.0, 1.0))
ABOVE = Camera((0.0, 10.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, -1.0), 2 * math.atan(0.1))  # sees |x|, |z| <= 1 at y = 0
PLATE = rectangle((-0.5, 0, 0.5), (2, 0, 0), (0, 0, -1))  # -0.5 <= x <= 1.5: the picture ends at x = 1
SPECK = rectangle((0, 5.0, 3.0), (1e-4, 0, 0), (0, 0, 1e-4), BLACK)  # a face, out of the way, for receivers to name
SHAPE = (8, 8)  # equal receivers: the rows and columns that the camera's picture is taken to have


def irradiance(meshes, point, normal, camera=ABOVE, light=SUN, **settings):
    """Return the truth with seen emitters at one point, given to every pixel."""
    geometry, materials = merge([SPECK, *meshes])
    place, up = (np.broadcast_to(np.reshape(v, (3, 1, 1)), (3, *SHAPE)) for v in (point, normal))
    return accumulate(Scene("by hand", geometry, materials, camera, (light,)), Tracer(geometry), place, up,
                      np.zeros(SHAPE, np.int32), TruthSettings(emitters="visible", **settings))


def form_factor(point, normal, x0, x1, z0=-0.5, z1=0.5):
    """Return the form factor of a rectangle at y = 0 from above."""
    return polygon_form_factor(point, normal, [(x0, 0, z1), (x1, 0, z1), (x1, 0, z0), (x0, 0, z0)])


def agrees(result, factor):
    expected = WHITE.diffuse[0] * np.array(SUN.irradiance) / np.linalg.norm(SUN.direction) * factor
    error = np.abs(result.picture_mean - expected)
    assert (error <= SIGMAS * np.sqrt(result.picture_variance) + BIAS * expected).all()
    return float((error / expected.max()).max())


@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize("visibility", [True, False])
def test_the_pictures_edge_cuts_an_emitter(estimator, visibility, evidence):
    point, down = (1.2, 0.6, 0.1), (0.0, -1.0, 0.0)
    result = irradiance([PLATE], point, down, estimator=estimator, visibility=visibility, samples=1200)
    off = agrees(result, form_factor(point, down, -0.5, 1.0))
    assert form_factor(point, down, 1.0, 1.5) > 0.5 * form_factor(point, down, -0.5, 1.0)  # what is cut off matters
    evidence(f"{estimator}, visibility={visibility}: off by {off:.1e}")


@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize("visibility", [True, False])
def test_what_stands_before_an_emitter_hides_it(estimator, visibility):
    # half-way up to the eye a board of |x| <= 0.1, black: it hides |x| <= 0.2 of the plate
    board = rectangle((-0.1, 5, 2), (0.2, 0, 0), (0, 0, -4), BLACK)
    point, down = (0.1, 0.6, 0.1), (0.0, -1.0, 0.0)
    light = DirectionalLight((-1.0, -1.0, 0.0), SUN.irradiance)  # past the board
    result = irradiance([PLATE, board], point, down, light=light, estimator=estimator, visibility=visibility,
                        samples=1200)
    seen = form_factor(point, down, -0.5, -0.2) + form_factor(point, down, 0.2, 1.0)
    agrees(result, seen * math.cos(math.pi / 4) * np.linalg.norm(SUN.direction))


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_visibility_between_emitter_and_receiver_is_a_choice_of_its_own(estimator):
    # a screen on edge stands on the plate: the sun and the eye look along it
    screen = rectangle((0.2, 0, 5), (0, 0, -10), (0, 0.9, 0), BLACK)
    point, across = (0.6, 0.4, 0.0), (-1.0, 0.0, 0.0)
    options = {"camera": dataclasses.replace(ABOVE, eye=(0.2, 10.0, 0.0), target=(0.2, 0.0, 0.0)), "samples": 1200,
               "light": DirectionalLight((0.0, -1.0, 0.0), SUN.irradiance), "estimator": estimator}
    free = irradiance([PLATE, screen], point, across, visibility=False, **options)
    agrees(free, form_factor(point, across, -0.5, 0.6) * np.linalg.norm(SUN.direction))
    blocked = irradiance([PLATE, screen], point, across, **options)
    agrees(blocked, form_factor(point, across, 0.2, 0.6) * np.linalg.norm(SUN.direction))


@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize("visibility", [True, False])
def test_a_side_that_faces_away_is_not_seen(estimator, visibility):
    from_below = DirectionalLight((0.0, 1.0, 0.0), (1.0, 1.0, 1.0))
    result = irradiance([PLATE], (0.2, -0.6, 0.1), (0.0, 1.0, 0.0), light=from_below, estimator=estimator,
                        visibility=visibility)
    assert not result.mean.any()
    below = dataclasses.replace(ABOVE, eye=(0.0, -10.0, 0.0))
    assert irradiance([PLATE], (0.2, -0.6, 0.1), (0.0, 1.0, 0.0), camera=below, light=from_below,
                      estimator=estimator, visibility=visibility).mean.all()


FACES, POLYHEDRON = 20_000, 1.2e-3  # the polyhedron lies inside the sphere: E grows by about 20 / faces


@pytest.mark.slow("combined")
@pytest.mark.feature("HSS-03")
@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_the_part_of_a_sphere_that_is_seen(estimator, evidence):
    """E = L A / (4 R^2) at every point, A what the camera sees: its solid angle times R^2 from the centre."""
    found = load_scene(f"integrating_sphere:faces={FACES},albedo=0.5")
    flat = Geometry(found.geometry.vertices, found.geometry.faces, found.geometry.material_of_face)
    light, half = PointLight((0.0, 0.0, 0.0), (0.8, 1.6, 0.4)), math.radians(35)
    camera = Camera((0.0, 0.0, 0.0), (0.3, -0.2, 1.0), vfov=2 * half)
    lit = Scene("sphere", flat, found.materials, camera, (light,))
    chosen = np.linspace(0, len(flat.faces) - 1, 400).astype(int).reshape(20, 20)
    points = flat.vertices[flat.faces[chosen]].mean(axis=2)
    up = -points / np.linalg.norm(points, axis=2, keepdims=True)
    result = accumulate(lit, Tracer(flat), np.moveaxis(points, 2, 0), np.moveaxis(up, 2, 0), chosen.astype(np.int32),
                        TruthSettings(estimator=estimator, samples=2400, emitters="visible"))
    solid_angle = 4 * math.asin(math.sin(half) ** 2)  # of a square pyramid
    expected = 0.5 * np.array(light.intensity) / math.pi * solid_angle / 4
    error = np.abs(result.picture_mean / expected - 1)
    assert (error <= POLYHEDRON + SIGMAS * np.sqrt(result.picture_variance) / expected).all()
    evidence(f"{estimator}: E = L A / (4 R^2), off by {error.max():.1e}")


@pytest.fixture(scope="module")
def frame():
    return Frame(load_scene("cornell_box"), width=24, height=24)


@pytest.mark.slow
def test_estimators_agree_and_all_is_more(frame, evidence):
    results = {kind: trace_truth(frame, TruthSettings(estimator=kind, emitters="visible", samples=24 * 40))
               for kind in ALL}
    everything = trace_truth(frame, TruthSettings(samples=24 * 40))
    a = results["combined"]
    for kind in ALL[1:]:
        b = results[kind]
        z = np.abs(a.picture_mean - b.picture_mean) / np.sqrt(a.picture_variance + b.picture_variance)
        assert (z < SIGMAS).all()
    share = a.picture_mean / everything.picture_mean
    over = (a.mean - everything.mean)[:, a.samples > 0]
    assert (over < 6 * np.sqrt(a.variance_of_mean + everything.variance_of_mean)[:, a.samples > 0]).mean() > 0.999
    assert (share < 1).all()
    evidence(f"what is seen gives {share.min():.2f} of the light of the Cornell box")


@pytest.mark.parametrize("visibility", [True, False])
def test_a_camera_that_sees_all_that_is_lit(visibility):
    """Nothing changes, to the bit: only what gave no light was asked."""
    geometry, materials = merge([PLATE, rectangle((-0.5, 0.9, 0.5), (0, 0, -1), (-0.2, 0.4, 0), BLACK)])
    camera = dataclasses.replace(ABOVE, vfov=2 * math.atan(0.3))
    frame = Frame(Scene("by hand", geometry, materials, camera, (SUN,)), width=24, height=24)
    settings = TruthSettings(samples=96, visibility=visibility)
    result = trace_truth(frame, dataclasses.replace(settings, emitters="visible")).mean
    assert result.any()
    assert np.array_equal(result, trace_truth(frame, settings).mean)


def test_same_bits_for_threads_and_batches(frame):
    settings = TruthSettings(samples=72, emitters="visible")
    first = trace_truth(frame, settings)
    with jit.threads(1):
        again = trace_truth(frame, dataclasses.replace(settings, batch=1001))
    assert np.array_equal(first.mean, again.mean)


def test_a_checkpoint_with_other_emitters_is_refused(frame, tmp_path):
    settings = TruthSettings(samples=48, checkpoint=tmp_path / "truth.npz")
    trace_truth(frame, settings)
    with pytest.raises(InputError, match="another"):
        trace_truth(frame, dataclasses.replace(settings, emitters="visible"))


@pytest.mark.parametrize("others", [{"emitters": "some"}, {"emitters": "visible", "bounces": 2},
                                    {"emitters": "visible", "caustics": True}])
def test_unusable_settings_are_refused(others):
    with pytest.raises(InputError, match="emitters"):
        TruthSettings(**others)

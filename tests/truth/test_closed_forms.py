"""One-bounce light whose value is known in closed form, and the literal text where it is not."""

import math

import numpy as np
import pytest

from refgi.literal.truth import path_traced
from refgi.rays import Tracer
from refgi.scene import DirectionalLight, Geometry, Material, PointLight, Scene, SpotLight
from refgi.scene.material import material_table
from refgi.truth import TruthSettings
from refgi.truth.steps import lamps_of
from refgi.truth.truth import accumulate
from tests.form_factors import polygon_form_factor
from tests.naive.truth import truncated_series
from tests.truth.scenes import CAMERA, at, corner_room, floor, receivers_in_corner, rectangle, scene, spot_down

ESTIMATORS = ["combined", pytest.param("hemisphere", marks=pytest.mark.slow),
              pytest.param("light", marks=pytest.mark.slow)]
BLACK = Material("black", (0.0, 0.0, 0.0))
BIAS = 1e-4  # of the value, beyond the standard error
SIGMAS = 4.0  # a mean of a few dozen passes lies outside once in some 5,000 runs


def deviation(result, expected):
    """Return the relative error of the picture's mean, and how far it exceeds what its standard error allows."""
    error = np.abs(result.picture_mean / expected - 1)
    return error.max(), (error - SIGMAS * np.sqrt(result.picture_variance) / expected).max()


@pytest.mark.feature("REF-03")
@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_spot_over_a_plane(estimator, evidence):
    c, h, rho, intensity = math.radians(40), 0.7, 0.6, np.array([1.0, 2.0, 0.5])
    expected = 0.4 * rho * intensity / h**2 * (1 - math.cos(c) ** 5)
    settings = TruthSettings(estimator=estimator, samples=40 * (32 if estimator != "light" else 16), light_grid=64,
                             picks=16, directions=48 if estimator != "light" else None)
    # it is lit within 0.6 m; where a scene of 100 m ends, rays start so far off that it is 2e-4 too bright
    result = at(scene([floor(5.0)], spot_down(h, c)), [(0, h, 0)], [(0, -1, 0)], settings, repeat=256)
    error, beyond = deviation(result, expected)
    assert beyond < BIAS
    assert error < 2e-3
    evidence(f"{estimator}: relative error {error:.1e}, standard error "
             f"{(np.sqrt(result.picture_variance) / expected).max():.1e}")


@pytest.mark.feature("REF-07")
@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_lit_rectangle_gives_its_form_factor(estimator, evidence):
    # the sun lights the upper side of a plate; receivers beside and above it look at it
    plate = rectangle((0, 0, 0), (1, 0, 0), (0, 0, -1.5))
    corners = [(0, 0, 0), (1, 0, 0), (1, 0, -1.5), (0, 0, -1.5)]
    sun = DirectionalLight((0.2, -1.0, 0.1), (3.0, 2.0, 1.0))
    irradiance = np.array(sun.irradiance) / np.linalg.norm(sun.direction)  # E_perp times the cosine
    worst = 0.0
    speck = [rectangle((0.4, 0.9, 0.2), across, (0, 1e-4, 0), BLACK) for across in ((0, 0, 1e-4), (1e-4, 0, 0))]
    lit = scene([plate, *speck], sun)  # specks: faces for receivers that look along x and z
    for point, normal, triangle in (((0.5, 0.8, -0.7), (0, -1, 0), 0), ((-0.3, 0.4, -0.5), (1, 0, 0), 2),
                                    ((0.2, 0.05, 0.1), (0, 0, -1), 4)):
        expected = 0.6 * irradiance * polygon_form_factor(point, normal, corners)
        settings = TruthSettings(estimator=estimator, samples=480)
        result = at(lit, [point], [normal], settings, triangle=triangle, repeat=64)
        error, beyond = deviation(result, expected)
        assert beyond < BIAS
        worst = max(worst, error)
    assert worst < 1e-2
    evidence(f"{estimator}: worst relative error {worst:.1e}, within {SIGMAS:g} standard errors")


def sphere(faces, albedo=0.5, light=None):
    from refgi.scene import load_scene

    found = load_scene(f"integrating_sphere:faces={faces},albedo={albedo}")
    flat = Geometry(found.geometry.vertices, found.geometry.faces, found.geometry.material_of_face)
    return Scene("sphere", flat, found.materials, CAMERA, (light or found.lights[0],))


def in_sphere(found, settings, count=400):
    """Return the truth at centres of faces."""
    chosen = np.linspace(0, found.face_count - 1, count).astype(int)
    points = found.geometry.vertices[found.geometry.faces[chosen]].mean(axis=1)
    normals = -points / np.linalg.norm(points, axis=1, keepdims=True)
    return accumulate(found, Tracer(found.geometry), points.T.reshape(3, 1, -1), normals.T.reshape(3, 1, -1),
                      chosen.reshape(1, -1).astype(np.int32), settings)


# The polyhedron lies inside the sphere: E grows by about 20 / faces, which is 1e-4 here.
FACES, POLYHEDRON = 200_000, 1.2e-4


@pytest.mark.slow("combined")
@pytest.mark.feature("REF-06")
@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_integrating_sphere(estimator, evidence):
    light = PointLight((0.3, -0.2, 0.4), (0.8, 1.6, 0.4))
    expected = 0.5 * 4 * math.pi * np.array(light.intensity) / (4 * math.pi)
    settings = TruthSettings(estimator=estimator, samples=1600, light_grid=64)
    result = in_sphere(sphere(FACES, light=light), settings)
    error, beyond = deviation(result, expected)
    spread = (result.mean / expected[:, None, None]).std()
    assert beyond < POLYHEDRON
    evidence(f"{estimator}: mean off by {error:.1e} (standard error "
             f"{(np.sqrt(result.picture_variance) / expected).max():.1e}), spread over the wall {spread:.1e}")


@pytest.mark.feature("REF-10", "REF-16")
@pytest.mark.parametrize("bounces", [2, 4])
def test_bounces_in_a_sphere_are_a_geometric_series(bounces, evidence):
    light = PointLight((0.3, -0.2, 0.4), (0.8, 1.6, 0.4))
    expected = truncated_series(0.5, bounces) * np.array(light.intensity)
    result = in_sphere(sphere(FACES, light=light), TruthSettings(samples=240, bounces=bounces))
    error, beyond = deviation(result, expected)
    assert beyond < 2 * POLYHEDRON  # each bounce sees the polyhedron again; their sum at albedo 1/2 counts it twice
    assert error < 5e-3
    evidence(f"{bounces} bounces: relative error {error:.1e}, within {SIGMAS:g} standard errors")


@pytest.mark.feature("REF-03", "REF-10")
@pytest.mark.slow("several")
@pytest.mark.parametrize("lights", ["spot", "point", "several"])
def test_estimators_agree(lights, evidence):
    spot = SpotLight((0.5, 1.5, 0.6), (-0.6, -0.8, -0.7), 0.3, 0.6, (2.0, 1.5, 1.0))
    point = PointLight((-0.6, 0.9, -0.5), (0.1, 0.2, 0.4))
    sun = DirectionalLight((-0.3, -1.0, -0.4), (0.5, 0.4, 0.3))
    room = corner_room(*{"spot": (spot,), "point": (point,), "several": (spot, point, sun)}[lights])
    worst = agree(room, evidence, lights)
    assert worst < SIGMAS + 1  # the largest of 2 x 24 deviations


def agree(room, evidence, label, kinds=("combined", "hemisphere"), **settings):
    points, normals, triangles = receivers_in_corner()
    tracer, results = Tracer(room.geometry), []
    for kind in kinds:
        options = TruthSettings(estimator=kind, samples=128 * 24, directions=256 if kind == "hemisphere" else 8,
                                **settings)
        repeated = [np.repeat(a.T.reshape(3, -1, 1), 32, axis=2) for a in (points, normals)]
        results.append(pixel_means(room, tracer, *repeated, np.repeat(triangles.reshape(-1, 1), 32, axis=1), options))
    (a, va), (b, vb) = results
    z = np.abs(a - b) / np.sqrt(va + vb)
    evidence(f"{label}: {' and '.join(kinds)} differ by at most {z.max():.1f} of their standard error "
             f"(relative {np.sqrt((va + vb) / b**2).mean():.1e})")
    return z.max()


def pixel_means(room, tracer, position, normal, ids, options, passes=24):
    """Return mean and variance of each row of equal receivers, which share the light's rays: pass by pass."""
    from refgi.truth.passes import one_pass
    from refgi.truth.truth import task_of

    task = task_of(room, tracer, position, normal, ids, options)
    rows = np.stack([one_pass(task, k).reshape(3, *ids.shape).mean(axis=2) for k in range(passes)])
    return rows.mean(axis=0), rows.var(axis=0, ddof=1) / passes


@pytest.mark.feature("REF-03")
def test_glossy_emitters_agree(evidence):
    glossy = Material("glossy", (0.2, 0.2, 0.2), (0.5, 0.4, 0.3), 20.0)
    spot = SpotLight((0.5, 1.5, 0.6), (-0.6, -0.8, -0.7), 0.3, 0.6, (2.0, 1.5, 1.0))
    assert agree(corner_room(spot, material=glossy), evidence, "glossy floor") < SIGMAS + 1


@pytest.mark.feature("REF-03")
def test_estimators_agree_without_visibility(evidence):
    spot = SpotLight((0.5, 1.5, 0.6), (-0.6, -0.8, -0.7), 0.3, 0.6, (2.0, 1.5, 1.0))
    assert agree(corner_room(spot), evidence, "visibility=False", visibility=False) < SIGMAS + 1


@pytest.mark.feature("REF-03")
@pytest.mark.parametrize(("blocked", "falloff"), [(True, "smoothstep"), (False, "smoothstep"), (True, "squared_ramp")])
def test_the_literal_text_agrees(blocked, falloff, evidence):
    spot = SpotLight((0.5, 1.5, 0.6), (-0.6, -0.8, -0.7), 0.3, 0.6, (2.0, 1.5, 1.0), falloff)
    room = corner_room(spot)
    points, normals, triangles = (one[1::2] for one in receivers_in_corner(6))  # away from edges
    x, n = (one.T[:, None] for one in (points, normals))
    mesh = room.geometry.vertices, room.geometry.faces, room.geometry.material_of_face, None
    xi = (np.mgrid[:64, :64].reshape(2, -1).repeat(2, axis=1)[..., None, None] + np.random.default_rng(6).random(
        (1, 2, 2 * 64**2, 1, len(points)))) / 64
    mean, variance, _ = path_traced(x, n, triangles[None], xi, mesh, material_table(room.materials)[:3],
                                    lamps_of((spot,)), (falloff,), blocked)
    worst, error = 0.0, np.sqrt(variance[:, 0] / mean[:, 0] ** 2).max()
    for k, triangle in enumerate(triangles):
        result = at(room, [points[k]], [normals[k]], TruthSettings(samples=480, visibility=blocked), triangle=triangle,
                    repeat=64)
        off = np.abs(result.picture_mean - mean[:, 0, k])
        worst = max(worst, (off / np.sqrt(result.picture_variance + variance[:, 0, k])).max())
    assert error < 0.02
    assert worst < SIGMAS
    evidence(f"visibility={blocked}, {falloff}: within {worst:.1f} standard errors of the literal text, which has "
             f"{error:.1%} at most")


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_a_lamp_in_the_plane_of_the_ceiling(estimator):
    """The spot over a plane again, with a ceiling that the lamp lies in; it must not block or be lit."""
    c, h, rho, intensity = math.radians(40), 0.7, 0.6, np.array([1.0, 2.0, 0.5])
    expected = 0.4 * rho * intensity / h**2 * (1 - math.cos(c) ** 5)
    ceiling = rectangle((-0.5, h, -0.5), (1, 0, 0), (0, 0, 1))
    settings = TruthSettings(estimator=estimator, samples=40 * 16, light_grid=64, picks=16,
                             directions=48 if estimator != "light" else None)
    result = at(scene([floor(), ceiling], spot_down(h, c)), [(0, h, 0)], [(0, -1, 0)], settings, triangle=2, repeat=256)
    _, beyond = deviation(result, expected)
    assert beyond < BIAS

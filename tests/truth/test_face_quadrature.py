"""The oracle of glossy senders against closed forms, quadrature in one dimension and light tracing."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import quad

from refgi.scene import DirectionalLight, Material, PointLight, SpotLight
from refgi.scene.builtin.surfaces import sphere
from tests.form_factors import polygon_form_factor
from tests.naive import light_tracing
from tests.naive.face_quadrature import Receivers, irradiance, reflected
from tests.naive.radiometry import gauss_legendre, lobe_fraction
from tests.naive.receiver_lobes import tilted_albedo, unit
from tests.truth.scenes import floor, rectangle, scene

TOLERANCE = 1e-4  # relative, what is asked of the oracle
RHO = np.array((0.9, 0.7, 0.5))
RED = Material("red", (0.6, 0.5, 0.4))
DOWN = DirectionalLight((0.0, -1.0, 0.0), (1.0, 2.0, 3.0))


def glossy(exponent, diffuse=(0.0, 0.0, 0.0)):
    return Material("glossy", diffuse, tuple(RHO * 0.9), exponent)


def facing(points, normals):
    points, normals = (np.asarray(v, float).reshape(-1, 3) for v in (points, normals))
    return Receivers(points, unit(normals), unit(normals), unit(normals), np.zeros(len(points)))


def found(room, points, normals):
    value, moved = irradiance(room, facing(points, normals), TOLERANCE)
    assert (moved <= TOLERANCE * np.maximum(value, 1e-3 * value.max(axis=1, keepdims=True))).all()
    return value


def test_a_lobe_of_one_straight_down_is_diffuse():
    """P = 1 and light along the normal: (P + 1) / 2 pi <n.w> is 1 / pi <n.w>, so a plate gives its form factor."""
    plate = rectangle((0, 0, 0), (1, 0, 0), (0, 0, -1.5), glossy(1.0))
    corners = [(0, 0, 0), (1, 0, 0), (1, 0, -1.5), (0, 0, -1.5)]
    for point, normal in (((0.5, 0.8, -0.7), (0, -1, 0)), ((-0.3, 0.4, -0.5), (1, 0, 0)),
                          ((0.5, 0.01, 0.01), (0, 0, -1))):
        expected = 0.9 * RHO * DOWN.irradiance * polygon_form_factor(point, normal, corners)
        np.testing.assert_allclose(found(scene([plate], DOWN), [point], [normal])[0], expected, rtol=TOLERANCE)


@pytest.mark.parametrize(("exponent", "tilt"), [(2.0, 0.0), (2.0, 0.5), (40.0, 0.3), (1e6, 0.5)])
def test_a_receiver_s_lobe_over_a_large_floor(exponent, tilt):
    """Radiance rho E / pi from everywhere below, s = 1: ((P + 2) / 2 pi) int <m.w>^P <n.w> dw of it comes to the eye.

    The floor fills all of a lobe of 1e6, and of the others but for what lies beyond 400 times its height.
    """
    room, m = scene([floor(400.0, RED)], DOWN), unit(np.array([(math.sin(tilt), -math.cos(tilt), 0.0)]))
    to = facing([(2.31, 0.5, -1.47)], [(0, -1, 0)])._replace(mirrored=m, exponent=np.array([exponent]))
    value, moved = reflected(room, to, np.ones((1, 3)), tolerance=TOLERANCE)
    assert (moved <= TOLERANCE * value).all()
    share = tilted_albedo(exponent, tilt)
    np.testing.assert_allclose(value[0], share * np.array((0.6, 0.5, 0.4)) * DOWN.irradiance / math.pi, rtol=5e-4)


def test_a_narrow_spot_on_a_large_floor():
    """A patch of light that is small beside its face: 2/5 rho I / h^2 (1 - cos^5 c)."""
    c, h = 0.12, 0.7
    place = (2.31, h, -1.47)  # over the inside of a face
    lamp = SpotLight(place, (0.0, -1.0, 0.0), c, c, (1.0, 2.0, 0.5))
    expected = 0.4 * 0.6 * np.array(lamp.intensity) / h**2 * (1 - math.cos(c) ** 5)
    np.testing.assert_allclose(found(scene([floor(9.0)], lamp), [place], [(0, -1, 0)])[0], expected, rtol=TOLERANCE)


def test_a_sharp_highlight_inside_a_face():
    """Parallel light on a large floor of 1e6: a receiver gets all that lands below it."""
    got = found(scene([floor(9.0, glossy(1e6))], DOWN), [(2.31, 0.8, -1.47)], [(0, -1, 0)])[0]
    np.testing.assert_allclose(got, 0.9 * RHO * DOWN.irradiance, rtol=TOLERANCE)


@pytest.mark.parametrize("flip", [1, -1])
def test_a_small_plate_with_normals_askew_in_the_edge_of_a_spot(flip):
    """Flux by the face's normal and the spot's smoothstep, what is sent by the interpolated normal."""
    side, askew = 1e-3, unit(np.array((0.3, 1.0, 0.1)))
    plate = rectangle((-side / 2, 0, flip * side / 2), (side, 0, 0), (0, 0, -flip * side), RED)
    plate = dataclasses.replace(plate, normals=np.tile(askew, (4, 1)))
    lamp = SpotLight((0.6, 0.8, 0.0), (-0.6, -0.8, 0.35), 0.2, 0.5, (1.0, 2.0, 3.0))
    axis = np.array(lamp.direction) / math.hypot(*lamp.direction)
    t = (axis @ (-0.6, -0.8, 0.0) - math.cos(0.5)) / (math.cos(0.2) - math.cos(0.5))
    assert 0.2 < t < 0.8
    flux = np.array(lamp.intensity) * t * t * (3 - 2 * t) * 0.8 * side**2
    x = np.array((-0.3, 0.9, 0.4))
    r = np.linalg.norm(x)
    expected = flux * (0.6, 0.5, 0.4) / math.pi * (askew @ x / r) / r**2  # the receiver looks straight at it
    got = found(scene([plate], lamp, smooth=True), [x], [-x])[0]
    np.testing.assert_allclose(got, expected, rtol=1e-5)  # the plate is 1e-3 long


def test_a_lobe_of_zero_straight_down_sends_its_solid_angle():
    """P = 0: the same intensity everywhere above; a parallel receiver gets F / 2 pi times the plate's solid angle."""
    plate = rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2), glossy(0.0))
    h = 0.3
    solid_angle = 4 * math.atan(1 / (h * math.sqrt(h * h + 2)))
    expected = 0.9 * RHO * DOWN.irradiance * solid_angle / (2 * math.pi) / lobe_fraction(0.0, 0.0)
    np.testing.assert_allclose(found(scene([plate], DOWN), [(0, h, 0)], [(0, -1, 0)])[0], expected, rtol=TOLERANCE)


def disc(radius, count, material):
    """Return a fan of triangles around the origin with the area of the disc."""
    turn = 2 * math.pi * np.arange(count) / count
    radius *= math.sqrt(2 * math.pi / count / math.sin(2 * math.pi / count))
    rim = np.stack([radius * np.cos(turn), np.zeros(count), -radius * np.sin(turn)], axis=1)
    mesh = rectangle((0, 0, 0), (1, 0, 0), (0, 0, -1), material)
    faces = np.stack([np.zeros(count, int), 1 + np.arange(count), 1 + (1 + np.arange(count)) % count], axis=1)
    return type(mesh)(np.concatenate([[(0, 0, 0)], rim]), faces, None, material)


@pytest.mark.parametrize("exponent", [0.0, 1.0, 20.0, 900.0, 1e4])
def test_parallel_light_on_a_disc(exponent):
    """E = F (1 - (h / sqrt(h^2 + R^2))^(P + 1)) on the axis, for every P."""
    h, radius = 0.5, 0.6
    share = 1 - (h / math.hypot(h, radius)) ** (exponent + 1)
    expected = 0.9 * RHO * DOWN.irradiance * share
    got = found(scene([disc(radius, 48, glossy(exponent))], DOWN), [(0, h, 0)], [(0, -1, 0)])[0]
    np.testing.assert_allclose(got, expected, rtol=2 * TOLERANCE)


@pytest.mark.parametrize("exponent", [1.0, 60.0, 1000.0, 1e4])
def test_a_point_lamp_above_a_receiver(exponent):
    """Lamp and receiver on one axis over a plane: an integral over the distance from the axis."""
    lamp, height, h = PointLight((0.0, 0.8, 0.0), (1.0, 2.0, 0.5)), 0.8, 0.3

    def ring(s):
        d, r = math.hypot(s, height), math.hypot(s, h)
        cosine = (height * h - s * s) / (d * r)  # of the mirrored ray and the way to the receiver
        lobe = (exponent + 1) / (2 * math.pi * lobe_fraction(math.atan2(s, height), exponent))
        return 2 * math.pi * s * height / d**3 * lobe * max(0.0, cosine) ** exponent * h / r**3

    edge = math.sqrt(height * h)
    width = min(edge, 8 / math.sqrt(exponent) * height * h / (height + h))
    expected = 0.9 * RHO * lamp.intensity * (quad(ring, 0, width, epsrel=1e-8)[0]
                                             + quad(ring, width, edge, epsrel=1e-6, epsabs=1e-12)[0])
    got = found(scene([floor(5.0, glossy(exponent))], lamp), [(0, h, 0)], [(0, -1, 0)])[0]
    np.testing.assert_allclose(got, expected, rtol=TOLERANCE)


@pytest.mark.parametrize(("exponent", "tilt"), [(5.0, 0.0), (20.0, 1.2), (60.0, 1.5)])
def test_what_leaves_a_small_plate_is_its_flux(exponent, tilt):
    """The flux through a large half sphere is rho F A, whatever part of the lobe lies below the surface."""
    side, rounds, turns = 1e-3, 48, 48
    sun = DirectionalLight((math.sin(tilt), -math.cos(tilt), 0.0), (1.0, 2.0, 3.0))
    plate = rectangle((-side / 2, 0, side / 2), (side, 0, 0), (0, 0, -side), glossy(exponent))
    z, weight = gauss_legendre(rounds)
    z, weight = (z + 1) / 2, weight / 2
    turn = 2 * math.pi * (np.arange(turns) + 0.5) / turns
    flat = np.sqrt(1 - z * z)[:, None]
    points = np.stack([flat * np.cos(turn), np.broadcast_to(z[:, None], (rounds, turns)), flat * np.sin(turn)], axis=-1)
    speck = rectangle((0, -1, 0), (side, 0, 0), (0, 0, side), Material("black", (0.0,) * 3))  # one cell for the plate
    value, _ = irradiance(scene([plate, speck], sun), facing(points, -points), 1e-2)
    flux = (value.reshape(rounds, turns, 3) * weight[:, None, None]).sum(axis=(0, 1)) * 2 * math.pi / turns
    expected = 0.9 * RHO * sun.irradiance * math.cos(tilt) * side**2
    np.testing.assert_allclose(flux, expected, rtol=5e-4)  # of 48 rings; the plate is 1e-3 long


def cluttered_room():
    """A floor, a wall and a smooth ball of lobes, a plate between; a point lamp and a spot."""
    ball = sphere((0.2, 0.3, 0.1), 0.25, 48, glossy(15.0, (0.1, 0.1, 0.1)), "ball")
    return scene([rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2), glossy(8.0, (0.05, 0.2, 0.1))),
                  rectangle((-1, 0, -1), (2, 0, 0), (0, 2, 0), glossy(30.0)), ball,
                  rectangle((-0.6, 0.5, 0.3), (0.5, 0, 0), (0, 0.1, -0.5))],
                 PointLight((-0.3, 1.3, 0.4), (1.0, 0.5, 0.2)),
                 SpotLight((0.7, 0.9, 0.8), (-0.5, -0.6, -1.0), 0.3, 0.6, (0.5, 1.0, 2.0)), smooth=True)


def test_light_tracing_agrees(evidence):
    """Both segments blocked, interpolated normals, two lamps: a mean of random rays, within its standard error."""
    room, random = cluttered_room(), np.random.default_rng(8)
    points = np.array([(-0.5, 1e-3, 0.1), (0.6, 1e-3, -0.6), (0.0, 0.8, -1 + 1e-3), (-0.7, 0.3, -1 + 1e-3),
                       (0.3, 1.4, -1 + 1e-3), (0.9, 1e-3, 0.9)])
    to = facing(points, [(0, 1, 0)] * 2 + [(0, 0, 1)] * 3 + [(0, 1, 0)])
    rounds = np.array([light_tracing.irradiance(room, to, light_tracing.Rules(), 32, random) for _ in range(12)])
    expected, error = rounds.mean(axis=0), rounds.std(axis=0, ddof=1) / math.sqrt(len(rounds))
    value, _ = irradiance(room, to, TOLERANCE)
    off = np.abs(value - expected) / error
    evidence(f"off by {off.max():.1f} standard errors at most, of {np.median(error / expected):.1e}")
    assert (off < 4).all()
    assert np.median(error / expected) < 0.06


@pytest.mark.slow
def test_a_finer_tolerance_moves_it_within_the_coarser(evidence):
    room = cluttered_room()
    to = facing([(0.0, 0.8, -1 + 1e-3), (0.3, 1e-3, -1 + 1e-2)], [(0, 0, 1), (0, 1, 0)])
    rough, fine = (irradiance(room, to, tolerance)[0] for tolerance in (TOLERANCE, TOLERANCE / 10))
    off = np.abs(rough / fine - 1)
    evidence(f"moved by {off.max():.1e}")
    assert off.max() < TOLERANCE

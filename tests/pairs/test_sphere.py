"""Virtual spherical lights: against the integral over the cone, closed figures and the pixel lights they tend to."""

import math

import numba
import numpy as np
import pytest

from refgi.errors import InputError
from refgi.jit import threads
from refgi.pairs.sphere_sum import cone_term, cut_cone_term
from refgi.settings import of
from refgi.splat import PairSettings, irradiance
from tests.naive.sphere import cone_integral, spherical_pair
from tests.pairs import sets

UP = np.array([[0.0], [0.0], [1.0]])
ON_AXIS = {1: 0.667, 2: 0.935, 5: 0.990, 10: 0.9975}  # E / E of the pixel light at so many radii
FIGURE = 5e-4  # half of the last digit of the figures above
WHOLE = {np.float32: 2e-6, np.float64: 1e-12}  # roundings of a closed form; the twin's 1e-10 integrates it to rounding
# the Gauss rule of cut cones, where the pixel light on its axis is 1; 9.7e-5 is the worst of 4000, at d just over r
CUT = 1e-4
# float32 gives cos a = sqrt(1 - r^2 / d^2) an error of sqrt(6e-8) near d = r
CUT_SINGLE = 3e-4


def spheres(position, normal, lights, radius, real=np.float64):
    area = np.full(lights.position.shape[1], math.pi * radius**2)
    return irradiance(sets.receivers(position, normal, real), lights, of(PairSettings, clamp="sphere"), area)[:, 0]


def cones(rng, count):
    """Draw cones with their horizons: most of them cut by one or both, many narrow or just short of a hemisphere."""
    for _ in range(count):
        axis, first, second = sets.random_directions(rng, 3).T
        angle = rng.choice([rng.uniform(0, math.pi / 2), math.pi / 2, math.pi / 2 - 10 ** rng.uniform(-4, -1),
                            10 ** rng.uniform(-3, 0)])
        if rng.random() < 0.3:
            second = first + rng.normal(size=3) * 10 ** rng.uniform(-9, -1)
        second = second / np.linalg.norm(second)
        for horizon in (first, second):
            if rng.random() < 0.5:
                axis = axis - horizon * (horizon @ axis) + horizon * rng.normal() * math.sin(angle)
        yield axis / np.linalg.norm(axis), first, second, angle


@pytest.mark.feature("REF-09")
def test_on_axis_figures(evidence):
    found = {}
    for distance, figure in ON_AXIS.items():
        light = sets.lights(np.zeros((3, 1)), UP, math.pi)
        found[distance] = spheres(0.3 * distance * UP, -UP, light, 0.3)[0, 0] * (0.3 * distance) ** 2
        assert found[distance] == pytest.approx(figure, abs=FIGURE)
        sine = 1 / distance
        closed = 2 / 3 * (1 - (1 - sine**2) ** 1.5) / sine**2
        assert found[distance] == pytest.approx(closed, rel=1e-13)
    evidence("on axis: " + ", ".join(f"{e:.4f} of the pixel light at {d} r" for d, e in found.items()))


@pytest.mark.slow("float64")
@pytest.mark.parametrize("real", [np.float32, np.float64])
@pytest.mark.feature("REF-09")
def test_cones_are_integrated(real, evidence):
    rng = np.random.default_rng(1)
    whole, cut, counts = 0.0, [], [0, 0]
    for axis, first, second, angle in cones(rng, 500):
        axis, first, second = (part.astype(real) for part in (axis, first, second))
        ratio = real(math.sin(angle) ** 2)
        exact = [part.astype(np.float64) / np.linalg.norm(part.astype(np.float64)) for part in (axis, first, second)]
        above = min(exact[0] @ exact[1], exact[0] @ exact[2])
        if above < -math.sin(angle):
            continue  # wholly below a horizon
        expected = cone_integral(*exact, math.asin(math.sqrt(ratio))) / (math.pi * float(ratio))
        got = cut_cone_term(tuple(axis), tuple(first), tuple(second), ratio)
        cut.append(abs(float(got) - expected))
        counts[0] += 1
        if above > math.sin(angle):
            cosines = (real(exact[0] @ n) for n in exact[1:])
            closed = cone_term(*cosines, real(exact[1] @ exact[2]), ratio)
            whole = max(whole, abs(float(closed) - expected))
            counts[1] += 1
    assert whole < WHOLE[real]
    assert max(cut) < (CUT if real is np.float64 else CUT_SINGLE)
    assert counts[1] > 20
    evidence(f"{np.dtype(real).name}: closed form to {whole:.1e} ({counts[1]} whole cones), slices to {max(cut):.1e}, "
             f"median {np.median(cut):.1e} ({counts[0]} cones)")


@pytest.mark.feature("REF-09")
def test_sum_is_that_of_the_twin(evidence):
    receivers, lights = sets.room(np.random.default_rng(2), 12)
    worst = 0.0
    for radius in (0.05, 0.4, 3.0):
        got = spheres(receivers.position[:, 0], receivers.normal[:, 0], lights, radius)
        expected = np.array([sum(spherical_pair(x, n, *light, radius=radius) for light in zip(
            *(part.T for part in lights[:3]), strict=True)) for x, n in zip(
                receivers.position[:, 0].T, receivers.normal[:, 0].T, strict=True)]).T
        worst = max(worst, np.abs(got - expected).max() / expected.mean())
    assert worst < CUT
    evidence(f"144 pairs, r 0.05, 0.4, 3 m: error {worst:.1e} of the mean")


@pytest.mark.parametrize("real", [np.float32, np.float64])
@pytest.mark.feature("REF-09")
def test_small_spheres_are_pixel_lights(real, evidence):
    """The difference falls as r^2 and nothing is lost to rounding however small r is."""
    receivers, lights = sets.room(np.random.default_rng(3), 200, real)
    plain = irradiance(receivers, lights, PairSettings())[:, 0].astype(np.float64)
    errors = []
    for radius in (1e-2, 1e-3, 1e-5, 1e-12, 1e-25):
        got = spheres(receivers.position[:, 0], receivers.normal[:, 0], lights, radius, real)
        errors.append(float(np.abs(got - plain).max() / plain.mean()))
    assert errors[1] < errors[0] / 30
    assert max(errors[2:]) < {np.float32: 2e-5, np.float64: 1e-7}[real]  # r^2 / d^2 of the nearest pair at r = 1e-5
    evidence(f"{np.dtype(real).name}: off the pixel lights by {errors[0]:.1e}, {errors[1]:.1e}, {max(errors[2:]):.1e} "
             "at r = 1 cm, 1 mm, 10 um and less")


def test_changes_little_where_a_horizon_starts_to_cut():
    """The closed form and the slices meet."""
    for angle in (1e-3, 0.1, 0.7, 1.4):
        axis = np.array([math.cos(angle), 0.0, math.sin(angle)])  # touches the horizon of UP
        second = sets.unit(np.array([[1.0], [0.2], [0.3]]))[:, 0]
        ratio = math.sin(angle) ** 2
        cut = cut_cone_term(tuple(axis), (0.0, 0.0, 1.0), tuple(second), ratio)
        if axis @ second > math.sin(angle):
            assert cut == pytest.approx(cone_term(axis[2], axis @ second, second[2], ratio), rel=1e-5)


@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_finite_and_bounded_wherever_the_light_is(real):
    """Coincident, nearly so and far; the largest term is 2 / (3 r^2) Phi / pi, on the axis inside the sphere."""
    rng = np.random.default_rng(4)
    facing = sets.random_directions(rng, 64)
    facing[:, :8] = np.repeat(np.eye(3), 3, axis=1)[:, :8]
    light = sets.lights(np.zeros((3, 64)), facing[:, ::-1], 1.0, real)
    for distance in (0.0, *10.0 ** np.arange(-44.0, 16.0, 3)):
        for radius in (1e-20, 1e-3, 1.0, 1e5):
            towards = sets.random_directions(rng, 64)
            got = spheres(distance * towards, facing, light, radius, real).astype(np.float64)
            assert np.isfinite(got).all()
            assert (got >= 0).all()
            if radius > 1e-10:
                assert (got <= 64 * 2 / (3 * math.pi * radius**2) * (1 + 1e-4)).all()
    assert not spheres(np.zeros((3, 1)), -UP, sets.lights(np.zeros((3, 1)), UP, 1.0, real), 0.1, real).any()


@pytest.mark.feature("REF-09")
def test_reaches_over_horizons_by_its_radius():
    """A light 1 cm behind a wall's plane, 2 cm in radius, 10 cm away: seen in part; on a common plane: not at all."""
    light = sets.lights(np.array([[-0.01], [0.0], [0.1]]), -UP, 1.0)
    wall = np.array([[1.0], [0.0], [0.0]])
    assert spheres(np.zeros((3, 1)), wall, light, 0.02).min() > 0
    assert not spheres(np.zeros((3, 1)), wall, light, 0.009).any()
    assert not irradiance(sets.receivers(np.zeros((3, 1)), wall), light, PairSettings()).any()
    floor = np.array([[0.0, 0.3], [0.0, 0.1], [0.0, 0.0]])
    assert not spheres(floor, np.tile(UP, 2), sets.lights(floor, np.tile(UP, 2), 1.0), 0.5).any()


@pytest.mark.feature("REF-09")
def test_radius_follows_the_footprint():
    receivers, lights = sets.room(np.random.default_rng(5), 20)
    area = np.random.default_rng(6).uniform(0.01, 0.2, 20)
    four = irradiance(receivers, lights, of(PairSettings, clamp="sphere", clamp_value=4.0), area)
    np.testing.assert_array_equal(four, irradiance(receivers, lights, of(PairSettings, clamp="sphere"), 4 * area))
    plain = irradiance(receivers, lights, of(PairSettings, clamp="sphere", clamp_value=1.0), area)
    np.testing.assert_array_equal(plain, irradiance(receivers, lights, of(PairSettings, clamp="sphere"), area))


def test_same_bits_for_any_number_of_threads():
    receivers, lights = sets.room(np.random.default_rng(7), 700, np.float32)
    found = []
    for count in range(1, numba.config.NUMBA_NUM_THREADS + 1):
        with threads(count):
            found.append(spheres(receivers.position[:, 0], receivers.normal[:, 0], lights, 0.2, np.float32))
    for other in found[1:]:
        np.testing.assert_array_equal(other, found[0])


def test_glossy_lights_are_refused():
    lights = sets.glossy(np.zeros((3, 1)), UP, UP, 8.0)
    with pytest.raises(InputError, match="clamp: expected another one for glossy materials"):
        spheres(UP, -UP, lights, 0.1)

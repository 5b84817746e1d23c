"""Sums of pixel lights against form factors, and what each clamp costs in bias to save in variance."""

import math

import numpy as np
import pytest

from refgi.literal.pairs import pair
from refgi.settings import of
from refgi.splat import PairSettings, irradiance
from tests.form_factors import disc_form_factor, parallel_rectangles_form_factor, polygon_form_factor
from tests.pairs import sets

UP = np.array([[0.0], [0.0], [1.0]])
FLOOR = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
RADIANCE = 1.0  # of every sender; a sender of area A has the flux pi A
NEAREST = 1e-3  # of the bound: the nearest of 400 places, a factor of 1.02 apart


def floor_lights(points):
    """Pixel lights of an evenly bright unit floor at points (n, 2) of the unit square."""
    position = np.stack([points[:, 0], points[:, 1], np.zeros(len(points))])
    return sets.lights(position, np.tile(UP, len(points)), math.pi * RADIANCE / len(points))


def cells(n):
    middle = (np.arange(n) + 0.5) / n
    return np.stack(np.meshgrid(middle, middle), axis=-1).reshape(-1, 2)


def light_on(position, normal, lights, footprint=None, **settings):
    receivers = sets.receivers(position, np.broadcast_to(normal, position.shape))
    return irradiance(receivers, lights, of(PairSettings, **settings), footprint)[0, 0]


def exact(position, normal):
    return np.array([math.pi * RADIANCE * polygon_form_factor(p, normal, FLOOR) for p in position.T])


@pytest.mark.feature("REF-07")
def test_rectangles_at_any_tilt(evidence):
    """Errors fall as 1 / N (midpoint rule in two dimensions)."""
    worst, slopes = 0.0, []
    for tilt in (0.0, 0.4, 1.0, math.pi / 2):
        normal = np.array([[-math.sin(tilt)], [0.0], [-math.cos(tilt)]])
        at = np.array([[1.5, 1.9], [0.3, 0.8], [1.0, 1.6]])  # the whole floor lies before every tilt
        errors = [np.abs(light_on(at, normal, floor_lights(cells(n))) / exact(at, normal[:, 0]) - 1).max()
                  for n in (16, 64, 256)]
        slopes.append(math.log(errors[0] / errors[2]) / math.log(256))
        worst = max(worst, errors[2])
    assert worst < 1e-4
    assert min(slopes) > 0.95
    evidence(f"point to rectangle, four tilts: error {worst:.1e} at 256^2 lights, falling as N^-{min(slopes):.2f}")


@pytest.mark.feature("REF-07")
def test_disc_and_parallel_plates(evidence):
    n, radius, height = 400, 0.9, 0.6
    ring = np.sqrt((np.arange(n) + 0.5) / n) * radius
    turn = 2 * math.pi * (np.arange(64) + 0.5) / 64
    position = np.stack([np.outer(ring, np.cos(turn)).ravel(), np.outer(ring, np.sin(turn)).ravel(), np.zeros(n * 64)])
    lights = sets.lights(position, np.tile(UP, n * 64), math.pi**2 * radius**2 / (n * 64))
    disc = light_on(np.array([[0.0], [0.0], [height]]), -UP, lights)[0] / math.pi
    assert disc == pytest.approx(disc_form_factor(height, radius), rel=1e-5)
    whole = sets.lights(np.zeros((3, 1)), UP, math.pi**2 * radius**2)  # one light that stands for all of it
    one = light_on(np.array([[0.0], [0.0], [height]]), -UP, whole, np.array([math.pi * radius**2]), clamp="disc")
    assert one[0] / math.pi == pytest.approx(disc_form_factor(height, radius), rel=1e-12)
    above = np.concatenate([cells(32).T, np.full((1, 1024), 0.8)])
    mean = light_on(above, -UP, floor_lights(cells(32))).mean() / math.pi
    plates = parallel_rectangles_form_factor(1.0, 1.0, 0.8)
    assert mean == pytest.approx(plates, rel=5e-4)  # two midpoint rules of 32^2
    evidence(f"disc {disc / disc_form_factor(height, radius) - 1:+.1e}, parallel plates {mean / plates - 1:+.1e}")


@pytest.mark.feature("REF-07")
def test_wedge(evidence):
    """A wall on the edge of the lit floor, points from 2 cm up: needs dense lights, not a clamp."""
    at = np.stack([np.zeros(20), np.full(20, 0.5), np.linspace(0.02, 1, 20)])
    normal = np.array([[1.0], [0.0], [0.0]])
    error = np.abs(light_on(at, normal, floor_lights(cells(512))) / exact(at, normal[:, 0]) - 1)
    assert error.max() < 2e-3
    evidence(f"wall at the floor's edge: error up to {error.max():.1e} at 2 cm, {error[5:].max():.1e} from 28 cm up")


@pytest.mark.feature("SII-27", "REF-08")
@pytest.mark.parametrize(("clamp", "value"), [("distance", 0.3), ("geometry", 2.0), ("disc", 0.0)])
def test_clamps_are_those_of_the_twin(clamp, value):
    """A minimum distance, a bounded geometry term, a disc of the light's area, from the literal pair."""
    receivers, lights = sets.room(np.random.default_rng(1), 30)
    how = of(PairSettings, clamp=clamp, **({"clamp_value": value} if value else {}))
    got = irradiance(receivers, lights, how, np.full(30, 0.07))[:, 0]
    x, n, (p, m, flux) = receivers.position, receivers.normal, (part[:, :, None] for part in lights[:3])
    r = np.linalg.norm(x - p, axis=0)
    each = {"distance": lambda: pair(x, n, p, m, flux) * (r / np.maximum(r, value)) ** 2,
            "geometry": lambda: flux / math.pi * np.minimum(pair(x, n, p, m, math.pi), value),
            "disc": lambda: pair(x, n, p, m, flux, area=0.07)}[clamp]()
    expected = each.sum(axis=1)
    np.testing.assert_allclose(got, expected, rtol=1e-9, atol=1e-14)
    assert np.abs(got / np.maximum(irradiance(receivers, lights, PairSettings())[:, 0], 1e-9) - 1).max() > 0.01


@pytest.mark.parametrize("clamp", ["distance", "geometry", "disc", "sphere"])
def test_clamps_out_of_reach_change_no_bit_or_only_rounding(clamp):
    receivers, lights = sets.room(np.random.default_rng(2), 60)
    value = {"distance": 1e-9, "geometry": 1e12, "disc": 0.0, "sphere": 1.0}[clamp]
    how = of(PairSettings, clamp=clamp, **({"clamp_value": value} if value else {}))
    got = irradiance(receivers, lights, how, np.zeros(60))
    # the clamped term divides twice where the plain one multiplies by an inverse
    np.testing.assert_allclose(got, irradiance(receivers, lights, PairSettings()), rtol=1e-14)


MODES = {
    "none": {}, "distance 5 cm": {"clamp": "distance", "clamp_value": 0.05},
    "distance 20 cm": {"clamp": "distance", "clamp_value": 0.2},
    "G <= 100": {"clamp": "geometry", "clamp_value": 100.0}, "G <= 10": {"clamp": "geometry", "clamp_value": 10.0},
    "disc": {"clamp": "disc"}, "sphere": {"clamp": "sphere"}, "sphere of 4 A": {"clamp": "sphere", "clamp_value": 4.0},
}


@pytest.mark.feature("REF-08")
def test_bias_and_variance_of_the_clamps(evidence):
    """A wall lit by 256 random lights of the floor at its foot, 300 times over, against the closed form."""
    rng = np.random.default_rng(3)
    at = np.stack([np.zeros(40), np.linspace(0.1, 0.9, 40), np.linspace(0.01, 0.6, 40)])
    normal = np.array([[1.0], [0.0], [0.0]])
    truth = exact(at, normal[:, 0])
    sets_of_lights = [floor_lights(rng.random((256, 2))) for _ in range(300)]
    bias, noise, error = {}, {}, {}
    for name, how in MODES.items():
        runs = np.array([light_on(at, normal, lights, np.full(256, 1 / 256), **how) for lights in sets_of_lights])
        bias[name] = float((runs.mean(axis=0) - truth).mean() / truth.mean())
        noise[name] = float(np.sqrt(runs.var(axis=0).mean()) / truth.mean())
        error[name] = float((runs.mean(axis=1) - truth.mean()).std() / truth.mean() / math.sqrt(300))
    assert abs(bias["none"]) < 4 * error["none"]  # unbiased
    for name in MODES:
        assert noise[name] <= noise["none"]
        assert bias[name] < 4 * error[name]  # a clamp only takes away; a sphere gives back over horizons, but less
    assert bias["distance 20 cm"] < bias["distance 5 cm"] < -4 * error["distance 5 cm"]
    assert bias["G <= 10"] < bias["G <= 100"] <= 0
    assert noise["sphere of 4 A"] < noise["sphere"] < noise["none"] / 2
    assert noise["distance 20 cm"] < noise["distance 5 cm"] < noise["none"] / 2
    evidence("bias / noise of the mean: " + ", ".join(f"{n} {bias[n]:+.1%} / {noise[n]:.0%}" for n in MODES))


@pytest.mark.feature("SII-27")
def test_offset_keeps_the_largest_irradiance_finite_and_costs_bias(evidence):
    """Lights of the floor moved below it: the spike at the foot of the wall falls, light is lost near the edge."""
    rng = np.random.default_rng(4)
    at = np.stack([np.zeros(400), np.tile(np.linspace(0.01, 0.99, 20), 20), np.repeat(np.geomspace(1e-3, 1, 20), 20)])
    normal = np.array([[1.0], [0.0], [0.0]])
    truth = exact(at, normal[:, 0])
    points = np.concatenate([rng.random((900, 2)), rng.random((100, 2)) * [1e-3, 1]])
    peaks, biases = [], []
    for offset in (0.0, 0.01, 0.05, 0.2):
        got = light_on(at, normal, floor_lights(points), offset=offset)
        assert np.isfinite(got).all()
        peaks.append(got.max())
        dense = light_on(at, normal, floor_lights(cells(300)), offset=offset)
        biases.append(float((dense / truth - 1).mean()))
    assert peaks == sorted(peaks, reverse=True)
    assert peaks[1] < peaks[0] / 10
    assert abs(biases[0]) < abs(biases[1]) < abs(biases[2]) < abs(biases[3])
    exact_move = light_on(at + np.array([[0], [0], [0.05]]), normal, floor_lights(points))
    moved = light_on(at, normal, floor_lights(points), offset=0.05)
    np.testing.assert_allclose(moved, exact_move, rtol=1e-9)  # the wall sees the floor 5 cm lower
    evidence("offset 0, 1, 5, 20 cm: largest E " + ", ".join(f"{p:.3g}" for p in peaks) + " W/m^2; mean bias "
             + ", ".join(f"{b:+.1%}" for b in biases))


@pytest.mark.feature("SII-27")
@pytest.mark.parametrize(("how", "most"), [
    ({"offset": 0.05}, 3 * math.sqrt(3) / 16 / 0.05**2), ({"offset": 0.2}, 3 * math.sqrt(3) / 16 / 0.2**2),
    ({"clamp": "distance", "clamp_value": 0.05}, 1 / 2 / 0.05**2), ({"clamp": "geometry", "clamp_value": 70.0}, 70.0),
], ids=str)
def test_one_light_gives_a_wall_beside_it_no_more_than_its_bound(how, most, evidence):
    """Closed form: x h / (x^2 + h^2)^2 with h >= d is at most 3 sqrt 3 / 16 d^2; r >= m leaves at most 1/2 m^2.

    Both are attained, at the foot of the wall where x = d / sqrt 3, and on the diagonal up to r = m.
    """
    apart, above = (part.reshape(-1) for part in np.meshgrid(np.geomspace(1e-3, 1, 400), np.geomspace(1e-5, 1, 600)))
    at = np.stack([-apart, 0 * apart, above])
    light = sets.lights(np.zeros((3, 1)), UP, math.pi)
    largest = light_on(at, np.array([[1.0], [0.0], [0.0]]), light, **how).max()
    assert largest == pytest.approx(most, rel=NEAREST)
    assert largest <= most * (1 + 1e-12)
    plain = light_on(at, np.array([[1.0], [0.0], [0.0]]), light).max()
    evidence(f"{how}: largest E pi / Phi {largest:.4g}, bound {most:.4g} 1/m^2; without {plain:.3g}")

"""Lights moved back along their normals, or with a least distance: the picture's bias against exact irradiance."""

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.scene import Camera, DirectionalLight, Scene, merge
from refgi.settings import of
from refgi.splat import SiiSettings, sii
from tests.form_factors import polygon_form_factor
from tests.truth.scenes import rectangle

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # that is told: tests/pairs/test_loss

FLOOR = [(0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1)]
CELLS = 2e-3  # of the brightest pixel: the midpoint rule with 128 x 128 cells, the nearest of them 5 sides away


@pytest.fixture(scope="module")
def lit_floor():
    """A floor of the unit square, evenly lit by a sun straight above, and the wall at its edge, which the eye sees."""
    floor, wall = rectangle((0, 0, 1), (1, 0, 0), (0, 0, -1)), rectangle((0, 0, 1), (0, 0, -1), (0, 1, 0))
    geometry, materials = merge([floor, wall])
    scene = Scene("wall", geometry, materials, Camera((2.0, 0.6, 0.4), (0.0, 0.4, 0.5), (0.0, 1.0, 0.0), 0.6),
                  (DirectionalLight((0.0, -1.0, 0.0), (3.0, 2.0, 1.0)),))
    return Frame(scene, width=40, height=40, rsm_resolution=128, dtype=np.float64)


def on_wall(frame, offset=0.0):
    """Irradiance of the wall's pixels by the floor's form factor, the floor an offset lower, and where those are."""
    wall = frame.gbuffer.covered & (frame.gbuffer.normal[0] > 0.5)
    places = frame.gbuffer.position[:, wall].T + np.array([0.0, offset, 0.0])
    factors = [polygon_form_factor(place, (1, 0, 0), FLOOR) for place in places]
    (sun,) = frame.scene.lights
    return np.outer(np.array(frame.materials.diffuse[0]) * sun.irradiance, factors), wall


@pytest.mark.feature("SII-27")
@pytest.mark.parametrize("offset", [0.04, 0.1, 0.3])
def test_the_map_of_the_bias_of_an_offset_is_that_of_a_lower_floor(lit_floor, offset, evidence):
    """Closed form: lights moved back by d light the wall as a floor d lower; E is at most that at the wall's foot."""
    exact, wall = on_wall(lit_floor)
    bias = sii(lit_floor, of(SiiSettings, pattern="all", offset=offset))[:, wall] - exact
    expected = on_wall(lit_floor, offset)[0] - exact
    off = np.abs(bias - expected).max() / exact.max()
    (sun,) = lit_floor.scene.lights
    foot = polygon_form_factor((0, offset, 0.5), (1, 0, 0), FLOOR) * 0.6 * sun.irradiance[0]
    largest = (exact + bias)[0].max()
    assert off < CELLS
    assert 0.8 * foot < largest <= foot * (1 + CELLS)
    evidence(f"offset {offset} m: bias {bias.mean() / exact.mean():+.1%} of the wall's light, pixel by pixel "
             f"{bias.min() / exact.max():+.1%} to {bias.max() / exact.max():+.1%} of the brightest, within {off:.0e} "
             f"of the closed form; largest E {largest:.3f}, bound {foot:.3f} W/m^2")


def by_quadrature(places, least, n=800):
    """Integrate cos cos / max(r, m)^2 over the floor by the midpoint rule, for points of the wall (k, 3)."""
    x, z = np.meshgrid((np.arange(n) + 0.5) / n, (np.arange(n) + 0.5) / n)
    square = (x**2 + y**2 + (z - depth) ** 2 for _, y, depth in places)
    return np.array([(x * y / r2 / np.maximum(r2, least**2)).mean()
                     for (_, y, _), r2 in zip(places, square, strict=True)])


@pytest.mark.feature("SII-27")
@pytest.mark.parametrize("least", [0.05, 0.2])
def test_the_map_of_the_bias_of_a_least_distance_is_that_of_the_clamped_integral(lit_floor, least, evidence):
    """Quadrature, of every twentieth pixel: the clamp takes light near the wall's foot alone and gives none."""
    exact, wall = on_wall(lit_floor)
    bias = (sii(lit_floor, of(SiiSettings, pattern="all", clamp="distance", clamp_value=least))[:, wall] - exact)[0]
    places, (sun,) = lit_floor.gbuffer.position[:, wall].T, lit_floor.scene.lights
    expected = by_quadrature(places[::20], least) * 0.6 / np.pi * sun.irradiance[0] - exact[0, ::20]
    off = np.abs(bias[::20] - expected).max() / exact.max()
    assert off < CELLS
    assert bias.max() < CELLS * exact.max()
    far = places[:, 1] > least
    assert np.abs(bias[far]).max() < CELLS * exact.max() < -0.1 * bias.min()
    evidence(f"least distance {least} m: bias {bias.mean() / exact[0].mean():+.1%} of the wall's light, pixel by pixel "
             f"{bias.min() / exact.max():+.1%} to {bias.max() / exact.max():+.1%} of the brightest, within {off:.0e} "
             "of the clamped integral, none above the least distance")

"""Bias compensation in screen space: what a bound on G takes comes back from pixels nearby, and how much of it.

The scene of `tests/truth/test_bias_compensation`, where short rays give back the integral of max(0, G - b) exactly: a
floor of the unit square under a sun straight above, seen with the wall at its edge.
"""

import dataclasses
import math

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.frame import Frame
from refgi.scene import Camera, DirectionalLight, Scene, merge
from refgi.settings import of, replaced
from refgi.splat import SiiSettings, sii
from refgi.splat.sii.options import _within
from tests.form_factors import polygon_form_factor
from tests.literal.whole.sii import compensation
from tests.truth.scenes import rectangle

FLOOR = [(0, 0, 0), (1, 0, 0), (1, 0, -1), (0, 0, -1)]
SUN = DirectionalLight((0.0, -1.0, 0.0), (3.0, 2.0, 1.0))
RADIANCE = 0.6 * 3.0 / math.pi
BOUND = 4.0  # 1/m^2: half a metre
ROUNDING = 1e-9  # of the largest sum: float64 in another order
BOUNDED = of(SiiSettings, pattern="all", clamp="geometry", clamp_value=BOUND)


BOTH = Camera((1.5, 1.1, -0.5), (0.3, 0.3, -0.5), (0.0, 1.0, 0.0), math.radians(60))
WALL = Camera((1.5, 0.8, -0.5), (0.0, 0.8, -0.5), (0.0, 1.0, 0.0), math.radians(25))  # sees nothing of the floor
LEAST_HEIGHT = 0.02  # m: nearer to the floor than two pixels are apart, a sum of points is no integral

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # that is told: tests/pairs/test_loss


def corner(size, camera=BOTH, width=None, **options):
    floor, wall = rectangle((0, 0, 0), (1, 0, 0), (0, 0, -1)), rectangle((0, 0, 0), (0, 0, -1), (0, 1, 0))
    geometry, materials = merge([floor, wall])
    return Frame(Scene("corner", geometry, materials, camera, (SUN,)), width=width or size, height=size,
                 rsm_resolution=128, **options)


def taken(height, z, n=600):
    """Return the integral of max(0, G - b) over the floor from a point of the wall; midpoint rule in x = t^2."""
    t = (np.arange(n) + 0.5) / n
    x = t[:, None] ** 2
    term = x * height / (x**2 + height**2 + (z + t) ** 2) ** 2
    return float((np.maximum(term - BOUND, 0) * 2 * t[:, None]).sum() / n**2)


@pytest.mark.feature("REF-11")
@pytest.mark.parametrize(("size", "residual"), [(48, 0.08), (96, 0.02)])  # of the light taken: pixels are points
def test_what_the_bound_takes_comes_back(size, residual, evidence):
    """Analytic: what is added is the integral that short rays give back (REF-10), the whole the form factor."""
    frame = corner(size)
    x, y, z = frame.gbuffer.position.astype(float)
    here = frame.gbuffer.covered & (x < 1e-4) & (np.abs(z + 0.5) < 0.3) & (y > LEAST_HEIGHT) & (y < 0.6)
    here.reshape(-1)[np.flatnonzero(here)[np.arange(here.sum()) % 4 != 0]] = False
    bounded, given = (sii(frame, replaced(BOUNDED, {"compensation": how}))[0, here] for how in ("none", "screen"))
    places = [*zip(y[here], z[here], strict=True)]
    integral = RADIANCE * np.array([taken(*place) for place in places])
    whole = RADIANCE * math.pi * np.array([polygon_form_factor((0, *place), (1, 0, 0), FLOOR) for place in places])
    back = (given - bounded).sum() / integral.sum() - 1
    before, after = (math.sqrt(((light - whole) ** 2).mean()) / whole.mean() for light in (bounded, given))
    assert abs(back) < residual
    assert after < before / 10
    evidence(f"{size} x {size}: {integral.sum() / whole.sum():.0%} of the light is above the bound, of which pixels "
             f"give back {1 + back:.1%}, short rays all; RMSE to the form factor {before:.1%}, with it {after:.1%}")


@pytest.mark.feature("REF-11")
@pytest.mark.parametrize(("width", "height"), [(120, 20), (20, 120)])
def test_of_a_long_picture_it_is_the_sum_of_all_pairs_of_pixels(width, height):
    """Literal senders: windows of rows and of columns are each of their own angle of view."""
    narrow = dataclasses.replace(BOTH, target=(0.1, 0.1, -0.5), vfov=math.radians(15 if width > height else 90))
    frame = corner(height, narrow, width, dtype=np.float64)
    bounded, given = (sii(frame, replaced(BOUNDED, {"compensation": how})) for how in ("none", "screen"))
    expected = compensation(frame, BOUND)
    assert expected.any()
    np.testing.assert_allclose(given - bounded, expected, rtol=0, atol=ROUNDING * expected.max())


@pytest.mark.feature("REF-11")
def test_what_the_picture_does_not_show_is_not_given_back():
    """A wall that the sun only grazes sends nothing, and the floor is off screen."""
    frame = corner(32, WALL)
    bounded, given = (sii(frame, replaced(BOUNDED, {"compensation": how})) for how in ("none", "screen"))
    assert bounded.any()
    np.testing.assert_array_equal(given, bounded)


@pytest.mark.feature("REF-11")
def test_no_point_near_enough_lies_outside_the_window():
    """Property: of points nearer to each other than b^(-1/2), each one's window of columns holds the other."""
    rng, half, count = np.random.default_rng(4), 0.7, 64
    for _ in range(4000):
        bound, depth = rng.uniform(0.5, 20), rng.uniform(0.3, 4)
        here = np.array([rng.uniform(-half, half) * depth, depth])
        turn = rng.uniform(0, 7)
        there = here + rng.uniform(0.7, 1) / math.sqrt(bound) * np.array([math.cos(turn), math.sin(turn)])
        column, other = ((x / z / half + 1) / 2 * count for x, z in (here, there))
        if there[1] > 0 and 0 <= other < count:
            first, last = _within(int(column), count, depth, half, bound)
            assert first <= int(other) < last


def test_there_is_a_bound_to_make_up_for():
    with pytest.raises(InputError, match="compensation"):
        of(SiiSettings, compensation="screen")

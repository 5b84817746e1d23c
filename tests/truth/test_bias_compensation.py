"""Bias compensation (Kollig and Keller 2004): what a bound on G takes from the light side, short rays give back.

A sun straight above lights a floor of the unit square evenly; receivers stand on a wall at its edge, where G has no
bound. E = L times the integral of min(G, b) by light vertices, and of max(0, G - b) by hemisphere sampling; the whole
is the floor's form factor.
"""

import math

import numpy as np
import pytest

from refgi.rays import Tracer
from refgi.scene import DirectionalLight
from refgi.truth import TruthSettings
from refgi.truth.light_grid import footprint
from refgi.truth.light_pass import add_light_side
from refgi.truth.passes import _hemisphere, one_pass
from refgi.truth.task import drawn
from refgi.truth.truth import task_of
from tests.form_factors import polygon_form_factor
from tests.truth.scenes import rectangle, scene

FLOOR = [(0, 0, 0), (1, 0, 0), (1, 0, -1), (0, 0, -1)]
HEIGHTS = (0.03, 0.1, 0.3)
SUN = DirectionalLight((0.0, -1.0, 0.0), (3.0, 2.0, 1.0))
RADIANCE = 0.6 * np.array(SUN.irradiance) / math.pi
GRID = 16  # rays along a side of the light's grid
PASSES, REPEAT = 80, 64
STANDARD_ERRORS = 4.5  # one in 150,000 of unbiased figures
TELLING = 0.03  # largest standard error of a part, as a share of the whole


def quadrature(height, bound, n=1500):
    """Return the integrals of min(G, b) and max(0, G - b) over the floor, from a point of the wall above its edge.

    Midpoint rule in x = t^2, dense at the wall's foot.
    """
    t, z = ((np.arange(n) + 0.5) / n for _ in range(2))
    x = t[:, None] ** 2
    term = x * height / (x**2 + height**2 + (z - 0.5) ** 2) ** 2
    cell = 2 * t[:, None] / n**2
    return float((np.minimum(term, bound) * cell).sum()), float((np.maximum(term - bound, 0) * cell).sum())


def parts(bound):
    """Return light side, hemisphere and a whole pass of many passes, (3, passes, 3 heights), first channel over L."""
    room = scene([rectangle((0, 0, 0), (1, 0, 0), (0, 0, -1)), rectangle((0, 0, 0), (0, 0, -1), (0, 1, 0))], SUN)
    position = np.repeat(np.array([(0.0, h, -0.5) for h in HEIGHTS]).T[:, :, None], REPEAT, axis=2)
    normal = np.broadcast_to(np.array([1.0, 0, 0])[:, None, None], position.shape)
    settings = TruthSettings(bound=bound, light_grid=GRID)
    task = task_of(room, Tracer(room.geometry), position, normal, np.full(position.shape[1:], 2, np.int32), settings)
    found = np.zeros((3, PASSES, len(HEIGHTS)))
    for k in range(PASSES):
        draw = drawn(settings, k, 7)
        light, rays = np.zeros((2, 3, position[0].size))
        add_light_side(task, draw, light)
        _hemisphere(task, draw, rays)
        for part, value in enumerate((light, rays, one_pass(task, k))):
            found[part, k] = value[0].reshape(position.shape[1:]).mean(axis=1) / RADIANCE[0]
    return found, footprint(SUN, room.geometry, GRID)[0]


@pytest.mark.slow("0.003")
@pytest.mark.feature("REF-10")
@pytest.mark.parametrize("bound", [0.003, 0.03, 0.3])
def test_bounded_light_and_short_rays_are_the_two_parts_of_the_integral(bound, evidence):
    """Analytic: each part is its integral, and their mean is the unclamped one, whatever the bound."""
    found, measure = parts(bound)
    whole = np.array([math.pi * polygon_form_factor((0, h, -0.5), (1, 0, 0), FLOOR) for h in HEIGHTS])
    halves = np.array([quadrature(h, bound / measure) for h in HEIGHTS]).T
    np.testing.assert_allclose(halves.sum(axis=0), whole, rtol=1e-4)  # the quadrature itself
    expected = np.stack([*halves, whole])
    mean, error = found.mean(axis=1), found.std(axis=1, ddof=1) / math.sqrt(PASSES)
    assert (error < TELLING * whole).all()
    z = np.abs(mean - expected) / np.maximum(error, 1e-4 * whole)
    shares = ", ".join(f"{residual / all_of_it:.1%}" for residual, all_of_it in zip(halves[1], whole, strict=True))
    evidence(f"b = {bound / measure:.3g} 1/m^2, at 3, 10 and 30 cm: {shares} is above the bound; light side, short "
             f"rays and their sum within {', '.join(f'{worst:.1f}' for worst in z.max(axis=1))} standard errors of "
             f"their integrals")
    assert z.max() < STANDARD_ERRORS

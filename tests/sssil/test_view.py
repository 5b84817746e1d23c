"""Sample areas against areas of polygons, exact pixels of planes, and the factor of the printed form."""

import math

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.frame import Frame
from refgi.rsm.raster.projection import camera_projection
from refgi.scene import Camera, Material, PointLight, Scene, merge
from refgi.scene.builtin.surfaces import rectangle
from refgi.sssil.levels import levels
from refgi.sssil.view import GRAZING
from tests.sssil.pictures import FLOAT64, camera, random_picture

SUM_720P = 1e-3  # 0.1 % is asked at 720 lines; pixels on the outline count whole or not at all
# one pixel's area by its centre's ray: the midpoint rule, off by about the square of its angle, 3 mrad
MIDPOINT = 1e-5


def sample_area(depth, normal, projection, as_published=frozenset()):
    """The area of each texel of level 0, a pixel each."""
    nothing = np.zeros((3, *depth.shape), depth.dtype)
    return levels(depth, normal, nothing, nothing, projection, 0, 1, as_published=as_published)[0].area


def rays(view):
    """Rays of a camera along -z through the corners of its pixels, z = -1."""
    half_v = math.tan(view.vfov / 2)
    half_h = half_v * view.width / view.height
    x = np.linspace(-half_h, half_h, view.width + 1)
    y = np.linspace(half_v, -half_v, view.height + 1)
    return np.stack([*np.meshgrid(x, y), -np.ones((view.height + 1, view.width + 1))])


@pytest.mark.feature("HSS-02")
def test_sums_to_the_area_of_a_polygon(evidence):
    """A rectangle of 2 x 1.5 m, fully visible, its outline aslant to the pixels, 1280 x 720 pixels."""
    figures = []
    for degrees in (0.0, 30.0, 60.0, 80.0):
        c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        tilt = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        across, up = tilt @ (2 * 0.96, 2 * 0.28, 0), tilt @ (-1.5 * 0.28, 1.5 * 0.96, 0)
        corner = np.array([0.02, 0.03, -3.5]) - across / 2 - up / 2
        geometry, materials = merge([rectangle(corner, across, up, Material("grey", (0.5, 0.5, 0.5)), "rectangle")])
        scene = Scene("rectangle", geometry, materials, camera(1280, 720, 45.0), (PointLight((0, 0, 0), (1, 1, 1)),))
        buffer = Frame(scene).gbuffer
        area = sample_area(buffer.depth, buffer.normal, buffer.projection)
        figures.append(abs(area.sum(dtype=float) / 3.0 - 1))
        assert figures[-1] < SUM_720P, degrees
    evidence(f"sum of ds, tilted 0, 30, 60, 80 degrees: off by {', '.join(f'{off:.1e}' for off in figures)}")


@pytest.mark.feature("HSS-02")
def test_a_pixel_of_a_plane_has_the_area_between_its_corners(evidence):
    """Planes n.p = -1: the exact area is half the cross product of a quadrangle's diagonals."""
    view, rng, worst = camera(640, 360, 60.0), np.random.default_rng(3), 0.0
    corners = rays(view)
    centres = (corners[:, :-1, :-1] + corners[:, 1:, 1:]) / 2
    for _ in range(8):
        n = np.append(rng.uniform(-0.4, 0.4, 2), 1)
        n /= np.linalg.norm(n)
        facing = -np.tensordot(n, centres, 1)
        p = corners / -np.tensordot(n, corners, 1)
        one, other = p[:, 1:, 1:] - p[:, :-1, :-1], p[:, 1:, :-1] - p[:, :-1, 1:]
        exact = np.linalg.norm(np.cross(one, other, axis=0), axis=0) / 2
        seen = np.tensordot(n, corners, 1).max() < -0.2  # far from the horizon everywhere
        assert seen
        normal = np.broadcast_to(n[:, None, None], centres.shape)
        area = sample_area(1 / facing, normal, camera_projection(view))
        worst = max(worst, np.abs(area / exact - 1).max())
    assert worst < MIDPOINT
    evidence(f"8 planes, 640 x 360: every pixel within {worst:.1e} of its exact area")


@pytest.mark.feature("HSS-02")
@pytest.mark.parametrize(("degrees", "factor"), [(30, 4.64), (45, 5.83), (60, 9.0), (75, 23.7)])
def test_tangents_as_printed(degrees, factor, evidence):
    """Eq. 3 takes tan f for tan f/2: the table of docs/radiometry, a square picture."""
    view = camera_projection(camera(8, 8, degrees))
    depth, normal, *_ = random_picture(8, 8, behind=0.0)
    area = sample_area(depth, normal, view)
    assert (area > 0).any()
    ratio = sample_area(depth, normal, view, frozenset({"hss_tan_f"}))[area > 0] / area[area > 0]
    expected = (math.tan(math.radians(degrees)) / math.tan(math.radians(degrees) / 2)) ** 2
    np.testing.assert_allclose(ratio, expected, rtol=FLOAT64)
    assert abs(expected - factor) < 0.05
    evidence(f"{degrees} degrees: {float(ratio.mean()):.3f} times")


def test_tangents_as_printed_need_less_than_90_degrees():
    depth, normal, *_ = random_picture(16, 9)
    wide = camera_projection(camera(16, 9, 60.0))  # 91.5 degrees across
    with pytest.raises(InputError, match=r"'hss_tan_f': expected a field of view of less than 90 degrees, got '91\.4"):
        sample_area(depth, normal, wide, frozenset({"hss_tan_f"}))


@pytest.mark.feature("HSS-02")
def test_grazing_surfaces_are_bounded_and_those_that_look_away_have_none():
    view = camera_projection(Camera((0, 0, 0), (0, 0, -1), vfov=math.pi / 3, width=1, height=1))
    depth = np.full((1, 1), 2.0)
    pixel = 4 * math.tan(math.pi / 6) ** 2 * 4.0

    def area(*normal):
        return sample_area(depth, np.reshape(np.array(normal, float), (3, 1, 1)), view)[0, 0]

    assert area(0, 0, 1) == pytest.approx(pixel, rel=FLOAT64)
    assert area(0, 0.8, 0.6) == pytest.approx(pixel / 0.6, rel=FLOAT64)
    assert area(0, 1, 1e-12) == pytest.approx(pixel / GRAZING, rel=FLOAT64)
    assert area(0, 1, 0) == 0
    assert area(0, 0, -1) == 0
    assert sample_area(np.full((1, 1), np.inf), np.zeros((3, 1, 1)), view)[0, 0] == 0

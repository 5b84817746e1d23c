"""Literal flux of light maps against closed forms: spheres, cones, and a mirror direction by hand."""

import math

import numpy as np
import pytest

from refgi.literal.light_flux import reflected_flux, solid_angle, spot_integral, spot_share, texel_sides
from refgi.rsm.raster.projection import cube_projection, view_frame
from tests.naive.radiometry import solid_angle_of_rectangle
from tests.naive.raster import perspective_density

FLOOR = {"vertices": np.array([[-9.0, 0, -9], [9, 0, -9], [0, 0, 9]]), "faces": np.array([[0, 1, 2]]),
         "material_of_face": np.array([0]), "diffuse": np.array([[0.5, 0.25, 1.0]]),
         "specular": np.array([[0.25, 0.0, 0.0]]), "exponent": np.array([20.0])}
SHAPES = {"smoothstep": 1 / 2, "squared_ramp": 1 / 3, "ramp": 1 / 2}  # means over the cosine between the cones


def test_six_faces_of_a_cube_are_a_sphere():
    angle = solid_angle(*texel_sides(np.ones(2), 6, 5, 7))
    assert angle.sum() == pytest.approx(4 * math.pi, rel=1e-14)
    x0, x1, y0, y1 = (side[1, 2] for side in texel_sides(np.ones(2), 1, 5, 7))
    assert angle[1, 2] == pytest.approx(solid_angle_of_rectangle(perspective_density, x0, x1, y0, y1))


@pytest.mark.parametrize("falloff", SHAPES)
@pytest.mark.parametrize(("inner", "outer"), [(0.3, 0.7), (0.7, 0.7), (0.0, 1.1)])
def test_a_spot_integrates_to_its_closed_form(falloff, inner, outer):
    sides = texel_sides(math.tan(outer) * np.ones(2), 1, 13, 13)
    between = math.cos(inner) - math.cos(outer)
    expected = 2 * math.pi * (1 - math.cos(inner) + SHAPES[falloff] * between)
    assert spot_integral(*sides, inner, outer, falloff).sum() == pytest.approx(expected, rel=1e-6)


def test_shares_half_way_between_the_cosines_of_a_spots_cones():
    cosine = (math.cos(0.3) + math.cos(0.8)) / 2
    assert [spot_share(cosine, 0.3, 0.8, shape) for shape in SHAPES] == pytest.approx([0.5, 0.25, 0.5])
    assert [spot_share(math.cos(a), 0.3, 0.8) for a in (0.29, 0.81)] == [1, 0]
    assert [spot_share(math.cos(a), 0.5, 0.5) for a in (0.49, 0.51)] == [1, 0]


def test_a_point_light_in_a_closed_room_leaves_all_its_power_times_albedo():
    maps = cube_projection((0.0, 1.0, 0.0), 4)
    everywhere = np.zeros((24, 4), int)
    _, flux, lobe_flux, _, exponent = reflected_flux(
        everywhere, **FLOOR, origin=maps.origin, frame=maps.frame, half=maps.half, strength=np.array([1.0, 2.0, 3.0]),
        rows=4, columns=4, parallel=False)
    assert flux.sum(axis=(1, 2)) == pytest.approx(4 * math.pi * np.array([0.5, 0.5, 3.0]))
    assert lobe_flux.sum(axis=(1, 2)) == pytest.approx([math.pi, 0, 0])
    assert (exponent == 20).all()


def test_a_directional_light_at_45_degrees_is_mirrored_by_a_floor():
    frame = view_frame((1.0, -1.0, 0.0))[None]
    area, flux, _, axis, _ = reflected_flux(
        np.array([[0, -1]]), **FLOOR, origin=np.array([[-2.0, 2, 0]]), frame=frame, half=np.array([0.5, 0.25]),
        strength=np.array([1.0, 2.0, 3.0]), rows=1, columns=2, parallel=True)
    assert area.tolist() == [[0.25, 0.25]]
    assert flux[:, 0, 0] == pytest.approx(0.25 * np.array([0.5, 0.5, 3.0]))
    assert axis[:, 0, 0] == pytest.approx(np.array([1, 1, 0]) / math.sqrt(2))
    assert not flux[:, 0, 1].any()
    assert not axis[:, 0, 1].any()

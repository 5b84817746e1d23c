"""Solid angles of texels: quadrature, closed sums, and a spot's falloff integrated over texels."""

import dataclasses
import math

import numpy as np
import pytest

from refgi.rsm.buffers.light_projection import texel_shares
from refgi.rsm.buffers.solid_angle import (
    sampled_spot_share,
    spot_power,
    spot_power_at,
    texel_solid_angles,
    texel_solid_angles_at,
)
from refgi.rsm.raster.projection import (
    cube_projection,
    directional_projection,
    dual_paraboloid_projection,
    paraboloid_projection,
    spot_projection,
)
from refgi.scene import DirectionalLight, SpotLight
from tests.naive import raster as naive
from tests.naive.radiometry import solid_angle_of_rectangle

ROUNDING = 1e-13  # sums of up to 1e5 corner differences that cancel to rounding of numbers of order 1
RIM = {1: 1e-7, 2: 1e-7, 3: 1e-8, 8: 1e-11, 17: 1e-11, 64: 1e-13}  # 8 Gauss nodes across one rim texel
RESOLVED = 16  # texels a side from which on a spot's falloff is smooth within a texel
SII_01 = 1e-6  # the evidence asked for
SIZES = (1, 2, 3, 8, 17, 64)


def spot(inner, outer):
    return SpotLight((0, 0, 0), (0.3, -1, 0.2), inner, outer, (1, 1, 1))


def edges(projection, index):
    size, half = projection.width, projection.half[0]
    return half * (2 * index / size - 1), half * (2 * (index + 1) / size - 1)


@pytest.mark.feature("REF-01")
@pytest.mark.parametrize("n", SIZES)
def test_sums_over_whole_maps(n, evidence):
    whole = {
        "cube": (cube_projection((0, 0, 0), n), 4 * math.pi),
        "dual paraboloid": (dual_paraboloid_projection((0, 0, 0), n), 4 * math.pi),
        "perspective 90": (cube_projection((0, 0, 0), n)._replace(origin=np.zeros((1, 3))), 2 * math.pi / 3),
    }
    for name, (projection, expected) in whole.items():
        angles = texel_solid_angles(projection)
        error = abs(angles.sum() / expected - 1)
        assert error < (RIM[n] if name == "dual paraboloid" else ROUNDING), name
        np.testing.assert_array_equal(texel_solid_angles_at(projection, np.arange(angles.size)), angles.ravel())
        evidence(f"n={n} {name}: {error:.0e}")
    light = DirectionalLight((0, -1, 0), (1, 1, 1))
    area = texel_solid_angles(directional_projection(light, (np.zeros(3), np.array([2.0, 1, 3])), n)).sum()
    assert area == pytest.approx(6, rel=1e-5)  # the map has a margin of 1e-6 of its diagonal


@pytest.mark.feature("REF-01")
@pytest.mark.parametrize("kind", ["perspective", "paraboloid"])
def test_each_texel_equals_quadrature_of_the_density(kind, evidence):
    if kind == "perspective":
        projection, density = spot_projection(spot(0.5, 1.2), 9), naive.perspective_density
    else:
        projection, density = paraboloid_projection([(0, 0, 0)], [(0, 0, 1)], 9), naive.paraboloid_density
    angles, worst, compared = texel_solid_angles(projection), 0.0, 0
    for row in range(9):
        for column in range(9):
            (x0, x1), (y0, y1) = edges(projection, column), edges(projection, row)
            corner = max(abs(x0), abs(x1)) ** 2 + max(abs(y0), abs(y1)) ** 2
            rim = kind == "paraboloid" and (corner > 1 or _next_to_rim(row, column))
            if not rim:
                expected = solid_angle_of_rectangle(density, x0, x1, y0, y1)
                worst = max(worst, abs(angles[row, column] / expected - 1))
                compared += 1
    assert compared >= 25
    assert worst < 1e-12
    evidence(f"{kind}: worst relative error {worst:.0e} over {compared} texels")


def _next_to_rim(row, column):
    """Whether a texel of the 9 x 9 disc may have been given part of a neighbour."""
    return max(abs(row - 4), abs(column - 4)) > 2 or abs(row - 4) + abs(column - 4) > 4


@pytest.mark.feature("REF-01")
def test_rim_texels_hold_what_lies_inside_the_disc(evidence):
    n = 64
    angles = texel_solid_angles(paraboloid_projection([(0, 0, 0)], [(0, 0, 1)], n))
    centre = (2 * np.arange(n) + 1) / n - 1
    inside = np.add.outer(centre**2, centre**2) <= 1
    assert (angles[~inside] == 0).all()
    assert (angles[inside] > 0).all()
    np.testing.assert_allclose(angles, angles.T, rtol=1e-10)
    np.testing.assert_array_equal(angles, angles[::-1])
    plain = 4 / (1 + np.add.outer(centre**2, centre**2)) ** 2 * (2 / n) ** 2
    assert angles.max() < 1.001 * plain.max()
    assert (angles / plain)[inside].max() < 2.5  # own part and at most two neighbours' corners
    evidence(f"largest share of a rim texel {(angles / plain)[inside].max():.2f} of a whole one")


@pytest.mark.feature("SII-01")
@pytest.mark.parametrize(
    ("inner", "outer"), [(0.2, 0.9), (0.0, 0.6), (0.7, 0.7), (0.3, 1.3), (0.5, 1.0), (1.5, 1.55), (1.4, 1.4)]
)
@pytest.mark.parametrize("n", SIZES)
def test_a_spots_power_is_that_of_its_cone(inner, outer, n, evidence):
    light, cosines = spot(inner, outer), (math.cos(inner), math.cos(outer))
    expected = 2 * math.pi * (1 - sum(cosines) / 2)  # the smoothstep's mean over cos a is 1/2
    half = math.tan(outer / 2)
    wide = outer > math.radians(75)  # perspective maps are not used there
    for projection in (
        *(() if wide else (spot_projection(light, n),)),
        paraboloid_projection([(0, 0, 0)], [light.direction], n, half),
    ):
        error = abs(spot_power(projection, inner, outer).sum() / expected - 1)
        assert error < (SII_01 if inner == outer or n >= RESOLVED else 3e-3)
        evidence(f"{math.degrees(outer):.0f} deg n={n}: {error:.0e}")


@pytest.mark.feature("SII-01")
@pytest.mark.parametrize("kind", ["perspective", "paraboloid"])
@pytest.mark.parametrize(("inner", "outer"), [(0.3, 0.9), (0.8, 0.8)])
def test_each_texels_spot_power_equals_a_dense_sum(kind, inner, outer):
    light, n = spot(inner, outer), 7
    if kind == "perspective":
        projection = spot_projection(light, n)
        functions = naive.perspective_cosine, naive.perspective_density
    else:
        projection = paraboloid_projection([(0, 0, 0)], [light.direction], n, math.tan(outer / 2))
        functions = naive.paraboloid_cosine, naive.paraboloid_density
    power = spot_power(projection, inner, outer)
    dense = 2e-3 if inner == outer else 2e-5  # error of the midpoint sum at a hard and a soft edge
    for row, column in ((3, 3), (3, 6), (0, 3), (0, 0), (5, 5), (1, 2), (6, 5)):
        box = (*edges(projection, column), *edges(projection, row))
        expected = naive.spot_texel(*functions, *box, inner, outer, n=120)
        assert power[row, column] == pytest.approx(expected, rel=dense, abs=dense * power.max())


@pytest.mark.feature("SII-02")
def test_sampled_share_tends_to_the_exact_one():
    light, n, angles = spot(0.3, 0.9), 128, (0.3, 0.9)
    projection = spot_projection(light, n)
    axis = np.asarray(light.direction) / np.linalg.norm(light.direction)
    sampled = sampled_spot_share(projection, axis, *angles) * texel_solid_angles(projection)
    exact = spot_power(projection, *angles)
    assert np.abs(sampled - exact).max() < 1e-3 * exact.max()
    assert sampled.sum() == pytest.approx(exact.sum(), rel=1e-5)


@pytest.mark.feature("SII-01")
@pytest.mark.parametrize("falloff", ["smoothstep", "squared_ramp", "ramp"])
@pytest.mark.parametrize("n", [1, 2, 9, 16])
@pytest.mark.parametrize("half", [math.radians(40), math.radians(85)])
def test_power_of_some_texels_is_that_of_the_whole_map(n, half, falloff):
    light = dataclasses.replace(spot(half / 2, half), falloff=falloff)
    maps = spot_projection(light, n) if half < 1 else paraboloid_projection([(0, 0, 0)], [light.direction], n)
    angles = light.inner_half_angle, light.outer_half_angle
    texel, whole = np.arange(n * n)[::-1], spot_power(maps, *angles, falloff)
    np.testing.assert_array_equal(spot_power_at(maps, *angles, texel, falloff), whole.reshape(-1)[texel])
    np.testing.assert_array_equal(texel_shares(light, maps), whole)
    np.testing.assert_array_equal(texel_shares(light, maps, texel=texel), whole.reshape(-1)[texel])


@pytest.mark.feature("SII-01")
@pytest.mark.parametrize("n", [1, 2, 3, 5, 8])
@pytest.mark.parametrize(("inner", "outer"), [(0.4, 0.8), (0.1, 1.2), (0.0, 1.3), (0.02, 0.03)])
def test_coarse_maps_hold_a_spots_power(inner, outer, n):
    """Texels as large as the cone: 2 pi (1 - (cos inner + cos outer) / 2), summed."""
    light = spot(inner, outer)
    flat = spot_projection(light, n)
    round_ = paraboloid_projection([(0, 0, 0)], [light.direction], n, math.tan(outer / 2))
    for maps in (flat, round_):
        assert spot_power(maps, inner, outer).sum() == pytest.approx(
            2 * math.pi * (1 - (math.cos(inner) + math.cos(outer)) / 2), rel=2e-8)

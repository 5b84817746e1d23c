"""Bounds of the significant region: closed forms of the appendix, proofs as properties, meshes, quads, lists."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from refgi.errors import InputError
from refgi.pairs.ranged_sum import LANES, reached
from refgi.pairs.tiles import block_by_block
from refgi.rsm.raster.projection import camera_projection, cube_projection
from refgi.scene import Camera
from refgi.splat.sii.bounds import (
    Ellipsoid,
    appendix_ellipsoid,
    covered_pixels,
    half_ball_radius,
    inflation,
    light_solids,
    screen_quads,
    sphere_mesh,
    tangent_ellipsoid,
    tiles_of_quads,
)
from refgi.splat.sii.lists import list_lights, pack_solids
from tests.naive import bounds as naive
from tests.pairs import sets

TOUCH = 1e-12  # curves touch: F^2 and e^2 are equal there but for rounding
PRINTED = 0.5e-3  # tables give three digits
SHARE = 0.2e-2  # shares are given to 0.1 %, and the grid of the quadrature leaves as much
NEAR_A_FACE = 1e-4  # m: nearer than float32 depth and its slack tell
VIEW = camera_projection(Camera((0.1, 0.2, 2.0), (0.0, 0.0, 0.0), vfov=math.radians(55), width=96, height=80))


def significant_radius(x, exponent):
    """F(x) = x^(n / (n + 2)) sqrt(1 - x^(4 / (n + 2))), the radius of the significant region in R_0 (SII Eq. 7)."""
    x, n = np.asarray(x, np.float64), np.asarray(exponent, np.float64)
    # Eq. (7)
    return x ** (n / (n + 2)) * np.sqrt(np.maximum(0, 1 - x ** (4 / (n + 2))))


def waste(ellipsoid, exponent):
    """Volume of an ellipsoid over that of the significant region it encloses."""
    n = np.asarray(exponent, np.float64)
    region = math.pi * ((n + 2) / (3 * n + 2) - 1 / 3)
    return 4 / 3 * math.pi * ellipsoid.half_width * ellipsoid.height**2 / region


def in_ellipsoid(ellipsoid, x, rho):
    """Whether an ellipsoid holds points: ((x - c) / w)^2 + (rho / h)^2 <= 1 (procedure P3)."""
    along = (np.asarray(x) - ellipsoid.center) / ellipsoid.half_width
    return along**2 + (np.asarray(rho) / ellipsoid.height) ** 2 <= 1


def ellipse_square(ellipsoid, x):
    return ellipsoid.height**2 * (1 - ((x - ellipsoid.center) / ellipsoid.half_width) ** 2)


@pytest.mark.feature("SII-19")
def test_ellipsoid_has_the_numbers_of_the_appendix(evidence):
    n = np.array([1, 2, 10, 1e9])
    center, half_width, height = appendix_ellipsoid(n)
    np.testing.assert_allclose(center, [0.438691, 0.5, 0.578704, math.exp(-0.5)], atol=1e-6)  # E-SII-12
    np.testing.assert_allclose(height[:3], significant_radius(center[:3], n[:3]), rtol=1e-12)
    np.testing.assert_array_equal(half_width, np.maximum(center, 1 - center))
    share = n / (n + 2)
    np.testing.assert_allclose(height[:3], (share ** (n / 4) * np.sqrt(2 / (n + 2)))[:3], rtol=1e-12)
    x = np.linspace(0, 1, 100001)
    for one in (0.3, 1.0, 5.0, 77.0):  # Eq. 8: where F is largest
        assert abs(x[np.argmax(significant_radius(x, one))] - appendix_ellipsoid(one).center) < 2e-5
    of = np.array([1, 2, 10, 100, 1000])
    table = waste(appendix_ellipsoid(of), of)
    np.testing.assert_allclose(table, [1.080, 1.000, 1.240, 1.328, 1.338], atol=PRINTED)
    evidence("c(1), c(2), c(10), c(inf) = " + ", ".join(f"{c:.6f}" for c in center)
             + "; waste n = 1, 2, 10, 100, 1000: " + ", ".join(f"{w:.3f}" for w in table))


@pytest.mark.feature("SII-19")
def test_region_of_the_appendix_is_that_of_the_polar_function():
    """Eq. 7 in x and y against r^2 = cos^n in polar coordinates."""
    angle = np.linspace(0.01, 1.5, 200)
    for n in (0.5, 1, 2, 10, 300):
        r = np.cos(angle) ** (n / 2)
        np.testing.assert_allclose(significant_radius(r * np.cos(angle), n), r * np.sin(angle), rtol=1e-9, atol=1e-15)


@pytest.mark.feature("SII-19")
def test_volume_of_the_region():
    """The waste's denominator, by quadrature of pi F^2."""
    x, w = np.polynomial.legendre.leggauss(400)
    for n in (1, 10, 100):
        u = 0.5 * (x + 1)  # cos alpha; x = u^((n + 2) / 2) takes the root out of F
        along = u ** ((n + 2) / 2)
        volume = (0.5 * w * math.pi * significant_radius(along, n) ** 2 * (n + 2) / 2 * u ** (n / 2)).sum()
        ball = Ellipsoid(np.array(0.0), np.array(1.0), np.array(1.0))
        np.testing.assert_allclose(waste(ball, n), 4 / 3 * math.pi / volume, rtol=1e-6)


@settings(max_examples=300)
@given(exponent=st.floats(1e-3, 1000), where=st.floats(0, 1))
@example(exponent=1.0, where=0.438691)
@example(exponent=2.0, where=0.5)
@pytest.mark.feature("SII-19", "REF-14")
def test_ellipsoids_enclose_the_region_for_every_exponent(exponent, where):
    x = np.unique(np.concatenate([np.linspace(0, 1, 2001), 10.0 ** np.linspace(-30, 0, 500), [where]]))
    square = significant_radius(x, exponent) ** 2
    assert (square - ellipse_square(appendix_ellipsoid(exponent), x)).max() < TOUCH
    for x0 in (0.5, 0.7, 0.71, 0.72, 0.95):
        assert (square - ellipse_square(tangent_ellipsoid(exponent, x0), x)).max() < TOUCH


@pytest.mark.feature("REF-14")
def test_tangent_ellipsoids_waste_less(evidence):
    n = np.array([10, 100])
    for x0 in (0.70, 0.71, 0.72):
        assert waste(tangent_ellipsoid(n, x0), n) == pytest.approx([1.169, 1.233], abs=2e-3)  # E-SII-13, any of these
    table = waste(tangent_ellipsoid(n), n)
    of = np.geomspace(2, 1e6, 200)
    assert (waste(tangent_ellipsoid(of), of) <= waste(appendix_ellipsoid(of), of) * (1 + 1e-9)).all()
    assert tangent_ellipsoid(1.0) == appendix_ellipsoid(1.0)
    center, half_width, height = tangent_ellipsoid(20.0)
    assert center == half_width  # through the light itself
    touch = ellipse_square(tangent_ellipsoid(20.0), 0.71) - significant_radius(0.71, 20.0) ** 2
    assert abs(touch) < TOUCH
    assert height < half_width
    evidence(f"waste n = 10, 100: {table[0]:.3f}, {table[1]:.3f} (appendix 1.240, 1.328)")


def test_membership_of_an_ellipsoid():
    bound = appendix_ellipsoid(1.0)
    assert in_ellipsoid(bound, bound.center + bound.half_width * (1 - 1e-9), 0.0)
    assert not in_ellipsoid(bound, bound.center, bound.height * 1.001)


@pytest.mark.feature("REF-14")
def test_half_ball_holds_what_widening_adds(evidence):
    """Share of the integral of B dV outside the ellipsoid of P, and nothing outside of its union with the half ball."""
    r, u = (np.arange(1500) + 0.5) / 1500, (np.arange(1500) + 0.5) / 1500
    r, u = r[:, None], u[None, :]
    printed = {10: (0.004, 0.039, 0.178), 100: (0.004, 0.058, 0.232)}  # E-SII-14
    found = []
    for exponent, shares in printed.items():
        for a, expected in zip((0.25, 0.5, 1.0), shares, strict=True):
            inside = naive.widened_region(r, u, exponent, a)
            flow = np.where(inside, u ** (exponent * np.minimum(1, r / a)), 0)  # B r^2
            x, rho = r * u, r * np.sqrt(1 - u * u)
            left = ~in_ellipsoid(appendix_ellipsoid(exponent), x, rho)
            share = (flow * left).sum() / flow.sum()
            assert share == pytest.approx(expected, abs=SHARE)
            found.append(f"{share:.1%}")
            ball = r <= half_ball_radius(np.array(1.0), a)
            for bound in (appendix_ellipsoid, tangent_ellipsoid):
                assert not (inside & ~in_ellipsoid(bound(exponent), x, rho) & ~ball).any()
    assert half_ball_radius(np.array(4.0), 3.0) == 2
    assert half_ball_radius(np.array(4.0), 0.5, literal=True) == 2
    evidence("outside without the half ball, P = 10 and 100, a / R_0 = 1/4, 1/2, 1: " + ", ".join(found) + "; with: 0")


@pytest.mark.feature("SII-20", "REF-14")
def test_meshes_need_these_factors(evidence):
    factors = []
    for faces, expected in ((8, 1.7321), (20, 1.2584), (80, 1.0705), (320, 1.0181), (1280, 1.0045)):
        vertices, triangles = sphere_mesh(faces)
        assert len(triangles) == faces
        assert len(vertices) == faces // 2 + 2  # Euler: closed
        np.testing.assert_allclose(np.linalg.norm(vertices, axis=1), 1, rtol=1e-12)
        factors.append(inflation(vertices, triangles))
        assert factors[-1] == pytest.approx(expected, abs=0.6e-4)
    evidence("8, 20, 80, 320, 1280 faces: " + ", ".join(f"{factor:.4f}" for factor in factors))


def scattered(rng, count=14):
    place = rng.uniform(-0.8, 0.8, (3, count))
    return place, sets.random_directions(rng, count), rng.uniform(0.02, 1.5, count)


@pytest.mark.parametrize("exponent", [1.0, 30.0])
@pytest.mark.feature("SII-20")
def test_inflated_meshes_miss_no_pixel(exponent, evidence):
    """Receivers along each pixel's line of sight against the drawing of the mesh."""
    rng = np.random.default_rng(3)
    place, axis, square = scattered(rng)
    solids = light_solids(place, axis, np.full(len(square), exponent), square, "tangent")
    ahead = pixel_rays(VIEW)
    missed = {(faces, grown): 0 for faces in (8, 20, 80) for grown in (True, False)}
    for k in range(len(square)):
        needed = np.zeros(VIEW.shape, bool)
        for depth in np.linspace(0.05, 4, 240):
            d = VIEW.origin[0][:, None, None] + depth * ahead - place[:, k, None, None]
            r = np.sqrt((d**2).sum(axis=0))
            cosine = np.maximum(0, np.einsum("c,chw->hw", axis[:, k], d) / r)
            needed |= (cosine > 0) & (square[k] * cosine**exponent >= r**2)
        for faces, grown in missed:
            missed[faces, grown] += np.count_nonzero(needed & ~covered_pixels(VIEW, solids, k, faces, grown))
    assert all((count == 0) == grown for (_, grown), count in missed.items())
    evidence(f"n = {exponent:g}: 0 pixels missed with inflation; without "
             + ", ".join(f"{missed[faces, False]} ({faces} faces)" for faces in (8, 20, 80)))


@pytest.mark.parametrize("exponent", [1.0, 30.0])
@pytest.mark.feature("SII-30")
def test_the_depth_test_leaves_what_lies_in_the_mesh(exponent, evidence):
    """The drawing's nearest and farthest depth against the planes of the mesh's faces, surfaces at any depth."""
    rng = np.random.default_rng(4)
    place, axis, square = scattered(rng)
    place[:, 0] = VIEW.origin[0]  # its meshes hold the eye
    solids = light_solids(place, axis, np.full(len(square), exponent), square, False, 0.2)
    depth = rng.uniform(0.05, 3, VIEW.shape)
    seen = (VIEW.origin[0][:, None, None] + depth * pixel_rays(VIEW)).reshape(3, -1)
    kept = drawn = 0
    for k, faces in itertools.product(range(len(square)), (8, 80)):
        radius = math.sqrt(square[k])
        bodies = naive.bodies(place[:, k], axis[:, k], exponent, radius, min(radius, 0.2), faces)
        outside = np.min([out_of(body.reshape(-1, 3, 3), seen) for body in bodies], axis=0).reshape(VIEW.shape)
        covered, left = (covered_pixels(VIEW, solids, k, faces, False, given) for given in (None, 1 / depth))
        sure = np.abs(outside) > NEAR_A_FACE
        assert not (left & ~covered).any()
        np.testing.assert_array_equal(left[sure], outside[sure] < 0)
        kept, drawn = kept + left.sum(), drawn + covered.sum()
    assert kept < drawn / 2
    evidence(f"n = {exponent:g}: {kept:,} of {drawn:,} fragments pass, those whose surface lies in the mesh")


def out_of(triangles, points):
    """Return how far points (3, n) lie out of a convex mesh (m, 3 corners, 3), m; below 0: within it."""
    a, b, c = triangles.transpose(1, 0, 2)
    normal = sets.unit(np.cross(b - a, c - a).T).T
    normal *= np.sign((normal * (a - triangles.mean(axis=(0, 1)))).sum(axis=1))[:, None]
    return (normal @ points - (normal * a).sum(axis=1)[:, None]).max(axis=0)


def pixel_rays(view):
    row, column = np.mgrid[: view.height, : view.width] + 0.5
    across = (2 * column / view.width - 1) * view.half[0], (2 * row / view.height - 1) * view.half[1]
    return np.einsum("ihw,ij->jhw", np.stack([*across, np.ones_like(row)]), view.frame[0])


@pytest.mark.feature("SII-20")
def test_a_mesh_around_the_eye_covers_everything():
    solids = light_solids(VIEW.origin.T.copy(), np.array([[0.0], [0], [1]]), np.ones(1), np.array([1e-4]), "ellipsoid")
    assert covered_pixels(VIEW, solids, 0, 20, True).all()


@pytest.mark.feature("REF-14", "SII-18")
@settings(max_examples=60)
@given(seed=st.integers(0, 2**16), size=st.sampled_from([0.01, 0.3, 3.0]))
def test_quads_hold_their_balls(seed, size):
    """Points of balls anywhere around the eye project into the quad, and its sides touch the ball."""
    rng = np.random.default_rng(seed)
    center, radius = rng.uniform(-3, 3, (3, 40)) + VIEW.origin[0][:, None], size * rng.uniform(0.1, 1, 40)
    top, bottom, left, right = screen_quads(VIEW, center, radius)
    points = center[:, :, None] + radius[:, None] * sets.random_directions(rng, 300)[:, None, :]
    x, y, z = np.einsum("ij,jkl->ikl", VIEW.frame[0], points - VIEW.origin[0][:, None, None])
    seen = z > 1e-6
    with np.errstate(divide="ignore", invalid="ignore"):
        row, column = (y / z / VIEW.half[1] + 1) * VIEW.height / 2, (x / z / VIEW.half[0] + 1) * VIEW.width / 2
    slack = 1e-6 * (1 + np.abs(row) + np.abs(column))
    assert ((row >= top[:, None] - slack) & (row <= bottom[:, None] + slack))[seen].all()
    assert ((column >= left[:, None] - slack) & (column <= right[:, None] + slack))[seen].all()
    eye_inside = np.linalg.norm(center - VIEW.origin[0][:, None], axis=0) < radius
    assert np.isinf(top[eye_inside]).all()


@pytest.mark.feature("SII-18")
def test_quad_of_a_ball_ahead_is_its_tangents():
    eye = VIEW.origin[0] + 2.0 * VIEW.frame[0, 2]
    top, bottom, left, right = screen_quads(VIEW, eye[:, None], np.array([1.0]))[:, 0]
    half = math.tan(math.asin(0.5))
    assert (left, right) == pytest.approx(((1 - half / VIEW.half[0]) * 48, (1 + half / VIEW.half[0]) * 48))
    assert (top, bottom) == pytest.approx(((1 - half / VIEW.half[1]) * 40, (1 + half / VIEW.half[1]) * 40))
    behind = screen_quads(VIEW, (VIEW.origin[0] - 2 * VIEW.frame[0, 2])[:, None], np.array([1.0]))[:, 0]
    assert behind[0] > behind[1]
    with pytest.raises(InputError, match="projection: expected one perspective map"):
        screen_quads(cube_projection((0, 0, 0), 8), eye[:, None], np.ones(1))


@pytest.mark.feature("REF-14")
def test_tiles_meet_the_quads_that_hold_their_pixels():
    """Tiles of a picture in the kernels' order against each pixel's centre in each rectangle."""
    rng = np.random.default_rng(6)
    places = block_by_block(rng.random((40, 56)) < 0.9)
    top, left = rng.uniform(-10, 50, (2, 80))
    quads = np.stack([top, top + rng.uniform(0, 9, 80), left, left + rng.uniform(0, 9, 80)])
    row, column = places // 56 + 0.5, places % 56 + 0.5
    for tile, listed in enumerate(tiles_of_quads(quads, places, 56)):
        y, x = row[tile * LANES : (tile + 1) * LANES, None], column[tile * LANES : (tile + 1) * LANES, None]
        held = ((y >= quads[0]) & (y <= quads[1]) & (x >= quads[2]) & (x <= quads[3])).any(axis=0)
        assert not (held & ~listed).any()
        near = (y.max() >= quads[0] - 0.1) & (y.min() <= quads[1] + 0.1)
        near &= (x.max() >= quads[2] - 0.1) & (x.min() <= quads[3] + 0.1)
        assert not (listed & ~near).any()


@settings(max_examples=30)
@given(seed=st.integers(0, 2**16), spread=st.sampled_from([1e-3, 0.05, 1.0]), far=st.sampled_from([0.0, 1e3]),
       kind=st.sampled_from(["ellipsoid", "tangent"]), nearest=st.booleans())
@pytest.mark.feature("REF-14")
def test_no_light_that_counts_is_left_out_of_a_list(seed, spread, far, kind, nearest):
    """Single tiles of float32 receivers against the kernel's own test of the pair, at any place and size."""
    rng = np.random.default_rng(seed)
    scale = 10.0 ** rng.uniform(-4, 4)
    middle = scale * (rng.normal(size=(3, 1)) + far)
    place = (middle + scale * spread * rng.normal(size=(3, LANES))).astype(np.float32)
    normal = np.zeros((3, LANES), np.float32)  # face nowhere: nothing lies behind
    lights = (middle + scale * rng.normal(size=(3, 200))).astype(np.float32)
    facing = sets.random_directions(rng, 200).astype(np.float32)
    square = (scale * rng.uniform(0.05, 3, 200)).astype(np.float32) ** 2
    solids = light_solids(lights, facing, np.ones(200), square, kind)
    listed = list_lights(place, normal, pack_solids(solids, -facing, nearest=nearest))[0]
    for k in np.flatnonzero(~listed):
        for lane in range(0, LANES, 7):
            assert not reached(*(lights[:, k] - place[:, lane]), *-facing[:, k], square[k])
    if spread == 1e-3 and far == 0:
        assert listed.mean() < 0.8


@pytest.mark.feature("REF-14")
@pytest.mark.parametrize("count", [LANES, 4096 + 3 * 256 + 70, 2 * 4096])
def test_lists_of_many_tiles_are_those_of_each_tile_alone(count):
    """Strips that are tested first leave out no light that counts, and no list is longer than its tile's own."""
    rng = np.random.default_rng(5)
    place = np.stack([0.02 * np.arange(count), *rng.uniform(-0.3, 0.3, (2, count))]).astype(np.float32)
    normal = np.broadcast_to(np.array([[0.0], [0.0], [1.0]], np.float32), place.shape).copy()
    lights = rng.uniform([[-5], [-2], [-1]], [[0.02 * count + 5], [2], [2]], (3, 300)).astype(np.float32)
    facing = sets.random_directions(rng, 300).astype(np.float32)
    square = rng.uniform(0.05, 9, 300).astype(np.float32) ** 2
    packed = pack_solids(light_solids(lights, facing, np.ones(300), square, True), -facing, nearest=True)
    listed = list_lights(place, normal, packed)
    assert listed.shape == (-(-count // LANES), 300)
    for tile, found in enumerate(listed):
        part = slice(tile * LANES, (tile + 1) * LANES)
        here, up = np.ascontiguousarray(place[:, part]), np.ascontiguousarray(normal[:, part])
        alone = list_lights(here, up, packed)[0]
        assert not (found & ~alone).any()
        for k in np.flatnonzero(alone & ~found):
            for lane in range(here.shape[1]):
                assert not reached(*(lights[:, k] - here[:, lane]), *-facing[:, k], square[k])
        assert found.sum() >= 0.9 * alone.sum() - 1
    assert 0.01 < listed.mean() < 0.9

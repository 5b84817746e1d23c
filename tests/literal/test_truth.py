"""Analytic tests of the literal path tracer: closed forms of what a spot, a lit rectangle and a sphere send back."""

import math

import numpy as np
import pytest

from refgi.literal.truth import cosine_direction, path_traced, reflected
from tests.form_factors import polygon_form_factor

SIGMAS = 4.0  # the cases are few and their numbers fixed
PRECISE = 0.01  # of a value: the standard error must be less
SUN, LAMP = np.array([3.0, 2.0, 1.0]), np.array([1.0, 2.0, 0.5])
DOWN = np.array([0.0, -1.0, 0.0])


def rectangle(corner, along, across):
    corner, along, across = (np.array(one, float) for one in (corner, along, across))
    return [np.stack([corner, corner + along, corner + along + across]),
            np.stack([corner, corner + along + across, corner + across])]


def floor(half=50.0, height=0.0):
    return rectangle((-half, height, half), (2 * half, 0, 0), (0, 0, -2 * half))


def mesh_of(triangles, materials=None, normals=None):
    vertices = np.concatenate(triangles)
    return (vertices, np.arange(len(vertices)).reshape(-1, 3), np.zeros(len(triangles), int) if materials is None
            else np.array(materials), normals)


def of(diffuse, specular=0.0, exponent=1.0):
    return np.full((1, 3), diffuse), np.full((1, 3), specular), np.array([exponent])


def lamp(kind, strength, place=(0.0, 0.0, 0.0), direction=DOWN, half_angles=(0.0, 0.0)):
    return tuple(np.array([one], float) for one in (place, direction, strength, half_angles)), (kind,)


def traced(point, normal, mesh, materials, lights, bounces=1, side=48, triangle=0, **more):
    """Return E (3,) and its standard error, of pairs of random numbers in cells of the unit square."""
    random = np.random.default_rng(5).random((bounces, 2, 2 * side**2, 1, 1))
    cell = np.mgrid[:side, :side].reshape(2, -1).repeat(2, axis=1)
    random[0] = (cell[..., None, None] + random[0]) / side
    x, n = (np.reshape(np.array(one, float), (3, 1, 1)) for one in (point, normal))
    mean, variance, samples = path_traced(x, n, np.full((1, 1), triangle), random, mesh, materials, *lights, **more)
    assert samples.item() == (2 * side**2 if triangle >= 0 else 0)
    return mean.ravel(), np.sqrt(variance.ravel())


def expect(found, expected):
    mean, error = found
    assert (error < PRECISE * np.abs(expected)).all()
    assert (np.abs(mean - expected) < SIGMAS * error + 1e-4 * np.abs(expected)).all(), (mean, expected, error)


def test_a_spot_over_a_plane():
    """L = rho I cos^3 / (pi h^2) under the angle theta, up to c: E = 0.4 rho I (1 - cos^5 c) / h^2 at the lamp."""
    c, h, rho = math.radians(40), 0.7, 0.6
    lights = lamp("ramp", LAMP, (0, h, 0), half_angles=(c, c))
    expect(traced((0, h, 0), DOWN, mesh_of(floor()), of(rho), lights), 0.4 * rho * LAMP / h**2 * (1 - math.cos(c)**5))


@pytest.mark.parametrize(("falloff", "power"), [("ramp", 1), ("squared_ramp", 2)])
def test_a_spot_s_falloff(falloff, power):
    """Share t^power with t = (mu - cos c) / (1 - cos c) of an inner cone of 0: the integral of 2 rho I mu^4 t^power."""
    c, h, rho = math.radians(50), 0.7, 0.6
    mu = np.linspace(math.cos(c), 1, 20001)
    share = ((mu - math.cos(c)) / (1 - math.cos(c))) ** power
    expected = 2 * rho * LAMP / h**2 * np.trapezoid(mu**4 * share, mu)
    lights = lamp(falloff, LAMP, (0, h, 0), half_angles=(0, c))
    expect(traced((0, h, 0), DOWN, mesh_of(floor()), of(rho), lights), expected)


PLATE = rectangle((0, 0, 0), (1, 0, 0), (0, 0, -1.5))
CORNERS = [(0, 0, 0), (1, 0, 0), (1, 0, -1.5), (0, 0, -1.5)]
SLANTED = np.array([0.2, -1.0, 0.1])  # the sun's direction, not of unit length


@pytest.mark.parametrize("wound", [1, -1])
@pytest.mark.parametrize(("point", "normal"), [((0.5, 0.8, -0.7), (0, -1, 0)), ((-0.3, 0.4, -0.5), (1, 0, 0))])
def test_a_lit_rectangle_gives_its_form_factor_on_the_lit_side_alone(point, normal, wound):
    """Surfaces reflect on both sides, however they are wound, but not what arrives on the other."""
    plate = [one[::wound] for one in PLATE]
    across = (1, 0, 0) if normal[1] else (0, 1, 0)
    speck = [point + 1e-4 * np.array([(0, 0, 0), across, (0, 0, 1)])]  # the receiver's own face
    mesh, lights = mesh_of([*speck, *plate]), lamp("directional", SUN, direction=SLANTED)
    lit = SUN / np.linalg.norm(SLANTED)
    expect(traced(point, normal, mesh, of(0.6), lights), 0.6 * lit * polygon_form_factor(point, normal, CORNERS))
    mirrored = np.multiply(point, (1, -1, 1)), np.multiply(normal, (1, -1, 1))
    below = mesh_of([one * (1, -1, 1) for one in speck] + plate)
    mean, _ = traced(*mirrored, below, of(0.6), lights)
    assert not mean.any()


def test_a_lobe_of_unit_reflectance_sends_all_of_the_flux():
    """Over a wide floor under a vertical sun: L = rho E0 (P + 1) / (2 pi) cos^(P-1), whose integral is rho E0."""
    lights, height = lamp("directional", SUN), 0.5
    expect(traced((0, height, 0), DOWN, mesh_of(floor()), of(0.0, 0.7, 12.0), lights), 0.7 * SUN)
    both = traced((0, height, 0), DOWN, mesh_of(floor()), of(0.2, 0.7, 12.0), lights)
    expect(both, 0.9 * SUN)


def sphere(cuts=3):
    """Return triangles of an octahedron that is cut in four and pushed out to the unit sphere."""
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    found = [axes[[a, b, c]] for a in (0, 3) for b in (1, 4) for c in (2, 5)]
    for _ in range(cuts):
        parts = []
        for p, q, r in found:
            pq, qr, rp = ((a + b) / np.linalg.norm(a + b) for a, b in ((p, q), (q, r), (r, p)))
            parts += [np.array(one) for one in ((p, pq, rp), (pq, q, qr), (rp, qr, r), (pq, qr, rp))]
        found = parts
    return found


@pytest.mark.parametrize("bounces", [1, 2])
def test_a_lamp_in_a_sphere(bounces):
    """E = rho I / R^2 everywhere, then rho^2: faces of a polyhedron lie between the radii r and 1, so E does as well.

    The irradiance of a face is I cos / d^2, with d from r to 1 and cos from r to 1.
    """
    triangles, rho = sphere(), 0.5
    middle = triangles[7].mean(axis=0)
    r = min(np.linalg.det(one) / np.linalg.norm(np.cross(one[1] - one[0], one[2] - one[0])) for one in map(
        lambda one: one if np.linalg.det(one) > 0 else one[::-1], triangles))
    mean, error = traced(middle, -middle / np.linalg.norm(middle), mesh_of(triangles), of(rho), lamp("point", LAMP),
                         bounces, side=24, triangle=7)
    series = sum(rho**k for k in range(1, bounces + 1))
    assert r > 0.95
    assert (error < PRECISE * LAMP).all()
    assert (mean > series * LAMP * r - SIGMAS * error).all()
    assert (mean < series * LAMP / r**2 + SIGMAS * error).all()


def test_what_blocks_and_what_a_camera_sees():
    """A black plate below the receiver hides the floor; a camera from above sees |x| < 1, |z| < 2 of it."""
    plate = rectangle((-30, 0.3, 30), (60, 0, 0), (0, 0, -60))
    materials = np.array([[0.6] * 3, [0.0] * 3]), np.zeros((2, 3)), np.ones(2)
    mesh = mesh_of([*floor(), *plate], [0, 0, 1, 1])
    point, low = (0.2, 0.8, 0.1), lamp("point", LAMP, (0.2, 0.2, 0.1))  # the lamp lies under the plate
    assert not traced(point, DOWN, mesh, materials, low)[0].any()
    # rings of radius s on the floor: L = rho/pi I a / (s^2 + a^2)^(3/2), seen under cos cos / r^2 = b^2 / (s^2 + b^2)^2
    s = np.linspace(0, 50, 400001)
    L = 0.6 / math.pi * 0.2 / (s**2 + 0.2**2) ** 1.5
    expected = LAMP * np.trapezoid(L * 2 * math.pi * s * 0.8**2 / (s**2 + 0.8**2) ** 2, s)
    expect(traced(point, DOWN, mesh, materials, low, blocked=False), expected)
    axes = np.array([[[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]])
    camera = np.array([[0.0, 4, 0]]), axes, np.array([0.25, 0.5])
    found = traced(point, DOWN, mesh_of(floor()), of(0.6), lamp("directional", SUN), camera=camera)
    expect(found, 0.6 * SUN * polygon_form_factor(point, DOWN, [(-1, 0, 2), (1, 0, 2), (1, 0, -2), (-1, 0, -2)]))
    roof = mesh_of([*floor(), *[np.add(one, (0, 2.7, 0)) for one in plate]], [0, 0, 1, 1])  # hides all else
    assert traced(point, DOWN, roof, materials, low)[0].all()
    assert not traced(point, DOWN, roof, materials, low, camera=camera)[0].any()
    up = camera[0], axes * np.array([1, 1, -1])[:, None], camera[2]
    assert not traced(point, DOWN, mesh_of(floor()), of(0.6), lamp("directional", SUN), camera=up)[0].any()


def test_the_first_surface_counts_whichever_is_listed_first():
    plate = rectangle((-30, 0.3, 30), (60, 0, 0), (0, 0, -60))
    materials = np.array([[0.6] * 3, [0.0] * 3]), np.zeros((2, 3)), np.ones(2)
    found = traced((0.2, 0.8, 0.1), DOWN, mesh_of([*plate, *floor()], [0, 0, 1, 1]), materials,
                   lamp("directional", SUN), triangle=2)
    expect(found, 0.6 * SUN)


TILT = math.radians(50)
TILTED = np.array([math.sin(TILT), math.cos(TILT), 0.0])  # a normal of vertices, its face's is y


def test_interpolated_normals_turn_the_pattern_and_leave_the_flux():
    """L = rho/pi E0 <m.w> / <f.w>, whose integral over f's hemisphere is rho E0 (1 + cos tilt) / 2."""
    mesh = mesh_of(floor(), normals=np.tile(TILTED, (6, 1)))
    expect(traced((0, 0.5, 0), DOWN, mesh, of(0.6), lamp("directional", SUN), side=64),
           0.6 * SUN * (1 + math.cos(TILT)) / 2)


def test_what_arrives_by_a_bounce_arrives_at_the_face():
    """A ceiling that a sun from below lights shines on a small plate from all sides; its light alone is seen."""
    plate, ceiling = floor(1.0), floor(1e4, 100.0)
    normals = np.concatenate([np.tile(TILTED, (6, 1)), np.tile(DOWN, (6, 1))])
    mesh, up = mesh_of([*plate, *ceiling], normals=normals), lamp("directional", SUN, direction=-DOWN)
    assert not traced((0, 0.01, 0), DOWN, mesh, of(0.6), up)[0].any()
    expect(traced((0, 0.01, 0), DOWN, mesh, of(0.6), up, bounces=2, side=64),
           0.36 * SUN * (1 + math.cos(TILT)) / 2)


def test_a_receiver_s_face_hides_what_lies_below_it():
    """A vertical face with a normal that looks down sees half of the floor."""
    speck = [np.array([[0, 1, 0], [0, 1, 1e-4], [0, 1 + 1e-4, 0]])]
    tilted = np.array([1e-6, -1.0, 0.0])  # the face's side is that of the normal
    expect(traced((0, 1, 0), tilted, mesh_of([*speck, *floor()]), of(0.6), lamp("directional", SUN)), 0.3 * SUN)


@pytest.mark.parametrize(("exponent", "share"), [(0.0, lambda c: 1 - math.acos(c) / math.pi), (
    1.0, lambda c: (1 + c) / 2)])
def test_a_lobe_lies_about_the_mirrored_direction_of_the_interpolated_normal(exponent, share):
    """L per irradiance: rho_s (P + 1) / (2 pi K) <r.v>^P / <f.v>, K in closed form for P = 0 and 1; E-SII-03."""
    m, w, f = TILTED, np.array([math.cos(0.1), math.sin(0.1), 0.0]), -DOWN
    seen, below, away = np.array([[0.28, 0.96, 0.0], [-0.8, 0.6, 0.0], [-0.995, 0.0999, 0.0]])
    r = 2 * (m @ w) * m - w
    assert (m @ seen > 0, m @ below < 0, r @ below > 0, r @ away < 0) == (True,) * 4
    for v, counts in ((seen, 1.0), (below, 0.0), (away, 0.0)):
        args = (np.reshape(one, (3, 1, 1)) for one in (w, v, m, f, np.zeros(3), np.full(3, 0.7)))
        expected = counts * 0.7 * (exponent + 1) / (2 * math.pi * share(m @ r)) * max(0, r @ v) ** exponent / (f @ v)
        np.testing.assert_allclose(reflected(*args, np.full((1, 1), exponent)).ravel(), expected, rtol=1e-5)


def test_directions_have_the_density_cos_over_pi():
    """The mean of w is 2/3 n, that of w w^T is 1/4 across and 1/2 along: of a grid's centres to its error."""
    u, v = ((np.mgrid[:64, :64] + 0.5) / 64).reshape(2, 1, -1)
    n = np.array([0.48, -0.6, 0.64]).reshape(3, 1, 1) + np.zeros((3, 1, u.size))
    w = cosine_direction(n, u, v)[:, 0]
    np.testing.assert_allclose((w**2).sum(axis=0), 1)
    np.testing.assert_allclose(w.mean(axis=1), 2 / 3 * n[:, 0, 0], atol=2e-4)
    np.testing.assert_allclose(w @ w.T / u.size, np.eye(3) / 4 + np.outer(n[:, 0, 0], n[:, 0, 0]) / 4, atol=2e-4)


def test_no_surface_has_no_light_and_no_sample():
    mean, error = traced((0, 1, 0), DOWN, mesh_of(floor()), of(0.6), lamp("directional", SUN), triangle=-1)
    assert not mean.any()
    assert not error.any()

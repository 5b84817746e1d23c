"""Openness: closed forms on a plane, near walls and inside a sphere; seeds, subsets, backends, progress."""

import sys

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.jit import threads
from refgi.rays import Tracer, openness
from refgi.scene import Geometry
from refgi.stages import observe

STANDARD_ERRORS = 4.0  # of a mean: one in 16,000 means of unbiased estimates is farther off
TESSELLATION = 5e-3  # share of directions; an icosphere of 20,480 faces stands within 4e-4 of its radius


def geometry(*quads):
    """Return quads (corner, edge, edge) as triangles."""
    vertices, faces = [], []
    for corner, one, other in (np.asarray(quad, float) for quad in quads):
        first = len(vertices)
        vertices += [corner, corner + one, corner + one + other, corner + other]
        faces += [(first, first + 1, first + 2), (first, first + 2, first + 3)]
    return Geometry(np.array(vertices), np.array(faces, np.int32), np.zeros(len(faces), np.int32))


FLOOR = ((-50, 0, -50), (0, 0, 100), (100, 0, 0))
WALL = ((0, 0, -50), (0, 100, 0), (0, 0, 100))  # the plane x = 0 above the floor


def floor_points(distances):
    """Points on the floor at distances from the wall, and their normals."""
    x = np.asarray(distances, float)
    return np.stack([x, 0 * x, 0 * x]), np.stack([0 * x, 0 * x + 1, 0 * x])


def near_a_wall(t):
    """1 - (acos t - t sqrt(1 - t^2)) / pi: the wall hides the segment x > t of the unit disc of directions."""
    t = np.minimum(t, 1)
    return 1 - (np.arccos(t) - t * np.sqrt(1 - t * t)) / np.pi


@pytest.mark.feature("SII-15")
@pytest.mark.parametrize("radius", [0.01, 1.0, np.inf])
def test_a_plane_is_open(radius, evidence):
    at, up = floor_points(np.linspace(-40, 40, 500))
    share = openness(Tracer(geometry(FLOOR)), at, up, radius=radius)
    np.testing.assert_array_equal(share, 1)
    evidence(f"plane, radius {radius:g} m: O = 1 at all of {len(share)} points")


@pytest.mark.feature("SII-15")
def test_the_edge_of_a_right_angle_is_half_open(evidence):
    at, up = floor_points([1e-4])
    tracer = Tracer(geometry(FLOOR, WALL))
    share = [float(openness(tracer, at, up, radius=2.0, rays=256, seed=seed)[0]) for seed in range(100)]
    error = np.std(share, ddof=1) / 10
    assert abs(np.mean(share) - near_a_wall(1e-4 / 2)) < STANDARD_ERRORS * error
    assert abs(np.mean(share) - 0.5) < 1e-3
    evidence(f"edge of a 90-degree wedge: O = {np.mean(share):.4f} +- {error:.4f}")


@pytest.mark.feature("SII-15")
def test_near_a_wall_it_follows_the_closed_form(evidence):
    distances = np.array([0.05, 0.2, 0.5, 0.9, 0.97, 1.001, 3.0])
    at, up = floor_points(distances)
    tracer = Tracer(geometry(FLOOR, WALL))
    shares = np.array([openness(tracer, at, up, radius=1.0, rays=64, seed=seed) for seed in range(200)])
    expected = near_a_wall(distances)
    error = shares.std(axis=0, ddof=1) / np.sqrt(len(shares))
    assert (np.abs(shares.mean(axis=0) - expected) <= STANDARD_ERRORS * error + 1e-9).all()
    np.testing.assert_array_equal(shares[:, 5:], 1)  # beyond the radius nothing counts
    spread = shares.std(axis=0)[:3] / np.sqrt(expected * (1 - expected) / 64)[:3]
    assert (spread < 0.6).all()
    evidence(f"at 0.05 to 0.97 radii from a wall: within {np.abs(shares.mean(axis=0) - expected).max():.1e}; std "
             f"{spread.min():.2f} to {spread.max():.2f} of independent rays'")


@pytest.mark.feature("SII-15")
def test_inside_a_sphere_it_is_one_minus_the_square_of_the_radius_over_its_diameter(evidence):
    import trimesh

    mesh = trimesh.creation.icosphere(subdivisions=5)
    tracer = Tracer(Geometry(np.asarray(mesh.vertices), np.asarray(mesh.faces, np.int32),
                             np.zeros(len(mesh.faces), np.int32)))  # fmt: skip
    centres = mesh.triangles_center[::40].T
    inwards = -mesh.face_normals[::40].T
    off = 0.0
    for radius in (0.3, 1.0, 1.7, 2.5):
        share = openness(tracer, centres, inwards, radius=radius).mean()
        off = max(off, abs(share - max(0, 1 - (radius / 2) ** 2)))
    assert off < TESSELLATION
    evidence(f"unit sphere, radius 0.3 to 2.5: within {off:.1e} of 1 - (radius / 2)^2")


@pytest.mark.feature("SII-15")
def test_it_tends_to_one_as_the_radius_vanishes(evidence):
    at, up = floor_points([0.1, 1.0])
    tracer = Tracer(geometry(FLOOR, WALL))
    shares = [openness(tracer, at, up, radius=radius, rays=256)[0] for radius in (1.0, 0.3, 0.12, 0.1, 1e-3)]
    assert (np.diff(shares) >= 0).all()
    assert shares[-2:] == [1, 1]
    evidence(f"0.1 m from a wall, radius 1 to 0.001 m: {', '.join(f'{s:.2f}' for s in shares)}")


def test_a_map_and_a_list_give_the_same_and_uncovered_points_are_open():
    rng = np.random.default_rng(2)
    at, up = floor_points(rng.random(96))
    tracer = Tracer(geometry(FLOOR, WALL))
    alone = openness(tracer, at, up, radius=1.0, seed=3)
    covered = rng.random((8, 12)) < 0.7
    picture = openness(tracer, at.reshape(3, 8, 12), up.reshape(3, 8, 12), covered, radius=1.0, seed=3)
    np.testing.assert_array_equal(picture[covered], alone.reshape(8, 12)[covered])
    np.testing.assert_array_equal(picture[~covered], 1)
    assert alone.std() > 0
    single = openness(tracer, at.astype(np.float32), up.astype(np.float32), radius=1.0, seed=3)
    assert single.dtype == np.float32
    assert np.abs(single - alone).mean() < 1e-3  # rays move by float32 steps, few change sides
    assert openness(tracer, at[:, :0], up[:, :0], radius=1.0).shape == (0,)


@pytest.mark.feature("REF-19")
def test_threads_spans_and_backends_do_not_change_it(monkeypatch, evidence):
    at, up = floor_points(np.random.default_rng(4).random(700))
    shape = geometry(FLOOR, WALL)
    expected = openness(Tracer(shape), at, up, radius=1.0, seed=1)
    with threads(1):
        np.testing.assert_array_equal(openness(Tracer(shape), at, up, radius=1.0, seed=1), expected)
    monkeypatch.setattr(sys.modules["refgi.rays.openness"], "SPAN", 1000)
    np.testing.assert_array_equal(openness(Tracer(shape), at, up, radius=1.0, seed=1), expected)
    monkeypatch.setenv("REFGI_EMBREE", "run")
    np.testing.assert_array_equal(openness(Tracer(shape), at, up, radius=1.0, seed=1), expected)
    assert (openness(Tracer(shape), at, up, radius=1.0, seed=2) != expected).any()
    evidence("openness: equal bits for 1 and 2 threads, spans of 15 and 8192 points, both Embree backends")


def test_it_reports_progress(monkeypatch):
    monkeypatch.setattr(sys.modules["refgi.rays.openness"], "SPAN", 640)
    at, up = floor_points(np.linspace(0.1, 1, 40))
    told = []
    with observe(progress=lambda name, fraction: told.append((name, fraction))):
        openness(Tracer(geometry(FLOOR)), at, up, radius=1.0)
    assert {name for name, _ in told} == {"rays.openness"}
    assert sorted({fraction for _, fraction in told}) == [0, 0.25, 0.5, 0.75, 1]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"radius": 0.0}, r"radius: expected a length > 0 m, got 0.0"),
        ({"radius": np.nan}, r"radius: expected a length > 0 m"),
        ({"rays": 0}, "rays: expected 1 to 65536 directions a point, got 0"),
        ({"seed": -1}, "seed: expected a whole number >= 0, got -1"),
        ({"position": np.zeros((2, 4))}, r"position: expected shape \(3, ...\)"),
        ({"normal": np.zeros((3, 5))}, r"normal: expected shape \(3, 4\) as position"),
        ({"covered": np.ones(3, bool)}, r"covered: expected shape \(4,\)"),
    ],
)
def test_errors_name_what_is_wrong(change, message):
    given = {"position": np.zeros((3, 4)), "normal": np.ones((3, 4)), "covered": None, "radius": 1.0} | change
    with pytest.raises(InputError, match=message):
        openness(Tracer(geometry(FLOOR)), **given)

import dataclasses
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.rays import MISS, Tracer
from refgi.scene import DirectionalLight, Geometry, PointLight
from tests.naive.crossings import corners_of, nearest

FLOAT32_STEPS = 1e-6  # distances against float64: a dozen float32 steps at sizes about 1, rays not grazing


def geometry(vertices, faces):
    return Geometry(np.asarray(vertices, float), np.asarray(faces, np.int32), np.zeros(len(faces), np.int32))


def icosphere(levels, centre=(0.0, 0.0, 0.0), radius=1.0):
    import trimesh

    mesh = trimesh.creation.icosphere(subdivisions=levels)
    return geometry(np.asarray(mesh.vertices) * radius + centre, mesh.faces)


def box(size=1.0, centre=(0.0, 0.0, 0.0)):
    import trimesh

    mesh = trimesh.creation.box((size, size, size))
    return geometry(np.asarray(mesh.vertices) + centre, mesh.faces)


def unit_vectors(count, seed):
    v = np.random.default_rng(seed).normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


@pytest.fixture(params=["address", "run"])
def backend(request, monkeypatch):
    monkeypatch.setenv("REFGI_EMBREE", request.param)
    return request.param


@pytest.mark.feature("REF-02")
@pytest.mark.usefixtures("backend")
def test_hits_equal_the_naive_twin():
    random = np.random.default_rng(3)
    soup = geometry(random.normal(size=(60, 3)), np.arange(60).reshape(20, 3))
    origins, directions = random.normal(size=(200, 3)), unit_vectors(200, 4)
    hits = Tracer(soup).closest(origins, directions)
    soup = dataclasses.replace(soup, vertices=soup.vertices.astype(np.float32))
    face, distance = nearest(corners_of(soup), origins, directions)
    assert (hits.triangle_id == face).all()  # MISS is -1
    met = face >= 0
    np.testing.assert_allclose(hits.distance[met], distance[met], rtol=2e-5)  # worst of float32 at grazing angles
    assert (hits.triangle_id == MISS).any()
    assert (hits.triangle_id != MISS).any()


def test_both_backends_give_the_same_bits(monkeypatch, evidence):
    answers = {}
    mesh, origins = icosphere(4), unit_vectors(20_000, 5) * 0.9
    directions, reach = unit_vectors(20_000, 6), np.linspace(0, 2, 20_000)
    for name in ("address", "run"):
        monkeypatch.setenv("REFGI_EMBREE", name)
        tracer = Tracer(mesh)
        hits = tracer.closest(origins, directions, reach)
        answers[name] = (*hits, tracer.occluded(origins, directions, reach))
    assert all(np.array_equal(a, b) for a, b in zip(*answers.values(), strict=True))
    evidence("address and run: 20,000 closest hits and occlusions equal to the bit")


@pytest.mark.usefixtures("backend")
@pytest.mark.parametrize("centre", [(0.0, 0.0, 0.0), (7.3, -2.1, 4.4)])
def test_rays_at_vertices_and_edges_of_closed_meshes_never_slip_through(centre, evidence):
    mesh = icosphere(5, centre)
    vertices = mesh.vertices.astype(np.float32).astype(float)
    edges = vertices[np.unique(np.sort(np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]]]), axis=1), axis=0)]
    share = np.random.default_rng(1).uniform(size=(len(edges), 1))
    targets = np.concatenate([vertices, edges[:, 0] * share + edges[:, 1] * (1 - share)])
    tracer, bare = Tracer(mesh), 0
    for start in unit_vectors(5, 7) * 0.5 + centre:
        o = np.broadcast_to(start, targets.shape)
        assert (tracer.closest(o, targets - o).triangle_id != MISS).all()
        assert tracer.occluded(o, targets - o).all()
        ids, far = np.empty(len(o), np.int32), np.empty(len(o), np.float32)
        tracer.fill_closest(np.ascontiguousarray(o, np.float32), (targets - o).astype(np.float32),
                            np.full(len(o), np.inf, np.float32), ids, far)
        bare += int((ids == MISS).sum())
    assert bare > 0  # else this test shows nothing
    evidence(f"0 of {5 * len(targets)} rays at vertices and edges slip through; {bare} without float64")


def test_the_decision_in_float64_invents_no_hits():
    mesh = icosphere(3)
    targets = unit_vectors(50_000, 8) * 1.001  # just outside the sphere: tangents that pass it by
    along = np.cross(targets, unit_vectors(50_000, 9))
    hits = Tracer(mesh).closest(targets - 3 * along, along)
    assert (hits.triangle_id == MISS).all()


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("centre", [0.0, 5.0])
def test_offset_rays_never_hit_the_face_they_leave(scale, centre, evidence):
    import trimesh

    shape = trimesh.creation.icosphere(subdivisions=3)
    points, faces = trimesh.sample.sample_surface(shape, 100_000, seed=1)
    mesh = geometry((np.asarray(shape.vertices) + centre) * scale, shape.faces)
    tracer = Tracer(mesh)
    inward = -shape.face_normals[faces]
    directions = unit_vectors(100_000, 2)
    directions *= np.sign((directions * inward).sum(axis=1, keepdims=True))
    places = (points + centre) * scale
    origins = places.astype(np.float32) + tracer.offsets(places)[:, None] * inward  # as a G-buffer would have it
    hits = tracer.closest(origins, directions)
    assert (hits.triangle_id != MISS).all()
    assert (hits.triangle_id != faces).all()
    evidence(f"0 of 100,000 rays hit the face they leave (scale {scale}, centre {centre})")


@pytest.mark.feature("REF-02")
def test_segments_between_surface_points():
    tracer = Tracer(box())
    inside = np.array([[-0.5, 0.1, 0.0], [0.1, -0.5, 0.2]])
    outside = np.array([[2.5, 0.0, 0.0], [3.0, 0.0, 0.0]])
    assert not tracer.segments_blocked(inside[:1], inside[1:]).any()
    assert not tracer.segments_blocked(inside[:1], inside[1:], [[1, 0, 0]], [[0, 1, 0]]).any()
    assert tracer.segments_blocked(inside, outside).all()
    assert not tracer.segments_blocked(inside, inside).any()


@pytest.mark.parametrize("light", [PointLight((0.0, 2.0, 0.0), (1, 1, 1)), DirectionalLight((0, -1, 0), (1, 1, 1))])
def test_what_a_light_reaches(light):
    position = np.array([[0.0, 0.9, 0.0], [0.0, -0.5, 0.0], [0.0, 0.5, 0.0], [9.0, 0.0, 0.0]]).T.reshape(3, 2, 2)
    normal = np.zeros_like(position)
    normal[1] = 1
    normal[1, 1, 0] = -1
    visible = Tracer(box()).visible_from_light(position, normal, np.array([[True, True], [True, False]]), light)
    assert visible.tolist() == [[True, False], [False, False]]


def test_empty_geometry_lets_everything_pass():
    tracer = Tracer(geometry(np.zeros((0, 3)), np.zeros((0, 3))))
    assert tracer.closest([[0, 0, 0]], [[0, 0, 1]]).triangle_id.tolist() == [MISS]
    assert not tracer.occluded([[0, 0, 0]], [[0, 0, 1]]).any()
    assert tracer.closest(np.zeros((0, 3)), np.zeros((0, 3))).distance.shape == (0,)


@pytest.mark.parametrize(("origins", "directions", "reach", "named"), [
    ([[np.nan, 0, 0]], [[0, 0, 1]], 1.0, "origins"),
    ([[0, 0, 0]], [[0, np.inf, 1]], 1.0, "directions"),
    ([[0, 0, 0]], [[0, 0, 0]], 1.0, "directions"),
    ([[0, 0, 0]], [[0, 0, 1]], np.nan, "reach"),
    ([[0, 0]], [[0, 1]], 1.0, "origins"),
    ([[0, 0, 0]], [[0, 0, 1], [0, 1, 0]], 1.0, "directions"),
    ([[0, 0, 0]], [[0, 0, 1]], [1.0, 2.0], "reach"),
])
def test_unusable_rays_are_refused(origins, directions, reach, named):
    with pytest.raises(InputError, match=named):
        Tracer(box()).closest(origins, directions, reach)


def test_unusable_vertices_are_refused():
    with pytest.raises(InputError, match="vertex 2: expected finite coordinates"):
        Tracer(geometry([[0, 0, 0], [1, 0, 0], [0, np.nan, 0]], [[0, 1, 2]]))


@pytest.mark.usefixtures("backend")
def test_inputs_are_copied_and_left_alone():
    mesh = box()
    tracer = Tracer(mesh)
    origins, directions, reach = np.zeros((4, 3), np.float32), np.eye(4, 3, dtype=np.float32), np.full(4, 9, np.float32)
    directions[3] = 1
    before = [array.copy() for array in (origins, directions, reach)]
    expected = tracer.closest(origins, directions, reach)
    mesh.vertices[:] = 7
    assert np.array_equal(tracer.closest(origins, directions, reach).distance, expected.distance)
    assert all(np.array_equal(a, b) for a, b in zip(before, (origins, directions, reach), strict=True))


@pytest.mark.usefixtures("backend")
def test_first_use_by_many_threads_at_once():
    tracer = Tracer(icosphere(4))
    origins, directions = np.zeros((1000, 3)), unit_vectors(1000, 11)
    with ThreadPoolExecutor(4) as pool:  # each asks in its own thread; the tree is built once
        futures = [pool.submit(lambda: tracer._backend) for _ in range(4)]
        assert len({id(future.result()) for future in futures}) == 1
    distance = tracer.closest(origins, directions).distance
    assert np.abs(distance - 1).max() < 0.01  # the sphere's chords


@pytest.mark.usefixtures("backend")
@pytest.mark.parametrize("size", [1e-6, 1.0, 1e8])
def test_a_ray_at_the_tip_of_a_spike_meets_it(size, evidence):
    """Rounding may put a ray through a vertex on the outer side of each of the three edges there."""
    ball = icosphere(3)
    centres = ball.vertices[ball.faces].mean(axis=1)
    tips = len(ball.vertices) + np.arange(len(ball.faces))
    places = np.concatenate([0.4 * ball.vertices, centres / np.linalg.norm(centres, axis=1, keepdims=True)])
    sides = [np.stack([ball.faces[:, a], ball.faces[:, b], tips], axis=1) for a, b in ((0, 1), (1, 2), (2, 0))]
    rotation = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
    tracer = Tracer(geometry(size * places @ rotation.T, np.concatenate(sides)))
    targets = (size * places @ rotation.T)[tips].astype(np.float32)
    hits = tracer.closest(np.zeros_like(targets), targets)
    assert (hits.triangle_id % len(tips) == np.arange(len(tips))).all()
    np.testing.assert_allclose(hits.distance, 1, rtol=1e-5)
    assert tracer.occluded(np.zeros_like(targets), targets).all()
    evidence(f"size {size:g} m: {len(tips)} rays meet the tips they aim at")

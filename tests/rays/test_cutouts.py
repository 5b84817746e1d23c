"""Cut-outs along rays: a hit in a hole is none, whichever way Embree is called, and nothing behind is missed."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

from refgi.jit import threads
from refgi.rays import MISS, Tracer, openness
from refgi.rays.cutouts import is_there, ray_holes
from refgi.rays.embree import AddressBackend, RunBackend
from refgi.scene import Geometry, Material, PointLight, Texture, load_scene, merge
from refgi.scene.builtin.surfaces import rectangle
from refgi.scene.triangles import cut_outs
from tests.cutouts import CORNERS, half_plate, heap, opaque, spots
from tests.naive import cutouts as naive
from tests.rays.test_rays import unit_vectors
from tests.textured import laid

DOUBT = 1e-5  # of alpha or a barycentric coordinate: rays and corners are float32
FLOAT32_STEPS = 2e-5  # of a distance, at grazing angles
RESTARTED = 2 * FLOAT32_STEPS  # of a distance by either way: rays that start anew see a triangle from elsewhere


@pytest.fixture(params=["address", "run"])
def backend(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setenv("REFGI_EMBREE", request.param)
    return str(request.param)


def rays(count: int, seed: int, spread: float = 1.5) -> tuple[np.ndarray, np.ndarray]:
    """Origins and directions that float32 holds."""
    random = np.random.default_rng(seed)
    origins = random.uniform(-spread, spread, (count, 3)).astype(np.float32).astype(float)
    return origins, unit_vectors(count, seed + 1).astype(np.float32).astype(float)


@pytest.mark.feature("REF-28")
@pytest.mark.parametrize("chosen", ["nearest", "bilinear"])
def test_hits_are_those_of_a_literal_ray(backend: str, chosen: str, evidence: Callable[[str], None]) -> None:
    scene = heap(18, chosen=chosen)
    origins, directions = rays(600, 4)
    tracer, through, doubtful = Tracer(scene.geometry), 0, 0
    assert isinstance(tracer._backend, AddressBackend if backend == "address" else RunBackend)
    hits, blocked = tracer.closest(origins, directions), tracer.occluded(origins, directions)
    for k in range(600):
        found = naive.hits(origins[k], directions[k], scene.geometry, scene.materials)
        face, t, margin = naive.first(found)
        through += len(found) > 0 and found[0][1] != face
        if margin < DOUBT:
            doubtful += 1
            continue
        assert hits.triangle_id[k] == face
        assert blocked[k] == (face != MISS)
        if face != MISS:
            assert hits.distance[k] == pytest.approx(t, rel=FLOAT32_STEPS)
    evidence(f"{backend}, {chosen}: {through} of 600 rays pass holes, {doubtful} in doubt")
    assert through > 60
    assert doubtful < 3


@pytest.mark.usefixtures("backend")
def test_reach_ends_between_what_lies_on_a_ray() -> None:
    scene, (origins, directions) = heap(18), rays(400, 7)
    tracer = Tracer(scene.geometry)
    hits = tracer.closest(origins, directions)
    for share, expected in ((1.01, hits.triangle_id != MISS), (0.99, np.zeros(400, np.bool_))):
        reach = np.where(np.isfinite(hits.distance), share * hits.distance, 1.0)
        np.testing.assert_array_equal(tracer.occluded(origins, directions, reach), expected)
        np.testing.assert_array_equal(tracer.closest(origins, directions, reach).triangle_id != MISS, expected)
    assert tracer.occluded(origins, directions, 0.0).all()  # rays of no reach count as blocked
    assert (tracer.closest(origins, directions, 0.0).triangle_id == MISS).all()


@pytest.mark.feature("REF-28")
def test_both_backends_agree(monkeypatch: pytest.MonkeyPatch, evidence: Callable[[str], None]) -> None:
    """A ray that starts anew may pass over a leaf that lies within its offset behind a hole, and nothing else."""
    scene, (origins, directions) = load_scene("leaf_grid"), rays(100_000, 9, 0.9)
    origins[:, 1] += 1
    found = {}
    for name in ("address", "run"):
        monkeypatch.setenv("REFGI_EMBREE", name)
        tracer = Tracer(scene.geometry)
        found[name] = *tracer.closest(origins, directions), tracer.occluded(origins, directions, 0.7)
    differ = np.flatnonzero(found["address"][0] != found["run"][0])
    blocked = np.count_nonzero(found["address"][2] != found["run"][2])
    same = np.ones(len(origins), np.bool_)
    same[differ] = False
    np.testing.assert_allclose(found["run"][1][same], found["address"][1][same], rtol=RESTARTED)
    evidence(f"{len(differ)} of 100,000 hits differ, {blocked} occlusions")
    assert len(differ) <= 2
    assert blocked <= 2


@pytest.mark.feature("REF-28")
def test_leaves_in_one_plane_are_all_asked() -> None:
    """Ten quads in the same place, nine of them holes there: Embree's filter misses none, whatever their order."""
    material, hole = Material("there"), Material("hole", alpha=0.2, cutoff=0.5)
    quad = rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0), hole, "quad")
    origins = np.concatenate([np.random.default_rng(2).uniform(-0.9, 0.9, (500, 2)), np.full((500, 1), 3.0)], axis=1)
    for place in range(10):
        quads = [dataclasses.replace(quad, material=material if k == place else hole) for k in range(10)]
        tracer = Tracer(merge(quads)[0])
        hits = tracer.closest(origins, [[0.0, 0.0, -1.0]] * 500)
        assert (hits.triangle_id // 2 == place).all()
        assert tracer.occluded(origins, [[0.0, 0.0, -1.0]] * 500).all()


@pytest.mark.usefixtures("backend")
def test_huge_leaves_have_their_holes_where_they_are() -> None:
    """Huge triangles are cut into pieces for Embree; a picture lies on the whole."""
    size = 3e4
    leaf = Material("leaf", texture=Texture(spots((16, 16)), ("clamp", "clamp")), cutoff=0.5)
    quad = laid(rectangle((-size, 0, size), (2 * size, 0, 0), (0, 0, -2 * size), leaf, "leaf"), CORNERS)
    small = rectangle((-1, -1, -1), (2, 0, 0), (0, 2, 0), Material("small"), "small", cells=(4, 4))
    geometry, materials = merge([small, quad])
    tracer = Tracer(geometry)
    assert len(tracer._pieces.faces) > len(geometry.faces)
    random = np.random.default_rng(1)
    place = random.uniform(-0.99 * size, 0.99 * size, (300, 2)).astype(np.float32).astype(float)
    origins = np.stack([place[:, 0], np.full(300, 64.0), place[:, 1]], axis=1)
    hits, there = tracer.closest(origins, [[0.0, -1.0, 0.0]] * 300), 0
    for k in range(300):
        face, _, margin = naive.nearest(origins[k], np.array([0.0, -1.0, 0.0]), geometry, materials)
        there += face != MISS
        assert margin < 1e-3 or hits.triangle_id[k] == face
    assert 60 < there < 240


@pytest.mark.usefixtures("backend")
def test_rays_at_vertices_see_holes_too() -> None:
    """Misses are decided in float64 again: at a corner whose surroundings are a hole nothing is met."""
    scene = half_plate(size=4.0)
    targets = scene.geometry.vertices[4:]  # the plate's corners: the left ones lie in the hole
    origins = np.array([0.3, 3.0, 0.2]) + 0 * targets
    hits = Tracer(scene.geometry).closest(origins, targets - origins)
    plate = hits.triangle_id >= 2
    np.testing.assert_array_equal(plate, targets[:, 0] > 0)
    whole = Tracer(opaque(scene).geometry).closest(origins, targets - origins)
    assert (whole.triangle_id >= 2).all()


def test_the_decision_in_float64_knows_holes() -> None:
    """Rays at every vertex of a fine mesh, some of which slip through it in float32 (`test_rays`)."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=5)
    uv = np.zeros((len(ball.faces), 3, 2))
    shape = Geometry(np.asarray(ball.vertices), np.asarray(ball.faces, np.int32), np.zeros(len(ball.faces), np.int32),
                     None, uv)
    targets = shape.vertices.astype(np.float32).astype(float)
    for cutoff, there in ((0.5, True), (1.5, False)):
        holes = cut_outs((Material("leaf", texture=Texture(spots((2, 2))), cutoff=0.0),
                          Material("ball", alpha=1.0, cutoff=cutoff)))
        ball_of = np.ones(len(shape.faces), np.int32)
        tracer = Tracer(dataclasses.replace(shape, material_of_face=ball_of, cut_outs=holes))
        start = np.broadcast_to([0.3, -0.2, 0.1], targets.shape)
        assert (tracer.closest(start, targets - start).triangle_id != MISS).all() == there
        assert (tracer.closest(start, targets - start).triangle_id != MISS).any() == there


@pytest.mark.usefixtures("backend")
@pytest.mark.parametrize("up", [1.0, -1.0])
def test_rays_beside_an_edge_of_a_mask_are_not_decided_by_their_neighbours(up: float) -> None:
    """A miss is asked again a hair beside, where the plate may be there; the ray itself passes its hole."""
    scene = half_plate(size=4.0)
    plate = scene.geometry.selected(np.arange(4) >= 2)
    x = np.concatenate([-np.geomspace(1e-7, 1e-4, 50), np.geomspace(1e-7, 1e-4, 50)])
    origins = np.stack([x, np.full(100, 1.0 - 2.0 * up), np.full(100, 0.3)], axis=1)
    tracer, along = Tracer(plate), np.tile([0.0, up, 0.0], (100, 1))
    np.testing.assert_array_equal(tracer.closest(origins, along).triangle_id != MISS, x > 0)
    np.testing.assert_array_equal(tracer.occluded(origins, along), x > 0)


def test_bits_do_not_depend_on_threads() -> None:
    scene, (origins, directions) = load_scene("leaf_grid"), rays(30_000, 11, 0.9)
    tracer, answers = Tracer(scene.geometry), []
    for count in (1, 2):
        with threads(count):
            answers.append((*tracer.closest(origins, directions), tracer.occluded(origins, directions, 0.5)))
    assert all(np.array_equal(one, other) for one, other in zip(*answers, strict=True))


@pytest.mark.feature("REF-28")
@pytest.mark.usefixtures("backend")
def test_a_light_and_the_sky_shine_through_holes() -> None:
    """A plate over x > 0 alone: points under it are dark and half closed, others are not."""
    scene = half_plate()
    position, normal = np.zeros((3, 1, 40)), np.zeros((3, 1, 40))
    position[0, 0], normal[1] = np.linspace(-3.0, 3.0, 40), 1.0
    tracer, covered = Tracer(scene.geometry), np.ones((1, 40), np.bool_)
    lit = tracer.visible_from_light(position, normal, covered, PointLight((0.0, 2.0, 0.0), (1, 1, 1)))[0]
    np.testing.assert_array_equal(lit, position[0, 0] < 0)
    share = openness(tracer, position, normal, radius=np.inf, rays=256)[0]
    # a half plane at height 1 over x > 0 leaves (1 - x / sqrt(1 + x^2)) / 2 of the cosine-weighted sky
    x = position[0, 0]
    np.testing.assert_allclose(share, 0.5 * (1 - x / np.hypot(1, x)), atol=0.02)


@pytest.mark.feature("REF-28")
def test_points_of_a_triangle_are_there_as_the_mask_says() -> None:
    scene, random, there = heap(18), np.random.default_rng(6), 0
    holes = ray_holes(scene.geometry)
    for k, face in enumerate(scene.geometry.cut.face):
        weights = random.dirichlet((1, 1, 1), 20)
        for point, uv in zip(weights @ scene.geometry.vertices[scene.geometry.faces[face]],
                             weights @ scene.geometry.uv[face], strict=True):
            origin = point - 2.0 * random.normal(size=3)
            excess = naive.excess(scene.materials[scene.geometry.material_of_face[face]], *uv)
            assert is_there(holes, k, *origin, *(point - origin)) == (excess >= 0)
            there += excess >= 0
    assert 60 < there < 200


def test_without_holes_embree_has_the_mesh_alone() -> None:
    scene = opaque(heap(30))
    tracer = Tracer(scene.geometry)
    assert len(tracer._holes.of_face) == 0
    assert tracer._backend._filter is None
    assert tracer._backend.calls.first == 0
    bare = Geometry(scene.geometry.vertices, scene.geometry.faces, scene.geometry.material_of_face)
    origins, directions = rays(1000, 3)
    for one, other in zip(tracer.closest(origins, directions), Tracer(bare).closest(origins, directions), strict=True):
        np.testing.assert_array_equal(one, other)

"""Ray ends stay off surfaces by the error bound of their own point, and huge triangles are cut for Embree."""

import dataclasses
import os
from pathlib import Path

import numpy as np
import pytest

from refgi import load_scene
from refgi.frame import Frame
from refgi.pairs.shadow_rays import receivers
from refgi.rays import MISS, Tracer, openness
from refgi.rays.watertight import GRAIN, REACH, STEPS, cut, far_offset, grain_of, ray_offset
from refgi.scene import Camera, Geometry, Material, Mesh, SpotLight, light_table, material_table
from refgi.settings import of
from refgi.truth import TruthSettings, VplSettings, trace_truth, vpl
from refgi.truth.surfaces import height_above, lift, surfaces
from tests.truth.scenes import rectangle, scene

DATA = Path(os.environ.get("REFGI_DATA", Path(__file__).parents[3] / "shared" / "data"))
UNCHANGED = 1e-5  # of the picture's mean, in any pixel
SINGLE = 2.0**-24


def geometry(vertices, faces):
    return Geometry(np.asarray(vertices, float), np.asarray(faces, np.int32), np.zeros(len(faces), np.int32))


def quad(half, y=0.0, tilt=0.0):
    corners = np.array([[-half, y, half], [half, y, half], [half, y, -half], [-half, y, -half]], float)
    corners[:, 1] += tilt * corners[:, 0]
    return geometry(corners, [[0, 1, 2], [0, 2, 3]])


def with_plane_below(scene, half, depth=1e-3):
    """The scene with a plane just below its floor, which neither camera nor light sees from within the box."""
    shape, plane = scene.geometry, quad(half, scene.geometry.vertices[:, 1].min() - depth)
    normals = shape.vertex_normals
    return dataclasses.replace(scene, geometry=Geometry(
        np.concatenate([shape.vertices, plane.vertices]),
        np.concatenate([shape.faces, plane.faces + len(shape.vertices)]).astype(np.int32),
        np.append(shape.material_of_face, [0, 0]).astype(np.int32),
        None if normals is None else np.concatenate([normals, np.tile([0.0, 1.0, 0.0], (4, 1))])))


BALL = Material("ball", (0.5, 0.5, 0.6))


def closed_box(ball=BALL):
    """A box of 2 m with a ball and a plate, camera and lamp inside."""
    import trimesh

    walls = [rectangle((-1, y, 1), (2, 0, 0), (0, 0, -2)) for y in (0, 2)]
    walls += [rectangle((x, 0, -1), (0, 2, 0), (0, 0, 2), Material("red", (0.7, 0.2, 0.1))) for x in (-1, 1)]
    walls += [rectangle((-1, 0, z), (2, 0, 0), (0, 2, 0)) for z in (-1, 1)]
    sphere = trimesh.creation.icosphere(subdivisions=2, radius=0.3)
    walls.append(Mesh(np.add(sphere.vertices, (0.3, 0.5, -0.2)), np.asarray(sphere.faces), None, ball))
    walls.append(rectangle((-0.6, 0.0, 0.1), (0.0, 0.8, 0.0), (0.3, 0.0, -0.6)))
    lamp = SpotLight((0.4, 1.7, 0.5), (-0.6, -0.8, -0.5), 0.4, 0.7, (3.0, 2.0, 1.0))
    camera = Camera((0.0, 1.2, 0.95), (0.0, 0.7, 0.0), (0, 1, 0), 1.2, 24, 24)
    return dataclasses.replace(scene(walls, lamp), camera=camera)


def small(scene, shadows="map"):
    return Frame(scene, rsm_resolution=64, shadows=shadows)


def hssil_by_rays(frame):
    from refgi.sssil import HssilSettings, hssil

    return hssil(frame, of(HssilSettings, visibility="rays"))


def multires_by_rays(frame):
    from refgi.splat.multires.multires import multires
    from refgi.splat.multires.settings import MultiresSettings

    return multires(frame, of(MultiresSettings, visibility="rays"))


def shares_of_rays(frame):
    """Share of rays from what is seen to points of the floor and a wall: what the reference modes of `val` ask for."""
    from refgi.cluster.reference import free_share

    u, v = np.random.default_rng(9).uniform(0.05, 0.95, (2, 32))
    targets = np.stack([2 * u - 1, np.zeros(32), 2 * v - 1])
    up = np.array([[0.0], [1.0], [0.0]])
    covered = frame.gbuffer.covered
    return free_share(frame.tracer, frame.gbuffer.position[:, covered], frame.gbuffer.normal[:, covered], targets, up,
                      None, frame.tracer.grain)


def walked_lights(frame):
    from refgi.lights.walk import walk_lights

    materials, lamps = material_table(frame.scene.materials), light_table(frame.scene.lights)
    lights = walk_lights(frame.tracer, frame.scene.geometry, materials, lamps, paths=64, bounces=3, seed=1)
    return np.concatenate([lights.position, lights.flux])


USERS = {
    "truth": lambda frame: trace_truth(frame, TruthSettings(samples=48)).mean,
    "two bounces": lambda frame: trace_truth(frame, TruthSettings(estimator="hemisphere", samples=32, bounces=2)).mean,
    "seen": lambda frame: trace_truth(frame, TruthSettings(samples=48, emitters="visible")).mean,
    "caustics": lambda frame: trace_truth(frame, TruthSettings(samples=48, caustics=True, photons=1 << 12)).mean,
    "vpl": lambda frame: vpl(frame, of(VplSettings, lights=64)),
    "hssil": hssil_by_rays,
    "multires": multires_by_rays,
    "reference modes of val": shares_of_rays,
    "random walk": walked_lights,
    "openness": lambda frame: openness(frame.tracer, frame.gbuffer.position, frame.gbuffer.normal,
                                       frame.gbuffer.covered, radius=0.3, rays=16),
}


@pytest.mark.parametrize("name", USERS)
def test_a_far_vertex_changes_no_pixel(name, evidence):
    """Property: a hidden plane of 10 m to 1e8 m changes nothing."""
    scene = closed_box(Material("ball", ior=1.5)) if name == "caustics" else closed_box()
    plain = small(scene)
    expected = np.asarray(USERS[name](plain))
    worst = 0.0
    for half in (1e1, 1e3, 1e5, 1e8):
        far = small(with_plane_below(scene, half))
        assert (far.gbuffer.triangle_id == plain.gbuffer.triangle_id).all()
        worst = max(worst, np.abs(np.asarray(USERS[name](far)) - expected).max() / expected.mean())
    assert expected.mean() > 0
    assert worst <= UNCHANGED
    evidence(f"{name}: a hidden plane up to 1e8 m moves pixels by {worst:.1e} of the mean at most")


def test_a_far_vertex_changes_no_shadow():
    plain = small(closed_box(), "exact")
    for half in (1e1, 1e8):
        far = small(with_plane_below(closed_box(), half), "exact")
        assert (far.direct == plain.direct).all()


@pytest.mark.parametrize("half", [1e2, 1e5, 1e8])
def test_a_floor_just_above_a_huge_plane_hides_it(half):
    """Rays from below the plane find the plane, those from above the floor, 1 mm away."""
    plane, floor = quad(half, -1e-3), quad(1.0)
    tracer = Tracer(geometry(np.concatenate([floor.vertices, plane.vertices, 1 + floor.vertices]),
                             np.concatenate([floor.faces, plane.faces + 4, floor.faces + 8])))
    random = np.random.default_rng(1)
    origins = random.uniform(-0.2, 0.2, (20_000, 3)) * (1, 0, 1) + (0, 0.7, 0)
    directions = random.normal(size=(20_000, 3)) * (1, 0.3, 1)
    directions[:, 1] = -np.abs(directions[:, 1]) - 0.3
    hits = tracer.closest(origins, directions)
    landed = origins - (origins[:, 1:2] / directions[:, 1:2]) * directions
    onto = (np.abs(landed[:, ::2]) < 0.999).all(axis=1)
    assert onto.sum() > 3000
    assert (hits.triangle_id[onto] < 2).all()
    np.testing.assert_allclose(hits.distance[onto], -0.7 / directions[onto, 1], rtol=1e-5)
    below = tracer.closest(origins * (1, -1, 1), directions * (1, -1, 1))
    assert np.isin(below.triangle_id, (2, 3)).all()
    np.testing.assert_allclose(below.distance, -(0.7 - 1e-3) / directions[:, 1], rtol=1e-5)


@pytest.mark.parametrize("tilt", [0.0, 0.37])
def test_pieces_cover_what_was_cut_and_grow_with_their_distance(tilt):
    plane = quad(1e6, 0.25, tilt)
    vertices, faces = plane.vertices.astype(np.float32), plane.faces
    grain = 4.0
    pieces = cut(vertices, faces, grain)
    corner = pieces.vertices[pieces.faces].astype(np.float64)
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    whole = np.cross(vertices[1] - vertices[0], vertices[2] - vertices[0]).astype(np.float64)
    whole /= np.linalg.norm(whole)
    areas = cross @ whole / 2
    assert (areas > 0).all()  # as the face is turned
    for k in range(2):
        assert areas[pieces.face == k].sum() == pytest.approx(2e12 * np.hypot(1, tilt), rel=1e-6)
    edge = np.roll(corner, -1, axis=1) - corner
    middle = np.linalg.norm(corner + edge / 2, axis=2)
    assert (np.linalg.norm(edge, axis=2) <= 1.01 * np.maximum(grain, REACH * middle)).all()
    # every edge inside belongs to two pieces: no corner of one lies on the middle of another's edge
    edges = np.sort(np.stack([pieces.faces, np.roll(pieces.faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    _, index = np.unique(pieces.vertices, axis=0, return_inverse=True)
    edges = np.sort(index.reshape(-1)[edges], axis=1)
    _, times = np.unique(edges, axis=0, return_counts=True)
    assert times.max() == 2
    assert len(faces) < len(pieces.faces) < 4000  # 20 halvings of 2 faces


def test_nothing_is_cut_where_triangles_are_alike():
    for name in ("cornell_box", "atrium:faces=10000", "stage"):
        shape = load_scene(name).geometry
        vertices = shape.vertices.astype(np.float32)
        pieces = cut(vertices, shape.faces, grain_of(vertices, shape.faces))
        assert pieces.face is None
        assert pieces.faces is shape.faces


@pytest.mark.parametrize(("side", "pieces"), [(0.69, 2), (0.71, 4), (0.99, 4), (1.01, 8)])
def test_edges_up_to_the_grain_stay_whole(side, pieces):
    """A square around the coordinates' origin: first its diagonal is longer than the grain, then its sides are."""
    plane = quad(side * 4)
    found = cut(plane.vertices.astype(np.float32), plane.faces, 8.0)
    assert len(found.faces) == pieces
    assert (found.face is None) == (pieces == 2)


@pytest.mark.parametrize("tilt", [0.0, 0.37])
def test_no_ray_slips_between_pieces(tilt):
    quads = [quad(1e5, 0.0, tilt), *(quad(1.0, 5.0 + k) for k in range(4))]
    tracer = Tracer(geometry(np.concatenate([part.vertices for part in quads]),
                             np.concatenate([part.faces + 4 * k for k, part in enumerate(quads)])))
    random = np.random.default_rng(2)
    across = 10 ** random.uniform(-2, 4.5, (200_000, 2)) * random.choice([-1, 1], (200_000, 2))
    origins = np.zeros((200_000, 3))
    origins[:, 1] = 3
    targets = np.column_stack([across[:, 0], tilt * across[:, 0], across[:, 1]])
    triangle_id, distance = np.empty(200_000, np.int32), np.empty(200_000, np.float32)
    tracer.fill_closest(origins.astype(np.float32), (targets - origins).astype(np.float32),
                        np.full(200_000, np.inf, np.float32), triangle_id, distance)
    assert (triangle_id != MISS).all()
    assert (triangle_id < 2).all()


def test_the_grain_follows_the_middle_of_the_scene():
    shape = load_scene("cornell_box").geometry
    assert grain_of(shape.vertices, shape.faces) == 0.5 * GRAIN  # half of its faces reach to 0.472 m or more
    assert grain_of(4 * shape.vertices, shape.faces) == 2 * GRAIN
    far = with_plane_below(load_scene("cornell_box"), 1e8).geometry
    assert grain_of(far.vertices, far.faces) == 0.5 * GRAIN


@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_offsets_are_steps_of_the_point_at_hand(real):
    x, y, z = real(1.5), real(-20.0), real(0.25)
    tracer = Tracer(load_scene("cornell_box").geometry)
    expected = 4 * SINGLE * (1.5 + 20 + 0.25 + 4)
    assert ray_offset(x, y, z, real(4)) == pytest.approx(expected, rel=1e-6)
    assert far_offset(x, y, z) == pytest.approx(4 * SINGLE * 21.75, rel=1e-6)
    tracer = Tracer(load_scene("cornell_box").geometry)
    np.testing.assert_allclose(tracer.offsets([[1.5, -20.0, 0.25]]), expected)
    assert STEPS == 4 * SINGLE


def test_receivers_start_above_their_face_where_the_raster_is_off_it():
    plane = quad(1.0)
    position = np.array([[0.1, 0.2, 0.3], [1e-5, -2e-5, 0.5], [0.1, 0.3, -0.2]])  # a column is a point
    normal = np.tile([[0.0], [1.0], [0.0]], 3)
    to = receivers(plane, position, normal, np.zeros(3, int), GRAIN)
    expected = STEPS * (np.abs(position).sum(axis=0) + GRAIN)
    expected[2] += 0.5  # that far above is meant
    np.testing.assert_allclose(to.origin[1], expected, rtol=1e-5)
    np.testing.assert_allclose(to.position, position, rtol=1e-6)


@pytest.mark.parametrize("away", [1e2, 1e4, 1e6])
def test_a_wall_lights_a_plane_far_away(away):
    """Property: nothing blocks between them; rounding at the far end grows with the length of a ray."""
    wall = [rectangle((-1, k, 0), (2, 0, 0), (0, 1, 0)) for k in range(4)]
    ground = rectangle((-1e7, 0, 1e7), (2e7, 0, 0), (0, 0, -2e7))
    lamp = SpotLight((0.0, 2.0, 3.0), (0.0, 0.0, -1.0), 0.3, 0.5, (3.0, 2.0, 1.0))
    camera = Camera((0.0, 3.0, away), (0.0, 0.0, away + 3.0), (0, 1, 0), 0.5, 16, 16)
    frame = small(dataclasses.replace(scene([*wall, ground], lamp), camera=camera))
    assert (frame.gbuffer.triangle_id >= 8).all()
    free, open_ = (vpl(frame, of(VplSettings, lights=64, visibility=v)) for v in (True, False))
    assert open_.mean() > 0
    assert (free == open_).all()
    free, open_ = (trace_truth(frame, TruthSettings(estimator="light", samples=32, visibility=v)).mean
                   for v in (True, False))
    assert (free == open_).all()


def test_a_lamp_in_a_ceiling_lights_the_floor():
    """The ceiling that the lamp lies in must not block: shadows by rays, from below and for grazing rays."""
    floor, ceiling = quad(3.0), quad(3.0, 0.7)
    tracer = Tracer(geometry(np.concatenate([floor.vertices, ceiling.vertices]),
                             np.concatenate([floor.faces, ceiling.faces + 4])))
    x, z = np.meshgrid(np.linspace(-2.9, 2.9, 60), np.linspace(-2.9, 2.9, 60))
    position = np.stack([x, np.zeros_like(x), z])
    normal = np.stack([np.zeros_like(x), np.ones_like(x), np.zeros_like(x)])
    lamp = SpotLight((0.123, 0.7, -0.211), (0.0, -1.0, 0.0), 1.0, 1.5, (1.0, 1.0, 1.0))
    assert tracer.visible_from_light(position, normal, np.ones(x.shape, bool), lamp).all()


@pytest.mark.parametrize(("size", "shift"), [(1.0, 0.0), (1e-3, 0.0), (1e5, 0.0), (1.0, 100.0)])
def test_nothing_blocks_in_a_convex_room(size, shift):
    """Property: every segment between walls is free, at either end and at every length."""
    def place(corner):
        return tuple(size * np.asarray(corner, float) + shift)

    walls = [rectangle(place((-1, y, 1)), (2 * size, 0, 0), (0, 0, -2 * size)) for y in (0, 2)]
    walls += [rectangle(place((x, 0, -1)), (0, 2 * size, 0), (0, 0, 2 * size)) for x in (-1, 1)]
    walls += [rectangle(place((-1, 0, z)), (2 * size, 0, 0), (0, 2 * size, 0)) for z in (-1, 1)]
    lamp = SpotLight(place((0.4, 1.7, 0.5)), (-0.6, -0.8, -0.5), 0.4, 1.2, (3.0, 2.0, 1.0))
    camera = Camera(place((0.0, 1.2, 0.95)), place((0.1, 0.7, 0.0)), (0, 1, 0), 1.6, 24, 24)
    frame = small(dataclasses.replace(scene(walls, lamp), camera=camera))
    free, open_ = (vpl(frame, of(VplSettings, lights=128, visibility=v)) for v in (True, False))
    assert open_.mean() > 0
    assert (free == open_).all()
    free, open_ = (trace_truth(frame, TruthSettings(estimator="light", samples=32, visibility=v)).mean
                   for v in (True, False))
    assert (free == open_).all()


@pytest.mark.parametrize("off", [0.0, 1e-3, -1e-3])
def test_rays_go_on_above_the_face_whatever_their_distance_rounds_to(off):
    """A found point that is off its face by a millimetre: the next ray starts above the face by the offset alone."""
    plane = rectangle((-1, 0.3, 1), (2, 0.4, 0), (0, 0, -2))
    tables = surfaces(scene([plane], SpotLight((0, 5, 0), (0, -1, 0), 0.3, 0.4, (1, 1, 1))))
    for side in (1.0, -1.0):
        g = side * np.array([-0.2, 1.0, 0.0]) / np.hypot(0.2, 1)
        y = np.array([0.2, 0.3 + 0.2 * 1.2, 0.1]) + off * g
        assert height_above(tables, 0, tuple(y), tuple(g)) == pytest.approx(off, abs=1e-15)
        start = y + lift(tables, 0, tuple(y), tuple(g), 8.0) * g
        height = (start - (0.2, 0.3 + 0.2 * 1.2, 0.1)) @ g
        assert height == pytest.approx(4 * SINGLE * (np.abs(y).sum() + 8), abs=1e-15)


def own_hits(frame, rays=16):
    """Share of random rays from what the camera sees that hit the face they leave."""
    tracer, buffer = frame.tracer, frame.gbuffer
    to = receivers(frame.scene.geometry, buffer.position, buffer.normal, buffer.triangle_id, tracer.grain)
    origins, own = np.repeat(to.origin.T, rays, axis=0), np.repeat(buffer.triangle_id.reshape(-1)[to.pixel], rays)
    directions = np.random.default_rng(4).normal(size=origins.shape).astype(np.float32)
    facing = np.repeat(to.facing.T, rays, axis=0)
    directions *= np.sign((directions * facing).sum(axis=1, keepdims=True))
    triangle_id, distance = np.empty(len(own), np.int32), np.empty(len(own), np.float32)
    tracer.fill_closest(np.ascontiguousarray(origins), directions, np.full(len(own), np.inf, np.float32), triangle_id,
                        distance)
    return int((triangle_id == own).sum()), len(own)


@pytest.mark.parametrize("name", ["cornell_sphere:faces=80", "atrium:faces=10000", "stage"])
def test_no_ray_hits_the_face_it_leaves(name, evidence):
    hit, rays = own_hits(Frame(load_scene(name), width=96, height=96))
    assert hit == 0
    evidence(f"{name}: 0 of {rays} rays hit the face they leave")


@pytest.mark.parametrize("half", [1e2, 1e5, 1e8])
def test_no_ray_hits_a_huge_face_that_it_leaves(half):
    """Seen from 2 m above, a plane out to the horizon."""
    scene = load_scene("cornell_box")
    seen = with_plane_below(scene, half)
    camera = dataclasses.replace(scene.camera, eye=(0.0, 2.0, 3.0), target=(0.0, 1.0, 0.0))
    frame = Frame(dataclasses.replace(seen, camera=camera), width=64, height=64)
    assert (frame.gbuffer.triangle_id >= len(scene.geometry.faces)).sum() > 500
    assert own_hits(frame)[0] == 0


@pytest.mark.filterwarnings("ignore:.*zero area")
@pytest.mark.parametrize("name", sorted(p.stem for p in DATA.glob("*.json")) if DATA.is_dir() else [])
def test_no_ray_hits_the_face_it_leaves_in_real_scenes(name, evidence):
    hit, rays = own_hits(Frame(load_scene(str(DATA / f"{name}.json")), width=96, height=96))
    assert hit == 0
    evidence(f"{name}: 0 of {rays} rays hit the face they leave")

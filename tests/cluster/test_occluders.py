"""What is left out of every map: only triangles that no segment between two points of the scene can meet."""

import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refgi.cluster.occluders import Ends, blockers, ends_of, everywhere, occluders
from refgi.frame import Frame
from refgi.lights.selection import choose_lights
from refgi.lights.settings import LightSettings
from refgi.rsm.buffers.extent import Extent
from refgi.scene import load_scene
from refgi.stages import Memory, observe
from tests.cluster.lights import surface_points
from tests.rsm.shapes import geometry

# An end of a segment this near a plane, as a share of the scene's diagonal, lies in it: the stated 1e-6, and rounding.
IN_THE_PLANE = 1.1e-6
IN_THE_PLANE_OF_FLOAT32 = 2e-6  # the same for rays, whose triangles are rounded to float32


def box(low=(0, 0, 0), high=(1, 1, 1)):
    """Twelve triangles of a box."""
    vertices = np.array([[(low, high)[i >> axis & 1][axis] for axis in range(3)] for i in range(8)], float)
    quads = [(0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5)]
    return geometry(vertices, [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))])


def together(*shapes):
    offsets = np.cumsum([0] + [len(shape.vertices) for shape in shapes])
    return geometry(np.concatenate([shape.vertices for shape in shapes]),
                    np.concatenate([shape.faces + at for shape, at in zip(shapes, offsets, strict=False)]))


def crossed(starts, ends, corners, near):
    """Tell which segments cross which triangles' planes within them, with both ends farther than `near` from these."""
    a, b, c = (corners[:, i] for i in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    height = [np.einsum("tk,stk->st", normal, p[:, None] - a) for p in (starts, ends)]
    across = (height[0] * height[1] < 0) & (np.abs(height).min(axis=0) > near)
    segment, triangle = np.nonzero(across)
    share = (height[0] / np.where(across, height[0] - height[1], 1))[segment, triangle, None]
    hit = starts[segment] + share * (ends - starts)[segment]
    side = [np.einsum("ik,ik->i", normal[triangle], np.cross((q - p)[triangle], hit - p[triangle]))
            for p, q in ((a, b), (b, c), (c, a))]
    return np.min(side, axis=0) >= 0 if len(hit) else np.zeros(0, bool)


def test_a_boxs_walls_block_nothing():
    assert not occluders(box()).any()


def test_what_stands_in_a_box_does():
    shape = together(box(), box((0.3, 0, 0.3), (0.6, 0.5, 0.7)))
    kept = occluders(shape)
    assert not kept[:12].any()
    on_the_floor = (shape.vertices[shape.faces][:, :, 1] == 0).all(axis=1)
    np.testing.assert_array_equal(kept[12:], ~on_the_floor[12:])
    drawn = blockers(shape, True)
    np.testing.assert_array_equal(drawn.vertices[drawn.faces], shape.vertices[shape.faces[kept]])
    assert len(drawn.vertices) == 8


def test_a_sphere_seen_from_within_blocks_nothing_but_a_dent_does():
    shape = load_scene("integrating_sphere").geometry
    assert not occluders(shape).any()
    vertices = shape.vertices.copy()
    dent = int(np.argmax(vertices[:, 1]))
    vertices[dent] *= 0.9
    touched = (shape.faces == dent).any(axis=1)
    assert occluders(geometry(vertices, shape.faces))[touched].all()


def test_flat_and_degenerate_scenes():
    square = geometry([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]], [[0, 1, 2], [0, 2, 3]])
    assert not occluders(square).any()
    point = geometry([[1, 2, 3]] * 3, [[0, 1, 2]])
    assert not occluders(point).any()
    assert not occluders(geometry(np.zeros((0, 3)), np.zeros((0, 3), int))).any()


def test_where_nothing_is_seen_and_nothing_shines_nothing_blocks():
    room = geometry([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    point = Extent(np.zeros(3), np.zeros(3))
    nowhere = Ends(np.zeros((0, 3)), point, point)
    assert not occluders(room, nowhere).any()
    assert len(blockers(room, alone=True, ends=nowhere).faces) == 0


def test_the_hull_decides_as_all_points_do(monkeypatch):
    ball = load_scene("integrating_sphere:faces=2000").geometry
    radius = np.random.default_rng(1).choice([1, 0.999], len(ball.vertices))  # dents that a sketch does not show
    shape = geometry(ball.vertices * radius[:, None], ball.faces)
    plain = occluders(shape)
    assert 0.05 < plain.mean() < 0.95
    monkeypatch.setattr(sys.modules[occluders.__module__], "FEW_PAIRS", 0)
    np.testing.assert_array_equal(occluders(shape), plain)
    flat = geometry([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]], [[0, 1, 2], [0, 2, 3]])
    assert not occluders(flat).any()


@settings(max_examples=40)
@given(seed=st.integers(0, 2**32 - 1), solids=st.integers(1, 4), loose=st.integers(0, 12), turned=st.booleans())
def test_no_segment_between_two_points_of_a_scene_meets_what_was_left_out(seed, solids, loose, turned):
    rng = np.random.default_rng(seed)
    shapes = [box(*np.sort(rng.uniform(-1, 1, (2, 3)), axis=0)) for _ in range(solids)]
    shapes += [geometry(rng.uniform(-1, 1, (3, 3)), [[0, 1, 2]]) for _ in range(loose)]
    shape = together(*shapes)
    if turned:
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        shape = geometry(shape.vertices @ turn, shape.faces)
    points, _ = surface_points(shape, 200, rng)
    kept, starts, ends, near = occluders(shape), points.T[:100], points.T[100:], IN_THE_PLANE * shape.diagonal
    assert not crossed(starts, ends, shape.vertices[shape.faces[~kept]], near).any()


@pytest.mark.parametrize("name", ["cornell_horse", "kitchen"])
@pytest.mark.filterwarnings("ignore::refgi.errors.RefgiWarning")
def test_real_scenes_by_rays(name, data_dir, evidence):
    from refgi.rays import Tracer

    shape = load_scene(data_dir / f"{name}.json").geometry
    kept = occluders(shape)
    left_out = geometry(shape.vertices, shape.faces[~kept])
    rng = np.random.default_rng(2)
    points, _ = surface_points(shape, 40000, rng)
    starts, ends = points.T[:20000], points.T[20000:]
    hits = Tracer(left_out).closest(starts, ends - starts, 1.0)
    met = hits.triangle_id >= 0
    a, b, c = shape.vertices[left_out.faces[hits.triangle_id[met]]].swapaxes(0, 1)
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    height = np.abs([((p[met] - a) * normal).sum(axis=1) for p in (starts, ends)]).min(axis=0)
    assert height.max(initial=0.0) < IN_THE_PLANE_OF_FLOAT32 * shape.diagonal
    evidence(f"{name}: {len(left_out.faces)} of {len(shape.faces)} triangles left out; 20000 segments meet none but "
             "with an end in its plane")


def test_an_animation_finds_them_once():
    shape, memory = box(), Memory()
    for _ in range(2):
        with observe(memory=memory) as log:
            blockers(shape, True)
    assert log.status("cluster.blockers") == ["reused"]
    assert log.status("cluster.occluders") == ["reused"]


def within(shape, *more):
    """Ends of light anywhere on a mesh and at some more places."""
    ends = everywhere(shape)
    points = np.concatenate([ends.points, np.reshape(more, (-1, 3))])
    box = Extent(points.min(axis=0), points.max(axis=0))
    return Ends(points, box, box)


@pytest.mark.parametrize("half", [1e1, 1e4, 1e8])
def test_what_lies_outside_of_all_that_takes_part_blocks_nothing(half):
    """A plane below a room: neither it nor the floor, which is on the hull of the room but not of the scene."""
    room = together(box(), box((0.3, 0.2, 0.3), (0.6, 0.5, 0.7)))
    plane = geometry(half * np.array([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]]) - [0, 0.1, 0],
                     [[0, 1, 2], [0, 2, 3]])
    shape, alone = together(room, plane), occluders(room)
    assert alone[12:].all()
    np.testing.assert_array_equal(occluders(shape, within(room)), [*alone, False, False])
    np.testing.assert_array_equal(occluders(shape, within(room), touching=True), [True] * 24 + [False] * 2)
    for alone_drawn in (True, False):
        drawn, plain = blockers(shape, alone_drawn, within(room)), blockers(room, alone_drawn)
        np.testing.assert_array_equal(drawn.vertices[drawn.faces], plain.vertices[plain.faces])
    light_below = within(room, (0.5, -0.2, 0.5))
    assert occluders(shape, light_below)[-2:].any()  # light comes through the plane


def test_light_ends_where_the_camera_looks_and_where_it_begins():
    scene = load_scene("cornell_box")
    frame = Frame(scene, width=16, height=16, rsm_resolution=32)
    lights = choose_lights(frame, LightSettings(20))
    seen = np.unique(frame.gbuffer.triangle_id[frame.gbuffer.covered])
    assert 0 < len(seen) < scene.face_count
    corners = scene.geometry.vertices[np.unique(scene.geometry.faces[seen])]
    ends = ends_of(frame, lights)
    np.testing.assert_array_equal(ends.points, np.concatenate([corners, lights.position.T.astype(float)]))
    assert ends.visible is frame.visible_extent
    assert all(map(np.array_equal, ends.extent, frame.extent))
    assert ends.illuminated is frame.illuminated_extent

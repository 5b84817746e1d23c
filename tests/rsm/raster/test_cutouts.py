"""Cut-outs on maps: what a literal ray sees, what rays of Embree see, and the same as a mesh cut by hand."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.jit import threads
from refgi.rays import Tracer
from refgi.rsm import camera_projection, paraboloid_depth_maps
from refgi.rsm.raster.projection import cube_projection, paraboloid_projection
from refgi.rsm.raster.visibility_buffer import rasterize
from refgi.scene import Camera, Geometry, Image, Material, PointLight, Scene, Texture, load_scene
from refgi.scene.triangles import cut_outs
from tests.cutouts import heap, holed_quad, opaque
from tests.naive import cutouts as naive
from tests.rsm.raster.test_against_embree import edge_distance, pixel_rays
from tests.rsm.raster.test_raster import RAYS, projections
from tests.rsm.shapes import geometry, height_field, soup

DOUBT = 1e-6  # of alpha or a barycentric coordinate: nearer decisions are rounding, as is nearness in float32
NEAR_EDGE = 1e-3  # px
ROUNDED = 1e-7  # of a ray's origin and direction: float32
NAMES = tuple(projections())


def texel_rays(projection):
    """Origin and direction of every third texel of the stacked maps, None outside a disc."""
    for row in range(projection.shape[0]):
        m, local = divmod(row, projection.height)
        for column in range(row % 3, projection.width, 3):
            yield row, column, RAYS[projection.kind](projection.origin[m], projection.frame[m], projection.half,
                                                     projection.height, projection.width, local, column)


@pytest.mark.feature("REF-28")
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("chosen", ["nearest", "trilinear"])
def test_ids_are_those_of_a_literal_ray(name: str, chosen: str, evidence: Callable[[str], None]) -> None:
    scene, projection = heap(18, chosen=chosen), projections()[name]
    seen, doubtful, through = rasterize(scene.geometry, projection), 0, 0
    for row, column, ray in texel_rays(projection):
        if ray is None:
            assert seen.triangle_id[row, column] == -1
            continue
        found = naive.hits(*ray, scene.geometry, scene.materials)
        face, _, margin = naive.first(found)
        through += len(found) > 0 and face != found[0][1]
        if margin < DOUBT:
            doubtful += 1
        else:
            assert seen.triangle_id[row, column] == face
    texels = seen.triangle_id.size // 3
    evidence(f"{name}, {chosen}: {through} of {texels} texels see through holes, {doubtful} in doubt")
    assert through > 15
    assert doubtful <= 1


@pytest.mark.feature("REF-28")
def test_nearness_is_that_of_what_is_seen_behind() -> None:
    scene, projection = heap(18), projections()["perspective"]
    seen = rasterize(scene.geometry, projection)
    for row, column, ray in texel_rays(projection):
        face, t, margin = naive.nearest(*ray, scene.geometry, scene.materials)
        if margin >= DOUBT:
            expected = 0.0 if face < 0 else 1 / t
            assert seen.inverse_depth[row, column] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("name", NAMES)
def test_bits_do_not_depend_on_threads_bands_or_order(name: str) -> None:
    scene, projection = heap(60), projections()[name]
    with threads(1):
        expected = rasterize(scene.geometry, projection)
    for rows in (1, 7, 64):
        with threads(2):
            found = rasterize(scene.geometry, projection, band_rows=rows)
        for one, other in zip(found, expected, strict=True):
            np.testing.assert_array_equal(one, other)
    order = np.random.default_rng(5).permutation(60)
    shape = dataclasses.replace(scene.geometry, faces=scene.geometry.faces[order], uv=scene.geometry.uv[order],
                                material_of_face=scene.geometry.material_of_face[order])
    found = rasterize(shape, projection)
    np.testing.assert_array_equal(found.inverse_depth, expected.inverse_depth)
    np.testing.assert_array_equal(np.append(order, -1)[found.triangle_id], expected.triangle_id)


@pytest.mark.feature("REF-28")
@pytest.mark.parametrize("name", NAMES)
def test_of_coincident_triangles_the_first_that_is_there_is_seen(name: str) -> None:
    """The same triangles whole and with holes, either first: where there is a hole the whole one is seen."""
    scene, projection = heap(12), projections()[name]
    shape, count = scene.geometry, scene.face_count
    for whole_first in (True, False):
        of = [np.zeros(count, np.int32), np.ones(count, np.int32)]
        both = dataclasses.replace(shape, faces=np.concatenate([shape.faces] * 2), uv=np.concatenate([shape.uv] * 2),
                                   material_of_face=np.concatenate(of if whole_first else of[::-1]))
        found = rasterize(both, projection).triangle_id
        holes = rasterize(dataclasses.replace(shape, material_of_face=of[1]), projection).triangle_id
        whole = rasterize(dataclasses.replace(shape, material_of_face=of[0]), projection).triangle_id
        np.testing.assert_array_equal(np.where(found >= 0, found % count, -1), whole)
        nearest_is_there = holes == whole
        expected = whole if whole_first else np.where(nearest_is_there | (whole < 0), whole, whole + count)
        assert (found == expected).all()
        assert (~nearest_is_there).any()


def test_scenes_without_holes_are_drawn_as_ever() -> None:
    """Bits, and not a second pass."""
    scene = opaque(heap(30))
    assert scene.geometry.cut is None
    assert scene.geometry.without_cut is scene.geometry.faces
    bare = Geometry(scene.geometry.vertices, scene.geometry.faces, scene.geometry.material_of_face)
    for projection in projections().values():
        for one, other in zip(rasterize(scene.geometry, projection), rasterize(bare, projection), strict=True):
            np.testing.assert_array_equal(one, other)


def excess_at(scene: Scene, face: int, origin: np.ndarray, direction: np.ndarray) -> float:
    """How far alpha is above the cutoff where a ray meets a face's plane."""
    shape = scene.geometry
    weights = naive.barycentric(shape.vertices[shape.faces[face]], origin, direction)
    return naive.excess(scene.materials[shape.material_of_face[face]], *(weights @ shape.uv[face]))


def is_on_mask_edge(scene: Scene, face: int, origin: np.ndarray, direction: np.ndarray) -> bool:
    """Whether a ray that is off by the rounding of float32 may find the other answer of the mask."""
    random, scale = np.random.default_rng(1), np.abs(direction).max()
    found = [excess_at(scene, face, origin + ROUNDED * np.abs(origin).max() * random.uniform(-1, 1, 3),
                       direction + ROUNDED * scale * random.uniform(-1, 1, 3)) for _ in range(64)]
    return min(found) <= 0 <= max(found)


@pytest.mark.feature("REF-28")
@pytest.mark.parametrize("name", ["leaf_grid", "leaf_grid:leaves=20000,texels=1024"])
def test_rasterizer_and_rays_see_the_same_leaves(name: str, evidence: Callable[[str], None]) -> None:
    """But for texels on a triangle's edge, or where alpha is the cutoff within the ray's rounding."""
    scene, on_edge, on_mask, leaves = load_scene(name), 0, 0, 0
    tracer, is_cut = Tracer(scene.geometry), scene.geometry.cut.of_face >= 0
    for eye in ((0.15, 1.0, 3.3), (2.3, 2.1, 1.7), (0.03, 0.31, 0.02)):
        camera = dataclasses.replace(scene.camera, eye=eye, target=(0.1, 0.9, -0.3))
        projection = camera_projection(camera, 512, 512)
        origins, directions = pixel_rays(projection)
        seen = rasterize(scene.geometry, projection).triangle_id.reshape(-1)
        met = tracer.closest(origins, directions).triangle_id
        leaves += int(is_cut[seen[seen >= 0]].sum())
        for k in np.flatnonzero(seen != met):
            faces = [face for face in (seen[k], met[k]) if face >= 0]
            edges = [edge_distance(projection, scene.geometry, np.array([face]), np.array([k]))[0] for face in faces]
            if min(edges) < NEAR_EDGE:
                on_edge += 1
            else:
                on_mask += 1
                assert any(is_cut[face] and is_on_mask_edge(scene, face, origins[k], directions[k]) for face in faces)
    evidence(f"{name}, three views: {on_edge + on_mask} of {3 * 512**2} ids differ, {on_edge} on a triangle's edge, "
             f"{on_mask} on a mask's; {leaves} texels show leaves")
    assert leaves > 100_000
    assert on_edge + on_mask < 20


@pytest.mark.feature("REF-28")
def test_a_cut_out_is_the_mesh_that_is_cut_along_its_edge(evidence: Callable[[str], None]) -> None:
    cut, mesh = holed_quad()
    total = 0
    for projection in (camera_projection(cut.camera), cube_projection((0.3, 0.5, 1.2), 64),
                       paraboloid_projection([(0.3, 0.5, 1.2)], [(0.1, 0, -1.0)], 96)):
        one, other = (rasterize(scene.geometry, projection).triangle_id for scene in (cut, mesh))
        np.testing.assert_array_equal(one >= 2, other >= 2)
        np.testing.assert_array_equal(np.where(one >= 2, 2, one), np.where(other >= 2, 2, other))
        total += int((one >= 2).sum())
    evidence(f"{total} texels on three maps, none differs")
    assert total > 2000


@pytest.mark.feature("REF-28")
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_paraboloid_depth_maps_show_what_lies_behind_holes(dtype: type) -> None:
    scene = heap(18)
    centres, axes = np.array([[0.1, 0.2, 0.05], [0.0, 0.0, 3.0]]), np.array([[1, 2, 0.5], [0.1, 0.0, -1.0]])
    maps = paraboloid_depth_maps(scene.geometry, centres, axes, 24, dtype)
    projection, through = paraboloid_projection(centres, axes, 24), 0
    for row, column, ray in texel_rays(projection):
        if ray is None:
            continue
        found = naive.hits(*ray, scene.geometry, scene.materials)
        face, t, margin = naive.first(found)
        through += len(found) > 0 and face != found[0][1]
        if margin >= DOUBT:
            assert maps[row // 24, row % 24, column] == pytest.approx(t, rel=3e-6)
    assert through > 15


def test_a_material_without_texels_is_there_or_not_as_a_whole() -> None:
    scene = heap(18)
    for alpha, cutoff, there in ((0.4, 0.5, False), (0.5, 0.5, True), (1.0, 1.5, False), (0.0, 0.0, True)):
        material = Material("all or nothing", alpha=alpha, cutoff=cutoff)
        chosen = dataclasses.replace(scene, materials=(material,) * 3)
        assert (chosen.geometry.cut is None) == there
        for projection in projections().values():
            assert (rasterize(chosen.geometry, projection).triangle_id >= 0).any() == there


@pytest.mark.feature("REF-28")
def test_the_picture_and_the_map_of_a_light_see_through_holes() -> None:
    scene = heap(18)
    frame, whole = (Frame(one, rsm_resolution=32) for one in (scene, opaque(scene)))
    assert (frame.gbuffer.triangle_id != whole.gbuffer.triangle_id).any()
    assert (frame.rsms[0].triangle_id != whole.rsms[0].triangle_id).any()
    assert (frame.direct != whole.direct).any()


def test_triangles_that_cross_the_plane_of_the_eye() -> None:
    """A camera in the middle of the heap."""
    scene = heap(30)
    camera = Camera((0.1, 0.05, -0.1), (1.0, 0.3, 0.2), vfov=2.0, width=40, height=40)
    lamp = PointLight((0.1, 0.05, -0.1), (1.0, 1.0, 1.0))
    seen = Frame(dataclasses.replace(scene, camera=camera, lights=(lamp,))).gbuffer.triangle_id
    for row, column, ray in texel_rays(camera_projection(camera)):
        face, _, margin = naive.nearest(*ray, scene.geometry, scene.materials)
        assert margin < DOUBT or seen[row, column] == face


def asked(shape: Geometry, which: slice = slice(None)) -> Geometry:
    """Return a geometry of which some triangles ask a mask that has a hole, though not where they lie on it."""
    pixels, alpha = np.zeros((1, 4, 3), np.uint8), np.array([[255, 255, 255, 0]], np.uint8)
    leaf = Material("leaf", texture=Texture(Image(pixels, "mostly", alpha), ("clamp", "clamp")), cutoff=0.5)
    of_face = np.zeros(len(shape.faces), np.int32)
    of_face[which] = 1
    return dataclasses.replace(shape, material_of_face=of_face, uv=np.full((len(of_face), 3, 2), 0.25),
                               cut_outs=cut_outs((Material(), leaf)))


SHAPES: dict[str, tuple[Geometry, slice]] = {
    "all": (soup(np.random.default_rng(2), 40), slice(None)),
    "some": (soup(np.random.default_rng(3), 40), slice(0, 40, 3)),
    "flat": (geometry([[0, 0, 0], [0, 1, 0], [1, 0, 0.2]], [[0, 0, 0], [0, 1, 0], [0, 1, 2]]), slice(None)),
    "many": (height_field(3000), slice(1, 3000, 2)),
    "edge-on": (geometry([[-9, -9, -3], [9, -9, -3], [9, 9, -3], [-1, 0.2, 5], [1, 0.2, 5], [0.2, 0.2, -7]],
                         [[0, 1, 2], [3, 4, 5]]), slice(None))}


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("kind", SHAPES)
def test_what_is_there_everywhere_has_the_bits_of_a_whole_triangle(kind: str, name: str) -> None:
    shape, which = SHAPES[kind]
    assert len(asked(shape, which).cut.face) > 0
    for one, other in zip(rasterize(asked(shape, which), projections()[name]), rasterize(shape, projections()[name]),
                          strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("kind", SHAPES)
@pytest.mark.parametrize("eye", [(0.1, 0.2, 0.05), (0.0, 0.2, 2.0)])
def test_distances_of_what_is_there_everywhere_have_the_same_bits(kind: str, eye: tuple[float, float, float]) -> None:
    shape, which = SHAPES[kind]
    maps = [paraboloid_depth_maps(each, [eye] * 2, [(1, 2, 0.5), (0.1, 0, -1)], 40) for each in (
        shape, asked(shape, which))]
    np.testing.assert_array_equal(*maps)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e4])
def test_a_plane_past_the_eye_hides_what_its_distance_says(size: float) -> None:
    """As in `test_raster`: a plane nearer than 1e-9 of a triangle's size holds the eye."""
    shape = asked(geometry(size * np.array([[-1.0, 0, 0.5], [1, 0, 0.5], [0.1, 0, -3]]), [[0, 1, 2]]))
    for height, seen in ((3e-8, True), (1e-11, False)):
        eye, ahead = (0.0, height * size, 0.0), (0.0, height * size, -size)
        for projection in (camera_projection(Camera(eye, ahead, width=9, height=9)), cube_projection(eye, 9)):
            assert (rasterize(shape, projection).triangle_id == 0).any() == seen

"""The rasterizer against Embree's rays through the same texel centres, on the same float32 vertices."""

import dataclasses

import numpy as np
import pytest
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from refgi.rsm import camera_projection, paraboloid_depth_maps, rasterize
from refgi.rsm.raster.projection import cube_projection, paraboloid_projection
from refgi.scene import load_scene
from tests.naive import raster as naive
from tests.rsm.shapes import geometry, soup

NEAR_EDGE = 1e-3  # px
SAME_DEPTH = 3e-6  # relative; Embree's t is worst at grazing angles, 2e-5 there; coincident faces have equal depth
GRAZING = 2e-5
REAL = ("sponza", "kitchen", "quake_e1m1", "dragon_bunny", "cornell_horse", "flying_bunnies")


def embree(shape):
    scene = EmbreeScene()
    TriangleMesh(scene, shape.vertices.astype(np.float32), np.ascontiguousarray(shape.faces))
    return scene


def rounded(shape):
    """The geometry as Embree keeps it."""
    return geometry(shape.vertices.astype(np.float32), shape.faces)


def pixel_rays(projection):
    """Rays of a single perspective map, row by row."""
    row, column = np.mgrid[: projection.height, : projection.width] + 0.5
    x = projection.half[0] * (2 * column / projection.width - 1)
    y = projection.half[1] * (2 * row / projection.height - 1)
    local = np.stack([x, y, np.ones_like(x)], axis=-1).reshape(-1, 3)
    directions = local @ projection.frame[0]
    return np.broadcast_to(projection.origin[0], directions.shape), directions


def edge_distance(projection, shape, face, index):
    """Distance of texel centres to the nearest of a triangle's three lines on the map, px."""
    row, column = np.divmod(index, projection.width)
    local = (shape.vertices[shape.faces[face]] - projection.origin[0]) @ projection.frame[0].T
    depth = local[..., 2]
    x = (local[..., 0] / projection.half[0] + depth) * projection.width / 2
    y = (local[..., 1] / projection.half[1] + depth) * projection.height / 2
    v = np.stack([x, y, depth], axis=-1)
    lines = np.cross(np.roll(v, -1, axis=1), np.roll(v, -2, axis=1))
    value = lines[..., 0] * (column + 0.5)[:, None] + lines[..., 1] * (row + 0.5)[:, None] + lines[..., 2]
    return (np.abs(value) / np.hypot(lines[..., 0], lines[..., 1])).min(axis=1)


def compare(scene, size):
    """Count texels where the ids differ: in all, near an edge, on coincident faces, for another reason."""
    shape = rounded(scene.geometry)
    camera = dataclasses.replace(scene.camera, eye=tuple(map(float, np.float32(scene.camera.eye))))
    projection = camera_projection(camera, size, size)
    origins, directions = pixel_rays(projection)
    hits = embree(shape).run(origins.astype(np.float32), directions.astype(np.float32), output=True)
    ids = rasterize(shape, projection)
    ours, theirs = ids.triangle_id.reshape(-1), hits["primID"]
    index = np.flatnonzero(ours != theirs)
    near = np.zeros(len(index), bool)
    for side in (ours, theirs):
        seen = side[index] >= 0
        near[seen] |= edge_distance(projection, shape, side[index][seen], index[seen]) < NEAR_EDGE
    depth = ids.inverse_depth.reshape(-1)[index] * hits["tfar"][index]
    coincident = ~near & (np.abs(depth - 1) < SAME_DEPTH)
    return len(index), near.sum(), coincident.sum(), (~near & ~coincident).sum()


@pytest.mark.parametrize("name", ["cornell_box", "cornell_sphere", "atrium:faces=100000", "wedge"])
def test_ids_on_built_in_scenes(name, evidence):
    total, near, coincident, other = compare(load_scene(name), 512)
    assert other == 0
    evidence(f"{name}: {total} of 262144 differ, {near} near an edge, {coincident} on coincident faces")


@pytest.mark.feature("SII-01")
@pytest.mark.parametrize("name", REAL)
@pytest.mark.filterwarnings("ignore::refgi.errors.RefgiWarning")
def test_ids_on_real_scenes(name, data_dir, evidence):
    scene = load_scene(data_dir / f"{name}.json")
    total, near, coincident, other = compare(scene, 512)
    assert other == 0
    evidence(f"{name}: {total} of 262144 ids differ from Embree's, {near} near an edge, {coincident} coincident")


def test_paraboloid_distances_are_those_of_rays():
    shape = rounded(load_scene("cornell_sphere").geometry)
    centers = np.array([[0.1, 0.3, 0.2], [0.4, 0.5, 0.1], [0.3, 0.05, 0.4]])
    axes = np.array([[1, 0.2, -0.3], [0, -1, 0], [-0.5, 0.8, 0.1]])
    n = 96
    maps = paraboloid_depth_maps(shape, centers, axes, n)
    assert maps.shape == (3, n, n)
    frames = paraboloid_projection(centers, axes, n).frame
    scene = embree(shape)
    s, t = np.meshgrid(*[(2 * np.arange(n) + 1) / n - 1] * 2)
    square = s * s + t * t
    local = np.stack([2 * s, 2 * t, 1 - square], axis=-1) / (1 + square)[..., None]
    for m in range(3):
        directions = (local @ frames[m]).reshape(-1, 3).astype(np.float32)
        hits = scene.run(np.broadcast_to(centers[m].astype(np.float32), directions.shape), directions, output=True)
        expected = np.where(hits["primID"] >= 0, hits["tfar"], np.inf).reshape(n, n)
        expected[square > 1] = np.inf
        with np.errstate(invalid="ignore"):
            off = np.abs(maps[m] / expected - 1) > GRAZING
        assert off.mean() < 2e-3  # texels within rounding of a silhouette
        np.testing.assert_array_equal(np.isinf(maps[m]), np.isinf(expected))


def test_paraboloid_distances_float64_are_exact():
    shape, centers, axes = soup(np.random.default_rng(3), 50), np.array([[0.1, 0.2, 0.0]]), np.array([[1.0, 2, 0.5]])
    single = paraboloid_depth_maps(shape, centers, axes, 24)
    double = paraboloid_depth_maps(shape, centers, axes, 24, np.float64)
    projection = paraboloid_projection(centers, axes, 24)
    hits = 0
    for row in range(24):
        for column in range(24):
            ray = naive.paraboloid_ray(centers[0], projection.frame[0], (1, 1), 24, 24, row, column)
            if ray is None:
                assert np.isinf(double[0, row, column])
                continue
            winner, t, _, margin = naive.nearest(*ray, shape.vertices, shape.faces)
            if margin > 1e-6:
                assert np.isinf(double[0, row, column]) == (winner < 0)
                if winner >= 0:
                    assert double[0, row, column] == pytest.approx(t, rel=1e-12)
                    assert single[0, row, column] == pytest.approx(t, rel=3e-7)
                    hits += 1
    assert hits > 100


def test_large_triangles_reach_every_texel_of_a_paraboloid_map():
    rng = np.random.default_rng(12)
    projection = paraboloid_projection([(0, 0, 0)], [(0.3, 1, 0.2)], 40)
    for _ in range(30):
        shape = geometry(rng.normal(size=(3, 3)) * 10 ** rng.uniform(-1, 2, (3, 1)), [[0, 1, 2]])
        seen = rasterize(shape, projection).triangle_id
        for row in range(0, 40, 3):
            for column in range(40):
                ray = naive.paraboloid_ray((0, 0, 0), projection.frame[0], (1, 1), 40, 40, row, column)
                if ray is not None:
                    winner, _, _, margin = naive.nearest(*ray, shape.vertices, shape.faces)
                    if margin > 1e-9:
                        assert seen[row, column] == winner


@pytest.mark.feature("SII-02")
def test_a_million_rays_inside_a_closed_scene_find_a_surface(evidence):
    shape = load_scene("integrating_sphere").geometry
    texels = 0
    for eye in np.random.default_rng(1).uniform(-0.3, 0.3, (4, 3)) * shape.bounds[1].max():
        seen = rasterize(shape, cube_projection(eye, 220))
        assert (seen.triangle_id >= 0).all()
        texels += seen.triangle_id.size
    evidence(f"no hole in {texels} texels of cubes inside a closed sphere of {len(shape.faces)} faces")

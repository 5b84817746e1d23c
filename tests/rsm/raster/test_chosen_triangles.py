"""Triangles that float32 bounds pass over on paraboloid maps, and small ones drawn together: maps keep their bits."""

import numpy as np
import pytest

from refgi.rsm.raster import paraboloid
from refgi.rsm.raster.paraboloid import Ignored, draw_distances, draw_paraboloids
from refgi.rsm.raster.paraboloid_batch import AHEAD, ANY, BEHIND, BOX, KINDS, MOST, STATE, gather, sort_chunk, transform
from refgi.rsm.raster.paraboloid_texels import scratch
from refgi.rsm.raster.projection import paraboloid_projection
from refgi.rsm.raster.triangle import CHUNK, chunks
from tests.rsm.shapes import geometry, rotation, soup, sphere

FAR = 10 * MOST  # of a box: beyond what float32 bounds are asked for


def unbounded(laid):
    """Chunks of which every triangle is set up in float64 and drawn row by row."""
    return laid._replace(box=np.tile([-FAR, -FAR, -FAR, FAR, FAR, FAR], (len(laid.box), 1)))


def moved(shape, shift, scale, rng):
    return geometry(scale * (shape.vertices @ rotation(rng).T + shift), shape.faces)


def shell(rng, count, radius, size):
    """Small triangles about as far from the origin as a ball reaches that is cut away."""
    outward = rng.normal(size=(count, 1, 3))
    outward *= radius / np.linalg.norm(outward, axis=2, keepdims=True)
    return geometry(outward + rng.normal(0, size, (count, 3, 3)), np.arange(3 * count))


SHAPES = {
    "dense": lambda _: sphere(60, 1.0, (0, 0, 0.4)),
    "dust": lambda rng: soup(rng, 4000, 1.0, 0.004),
    "mixed": lambda rng: soup(rng, 1500, 1.0, rng.choice([0.003, 0.02, 0.1, 0.6], (1500, 1, 1))),
    "slivers": lambda rng: soup(rng, 1500, 1.0, np.array([0.3, 1e-5, 1e-3])),
    "degenerate": lambda rng: geometry(soup(rng, 900, 1.0, 0.01).vertices, np.arange(2700) - (np.arange(2700) % 3 > 1)),
    "near": lambda rng: soup(rng, 3000, 0.02, 0.002),
    "shell": lambda rng: shell(rng, 3000, 0.6, 0.006),
    "on the axes": lambda rng: geometry(np.round(soup(rng, 1500, 1.0, 0.05).vertices * 32) / 32, np.arange(4500)),
}


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize(("size", "scale", "shift"), [
    (20, 1.0, 0.0), (33, 1e-3, 0.0), (256, 100.0, 30.0), (64, 1e-9, 0.0), (97, 1.0, 1e6), (512, 1.0, 0.0)])  # fmt: skip
def test_distances_keep_their_bits(name, size, scale, shift):
    rng = np.random.default_rng([size, len(name)])
    shape = SHAPES[name](rng)
    centers = np.concatenate([[[0.0, 0, 0]], rng.uniform(-0.7, 0.7, (3, 3))])
    if name != "on the axes" or shift:
        shape = moved(shape, shift, scale, rng)
    else:
        shape = geometry(scale * shape.vertices, shape.faces)
    maps = paraboloid_projection(scale * (centers + shift), [(0, 0, 1.0), *rng.normal(size=(3, 3))], size)
    laid = chunks(shape.vertices, shape.faces)
    none, radius = np.zeros(4), scale * np.array([0.6, 0.01, 0.2, 0.0])
    for ignored in (Ignored(none, none), Ignored(none, radius), Ignored(radius, none)):
        drawn, plain = np.empty((2, 4 * size, size))
        found = draw_distances(maps, laid, ignored, 2, drawn)
        expected = draw_distances(maps, unbounded(laid), ignored, 1, plain)
        np.testing.assert_array_equal(drawn.view(np.int64), plain.view(np.int64))
        np.testing.assert_array_equal(found, expected)
        single, plain = np.empty((2, 4 * size, size), np.float32)
        draw_distances(maps, laid, ignored, 2, single)
        draw_distances(maps, unbounded(laid), ignored, 1, plain)
        np.testing.assert_array_equal(single.view(np.int32), plain.view(np.int32))
    assert np.isfinite(drawn).any() or name == "degenerate"


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("half", [1.0, 0.8])
def test_ids_keep_their_bits(name, half, monkeypatch):
    rng = np.random.default_rng(7)
    shape = SHAPES[name](rng)
    twice = np.concatenate([shape.faces, shape.faces])  # of two in one place the first is seen
    maps, found = paraboloid_projection([(0.0, 0, 0)], [(0.1, 0.2, 1.0)], 128, half), []
    for lay in (chunks, lambda *triangles: unbounded(chunks(*triangles))):
        monkeypatch.setattr(paraboloid, "chunks", lay)
        nearness, ids = np.empty((128, 128), np.float32), np.empty((128, 128), np.int32)
        draw_paraboloids(maps, shape.vertices, twice, 1, nearness, ids)
        found += [nearness.view(np.int32), ids]
    np.testing.assert_array_equal(found[0], found[2])
    np.testing.assert_array_equal(found[1], found[3])
    assert len(shape.faces) > found[1].max() >= (-1 if name == "degenerate" else 0)


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("size", [16, 256, 1024])
def test_kinds_hold_for_float64(name, size):
    rng = np.random.default_rng(size)
    shape = SHAPES[name](rng)
    laid = chunks(shape.vertices, shape.faces)
    work, passed, small = scratch(), 0, 0
    for ball in (0.0, 0.3):
        maps = paraboloid_projection([rng.uniform(-0.5, 0.5, 3)], [rng.normal(size=3)], size)
        view = (*maps.origin[0].tolist(), *maps.frame[0].ravel().tolist())
        for chunk, box in enumerate(laid.box):
            far = float(np.linalg.norm(np.maximum(np.abs(box[:3] - view[:3]), np.abs(box[3:] - view[:3]))))
            sort_chunk(laid.corners, laid.box, chunk, view, 1.0, size, ball, far, work.kind)
            members = np.arange(chunk * CHUNK, (chunk + 1) * CHUNK, dtype=np.int32)
            gather(laid.vertices, laid.faces, members, CHUNK, work.setup)
            transform(view, 1.0, size, ball, work.setup)
            state, sides = work.setup[STATE : STATE + CHUNK], work.setup[BOX : BOX + 4 * CHUNK].reshape(4, CHUNK)
            texels = np.maximum(sides[1] - sides[0], sides[3] - sides[2]) + 1
            kind, empty = work.kind, (sides[0] > sides[1]) | (sides[2] > sides[3])
            none = kind == KINDS
            assert ((state[none] == BEHIND) | (empty[none] & (state[none] == 3))).all()
            few = kind < ANY
            assert ((state[few] == AHEAD) | (state[few] == 3)).all()
            assert (texels[few & ~empty] <= 1 << kind[few & ~empty]).all()
            passed, small = passed + none.sum(), small + few.sum()
    assert passed > 0
    assert small > 0 or name == "near" or size > 256

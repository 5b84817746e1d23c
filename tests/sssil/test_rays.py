"""Samples with shadow rays, against segments cut with triangles one by one, and the limits of what they may give."""

import dataclasses

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.jit import threads
from refgi.scene import Camera, Material, Mesh, Scene, SpotLight, merge
from refgi.settings import of, replaced
from refgi.sssil.bitmask import bitmask_gather
from refgi.sssil.levels import pyramid
from refgi.sssil.pattern import samples_at
from refgi.sssil.rays import Surfels, Traced, _transfer, add_unoccluded, ray_gather
from refgi.sssil.settings import HssilSettings
from tests.naive import bitmask as naive
from tests.naive.crossings import corners_of, free

WHITE = Material("white", (0.6, 0.6, 0.6))
ROUNDING = 1e-12  # float64 sums of some 20 terms of like sign
SETTINGS = of(HssilSettings, radius=4, levels=1, samples=12, start="full")
MARGIN = 1e-4  # share of a segment where triangles do not count: its ends lie on some


def rectangle(corner, along, across):
    corner, along, across = (np.asarray(v, float) for v in (corner, along, across))
    return Mesh(np.stack([corner, corner + along, corner + along + across, corner + across]),
                np.array([[0, 1, 2], [0, 2, 3]]), None, WHITE)


def scene(*, blocker):
    """A floor and a wall that meet, lit from above, and a shelf between them."""
    meshes = [rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2)), rectangle((-1, 0, -1), (2, 0, 0), (0, 2, 0))]
    if blocker:
        meshes.append(rectangle((-0.4, 0.3, -0.9), (0.7, 0, 0), (0, 0, 0.9)))
    geometry, materials = merge(meshes)
    lamp = SpotLight((0.2, 1.8, 1.5), (-0.1, -0.7, -1.0), 0.9, 0.9, (10.0, 12.0, 8.0))
    return Scene("by hand", geometry, materials, Camera((0.2, 1.1, 3.1), (0.0, 0.5, 0.0), vfov=0.8), (lamp,))


@pytest.fixture(scope="module")
def frame():
    return Frame(scene(blocker=True), width=12, height=9, dtype=np.float64, rsm_resolution=64)


def traced(frame):
    return Traced(frame.gbuffer, frame.scene.geometry, frame.tracer)


@pytest.mark.feature("HSS-03", "REF-32")
@pytest.mark.parametrize(("faces", "expected"), [((1.0, -1.0), 0.25), ((-1.0, -1.0), 0.0), ((1.0, 1.0), 0.0)])
def test_what_either_face_hides_is_not_transferred(faces, expected):
    """By hand: c s A / r^4 of 1 m^2 at 2 m that face each other; 0 where a face looks away under its shading normal."""
    to, sender = (Surfels(*(np.array([[0.0], [0.0], [z]]) for z in (place, up)), np.ones(1), np.array(
        [[0.0], [0.0], [face]]), np.zeros((3, 1), np.float32)) for place, up, face in zip(
            (0.0, 2.0), (1.0, -1.0), faces, strict=True))
    assert _transfer(to, sender, 0, 0, 1.0, 0.0) == pytest.approx(expected)


def around(level, index, settings):
    return lambda row, column: [(int(ox), int(oy), w) for (ox, oy), w in zip(
        *samples_at(settings.sampling, index, level.number, row, column), strict=True)]


def twin(level, settings, frame=None):
    if frame is None:
        return naive.light(level._asdict(), around(level, 0, settings), settings.senders.form_factor,
                           share=settings.senders.disc_share)
    geometry, eye = frame.scene.geometry, np.asarray(frame.scene.camera.eye)
    corners = corners_of(geometry)

    def see(receiver, sender):
        start, end = (level.position[:, *texel] + eye for texel in (receiver, sender))
        margin = MARGIN * (end - start)
        return float(free(corners, (start + margin)[None], (end - margin)[None])[0])

    return naive.light(level._asdict(), around(level, 0, settings), settings.senders.form_factor, see,
                       settings.senders.disc_share)


@pytest.mark.feature("REF-02")
@pytest.mark.parametrize(("pattern", "form"), [("interleaved", "disc"), ("row", "disc"), ("pixel", "point")])
def test_twin(frame, pattern, form, evidence):
    settings = replaced(SETTINGS, {"pattern": pattern, "form_factor": form})
    (level,) = pyramid(frame, settings)
    expected, free = twin(level, settings, frame), twin(level, settings)
    got = ray_gather(level, 0, settings, traced(frame))
    error = np.abs(got - expected).max() / expected.max()
    evidence(f"{pattern}: V of all samples as segments cut with every triangle, to {error:.0e} of the largest; "
             f"{1 - expected.sum() / free.sum():.1%} of the light is blocked")
    assert expected.sum() < 0.97 * free.sum()
    assert error < ROUNDING


@pytest.mark.feature("REF-02")
def test_nothing_between_is_the_unoccluded_sum(evidence):
    frame = Frame(scene(blocker=False), width=12, height=9, dtype=np.float64, rsm_resolution=64)
    (level,) = pyramid(frame, SETTINGS)
    expected, got = twin(level, SETTINGS), ray_gather(level, 0, SETTINGS, traced(frame))
    error = np.abs(got - expected).max() / expected.max()
    evidence(f"nothing between: the sum without visibility to {error:.0e}")
    assert error < ROUNDING


def test_batches_and_threads_change_no_bit(frame):
    (level,) = pyramid(frame, SETTINGS)
    expected = ray_gather(level, 0, SETTINGS, traced(frame))
    for batch in (1, 100):
        np.testing.assert_array_equal(ray_gather(level, 0, SETTINGS, traced(frame), batch=batch), expected)
    with threads(1):
        np.testing.assert_array_equal(ray_gather(level, 0, SETTINGS, traced(frame)), expected)


@pytest.mark.feature("HSS-10")
def test_mirror_images_are_added_to_each_other_first():
    """Exchanging the two of each pair of samples changes no bit, whichever of them are blocked."""
    rng = np.random.default_rng(8)
    radiance, worth, sender = rng.random((3, 50)), rng.random(40), rng.permutation(50)[:40]
    blocked = rng.random(40) < 0.3
    exchanged = np.arange(40).reshape(-1, 2)[:, ::-1].ravel()
    sums = np.zeros((2, 3, 1))
    add_unoccluded(radiance, 0, 1, 40, blocked, worth, sender, sums[0])
    add_unoccluded(radiance, 0, 1, 40, blocked[exchanged], worth[exchanged], sender[exchanged], sums[1])
    np.testing.assert_array_equal(sums[0], sums[1])
    np.testing.assert_allclose(sums[0, :, 0], radiance[:, sender] @ (worth * ~blocked), rtol=1e-14)


def test_background_receives_nothing():
    away = dataclasses.replace(scene(blocker=False), camera=Camera((0.2, 1.1, 3.1), (0.0, 2.0, 0.0), vfov=0.8))
    frame = Frame(away, width=7, height=5, rsm_resolution=64)
    (level,) = pyramid(frame, SETTINGS)
    got = ray_gather(level, 0, SETTINGS, traced(frame))
    assert (level.pixel < 0).any()
    assert got.dtype == np.float32
    assert not got[:, level.pixel < 0].any()
    assert np.isfinite(got).all()


@pytest.mark.feature("HSS-17")
def test_over_brightness_and_what_the_bitmask_leaves_of_it(evidence):
    """Samples of slices without visibility and with the bitmask, against rays to every texel."""
    settings = of(HssilSettings, radius=6, levels=1, samples=64, start="full", pattern="all")
    frame = Frame(scene(blocker=True), width=48, height=36, rsm_resolution=128)
    (level,) = pyramid(frame, settings)
    true = ray_gather(level, 0, settings, traced(frame))
    dense = replaced(settings, {"pattern": "row", "slices": 16, "samples": 512, "thickness": 0.01})
    free, masked = (bitmask_gather(level, 0, replaced(dense, {"thickness": t}), frame.scene.geometry.diagonal)
                    for t in (0.0, dense.visibility.thickness))
    over, left = (light.sum() / true.sum() - 1 for light in (free, masked))
    error, rest = (np.abs(light - true).mean() / true.mean() for light in (free, masked))
    evidence(f"below a shelf: V = 1 is {over:.1%} too bright, {left:.1%} with the bitmask; mean error of a texel "
             f"{error:.1%} and {rest:.1%}")
    assert abs(left) < 0.5 * over
    assert rest < error

"""Levels of what a camera sees: against the literal text, the buffers they are made of, and mirrored pictures."""

import math

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.frame import Frame
from refgi.literal import hssil_levels as literal
from refgi.rsm.raster.projection import camera_projection
from refgi.scene import load_scene
from refgi.settings import of
from refgi.sssil.levels import pyramid, useful_levels
from refgi.sssil.settings import HssilSettings
from refgi.stages import Memory, observe
from tests.naive.crossings import LIFT, corners_of, free
from tests.sssil.pictures import FLOAT32, FLOAT64, camera, made, random_picture, same
from tests.wiring.cases import LAMPS, room

DIRECT = 1e-9  # of the brightest: float64 in another order
MODES = ("closest", "average", "closest_average")


def levels_by_text(picture, view, first, count, mode, tangents="half"):
    """Return the same levels by the literal text, as tuples of planes: of means with the pixels of the closest."""
    camera_, shape = camera_projection(view), picture[0].shape
    seen = *picture, camera_.frame, camera_.half
    closest = [literal.first_level(*seen, first)]
    for number in range(first + 1, first + count):
        closest.append(literal.coarser_level(*closest[-1], number, shape))
    made = closest
    if mode == "average":
        made = [literal.first_mean(*seen, first)]
        for _ in range(count - 1):
            made.append(literal.level_of_means(*made[-1]))
        made = [(*means, nearest[5]) for means, nearest in zip(made, closest, strict=True)]
    if mode == "closest_average":
        made = [literal.first_mean_radiance(*seen, first)]
        for number in range(first + 1, first + count):
            made.append(literal.coarser_mean_radiance(*made[-1], number, shape))
    wide = 1.0 if tangents == "half" else 4 / np.prod(1 - camera_.half**2)  # tan f = 2 t / (1 - t^2)
    return [(*planes[:4], wide * planes[4], planes[5]) for planes in made]


def assert_equal_to(expected, level, rtol):
    assert np.array_equal(level.pixel, expected[5])
    for key, plane in zip(("position", "depth", "normal", "radiance", "area"), expected[:5], strict=True):
        np.testing.assert_allclose(getattr(level, key), plane, rtol=rtol,
                                   atol=rtol if plane.ndim == 3 else 0, err_msg=key)
    for plane in (level.position, level.normal, level.radiance, level.area[None]):
        assert not plane[:, level.pixel < 0].any()


@pytest.mark.feature("HSS-01", "HSS-02", "HSS-08", "HSS-09", "HSS-10")
@pytest.mark.parametrize("mode", MODES)
def test_levels_are_those_of_the_literal_text(mode, evidence):
    """Odd sizes, ties, background, normals that look away; all three starts."""
    for seed, (width, height) in enumerate([(1, 1), (2, 3), (1, 9), (14, 1), (21, 13), (24, 10)]):
        picture, view = random_picture(width, height, seed), camera(width, height)
        for first in range(3):
            right = levels_by_text(picture, view, first, 3, mode)
            for level, expected in zip(made(picture, view, first, 3, mode), right, strict=True):
                assert_equal_to(expected, level, FLOAT64)
    evidence(f"{mode}: pixels chosen equal, the rest to {FLOAT64:g}")


@pytest.mark.parametrize("mode", MODES)
def test_float32_is_float64_to_its_rounding(mode):
    picture, view = random_picture(37, 22), camera(37, 22)
    picture = tuple(plane.astype(np.float32).astype(np.float64) for plane in picture)
    for level, expected in zip(made(picture, view, 1, 4, mode, np.float32), levels_by_text(picture, view, 1, 4, mode),
                               strict=True):
        assert_equal_to(expected, level, 4 * FLOAT32)  # normals that graze magnify the rounding of their own


@pytest.mark.feature("HSS-01")
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_level_0_is_the_buffers_and_the_light_that_leaves_them(dtype, evidence):
    """Radiance is that of the composed picture without emission; positions are the G-buffer's, from the eye."""
    frame = Frame(load_scene("cornell_box"), width=75, height=53, dtype=dtype)
    level = pyramid(frame, of(HssilSettings, start="full", levels=1))[0]
    buffer = frame.gbuffer
    dark = frame.materials.emission[buffer.material_id].max(axis=-1) == 0
    covered = buffer.covered & dark
    assert covered.sum() > 1000
    leaving = frame.radiance()
    np.testing.assert_allclose(level.radiance[:, covered], leaving[:, covered],
                               rtol=FLOAT32 if dtype == np.float32 else FLOAT64)
    assert np.array_equal(level.depth, buffer.depth)
    assert np.array_equal(level.normal, buffer.normal)
    assert np.array_equal(level.pixel >= 0, buffer.covered)
    eye = np.array(frame.scene.camera.eye)[:, None]
    away = np.abs(level.position[:, buffer.covered] - (buffer.position[:, buffer.covered] - eye)).max()
    size = np.abs(buffer.position).max() + np.abs(eye).max()
    assert away <= (FLOAT32 if dtype == np.float32 else FLOAT64) * size
    evidence(f"{np.dtype(dtype).name}: L is albedo/pi E, positions within {away:.1e} m of the G-buffer's")


@pytest.mark.feature("HSS-01")
def test_radiance_of_glossy_surfaces_is_the_diffuse_part_alone(evidence):
    """Closed form of a point light, albedo / pi I cos / d^2, on a wall with a lobe and on a block with nothing else.

    Towards the camera the lobes send more than that: with them the level would be another picture.
    """
    lamp = LAMPS[1]
    frame = Frame(room(lamp), width=82, height=62, dtype=np.float64, shadows="exact")
    buffer, scene, covered = frame.gbuffer, frame.scene, frame.gbuffer.covered
    x, n = buffer.position[:, covered].T, buffer.normal[:, covered].T
    materials = [scene.materials[k] for k in scene.geometry.material_of_face[buffer.triangle_id[covered]]]
    toward = np.array(lamp.position) - x
    d = np.linalg.norm(toward, axis=1)
    cosine = np.maximum((toward * n).sum(axis=1) / d, 0)
    seen = free(corners_of(scene.geometry), x + LIFT * n, np.broadcast_to(lamp.position, x.shape))
    arrives = (cosine / d**2 * seen)[:, None] * lamp.intensity  # W/m^2
    diffuse, specular = (np.array([getattr(one, key) for one in materials]) for key in ("diffuse", "specular"))
    exponent = np.array([one.exponent for one in materials])
    eye = np.array(scene.camera.eye) - x
    mirror = 2 * cosine[:, None] * n - toward / d[:, None]
    along = np.maximum((mirror * eye).sum(axis=1) / np.linalg.norm(eye, axis=1), 0)
    lobe = specular * arrives * ((exponent + 1) / (2 * math.pi) * along**exponent)[:, None]

    level = pyramid(frame, of(HssilSettings, start="full", levels=1))[0]
    found, expected = level.radiance[:, covered].T, diffuse / math.pi * arrives
    glossy = specular.any(axis=1) & (arrives.any(axis=1))
    black = glossy & ~diffuse.any(axis=1)
    evidence(f"{glossy.sum()} pixels of glossy surfaces in light, {black.sum()} of them without a diffuse part: "
             f"radiance within {np.abs(found - expected).max() / expected.max():.1e} of albedo / pi E; the lobes would "
             f"add up to {(lobe / expected.max()).max():.2f} of the largest")
    np.testing.assert_allclose(found, expected, rtol=0, atol=DIRECT * expected.max())
    assert black.sum() > 20
    assert not found[black].any()
    assert lobe[glossy].max() > expected.max()
    assert (lobe[glossy] > 0.1 * expected.max()).any(axis=1).sum() > 20


@pytest.mark.feature("HSS-10")
@pytest.mark.parametrize("mode", MODES)
def test_mirrored_pictures_have_mirrored_levels(mode, evidence):
    """To the bit, as long as texels mirror each other."""
    for first in range(3):
        picture, view = random_picture(48, 20, first), camera(48, 20)
        depth, normal, albedo, direct = (plane[..., ::-1].copy() for plane in picture)
        normal[0] *= -1
        for level, mirrored in zip(made(picture, view, first, 4 - first, mode, np.float32),
                                   made((depth, normal, albedo, direct), view, first, 4 - first, mode, np.float32),
                                   strict=True):
            turned = [plane[..., ::-1].copy() for plane in mirrored[1:]]
            turned[0][0] *= -1  # x of positions and normals
            turned[2][0] *= -1
            column = turned[-1] % 48
            turned[-1] = np.where(turned[-1] < 0, -1, turned[-1] - column + 47 - column)
            assert same(level, (0, *turned))
    evidence(f"{mode}: equal bits down to texels of 8 x 8 pixels")


@pytest.mark.feature("HSS-07")
def test_a_later_start_has_the_levels_of_an_earlier_one():
    picture, view = random_picture(45, 27), camera(45, 27)
    full = made(picture, view, 0, 4)
    for first in (1, 2):
        for level, expected in zip(made(picture, view, first, 4 - first), full[first:], strict=True):
            assert same(level, expected)
            assert level.number == expected.number


@pytest.mark.parametrize("scale", [1e-3, 1e6])
def test_any_distance_and_grazing_normals_stay_finite(scale):
    depth, normal, albedo, direct = random_picture(19, 11)
    normal[:] = np.array([0, 1, 1e-9])[:, None, None]  # along most rays
    for mode in MODES:
        for level in made((depth * scale, normal, albedo, direct), camera(19, 11), 1, 3, mode, np.float32):
            for plane in (level.position, level.normal, level.radiance, level.area):
                assert np.isfinite(plane).all()
            assert (level.area >= 0).all()
            assert not np.isnan(level.depth).any()


def test_nothing_seen_is_nothing():
    picture = random_picture(9, 5, behind=2.0)
    for mode in MODES:
        for level in made(picture, camera(9, 5), 0, 3, mode):
            assert (level.pixel == -1).all()
            assert (level.depth == np.inf).all()
            assert not any(plane.any() for plane in (level.area, level.position, level.normal, level.radiance))


@pytest.mark.feature("HSS-07")
def test_levels_whose_crowns_miss_the_picture_are_left_out():
    """A crown from 20 texels on needs a level of more than 20 texels from corner to corner."""
    frame = Frame(load_scene("cornell_box"), width=64, height=64)
    with observe() as log:
        numbers = [level.number for level in pyramid(frame, of(HssilSettings, radius=20, levels=4))]
    assert numbers == [1, 2]  # 32 x 32 and 16 x 16: 22.6; 8 x 8: 11.3
    assert log.status("sssil.level") == ["skipped"]
    assert useful_levels((64, 64), of(HssilSettings, radius=None, levels=9).sampling) == 9
    assert useful_levels((1, 1), of(HssilSettings, radius=1, levels=9).sampling) == 9
    assert useful_levels((1, 1), of(HssilSettings, radius=2, levels=9).sampling) == 1


def test_levels_are_kept_while_only_samples_change():
    frame, memory = Frame(load_scene("cornell_box"), width=16, height=16), Memory()
    found = []
    for settings in (HssilSettings(), of(HssilSettings, samples=7, seed=3), of(HssilSettings, downsample="average")):
        with observe(memory=memory) as log:
            pyramid(frame, settings)
        found += log.status("sssil.pyramid")
    assert found == ["ran", "reused", "ran"]


def test_planes_that_do_not_fit_are_refused():
    depth, normal, albedo, direct = random_picture(9, 5)
    with pytest.raises(InputError, match=r"albedo: expected shape \(3, 5, 9\), got \(3, 5, 8\)"):
        made((depth, normal, albedo[..., :-1], direct), camera(9, 5), 0, 1)
    with pytest.raises(InputError, match=r"depth: expected shape \(5, 9\)"):
        made((depth[:-1], normal, albedo, direct), camera(9, 5), 0, 1)
    with pytest.raises(InputError, match=r"normal: expected shape \(3, 5, 9\), got \(5, 9\)"):
        made((depth, normal[0], albedo, direct), camera(9, 5), 0, 1)

"""Refinement to an error: the promise on several scenes, what it costs, and each part against closed forms."""

import math
from typing import NamedTuple

import numpy as np
import pytest

from refgi.error_target import near as sum_module
from refgi.error_target import trial
from refgi.error_target.error_driven import draw_samples, error_driven, estimate_error, estimate_mean
from refgi.error_target.interpolate import blend_weights, surface_levels
from refgi.error_target.near import near_light
from refgi.error_target.trial import fill_coarsest, fill_level, fill_picture
from refgi.errors import InputError
from refgi.jit import threads
from refgi.lights import PixelLights
from refgi.lights.selection import choose_lights, footprints
from refgi.pairs.irradiance import checked
from refgi.splat import Receivers
from refgi.splat.multires.refine import refine
from refgi.stages import observe
from tests.splat.multires.choices import by_error, frame_of, full_sum, relative_error, unclamped

ROUNDING = 1e-5  # float32 sums of 64 terms, the largest many times the rest
LINEAR = 1e-5  # of values up to 10: float32 means of four
TARGETS = (0.2, 0.05, 0.02)
SCENES = ("cornell_box", "metaballs", "stage", "atrium")


def lights_and_sum(frame, settings):
    lights, area = choose_lights(frame, settings.lights), footprints(frame, settings.lights, settings.effective_pairs)
    return lights, area, full_sum(frame.gbuffer, lights, settings, area)


def driven(buffer, lights, settings, area):
    return error_driven(buffer, lights, settings.subsplats, settings.effective_pairs, area, settings.lights.seed)


def leaves(found):
    return refine(found.split, found.covered, "off")


class Blank(NamedTuple):
    """What the camera sees, as far as it is asked for."""

    position: np.ndarray
    normal: np.ndarray
    covered: np.ndarray
    height: int = 20
    width: int = 30

    def resolve(self, *names):
        return tuple(getattr(self, name) for name in names)


@pytest.fixture(scope="module")
def box():
    return frame_of("cornell_box")


@pytest.mark.parametrize("name", SCENES)
def test_every_promise_is_kept_against_the_full_sum(name):
    """Picture: the error measured at all pixels, floor 0."""
    frame = frame_of(name)
    covered = frame.gbuffer.covered
    for clamp in ("none", "disc") if name == "cornell_box" else ("none",):
        lights, area, full = lights_and_sum(frame, unclamped(lights=64, clamp=clamp))
        for target in TARGETS:
            for seed in (0, 1):
                settings = by_error(target, lights=64, clamp=clamp, seed=seed)
                found = driven(frame.gbuffer, lights, settings, area)
                assert relative_error(found.irradiance, full, covered) <= target
                assert found.low <= found.error <= found.high <= target
                assert found.pairs <= 2 * found.full_pairs


def test_pairs_are_saved_and_all_counted(monkeypatch):
    frame = frame_of("cornell_box", 300, 300)
    settings = by_error(0.05, lights=64)
    lights, area, full = lights_and_sum(frame, settings)
    evaluated, near, add_lights = [], [], sum_module.add_lights
    monkeypatch.setattr(sum_module, "add_lights", lambda p, *how: evaluated.append(p.T) or add_lights(p, *how))
    monkeypatch.setattr(sum_module, "near_light", lambda *how: near.append(near_light(*how)) or near[-1])
    with observe() as log:
        found = driven(frame.gbuffer, lights, settings, area)
    said = next(run.reason for run in log.runs if run.name == "error_target.full_sum")
    assert said.startswith(f"{found.pairs / found.full_pairs:.1%} of its pairs")
    points = np.concatenate(evaluated)
    assert len(np.unique(points, axis=0)) == len(points)  # no pixel twice
    count = lights.flux.shape[1]
    assert found.pairs == count * len(points) + near[0].pairs
    assert found.full_pairs == count * np.count_nonzero(frame.gbuffer.covered)
    assert found.pairs < 0.25 * found.full_pairs
    assert relative_error(found.irradiance, full, frame.gbuffer.covered) <= 0.05


def test_subsplats_are_the_pictures(box):
    settings = by_error(0.05, lights=64)
    lights, area, full = lights_and_sum(box, settings)
    found = driven(box.gbuffer, lights, settings, area)
    times = sum(np.kron(leaf, np.ones((1 << level, 1 << level)))[:90, :120]
                for level, leaf in enumerate(leaves(found).leaf))
    assert (times[box.gbuffer.covered] == 1).all()
    pixels = leaves(found).leaf[0]
    assert pixels.any()
    np.testing.assert_array_equal(found.irradiance[:, pixels], full[:, pixels])
    finer = driven(box.gbuffer, lights, by_error(0.02, lights=64), area)
    assert len(leaves(finer).level) > len(leaves(found).level)
    assert finer.pairs > found.pairs


def test_no_error_at_all_is_the_full_sum_to_the_bit(box):
    settings = by_error(1e-6, lights=64)
    lights, area, full = lights_and_sum(box, settings)
    found = driven(box.gbuffer, lights, settings, area)
    np.testing.assert_array_equal(found.irradiance, full)
    assert found.error == found.high == 0
    assert leaves(found).counts[1:].sum() == 0


def test_threads_change_no_bit(box):
    settings = by_error(0.05, lights=64)
    lights, area, _ = lights_and_sum(box, settings)
    found = driven(box.gbuffer, lights, settings, area)
    with threads(1):
        alone = driven(box.gbuffer, lights, settings, area)
    np.testing.assert_array_equal(found.irradiance, alone.irradiance)
    assert found[3:] == alone[3:]


@pytest.mark.parametrize(("width", "height"), [(1, 1), (1, 40), (33, 1), (17, 40)])
def test_small_pictures(width, height):
    frame = frame_of("metaballs", width, height)
    settings = by_error(0.1, lights=64, coarsest=4)
    lights, area, full = lights_and_sum(frame, settings)
    found = driven(frame.gbuffer, lights, settings, area)
    assert np.isfinite(found.irradiance).all()
    assert relative_error(found.irradiance, full, frame.gbuffer.covered) <= 0.1


def test_nothing_to_see_and_no_light(box):
    settings = by_error(0.1, lights=64)
    lights, area, _ = lights_and_sum(box, settings)
    dark = driven(box.gbuffer, lights._replace(flux=np.zeros_like(lights.flux)), settings, area)
    assert (dark.irradiance == 0).all()
    assert dark.error == dark.high == 0
    buffer = Blank(np.zeros((3, 20, 30), np.float32), np.zeros((3, 20, 30), np.float32), np.zeros((20, 30), bool))
    empty = driven(buffer, lights, settings, area)
    assert (empty.irradiance == 0).all()
    assert empty.error == empty.pairs == len(leaves(empty).level) == 0


def test_a_target_is_needed():
    with pytest.raises(InputError, match=r"subsplats\.target"):
        by_error(0.0)


def plane(height, width, turn=None):
    """Pixels of a floor 0.1 m apart; from column `turn` on it is a wall."""
    i, j = np.mgrid[:height, :width].astype(np.float32)
    flat = np.stack([0.1 * j, np.zeros_like(i), 0.1 * i])
    normal = np.zeros_like(flat)
    normal[1] = 1
    if turn is not None:
        wall = j >= turn
        flat[0][wall], flat[1][wall] = 0.1 * turn, (0.1 * (j - turn))[wall]
        normal[:, wall] = np.array([[-1], [0], [0]], np.float32)
    return flat, normal


def from_level(top, image, position, normal, covered):
    """Interpolate a picture's values at the pixels of one level down to all."""
    levels, exact = surface_levels(position, normal, covered, top), np.stack([image] * 3)
    made, squares = blend_weights(levels), [-(-side // 16) for side in image.shape]
    none = np.zeros((3, 0, 0), np.float32), np.zeros(squares, bool)
    light = np.zeros((3, *levels[top].covered.shape), np.float32)
    fill_coarsest(levels[top].representative_pixel, exact, *none, light)
    for k in range(top - 1, -1, -1):
        shape, unsplit = levels[k].covered.shape, np.zeros(levels[k + 1].covered.shape, bool)
        fine, blend = np.full((3, *shape), np.nan, np.float32), made[k]
        if k:
            fill_level(light, blend.weight, blend.across, unsplit, levels[k].representative_pixel, exact, *none, fine,
                       np.zeros(shape, bool), np.zeros(shape, np.float32))
        else:
            fill_picture(light, blend.weight, blend.across, unsplit, covered, exact, *none, fine)
        light = fine
    return light[0]


def test_light_linear_on_a_plane_is_interpolated_exactly():
    """Analytic: away from the border, where a neighbour is missing."""
    position, normal = plane(48, 64)
    image = (0.7 * position[0] + 0.3 * position[2] + 1).astype(np.float32)
    got = from_level(2, image, position, normal, np.ones((48, 64), bool))
    np.testing.assert_allclose(got[4:-4, 4:-4], image[4:-4, 4:-4], atol=LINEAR)
    assert np.abs(got - image).max() > 10 * LINEAR  # the border differs


def test_light_does_not_cross_an_edge_nor_come_from_empty_pixels():
    position, normal = plane(32, 32, turn=13)
    image = np.where(np.arange(32) < 13, 1, 3) * np.ones((32, 1))
    covered = np.ones((32, 32), bool)
    covered[5:9, 20:30] = False
    got = from_level(2, image.astype(np.float32), position, normal, covered)
    np.testing.assert_allclose(got[covered], image[covered], rtol=1e-6)
    assert (got[~covered] == 0).all()


def test_light_stays_on_its_facet_and_on_its_step():
    """Analytic: 30 degrees leave 1e-8 of a weight, a step of 1 m between pixels 0.1 m apart less than 1e-3."""
    beyond = np.arange(32) >= 13
    image = np.where(beyond, 3, 1).astype(np.float32) * np.ones((32, 1), np.float32)
    covered = np.ones((32, 32), bool)
    position, normal = plane(32, 32)
    normal[:, :, beyond] = np.array([-0.5, math.sqrt(0.75), 0], np.float32)[:, None, None]
    np.testing.assert_allclose(from_level(2, image, position, normal, covered), image, rtol=1e-6)
    position, normal = plane(32, 32)
    position[1][:, beyond] = 1
    np.testing.assert_allclose(from_level(2, image, position, normal, covered), image, rtol=1e-3)


def test_residuals_are_those_of_the_interpolated_normals():
    """Analytic: none on a plane; a pixel turned by 90 degrees against all around is off by sqrt 2."""
    position, normal = plane(16, 16)
    covered = np.ones((16, 16), bool)
    blends = blend_weights(surface_levels(position, normal, covered, 2))
    assert max(blend.normal_error.max() for blend in blends) < 1e-12
    normal[:, 4, 6] = 1, 0, 0  # an even row and column: it stands for no coarser cell
    one, two = (blend.normal_error for blend in blend_weights(surface_levels(position, normal, covered, 2)))
    assert one[2, 3] == pytest.approx(2, rel=1e-5)
    assert two[1, 1] == pytest.approx(2, rel=1e-5)
    assert two.sum() == pytest.approx(2, rel=1e-5)


@pytest.mark.parametrize("clamp", [{}, {"clamp": "distance", "clamp_value": 0.05}])
@pytest.mark.parametrize("facing", ["down", "anywhere"])
def test_near_light_is_what_exceeds_the_bound(clamp, facing):
    """Analytic: sum of (Phi / pi) max(0, g - b) over all pairs."""
    rng = np.random.default_rng(5)
    position, normal = plane(23, 37)
    at = rng.uniform((0, 0.01, 0), (3.7, 0.3, 2.3), (64, 3)).T
    axis = np.tile([[0.0], [-1.0], [0.0]], 64) if facing == "down" else rng.normal(size=(3, 64))
    axis /= np.linalg.norm(axis, axis=0)
    lights = PixelLights(at, axis, rng.uniform(0.1, 1, (3, 64)), *(None,) * 3, 64)
    covered = rng.random((23, 37)) < 0.9
    most, settings = 2.0, unclamped(**clamp)
    receivers = Receivers(position, normal, covered)
    near = near_light(receivers, checked(receivers, lights, settings.effective_pairs, None), most)
    got = np.where(np.kron(near.has_near, np.ones((16, 16), bool))[:23, :37], near.irradiance, np.float32(0))
    away = at.astype(np.float32).astype(float)[:, None, None] - position[..., None]
    square = (away**2).sum(axis=0)
    clamped_square = np.maximum(square, 0.05**2) if clamp else square
    leaving = -(away * axis.astype(np.float32)[:, None, None]).sum(axis=0)
    term = np.maximum(away[1], 0) * np.maximum(leaving, 0) / (square * clamped_square)
    bound = most * math.pi / lights.flux.max(axis=0)
    excess = (lights.flux[:, None, None] / math.pi * np.maximum(0, term - bound)).sum(axis=-1) * covered
    assert excess.max() > 10 * most
    np.testing.assert_allclose(got, excess, rtol=ROUNDING, atol=ROUNDING * most)
    assert 0 < near.pairs < 64 * covered.sum()


def test_cells_are_split_where_normals_or_light_promise_too_much():
    """Literal: the brightest of nine cells times the normals' error, and the surplus, a quarter of the neighbours'."""
    rng = np.random.default_rng(3)
    known = rng.random((9, 11)) < 0.8
    light = rng.uniform(0, 2, (3, 9, 11)).astype(np.float32)
    surplus, error = (rng.uniform(0, 1, (9, 11)).astype(np.float32) ** 6 for _ in range(2))
    split, pixels = np.zeros((9, 11), bool), 4.0
    most = 1.0
    trial._mark_split(known, light, surplus, error, pixels, most, split)
    for i, j in np.ndindex(9, 11):
        around = np.s_[max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2]
        brightest = (light[:, *around].astype(float) ** 2).sum(axis=0).max()
        from_beside = 0.25 * surplus[around].astype(float).max()
        promised = brightest * float(error[i, j]) + pixels * max(float(surplus[i, j]), from_beside)
        assert split[i, j] == (known[i, j] and promised > most), (i, j)
    assert 0.2 < split[known].mean() < 0.8


def test_samples_stand_for_all_covered_pixels_and_bound_the_error():
    """Statistical: the bounds hold the true error of a heavy-tailed difference for every seed."""
    rng = np.random.default_rng(2)
    covered = rng.random((200, 230)) < 0.8
    full = rng.uniform(0.5, 1.5, (3, 200, 230)).astype(np.float32)
    picture = full + (0.02 * rng.standard_t(4, full.shape)).astype(np.float32)
    error = relative_error(picture, full, covered)
    for seed in range(20):
        samples = draw_samples(covered, seed)
        assert covered.reshape(-1)[samples.pixel].all()
        assert samples.share.sum() == pytest.approx(1)
        assert len(np.unique(samples.pixel)) == len(samples.pixel) < covered.sum() / 8
        light, exact = (part.reshape(3, -1)[:, samples.pixel] for part in (picture, full))
        mean, uncertainty = estimate_mean(samples, exact)
        assert abs(mean - full[:, covered].mean(dtype=float)) < uncertainty
        found = estimate_error(samples, exact - light, (mean, uncertainty))
        assert found.low < error < found.high < 1.4 * error

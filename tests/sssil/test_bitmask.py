"""Samples past the bitmask, against a twin of vectors and sets, convex rooms, and what must hold for any picture."""

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.settings import of, replaced
from refgi.sssil.bitmask import bitmask_gather
from refgi.sssil.pattern import level_key, pixel_key, row_key
from refgi.sssil.settings import HssilSettings
from refgi.sssil.slices import fill_slices, slice_counts, slice_offsets, turn_of
from refgi.sssil.view import Level
from tests.naive import bitmask as naive

SETTINGS = of(HssilSettings, radius=4, levels=1, samples=24, slices=5, start="full", thickness=0.1)
DIAGONAL = 2.0  # m; with the thickness above, surfaces of 0.2 m
ROUNDING = 1e-12  # float64 sums of some 100 terms of like sign
SINGLE = 3e-5  # float32: some 100 roundings of 6e-8, and cosines of small angles
TIES = 0.02  # share of receivers whose float32 angles fall on the other side of a sector's middle
ROOM = np.array([[2.0, 1.5, 4.0]] * 2) * [[-1], [1]]  # walls at x = +-2, y = +-1.5, z = +-4 around the eye


def seen(rows=10, columns=14, plate=None, dtype=np.float64):
    """What an eye in a room sees along +z: a level; `plate` (low, high) is a box axis by axis that stands in it."""
    y, x = np.mgrid[0:rows, 0:columns] + 0.5
    ray = np.stack([(2 * x - columns) / rows, (2 * y - rows) / rows, np.ones_like(x)])
    with np.errstate(divide="ignore"):
        far = np.max(ROOM[:, :, None, None] / ray, axis=0)  # where each pair of walls is left
    axis, t = np.argmin(far, axis=0), np.min(far, axis=0)
    if plate is not None:
        with np.errstate(divide="ignore"):
            bounds = np.sort(np.asarray(plate, float)[:, :, None, None] / ray, axis=0)
        enter, leave = bounds[0].max(axis=0), bounds[1].min(axis=0)
        hit = (enter < leave) & (enter > 0)
        axis, t = np.where(hit, bounds[0].argmax(axis=0), axis), np.where(hit, enter, t)
    normal = -np.sign(ray) * (np.arange(3)[:, None, None] == axis)
    random = np.random.default_rng(5)
    radiance = random.uniform(0.5, 1.5, (3, rows, columns))
    area = t**2 * (2 / rows) ** 2 / np.abs((normal * ray).sum(axis=0))
    pixel = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    return Level(0, *(a.astype(dtype) for a in (t * ray, t, normal, radiance, area)), pixel)


def without(level, hidden):
    """The level with background where `hidden`."""
    gone = {name: np.where(hidden, 0, getattr(level, name)).astype(level.area.dtype)
            for name in ("position", "normal", "radiance", "area")}
    return level._replace(**gone, depth=np.where(hidden, np.inf, level.depth).astype(level.area.dtype),
                          pixel=np.where(hidden, -1, level.pixel).astype(np.int32))


def shaken(level):
    """The level with points off their planes: in these, angles are equal but for rounding."""
    return level._replace(position=level.position + np.random.default_rng(6).normal(0, 1e-3, level.position.shape))


def twin(level, settings, offsets_of, thickness=DIAGONAL * SETTINGS.visibility.thickness):
    def around(row, column):
        offsets, weight = offsets_of(row, column)
        return [[(*map(int, o), w) for o, w in zip(*both, strict=True)] for both in zip(offsets, weight, strict=True)]

    if thickness is None:
        flat = lambda row, column: [sample for samples in around(row, column) for sample in samples]  # noqa: E731
        return naive.light(level._asdict(), flat, settings.senders.form_factor,
                           share=settings.senders.disc_share)
    return naive.masked_light(level._asdict(), around, thickness, settings.senders.form_factor,
                              share=settings.senders.disc_share)


def shared(level, index, settings):
    steps = slice_counts(settings.sampling, settings.visibility, index, settings.sampling.radius)
    offsets, weight = slice_offsets(settings.sampling, steps, level.number, level.shape[0])

    def of(row, column):
        return tuple(a[row % a.shape[0], column % a.shape[1]] for a in (offsets, weight))

    return of


def own(level, index, settings):
    steps = slice_counts(settings.sampling, settings.visibility, index, settings.sampling.radius)
    offsets, weight = np.empty((steps.slices, steps.per_slice, 2), np.int32), np.empty((steps.slices, steps.per_slice))

    def of(row, column):
        key = pixel_key(row_key(level_key(settings.sampling.seed, level.number), row), column)
        fill_slices(steps, *turn_of(key), False, np.empty(steps.per_slice), offsets, weight)
        return offsets, weight

    return of


PLATE = ((-0.6, -0.2, 2.0), (0.5, 0.9, 2.2))
CASES = [("interleaved", "disc", 0), ("row", "disc", 0), ("fixed", "point", 1), ("pixel", "disc", 1)]


@pytest.mark.feature("HSS-17")
@pytest.mark.parametrize(("pattern", "form", "index"), CASES)
def test_twin(pattern, form, index):
    settings = replaced(SETTINGS, {"pattern": pattern, "form_factor": form})
    level = without(shaken(seen(plate=PLATE)), np.arange(140).reshape(10, 14) % 17 == 3)
    expected = twin(level, settings, (own if pattern == "pixel" else shared)(level, index, settings))
    got = bitmask_gather(level, index, settings, DIAGONAL)
    assert expected.max() > 0
    np.testing.assert_allclose(got, expected, rtol=0, atol=ROUNDING * expected.max())


def test_float32_is_float64_rounded_but_for_ties():
    level, single = seen(20, 30, PLATE), seen(20, 30, PLATE, np.float32)
    expected, got = (bitmask_gather(one, 0, SETTINGS, DIAGONAL) for one in (level, single))
    assert got.dtype == np.float32
    off = np.abs(got - expected).max(axis=0) > SINGLE * expected.max()
    assert off.mean() < TIES


@pytest.mark.feature("HSS-17")
@pytest.mark.parametrize("pattern", ["interleaved", "row", "fixed"])
def test_surfaces_of_no_thickness_block_nothing(pattern, evidence):
    settings = replaced(SETTINGS, {"pattern": pattern, "thickness": 0.0})
    level = seen(plate=PLATE)
    expected = twin(level, settings, shared(level, 0, settings), None)
    got = bitmask_gather(level, 0, settings, DIAGONAL)
    error = np.abs(got - expected).max() / expected.max()
    evidence(f"{pattern}: bitmask of surfaces without thickness = unoccluded sum to {error:.0e}")
    assert error < ROUNDING


@pytest.mark.feature("HSS-17")
def test_nothing_blocks_in_a_convex_room(evidence):
    """Along a slice of a convex room each surface stands higher than those before it."""
    settings = replaced(SETTINGS, {"slices": 4, "radius": 8})
    level = seen(24, 32)
    free, masked = (bitmask_gather(level, 0, replaced(settings, {"thickness": t, "pattern": "fixed"}), DIAGONAL)
                    for t in (0.0, 0.1))
    lost = 1 - masked.sum() / free.sum()
    evidence(f"convex room: {lost:.2%} of the light lost to blocking")
    assert 0 <= lost < LOST_TO_ROUNDED_OFFSETS


LOST_TO_ROUNDED_OFFSETS = 0.005  # samples of a slice lie up to half a texel beside it: its cut is not quite convex


@pytest.mark.feature("HSS-17")
@pytest.mark.parametrize(("thickness", "lamp_height", "share"), [(0.0, 0.2, 1), (3.0, 0.2, 0), (3.0, 3.5, 1)])
def test_a_post_hides_the_lamp_behind_it(thickness, lamp_height, share):
    """A floor, a post's upper end before it and a lamp: the post reaches down to the floor where it is thick."""
    eye_height, far = 4.0, 4.0

    def place(x, height):  # all in the plane of the eye and the row
        closer = 1 - height / eye_height
        return x, eye_height * closer, far * closer

    points = [place(0.0, 0.0), place(1.0, 1.0), place(3.0, lamp_height)]
    level = seen(1, 3)._replace(position=np.array(points).T[:, None], radiance=np.zeros((3, 1, 3)))
    level.normal[:, 0] = np.array([[0, -1, 0], [-1, 0, 0], [-1, 0, 0]]).T
    level.radiance[:, 0, 2] = 1.0
    settings = replaced(SETTINGS, {"slices": 2, "radius": 1, "samples": 16, "pattern": "fixed"})
    free, got = (bitmask_gather(level, 0, replaced(settings, {"thickness": t}), 1.0)[0, 0, 0]
                 for t in (0.0, thickness))
    assert free > 0
    assert got == share * free


@pytest.mark.feature("HSS-17")
def test_never_above_the_unoccluded_sum(evidence):
    level = seen(30, 40, PLATE)
    shares = []
    free = bitmask_gather(level, 0, replaced(SETTINGS, {"thickness": 0.0}), DIAGONAL)
    for thickness in (0.02, 0.1, 1.0):
        masked = bitmask_gather(level, 0, replaced(SETTINGS, {"thickness": thickness}), DIAGONAL)
        assert (masked >= 0).all()
        assert (masked <= free * (1 + ROUNDING)).all()
        shares.append(masked.sum() / free.sum())
    evidence(f"thicker surfaces block more: {', '.join(f'{share:.3f}' for share in shares)} of the unoccluded light")
    assert shares[0] > shares[1] > shares[2] > 0


@pytest.mark.feature("HSS-10", "HSS-17")
def test_mirror_images_to_the_bit():
    level = seen(12, 15, ((-0.5, -0.2, 2.0), (0.5, 0.9, 2.2)), np.float32)
    level = level._replace(radiance=level.radiance + level.radiance[:, :, ::-1])
    for slices in (4, 5):
        settings = replaced(SETTINGS, {"pattern": "fixed", "slices": slices})
        got = bitmask_gather(level, 0, settings, DIAGONAL)
        np.testing.assert_array_equal(got, got[:, :, ::-1])


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (7, 1)])
def test_small_pictures_and_background(shape):
    level = seen(*shape, dtype=np.float32)
    for one in (level, without(level, np.ones(shape, bool))):
        for pattern in ("interleaved", "row", "pixel"):
            got = bitmask_gather(one, 0, replaced(SETTINGS, {"pattern": pattern}), DIAGONAL)
            assert got.shape == (3, *shape)
            assert np.isfinite(got).all()
    assert not got.any()


def test_any_scale():
    level = seen(12, 16, PLATE, np.float32)
    expected = bitmask_gather(level, 0, SETTINGS, DIAGONAL)
    for scale in (2.0**-20, 2.0**20):
        larger = level._replace(position=level.position * np.float32(scale), depth=level.depth * np.float32(scale),
                                area=level.area * np.float32(scale**2))
        np.testing.assert_array_equal(bitmask_gather(larger, 0, SETTINGS, DIAGONAL * scale), expected)


@pytest.mark.feature("HSS-17")
@pytest.mark.parametrize("near", [1e-2, 1e-4])
def test_bars_near_the_eye_cost_no_digits(near):
    """Float32 against float64: heights over a plane are no differences of large squares."""
    room, bars = seen(24, 32), np.s_[..., 1::4]
    nearer = np.ones_like(room.depth)
    nearer[bars] = near / room.depth[bars]
    normal = room.normal.copy()
    normal[bars] = np.array([0.0, 0.0, -1.0])[:, None, None]
    level = room._replace(position=room.position * nearer, depth=room.depth * nearer, area=room.area * nearer**2,
                          normal=normal)
    expected = bitmask_gather(level, 0, SETTINGS, DIAGONAL)
    single = level._replace(**{name: getattr(level, name).astype(np.float32)
                               for name in ("position", "depth", "normal", "radiance", "area")})
    off = np.abs(bitmask_gather(single, 0, SETTINGS, DIAGONAL) - expected).max(axis=0) / expected.max()
    assert (off > SINGLE).mean() <= TIES


def test_surfaces_in_the_same_place_give_nothing():
    level = seen(6, 8, dtype=np.float32)
    one = level._replace(position=np.broadcast_to(level.position[:, :1, :1], level.position.shape).copy())
    assert not bitmask_gather(one, 0, SETTINGS, DIAGONAL).any()


def test_a_bitmask_needs_its_settings():
    with pytest.raises(InputError, match="visibility: expected bitmask"):
        bitmask_gather(seen(), 0, replaced(SETTINGS, {"visibility": "rays"}), DIAGONAL)

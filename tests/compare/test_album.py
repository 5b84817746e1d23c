"""A page's pictures: what the script is told, and what becomes coarse where all are more than the limit."""

import base64
import functools
import json
import math
import zlib

import numpy as np
import pytest

from refgi.compare.album import (
    COARSEST,
    FIRST,
    SECOND,
    THIRD,
    Judge,
    Picture,
    Store,
    SurfaceFit,
    View,
    album,
    block_means,
    follows,
    halves,
    packed,
)
from refgi.compare.pictures import luminance
from refgi.errors import InputError

HALF = 2.0**-11  # relative rounding of a half float


def unpacked(text, channels, height, width):
    """The 16 bits of each pixel: high bytes, low bytes; sums along rows; the second channel added to the others."""
    content = np.frombuffer(zlib.decompress(base64.b64decode(text)), np.uint8).astype(np.int64)
    count = channels * height * width
    steps = (256 * content[:count] + content[count:]).reshape(channels, height, width)
    bits = np.cumsum(steps, axis=2) % 65536
    for channel in range(channels):
        if channels > 1 and channel != 1:
            bits[channel] = (bits[channel] + bits[1]) % 65536
    return bits.astype(np.uint16)


@pytest.mark.parametrize("channels", [1, 2, 3])
def test_packed_bits_are_found_again(channels):
    bits = np.random.default_rng(1).integers(0, 65536, (channels, 5, 7)).astype(np.uint16)
    before = bits.copy()
    assert np.array_equal(unpacked(packed(bits), channels, 5, 7), bits)
    assert np.array_equal(bits, before)


@pytest.mark.parametrize("scale", [1e-12, 1e-3, 1.0, 3e4, 1e9])
def test_numbers_of_any_size_keep_eleven_bits(scale):
    planes = scale * np.random.default_rng(2).uniform(1e-6, 1.0, (3, 6, 4)) * np.array([1, -1, 1])[:, None, None]
    bits, exponent = halves(planes)
    found = bits.view(np.float16).astype(np.float64) * 2.0**exponent
    assert np.abs(found / planes - 1).max() <= HALF


def test_the_largest_number_never_overflows():
    for largest in (65504.0, 65536.0, 1.0, np.nextafter(2.0, 0)):
        bits, exponent = halves(np.array([[[largest, 0.0]]]))
        found = bits.view(np.float16).astype(np.float64) * 2.0**exponent
        assert found[0, 0] == pytest.approx([largest, 0.0], rel=HALF)


def test_nan_and_infinity_stay():
    bits, exponent = halves(np.array([[[np.nan, np.inf, -np.inf, 2.0]]]))
    found = bits.view(np.float16)[0, 0]
    assert np.isnan(found[0])
    assert found[1:3].tolist() == [np.inf, -np.inf]
    assert float(found[3]) * 2.0**exponent == 2.0
    assert halves(np.full((1, 1, 1), np.nan))[1] == 0


def test_noise_that_channels_share_is_stored_once():
    rng = np.random.default_rng(3)
    shared, own = 1 + 0.1 * rng.standard_normal((1, 64, 64)), 1 + 0.1 * rng.standard_normal((3, 64, 64))
    light = np.array([1.0, 0.8, 0.5])[:, None, None]
    assert len(packed(halves(light * shared)[0])) < 0.8 * len(packed(halves(light * own)[0]))


def test_means_are_over_covered_pixels_of_each_block():
    values = np.arange(15.0).reshape(1, 3, 5)
    covered = np.ones((3, 5), bool)
    covered[0, 1] = covered[2, 4] = False
    expected = [[(0 + 5 + 6) / 3, (2 + 3 + 7 + 8) / 4, (4 + 9) / 2], [(10 + 11) / 2, (12 + 13) / 2, 0.0]]
    assert block_means(values, covered, 1)[0] == pytest.approx(np.array(expected))
    assert block_means(values, covered, 0) is values
    assert block_means(values, covered, 3)[0] == pytest.approx(values[0][covered].mean())


def test_ids_are_those_of_a_pixel_of_each_block():
    store, ids = Store(), 70_000 + np.arange(15, dtype=np.uint32).reshape(3, 5)
    store.add_ids(ids)
    store.fit(len(store.texts()[0]) - 1)
    assert store.facts() == [{"channels": 2, "exponent": 0, "level": 1}]
    low, high = unpacked(store.texts()[0], 2, 2, 3).astype(int)
    assert (low + 65536 * high - 70_000).tolist() == [[0, 2, 4], [10, 12, 14]]


HEIGHT, WIDTH = 40, 50


def light(seed):
    rng = np.random.default_rng(seed)
    return rng.uniform(0.5, 2, (3, HEIGHT, WIDTH)).astype(np.float32)


def lit(irradiance):
    return irradiance, (0.2 + irradiance / 4).astype(np.float32)


def make_view(importances=(SECOND, THIRD, THIRD, SECOND), judges=("truth", "unoccluded"), radiance=None):
    references = {name: Judge(lit(light(i))[0], np.full((3, HEIGHT, WIDTH), 0.01), lit(light(i))[1], name)
                  for i, name in enumerate(judges)}
    covered = np.ones((HEIGHT, WIDTH), bool)
    covered[:10, :10] = False
    pictures = [Picture(f"p{i}", f"picture {i}", "said", judges, functools.partial(lit, light(10 + i)), importance)
                for i, importance in enumerate(importances)]
    if radiance is not None:
        pictures[0] = pictures[0]._replace(load=lambda: (light(10), radiance))
    ids = {"face": np.arange(HEIGHT * WIDTH, dtype=np.uint32).reshape(HEIGHT, WIDTH) + 70_000}
    return View("v", "a <view>", 0.5, covered, references, pictures, ids)


def planes(made, number):
    facts = made.data["planes"][number]
    height, width = (-(-side // 2 ** facts["level"]) for side in (HEIGHT, WIDTH))
    return unpacked(made.blobs[number], facts["channels"], height, width), facts


def numbers(made, number):
    bits, facts = planes(made, number)
    return bits.view(np.float16).astype(np.float64) * 2.0 ** facts["exponent"]


def test_the_script_is_told_all_planes():
    made = album([make_view()])
    view, = made.data["views"]
    assert (view["title"], view["width"], view["height"], view["exposure"]) == ("a <view>", WIDTH, HEIGHT, 0.5)
    assert [one["key"] for one in view["references"]] == ["truth", "unoccluded"]
    assert np.array_equal(numbers(made, view["mask"])[0] == 1, make_view().covered)
    for one, seed in zip((*view["references"], *view["pictures"]), (0, 1, 10, 11, 12, 13), strict=True):
        assert numbers(made, one["irradiance"]) == pytest.approx(light(seed), rel=2**-11)
        assert "radiance" not in one
    assert numbers(made, view["emitted"]) == pytest.approx(np.full((3, HEIGHT, WIDTH), 0.2), rel=1e-3)
    assert numbers(made, view["reflectance"]) == pytest.approx(np.full((3, HEIGHT, WIDTH), 0.25), rel=1e-3)
    deviation = numbers(made, view["references"][0]["deviation"])
    assert deviation == pytest.approx(np.full((1, HEIGHT, WIDTH), 0.1), rel=1e-3)
    low, high = planes(made, view["ids"]["face"])[0].astype(int)
    assert (low + 65536 * high)[3, 4] == 3 * WIDTH + 4 + 70_000
    json.dumps(made.data, allow_nan=False)


def test_pixels_that_are_not_finite_stay_so_and_stop_nothing():
    broken = light(10)
    broken[:, 20, 20], broken[1, 30, 30] = np.nan, np.inf
    view = make_view(importances=(FIRST, FIRST))
    picture = view.pictures[0]._replace(load=lambda: lit(broken))
    made = album([view._replace(pictures=[picture, *view.pictures[1:]])])
    described = made.data["views"][0]["pictures"][0]
    found = numbers(made, described["irradiance"])
    assert np.isnan(found[:, 20, 20]).all()
    assert found[1, 30, 30] == np.inf
    assert np.isfinite(found).sum() == found.size - 4
    assert "radiance" not in described
    json.dumps(made.data, allow_nan=False)


def test_radiance_that_the_surface_does_not_explain_is_stored():
    other = light(99)
    made = album([make_view(radiance=other)])
    picture = made.data["views"][0]["pictures"][0]
    assert numbers(made, picture["radiance"]) == pytest.approx(other, rel=2**-11)


def test_a_picture_is_described_by_the_reference_it_converges_to_and_its_worst_places_by_the_truth():
    view = make_view(importances=(FIRST,))
    picture = view.pictures[0]._replace(load=lambda: lit(0.8 * light(1)))
    described, = album([view._replace(pictures=[picture])]).data["views"][0]["pictures"]
    finding, = described["findings"]
    assert finding["name"] == "too dark by 20% all over"
    assert "against the truth without visibility: " in finding["about"]
    assert finding["about"].endswith("named from 0.5 on")
    error = ((0.8 * luminance(light(1)) - luminance(light(0))) * view.covered) ** 2
    x, y, side = (described["crops"][0][key] for key in ("x", "y", "side"))
    assert described["crops"][0]["share"] == pytest.approx(error[y:y + side, x:x + side].sum() / error.sum(), rel=1e-3)


def test_equal_views_give_equal_albums():
    assert album([make_view()]) == album([make_view()])


def test_least_important_pictures_become_coarse_first_and_the_truth_last():
    whole = sum(map(len, album([make_view()]).blobs))
    levels = []
    for share in (1.0, 0.95, 0.6, 0.4, 0.2, 0.05):
        made = album([make_view()], int(share * whole))
        assert sum(map(len, made.blobs)) <= share * whole
        view = made.data["views"][0]
        levels.append([made.data["planes"][one["irradiance"]]["level"]
                       for one in (*view["references"], *view["pictures"])])
        assert made.data["planes"][view["mask"]]["level"] == 0
    assert levels[0] == [0] * 6
    assert levels[1] == [0, 0, 0, 0, 1, 0]  # the last of the least important
    for truth, _, a, b, c, d in levels:
        assert truth <= min(a, d) <= max(a, d) <= min(b, c)
    assert min(levels[-1]) > 0


def test_coarse_planes_are_means_over_covered_pixels():
    covered = np.ones((HEIGHT, WIDTH), bool)
    covered[:, 0] = False
    store = Store()
    store.add(light(1), covered, FIRST)
    store.add(light(2), covered, THIRD)
    store.fit(len(store.texts()[0]) + len(store.texts()[1]) - 1)
    assert [one["level"] for one in store.facts()] == [0, 1]
    bits = unpacked(store.texts()[1], 3, HEIGHT // 2, WIDTH // 2)
    found = bits.view(np.float16) * 2.0 ** store.facts()[1]["exponent"]
    assert found[0, 3, 0] == pytest.approx(light(2)[0, 6:8, 1].mean(), rel=2**-11)
    assert found[2, 3, 5] == pytest.approx(light(2)[2, 6:8, 10:12].mean(), rel=2**-11)


def test_a_limit_that_cannot_be_met_ends_at_the_coarsest():
    store = Store()
    store.add(light(1), np.ones((HEIGHT, WIDTH), bool), SECOND)
    store.fit(0)
    assert store.facts()[0]["level"] == COARSEST


RNG = np.random.default_rng(5)
EMITTED, ALBEDO = RNG.uniform(0, 3, (3, 4, 5)), RNG.uniform(0.05, 1, (3, 4, 5))
SHOWN = RNG.uniform(0, 2, (4, 3, 4, 5)).astype(np.float32)


def seen(irradiance):
    return (EMITTED + ALBEDO / math.pi * irradiance).astype(np.float32)


def solved(pictures):
    fit = SurfaceFit(EMITTED.shape)
    for picture in pictures:
        fit.add(picture, seen(picture))
    return fit.solve()


def test_emission_and_reflectance_are_found():
    emitted, reflectance = solved(SHOWN)
    assert emitted == pytest.approx(EMITTED, rel=1e-4, abs=1e-4)
    assert reflectance == pytest.approx(ALBEDO / math.pi, rel=1e-4, abs=1e-4)
    assert all(follows(picture, seen(picture), (emitted, reflectance)) for picture in SHOWN)


@pytest.mark.parametrize("pictures", [SHOWN[:1], [SHOWN[0], SHOWN[0]],
                                      [SHOWN[0], SHOWN[0] * np.float32(1 + 2e-7)]])
def test_pictures_that_agree_are_reproduced_whatever_the_reflectance(pictures):
    surface = solved(pictures)
    assert all(follows(picture, seen(picture), surface) for picture in pictures)
    assert (surface[0] >= 0).all()
    assert ((surface[1] >= 0) & (surface[1] <= 1 / math.pi)).all()


def test_emission_is_never_negative_and_reflectance_no_more_than_that_of_white():
    """Pictures that differ by rounding alone have any slope: here 0.3 and 3 where light itself allows 0.01 at most."""
    fit = SurfaceFit((3, 1, 1))
    for shift in (0.0, 1e-4):
        irradiance = np.full((3, 1, 1), 1 + shift)
        fit.add(irradiance, np.array([0.01 + 0.3 * shift, 0.01 + 3 * shift, 5 + 3 * shift]).reshape(3, 1, 1))
    emitted, reflectance = (part.ravel() for part in fit.solve())
    assert (emitted >= 0).all()
    assert reflectance == pytest.approx([0.01, 0.01, 1 / math.pi], rel=0.02)
    assert emitted + reflectance == pytest.approx([0.01, 0.01, 5], rel=0.02)


def test_pixels_that_are_not_finite_do_not_count():
    broken = SHOWN.copy()
    broken[0, :, 1, 2] = np.nan
    broken[1, 0, 0, 0] = np.inf
    emitted, reflectance = solved(broken)
    assert emitted == pytest.approx(EMITTED, rel=1e-3, abs=1e-3)
    assert follows(broken[0], seen(broken[0]), (emitted, reflectance))


def test_other_radiance_does_not_follow():
    surface, other = solved(SHOWN), seen(SHOWN[0])
    other[1, 2, 3] *= 1.01
    assert not follows(SHOWN[0], other, surface)


def test_pictures_of_other_sizes_are_refused():
    with pytest.raises(InputError, match="shape"):
        SurfaceFit((3, 4, 5)).add(np.zeros((3, 4, 4)), np.zeros((3, 4, 4)))

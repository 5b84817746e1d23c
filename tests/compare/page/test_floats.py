"""Planes as a page holds them, unpacked here step by step as the format says."""

import base64
import zlib

import numpy as np
import pytest

from refgi.compare.page.floats import block_means, every, halves, packed

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
    ids = np.arange(15, dtype=np.uint32).reshape(3, 5)
    assert every(ids, 1).tolist() == [[0, 2, 4], [10, 12, 14]]

"""Texels, packed floats and stored depth against tables of every number that a format holds, made by its definition."""

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.vectors.manifest import ArrayEntry
from refgi.vectors.storage import Depth, depth_from, packed_steps, planes_of


def entry(shape, axes, dtype="<f4"):
    return ArrayEntry(file="x", sha256="", dtype=dtype, shape=shape, axes=axes, unit="1", what="x", tier="T1")


def small_floats(mantissa):
    """Every finite number of a float without sign, of 5 bits of exponent, bias 15; the lowest has no hidden 1."""
    below = [2.0**-14 * m / 2**mantissa for m in range(2**mantissa)]
    return np.array(below + [2.0 ** (e - 15) * (1 + m / 2**mantissa) for e in range(1, 31) for m in range(2**mantissa)])


@pytest.mark.parametrize(("component", "mantissa", "numbers", "largest"), [
    (0, 6, 1984, 65024.0), (1, 6, 1984, 65024.0), (2, 5, 992, 64512.0)])
def test_steps_of_r11g11b10f_are_the_gaps_of_all_its_numbers(component, mantissa, numbers, largest):
    table = small_floats(mantissa)
    assert (len(table), table.max(), table[1]) == (numbers, largest, 2.0 ** (-14 - mantissa))
    assert (np.diff(table) > 0).all()
    for share in (0.0, 0.25, 0.999):  # from each number towards the next
        colour = np.zeros((3, len(table) - 1))
        colour[component] = table[:-1] + share * np.diff(table)
        steps = packed_steps("R11G11B10F", entry(colour.shape, "rgb, light"), colour)
        np.testing.assert_array_equal(steps[component], np.diff(table))


def rgb9e5(colour):
    """Return the nearest number of RGB9E5, by trying each exponent: the least that holds all three."""
    for exponent in range(32):
        step = 2.0 ** (exponent - 15 - 9)
        mantissa = np.floor(colour / step + 0.5)
        if (mantissa <= 511).all():
            return mantissa * step, step
    raise AssertionError(colour)


def test_steps_of_rgb9e5_are_those_of_the_exponent_that_holds_the_largest():
    rng = np.random.default_rng(3)
    largest = [2.0**k * share for k in range(-24, 16) for share in (1.0, 1.5, 511.4 / 512 * 2, 511.6 / 512 * 2)]
    largest = [value for value in largest if value <= 65408]
    colours = np.array([[value, value * rng.uniform(), value * rng.uniform(0, 0.01)] for value in largest]).T
    steps = packed_steps("RGB9E5", entry(colours.shape, "rgb, light"), colours)
    for k, colour in enumerate(colours.T):
        stored, step = rgb9e5(colour)
        assert (steps[:, k] == step).all(), colour
        assert (np.abs(stored - colour) <= 0.5 * step).all()


@pytest.mark.parametrize("tier", ["R11G11B10F", "RGB9E5"])
def test_what_a_format_cannot_hold_has_no_step(tier):
    colours = np.array([[-1.0, 70000.0, 2.0], [1.0, 1.0, 1.0], [1.0, 1.0, 1.0]])
    steps = packed_steps(tier, entry((3, 3), "rgb, light"), colours)
    assert (steps[0, :2] == 0).all()
    assert (steps[:, 2] > 0).all()
    stacked = packed_steps(tier, entry((2, 3, 3), "area light, rgb, row"), np.stack([colours, colours]))
    np.testing.assert_array_equal(stacked, np.stack([steps, steps]))


FORMULAS = {"linear": lambda z, n, f: (z - n) / (f - n), "ndc": lambda z, n, f: f * (z - n) / (z * (f - n)),
            "gl": lambda z, n, f: (f + n) / (f - n) - 2 * f * n / (z * (f - n)),
            "reversed": lambda z, n, f: n * (f - z) / (z * (f - n))}


@pytest.mark.parametrize("encoding", FORMULAS)
def test_depth_of_every_16_bit_number_is_its_own_and_its_gap_is_the_step(encoding):
    near, far, last = 0.5, 20.0, 2**16 - 1
    stored = np.arange(1, last) / last
    x = 2 * stored - 1 if encoding == "gl" else stored
    depth = Depth(encoding, near, far, 16)
    z = depth.decoded(x)
    np.testing.assert_allclose(FORMULAS[encoding](z, near, far), x, atol=1e-12)
    gaps, steps = np.abs(np.diff(z)), depth.steps(z)
    some = gaps < 0.01 * z[:-1]  # beyond, the slope changes within a step
    assert some.mean() > 0.9
    ratio = gaps[some] / steps[:-1][some]
    assert ratio.min() > 0.95  # beside storage, 4 roundings of float32: 1.6 % of a step
    assert ratio.max() < 1.01
    if encoding != "gl":
        np.testing.assert_allclose(depth.decoded(np.arange(1, last, dtype=np.uint32)), z)


def test_24_bits_and_floats_stay_within_their_steps():
    rng = np.random.default_rng(1)
    z = rng.uniform(0.2, 90.0, 4000)
    for encoding, formula in FORMULAS.items():
        x = formula(z, 0.1, 100.0)
        for bits, kept in ((24, np.round(x * (2**24 - 1)) / (2**24 - 1)), (32, x.astype(np.float32))):
            depth = Depth(encoding, 0.1, 100.0, bits)
            off = np.abs(depth.decoded(kept) - z)
            assert (off <= depth.steps(z)).all(), (encoding, bits)
            assert off.max() > 0.02 * depth.steps(z).max(), (encoding, bits)
    assert Depth("reversed", 0.1, 100.0, 32).steps(z).max() < 0.1 * Depth("ndc", 0.1, 100.0, 32).steps(z).max()


def test_a_cleared_buffer_is_no_surface():
    for encoding, cleared in (("linear", 1.0), ("ndc", 1.0), ("gl", 1.0), ("reversed", 0.0)):
        assert Depth(encoding, 0.1, 100.0).decoded(np.float32([cleared])).tolist() == [np.inf]
    assert Depth("ndc", 0.1, np.inf).decoded(np.float64([0.5, 1.0])).tolist() == [0.2, np.inf]
    assert Depth("reversed", 0.1, np.inf).decoded(np.float64([0.5, 0.0])).tolist() == [0.2, np.inf]


def test_depth_is_said_in_words():
    assert depth_from("ndc:0.1:100") == ("", Depth("ndc", 0.1, 100.0, 24))
    assert depth_from("rsm.surface.depth=linear:0:50:16") == ("rsm.surface.depth", Depth("linear", 0.0, 50.0, 16))
    assert depth_from("reversed:0.1:inf:32")[1].far == np.inf
    for wrong in ("ndc", "ndc:0:100", "ndc:2:1", "linear:0:inf", "log:0.1:100", "ndc:0.1:100:8", "ndc:a:b",
                  "ndc:0.1:100:24:1"):
        with pytest.raises(InputError, match="--depth: expected"):
            depth_from(wrong)


ARRAY = np.arange(3 * 4 * 5, dtype=np.float32).reshape(3, 4, 5)


@pytest.mark.parametrize(("got", "said"), [
    (np.moveaxis(ARRAY, 0, -1), "read as texels (4, 5, 3)"),
    (np.concatenate([np.moveaxis(ARRAY, 0, -1), np.ones((4, 5, 1))], axis=2),
     "read as texels (4, 5, 4), without component 4"),
    (np.concatenate([ARRAY, np.ones((1, 4, 5))]), "read as texels (4, 4, 5), without component 4"),
    (ARRAY, ""),
])
def test_texels_of_colours(got, said):
    planes, remark = planes_of(entry((3, 4, 5), "rgb, row, column"), got)
    np.testing.assert_array_equal(planes, ARRAY)
    assert remark == said


def test_texels_of_numbers_lists_and_stacks():
    plane = ARRAY[0]
    rgba = np.stack([plane, -plane, plane, plane], axis=-1)
    planes, said = planes_of(entry((4, 5), "row, column"), rgba)
    np.testing.assert_array_equal(planes, plane)
    assert said == "read as texels (4, 5, 4), without component 2 and 3 and 4"
    stack = np.zeros((2, 4, 5, 4))
    assert planes_of(entry((2, 3, 4, 5), "area light, rgb, row, column"), stack)[0].shape == (2, 3, 4, 5)
    assert planes_of(entry((3, 7), "xyz, light"), np.zeros((7, 4)))[0].shape == (3, 7)
    assert planes_of(entry((2, 7), "xy, light"), np.zeros((7, 4)))[1] == (
        "read as texels (7, 4), without component 3 and 4")
    for wrong in (np.zeros((5, 4, 4)), np.zeros((4, 5, 2)), np.zeros((4, 5, 5)), np.zeros(60)):
        assert planes_of(entry((3, 4, 5), "rgb, row, column"), wrong) == (wrong, "")

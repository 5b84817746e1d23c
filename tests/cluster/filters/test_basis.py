"""The basis of the series against sines and cosines one by one (VAL-12), in 8 and 16 bits (VAL-17)."""

import math
import re

import numpy as np
import pytest

from refgi.cluster.filters.basis import (
    DepthScale,
    eight_bits,
    fill_basis,
    half_precision,
    normalise,
    series_depths,
    sine_cosine,
)
from refgi.jit import kernel
from refgi.literal.val_maps import basis, series_depth
from refgi.literal.val_series import above_half, frequencies, shade, weights
from tests.cluster.filters import reads

EXACT = 1e-12  # 64 turns of rounded sines and cosines
# float32: turn k of an angle is off by 2.4e-7 (2k - 1) at most, and a term's weight is 2 sqrt(2) / ((2k - 1) pi)
PER_TERM = 2.4e-7 * 2 * math.sqrt(2) / math.pi
WORST = 0.0059  # sum_k 2 sqrt(2) / (255 c_k) for four terms
MEASURED = 0.0042  # what a coarse search for the largest error of V finds
DIGIT = 5.1e-5  # half of the last digit
# errors of one sine or cosine, from 0 to 1 and from -1/4 to 0, as promised in the docstring of `sine_cosine`
PROMISED = {np.float32: (2.4e-7, 4.5e-7), np.float64: (4e-16, 8e-16)}
PI = np.longdouble("3.14159265358979323846264338327950288")


@kernel
def fill_sines(t, sine, cosine):
    for i in range(len(t)):
        sine[i], cosine[i] = sine_cosine(t[i])


def worst_sine(t):
    """Largest error of sin(pi t) and cos(pi t)."""
    sine, cosine = np.empty_like(t), np.empty_like(t)
    fill_sines(t, sine, cosine)
    exact = PI * t
    return float(max(np.abs(sine - np.sin(exact)).max(), np.abs(cosine - np.cos(exact)).max()))


def test_the_docstring_promises_these_limits():
    stated = [float(number) for number in re.findall(r"\d+(?:\.\d+)?e-\d+", sine_cosine.py_func.__doc__)]
    assert stated == [PROMISED[real][part] for part in (0, 1) for real in (np.float32, np.float64)]


@pytest.mark.parametrize("part", range(8))
def test_sines_and_cosines_of_float32_depths(part):
    """Every 127th of all float32 numbers of [0, 1], more of the largest."""
    end = int(np.float32(1).view(np.int32)) + 1
    bits = np.arange(part * end // 8, (part + 1) * end // 8, 127 if part < 7 else 31, dtype=np.int32)
    assert worst_sine(bits.view(np.float32)) < PROMISED[np.float32][0]
    assert worst_sine(np.array([0, 1], np.float32)) < PROMISED[np.float32][0]


def test_sines_and_cosines_of_float64_depths():
    rng, count = np.random.default_rng(3), 400_000
    turn = 0.5 + rng.choice([-1, 1], count) * np.exp2(rng.uniform(-52, -1, count))
    for t in (rng.random(count), turn, 1 - np.exp2(rng.uniform(-53, 0, count)), np.exp2(rng.uniform(-60, 0, count))):
        assert worst_sine(t) < PROMISED[np.float64][0]


@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_sines_and_cosines_of_depths_less_a_bias(real):
    assert worst_sine(np.linspace(-0.25, 0, 500_001).astype(real)) < PROMISED[real][1]


def basis_of(t, terms, dtype, quantised=False):
    """All channels of depths, (4 M + 1, count)."""
    t = np.asarray(t, dtype).reshape(1, -1)
    basis, basis_z = np.empty((*t.shape, 2 * terms), dtype), np.empty((*t.shape, 2 * terms + 1), dtype)
    fill_basis(t, terms, quantised, basis, basis_z)
    return np.concatenate([basis, basis_z], axis=2)[0].T


def summed(channels, d, weight):
    """Sum sines and cosines (2 M, n) to the series at a depth."""
    return shade(channels[None, :, None], np.full((1, 1, channels.shape[1]), d), 0, weight)[0, 0]


@pytest.mark.feature("VAL-12")
@pytest.mark.parametrize("terms", [1, 4, 64])
def test_channels_add_up_to_the_series(terms, evidence):
    depths = np.linspace(0, 0.99, 34)
    errors = {}
    for dtype in (np.float64, np.float32):
        given, weight = depths.astype(dtype), weights(terms, 0.0)
        found, z, error = basis_of(given, terms, dtype).astype(np.float64), given.astype(np.float64), 0.0
        for d in depths[::3]:
            lit = above_half(z - d, weight)
            error = max(error, np.abs(summed(found[: 2 * terms], d, weight) - lit).max(),
                        np.abs(summed(found[2 * terms : 4 * terms], d, weight) - z * lit).max())
        errors[dtype] = error
    assert errors[np.float64] < EXACT
    assert errors[np.float32] < PER_TERM * terms
    evidence(f"M = {terms}: sum of channels less series {errors[np.float64]:.1e} (float64), "
             f"{errors[np.float32]:.1e} (float32, bound {PER_TERM * terms:.1e})")


@pytest.mark.feature("VAL-12")
@pytest.mark.parametrize(("dtype", "tolerance"), [(np.float64, 1e-13), (np.float32, 2e-6)])  # 7 turns
def test_channels_are_sines_and_cosines(dtype, tolerance):
    t = np.linspace(0, 1, 41, dtype=dtype)
    expected = basis(t.astype(float)[None, None], 4, False)[0, :, 0]
    assert np.abs(basis_of(t, 4, dtype) - expected).max() < tolerance


@pytest.mark.feature("VAL-11")
def test_nothing_seen_lies_at_the_far_end():
    depth = np.array([[0.0, 1.0], [4.0, 7.0], [np.inf, 3.999999]], np.float32)
    out = np.empty_like(depth)
    normalise(depth, DepthScale(False, 0.0, 0.2, 0.8), out)
    expected = series_depth(depth[None], np.zeros(1), np.array([0.2]), np.array([0.8]), False)[0]
    assert np.abs(out - expected).max() < 1e-7
    assert out[1, 1] == out[2, 0] == np.float32(0.8)


@pytest.mark.feature("VAL-17")
def test_eight_bits_move_visibility_by_less_than_the_bound(evidence):
    terms = 4
    depths = np.linspace(0, 1, 4001)
    plain, rounded = basis_of(depths, terms, np.float64), basis_of(depths, terms, np.float64, quantised=True)
    bound = (2 * math.sqrt(2) / (255 * frequencies(terms))).sum()
    worst = 0.0
    for d in np.linspace(0, 1, 101):
        worst = max(worst, np.abs(summed((rounded - plain)[: 2 * terms], d, weights(terms, 0.0))).max())
    assert bound == pytest.approx(WORST, abs=DIGIT)
    assert MEASURED < worst < bound
    evidence(f"8 bits: V off by {worst:.4f} at most, bound {bound:.4f} (M = 4)")


@pytest.mark.feature("VAL-17")
def test_sixteen_bits_move_the_blocker_depth_little(evidence):
    terms, depths = 4, np.linspace(0, 0.85, 2001)
    plain, rounded = basis_of(depths, terms, np.float64), basis_of(depths, terms, np.float64, quantised=True)
    worst = 0.0
    for d in np.linspace(0, 0.85, 51):
        off = rounded - plain
        by_depth = 0.5 * off[4 * terms] - summed(off[2 * terms : 4 * terms], d, weights(terms, 0.0))
        worst = max(worst, np.abs(by_depth[::40]).max())
    # a half is off by 2^-12 of numbers below 1: Z/2 and 2 sqrt(2)/c_k for each term
    bound = 2.0**-12 * (0.5 + (2 * math.sqrt(2) / frequencies(terms)).sum())
    assert 0 < worst < bound
    evidence(f"16 bits: sum of blockers' depths off by {worst:.1e} of the range at most, bound {bound:.1e}")


SIZES = [2, 3, 15, 16, 17, 50, 131, 256]  # sides of level 1 below, at and above groups of 8 and runs of 32 texels
SCALES = [DepthScale(True, 0.2, 0.15, reads.MOST), DepthScale(False, 0.1, reads.MOST / 4, reads.MOST)]


@kernel
def round_all(values, steps, halves):
    for i in range(len(values)):
        steps[i], halves[i] = eight_bits(values[i]), half_precision(values[i])


def level_1(mip, n, quantised):
    """Level 1 from the basis of all texels, 2 x 2 at a time in the order of the docstrings; basis, basis-z, depths."""
    channels = 2 * mip.terms
    basis, basis_z = (np.empty((n, n, channels + extra), mip.depth.dtype) for extra in (0, 1))
    fill_basis(mip.depth, mip.terms, quantised, basis, basis_z)
    quarter = mip.depth.dtype.type(0.25)
    means = []
    for values in (basis, basis_z):
        even = np.pad(values, ((0, n % 2), (0, n % 2), (0, 0)), mode="edge")
        a, b, c, d = even[::2, ::2], even[::2, 1::2], even[1::2, ::2], even[1::2, 1::2]
        means.append((quarter * ((a + b) + (c + d))).reshape(-1, values.shape[2]))
    return means[0], means[1][:, :-1], means[1][:, -1]


def maps(n, dtype):
    """Maps that are empty but for one corner, a part, everything or nothing."""
    full = reads.random_map(n, dtype)
    nothing = np.full((n, n), np.inf, dtype)
    corner, part, far = nothing.copy(), nothing.copy(), full.copy()
    corner[-1, -1], corner[0, n // 2] = 1, 0.7
    part[n // 3 : n // 2 + 1, n // 4 : 2 * n // 3 + 1] = full[n // 3 : n // 2 + 1, n // 4 : 2 * n // 3 + 1]
    far[::3] = 1e6  # counts as empty
    return {"nothing": nothing, "corner": corner, "part": part, "full": full, "far": far}


@pytest.mark.feature("VAL-16")
@pytest.mark.parametrize("n", SIZES)
@pytest.mark.parametrize(("terms", "dtype", "quantised"), [
    (4, np.float32, False), (4, np.float32, True), (5, np.float32, False), (1, np.float64, False),
    (3, np.float64, True)])
def test_level_1_is_the_mean_of_all_texels_to_the_bit(n, terms, dtype, quantised):
    for name, depth in maps(n, dtype).items():
        mip = reads.mip(depth, terms, quantised=quantised, mirrored=True)
        basis, basis_z, mean_depth = level_1(mip, n, quantised)
        if quantised:
            (basis, _), (_, basis_z), (_, mean_depth) = rounded(basis), rounded(basis_z), rounded(mean_depth)
        count = ((n + 1) // 2) ** 2
        for found, expected in ((mip.basis, basis), (mip.basis_z, basis_z)):
            assert found[:count, : 2 * terms].tobytes() == expected.tobytes(), name
            assert not found[:, 2 * terms :].any(), name
        assert mip.mean_depth[:count].tobytes() == mean_depth.tobytes(), name


def rounded(values):
    """Values of 8 and of 16 bits, as level 1 keeps its means."""
    steps, halves = np.empty_like(values), np.empty_like(values)
    round_all(np.ascontiguousarray(values).reshape(-1), steps.reshape(-1), halves.reshape(-1))
    return steps, halves


@pytest.mark.parametrize("n", SIZES)
@pytest.mark.parametrize("scale", SCALES)
def test_runs_that_hold_nothing_are_at_the_far_end(n, scale):
    for depth in maps(n, np.float32).values():
        found, expected = np.empty_like(depth), np.empty_like(depth)
        normalise(depth, scale, found)
        series_depths(scale, depth.reshape(-1), expected.reshape(-1), depth.size)
        assert found.tobytes() == expected.tobytes()
        assert (found[np.isinf(depth)] == np.float32(reads.MOST)).all()


@pytest.mark.feature("VAL-17")
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_16_bits_are_the_format_of_numpy_with_sign_ties_and_small_numbers(dtype):
    rng = np.random.default_rng(4)
    ties = np.concatenate([np.arange(2**11, 2**13) * 2.0**-12, np.arange(4096) * 2.0**-25, [2.0**-14, 2.0**-26, 65504]])
    near = np.concatenate([np.nextafter(ties.astype(dtype), dtype(at)) for at in (-9e4, 9e4)])
    values = np.concatenate([ties, near, rng.uniform(-1, 1, 20_000), np.exp2(rng.uniform(-40, 15.9, 20_000))])
    values = np.concatenate([values, -values]).astype(dtype)
    values = values[np.abs(values) <= 65504]
    _, found = rounded(values)
    assert found.tobytes() == values.astype(np.float16).astype(dtype).tobytes()


@pytest.mark.feature("VAL-17")
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_8_bits_are_256_steps(dtype):
    steps = np.arange(256)
    for values in (steps * 2 / 255 - 1, (steps[:-1] + 0.5) * 2 / 255 - 1, (steps[:-1] + 0.499) * 2 / 255 - 1):
        found, _ = rounded(values.astype(dtype))
        whole = np.floor((values + 1) * 255 / 2 + 0.5001)
        assert (found == whole.astype(dtype) * dtype(2 / 255) - dtype(1)).all()

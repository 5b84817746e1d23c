"""Level 1 of mip maps to the bit: from the basis of every texel, whether the map is empty there or not (VAL-16, 17)."""

import numpy as np
import pytest

from refgi.cluster.filters.basis import DepthScale, eight_bits, fill_basis, half_precision, normalise, series_depths
from refgi.jit import kernel
from tests.cluster.filters import reads

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

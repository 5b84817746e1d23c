"""Seeded draws: known values, and what independent uniform numbers do, over seeds, streams and indices."""

import itertools
import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2, kstwo

import refgi
from refgi import sampling as module
from refgi.errors import InputError
from refgi.sampling import PIXEL_LIGHTS, RANGE, draw_bits, draws
from tests.naive import draws as naive

COUNT = 1 << 20
DEVIATIONS = 5.0  # a fair set exceeds this in one of two million comparisons
ALPHA = 1e-6  # chance that a fair set fails one test
USES = {name: value for name, value in vars(module).items() if isinstance(value, int) and name != "PARTS"}
SEEDS = (0, 1, 2**32 - 1)
# documented in docs/conventions.md
KNOWN = {(0, 0, 0): 0xB2D3E07F, (0, 0, 1): 0x727967A6, (1, 0, 0): 0xA471BB93, (0, 1, 0): 0x21D94C6E,
         (7, 259, 1000): 0x5DC8B27A, (2**32 - 1, 2**32 - 1, 2**32 - 1): 0xD95BD3F5}


@pytest.mark.parametrize(("place", "bits"), KNOWN.items())
def test_known_values(place, bits):
    assert int(draw_bits(*(np.uint32(part) for part in place))) == bits == naive.draw_bits(*place)


def test_numbers_are_the_upper_24_bits():
    got = draws(3, RANGE, 1000, part=1)
    assert got.tolist() == [naive.draw(3, RANGE + 256, i) for i in range(1000)]
    assert (got.astype(np.float32) == got).all()
    assert draws(3 + 2**32, RANGE, 9, 1).tolist() == got[:9].tolist()


def test_the_ends_of_the_range():
    values = draws(1, PIXEL_LIGHTS, 1 << 25)  # every multiple of 2^-24 is expected twice
    assert values.min() == 0.0
    assert values.max() == 1 - 2.0**-24


def test_what_does_not_fit():
    for wrong in ({"seed": -1}, {"part": -1}, {"part": 1 << 24}):
        with pytest.raises(InputError, match=next(iter(wrong))):
            draws(**{"seed": 0, "use": RANGE, "count": 1, **wrong})


def is_uniform(cells, count):
    """Chi-square of the counts of equally likely cells, both ends."""
    filled = np.bincount(cells, minlength=count)
    expected = len(cells) / count
    statistic = ((filled - expected) ** 2 / expected).sum()
    return chi2.ppf(ALPHA, count - 1) < statistic < chi2.isf(ALPHA, count - 1)


@pytest.mark.parametrize("use", USES)
@pytest.mark.parametrize("seed", SEEDS)
def test_each_stream_is_uniform_and_without_memory(use, seed):
    values = draws(seed, USES[use], COUNT)
    assert is_uniform((values * 1024).astype(int), 1024)
    ordered = np.sort(values)
    distance = max((np.arange(1, COUNT + 1) / COUNT - ordered).max(), (ordered - np.arange(COUNT) / COUNT).max())
    assert distance < kstwo.isf(ALPHA, COUNT)
    pairs = (values.reshape(-1, 2) * 32).astype(int)
    assert is_uniform(pairs[:, 0] * 32 + pairs[:, 1], 1024)
    for lag in (1, 2, 3, 7, 64, 256, 1024):
        assert abs(np.corrcoef(values[:-lag], values[lag:])[0, 1]) < DEVIATIONS / math.sqrt(COUNT)


@pytest.mark.slow
def test_neighbouring_seeds_streams_and_parts_are_independent():
    seeds, uses, parts = (0, 1, 2, 3, 2**31, 2**32 - 1), tuple(USES.values()), (0, 1, 2, 255)
    streams = [draws(seed, use, COUNT, part) for seed, use, part in itertools.chain(
        itertools.product(seeds, uses[:1], (0,)), itertools.product((0,), uses[1:], (0,)),
        itertools.product((0,), uses[:1], parts[1:]), itertools.product((1,), (RANGE,), (0, 1)))]
    correlation = np.corrcoef(streams) - np.eye(len(streams))
    assert np.abs(correlation).max() < DEVIATIONS / math.sqrt(COUNT)
    for one, other in itertools.combinations(streams[::2], 2):
        assert is_uniform((one * 32).astype(int) * 32 + (other * 32).astype(int), 1024)


def test_seeds_and_streams_are_uniform_in_themselves():
    """The first number of each of many seeds, and of each part of a stream."""
    seeds = np.array([draws(seed, PIXEL_LIGHTS, 1)[0] for seed in range(20_000)])
    parts = np.array([draws(0, PIXEL_LIGHTS, 1, part)[0] for part in range(20_000)])
    for values in (seeds, parts):
        assert is_uniform((values * 100).astype(int), 100)
        assert abs(np.corrcoef(values[1:], values[:-1])[0, 1]) < DEVIATIONS / math.sqrt(len(values))
    assert abs(np.corrcoef(seeds, parts)[0, 1]) < DEVIATIONS / math.sqrt(len(seeds))


def test_every_bit_of_seed_stream_and_index_turns_half_of_the_bits():
    rng = np.random.default_rng(1)
    places = rng.integers(0, 2**32, (2000, 3))
    plain = [naive.draw_bits(*map(int, place)) for place in places]
    for which, bit in itertools.product(range(3), range(32)):
        turned = places.copy()
        turned[:, which] ^= 1 << bit
        flips = [(naive.draw_bits(*map(int, place)) ^ before).bit_count()
                 for place, before in zip(turned, plain, strict=True)]
        assert abs(np.mean(flips) - 16) < 0.5  # of 32; five deviations are 0.3


def test_methods_draw_from_nothing_else():
    """NumPy's generators are left to path tracing, scenes in the making and changed, test vectors and the bootstrap."""
    package = Path(refgi.__file__).parent
    used = {path.relative_to(package).as_posix() for path in package.rglob("*.py")
            if re.search(r"np\.random|numpy\.random|import random", path.read_text(encoding="utf-8"))}
    assert {name.split("/")[0] for name in used} <= {"truth", "scene", "vectors", "bench", "stress"}

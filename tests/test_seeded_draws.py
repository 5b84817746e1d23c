"""docs/conventions.md: the first index of each point set, and every seeded draw from its formula."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

from refgi.error_target.error_driven import draw_samples
from refgi.frame import Frame
from refgi.lights import choose_pixel_lights
from refgi.lights.selection import roulette
from refgi.lights.shares import map_shares
from refgi.rays import Tracer
from refgi.rays.openness import openness
from refgi.rsm import reflective_shadow_map
from refgi.sampling import halton, sobol_owen
from refgi.scene import PointLight, load_scene
from refgi.settings import of
from refgi.splat.gather.gather_sum import disc_pattern
from refgi.splat.sii.settings import SiiSettings
from refgi.splat.sii.threshold import light_range
from refgi.sssil import HssilSettings
from refgi.sssil.pattern import samples_at
from refgi.sssil.slices import slice_counts, slice_offsets
from tests.naive.draws import draw, draw_bits, mix32
from tests.rsm.shapes import geometry

DOCUMENT = (Path(__file__).parents[1] / "docs" / "conventions.md").read_text(encoding="utf-8")
ROUNDING = 1e-12  # a dozen operations in float64
SEEDS = (0, 3, 2**32 - 1)


def van_der_corput(index, base):
    value, digit = 0.0, 1.0
    while index:
        digit /= base
        index, rest = divmod(index, base)
        value += rest * digit
    return value


def first_map(scene="cornell_box", light=None, resolution=32):
    scene = load_scene(scene)
    frame = Frame(scene, width=8, height=8, dtype=np.float64)
    return reflective_shadow_map(scene.geometry, frame.materials, light or scene.lights[0], resolution, np.float64)


POINT = PointLight((0.278, 0.3, -0.2), (1.0, 1.0, 1.0))


def texels(rsms, **settings):
    """Texels of the pixel lights that a pattern gives, by map, those without flux left out."""
    lights = choose_pixel_lights(rsms, **settings)
    return [lights.texel[lights.map_index == m].tolist() for m in range(len(rsms))]


def at(rsm, points):
    """The texel (floor(v H), floor(u W)) of each point that has flux."""
    height, width = rsm.projection.shape
    found = [math.floor(v * height) * width + math.floor(u * width) for u, v in points]
    flux = rsm.flux.any(axis=0).reshape(-1)
    return [texel for texel in found if flux[texel]]


@pytest.mark.parametrize("seed", SEEDS)
def test_halton_lights_start_at_index_0_and_are_shifted_by_the_draws(seed):
    rsms = [first_map(light=POINT, resolution=8), first_map(light=POINT, resolution=8)]
    got = texels(rsms, count=60, pattern="halton", seed=seed)
    for m, rsm in enumerate(rsms):
        shift = [0.0, 0.0] if seed == m == 0 else [draw(seed, 256 * m, axis) for axis in (0, 1)]
        points = [((van_der_corput(i, 2) + shift[0]) % 1, (van_der_corput(i, 3) + shift[1]) % 1) for i in range(30)]
        assert got[m] == at(rsm, points)
    assert halton(1).tolist() == [[0.0, 0.0]]


@pytest.mark.parametrize("seed", SEEDS)
def test_random_lights_are_pairs_of_draws(seed):
    rsms = [first_map(light=POINT, resolution=8), first_map()]
    got = texels(rsms, count=61, pattern="random", seed=seed)
    counts = [share.drawn for share in map_shares(rsms, 61, "random", seed)]
    assert sum(counts) == 61
    for m, rsm in enumerate(rsms):
        points = [(draw(seed, 256 * m, 2 * k), draw(seed, 256 * m, 2 * k + 1)) for k in range(counts[m])]
        assert got[m] == at(rsm, points)


@pytest.mark.parametrize("seed", SEEDS)
def test_offsets_of_gathering_start_at_index_1(seed):
    shift = [draw(seed, 5, axis) if seed else 0.0 for axis in (0, 1)]
    for i, (down, right, _) in enumerate(disc_pattern(20, seed)):
        xi, turn = ((van_der_corput(i + 1, base) + s) % 1 for base, s in zip((2, 3), shift, strict=True))
        angle = 2 * math.pi * turn
        assert (down, right) == pytest.approx((xi * math.cos(angle), xi * math.sin(angle)), abs=ROUNDING)


class EmittedError(Exception):
    """Carries the numbers of paths."""


@pytest.mark.parametrize("seed", SEEDS)
def test_paths_start_at_index_1_and_are_shifted_by_the_draws(seed, monkeypatch):
    from refgi.lights import walk

    def stop(*emitted):
        raise EmittedError(emitted[2])

    monkeypatch.setattr(walk, "_emit", stop)
    scene = load_scene("cornell_box")
    frame = Frame(scene, width=8, height=8, dtype=np.float64)
    with pytest.raises(EmittedError) as caught:
        walk.walk_lights(Tracer(scene.geometry), scene.geometry, frame.materials, frame.lights, 9, bounces=2, seed=seed)
    expected = [[(van_der_corput(i, base) + (draw(seed, 1, c) if seed else 0.0)) % 1
                 for c, base in enumerate((2, 3, 5, 7, 11, 13))] for i in range(1, 10)]
    np.testing.assert_allclose(caught.value.args[0], expected, atol=ROUNDING)


def test_the_table_of_known_values():
    rows = re.findall(r"\| (\d+) \| (\d+) \| (\d+) \| ([0-9a-f]{8}) \| ([0-9.]+) \|", DOCUMENT)
    assert len(rows) == 5
    for seed, stream, index, bits, number in rows:
        place = int(seed), int(stream), int(index)
        assert draw_bits(*place) == int(bits, 16)
        assert round(draw(*place), 7) == float(number)


@pytest.mark.parametrize("seed", SEEDS)
def test_roulette_keeps_light_k_by_draw_k(seed):
    lights = choose_pixel_lights([first_map()], count=200, pattern="halton")
    free = np.linspace(0, 1, lights.flux.shape[1])
    kept = [k for k, share in enumerate(free) if draw(seed, 2, k) < max(0.1, 1 - share)]
    np.testing.assert_array_equal(roulette(lights, free, 0.1, seed).texel, lights.texel[kept])


@pytest.mark.parametrize("seed", SEEDS)
def test_xi_of_the_stochastic_range(seed):
    settings = of(SiiSettings, stochastic=True, seed=seed)
    for part in (0, 1):
        scale = light_range(np.ones(50), 0.1, settings.reach, part, np.float64).scale
        assert scale.tolist() == [1 - draw(seed, 3 + 256 * part, k) for k in range(50)]


@pytest.mark.parametrize("seed", SEEDS)
def test_samples_of_the_error_target_of_multires(seed):
    covered = np.random.default_rng(4).random((100, 151)) < 0.4
    side = min(max(math.isqrt(covered.size) // 48, 1), 8)
    across = -(-151 // side)
    expected = []
    for i in range(-(-100 // side)):
        for j in range(across):
            here = [(y, x) for y in range(i * side, min(i * side + side, 100))
                    for x in range(j * side, min(j * side + side, 151)) if covered[y, x]]
            if here:
                y, x = here[math.floor(draw(seed, 4, i * across + j) * len(here))]
                expected.append(y * 151 + x)
    assert draw_samples(covered, seed).pixel.tolist() == expected


A, B = 0.7548776662466927, 0.5698402909980532  # 1 / g, 1 / g^2


def test_the_steps_of_hssils_points():
    assert pytest.approx(1 / A + 1, rel=1e-15) == (1 / A) ** 3
    assert pytest.approx(A * A, rel=1e-15) == B


def level_key(seed, number):
    return mix32(seed ^ mix32((number + 0x9E3779B9) % 2**32))


def pair_of(key):
    return mix32(key) / 2**32, mix32(key ^ 0x27D4EB2F) / 2**32


def row_key(key, row):
    return mix32(key ^ mix32((row + 0x85EBCA6B) % 2**32))


def pixel_key(key, column):
    return mix32(key ^ mix32((column + 0xC2B2AE35) % 2**32))


def place(radius, near, u, angle, density="inverse_distance"):
    length = radius * (math.sqrt(near + (1 + 2 * near) * u) if density == "uniform" else near + u)
    return math.floor(length * math.cos(angle) + 0.5), math.floor(length * math.sin(angle) + 0.5)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("index", [0, 1])
@pytest.mark.parametrize("density", ["inverse_distance", "uniform"])
@pytest.mark.parametrize("pattern", ["interleaved", "row", "pixel"])
def test_samples_of_a_receiver(pattern, density, index, seed):
    settings = of(HssilSettings, radius=6.5, samples=13, inner_samples=5, pattern=pattern, density=density, seed=seed)
    inner = settings.sampling.inner if index == 0 else 0
    for row, column in ((0, 0), (3, 6), (17, 41)):
        key = level_key(seed, 2)
        n = 2 * row + column % 2 if pattern == "row" else 4 * (row % 4) + column % 4
        if pattern == "pixel":
            key, n = pixel_key(row_key(key, row), column), 0
        s, t = pair_of(key)
        expected = []
        for near, count in ((0, inner), (1, 13)):
            for j in range(count):
                u = ((0.5 + j * A) % 1 + s + n * 13 * A) % 1
                v = (0.5 + j * B) % 1 + t + n * 13 * B
                expected.append(place(6.5, near, u, 2 * math.pi * v, density))
        assert samples_at(settings.sampling, index, 2, row, column)[0].tolist() == [list(offset) for offset in expected]


@pytest.mark.parametrize("seed", SEEDS)
def test_fixed_samples_are_mirror_images(seed):
    settings = of(HssilSettings, radius=6.5, samples=13, inner_samples=5, pattern="fixed", density="uniform",
                  seed=seed)
    s, t = pair_of(level_key(seed, 1))
    pairs, middles = [], []
    for near, count in ((0, settings.sampling.inner), (1, 13)):
        for j in range((count + 1) // 2):
            u, v = (0.5 + j * A + s) % 1, (0.5 + j * B + t) % 1
            x, y = place(6.5, near, u, math.pi * (v - 0.5), "uniform")
            if 2 * j + 1 < count:
                pairs += [(x, y), (-x, y)]
            else:
                length = 6.5 * math.sqrt(near + (1 + 2 * near) * u)
                middles.append((0, math.floor(math.copysign(length, v - 0.5) + 0.5)))
    assert sorted(map(tuple, samples_at(settings.sampling, 0, 1, 0, 0)[0].tolist())) == sorted(pairs + middles)


@pytest.mark.parametrize("pattern", ["row", "interleaved"])
@pytest.mark.parametrize("seed", SEEDS)
def test_slices_of_the_bitmask(seed, pattern):
    settings = of(HssilSettings, radius=8.0, samples=16, inner_samples=4, visibility="bitmask", density="uniform",
                  seed=seed, pattern=pattern, tile=2)
    steps = slice_counts(settings.sampling, settings.visibility, 0, 8.0)
    offsets, _ = slice_offsets(settings.sampling, steps, 1, 4)
    assert offsets.shape[:2] == ((4, 1) if pattern == "row" else (2, 2))
    for row, column in np.ndindex(offsets.shape[:2]):
        s, t = pair_of(row_key(level_key(seed, 1), row) if pattern == "row" else level_key(seed, 1))
        if pattern == "interleaved":
            n = 2 * row + column
            s, t = (s + n * 0.5698402909980532) % 1, (t + n * 0.7548776662466927) % 1
        for k in range(steps.slices):
            angle, shift = 2 * math.pi * (k + s) / steps.slices, (t + 0.6180339887498949 * k) % 1
            lengths = [8.0 * (j + shift) / steps.occluders for j in range(steps.occluders)]
            lengths += [8.0 * math.sqrt((j + shift) / steps.disc) for j in range(steps.disc)]
            lengths += [8.0 * math.sqrt(1 + 3 * (j + shift) / steps.crown) for j in range(steps.crown)]
            expected = [[math.floor(far * math.sin(angle) + 0.5), math.floor(far * math.cos(angle) + 0.5)]
                        for far in sorted(lengths)]
            assert offsets[row, column, k].tolist() == expected


def test_openness_of_a_point_by_its_rays():
    """Half of a ceiling, over x > 0: a ray is blocked where it is steep enough and leans that way."""
    ceiling = geometry([[0, 0.5, -90], [90, 0.5, -90], [90, 0.5, 90], [0, 0.5, 90]], [[0, 1, 2], [0, 2, 3]])
    points, up = np.zeros((3, 6)), np.repeat([[0.0], [1.0], [0.0]], 6, axis=1)
    for seed in SEEDS:
        got = openness(Tracer(ceiling), points, up, radius=1.0, rays=16, seed=seed)
        for i in range(6):
            w = mix32(i ^ mix32((seed + 0x9E3779B9) % 2**32))
            turn, free = mix32((w + 1) % 2**32) / 2**32, 0
            for k in range(16):
                u, v = (sobol_owen(np.uint32(k), axis, np.uint32(seed)) for axis in (0, 1))
                cosine = math.sqrt(1 - (u + w / 2**32) % 1)
                free += cosine < 0.5 or math.cos(2 * math.pi * (v + turn)) < 0
            assert got[i] == pytest.approx(free / 16)

"""Sums over samples: against the literal text, and what they must keep whatever the numbers."""

import math

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.literal import hssil_crown as literal
from refgi.scene import load_scene
from refgi.settings import of, replaced
from refgi.sssil.crown import _list_emitting, gather
from refgi.sssil.form_factor import DISC, Emitters, SampleForm
from refgi.sssil.pattern import samples_at
from refgi.sssil.settings import PRESETS, HssilSettings
from refgi.sssil.view import Level
from tests.sssil.counting import COUNTED, reads_of_levels, share_inside

SETTINGS = of(HssilSettings, radius=3.3, samples=9, levels=2)
# of the largest value: terms of a sum of up to 200, each with a dozen roundings
ROUNDING = {np.float64: 4e-15, np.float32: 2e-6}


def random_level(shape, dtype=np.float64, seed=0, background=0.2, number=1):
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=(3, *shape))
    position, radiance, area = rng.normal(size=(3, *shape)), rng.random((3, *shape)), 0.01 * rng.random(shape)
    seen = rng.random(shape) >= background
    planes = (position * seen, np.where(seen, 1.0 + rng.random(shape), np.inf),
              normal / np.linalg.norm(normal, axis=0) * seen, radiance * seen, area * seen)
    pixel = np.where(seen, np.arange(seen.size).reshape(shape), -1).astype(np.int32)
    return Level(number, *(np.ascontiguousarray(plane, dtype) for plane in planes), pixel)


def summed(level, sampling, index, form, share):
    """Return the sum of the literal text over the samples that the package draws for each texel."""
    each = [[samples_at(sampling, index, 1, row, column) for column in range(level.shape[1])]
            for row in range(level.shape[0])]
    offsets, weight = (np.array([[one[k] for one in row] for row in each]) for k in (0, 1))
    position, normal, radiance, area = (np.asarray(plane, float) for plane in (
        level.position, level.normal, level.radiance, level.area))
    if (form, share) == ("disc", 1.0):
        return literal.gather(position, normal, radiance, area, offsets, weight)
    if form == "disc":
        return literal.gather_shared(position, normal, position, normal, radiance, area, offsets, weight, share)
    i, j, texels = literal.samples_at(level.shape, offsets, weight)
    pairs = position[..., None], normal[..., None], position[:, i, j], normal[:, i, j]
    factor = literal.point_form_factor(*pairs, area[i, j] * texels)
    return (factor * radiance[:, i, j]).sum(axis=-1)


@pytest.mark.feature("HSS-03", "HSS-04", "HSS-06")
@pytest.mark.parametrize(("form", "share"), [("disc", 1.0), ("disc", 0.25), ("disc", 0.0), ("point", 0.25)])
@pytest.mark.parametrize("density", ["inverse_distance", "uniform"])
@pytest.mark.parametrize("pattern", ["interleaved", "row", "fixed", "all", "pixel"])
def test_equals_the_literal_text(pattern, density, form, share):
    """Oracle: every pattern and form, float64, first level and a later one, odd sizes."""
    for shape, index in (((7, 11), 0), ((9, 6), 1)):
        level = random_level(shape, seed=index)
        settings = replaced(SETTINGS, {"pattern": pattern, "density": density, "form_factor": form,
                                       "disc_share": share})
        expected = summed(level, settings.sampling, index, form, share)
        assert expected.max() > 0
        np.testing.assert_allclose(gather(level, index, settings), expected, rtol=0,
                                   atol=ROUNDING[np.float64] * expected.max())


@pytest.mark.feature("HSS-04")
@pytest.mark.parametrize("pattern", ["interleaved", "pixel"])
def test_a_sample_of_less_than_a_texel_has_no_larger_disc(pattern):
    """Oracle: so many samples that near ones stand for less than a texel, whose disc covers all of it."""
    level = random_level((7, 11))
    settings = replaced(SETTINGS, {"pattern": pattern, "samples": 150, "disc_share": 0.25})
    weight = samples_at(settings.sampling, 0, 1, 3, 5)[1]
    assert (weight < 1).sum() > 50
    assert (weight > 1).any()
    expected = summed(level, settings.sampling, 0, "disc", 0.25)
    np.testing.assert_allclose(gather(level, 0, settings), expected, rtol=0,
                               atol=ROUNDING[np.float64] * expected.max())


@pytest.mark.parametrize(("trims", "lanes"), [(True, [8, 24]), (False, [0, 32])])
def test_a_sample_is_summed_for_the_lanes_that_it_emits_for(trims, lanes):
    """Lanes 16 to 31 of one row of 64 emit; a strip of 32 has a sample 8 texels to the right, one 32 to the right."""
    emit_from = np.array([16, 16, 16, 24, 64, 64, 64, 64, 64], np.int32).reshape(1, 1, 9).repeat(2, axis=0)
    emit_to = np.array([0, 0, 0, 24, 32, 32, 32, 32, 32], np.int32).reshape(1, 1, 9).repeat(2, axis=0)
    emitters = Emitters(np.zeros(0), emit_from, emit_to, phases=1, line=64, pad=0, strip=32, scale=1.0)
    offsets, weight = np.array([[8, 0], [32, 0]], np.int32), np.ones(2)
    starts, weights = np.empty((3, 3), np.int64), np.empty((2, 3))
    count = _list_emitting(emitters, offsets, 8.0 * weight, False, trims, SampleForm(DISC, 0.5), 0, 0, 0, starts,
                           weights)
    assert count == 1  # the other one is dark for the whole strip
    assert starts[:, 0].tolist() == [8, *lanes]
    assert weights[:, 0].tolist() == [8.0, 4.0]  # texels that it stands for, and those of its disc


def test_single_precision_rounds_and_no_more():
    """Oracle: float32 against the literal text on the same numbers; several strips of lanes, some of them dark."""
    level = random_level((5, 700), np.float32)
    level.radiance[:, :, 100:500] = 0
    settings = replaced(SETTINGS, {"samples": 4})
    expected = summed(level, settings.sampling, 0, "disc", 0.25)
    found = gather(level, 0, settings)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, expected, rtol=0, atol=ROUNDING[np.float32] * expected.max())


@pytest.mark.feature("HSS-10")
@pytest.mark.parametrize("pattern", ["fixed", "all"])
def test_a_mirrored_level_receives_mirrored_light(pattern, evidence):
    """Property: to the bit, with the axis of the mirror along x, both precisions, even and odd widths."""
    for dtype, width in ((np.float32, 21), (np.float64, 22)):
        level = random_level((13, width), dtype)
        sign = np.array([-1, 1, 1], dtype)[:, None, None]
        mirrored = level._replace(**{name: np.ascontiguousarray(getattr(level, name)[..., ::-1])
                                     for name in ("depth", "radiance", "area", "pixel")},
                                  position=np.ascontiguousarray(level.position[..., ::-1] * sign),
                                  normal=np.ascontiguousarray(level.normal[..., ::-1] * sign))
        settings = replaced(SETTINGS, {"pattern": pattern, "samples": 16})
        there = gather(mirrored, 0, settings)
        np.testing.assert_array_equal(there[..., ::-1], gather(level, 0, settings))
    evidence(f"pattern {pattern}: mirrored level, mirrored irradiance to the bit, float32 and float64")


def test_one_near_texel_among_far_ones_leaves_no_nan():
    """Depths of 1e-3 m and 1e8 m: 4th powers of their distances are at the ends of float32."""
    far = random_level((8, 8), np.float32, background=0.0)
    scale = np.full((8, 8), 1e8, np.float32)
    scale[0, 0] = 1e-3
    level = far._replace(position=far.position * scale, depth=far.depth * scale, area=far.area * scale**2)
    got = gather(level, 0, SETTINGS)
    assert np.isfinite(got).all()
    assert got.max() > 0


@pytest.mark.parametrize("power", [-40, -10, 20, 40])
def test_scale_of_the_scene_changes_no_bit(power):
    """Property: lengths times 2^k and areas times 4^k, from 1e-12 to 1e12, in float32."""
    level = random_level((9, 20), np.float32)
    scale = np.float32(2.0**power)
    there = level._replace(position=level.position * scale, depth=level.depth * scale, area=level.area * scale**2)
    np.testing.assert_array_equal(gather(there, 0, SETTINGS), gather(level, 0, SETTINGS))


@pytest.mark.parametrize("form", ["disc", "point"])
def test_hard_numbers_stay_finite_and_bounded(form):
    """Property: texels at one place, depths from 1e-3 to 1e6, areas of grazing views; Eq. 4 knows a bound."""
    for dtype in (np.float32, np.float64):
        level = random_level((12, 24), dtype)
        rng = np.random.default_rng(3)
        level.position[...] *= (10.0 ** rng.uniform(-3, 6, level.shape)).astype(dtype)
        level.position[:, 3:5, 4:9] = level.position[:, :1, :1]
        level.depth[level.area > 0] = np.abs(level.position).max(axis=0)[level.area > 0] + 1e-3
        level.area[...] *= (10.0 ** rng.uniform(-9, 12, level.shape)).astype(dtype)
        found = gather(level, 0, replaced(SETTINGS, {"form_factor": form}))
        assert np.isfinite(found).all()
        assert (found >= 0).all()
        if form == "disc":  # each sample fills at most the hemisphere
            assert found.max() <= math.pi * level.radiance.max() * 12 * (1 + 1e-5)


def test_one_texel_and_none_seen_receive_nothing():
    """Property: 1 x 1, one row, one column, and all background."""
    for shape, background in (((1, 1), 0.0), ((1, 1), 1.0), ((6, 5), 1.0)):
        assert not gather(random_level(shape, background=background), 0, SETTINGS).any()
    for shape in ((1, 9), (9, 1)):
        found = gather(random_level(shape, background=0.0), 0, replaced(SETTINGS, {"pattern": "all"}))
        assert found.any()
        assert np.isfinite(found).all()


@pytest.mark.feature("HSS-04", "HSS-08")
def test_printed_forms_differ_by_their_factor():
    """Analytic: Eq. 4 without its pi is 1 / pi of it; 2^2k again is 4 per level; Eq. 3 has no pi to lose."""
    level = random_level((6, 8))

    def light(index, *names, form="disc"):
        settings = replaced(SETTINGS, {"as_published": frozenset(names), "form_factor": form})
        return gather(level, index, settings)

    np.testing.assert_allclose(light(1, "hss_disc_pi"), light(1) / math.pi, rtol=1e-14)
    np.testing.assert_allclose(light(2, "hss_level_factor"), light(2) * 16, rtol=1e-14)
    np.testing.assert_array_equal(light(0, "hss_level_factor"), light(0))
    np.testing.assert_array_equal(light(1, "hss_disc_pi", form="point"), light(1, form="point"))


def groove(number, size):
    """Two planes that meet at a right angle, seen from straight above; 2^number pixels a side of a texel."""
    count = size >> number
    at = ((np.arange(count) + 0.5) * 2**number - size / 2) / size
    x, y = np.broadcast_to(at, (count, count)), np.broadcast_to(at[:, None], (count, count))
    position = np.stack([x, y, np.abs(x) - 3.0])
    normal = np.stack([-np.sign(x), np.zeros_like(x), np.ones_like(x)]) / math.sqrt(2)
    area = np.full((count, count), math.sqrt(2) * (2**number / size) ** 2)
    radiance = np.ones((3, count, count))
    pixel = np.zeros((count, count), np.int32)
    return Level(number, *map(np.ascontiguousarray, (position, -position[2], normal, radiance, area)), pixel)


@pytest.mark.feature("HSS-08")
def test_mean_light_does_not_depend_on_the_split_into_levels(evidence):
    """Analytic: one level of radius 16, two of 8 and three of 4 reach as far; the printed 2^2k counts areas twice."""
    def mean(levels, *printed):
        settings = of(HssilSettings, radius=16.0 / 2 ** (levels - 1), levels=levels, pattern="all",
                                 as_published=frozenset(printed))
        return sum(gather(groove(k, 64), k, settings).mean() for k in range(levels))

    one, two, three, twice = mean(1), mean(2), mean(3), mean(3, "hss_level_factor")
    assert two == pytest.approx(one, rel=0.02)  # rims of coarse crowns are off by half a coarse texel
    assert three == pytest.approx(one, rel=0.05)
    assert twice > 1.5 * one
    evidence(f"mean E of 2 and 3 levels over that of one: {two / one:.4f}, {three / one:.4f}; "
             f"with the printed 2^2k: {twice / one:.2f}")


@pytest.mark.feature("HSS-06")
@pytest.mark.parametrize("pattern", ["interleaved", "row", "pixel"])
def test_error_falls_with_samples_and_the_mean_stays(pattern, evidence):
    """Statistical: Eq. 3 on a bounded scene, 12 seeds: no bias, and the error falls at least as N^-1/2."""
    level, count = groove(0, 32), 12
    level.position[2, :, 16:] += 0.5  # the halves are apart: no pair is near
    settings = of(HssilSettings, radius=6.0, levels=1, pattern=pattern, form_factor="point")
    exact = _of_shares(level, settings.sampling.radius)
    error = []
    for samples in (16, 64, 256):
        found = np.array([gather(level, 1, replaced(settings, {"samples": samples, "seed": seed}))[0]
                          for seed in range(count)])
        means = found.mean(axis=(1, 2))
        assert abs(means.mean() - exact.mean()) < 4.0 * means.std(ddof=1) / math.sqrt(count) + 1e-3 * exact.mean()
        error.append(math.sqrt(((found - exact) ** 2).mean()) / exact.mean())
    assert error[0] / error[1] > 1.9  # 2 for independent samples
    assert error[1] / error[2] > 1.9
    evidence(f"pattern {pattern}: relative error {error[0]:.3f}, {error[1]:.4f}, {error[2]:.4f} with 16, 64, 256 "
             f"samples; mean over seeds within {abs(means.mean() / exact.mean() - 1):.1e}")


@pytest.mark.feature("HSS-06")
def test_few_samples_are_darker_by_equation_4(evidence):
    """Statistical: E-HSS-05; a sample's disc is as large as its share of the crown, so light falls with their number.

    Expected is every texel once, its term s c t A / (r^2 + R^2) with R^2 = t ds / pi.
    """
    level, radius, darker = groove(0, 64), 8.0, []
    whole = _of_shares(level, radius).mean()
    for samples in (16, 64, 256):
        settings = of(HssilSettings, radius=radius, levels=1, pattern="pixel", density="uniform", disc_share=1.0,
                      samples=samples)
        found = np.array([gather(level, 1, replaced(settings, {"seed": seed}))[0].mean() for seed in range(12)])
        expected = _of_shares(level, radius, 3 * math.pi * radius**2 / samples).mean()
        assert abs(found.mean() - expected) < 4.0 * found.std(ddof=1) / math.sqrt(12) + 1e-3 * expected
        darker.append(found.mean() / whole)
    assert darker[0] < darker[1] < darker[2] < 1
    evidence("Eq. 4 in a groove with 16, 64, 256 samples: " + ", ".join(f"{one:.3f}" for one in darker) + " of Eq. 3")


def _of_shares(level, radius, texels=0.0):
    """Sum every texel by the share of it that lies in the crown: what the mean of all patterns must be.

    `texels`: how many each sample's disc of Eq. 4 stands for; 0: Eq. 3.
    """
    reach = math.ceil(2 * radius) + 1
    offsets = [(x, y) for x in range(-reach, reach + 1) for y in range(-reach, reach + 1)]
    share = [share_inside(x, y, radius, 2 * radius) for x, y in offsets]
    kept = [(offset, s) for offset, s in zip(offsets, share, strict=True) if s > 0]
    position, normal, area = level.position, level.normal, level.area
    total = np.zeros(level.shape)
    rows, columns = np.mgrid[: level.shape[0], : level.shape[1]]
    for (ox, oy), s in kept:
        a, b = rows + oy, columns + ox
        inside = (a >= 0) & (a < level.shape[0]) & (b >= 0) & (b < level.shape[1])
        a, b = np.where(inside, a, 0), np.where(inside, b, 0)
        d = position[:, a, b] - position
        square = np.maximum((d * d).sum(axis=0), 1e-30)
        c, t = np.maximum((normal * d).sum(axis=0), 0), np.maximum(-(normal[:, a, b] * d).sum(axis=0), 0)
        disc = texels * area[a, b] * t / (np.sqrt(square) * math.pi)  # t is not divided by the distance
        total += np.where(inside, s * c * t * area[a, b] / (square * (square + disc)), 0) * level.radiance[0, a, b]
    return total


@pytest.mark.feature("HSS-19")
def test_the_first_level_has_most_of_the_samples(evidence):
    """Pairs that the method adds up at the paper's shape of picture; the share of time it prints is the crowns'."""
    frame = Frame(load_scene("cornell_box"), width=640, height=360, rsm_resolution=64)
    five = replaced(PRESETS["paper"], {"levels": 5})
    crowns, whole = (reads_of_levels(frame, replaced(five, {"inner_samples": inner})) for inner in (0, None))
    share, with_disc = (reads[0] / sum(reads[:4]) for reads in (crowns, whole))
    fifth = crowns[4] / sum(crowns[:4])
    texels = [320 * 180 // 4**k for k in range(4)]
    evidence(f"first of 4 levels: {share:.1%} of the crowns' samples, {with_disc:.1%} with its disc; a fifth adds "
             f"{fifth:.2%}; a pixel of the picture has {crowns[0] / texels[0]:.1f} samples in the crown, "
             f"{(whole[0] - crowns[0]) / texels[0]:.1f} in the disc")
    assert crowns[:3] == pytest.approx([64 * n for n in texels[:3]], rel=COUNTED)
    assert whole[1:] == pytest.approx(crowns[1:], rel=2 * COUNTED)  # the first level alone has a disc
    assert whole[0] - crowns[0] == pytest.approx(64 / 3 * texels[0], rel=8 * COUNTED)
    assert share == pytest.approx(0.753, abs=0.01)
    # rows and columns rounded up
    assert fifth == pytest.approx(20 * 12 / (sum(texels[:3]) + 40 * 23), rel=2 * COUNTED)
    assert fifth < 0.01  # as the paper says

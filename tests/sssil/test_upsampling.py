"""Upsampling between levels: against its twin, constants and planes, edges, mirrors, and what it must not do."""

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.frame import Frame
from refgi.literal import upsampling as literal
from refgi.scene import load_scene
from refgi.settings import of
from refgi.sssil.settings import HssilSettings
from refgi.sssil.upsampling import Guide, upsample

# a share of the result; float32: some 30 roundings of half a unit, and off, whose rounding the 16th power multiplies
TWIN = {np.float64: 1e-11, np.float32: 3e-4}
ROUNDING = 4 * np.finfo(np.float32).eps
PLAIN = HssilSettings()


def closest(depth, normal, factor):
    """Depth and normal of the nearest pixel of every texel."""
    rows, columns = (-(-size // factor) for size in depth.shape)
    below, normals = np.full((rows, columns), np.inf), np.zeros((3, rows, columns))
    for i in range(depth.shape[0]):
        for j in range(depth.shape[1]):
            if depth[i, j] < below[i // factor, j // factor]:
                below[i // factor, j // factor] = depth[i, j]
                normals[:, i // factor, j // factor] = normal[:, i, j]
    return below, normals


def slanted(shape, across=0.3, down=1.0):
    """A plane whose nearness is linear in the picture, and its constant normal."""
    y, x = ((np.arange(size) + 0.5) / size for size in shape)
    depth = 1 / (0.2 + down * y[:, None] + across * x[None, :])
    normal = np.zeros((3, *shape))
    normal[1] = 1
    return depth, normal


def rubble(shape, seed):
    """Slanted slabs in front of each other, with gaps, and normals that vary a little."""
    rng = np.random.default_rng(seed)
    depth, _ = slanted(shape)
    slab = rng.integers(0, 3, (-(-shape[0] // 3), -(-shape[1] // 5))).repeat(3, 0).repeat(5, 1)[: shape[0], : shape[1]]
    depth = np.where(slab == 0, depth, depth * (0.7 + 0.2 * slab))
    depth *= 1 + 0.01 * rng.random(shape)
    depth[rng.random(shape) < 0.1] = np.inf
    depth[:, : shape[1] // 8] = np.inf
    normal = rng.normal(0, 0.2, (3, *shape)) + np.eye(3)[slab % 2 + 1].transpose(2, 0, 1)
    normal /= np.linalg.norm(normal, axis=0)
    return depth, normal * np.isfinite(depth)


def guides(depth, normal, factor, dtype=np.float64):
    """Guides of the texels and of the pixels."""
    below = closest(depth, normal, factor)
    return (Guide(*(array.astype(dtype) for array in pair)) for pair in (below, (depth, normal)))


CASES = {
    "half": ((21, 27), 2, {}, np.float64),
    "quarter": ((18, 23), 4, {"downsample": "average", "depth_sigma": 0.1}, np.float64),
    "wide": ((6, 331), 2, {}, np.float64),
    "one": ((1, 1), 2, {}, np.float64),
    "row": ((1, 19), 4, {}, np.float64),
    "single": ((21, 27), 2, {"depth_sigma": 0.1}, np.float32),
    "any power": ((14, 17), 2, {"normal_power": 2.5}, np.float32),
    "no power": ((14, 17), 2, {"normal_power": 0}, np.float32),
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.feature("HSS-11")
def test_equals_its_twin(case, evidence):
    shape, factor, changes, dtype = CASES[case]
    settings = of(HssilSettings, **changes)
    below, here = guides(*rubble(shape, 1), factor, dtype)
    rng = np.random.default_rng(2)
    light, added = (rng.random((3, *size)).astype(dtype) for size in (below.depth.shape, shape))
    got = upsample(light, below, here, settings, added)
    twin = literal.upsample(light, *map(np.float64, below), *map(np.float64, here), factor,
                            settings.upsampling.depth_sigma, settings.upsampling.normal_power,
                            settings.senders.downsample != "average")
    twin += added * np.isfinite(here.depth)
    error = float(np.max(np.abs(got - twin)))
    assert got.dtype == dtype
    assert error <= TWIN[dtype]
    evidence(f"{case}: within {error:.1e} of the twin")


@pytest.mark.feature("HSS-11")
@pytest.mark.parametrize("mode", ["bilinear", "nearest"])
def test_plain_modes(mode):
    below, here = guides(*rubble((13, 18), 3), 4)
    light = np.random.default_rng(4).random((3, *below.depth.shape))
    got = upsample(light, below, here, of(HssilSettings, upsampling=mode))
    seen = np.isfinite(here.depth)
    own = light.repeat(4, 1).repeat(4, 2)[:, :13, :18] * seen
    np.testing.assert_allclose(got, literal.bilinear(light, below.depth, here.depth, 4) if mode == "bilinear" else own,
                               rtol=0, atol=TWIN[np.float64])


@pytest.mark.feature("HSS-11")
def test_constants_stay(evidence):
    depth, normal = rubble((40, 70), 5)
    below, here = guides(depth, normal, 2, np.float32)
    light = np.full((3, *below.depth.shape), 0.3, np.float32)
    for mode in ("bilateral", "bilinear", "nearest"):
        got = upsample(light, below, here, of(HssilSettings, upsampling=mode))
        off = got[:, np.isfinite(depth)] / np.float32(0.3) - 1
        assert np.max(np.abs(off)) <= ROUNDING
    below, here = guides(*slanted((40, 70)), 2, np.float32)
    light = np.full((3, *below.depth.shape), 0.3, np.float32)
    assert np.array_equal(upsample(light, below, here, PLAIN), np.full((3, 40, 70), 0.3, np.float32))
    evidence("equal light is equal to the bit on a slanted plane, to 4 units in the last place in rubble")


@pytest.mark.parametrize("downsample", ["closest", "average"])
@pytest.mark.parametrize("factor", [2, 4])
@pytest.mark.feature("HSS-11")
def test_linear_light_stays_linear_on_a_slanted_plane(factor, downsample, evidence):
    # analytic: the tent leaves linear functions as they are, and a plane in the picture keeps the whole tent
    depth, normal = slanted((32, 48), down=4.0)
    below, here = guides(depth, normal, factor)
    ramp = 3 * np.arange(48)[None, :] + 5 * np.arange(32)[:, None] + 1.0
    light = ramp[factor - 1 :: factor, factor - 1 :: factor]  # of the nearest pixel
    if downsample == "average":  # of the texel's middle, as is its nearness
        light = ramp.reshape(32 // factor, factor, -1, factor).mean((1, 3))
        below = Guide(1 / (1 / depth).reshape(32 // factor, factor, -1, factor).mean((1, 3)), below.normal)
    got = upsample(np.stack([light] * 3), below, here, of(HssilSettings, downsample=downsample))
    inner = (slice(None), slice(factor, -factor), slice(factor, -factor))
    error = float(np.max(np.abs(got - ramp)[inner]) / ramp.max())
    steps = np.abs(np.diff(below.depth, axis=0)) / below.depth[1:]
    assert error < 1e-12
    evidence(f"factor {factor}, {downsample}: a ramp comes out with error {error:.0e} on a plane whose depth falls by "
             f"up to {steps.max():.0%} from texel to texel")


def step(gap, turned):
    """Two half planes that meet, or lie behind each other, at a column in the midst of texels."""
    depth, normal = np.full((24, 37), 2.0), np.zeros((3, 24, 37))
    depth[:, 17:] = 2.0 * gap
    normal[2] = 1
    if turned:
        normal[:, :, 17:] = np.array([1.0, 0, 0])[:, None, None]
    return depth, normal


@pytest.mark.parametrize(("gap", "turned"), [(1.5, False), (1.0, True), (0.6, False)])
@pytest.mark.feature("HSS-11")
def test_no_bleeding_across_a_step(gap, turned, evidence):
    depth, normal = step(gap, turned)
    below, here = guides(depth, normal, 2)
    light = np.where((below.depth == 2.0) & (below.normal[2] == 1), 1.0, 0.0) * np.ones((3, 1, 1))
    right = np.zeros_like(depth)
    right[:, :17] = 1
    bled = [float(np.max(np.abs(upsample(light, below, here, of(HssilSettings, upsampling=mode)) - right)))
            for mode in ("bilateral", "bilinear")]
    assert bled[0] == 0
    assert bled[1] > 0.2  # a pixel beside the edge takes a quarter from beyond
    evidence(f"depth x {gap:g}, normals {'turned' if turned else 'alike'}: bilateral bleeds {bled[0]:g}, bilinear "
             f"{bled[1]:.2f} of the light beyond the edge")


@pytest.mark.feature("HSS-12")
def test_adding_first_equals_upsampling_apart(evidence):
    # weights do not depend on light: a chain of levels is linear in the light of each
    depth, normal = rubble((48, 64), 7)
    guide = [Guide(depth, normal)]
    for _ in range(2):
        guide.append(Guide(*closest(*guide[-1], 2)))
    rng = np.random.default_rng(8)
    light = [rng.random((3, *level.depth.shape)) * np.isfinite(level.depth) for level in guide]
    worst = 0.0
    for mode in ("bilateral", "bilinear", "nearest"):
        settings = of(HssilSettings, upsampling=mode)

        def up(values, number, added=None, settings=settings):
            return upsample(values, guide[number], guide[number - 1], settings, added)

        joined = up(up(light[2], 2, light[1]), 1, light[0])
        apart = up(up(light[2], 2), 1) + up(light[1], 1) + light[0]
        worst = max(worst, float(np.max(np.abs(joined - apart))))
    assert worst < 1e-14
    evidence(f"three levels added on the way or at the end: {worst:.0e} apart, with each kind of upsampling")


@pytest.mark.feature("HSS-12")
def test_light_is_carried_linearly_whatever_its_scale():
    below, here = guides(*rubble((21, 27), 9), 2)
    light = np.random.default_rng(1).random((3, *below.depth.shape))
    np.testing.assert_array_equal(upsample(light * 2.0**40, below, here, PLAIN),
                                  upsample(light, below, here, PLAIN) * 2.0**40)


@pytest.mark.parametrize("mode", ["bilateral", "bilinear", "nearest"])
@pytest.mark.feature("HSS-10")
def test_mirrored_pictures_come_out_mirrored_to_the_bit(mode, evidence):
    depth, normal = rubble((22, 672), 11)  # three blocks of pixels a row, which the mirror cuts elsewhere
    below, here = guides(depth, normal, 2, np.float32)
    light, added = (np.random.default_rng(3).random((3, *g.depth.shape)).astype(np.float32) for g in (below, here))
    flipped = [Guide(*(np.ascontiguousarray(array[..., ::-1]) for array in guide)) for guide in (below, here)]
    settings = of(HssilSettings, upsampling=mode)
    straight = upsample(light, below, here, settings, added)
    mirrored = upsample(light[..., ::-1], *flipped, settings, added[..., ::-1])
    assert np.array_equal(mirrored[..., ::-1], straight)
    evidence(f"{mode}: a mirrored picture comes out mirrored to the bit")


@pytest.mark.feature("HSS-11")
def test_nearest_in_depth_where_no_weight_is_left():
    depth, normal = np.full((16, 16), 2.0), np.zeros((3, 16, 16))
    normal[2] = 1
    depth[8:, 8:], depth[7, 7] = 5.0, 3.0  # a pixel behind a slab, and a wall behind both
    normal[:, 3, 12] = -normal[:, 3, 12]  # and one turned away from its like
    below, here = guides(depth, normal, 2)
    light = np.random.default_rng(3).random((3, 8, 8))
    got = upsample(light, below, here, PLAIN)
    assert np.array_equal(got[:, 7, 7], light[:, 4, 4])  # |1/3 - 1/5| < |1/3 - 1/2|
    assert np.array_equal(got[:, 3, 12], light[:, 1, 6])  # all as near: the own texel


def test_background_receives_nothing_and_gives_nothing():
    depth, normal = rubble((21, 27), 13)
    below, here = guides(depth, normal, 2, np.float32)
    light = np.where(np.isfinite(below.depth), np.float32(1), np.float32(1e30)) * np.ones((3, 1, 1), np.float32)
    added = np.where(np.isfinite(depth), np.float32(1), np.float32(np.nan)) * np.ones((3, 1, 1), np.float32)
    for mode in ("bilateral", "bilinear", "nearest"):
        got = upsample(light, below, here, of(HssilSettings, upsampling=mode), added)
        np.testing.assert_allclose(got, 2.0 * np.isfinite(depth) * np.ones((3, 1, 1)), rtol=ROUNDING)
    nothing = Guide(np.full_like(here.depth, np.inf), np.zeros_like(here.normal))
    empty = Guide(np.full_like(below.depth, np.inf), np.zeros_like(below.normal))
    assert not upsample(light, empty, nothing, PLAIN, added).any()
    seen = np.isfinite(depth)
    assert np.array_equal(upsample(light, empty, here, PLAIN, added)[:, seen], added[:, seen])


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e6])
@pytest.mark.parametrize("sigma", [1e-6, 0.02, 1e6])
def test_any_depth_is_finite_and_within_bounds(scale, sigma):
    depth, normal = rubble((21, 27), 14)
    depth[3, 4], depth[8, 9] = 1e-6, 1e6  # next to others: far beyond any slope
    below, here = guides(depth * scale, normal, 2, np.float32)
    light = np.random.default_rng(5).random((3, *below.depth.shape)).astype(np.float32) + np.float32(0.5)
    got = upsample(light, below, here, of(HssilSettings, depth_sigma=sigma))[:, np.isfinite(depth)]
    assert np.all(np.isfinite(got))
    assert got.min() >= 0.5 * (1 - ROUNDING)
    assert got.max() <= 1.5 * (1 + ROUNDING)


def test_sizes_that_do_not_fit_are_refused():
    below, here = guides(*slanted((20, 30)), 2)
    light = np.zeros((3, 10, 15))
    with pytest.raises(InputError, match=r"coarse: expected shape \(3, 10, 15\), got \(3, 10, 14\)"):
        upsample(light[..., :-1], below, here, PLAIN)
    with pytest.raises(InputError, match="added: expected shape"):
        upsample(light, below, here, PLAIN, np.zeros((3, 20, 29)))
    with pytest.raises(InputError, match=r"coarse: expected texels of 2, 4, \.\. 32 pixels"):
        upsample(light, below, Guide(*slanted((20, 31))), PLAIN)


ROUNDED = 4e-15  # a few roundings of float64


@pytest.mark.feature("HSS-16")
def test_direct_and_indirect_light_leave_by_the_same_albedo(evidence):
    frame = Frame(load_scene("cornell_box"), width=24, height=18, dtype=np.float64, rsm_resolution=32)
    indirect = np.random.default_rng(1).random((3, 18, 24)) * frame.gbuffer.covered
    without, with_light = frame.radiance(), frame.radiance(indirect)
    # what is added is albedo/pi E, channel by channel
    np.testing.assert_allclose(with_light - without, frame.gbuffer.albedo / np.pi * indirect, rtol=0,
                               atol=ROUNDED * with_light.max())
    # and the power that leaves a surface, pi L over all directions, is the albedo's share of all that arrives
    arrives = frame.direct + indirect
    leaves = np.pi * (with_light - frame.radiance(-frame.direct))  # less what it emits
    error = float(np.max(np.abs(leaves - frame.gbuffer.albedo * arrives)) / leaves.max())
    assert error < ROUNDED
    evidence(f"pi L - emission = albedo (direct + indirect) within {error:.0e} of the largest")

"""Mips of ranges, slopes and curvatures, and the discontinuities they find and miss."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from refgi.error_target.grid import level_shape, top_level
from refgi.jit import threads
from refgi.literal import multires as literal
from refgi.settings import of
from refgi.splat.multires.criteria import depth_ranges, discontinuities, normal_ranges
from refgi.splat.multires.derivatives import curvatures, depth_slopes
from refgi.splat.multires.settings import MultiresSettings
from tests.pairs.sets import random_directions, unit
from tests.splat.multires.choices import FakeBuffer, ids, only

SIZES = ((1, 1), (1, 9), (7, 1), (16, 16), (37, 53))
TOP = 3
ROUNDING = 1e-12  # of float64 sums of three squares, roots and quotients, relative to 1
THRESHOLDS = (0.2, 0.25, 1.4, 1.5)  # Fig. 11 and 12


def facing(shape, real=np.float64):
    return np.broadcast_to(np.array([0.0, 0.0, 1.0], real)[:, None, None], (3, *shape)).copy()


def scattered(shape, real=np.float64, share=0.7, seed=1):
    """A picture of random surfaces with holes."""
    rng = np.random.default_rng(seed)
    covered = rng.random(shape) < share
    depth = np.where(covered, rng.uniform(1, 3, shape), np.inf).astype(real)
    normal = random_directions(rng, covered.size).reshape(3, *shape).astype(real) * covered
    return FakeBuffer(depth, normal, covered, rng.normal(size=(3, *shape)).astype(real) * covered)


def sphere(size=64, radius=2.0, share=0.9):
    """A sphere seen from far away, which fills a share of the picture."""
    y, x = (np.mgrid[:size, :size] + 0.5 - size / 2) / (size / 2 * share)
    covered = x * x + y * y < 1
    normal = np.stack([x, -y, np.sqrt(np.maximum(0, 1 - x * x - y * y))]) * covered
    depth = np.where(covered, 100 - radius * normal[2], np.inf)
    return FakeBuffer(depth, normal, covered, radius * normal)


@pytest.mark.feature("AMS-02")
@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_ranges_are_those_of_the_pixels_with_a_surface(evidence, real):
    cells = 0
    for shape in SIZES:
        buffer = scattered(shape, real)
        for rim in (0, 1):
            depth = depth_ranges(buffer.depth, buffer.covered, TOP, rim)
            normal = normal_ranges(buffer.normal, buffer.covered, TOP, rim)
            assert depth.low[TOP].shape == level_shape(*shape, TOP)
            for mip, expected in ((depth, literal.depth_ranges(buffer.depth, ids(buffer), TOP, rim)),
                                  (normal, literal.normal_ranges(buffer.normal, ids(buffer), TOP, rim, 3))):
                for found, level in zip((*mip.low[1:], *mip.high[1:]), expected, strict=True):
                    np.testing.assert_array_equal(found, level)
            cells += sum(level.size for level in depth.low[1:])
    evidence(f"{cells} cells of pictures of {len(SIZES)} sizes: depth and normal ranges equal those of their pixels")


def test_a_picture_without_surface_has_no_range_and_no_need():
    buffer = scattered((21, 5), share=0)
    mip = depth_ranges(buffer.depth, buffer.covered, TOP)
    assert np.isposinf(mip.lows).all()
    assert np.isneginf(mip.highs).all()
    every = of(MultiresSettings, **only("depth", "derivative", "normal", "curvature"), depth_threshold=0)
    assert not any(level.any() for level in discontinuities(buffer, every.subsplats.criteria, TOP))


def test_a_mip_of_a_single_level_is_the_picture():
    buffer = scattered((3, 4))
    (level,) = depth_ranges(buffer.depth, buffer.covered, 0).low
    np.testing.assert_array_equal(level, buffer.depth)
    (need,) = discontinuities(buffer, MultiresSettings().subsplats.criteria, 0)
    assert need.shape == (3, 4)
    assert not need.any()


def test_mips_are_the_same_for_any_number_of_threads():
    buffer = scattered((37, 53), np.float32)

    def all_of_them():
        one, two = buffer.depth, buffer.normal
        mips = (depth_ranges(one, buffer.covered, TOP, 1), normal_ranges(two, buffer.covered, TOP),
                depth_slopes(one, buffer.covered, TOP),
                curvatures(two, buffer.position, buffer.covered, TOP, rate=True))
        return [level.tobytes() for mip in mips for level in (*mip.low, *mip.high)]

    with threads(1):
        alone = all_of_them()
    assert all_of_them() == alone


@pytest.mark.feature("AMS-03", "AMS-05")
@pytest.mark.parametrize("shape", SIZES)
def test_slopes_and_curvatures_are_the_largest_of_their_pixels(shape):
    buffer = scattered(shape)
    pairs = [(depth_slopes(buffer.depth, buffer.covered, TOP), literal.slopes(buffer.depth, ids(buffer), TOP, True))]
    pairs += [(curvatures(buffer.normal, buffer.position, buffer.covered, TOP, rate),
               literal.curvatures(buffer.normal, buffer.position, ids(buffer), TOP, rate)) for rate in (False, True)]
    for mip, levels in pairs:
        assert mip.high[0].shape == shape
        for found, expected in zip(mip.high[1:], levels, strict=True):
            np.testing.assert_allclose(found, expected, rtol=ROUNDING)


def found_by(buffer, top, finest=0, **settings):
    return discontinuities(buffer, of(MultiresSettings, **settings).subsplats.criteria, top, finest)


def plane(size=128, lean=50.0, vertical_fov=60.0):
    """Depth of a plane that leans back by some degrees, 4 m away in the picture's centre."""
    half = math.tan(math.radians(vertical_fov / 2))
    y = -(np.arange(size) + 0.5 - size / 2) / (size / 2) * half
    depth = 4 / (1 - y * math.tan(math.radians(lean)))
    return np.repeat(depth[:, None], size, axis=1)


@pytest.mark.feature("AMS-03")
def test_a_plane_seen_at_a_slant_is_split_by_the_range_alone(evidence):
    depth = plane()
    buffer = FakeBuffer(depth, facing(depth.shape), np.ones(depth.shape, bool), facing(depth.shape))
    top = top_level(*depth.shape, 16)
    split = {name: np.count_nonzero(found_by(buffer, top, **only(name))[top])
             for name in ("depth", "derivative")}
    assert split["derivative"] == 0
    assert split["depth"] > 0
    evidence(f"plane leaning 50 deg, 16 x 16 cells of 8 x 8 pixels: {split['depth']} split by the range, "
             "0 by the derivative")


@pytest.mark.feature("AMS-03")
def test_the_derivative_misses_gentle_ramps(evidence):
    settings = of(MultiresSettings, **only("derivative")).subsplats.criteria
    x = np.arange(64)
    missed, found = [], []
    for width in (1, 2, 4, 8, 10, 16, 32):
        depth = np.broadcast_to(1 + 0.5 * np.clip((x - 15.5 + width / 2) / width, 0, 1), (8, 64))
        buffer = FakeBuffer(depth, facing((8, 64)), np.ones((8, 64), bool), facing((8, 64)))
        range_too = any(level.any() for level in found_by(buffer, 5, **only("depth")))
        assert range_too
        (found if any(level.any() for level in discontinuities(buffer, settings, 5)) else missed).append(width)
    # a ramp of 0.5 m over `width` pixels from 1 m rises by 0.5 / width of the depth a pixel at its foot
    assert found == [width for width in (1, 2, 4, 8, 10, 16, 32) if 0.5 / width > settings.derivative.threshold]
    evidence(f"1 m to 1.5 m at a threshold of 0.05 a pixel: found over {found} pixels, missed over {missed}; "
             "the range finds all")


def crease(one, other, size=8):
    """A picture whose left half has one normal and whose right half another."""
    normal = np.empty((3, size, size))
    normal[..., : size // 2 - 1], normal[..., size // 2 - 1 :] = one[:, None, None], other[:, None, None]
    flat = np.ones((size, size))
    return FakeBuffer(flat, normal, flat.astype(bool), facing((size, size)))


def is_found(buffer, **settings):
    return bool(found_by(buffer, 3, **settings)[3].any())


@pytest.mark.feature("AMS-04")
def test_the_threshold_of_normals_is_an_angle_between_two_bounds(evidence):
    rng = np.random.default_rng(4)
    lines = []
    for threshold in THRESHOLDS:
        surely = 2 * math.asin(min(1, threshold * math.sqrt(3) / 2))
        never = 2 * math.asin(threshold / 2)
        for angle in (0.99 * never, 0.5 * (surely + never), min(1.01 * surely, math.pi)):
            one = random_directions(rng, 1)[:, 0]
            across = unit(np.cross(one, rng.normal(size=3)))
            other = math.cos(angle) * one + math.sin(angle) * across
            found = is_found(crease(one, other), **only("normal"), normal_threshold=threshold)
            assert found == (np.abs(one - other).max() > threshold)
            assert found or angle <= surely or threshold > 2 / math.sqrt(3)
            assert not found or angle >= never
        both = "never surely" if threshold > 2 / math.sqrt(3) else f"surely from {math.degrees(surely):.1f} deg"
        lines.append(f"{threshold}: none below {math.degrees(never):.1f} deg, {both}")
    # opposite normals along the diagonal of the axes: the range of each component is 2 / sqrt(3) = 1.155
    fold = np.full(3, 1 / math.sqrt(3))
    assert not is_found(crease(fold, -fold), **only("normal"), normal_threshold=1.4)
    evidence("; ".join(lines) + "; above 1.155 even a fold of 180 deg can be missed")


@pytest.mark.feature("AMS-04")
def test_two_components_do_not_see_a_fold_about_the_third():
    one, other = unit(np.array([0.6, 0.0, 0.8])), unit(np.array([0.6, 0.0, -0.8]))
    buffer = crease(one, other)
    assert is_found(buffer, **only("normal"), normal_components="xyz")
    assert not is_found(buffer, **only("normal"), normal_components="xy")
    turned = crease(one, unit(np.array([0.0, 0.6, 0.8])))
    assert is_found(turned, **only("normal"), normal_components="xy")


@pytest.mark.feature("AMS-04")
@given(st.integers(0, 2**32 - 1), st.floats(1e-3, math.pi))
def test_the_largest_range_of_a_component_is_near_the_chord(seed, angle):
    rng = np.random.default_rng(seed)
    one, helper = random_directions(rng, 2).T
    other = math.cos(angle) * one + math.sin(angle) * unit(np.cross(one, helper))
    mip = normal_ranges(crease(one, other).normal, np.ones((8, 8), bool), 3)
    value, chord = (mip.high[3] - mip.low[3]).max(), 2 * math.sin(angle / 2)
    assert chord / math.sqrt(3) <= value * (1 + ROUNDING) + ROUNDING
    assert value <= chord * (1 + ROUNDING) + ROUNDING


@pytest.mark.feature("AMS-05")
def test_curvature_misses_a_sphere_and_finds_a_crease(evidence):
    buffer, top = sphere(256), 4
    inner = slice(5, 11)  # of 16 x 16 cells: those well within the disc
    lines = []
    for threshold in (0.1, 0.3):  # Fig. 12
        settings = of(MultiresSettings, **only("curvature"), curvature_threshold=threshold)
        bends = discontinuities(buffer, settings.subsplats.criteria, top)[top]
        assert not bends[inner, inner].any()
        lines.append(f"{threshold}: {np.count_nonzero(bends)} cells of the limb")
        # a crease whose chord is 1.1 times the threshold
        half = math.asin(1.1 * threshold / 2)
        fold = crease(np.array([math.sin(half), 0, math.cos(half)]), np.array([-math.sin(half), 0, math.cos(half)]))
        assert is_found(fold, **only("curvature"), curvature_threshold=threshold)
    spreads = found_by(buffer, top, **only("normal"), normal_threshold=0.1)[top]
    assert spreads[inner, inner].all()
    evidence(f"sphere, 0 of its 36 inner cells at {', '.join(lines)}; all 36 by the normals' range of 0.1; "
             "creases 10 % above found")


@pytest.mark.feature("AMS-05")
@pytest.mark.parametrize("radius", [0.01, 2.0, 300.0])
def test_the_rate_of_a_sphere_is_the_inverse_of_its_radius(evidence, radius):
    buffer = sphere(48, radius)
    rates = curvatures(buffer.normal, buffer.position, buffer.covered, 2, rate=True).high[0][buffer.covered]
    np.testing.assert_allclose(rates, 1 / radius, rtol=ROUNDING)
    evidence(f"R = {radius:g} m: 1/R to {np.abs(rates * radius - 1).max():.0e}")


@pytest.mark.feature("AMS-06")
def test_criteria_add_up_and_the_finest_level_is_never_refined():
    buffer = scattered((37, 53), np.float32, 0.95)
    together = found_by(buffer, TOP, 1, **only("depth", "normal"))
    alone = [found_by(buffer, TOP, 1, **only(name))
             for name in ("depth", "normal")]
    for level in range(TOP + 1):
        np.testing.assert_array_equal(together[level], alone[0][level] | alone[1][level])
        assert together[level].any() == (level > 1)


@pytest.mark.feature("AMS-02", "AMS-04")
@pytest.mark.parametrize("rim", [0, 1])
def test_needs_are_those_of_the_printed_tests(rim):
    buffer = scattered((19, 23), np.float32, 0.6)
    buffer.depth[:, 12:] = np.where(buffer.covered[:, 12:], 2, np.inf)  # flat, each elsewhere: some cells need nothing
    buffer.normal[:, 10:] = facing((9, 23)) * buffer.covered[10:]
    settings = of(MultiresSettings, rim=rim, normal_threshold=0.7, depth_threshold=0.4)

    least, largest = ranges_of(literal.depth_ranges(buffer.depth, ids(buffer), 4, rim))
    lows, highs = ranges_of(literal.normal_ranges(buffer.normal, ids(buffer), 4, rim, 3))
    expected = literal.discontinuities(
        4, 0, least, largest, None, lows, highs, depth_threshold=np.float32(0.4), depth_measure="relative",
        normal_threshold=np.float32(0.7))
    found = discontinuities(buffer, settings.subsplats.criteria, 4)
    assert not found[0].any()
    for one, other in zip(found[1:], expected, strict=True):
        np.testing.assert_array_equal(one, other)


def ranges_of(levels):
    """Return least and largest, apart."""
    return levels[: len(levels) // 2], levels[len(levels) // 2 :]

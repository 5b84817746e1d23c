"""Indirect light at half resolution: what is exact, what bleeds, what it costs and how far it is off."""

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.jit import threads
from refgi.literal.upsampling import joint_bilateral
from refgi.scene import load_scene
from refgi.settings import of, replaced
from refgi.splat import Receivers, SiiSettings, sii
from refgi.splat.sii.options import _block_pixels, half_resolution

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # that is told: tests/pairs/test_loss

QUARTER = 0.26  # of the pixels: blocks on the edge of the picture and of surfaces are not whole
ROUNDING = 1e-12  # of the brightest pixel
# RMSE over the mean at 96 x 80: light that bends within a block, in corners and on columns that are a few pixels wide
LIMITS = {"cornell_box": 0.08, "stage": 0.13, "atrium:faces=20000": 0.3}


def wall(height, width, real=np.float64):
    """Receivers on a plane, a pixel a metre apart."""
    y, x = np.mgrid[0:height, 0:width].astype(real)
    position = np.stack([x, y, np.zeros_like(x)])
    return Receivers(position, np.stack([np.zeros_like(x), np.zeros_like(x), np.ones_like(x)]), np.ones_like(x, bool))


def of_positions(function):
    """Light that is a function of position, on all channels, and the shapes it was asked for."""
    asked = []

    def evaluate(receivers):
        asked.append(int(np.count_nonzero(receivers.covered)))
        return np.stack([function(*receivers.position)] * 3) * receivers.covered

    return evaluate, asked


def rough(rng, height, width):
    """Receivers on bumpy steps with holes."""
    position, _, _ = wall(height, width)
    position[2] = rng.normal(size=(height, width)) * 0.2 + 3.0 * (position[0] > width / 2)
    normal = rng.normal(size=(3, height, width)) * 0.4 + np.array([0, 0, 1.0])[:, None, None]
    return Receivers(position, normal / np.linalg.norm(normal, axis=0), rng.random((height, width)) < 0.8)


@pytest.mark.parametrize("size", [(1, 1), (1, 6), (7, 1), (8, 6), (9, 13)])
@pytest.mark.feature("SII-22")
def test_it_is_the_filter_of_the_formula(size, evidence):
    """Oracle: on random surfaces with holes, whole and odd sizes, against the literal twin."""
    receivers = rough(np.random.default_rng(3), *size)
    evaluate, _ = of_positions(lambda x, y, z: 1 + x + 2 * y * y - z)
    light = evaluate(receivers)
    got = half_resolution(receivers, evaluate)
    error = np.abs(got - joint_bilateral(*receivers[:3], light)).max()
    assert error < 1e-12 * max(1.0, np.abs(light).max())
    assert not got[:, ~receivers.covered].any()
    evidence(f"{size}: {error:.0e} off the literal filter")


@pytest.mark.parametrize("joint", [True, False])
@pytest.mark.parametrize("real", [np.float32, np.float64])
@pytest.mark.feature("SII-22")
def test_constants_are_exact_and_a_plane_keeps_its_ramp(joint, real, evidence):
    rng = np.random.default_rng(5)
    receivers = rough(rng, 31, 18)
    receivers = Receivers(receivers.position.astype(real), receivers.normal.astype(real), receivers.covered)
    third = np.array([1 / 3, 0.1, 7.7], real)[:, None, None]
    got = half_resolution(receivers, lambda some: third * some.covered, joint=joint)
    assert got.dtype == real
    np.testing.assert_array_equal(got, third * receivers.covered)
    evaluate, asked = of_positions(lambda x, y, _: 3 * x - y)
    ramp = half_resolution(wall(12, 16, real), evaluate, joint=joint)[0]
    np.testing.assert_allclose(ramp[:11, :15], evaluate(wall(12, 16, real))[0][:11, :15], atol=1e-5)
    assert asked[0] == 12 * 16 / 4
    assert len(asked) == 2  # the other is of this test
    evidence(f"{np.dtype(real).name}, joint={joint}: constants to the bit, a ramp to 1e-5, at 1/4 of the pixels")


@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_a_bright_block_that_disagrees_costs_its_neighbours_no_digits(real):
    """Analytic: stripes of bumpy wall that face away from each other, in the same blocks, one of them bright."""
    receivers = rough(np.random.default_rng(8), 40, 45)
    behind = receivers.position[0] % 6 > 2.5
    receivers.normal[2] = np.where(behind, -3, 3)
    receivers.normal[:] /= np.linalg.norm(receivers.normal, axis=0)
    receivers = Receivers(receivers.position.astype(real), receivers.normal.astype(real), receivers.covered)
    for dark in (0.0, 0.3):
        light = half_resolution(
            receivers, lambda some, dark=dark: np.stack([np.where(some.normal[2] < 0, dark, 1e9).astype(real)] * 3))
        np.testing.assert_array_equal(light[:, behind & receivers.covered], real(dark))


@pytest.mark.feature("SII-22")
def test_nothing_bleeds_over_edges_or_from_the_background(evidence):
    """Analytic: two walls of constant light, apart in depth or turned; with the joint filter none tints the other."""
    spread = {}
    for what in ("depth", "edge"):
        receivers = wall(16, 15)
        behind = receivers.position[0] > 6.5  # within a block
        if what == "depth":
            receivers.position[2, behind] = -40.0
        else:
            receivers.normal[:, behind] = np.array([1.0, 0, 0])[:, None]
        receivers.covered[:5] = False
        light = np.where(behind, 5.0, 1.0) * receivers.covered

        def evaluate(some, what=what):
            far = some.position[2] < -1 if what == "depth" else some.normal[0] > 0.5
            return np.stack([np.where(far, 5.0, 1.0) * some.covered] * 3)

        joint, plain = (half_resolution(receivers, evaluate, joint=how)[0] for how in (True, False))
        spread[what] = float(np.abs(joint - light).max()), float(np.abs(plain - light).max())
        assert spread[what][0] < 0.02  # (1 - sine)^2 of a step of 40 m over 2 m is 2e-6; the cosine is 0
        assert spread[what][1] > 1
    evidence("largest error of two walls of light 1 and 5: " + "; ".join(
        f"{what} {a:.1e} joint, {b:.1f} plain" for what, (a, b) in spread.items()))


@pytest.fixture(scope="module", params=LIMITS, ids=lambda name: name.partition(":")[0])
def scene(request):
    """A scene's name, the picture at full and at half resolution and what both are seen on, in float64."""
    frame = Frame(load_scene(request.param), width=96, height=80, rsm_resolution=96, dtype=np.float64)
    settings = of(SiiSettings, pattern="all", clamp="disc")
    full, half = (sii(frame, replaced(settings, {"half_resolution": how})) for how in (False, True))
    return request.param, full, half, Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))


@pytest.mark.feature("SII-22")
def test_the_method_at_half_resolution_is_the_filtered_picture(scene, evidence):
    """Oracle: the literal filter over the pixels of the picture at full resolution."""
    name, full, half, receivers = scene
    off = np.abs(half - joint_bilateral(*receivers[:3], full)).max() / full.max()
    assert off < ROUNDING
    evidence(f"{name}: sii(half_resolution=True) is {off:.0e} of the maximum off the literal filter of sii")


@pytest.mark.feature("SII-22")
def test_the_error_on_scenes_is_less_than_that_of_any_wrong_filter(scene, evidence):
    """Picture: below a limit that no interpolation, a filter over edges and one that is a pixel astray all exceed."""
    name, full, half, receivers = scene

    def error(picture):
        return float(np.sqrt(((picture - full) ** 2).mean()) / full.mean())

    flat = full.reshape(3, -1)
    blocks = flat[:, _block_pixels(receivers.covered)].repeat(2, axis=1).repeat(2, axis=2)
    wrong = {"none": blocks * receivers.covered,
             "plain": joint_bilateral(*wall(*receivers.covered.shape)[:2], receivers.covered, full),
             "a pixel right": np.roll(half, 1, axis=2) * receivers.covered,
             "a pixel down": np.roll(half, 1, axis=1) * receivers.covered}
    off = error(half)
    errors = {what: error(picture) for what, picture in wrong.items()}
    evidence(f"{name}: RMSE / mean {off:.4f}, limit {LIMITS[name]}; wrong filters: "
             + ", ".join(f"{what} {value:.3f}" for what, value in errors.items()))
    assert off < LIMITS[name]
    assert min(errors.values()) > 1.2 * LIMITS[name]


@pytest.mark.feature("SII-22")
@pytest.mark.parametrize("name", LIMITS)
def test_a_quarter_of_the_pixels_is_evaluated(name, evidence):
    frame = Frame(load_scene(name), width=192, height=160)
    receivers = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))
    evaluate, asked = of_positions(lambda x, y, z: x + y + z)
    half_resolution(receivers, evaluate)
    share = sum(asked) / receivers.covered.sum()
    assert 0.25 <= share < QUARTER + 0.03  # pixels that no block agrees with are lit as well
    evidence(f"{name}: {share:.1%} of the pixels")


@pytest.mark.feature("SII-22")
def test_thin_surfaces_are_lit_by_themselves():
    """A bright pole one pixel wide between the pixels that stand for blocks keeps its own light."""
    receivers = wall(10, 10)
    receivers.position[2, :, 5] = 50.0
    evaluate, asked = of_positions(lambda _x, _y, z: 1 + z)
    got = half_resolution(receivers, evaluate)
    np.testing.assert_array_equal(got[0, :, 5], 51.0)
    assert asked == [25, 10]


def test_same_bits_for_any_number_of_threads():
    receivers = rough(np.random.default_rng(8), 40, 33)
    evaluate, _ = of_positions(lambda x, y, z: x * y + z)
    whole = half_resolution(receivers, evaluate)
    with threads(1):
        np.testing.assert_array_equal(half_resolution(receivers, evaluate), whole)


def test_a_view_of_nothing_stays_dark():
    receivers = wall(5, 4)
    receivers.covered[:] = False
    assert not half_resolution(receivers, of_positions(lambda x, *_: x)[0]).any()

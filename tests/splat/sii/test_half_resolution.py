"""Indirect light at half resolution: what is exact, what bleeds, what it costs and how far it is off."""

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.jit import threads
from refgi.lights.selection import choose_lights, footprints
from refgi.pairs.irradiance import irradiance
from refgi.scene import load_scene
from refgi.settings import of
from refgi.splat import Receivers, SiiSettings
from refgi.splat.sii.half_resolution import half_resolution
from tests.naive.joint_bilateral import joint_bilateral

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # that is told: tests/pairs/test_loss

QUARTER = 0.26  # of the pixels: blocks on the edge of the picture and of surfaces are not whole


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
    error = np.abs(got - joint_bilateral(receivers, light)).max()
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


@pytest.mark.feature("SII-22")
def test_error_and_cost_on_scenes(evidence):
    """Picture: a quarter of the pairs; nearer to the full picture with the joint filter than with the plain one."""
    found = []
    for name in ("cornell_box", "stage", "atrium:faces=20000"):
        frame = Frame(load_scene(name), width=192, height=160, rsm_resolution=96)
        settings = of(SiiSettings, lights=96, clamp="disc")
        lights, area = choose_lights(frame, settings.lights), footprints(frame, settings.lights, settings.pairs)
        receivers = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))
        counted = []

        def evaluate(some, lights=lights, settings=settings, area=area, counted=counted):
            counted.append(np.count_nonzero(some.covered))
            return irradiance(some, lights, settings.pairs, area)

        full = evaluate(receivers)
        errors = []
        for joint in (True, False):
            counted.clear()
            got = half_resolution(receivers, evaluate, joint=joint)
            errors.append(float(np.sqrt(((got - full) ** 2).mean()) / full.mean()))
            share = sum(counted) / receivers.covered.sum()
            assert share < QUARTER + 0.03 * joint  # pixels that no block agrees with are lit as well
            if joint:
                cost = share
        assert errors[0] < 0.8 * errors[1]  # the rest is light that changes within a pixel, near lights in corners
        found.append(f"{name.partition(':')[0]} RMSE / mean {errors[0]:.3f} joint, {errors[1]:.3f} plain, "
                     f"{cost:.1%} of the pairs")
    evidence("; ".join(found))


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

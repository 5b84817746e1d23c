"""The paper's storage of lights and receivers (SII Sec. 4, 6): its formats, and what they cost a picture."""

import math

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.frame import Frame
from refgi.lights.selection import choose_lights
from refgi.scene import load_scene
from refgi.settings import of, replaced
from refgi.splat import SiiSettings, sii
from refgi.splat.sii.options import stored_lights, stored_surface
from tests.lamps import corner
from tests.literal.whole.sii import stored
from tests.naive import storage

TILT = math.asin(math.sqrt(3) / 255)  # of a direction with three components off by half a step, 1/255
NEAREST = 0.1  # of r: how much nearer a light may come


@pytest.mark.feature("SII-31")
@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_numbers_are_those_of_the_formats(real, evidence):
    """IEEE half floats and codes of bytes, number by number; each step's half is met and not exceeded."""
    rng = np.random.default_rng(5)
    position = rng.uniform(-1, 1, (3, 40, 50)) * 10.0 ** rng.uniform(-6, 4, (40, 50))
    normal = rng.normal(size=position.shape)
    normal = normal / np.linalg.norm(normal, axis=0)
    normal[:, :3] = 0
    lights = choose_lights(corner(), of(SiiSettings, lights=40).lights)
    frame = corner(width=50, height=40)
    frame.gbuffer = frame.gbuffer.with_channels(
        {**frame.gbuffer.recorded(), "position": position.astype(real), "normal": normal.astype(real)}, real)
    _, kept = stored(frame, lights)
    place, facing = stored_surface(*frame.gbuffer.resolve("position", "normal"))
    np.testing.assert_array_equal(place, storage.halves(position.astype(real)))
    np.testing.assert_allclose(facing, storage.directions(normal.astype(real)), atol=4 * np.finfo(real).eps)
    assert place.dtype == facing.dtype == real
    for name, expected in kept.recorded().items():
        if expected is not None:
            np.testing.assert_allclose(getattr(stored_lights(lights), name), expected, atol=1e-15, err_msg=name)
    step = np.exp2(np.maximum(np.floor(np.log2(np.abs(position))), -14) - 10)
    off = np.abs(place - position.astype(real)) / step
    lit = normal.any(axis=0)
    tilt = np.arccos(np.minimum(1, (facing * normal).sum(axis=0)))[lit]
    assert 0.49 < off.max() <= 0.5
    assert 0.85 * TILT < tilt.max() <= TILT + 1e-3 * (real is np.float32)
    evidence(f"{real.__name__}: positions to {off.max():.3f} of a step, directions to {math.degrees(tilt.max()):.2f} "
             f"degrees, bound {math.degrees(TILT):.2f}")


@pytest.mark.feature("SII-31")
def test_an_axis_leans_as_its_codes_say():
    """0 has no code: 128 is nearest, 1/255, so (0, 1, 0) leans by atan(sqrt(2) / 255)."""
    axis = np.array([0.0, 1.0, 0.0])[:, None, None]
    _, found = stored_surface(axis, axis)
    assert math.degrees(math.acos(found[1, 0, 0])) == pytest.approx(math.degrees(math.atan(math.sqrt(2) / 255)), 1e-6)


@pytest.mark.feature("SII-31")
def test_a_picture_is_off_by_its_steps_at_most(evidence):
    """Phi (n . d) (m . -d) / r^4 between its ends: places off by half a step, normals by TILT, flux by 1/510."""
    frame = Frame(load_scene("cornell_box"), width=48, height=48, rsm_resolution=64)
    plain = of(SiiSettings, lights=64, clamp="none")
    full, few = (sii(frame, replaced(plain, {"quantisation": how})).astype(float) for how in ("none", "published"))
    lights, buffer, bound = choose_lights(frame, plain.lights), frame.gbuffer, np.zeros(full.shape)
    for place, normal, flux in zip(lights.position.T, lights.normal.T, lights.flux.T, strict=True):
        away = buffer.position.astype(float) - place[:, None, None]
        r, shift = np.linalg.norm(away, axis=0), half_step(buffer.position) + half_step(place)
        planes = np.array([np.tensordot(normal, away, 1), -(buffer.normal * away).sum(axis=0)])
        ends = [np.maximum(flux + sign * lights.flux.max() / 510, 0)[:, None, None]
                * np.maximum(planes + sign * (shift + (r + shift) * TILT), 0).prod(axis=0)
                / np.maximum(r - sign * shift, NEAREST * r) ** 4 for sign in (1, -1)]
        bound += (ends[0] - ends[1]) / math.pi
    off = np.abs(few - full)
    share = (off / np.maximum(bound, 1e-9)).max()
    rmse = np.sqrt((off**2).mean()) / full.mean()
    assert 0.1 < share < 1
    assert 0.005 < rmse < 0.02
    evidence(f"cornell_box, 64 lights: RMSE {rmse:.2%} of the mean, {share:.2f} of the bound at most")


def half_step(position):
    """Return the length (...) of the largest error of half floats, m."""
    return np.linalg.norm(np.exp2(np.maximum(np.floor(np.log2(np.maximum(np.abs(position), 1e-9))), -14) - 11), axis=0)


def test_places_beyond_half_floats_are_refused():
    with pytest.raises(InputError, match="65504"):
        stored_surface(np.full((3, 1, 1), 7e4), np.zeros((3, 1, 1)))

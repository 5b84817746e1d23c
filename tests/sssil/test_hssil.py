"""The method as a whole: what it is made of, what each setting does, what it leaves out."""

import numpy as np
import pytest

from refgi.errors import RefgiWarning
from refgi.frame import Frame
from refgi.method import Extent
from refgi.methods import find_method
from refgi.scene import load_scene
from refgi.scene.model import Camera
from refgi.settings import of, replaced
from refgi.sssil.approximations import level_bytes
from refgi.sssil.hssil import hssil
from refgi.sssil.levels import pyramid, sender_pyramid
from refgi.sssil.settings import HssilSettings
from refgi.stages import observe
from tests.sssil.pictures import camera, made, random_picture

SMALL = of(HssilSettings, radius=None, levels=3, samples=24)
SUM = {np.float32: 2e-6, np.float64: 1e-14}  # another order of summation, relative to the brightest pixel


def frame(name="cornell_sphere:faces=400", width=49, height=35, **options):
    return Frame(load_scene(name), width=width, height=height, **{"rsm_resolution": 64} | options)


@pytest.fixture(scope="module")
def ball():
    return frame()


def changed(**changes):
    return replaced(SMALL, changes)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.feature("HSS-12")
def test_levels_shown_one_by_one_add_up_to_the_picture(dtype, evidence):
    """Upsampling is linear in light: its weights come from depth and normals alone."""
    at = frame(dtype=dtype)
    whole = hssil(at, SMALL)
    parts = sum(hssil(at, changed(only_level=level)).astype(np.float64) for level in range(SMALL.sampling.levels))
    off = np.abs(parts - whole).max() / whole.max()
    assert off <= SUM[dtype]
    evidence(f"{np.dtype(dtype).name}: sum of {SMALL.sampling.levels} levels against all at once {off:.1e}")


@pytest.mark.feature("HSS-07")
def test_settings_that_do_not_cover_the_screen_say_so(ball, evidence):
    short = changed(radius=2.0, start="full")
    with pytest.warns(RefgiWarning, match="radius") as caught:
        hssil(ball, short)
    hssil(ball, changed(radius=None, start="full"))
    evidence(str(caught[0].message))


@pytest.mark.feature("HSS-07")
def test_more_levels_than_the_picture_has_are_left_out(ball):
    with observe() as log:
        many = hssil(ball, of(HssilSettings, radius=30.0, levels=16, samples=8))
    assert len([run for run in log.runs if run.name == "sssil.gather"]) < 16
    assert log.status("sssil.level") == ["skipped"]
    assert np.isfinite(many).all()


def test_what_one_camera_does_not_need_is_not_done(ball):
    with observe() as log:
        hssil(ball, changed(start="full"))
    assert log.status("sssil.cameras") == ["skipped"]
    assert not log.status("sssil.rays")
    assert not log.status("sssil.bitmask")


def test_rsm_and_rays_are_needed_for_direct_light_alone(ball):
    """Where direct light is known, a picture of it by what is seen asks for no map and no ray."""
    at = frame()
    at.direct = ball.direct
    hssil(at, SMALL)
    assert "rsms" not in vars(at)
    assert "tracer" not in vars(at)


def test_memory_is_counted():
    method = find_method("hssil")
    plain = method.extra_bytes(SMALL, Extent((1024, 1024)))
    assert method.extra_bytes(changed(start="full"), Extent((1024, 1024))) > 2 * plain
    assert method.extra_bytes(changed(views=(Camera((0, 0, 0), (0, 0, 1)),)), Extent((1024, 1024))) > plain
    assert method.extra_bytes(changed(visibility="rays"), Extent((1024, 1024))) > plain


@pytest.mark.feature("HSS-20")
@pytest.mark.parametrize(("samples", "least"), [
    ({"samples": 20000}, 20000 * 2 * 8),  # int32 offsets of each row's even and odd columns
    ({"samples": 20000, "visibility": "bitmask"}, 20000 * (8 + 8)),  # offsets and weights
], ids=str)
def test_samples_of_rows_are_counted(samples, least):
    count = find_method("hssil").extra_bytes
    few, many = (count(changed(start="full", pattern="row", **how), Extent((1024, 1024))) for how in ({}, samples))
    assert many - few > 1024 * least


@pytest.mark.feature("HSS-20")
def test_rows_of_thin_pictures_are_counted():
    """Senders have darkness around each row: a picture of one column takes far more than its pixels."""
    count = find_method("hssil").extra_bytes
    assert count(SMALL, Extent((1, 65536))) > 65536 // 2 * 9 * 32 * 4


@pytest.mark.feature("HSS-05")
def test_all_texels_of_a_huge_radius_are_those_of_the_picture():
    small = frame(width=12, height=9)
    near, far = (of(HssilSettings, pattern="all", start="full", levels=1, radius=radius) for radius in (10.0, 65536.0))
    np.testing.assert_array_equal(hssil(small, far), hssil(small, near))
    assert find_method("hssil").extra_bytes(far, Extent((12, 9))) < 1 << 20


BUFFER_BYTES = 11 * 4 + 4  # a pixel: position, depth, normal, direct light, area, and which it is


@pytest.mark.feature("HSS-20")
def test_mip_levels_add_a_third(evidence):
    """What arrays hold is what is foretold; all levels of a picture of 2^7 x 2^7 take 4/3 of the first."""
    picture, view, figures = random_picture(128, 128), camera(128, 128), []
    for start, first in (("full", 0), ("half", 1), ("quarter", 2)):
        settings = of(HssilSettings, start=start, levels=5, downsample="closest")
        held = sum(plane.nbytes for level in made(picture, view, first, 5, dtype=np.float32) for plane in level[1:])
        assert held == level_bytes(settings, 128 * 128, 4)
        one, = made(picture, view, first, 1, dtype=np.float32)
        more, less = (find_method("hssil").extra_bytes(replaced(settings, {"levels": levels}), Extent((128, 128)))
                      for levels in (5, 1))
        assert more - less == held - sum(plane.nbytes for plane in one[1:])
        ratio = held / (BUFFER_BYTES * 128 * 128)
        assert ratio == pytest.approx((4 - 4.0**-4) / 3 / 4**first, rel=1e-12)
        figures.append(f"{start} {ratio:.4f}")
    evidence(f"bytes of 5 levels over those of full-resolution buffers: {', '.join(figures)}")


@pytest.mark.feature("HSS-20")
def test_doubles_and_means_of_radiance_take_more():
    pixels = 1280 * 720
    assert level_bytes(of(HssilSettings, start="full", levels=1), pixels, 8) == pixels * 92
    mean = of(HssilSettings, start="full", levels=1, downsample="closest_average")
    assert level_bytes(mean, pixels, 4) == pixels * 52
    assert level_bytes(of(HssilSettings, start="half", levels=1, downsample="closest"), 1, 4) == 48


@pytest.mark.feature("HSS-20")
def test_drawn_senders_are_levels_of_their_own():
    """All but the depth, which is the receivers'; pixels are senders as they are."""
    frame = Frame(load_scene("cornell_box"), width=32, height=32, rsm_resolution=8)
    for start in ("full", "half"):
        settings = of(HssilSettings, start=start, levels=3, radius=2.0)
        receivers = pyramid(frame, settings)
        senders = sender_pyramid(frame, receivers, settings)
        own = [plane for one, other in zip(senders, receivers, strict=True)
               for plane, there in zip(one[1:], other[1:], strict=True) if plane is not there]
        held = sum(plane.nbytes for plane in own) + sum(plane.nbytes for level in receivers for plane in level[1:])
        assert held == level_bytes(settings, 32 * 32, 4)

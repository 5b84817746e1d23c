"""Memory of the levels: counted, and a third more than the first alone."""

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.scene import load_scene
from refgi.settings import of
from refgi.sssil.hssil import level_bytes
from refgi.sssil.levels import pyramid, sender_pyramid
from refgi.sssil.settings import HssilSettings
from tests.sssil.pyramid.pictures import camera, made, random_picture

BUFFER_BYTES = 11 * 4 + 4  # a pixel: position, depth, normal, direct light, area, and which it is


@pytest.mark.feature("HSS-20")
def test_mip_levels_add_a_third(evidence):
    """What arrays hold is what is foretold; all levels of a picture of 2^7 x 2^7 take 4/3 of the first."""
    picture, view, figures = random_picture(128, 128), camera(128, 128), []
    for start, first in (("full", 0), ("half", 1), ("quarter", 2)):
        settings = of(HssilSettings, start=start, levels=5, downsample="closest")
        held = sum(plane.nbytes for level in made(picture, view, first, 5, dtype=np.float32) for plane in level[1:])
        assert held == level_bytes(settings, 128 * 128, 4)
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

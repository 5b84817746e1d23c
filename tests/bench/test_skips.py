"""What is measured of skips: those that fire, their counts and times, wrong ones, and what changes of settings cost."""

import numpy as np
import pytest

from refgi import frame as frames
from refgi import skips
from refgi.bench.skips import TRADES, UNMEASURED, measure_skips
from refgi.diagnostics import diagnosing
from refgi.errors import InputError
from refgi.frame import Frame
from refgi.jit import threads
from refgi.methods import METHODS, render
from refgi.pairs import irradiance as pairs
from refgi.scene import load_scene
from refgi.settings import from_text

pytestmark = pytest.mark.filterwarnings("ignore::refgi.errors.RefgiWarning")

OPTIONS = {"width": 24, "height": 18, "rsm_resolution": 64}
LARGER = {"width": 96, "height": 72, "rsm_resolution": 64}  # tiles of 16 x 16 pixels that hold one surface alone
SPHERE, BOX, WEDGE = "cornell_sphere:faces=320", "cornell_box", "wedge"


def settings_of(method, *changes):
    return from_text(METHODS[method].settings(), changes)


@pytest.fixture(autouse=True)
def _one_thread():
    """Pictures are small: waking other threads costs more than it brings."""
    with threads(1):
        yield


@pytest.fixture(scope="module")
def wedge():
    return load_scene(WEDGE)


@pytest.fixture(scope="module")
def box():
    return load_scene(BOX)


@pytest.fixture
def impatient(monkeypatch):
    """A skip of pixels without surface that leaves out a row of those with one as well."""
    careful = pairs.receiving

    def receiving(covered):
        shown = careful(covered)
        if shown is covered:
            shown = covered.copy()
            shown[len(shown) // 2] = False
        return shown

    monkeypatch.setattr(pairs, "receiving", receiving)


def test_what_fires_is_measured_in_rounds(wedge):
    report = measure_skips(wedge, "sii", settings_of("sii", "lights=16"), rounds=2, **OPTIONS)
    assert (report.scene, report.method, report.width, report.height) == ("wedge", "sii", 24, 18)
    assert [skip.name for skip in report.skips] == [
        "frame.buffers", "frame.lobes", "rsm.channels", "rsm.texels", "lights.refraction", "pairs.pixels",
        "pairs.lobes"]
    assert report.same_bits
    for skip in report.skips:
        assert skip.meaning == skips.SKIPS[skip.name].meaning
        assert len(skip.times) == 2
        assert len(skip.times_without) == 2
        assert min(skip.times + skip.times_without) > 0
    assert {one.reason for one in report.unmeasured} == {one.reason for one in UNMEASURED if "sii" in one.methods}


def test_counts_are_those_of_the_buffers(wedge):
    frame = Frame(wedge, **OPTIONS)
    report = measure_skips(wedge, "sii", settings_of("sii", "lights=16"), rounds=1, **OPTIONS)
    found = {skip.name: (skip.left_out, skip.of) for skip in report.skips}
    assert found["pairs.pixels"] == (int((~frame.gbuffer.covered).sum()), 24 * 18)
    look_ups, rest = divmod(found["rsm.texels"][1], 64**2)
    assert rest == 0
    assert found["rsm.texels"][0] >= look_ups * (64**2 - 16)
    assert found["lights.refraction"][0] % 64**2 == 0
    assert found["frame.buffers"] == (1, 3)  # no rays


def test_rays_left_out_are_those_of_pairs_that_face_away():
    scene, settings = load_scene(BOX), settings_of("vpl", "lights=32")
    with diagnosing(False), skips.count_skips() as counts:
        frame = render(scene, "vpl", settings, **OPTIONS).frame
    from refgi.lights import choose_pixel_lights

    lights = choose_pixel_lights(frame.rsms, count=32, pattern="halton")
    covered = frame.gbuffer.covered
    x, n = (plane[:, covered].astype(np.float64) for plane in (frame.gbuffer.position, frame.gbuffer.normal))
    to = lights.position[:, None].astype(np.float64) - x[:, :, None]
    dark = ((to * n[:, :, None]).sum(axis=0) <= 0) | ((to * lights.normal[:, None]).sum(axis=0) >= 0)
    grazing = 0.02 * dark.size  # walls and lights in one plane: rounding decides
    assert counts["pairs.shadow_rays"].of == dark.size
    assert abs(counts["pairs.shadow_rays"].left_out - dark.sum()) <= grazing


def test_tiles_left_out_have_no_light_of_theirs():
    """No more than the pairs of tile and light of which no receiver has any light."""
    scene, settings = load_scene(SPHERE), settings_of("sii", "lights=100", "pairs.clamp=none")
    with diagnosing(False), skips.count_skips() as counts:
        frame = render(scene, "sii", settings, **LARGER).frame
    from refgi.lights.selection import choose_lights
    from refgi.pairs.tiles import block_by_block

    lights, buffer = choose_lights(frame, settings.lights), frame.gbuffer
    places = block_by_block(buffer.covered)
    x, n = (plane.reshape(3, -1)[:, places].astype(np.float64) for plane in (buffer.position, buffer.normal))
    dark = 0
    for first in range(0, len(places), 256):
        part = slice(first, first + 256)
        to = lights.position[:, None].astype(np.float64) - x[:, part, None]
        facing = np.minimum((to * n[:, part, None]).sum(axis=0), -(to * lights.normal[:, None]).sum(axis=0))
        dark += int((facing.max(axis=0) <= 1e-6).sum())
    assert counts["pairs.tiles"].of == -(-len(places) // 256) * lights.flux.shape[1]
    assert 0 < counts["pairs.tiles"].left_out <= dark


def test_time_saved_is_that_of_what_is_left_out(wedge, monkeypatch):
    """By a clock that goes on while rays are set up alone, 1 s the first time, 2 s the second, and so on."""
    built, now = frames._tracer, [0.0, 0.0]

    def slow(geometry):
        now[:] = now[0] + now[1] + 1.0, now[1] + 1.0
        return built(geometry)

    monkeypatch.setattr(frames, "_tracer", slow)
    report = measure_skips(wedge, "gather", settings_of("gather", "disc.samples=8"), rounds=4, clock=lambda: now[0],
                           **OPTIONS)
    assert set(report.times) == {0.0}
    assert {skip.name: skip.times_without for skip in report.skips if any(skip.times_without)} == {
        "frame.buffers": (2.0, 3.0, 4.0, 5.0)}  # the first was not timed: its bits were compared
    assert [skip.saves for skip in report.skips] == [3.5 * (skip.name == "frame.buffers") for skip in report.skips]


@pytest.mark.usefixtures("impatient")
def test_a_wrong_skip_is_found(wedge):
    report = measure_skips(wedge, "sii", settings_of("sii", "lights=16"), rounds=1, **OPTIONS)
    assert not report.same_bits
    assert [skip.name for skip in report.skips if not skip.same_bits] == ["pairs.pixels"]


def test_trades_are_pictures_of_their_settings(box):
    settings = settings_of("sii", "lights=64")
    report = measure_skips(box, "sii", settings, rounds=2, **OPTIONS)
    assert report.dim_lights.carrying < 64
    assert [trade.changes[0] for trade in report.trades] == [
        f"lights.count={report.dim_lights.count}", "reach.cut=relative", "half_resolution=true"]
    plain = render(box, "sii", settings, **OPTIONS)
    for trade in report.trades:
        changed = render(box, "sii", from_text(settings, trade.changes), **OPTIONS)
        made, right = (one.irradiance[:, plain.frame.gbuffer.covered].astype(float) for one in (changed, plain))
        assert trade.difference == pytest.approx(np.sqrt(((made - right) ** 2).mean()) / right.mean())
        assert len(trade.times_changed) == 2


def test_a_trade_that_is_made_already_is_none(wedge):
    report = measure_skips(wedge, "sii", settings_of("sii", "lights=64", "half_resolution=true"), rounds=1, **OPTIONS)
    assert not any("half_resolution=true" in trade.changes for trade in report.trades)


def test_trades_and_reasons_are_of_methods_and_settings_that_there_are():
    for method, trades in TRADES.items():
        for _, changes in trades:
            assert settings_of(method, *changes) != METHODS[method].settings()
    assert {name for one in UNMEASURED for name in one.methods} <= set(METHODS)


def test_no_rounds_are_refused(wedge):
    with pytest.raises(InputError, match="rounds: expected 1 or more, got 0"):
        measure_skips(wedge, "sii", rounds=0, **OPTIONS)

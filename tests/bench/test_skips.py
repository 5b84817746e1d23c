"""What is measured of skips: those that fire, their counts and times, wrong ones, and what changes of settings cost."""

import itertools

import numpy as np
import pytest

from refgi import frame as frames
from refgi import skips
from refgi.bench.skips import TRADES, UNMEASURED, brightest, dim_lights, measure_skips, parts_of_lights
from refgi.diagnostics import diagnosing
from refgi.errors import InputError
from refgi.frame import Frame
from refgi.jit import threads
from refgi.lights.selection import choose_lights
from refgi.methods import METHODS, render
from refgi.pairs import irradiance as pairs
from refgi.pairs.settings import DiscClamp, PairSettings
from refgi.scene import load_scene
from refgi.settings import from_text
from tests.pairs import sets

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
    assert {one.reason for one in report.unmeasured} == {one.reason for methods, one in UNMEASURED if "sii" in methods}


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
    assert {name for methods, _ in UNMEASURED for name in methods} <= set(METHODS)


def test_no_rounds_are_refused(wedge):
    with pytest.raises(InputError, match="rounds: expected 1 or more, got 0"):
        measure_skips(wedge, "sii", rounds=0, **OPTIONS)


ROUNDING = 1e-6  # of float32, in a sum of few terms
UNLIKE = 1e-4  # roundings of cosines of pairs that nearly lie in one plane


@pytest.mark.parametrize(("share", "kept"), [
    (0.5, [1]), (0.51, [1, 3]), (0.9, [1, 3]), (0.95, [0, 1, 3]), (1.0, [0, 1, 3])])
def test_the_fewest_lights_that_carry_a_share(share, kept):
    parts = np.array([1.0, 5.0, 0.0, 4.0])
    assert brightest(parts, share).tolist() == kept


def test_dark_lights_carry_nothing():
    assert brightest(np.zeros(3), 0.9).tolist() == []
    assert brightest(np.zeros(0), 0.9).tolist() == []


def test_a_light_over_a_point_gives_it_the_inverse_square():
    """Closed form: head on at distance r, E = Phi / (pi r^2); behind the point, nothing."""
    real = np.float32
    up = np.array([[0.0], [1.0], [0.0]])
    heights = np.array([1.0, 2.0, -1.0])
    lights = sets.lights(up * heights, np.repeat(-up, 3, axis=1), np.array([[3.0, 8.0, 1.0]]), real)
    parts = parts_of_lights(sets.receivers(0 * up, up, real), lights, PairSettings(clamp=None))
    np.testing.assert_allclose(parts, np.array([3.0, 2.0, 0.0]) / np.pi, rtol=ROUNDING)


def test_each_light_is_clamped_by_its_own_disc():
    """Closed form: head on at distance r from a disc of area A, E = Phi / (pi r^2 + A)."""
    real, up, area = np.float32, np.array([[0.0], [1.0], [0.0]]), np.array([1.0, 5.0], np.float32)
    lights = sets.lights(np.repeat(up, 2, axis=1), np.repeat(-up, 2, axis=1), np.full((1, 2), 2.0), real)
    parts = parts_of_lights(sets.receivers(0 * up, up, real), lights, PairSettings(clamp=DiscClamp()), area)
    np.testing.assert_allclose(parts, 2.0 / (np.pi + area), rtol=ROUNDING)


def test_error_is_that_of_the_lights_left_out():
    """Independent: light by light in float64, without a clamp; the picture is smaller than a sample of one would be."""
    settings = settings_of("sii", "lights=48", "pairs.clamp=none")
    frame = Frame(load_scene("cornell_box"), **OPTIONS)
    ticks = itertools.count()
    found = dim_lights(frame, settings, 2, share=0.8, clock=lambda: next(ticks) ** 2.0)
    lights, buffer = choose_lights(frame, settings.lights), frame.gbuffer
    x, n = (plane[:, buffer.covered].astype(np.float64) for plane in (buffer.position, buffer.normal))
    to = lights.position[:, None].astype(np.float64) - x[:, :, None]
    square = (to**2).sum(axis=0)
    g = (np.maximum((to * n[:, :, None]).sum(axis=0), 0) * np.maximum(-(to * lights.normal[:, None]).sum(axis=0), 0)
         / np.maximum(square, 1e-30) ** 2)
    light = g * lights.flux[:, None] / np.pi  # (3, pixels, lights)
    parts = light.mean(axis=(0, 1))
    order = np.argsort(-parts)
    carrying = 1 + np.flatnonzero(np.cumsum(parts[order]) >= 0.8 * parts.sum())[0]
    lost = light[:, :, order[carrying:]].sum(axis=2)
    assert (found.lights, found.carrying, found.share) == (len(parts), carrying, 0.8)
    assert 1 < carrying < len(parts) < 48  # some of those drawn have no flux
    assert abs(found.count - 48 * carrying / len(parts)) <= 0.5
    assert found.error == pytest.approx(np.sqrt((lost**2).mean()) / light.sum(axis=2).mean(), rel=UNLIKE)
    assert (found.times, found.times_carrying) == ((1.0, 9.0), (5.0, 13.0))  # in turn: 1 - 0, 9 - 4, 25 - 16, 49 - 36


def test_footprints_go_with_their_lights():
    frame = Frame(load_scene("cornell_box"), **OPTIONS)
    found = dim_lights(frame, settings_of("multires", "lights=100"), 1)
    assert 0 < found.carrying < found.lights <= 100
    assert 0 < found.error < 0.02  # a thousandth of the light, spread unevenly


def test_methods_without_pixel_lights_and_dark_scenes_have_none(monkeypatch):
    frame = Frame(load_scene("cornell_box"), **OPTIONS)
    assert dim_lights(frame, settings_of("gather"), 1) is None
    assert dim_lights(frame, settings_of("vpl"), 1) is None
    monkeypatch.setattr("refgi.bench.skips.MOST", 10)
    assert dim_lights(frame, settings_of("sii", "lights=64"), 1) is None

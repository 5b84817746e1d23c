"""Warnings of lost light: the share they name against full sums at every pixel, and when they are silent."""

import functools
import math
import re
import warnings

import numpy as np
import pytest

from refgi.cluster import ValSettings, val
from refgi.errors import RefgiWarning
from refgi.frame import Frame
from refgi.lights.selection import choose_lights, footprints
from refgi.lights.settings import LightSettings
from refgi.pairs import estimates
from refgi.pairs.estimates import seen_light
from refgi.pairs.irradiance import Receivers, irradiance
from refgi.pairs.sample import sample_pixels
from refgi.pairs.settings import PairSettings
from refgi.scene import Camera, PointLight, load_scene
from refgi.settings import of
from refgi.splat import GatherSettings, MultiresSettings, SiiSettings, gather, multires, sii
from refgi.splat.gather.gather_sum import disc_loss
from refgi.splat.multires import ByError
from refgi.stages import observe

A_QUARTER_OF_LIGHTS = 0.05  # the sampling error of the mean of 750 lights is about 0.02
# points of 100, besides the rounding of the words: without a clamp the sum has a standard deviation of 0.8 to 2.2 of
# its mean at a pixel, which is 2 to 5 points for 2048 pixels; both sums share most of it
NEAR = 3.0
LIGHTS = 256  # 4096 of 9216 pixels are looked at
BOX = load_scene("cornell_box")


@functools.cache
def frame(name):
    return Frame(load_scene(name), width=96, height=96, rsm_resolution=128)


def receivers(at):
    return Receivers(*at.gbuffer.resolve("position", "normal", "covered"))


def plain(**change):
    return of(SiiSettings, **{"lights": LIGHTS, "clamp": "none"} | change)


def full(at, settings, pair=None):
    lights, own = choose_lights(at, settings.lights), settings.effective_pairs
    footprint = footprints(at, settings.lights, own)
    return float(irradiance(receivers(at), lights, pair or own, footprint).sum(dtype=float))


def told(run, *args):
    """Return the picture, and the one warning's share in points of 100, with its words; None without one."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", RefgiWarning)
        light = run(*args)
    texts = [str(each.message) for each in caught]
    assert all(re.fullmatch(r".* takes \d+ % of the indirect light", text) for text in texts), texts
    return light, [(float(re.search(r"takes (\d+) %", text)[1]), text) for text in texts]


@pytest.mark.parametrize("name", ["cornell_box", "atrium:faces=20000"])
@pytest.mark.parametrize("clamp", [{"clamp": "disc"}, {"clamp": "sphere"}, {"clamp": "distance", "clamp_value": 0.3},
                                   {"clamp": "geometry", "clamp_value": 8.0}])
def test_what_a_clamp_takes_is_told(name, clamp):
    at, settings = frame(name), of(SiiSettings, lights=LIGHTS, **clamp)
    share = 100 * (1 - full(at, settings) / full(at, settings, PairSettings()))
    _, said = told(sii, at, settings)
    if share > 2 + NEAR:
        assert len(said) == 1
        assert said[0][0] == pytest.approx(share, abs=NEAR)
        assert said[0][1].startswith(f"sii: clamp {clamp['clamp']!r}" + (
            f" of {clamp['clamp_value']:g} takes" if "clamp_value" in clamp else " takes"))
    elif said:
        assert said[0][0] == pytest.approx(share, abs=NEAR)


def test_each_method_tells_of_its_clamp():
    at = frame("cornell_box")
    for method, settings, name in ((multires, of(MultiresSettings, lights=LIGHTS), "multires"),
                                   (multires, of(MultiresSettings, lights=LIGHTS, supersampled=True), "multires"),
                                   (multires, of(MultiresSettings, lights=LIGHTS, subsplats="irradiance"), "multires"),
                                   (multires, of(MultiresSettings, lights=LIGHTS, subsplats=ByError(0.3)), "multires"),
                                   (val, of(ValSettings, lights=LIGHTS, clamp="disc", maps_resolution=16), "val")):
        share = 100 * (1 - full(at, settings) / full(at, settings, PairSettings()))
        _, said = told(method, at, settings)
        assert said[0][0] == pytest.approx(share, abs=NEAR)
        assert said[0][1].startswith(f"{name}: clamp 'disc' takes")
        assert len(said) == 1


@pytest.mark.parametrize("cut", [
    {"cut_share": 0.05, "reference_length": 0.2}, {"cut_irradiance": 0.2}, {"cut_share": 0.2},
    {"cut_share": 0.3, "bound": "quad"}, {"cut_share": 0.2, "half_resolution": True},
    {"cut_share": 0.05, "reference_length": 0.1, "as_published": {"per_light_ilow"}},
    {"cut_irradiance": 0.5, "bound": "mesh", "bound_faces": 8, "bound_inflate": False}])
def test_what_the_threshold_takes_is_told(cut):
    at, settings = frame("cornell_box"), plain(**cut)
    light, said = told(sii, at, settings)
    share = 100 * (1 - light.sum(dtype=float) / full(at, settings))
    assert share > 2 + NEAR
    assert len(said) == 1
    assert said[0][0] == pytest.approx(share, abs=NEAR)
    absolute = f"sii: reach.cut.irradiance {cut['cut_irradiance']:g} W/m^2 takes" if "cut_irradiance" in cut else ""
    assert said[0][1].startswith(absolute or f"sii: reach.cut.share {cut['cut_share']:g} with reference_length")


def test_clamp_and_threshold_are_told_apart():
    at, settings = frame("cornell_box"), of(SiiSettings, clamp="distance", clamp_value=0.2, cut_irradiance=0.1)
    light, said = told(sii, at, settings)
    clamped = full(at, settings)
    shares = 100 * (1 - clamped / full(at, settings, PairSettings())), 100 * (1 - light.sum(dtype=float) / clamped)
    assert [share for share, _ in said] == [pytest.approx(share, abs=NEAR) for share in shares]


@pytest.mark.parametrize("settings", [
    plain(), plain(clamp="distance", clamp_value=1e-4), plain(cut_irradiance=1e-6),
    plain(cut_irradiance=0.5, stochastic=True), plain(stochastic=True, bound="quad")])
def test_settings_that_take_little_or_nothing_in_the_mean_are_passed_over(settings):
    _, said = told(sii, frame("cornell_box"), settings)
    assert said == []


def test_nothing_is_summed_where_nothing_is_limited():
    with observe() as log:
        sii(frame("cornell_box"), plain(lights=16))
        multires(frame("cornell_box"), of(MultiresSettings, lights=16, clamp="none"))
    assert not [run.name for run in log.runs if run.name.endswith(("_loss", "reference_length"))]


def test_a_black_or_empty_picture_has_nothing_to_lose():
    dark = BOX.with_lights(PointLight((0.3, 0.4, 0.3), (0.0, 0.0, 1e-30)))
    away = BOX.with_camera(eye=(0.0, 50.0, 0.0), target=(0.0, 60.0, 0.1))
    for scene in (dark, away):
        at = Frame(scene, width=16, height=16, rsm_resolution=16)
        for method, settings in ((sii, of(SiiSettings, cut_share=0.05, clamp="disc")), (multires, MultiresSettings()),
                                 (gather, GatherSettings())):
            light, said = told(method, at, settings)
            assert np.isfinite(light).all()
            assert said == [] or scene is dark


def test_scaled_fluxes_are_told():
    at, settings = frame("cornell_box"), plain(openness_flux="scale")
    _, said = told(sii, at, settings)
    kept, _ = told(choose_lights, at, settings.lights)
    whole = choose_lights(at, LightSettings(LIGHTS)).flux.sum(dtype=float)
    share = 100 * (1 - kept.flux.sum(dtype=float) / whole)
    assert said == [(pytest.approx(share, abs=0.5), said[0][1])]
    assert said[0][1].startswith("openness_flux 'scale' takes")
    assert told(sii, at, plain(openness_flux="roulette"))[1] == []


def outside_share(at, radius):
    """Return the share of the light of all texels outside each pixel's disc: pair by pair, over every pixel."""
    rsm, to = at.rsms[0], receivers(at)
    x, n = (plane[:, to.covered].T.astype(float) for plane in (to.position, to.normal))
    rows, columns = rsm.projection.height, rsm.projection.width
    place = np.indices(rsm.projection.shape).reshape(2, -1).T + 0.5
    y, m = (plane.reshape(3, -1).T.astype(float) for plane in (rsm.position, rsm.normal))
    flux = rsm.flux.sum(axis=0, dtype=float).ravel()
    centre = np.stack(rsm.project(np.ascontiguousarray(x.T))[:2]).T
    inside = whole = 0.0
    for point, normal, where in zip(x, n, centre, strict=True):
        d = y - point
        square = np.maximum((d * d).sum(axis=1), 1e-30)
        terms = flux * np.maximum((d * -m).sum(axis=1), 0) * np.maximum(d @ normal, 0) / square**2
        near = np.hypot(*((place - where) / (radius * rows, radius * columns)).T) <= 1
        inside, whole = inside + terms[near].sum(), whole + terms.sum()
    return 100 * (1 - inside / whole)


@pytest.mark.parametrize("radius", [0.15, 0.3, 0.6])
def test_what_lies_outside_the_discs_of_gathering_is_told(radius):
    """Oracle: under a point light every pixel has a place on the map."""
    scene = BOX.with_lights(PointLight((0.3, 0.3, 0.2), (1.0, 1.0, 1.0)))
    at = Frame(scene, width=24, height=24, rsm_resolution=24)
    _, said = told(gather, at, of(GatherSettings, radius=radius))
    assert said[0][0] == pytest.approx(outside_share(at, radius), abs=NEAR)
    assert said[0][1].startswith(f"gather: disc.radius {radius:g} of a map's width takes")


def test_a_disc_over_the_whole_map_loses_nothing():
    at = frame("cornell_box")
    assert disc_loss(receivers(at), at.rsms, math.sqrt(2)) == 0
    assert told(gather, at, of(GatherSettings, radius=1.5, samples=16))[1] == []
    assert 0 < disc_loss(receivers(at), at.rsms, 1.0) < disc_loss(receivers(at), at.rsms, 0.5)


@pytest.mark.parametrize("covered", [np.ones((40, 50), bool), np.eye(64, dtype=bool), np.zeros((8, 8), bool)])
def test_sampled_pixels_are_covered_differ_and_spread(covered):
    rng = np.random.default_rng(3)
    position, normal = rng.random((2, 3, *covered.shape)).astype(np.float32)
    to = Receivers(position, normal, covered)
    sample = sample_pixels(to, 300)
    assert len(sample.place) == min(300, covered.sum()) == len(set(sample.place.tolist()))
    assert covered.reshape(-1)[sample.place].all()
    np.testing.assert_array_equal(sample.position, position.reshape(3, -1)[:, sample.place])
    np.testing.assert_array_equal(sample.normal, normal.reshape(3, -1)[:, sample.place])
    np.testing.assert_array_equal(sample.place, sample_pixels(to, 300).place)
    if covered.all():  # 300 of 2000: each quarter of the picture has its share, within a few pixels
        rows, columns = np.divmod(sample.place, covered.shape[1])
        quarters = np.histogram2d(rows, columns, bins=[[0, 20, 40], [0, 25, 50]])[0]
        assert np.abs(quarters - 75).max() < 12


def test_one_of_every_few_lights_stands_for_many(monkeypatch):
    frame = Frame(load_scene("cornell_box"), width=32, height=32)
    receivers = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))
    lights = choose_lights(frame, LightSettings(count=3000))
    whole = seen_light(frame.scene.camera, frame.sent_albedo, frame.direct, receivers, lights)
    monkeypatch.setattr(estimates, "MANY", 700)
    some = seen_light(frame.scene.camera, frame.sent_albedo, frame.direct, receivers, lights)
    assert some != whole
    assert some == pytest.approx(whole, rel=A_QUARTER_OF_LIGHTS)


def test_a_pixel_shows_its_solid_angle_over_the_cosine_and_nothing_in_the_plane_of_the_eye():
    """A surface through the eye is seen edge-on: its depth is 0, and 0 over 0 is no area."""
    camera = Camera((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), vfov=np.pi / 2)
    position = np.array([[0.0, 0.0, -2.0], [3.0, 0.0, -2.0], [0.0, 0.0, -2.0], [1.0, 0.0, 0.0]], np.float32).T
    normal = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], np.float32).T
    sample = sample_pixels(Receivers(position[:, None], normal[:, None], np.ones((1, 4), bool)), 4)
    areas = estimates._areas(camera, 10, sample)
    np.testing.assert_allclose(areas, [0.16, 0.16, 0.16 / estimates.GRAZING, 0.0], rtol=1e-6)

"""Every method at its defaults: on every number and kind of lights, and where direct light's shadows come from."""

import functools
import warnings

import numpy as np
import pytest

from refgi.cluster import ValSettings
from refgi.errors import RefgiWarning
from refgi.frame import Frame
from refgi.methods import METHODS, find_method, render, usual_shadows
from refgi.pairs.settings import DiscClamp, SphereClamp
from refgi.scene import DirectionalLight, PointLight, load_scene
from refgi.settings import of, replaced
from refgi.splat import GatherSettings, MultiresSettings, SiiSettings
from refgi.sssil import HssilSettings
from refgi.truth import TruthSettings, VplSettings

BOX = load_scene("cornell_box")
KINDS = (BOX.lights[0], PointLight((0.3, 0.4, 0.3), (0.1, 0.1, 0.1)),
         DirectionalLight((0.3, -0.2, 0.9), (1.0, 1.0, 1.0)))
TINY = {"width": 16, "height": 14, "rsm_resolution": 16}
FEW = {"truth": TruthSettings(samples=16), "val": of(ValSettings, maps_resolution=16)}  # else at its defaults


def mixed(count):
    return BOX.with_lights(*(KINDS[index % len(KINDS)] for index in range(count)))


@functools.cache
def mean_light(method, count):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RefgiWarning)  # what the defaults of a method lose is tested elsewhere
        picture = render(mixed(count), method, FEW.get(method), **TINY)
    assert np.isfinite(picture.radiance).all()
    return float(picture.irradiance[:, picture.frame.gbuffer.covered].mean())


@pytest.mark.parametrize("count", [1, 2, 3, 8])
@pytest.mark.parametrize("method", list(METHODS))
def test_every_method_runs_on_one_to_eight_lights_of_all_kinds(method, count):
    """Property: and with more than one lamp there is more light."""
    assert mean_light(method, count) > (0 if count == 1 else 1.2 * mean_light(method, 1))


RAYS = [
    (TruthSettings(), True), (TruthSettings(visibility=False), True), (VplSettings(), True),
    (VplSettings(visibility=False), True), (SiiSettings(), False), (of(SiiSettings, source="walk"), True),
    (of(SiiSettings, openness_flux="scale"), True), (of(SiiSettings, warp="A", importance="openness"), True),
    (of(SiiSettings, warp="A"), False), (GatherSettings(), False), (MultiresSettings(), False),
    (of(MultiresSettings, visibility="rays"), True), (of(MultiresSettings, source="walk"), True),
    (ValSettings(), False), (of(ValSettings, renderer="rays"), True), (of(ValSettings, behind="raytrace"), True),
    (of(ValSettings, visibility="rays_rectangle"), True), (of(ValSettings, visibility="rays_vpls"), True),
    (of(ValSettings, source="walk"), True), (of(ValSettings, visibility="back_projection"), False),
    (HssilSettings(), False),
    (of(HssilSettings, visibility="rays"), True), (of(HssilSettings, visibility="bitmask"), False), (object(), False)]


@pytest.mark.parametrize(("settings", "rays"), RAYS)
def test_shadows_are_exact_where_the_method_traces_rays_anyway(settings, rays):
    assert usual_shadows(settings) == ("exact" if rays else "map")


@pytest.mark.filterwarnings("ignore:.* of the indirect light")
@pytest.mark.parametrize("method", ["truth", "vpl", "sii"])
def test_a_picture_has_the_shadows_of_its_method(method):
    settings = FEW[method] if method in FEW else of(find_method(method).settings, lights=16)
    frames = {shadows: Frame(BOX, shadows=shadows, **TINY) for shadows in ("map", "exact")}
    assert (frames["map"].direct != frames["exact"].direct).any()
    usual = "map" if method == "sii" else "exact"
    for asked, used in ((None, usual), ("map", "map"), ("exact", "exact")):
        picture = render(BOX, method, settings, shadows=asked, **TINY)
        assert picture.frame.shadows == used
        np.testing.assert_array_equal(picture.frame.direct, frames[used].direct)
    assert render(BOX, method, settings, **TINY).frame.shadows == usual


def test_a_frame_alone_takes_the_map():
    assert Frame(BOX, **TINY).shadows == Frame(BOX, shadows=None, **TINY).shadows == "map"


@pytest.mark.parametrize("kind", [SiiSettings, MultiresSettings, ValSettings])
def test_pixel_lights_are_clamped_alike(kind):
    """Property: a disc where lights have footprints, so that settings change one by one with no clamp in the way."""
    for change in ({"source": "walk"}, {"openness_flux": "roulette"}):
        assert of(kind, **change).effective_pairs.clamp is None
    for change in ({}, {"openness_flux": "scale"}):
        settings = of(kind, **change)
        assert settings.effective_pairs.clamp == DiscClamp()
        assert replaced(settings, {"clamp": "none"}).effective_pairs.clamp is None
        assert replaced(settings, {"clamp": "sphere"}).effective_pairs.clamp == SphereClamp()


def test_subsplats_are_clamped_without_shadow_rays():
    assert of(MultiresSettings, visibility="rays").effective_pairs.clamp is None
    for change in ({"visibility": "val"}, {"subsplats": "error"}, {"subsplats": "irradiance"}):
        assert of(MultiresSettings, **change).effective_pairs.clamp == DiscClamp()

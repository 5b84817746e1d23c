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
from refgi.settings import flat, of, replaced
from refgi.splat import GatherSettings, MultiresSettings, SiiSettings
from refgi.sssil import HssilSettings
from refgi.truth import TruthSettings, VplSettings

BOX = load_scene("cornell_box")
KINDS = (BOX.lights[0], PointLight((0.3, 0.4, 0.3), (0.1, 0.1, 0.1)),
         DirectionalLight((0.3, -0.2, 0.9), (1.0, 1.0, 1.0)))
TINY = {"width": 16, "height": 14, "rsm_resolution": 16}
FEW = {"truth": TruthSettings(samples=16), "val": of(ValSettings, maps_resolution=16)}  # else at its defaults


# features, method, settings, key and value: what the papers print, and what is done where they are silent (docs/errata)
PRINTED = [
    ("SII-26", "sii", "paper", "lights.count", 768),  # Fig. 8 and 12
    ("SII-03", "sii", "paper", "lights.source.filtered", True),  # Sec. 4
    ("SII-21", "sii", "paper", "reach.cut.share", 0.05),  # Fig. 8 and 12
    ("SII-18 SII-19", "sii", "paper", "reach.bound", "ellipsoid"),  # Sec. 3.4 and appendix
    ("SII-09", "sii", "default", "lights.source.refraction", "back_face"),  # Fig. 4
    ("SII-10 SII-28", "sii", "default", "lights.source.pattern", "halton"),  # Sec. 3.1: fixed, quasi-random
    ("SII-28", "sii", "default", "lights.seed", 0),
    ("SII-05 SII-06", "sii", "default", "pairs.lobe.norm", "clamped"),  # E-SII-03
    ("SII-07", "sii", "default", "pairs.lobe.widening", 0.0),
    ("SII-27", "sii", "default", "pairs.offset", 0.0),
    ("SII-14", "sii", "default", "lights.openness.floor", 0.05),  # E-SII-09
    ("SII-16", "sii", "default", "lights.openness.flux", "none"),  # E-SII-10
    ("SII-15 SII-32", "sii", "default", "lights.openness.radius", 0.0),
    ("SII-21", "sii", "default", "reach.cut", None),  # E-SII-15
    ("REF-12", "sii", "default", "reach.stochastic", False),
    ("SII-22", "sii", "default", "half_resolution", False),
    ("SII-31", "sii", "default", "quantisation", "none"),
    ("SII-32", "sii", "default", "ambient_occlusion", None),
    ("REF-11", "sii", "default", "compensation", "none"),
    ("REF-08", "sii", "default", "pairs.clamp", "auto"),
    ("SII-11 SII-12", "sii", {"warp": "A"}, "lights.source.warp.levels", 3),  # Sec. 5: the caustic's
    ("SII-13", "sii", {"warp": "A"}, "lights.source.warp.renormalise_weights", False),  # E-SII-06
    ("SII-14", "sii", {"warp": "A"}, "lights.source.warp.importance", "flux"),
    ("SII-20", "sii", {"cut": "relative", "bound": "mesh"}, "reach.bound.inflate", True),  # E-SII-14
    ("REF-09", "sii", {"clamp": "sphere"}, "pairs.clamp.value", 1.0),
    ("SII-25", "gather", "default", "disc.samples", 308),  # SII Fig. 12
    ("SII-25", "gather", "default", "interpolation.grid", 64),  # SII Fig. 12
    ("AMS-01", "multires", "default", "lights.count", 256),  # Sec. 5: 16 x 16
    ("AMS-01", "multires", "default", "lights.source.pattern", "grid"),
    ("AMS-02 AMS-21", "multires", "default", "subsplats.criteria.depth.threshold", 0.1),  # docs/methods/multires
    ("AMS-04 AMS-21", "multires", "default", "subsplats.criteria.normal.threshold", 0.25),  # Fig. 11 a
    ("AMS-04", "multires", "default", "subsplats.criteria.normal.components", "xyz"),
    ("AMS-05", "multires", {"curvature": "chord"}, "subsplats.criteria.curvature.threshold", 0.1),  # Fig. 12
    ("AMS-06 AMS-07", "multires", "default", "subsplats.coarsest", 16),  # Sec. 3.3
    ("AMS-06 AMS-10", "multires", "default", "subsplats.finest", 0),
    ("AMS-09", "multires", "paper", "subsplats.criteria.traversal", "list"),  # Sec. 3.3
    ("AMS-11", "multires", "default", "subsplats.upsampling", "tent"),
    ("AMS-12", "multires", "paper", "subsplats.criteria.diagonal", "literal"),  # Sec. 5.2
    ("AMS-14", "multires", "default", "detail", 0.0),
    ("AMS-15", "multires", "paper", "supersampled", True),  # Sec. 4
    ("REF-03", "truth", "default", "bounces", 1),
    ("REF-03", "truth", "default", "visibility", True),
    ("REF-03", "truth", "default", "emitters", "all"),
    ("REF-02", "vpl", "default", "visibility", True),
]


@pytest.mark.parametrize(("method", "chosen", "key", "value"), [
    pytest.param(*row, marks=pytest.mark.feature(*features.split())) for features, *row in PRINTED])
def test_values_of_the_papers(method, chosen, key, value):
    """`chosen`: a preset, or what is set over the defaults for the key to be there."""
    kind = METHODS[method]
    assert flat(of(kind.settings, **chosen) if isinstance(chosen, dict) else kind.preset(chosen))[key] == value


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

"""The method as a whole: its limits, odd pictures and scenes, sameness, bad settings."""

import dataclasses
import sys

import numpy as np
import pytest

from refgi.cluster import PRESETS, ValSettings, extra_bytes, val
from refgi.cluster.settings import GeometryBlur
from refgi.cluster.val import cluster_lights, sum_at_pixels
from refgi.cluster.visibility import shadow as shadows
from refgi.errors import InputError
from refgi.frame import Frame
from refgi.jit import threads
from refgi.lights.selection import choose_lights, footprints
from refgi.lights.settings import with_clamp
from refgi.method import Extent
from refgi.methods import find_method
from refgi.scene import load_scene
from refgi.settings import of, replaced
from refgi.stages import observe, standing_for

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # that is told: tests/pairs/test_loss

SMALL = {"lights": 64, "maps_resolution": 32}
SUM = {np.float32: 2e-6, np.float64: 1e-12}  # another order of summation, relative to the brightest pixel
# a moved or scaled scene: lights beside a texel's border may take its neighbour's depth; away from those it is rounding
SCALED = 1e-5


def small(how):
    """Few lights, few area lights and small maps."""
    return of(ValSettings, **SMALL | {"clusters_count": 6} | how)


def frame(name="cornell_sphere:faces=400", width=33, height=27, **options):
    return Frame(load_scene(name), width=width, height=height, **{"rsm_resolution": 64} | options)


@pytest.fixture(scope="module")
def ball():
    return frame()


@pytest.mark.parametrize("how", [
    {}, {"visibility": "pcss"}, {"visibility": "hard"}, {"visibility": "rays_vpls"}, {"visibility": "rays_rectangle"},
    {"visibility": "back_projection"}, {"visibility": "pcf"}, {"prefilter": "brute"}, {"interleaving": 4},
    {"quantisation": "published"}, {"behind": "dual_paraboloid"}, {"behind": "raytrace"}, {"clamp": "disc"},
    {"near_geometry": "keep"}, {"near_geometry": "ball"}, {"renderer": "rays"},
    {"distance": "raw"}, {"distance": "squared"}, {"axes": "pca"}, {"axes": "min_area"},
    {"as_published": ("val_alpha", "val_search_solid_angle")}, {"as_published": ("val_alpha_over_pi",)},
], ids=str)
def test_every_setting_gives_a_picture_between_darkness_and_the_unshadowed(ball, how):
    settings = small(how)
    light = val(ball, settings)
    most = val(ball, replaced(settings, {"visibility": "none", "behind": "visible"}))
    covered = ball.gbuffer.covered
    assert light.shape == (3, 27, 33)
    assert light.dtype == np.float32
    assert np.isfinite(light).all()
    assert (light >= 0).all()
    assert not light[:, ~covered].any()
    assert light[:, covered].mean() <= most[:, covered].mean() * (1 + SUM[np.float32])
    assert light[:, covered].mean() > 0.3 * most[:, covered].mean()


@pytest.mark.feature("REF-19")
def test_threads_change_no_bit(evidence):
    settings = small({"interleaving": 4})
    pictures = []
    for count in (1, 2):
        with threads(count):
            pictures.append(val(frame(), settings))
    np.testing.assert_array_equal(*pictures)
    evidence("val, one thread and two: the same bits")


@pytest.mark.parametrize("size", [(1, 1), (1, 7), (5, 1), (17, 9)])
def test_pictures_of_any_size(size):
    light = val(frame(width=size[0], height=size[1]), small({"interleaving": 8}))
    assert light.shape == (3, size[1], size[0])
    assert np.isfinite(light).all()


@pytest.mark.parametrize("scale", [2.0**-20, 2.0**20])
def test_the_unit_of_length_does_not_matter(ball, scale):
    """Law: E of a scene twice as large under the same light is a quarter; powers of two move no rounding."""
    scene = ball.scene
    shape = dataclasses.replace(scene.geometry, vertices=scene.geometry.vertices * scale)
    camera = dataclasses.replace(scene.camera, eye=tuple(scale * np.array(scene.camera.eye)),
                                 target=tuple(scale * np.array(scene.camera.target)))
    light = dataclasses.replace(scene.lights[0], position=tuple(scale * np.array(scene.lights[0].position)))
    large = Frame(dataclasses.replace(scene, geometry=shape, camera=camera, lights=(light,)), width=33, height=27,
                  rsm_resolution=64)
    expected = val(ball, small({})).astype(float)
    got = val(large, small({})).astype(float) * scale**2
    off = np.abs(got - expected).max(axis=0)
    assert np.median(off) <= SCALED * expected.max()
    assert (off > SCALED * expected.max()).mean() < 0.01


def test_a_light_that_hits_nothing_gives_darkness(ball):
    light = dataclasses.replace(ball.scene.lights[0], position=(0.0, 1e4, 0.0), direction=(0.0, 1.0, 0.0))
    dark = Frame(ball.scene.with_lights(light), width=9, height=9, rsm_resolution=16)
    for how in ({}, {"interleaving": 8}):
        assert not val(dark, small(how)).any()


@pytest.mark.feature("VAL-04")
def test_more_area_lights_than_lights_are_hard_shadows_of_each(ball):
    each = val(ball, small({"clusters_count": 1000}))
    hard = val(ball, small({"clusters_count": 64, "visibility": "hard"}))
    np.testing.assert_array_equal(each, hard)


@pytest.fixture
def any_size(monkeypatch):
    """Let subsplats light small pictures as well."""
    monkeypatch.setattr(sys.modules["refgi.cluster.val"], "FEW_PIXELS", 0)


EACH_KIND = ({}, {"visibility": "pcss"}, {"visibility": "pcf", "clusters_count": 64}, {"visibility": "none"},
             {"prefilter": "brute"}, {"visibility": "rays_rectangle"}, {"behind": "dual_paraboloid"})


def test_a_small_picture_runs_what_the_one_that_it_stands_for_runs():
    for pixels, ran in ((1 << 16, False), ((1 << 16) + 1, True)):
        with observe() as log, standing_for(pixels):
            val(Frame(load_scene("cornell_box"), width=24, height=18, rsm_resolution=64), of(ValSettings, lights=64))
        assert ("error_target.error_driven" in {run.name for run in log.runs if run.status == "ran"}) is ran


@pytest.mark.feature("REF-32")
@pytest.mark.usefixtures("any_size")
@pytest.mark.parametrize("kept", [True, False])
@pytest.mark.parametrize("how", EACH_KIND, ids=str)
def test_subsplats_without_an_error_are_every_pixel_to_the_bit(how, kept, monkeypatch):
    """Oracle: every light at every pixel of a smooth ball in one pass; lists read kept shadows, or filter maps anew."""
    if not kept:
        monkeypatch.setattr(shadows, "MOST_KEPT", 0)
    box = frame(width=80, height=60)
    with observe() as log:
        light = val(box, small(how | {"subsplats.target": 1e-6}))
    assert log.status("error_target.error_driven") == ["ran"]
    np.testing.assert_array_equal(light, val(box, small(how | {"interleaving": 1})))


def test_a_few_pixels_are_lit_as_in_the_picture(ball):
    """Oracle: the whole picture; these pixels fill no tile."""
    settings = with_clamp(small({}))
    lights, pixel = choose_lights(ball, settings.lights), np.flatnonzero(ball.gbuffer.covered)[::97]
    at = sum_at_pixels(ball, ball.gbuffer, lights, cluster_lights(ball, lights, settings), settings,
                       footprints(ball, settings.lights, settings.pairs))
    np.testing.assert_array_equal(at(pixel), val(ball, settings).reshape(3, -1)[:, pixel])


def test_subsplats_and_blocks_are_switched_off_apart():
    off = {one.name: one.off for one in find_method("val").approximations}
    default, blocks = ValSettings(), of(ValSettings, interleaving=4)
    assert off["subsplats"](default, {}) == off["interleaving"](blocks, {}) == of(
        ValSettings, interleaving=1, blur="none")
    assert off["subsplats"](blocks, {}) == blocks
    assert off["interleaving"](default, {}) == default


@pytest.mark.usefixtures("any_size")
def test_threads_change_no_bit_of_subsplats():
    pictures = []
    for count in (1, 2):
        with threads(count):
            pictures.append(val(frame("cornell_box", 112, 84), small({"subsplats.target": 0.1})))
    np.testing.assert_array_equal(*pictures)


@pytest.mark.parametrize(("width", "how", "status"), [
    (256, {}, ["skipped"]), (257, {}, ["ran"]), (257, {"clamp": "none"}, ["skipped"]),
    (257, {"visibility": "none"}, ["ran"]), (257, {"interleaving": 2}, []), (80, {"visibility": "rays_vpls"}, ["ran"])])
def test_what_is_lit_at_subsplats(width, how, status):
    """Larger pictures with a clamp, and any by rays, unless every pixel or blocks are asked for."""
    with observe() as log:
        val(frame(width=width, height=256 if width > 80 else 60, rsm_resolution=16), small(how | {"lights": 16}))
    assert log.status("error_target.error_driven") == status


def test_what_is_not_needed_does_not_run(ball):
    """Full sums are not blurred, visibility by rays draws no maps, an empty convex room neither."""
    with observe() as log:
        val(ball, small({}))
    assert log.status("cluster.blur") == ["skipped"]
    with observe() as log:
        val(ball, small({"visibility": "none"}))
    assert log.status("cluster.shadow_maps") == ["skipped"]


IN = {"cone": {"visibility": "pcss"}, "texels": {"visibility": "pcf"},
      "constant_bias_value": {"visibility": "pcss", "constant_bias": "constant_bias"}}  # choices that have a setting


@pytest.mark.parametrize(("key", "value"), [
    ("constant_bias_value", 0.3), ("clusters_count", 0), ("clusters_count", 1.5),
    ("terms", 0), ("terms", 65), ("maps_resolution", 0), ("rounds", 0),
    ("distance", "euclid"), ("visibility", "soft"), ("prefilter", "gauss"), ("bias", -0.1), ("bias", float("nan")),
    ("position_weight", -1), ("normal_weight", float("inf")), ("attenuation", -1), ("interleaving_block", 0),
    ("interleaving_block", 65), ("subsplats_target", 0), ("subsplats_coarsest", 0),
    ("blur_extent", -1), ("blur_cosine", 2),
    ("position_weight", "much"), ("bias", "some"), ("cone", None), ("occluders_alone", "no"), ("near_distance", -1),
    ("as_published", {"val_beta"}), ("assignment", "cards"), ("texels", 4), ("texels", 0),
    ("behind", "mirror"), ("near_geometry", "some"),
    ("axes", "x"), ("area_extent", "area"), ("clusters_count", "many"), ("renderer", "gpu")])
def test_a_setting_that_cannot_be_is_named(key, value):
    with pytest.raises(InputError, match=rf"{key.rpartition('_')[2]}: expected"):
        of(ValSettings, **IN.get(key, {}) | {key: value})


@pytest.mark.parametrize(("key", "how"), [
    ("visibility.terms", {"visibility": "pcss", "terms": 4}), ("blur.extent", {"blur": "box", "blur_extent": 0.1})])
def test_settings_that_do_not_go_together_are_refused(key, how):
    with pytest.raises(InputError, match=key):
        of(ValSettings, **how)


@pytest.mark.feature("VAL-22")
def test_what_is_ignored_near_a_cluster_follows_the_kind_of_shadow(ball):
    shares = {"csm": 0.4, "pcss": 0.7, "pcf": 0.6, "hard": 0.6, "back_projection": 0.25, "rays_rectangle": 0.7}
    drawn = {}
    for kind, share in shares.items():
        settings = small({"visibility": kind})
        assert settings.drawn_maps.near_distance == share
        assert replaced(settings, {"near_distance": 0.3}).drawn_maps.near_distance == 0.3
        if kind != "rays_rectangle":
            lights = choose_lights(ball, settings.lights)
            drawn[kind], given = (cluster_lights(ball, lights, some)[1].depth
                                  for some in (settings, replaced(settings, {"near_distance": share})))
            np.testing.assert_array_equal(drawn[kind], given)
    assert not np.array_equal(drawn["csm"], drawn["pcss"])
    assert small({"visibility": "none"}).drawn_maps.near_share == shares["csm"]


def test_memory_of_maps_is_counted():
    """Closed form: depths twice; where they are filtered, basis, basis-z, means and depth of as many as are at once.

    Filters of all are kept for lists of subsplats.
    """
    def counted(**how):
        with threads(1):  # one map is filtered while another one is read from
            return extra_bytes(of(ValSettings, **{"lights": 64, "clusters": 6, "maps": 32, "interleaving": 1} | how),
                               Extent((1, 1)))

    hard = counted(visibility="hard")
    assert hard == pytest.approx(2 * 6 * 32**2 * 4, rel=0.01)
    assert counted(visibility="csm", terms=4, prefilter="brute") - hard == 2 * 32**2 * (4 * 4 + 2) * 4
    assert counted(visibility="csm", terms=4) - hard == 2 * 32**2 * (1 + (2 * 8 + 3) // 3) * 4  # levels above alone
    assert counted(visibility="csm", interleaving=None) - hard == 6 * 32**2 * (1 + (2 * 8 + 3) // 3) * 4
    assert counted(visibility="none") < hard


@pytest.mark.feature("VAL-05", "VAL-17", "VAL-23", "VAL-24")
def test_the_preset_of_the_paper_has_the_printed_values(ball):
    paper = PRESETS["paper"]
    assert (paper.lights.count, paper.clusters.count, paper.visibility.terms) == (1024, 30, 4)
    assert (paper.maps.resolution, paper.interleaving.block, paper.blur) == (256, 8, GeometryBlur(0.1, 0.8, False))
    assert paper.as_published == ValSettings.SWITCHES
    assert np.isfinite(val(ball, replaced(paper, SMALL))).all()

"""Property tests of Frame: nothing is computed before it is asked for, and frames share what did not change."""

import dataclasses
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from refgi import Frame, load_scene
from refgi.errors import InputError, RefgiWarning
from refgi.frame import add_lobes
from refgi.methods import METHODS, find_method, render
from refgi.scene import DirectionalLight, Geometry, PointLight
from refgi.settings import of
from refgi.splat.sii.settings import SiiSettings
from refgi.splat.sii.sii import sii
from refgi.stages import Memory, observe

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # that is told: tests/pairs/test_loss

SIZE = {"width": 48, "height": 32, "rsm_resolution": 64}
SETTINGS = of(SiiSettings, lights=64)


@pytest.fixture(scope="module")
def scene():
    return load_scene("cornell_box")


def ran(log):
    return {run.name for run in log.runs if run.status == "ran"}


def test_what_the_page_on_new_methods_says_a_frame_offers_is_there_in_that_shape():
    frame = Frame(load_scene("ring"), **SIZE)
    map_of_light, = frame.rsms
    sides = {"h": 32, "w": 48, "3": 3, "H": map_of_light.solid_angle.shape[0], "W": map_of_light.solid_angle.shape[1]}
    page = (Path(__file__).parents[1] / "docs/new_method.md").read_text()
    table = page.partition("## What a frame offers")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| (`.+?) \| ?(.*?) ?\| .*\|$", table, re.M)
    assert len(rows) == 15
    for names, shapes in rows:
        of_map = "H" in shapes
        printed = re.findall(r"\((.*?)\)", shapes)
        for number, name in enumerate(re.findall(r"`(?:frame\.)?(\w+)[^`]*`", names)):
            offered = next(one for one in (map_of_light if of_map else frame, frame.gbuffer) if hasattr(one, name))
            if printed:
                shape = printed[min(number, len(printed) - 1)]
                assert getattr(offered, name).shape == tuple(sides[side] for side in shape.split(", ")), name


def test_construction_computes_nothing(scene):
    with observe() as log:
        Frame(scene)
    assert not log.runs


def test_the_light_alone_needs_no_gbuffer(scene):
    with observe() as log:
        _ = Frame(scene, **SIZE).rsms
    assert "rsm.reflective_shadow_map" in ran(log)
    assert "rsm.gbuffer" not in ran(log)


def test_the_view_alone_needs_no_rsm(scene):
    with observe() as log:
        _ = Frame(scene, **SIZE).gbuffer.position
    assert "rsm.gbuffer" in ran(log)
    assert "rsm.reflective_shadow_map" not in ran(log)


def test_radiance_is_albedo_over_pi_of_all_irradiance(scene):
    picture = render(scene, "sii", SETTINGS, dtype=np.float64, **SIZE)
    frame = picture.frame
    expected = frame.gbuffer.albedo / np.pi * (frame.direct + picture.irradiance)
    np.testing.assert_allclose(picture.radiance, expected, rtol=1e-14)


def test_emission_is_seen(scene):
    glowing = tuple(dataclasses.replace(m, emission=(1.0, 2.0, 3.0)) for m in scene.materials)
    plain, lit = (Frame(s, **SIZE) for s in (scene, dataclasses.replace(scene, materials=glowing)))
    difference = lit.radiance() - plain.radiance()
    covered = plain.gbuffer.covered
    for channel, value in enumerate((1.0, 2.0, 3.0)):
        np.testing.assert_allclose(difference[channel][covered], value, rtol=1e-6)
        assert not difference[channel][~covered].any()


@pytest.mark.feature("SII-29")
@pytest.mark.parametrize("moves", [(), ("light",), ("camera",), ("light", "camera")])
def test_frames_of_an_animation_share_what_did_not_change(scene, moves):
    """The four rows of SII Table 1: reuse must not change a bit."""
    moved = scene
    if "light" in moves:
        moved = moved.with_lights(dataclasses.replace(scene.lights[0], position=(0.3, 0.5, 0.25)))
    if "camera" in moves:
        moved = moved.with_camera(eye=(0.3, 0.3, -0.7))
    memory = Memory()
    with observe(memory=memory):
        render(scene, "sii", SETTINGS, **SIZE)
    with observe(memory=memory) as log:
        again = render(moved, "sii", SETTINGS, **SIZE)
    fresh = render(moved, "sii", SETTINGS, **SIZE)
    np.testing.assert_array_equal(again.irradiance, fresh.irradiance)
    np.testing.assert_array_equal(again.radiance, fresh.radiance)
    names, ran = ({run.name for run in log.runs if run.status == status} for status in ("reused", "ran"))
    assert any(name.startswith("lights.") for name in ran) == ("light" in moves)
    assert bool(ran) == bool(moves)
    assert ("rsm.reflective_shadow_map" in names) == ("light" not in moves)
    assert ("rsm.gbuffer" in names) == ("camera" not in moves)
    assert ("pairs.sum" in names) == ("frame.compose" in names) == (not moves)


def test_several_lights_add_up(scene):
    others = (PointLight((0.1, 0.3, 0.1), (0.05, 0.04, 0.03)), DirectionalLight((0.1, -0.2, 1.0), (0.2, 0.2, 0.2)))
    settings = of(SiiSettings, pattern="all")
    options = {"width": 24, "height": 16, "rsm_resolution": 16, "dtype": np.float64}
    lights = (*scene.lights, *others)
    together = sii(Frame(scene.with_lights(*lights), **options), settings)
    apart = sum(sii(Frame(scene.with_lights(light), **options), settings) for light in lights)
    np.testing.assert_allclose(together, apart, rtol=1e-12)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"width": 0}, "width: expected 1 to 65536 pixels, got 0"),
        ({"height": 10**6}, "height"),
        ({"width": 10.5}, "width: expected 1 to 65536 pixels, got 10.5"),
        ({"width": "10"}, "width: expected 1 to 65536 pixels, got '10'"),
        ({"dtype": np.float16}, "dtype: expected float32 or float64, got 'float16'"),
        ({"dtype": "float33"}, "dtype: expected float32 or float64, got 'float33'"),
        ({"rsm_resolution": 16.5}, "rsm_resolution"),
        ({"rsm_resolution": 0}, "rsm_resolution"),
        ({"shadows": "soft"}, "shadows: expected 'map' or 'exact', got 'soft'"),
    ],
)
def test_bad_options_are_named(scene, options, said):
    with pytest.raises(InputError, match=said):
        Frame(scene, **options)


def test_nothing_to_see_or_no_light_is_an_error(scene):
    empty = Geometry(np.zeros((0, 3)), np.zeros((0, 3), np.int32), np.zeros(0, np.int32))
    with pytest.raises(InputError, match="at least one triangle"):
        Frame(dataclasses.replace(scene, geometry=empty))
    with pytest.raises(InputError, match="at least one light"):
        Frame(scene.with_lights())


@pytest.mark.parametrize(("shift", "size", "warned"), [(0.0, 1.0, False), (1e5, 1.0, False), (1e8, 1e-6, True)])
def test_a_scene_too_far_from_the_origin_is_said_aloud(scene, shift, size, warned, recwarn):
    """At 1e8 m float64 numbers are 1.5e-8 m apart, and the box, made small, is 1e-6 m across."""
    vertices = size * scene.geometry.vertices + shift
    frame = Frame(dataclasses.replace(scene, geometry=dataclasses.replace(scene.geometry, vertices=vertices)))
    assert ["so far from the origin" in str(w.message) for w in recwarn] == [True] * warned
    np.testing.assert_array_equal(frame.scene.geometry.vertices + frame.origin, vertices)


def test_a_scene_near_the_origin_is_left_as_it_is(scene):
    assert Frame(scene).scene is scene
    assert Frame(scene).origin == (0, 0, 0)


def test_render_takes_a_path_and_refuses_what_is_no_scene(tmp_path):
    (tmp_path / "one.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.warns(RefgiWarning, match="no camera"):
        picture = render(tmp_path / "one.obj", width=4, height=4, rsm_resolution=8)
    assert picture.frame.scene.name == "one"
    with pytest.raises(InputError, match="scene: expected a Scene, got 'NoneType'"):
        render(None)
    with pytest.raises(InputError, match="method: expected one of"):
        render("cornell_box", [])


def test_methods_are_found_by_name_or_refused():
    for name in METHODS:
        method = find_method(name)
        function, settings = method.function, method.settings
        assert callable(function)
        assert dataclasses.is_dataclass(settings())
    with pytest.raises(InputError, match="method: expected one of sii, "):
        find_method("radiosity")
    with pytest.raises(InputError, match="settings: expected SiiSettings"):
        render("cornell_box", "sii", object())


LAZY = """
import sys, warnings
import refgi
assert "numpy" not in sys.modules
warnings.simplefilter("ignore")
for method in ("sii", "multires", "val", "hssil", "gather"):
    refgi.render("cornell_box", method, width=12, height=12, rsm_resolution=16)
    heavy = ("embreex", "trimesh", "pydantic") if method == "sii" else ("embreex",)
    assert not set(heavy) & {name.partition(".")[0] for name in sys.modules}, method
"""


def test_imports_are_lazy():
    subprocess.run([sys.executable, "-c", LAZY], check=True)


def test_map_and_exact_shadows_agree_off_their_edges(scene):
    """A shadow map decides by texel, rays by point: they may differ only where a shadow's edge passes."""
    frames = [Frame(scene, width=96, height=96, shadows=kind) for kind in ("map", "exact")]
    lit = [frame.direct.sum(axis=0) > 0 for frame in frames]
    assert np.mean(lit[0] != lit[1]) < 0.02  # 2 %: the share of pixels within a texel of an edge in this view


def test_lobes_are_added_to_what_diffuse_receivers_reflect():
    """By hand, in numbers that float32 holds, and without a change of what is given."""
    radiance, direct, indirect = (np.full((3, 2, 2), value, np.float32) for value in (1.0, 2.0, 4.0))
    assert (add_lobes(radiance, direct, indirect) == 7.0).all()
    assert (add_lobes(radiance, direct, None) == 3.0).all()
    assert [plane[0, 0, 0] for plane in (radiance, direct, indirect)] == [1.0, 2.0, 4.0]

"""The scene's extent: what takes part, and that nothing else changes a picture."""

import dataclasses

import numpy as np
import pytest

from refgi import Frame, load_scene, rays
from refgi.methods import find_method, render
from refgi.scene import DirectionalLight, Geometry, SpotLight
from refgi.scene.model import Camera, Scene
from refgi.settings import flat, of, replaced
from refgi.settings.keys import find_key
from refgi.splat.sii.settings import SiiSettings
from refgi.stages import observe

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # that is told: tests/pairs/test_loss

CHANGE = 1e-5  # of the mean: what a plane that nobody sees may change of any pixel
HALVES = (1e1, 1e3, 1e5, 1e8)  # m
SIZE = {"width": 24, "height": 24, "rsm_resolution": 64}
LIGHTS = {"lights": 64}
VAL = {**LIGHTS, "clusters_count": 6, "maps_resolution": 64}
ROUNDING = 1e-6  # float32 at a metre or two

# method, and its defaults and the settings that are shares of the scene's size
CASES = [
    ("sii", LIGHTS), ("multires", LIGHTS), ("val", VAL), ("val", {**VAL, "distance": "squared"}),
    ("val", {**VAL, "depth_scale": "map"}), ("val", {**VAL, "depth_scale": "scene"}),
    ("val", {**VAL, "interleaving": 4, "blur_extent": 0.05}), ("val", {**VAL, "visibility": "pcss"}),
    ("val", {**VAL, "visibility": "pcss", "constant_bias": "constant_bias", "constant_bias_value": 0.05}),
    ("val", {**VAL, "visibility": "hard"}),
    ("val", {**VAL, "occluders_alone": False}), ("val", {**VAL, "behind": "dual_paraboloid"}),
    ("val", {**VAL, "visibility": "back_projection"}), ("hssil", {}),
    ("hssil", {"visibility": "bitmask", "thickness": 0.1}), ("gather", {"samples": 64, "grid": 6, "reach": 0.1})]


def sides(low, high):
    """The six sides of a box, (6, 4, 3)."""
    x, y, z = zip(low, high, strict=True)
    corner = [[(x[a], y[b], z[c]) for c in (0, 1)] for a in (0, 1) for b in (0, 1)]
    (a, b), (c, d), (e, f), (g, h) = corner
    return [(a, e, f, b), (c, g, h, d), (a, c, d, b), (e, g, h, f), (a, e, g, c), (b, f, h, d)]


def room(half=None):
    """A closed room of 2 m with two blocks, all seen and lit from within; a plane of some half side below it."""
    blocks = sides((-0.6, 0, -0.5), (-0.1, 0.7, 0)) + sides((0.2, 0.5, -0.4), (0.6, 0.9, 0.1))
    quads = sides((-1, 0, -1), (1, 2, 1)) + blocks
    of_side = [0, 0, 1, 2, 0, 0] + [0] * 12
    if half is not None:
        quads.append([(-half, -0.1, -half), (half, -0.1, -half), (half, -0.1, half), (-half, -0.1, half)])
        of_side.append(0)
    faces = (4 * np.arange(len(quads))[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    white = load_scene("cornell_box").materials[0]
    colors = (0.7,) * 3, (0.7, 0.1, 0.1), (0.1, 0.6, 0.1)
    materials = tuple(dataclasses.replace(white, diffuse=color) for color in colors)
    geometry = Geometry(np.array(quads, float).reshape(-1, 3), faces.astype(np.int32),
                        np.repeat(of_side, 2).astype(np.int32))
    light = SpotLight((0.5, 1.7, 0.5), (-0.3, -1.0, -0.5), 0.5, 0.8, (3.0, 3.0, 2.5))
    return Scene("room", geometry, materials, Camera((0.3, 1.1, 0.95), (0.0, 0.8, -0.3), vfov=1.2), (light,))


def made_of(scene, **changes):
    """The scene with all its materials changed."""
    return dataclasses.replace(scene, materials=tuple(dataclasses.replace(m, **changes) for m in scene.materials))


def settings_of(method, changes):
    return of(find_method(method).settings, **changes)


@pytest.mark.parametrize(("method", "changes"), CASES, ids=lambda value: str(value))
def test_a_plane_that_nobody_sees_changes_no_pixel(method, changes, evidence):
    settings = settings_of(method, changes)
    plain, off = render(room(), method, settings, **SIZE).irradiance.astype(float), {}
    for half in HALVES:
        with_plane = render(room(half), method, settings, **SIZE).irradiance
        off[half] = float(np.abs(with_plane - plain).max() / plain.mean())
    evidence(f"{method}: largest change of a pixel, of the mean: " + ", ".join(
        f"{change:.0e} at {half:.0e} m" for half, change in off.items()))
    assert plain.mean() > 0
    assert max(off.values()) < CHANGE


@pytest.mark.filterwarnings("ignore:.* of the indirect light")  # of clamps: tests/pairs/test_loss
def test_the_plane_is_not_what_the_settings_refer_to():
    """Each share of the scene's size above is one that matters: a tenth of it gives another picture."""
    for method, changes, key in (("val", {**VAL, "interleaving": 4, "blur_extent": 0.05}, "blur_extent"),
                                 ("hssil", {"visibility": "bitmask", "thickness": 0.1}, "thickness"),
                                 ("gather", {"samples": 64, "grid": 6, "reach": 0.1}, "reach")):
        settings = settings_of(method, changes)
        smaller = replaced(settings, {key: flat(settings)[find_key(settings, key).key] / 10})
        one, other = (render(room(), method, s, **SIZE).irradiance for s in (settings, smaller))
        assert np.abs(one - other).max() > 1e3 * CHANGE * one.mean()


@pytest.mark.parametrize("half", [None, *HALVES])
def test_extents_are_the_boxes_of_what_is_seen_and_lit(half):
    frame = Frame(room(half), **SIZE)
    seen = frame.gbuffer.position[:, frame.gbuffer.covered].astype(float)
    lit = frame.rsms[0].position[:, frame.rsms[0].flux.any(axis=0)].astype(float)
    for extent, places in ((frame.visible_extent, seen), (frame.illuminated_extent, lit),
                           (frame.extent, np.hstack([seen, lit]))):
        np.testing.assert_array_equal(extent.low, places.min(axis=1))
        np.testing.assert_array_equal(extent.high, places.max(axis=1))
        assert extent.diagonal == pytest.approx(np.linalg.norm(np.ptp(places, axis=1)), rel=ROUNDING)
        assert extent.largest == np.abs(places).max()
    assert 2.5 < frame.extent.diagonal <= np.sqrt(12) * (1 + ROUNDING)


def test_a_grid_of_texels_finds_the_box_of_a_fine_map(evidence):
    """What 96 texels a side miss of a map of 512: one in five at either end."""
    coarse, fine = (Frame(room(), **{**SIZE, "rsm_resolution": n}).illuminated_extent for n in (96, 512))
    off = max(np.abs(coarse.low - fine.low).max(), np.abs(coarse.high - fine.high).max()) / fine.diagonal
    assert off < 0.01
    evidence(f"extent of the light by 96 of 512 texels a side: off by {off:.4f} of the diagonal")


def test_a_lobe_alone_is_lit_as_well():
    scene = room()
    shining = Frame(made_of(scene, diffuse=(0.0,) * 3, specular=(0.5,) * 3, exponent=20.0), **SIZE).illuminated_extent
    np.testing.assert_array_equal(shining, Frame(scene, **SIZE).illuminated_extent)


def test_without_light_or_view_the_extent_is_that_of_all_triangles():
    scene = room()
    black = made_of(scene, diffuse=(0.0,) * 3)
    away = scene.with_camera(eye=(0.0, 5.0, 0.0), target=(0.0, 9.0, 1.0))
    for extent in (Frame(black, **SIZE).illuminated_extent, Frame(away, **SIZE).visible_extent):
        np.testing.assert_array_equal(extent, scene.geometry.bounds)


@pytest.mark.parametrize(("which", "not_run"), [("visible_extent", "rsm.reflective_shadow_map"),
                                                ("illuminated_extent", "rsm.gbuffer")])
def test_an_extent_asks_for_no_buffer_that_it_does_not_need(which, not_run):
    with observe() as log:
        getattr(Frame(room(), **SIZE), which)
    assert not_run not in {run.name for run in log.runs}
    assert f"frame.{which}" in {run.name for run in log.runs}


def test_screen_space_visibility_needs_no_rsm():
    frame = Frame(room(), **SIZE, shadows="exact")
    method = find_method("hssil")
    run, kind = method.function, method.settings
    with observe() as log:
        run(frame, of(kind, visibility="bitmask"))
    assert "rsm.reflective_shadow_map" not in {run.name for run in log.runs}


@pytest.mark.feature("SII-15")
def test_rays_of_openness_are_a_tenth_of_what_lights_reach(monkeypatch):
    asked, openness, scene = [], rays.openness, room(1e3)

    def noted(*args, radius, **rest):
        asked.append(radius)
        return openness(*args, radius=radius, **rest)

    monkeypatch.setattr(rays, "openness", noted)
    render(scene, "sii", of(SiiSettings, lights=16, openness_flux="scale"), **SIZE)
    assert asked == [pytest.approx(Frame(scene, **SIZE).illuminated_extent.diagonal / 10)]


def test_directional_light_reaches_the_plane():
    """A plane below a room is not hidden from a light from below: it takes part."""
    scene = room(1e3).with_lights(DirectionalLight((0.0, 1.0, 0.1), (1.0, 1.0, 1.0)))
    assert Frame(scene, **SIZE).illuminated_extent.diagonal > 1e3

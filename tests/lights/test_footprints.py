"""The area behind each texel against the formula, texel by texel, and lights that carry it."""

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.lights.footprints import texel_areas
from refgi.lights.selection import choose_lights, footprints
from refgi.lights.settings import LightSettings
from refgi.scene import DirectionalLight, PointLight, load_scene
from refgi.settings import of
from refgi.splat import SiiSettings
from tests.naive.shares import nearest_grid, shares_of

ROUNDING = 3e-7  # float32: solid angle, position and normal are rounded once each
BOX = load_scene("cornell_box")
LAMPS = {"spot": BOX.lights[0], "cube": PointLight((0.3, 0.3, 0.2), (1.0, 2.0, 0.0)),
         "directional": DirectionalLight((0.1, -0.9, 0.3), (1.0, 1.0, 1.0))}


def by_hand(rsm, light):
    """Return O d^2 / cos of every texel that reflects, 0 elsewhere."""
    lobe = 0 if rsm.lobe_flux is None else rsm.lobe_flux
    areas = np.zeros(rsm.solid_angle.shape)
    for i, j in zip(*np.nonzero((rsm.flux + lobe).any(axis=0)), strict=True):
        if isinstance(light, DirectionalLight):
            towards, square = -np.asarray(light.direction, float), 1.0
        else:
            towards = np.asarray(light.position, float) - rsm.position[:, i, j]
            square = towards @ towards
        cosine = abs(towards @ rsm.normal[:, i, j]) / np.linalg.norm(towards)
        areas[i, j] = rsm.solid_angle[i, j] * square / max(cosine, 1e-3)
    return areas


def whole(rsm):
    """Return the areas of all texels, (H, W)."""
    return texel_areas(rsm, np.arange(rsm.texels)).reshape(rsm.projection.shape)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("kind", [*LAMPS, "glossy"])
def test_areas_are_those_of_the_formula(kind, dtype):
    scene = load_scene("ring") if kind == "glossy" else BOX.with_lights(LAMPS[kind])
    rsm = Frame(scene, rsm_resolution=40, dtype=dtype).rsms[0]
    areas, expected = whole(rsm), by_hand(rsm, scene.lights[0])
    assert areas.dtype == dtype
    assert expected.any()
    np.testing.assert_allclose(areas, expected, rtol=ROUNDING, atol=0)


def test_lobes_alone_have_an_area():
    rsm = Frame(load_scene("ring"), rsm_resolution=40).rsms[0]
    assert rsm.lobe_flux is not None
    mirror = rsm._replace(flux=np.zeros_like(rsm.flux))
    np.testing.assert_array_equal(whole(mirror) > 0, rsm.lobe_flux.any(axis=0))


@pytest.mark.parametrize("pattern", ["grid", "halton"])
def test_each_light_has_its_texels_area_times_the_texels_it_stands_for(pattern):
    """By hand, on a spot's and a point light's map of other flux."""
    frame = Frame(BOX.with_lights(LAMPS["spot"], LAMPS["cube"]), rsm_resolution=40)
    settings = of(SiiSettings, lights=256, pattern=pattern, clamp="disc")
    lights, area = choose_lights(frame, settings.lights), footprints(frame, settings.lights, settings.pairs)
    shares = shares_of(256, [float(rsm.flux.sum()) for rsm in frame.rsms])
    cells = shares if pattern == "halton" else map(nearest_grid, shares, (1, 6))
    for index, (rsm, drawn) in enumerate(zip(frame.rsms, cells, strict=True)):
        here = lights.map_index == index
        expected = by_hand(rsm, frame.scene.lights[index]).ravel()[lights.texel[here]] * rsm.texels / drawn
        np.testing.assert_allclose(area[here], expected, rtol=ROUNDING)


def test_lights_without_their_weight_have_their_texels_flux_under_a_rounded_grid():
    frame = Frame(BOX.with_lights(LAMPS["spot"], LAMPS["cube"]), rsm_resolution=40)
    lights = choose_lights(frame, of(LightSettings, count=256, pattern="grid", as_published={"sii_no_tn"}))
    for index, rsm in enumerate(frame.rsms):
        here = lights.map_index == index
        np.testing.assert_allclose(lights.flux[:, here], rsm.flux.reshape(3, -1)[:, lights.texel[here]], rtol=ROUNDING)

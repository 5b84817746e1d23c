"""The cut of `sii`: none by default; the paper's, at the length that leaves the paper's share of pairs."""

import dataclasses
import functools
import math
import warnings

import numpy as np
import pytest

from refgi.errors import InputError, RefgiWarning
from refgi.frame import Frame
from refgi.lights.selection import choose_lights
from refgi.pairs.settings import PairSettings
from refgi.radiometry import lobe_fraction
from refgi.scene import load_scene
from refgi.settings import of, replaced
from refgi.splat import Receivers, SiiSettings, cut_irradiance, irradiance, sii, splat
from refgi.splat.sii.approximations import sii_ledger
from refgi.splat.sii.fragments import fragments
from refgi.splat.sii.threshold import low_irradiance, reference_length, with_reference_length
from refgi.stages import observe

PAPER = of(SiiSettings, cut_share=0.05)  # 768 lights
SHARE = 125 / 768
SAMPLING = 0.05  # of the share: about 1400 of 4096 pixels, whose overdraw spreads by as much as its mean
SAME = 2e-4  # relative, of float32 pictures in other units: pairs at the edge of the cut fall on either side


@functools.cache
def frame(name="cornell_box", size=64):
    return Frame(load_scene(name), width=size, height=size, rsm_resolution=64)


def receivers(at):
    return Receivers(*at.gbuffer.resolve("position", "normal", "covered"))


def quietly(run, *args):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RefgiWarning)  # how much the cut takes is another test's
        return run(*args)


def counted(at, lights, low):
    """Return the pairs with B >= I_low, one by one, over every pixel; diffuse parts and lobes count apart."""
    x = receivers(at).position[:, at.gbuffer.covered].T.astype(float)
    total = 0
    for k in range(lights.flux.shape[1]):
        d = x - lights.position[:, k].astype(float)
        r = np.linalg.norm(d, axis=1)
        above = d @ lights.normal[:, k].astype(float)
        total += (lights.flux[:, k].max() / math.pi * np.maximum(above / r, 0) >= low * r * r).sum()
        if lights.lobe_flux is not None and lights.lobe_flux[:, k].any():
            exponent, axis = float(lights.lobe_exponent[k]), lights.lobe_axis[:, k].astype(float)
            norm = (exponent + 1) / (2 * math.pi * lobe_fraction(float(axis @ lights.normal[:, k]), exponent))
            along = np.where(above > 0, np.maximum(d @ axis / r, 0), 0)
            total += (lights.lobe_flux[:, k].max() * norm * along**exponent >= low * r * r).sum()
    return total


@pytest.mark.feature("SII-21")
@pytest.mark.parametrize("name", ["cornell_box", "stage", "glass_ball", "atrium:faces=20000"])
def test_the_papers_cut_leaves_the_papers_share_of_pairs(name):
    """Oracle: a count over all pixels, pair by pair, at the length found from some."""
    at = frame(name)
    lights = choose_lights(at, PAPER.lights)
    length = reference_length(receivers(at), lights, PAPER.pairs)
    low = low_irradiance(lights, replaced(PAPER, {"reference_length": length}))
    share = counted(at, lights, low) / lights.drawn / at.gbuffer.covered.sum()
    assert share == pytest.approx(SHARE, rel=SAMPLING)


@pytest.mark.parametrize("change", [
    {}, {"cut_share": 0.02}, {"stochastic": True}, {"bound": "quad"}, {"bound": "mesh", "bound_faces": 20},
    {"as_published": {"per_light_ilow"}}, {"half_resolution": True}])
def test_a_picture_is_that_of_its_length_given_by_hand(change):
    at, settings = frame(), of(SiiSettings, **{"cut_share": 0.05, "lights": 96} | change)
    lights = choose_lights(at, settings.lights)
    by_hand = replaced(settings, {"reference_length": reference_length(receivers(at), lights, settings.pairs)})
    with observe() as log:
        light = quietly(sii, at, settings)
    np.testing.assert_array_equal(light, quietly(sii, at, by_hand))
    assert log.status("sii.picture_length") == ["ran"]
    longer = replaced(by_hand, {"reference_length": 1.02 * by_hand.reach.cut.reference_length})
    assert (light != quietly(sii, at, longer)).any()


def test_stages_without_a_length_choose_the_methods():
    at, lights = frame(), choose_lights(frame(), PAPER.lights)
    to, view = receivers(at), at.gbuffer.projection
    by_hand = with_reference_length(to, lights, PAPER)
    assert by_hand.reach.cut.reference_length == reference_length(to, lights, PAPER.pairs)
    for stage in (splat, cut_irradiance):
        np.testing.assert_array_equal(stage(to, lights, PAPER), stage(to, lights, by_hand))
    counts = [fragments(to, lights, settings, None, view) for settings in (PAPER, by_hand)]
    np.testing.assert_array_equal(counts[0].overdraw, counts[1].overdraw)
    with pytest.raises(InputError, match="reference_length"):
        low_irradiance(lights, PAPER)


def test_a_length_is_chosen_only_where_it_counts():
    at, lights = frame(), choose_lights(frame(), PAPER.lights)
    for settings in (SiiSettings(), of(SiiSettings, cut_irradiance=0.1),
                     of(SiiSettings, cut_share=0.05, reference_length=0.3)):
        assert with_reference_length(receivers(at), lights, settings) is settings
    assert low_irradiance(lights, SiiSettings()) == 0


def scaled(scene, unit):
    """Return a scene with lengths in another unit and the lamps' figures as they are."""
    def place(point):
        return tuple(unit * x for x in point)

    camera = dataclasses.replace(scene.camera, eye=place(scene.camera.eye), target=place(scene.camera.target))
    lights = tuple(dataclasses.replace(light, position=place(light.position)) for light in scene.lights)
    geometry = dataclasses.replace(scene.geometry, vertices=unit * scene.geometry.vertices)
    return dataclasses.replace(scene, geometry=geometry, camera=camera, lights=lights)


@pytest.mark.parametrize("unit", [1e3, 1e-3, 4.0 / 0.55 * 1e3])
@pytest.mark.parametrize("settings", [of(SiiSettings, lights=96), of(SiiSettings, lights=96, cut_share=0.05)])
def test_a_scene_in_mm_m_or_km_gives_the_same_picture(settings, unit):
    """Property: E goes as the inverse square of lengths, and the last unit makes the box 4 m wide and read in mm."""
    scene, size = load_scene("cornell_box"), {"width": 40, "height": 40, "rsm_resolution": 64}
    here, there = (quietly(sii, Frame(one, **size), settings).astype(float) for one in (scene, scaled(scene, unit)))
    apart = np.abs(there * unit**2 - here) / np.maximum(here, here.mean() / 100)
    assert here.mean() > 0
    assert np.quantile(apart, 0.98) < SAME


@pytest.mark.parametrize("factor", [2.0, 0.25, 1024.0])
def test_lengths_scale_with_powers_of_two_to_the_bit(factor):
    at, lights = frame(), choose_lights(frame(), PAPER.lights)
    to = receivers(at)
    longer = lights._replace(position=lights.position * np.float32(factor), flux=lights.flux * np.float32(4))
    far = to._replace(position=to.position * np.float32(factor))
    assert reference_length(far, longer, PAPER.pairs) == factor * reference_length(to, lights, PAPER.pairs)


def test_many_lights_have_the_length_of_few():
    """Property: of 25,600 lights every second is looked at, and the length is a scene's, not a number of lights'."""
    at = Frame(load_scene("cornell_box"), width=64, height=64, rsm_resolution=160)
    every, few = of(SiiSettings, pattern="all", cut_share=0.05), of(SiiSettings, cut_share=0.05)
    lengths = [reference_length(receivers(at), choose_lights(at, settings.lights), settings.pairs)
               for settings in (every, few)]
    assert lengths[0] == pytest.approx(lengths[1], rel=SAMPLING)


def test_nothing_to_cut_has_some_length():
    at, lights = frame(), choose_lights(frame(), PAPER.lights)
    arrays = {key: part[..., :0] for key, part in lights._asdict().items() if isinstance(part, np.ndarray)}
    none = lights._replace(**arrays)
    to = receivers(at)
    assert reference_length(to, none, PAPER.pairs) == 1
    assert reference_length(to._replace(covered=np.zeros_like(to.covered)), lights, PAPER.pairs) == 1


def test_lights_that_reach_too_little_are_hardly_cut():
    """Limit: where all lights together reach fewer pairs than the paper's, the length is ten diagonals."""
    at, lights = frame(), choose_lights(frame(), PAPER.lights)
    few = lights._replace(drawn=100 * lights.drawn)
    length = reference_length(receivers(at), few, PAPER.pairs)
    assert length > 5 * at.scene.geometry.diagonal
    settings = replaced(PAPER, {"reference_length": length})
    cut, full = splat(receivers(at), lights, settings), irradiance(receivers(at), lights, PairSettings())
    assert cut.sum() > 0.999 * full.sum()


def test_the_ledger_uses_the_same_length():
    at = frame()
    settings = of(SiiSettings, lights=96, cut_share=0.05)
    by_hand = with_reference_length(receivers(at), choose_lights(at, settings.lights), settings)
    ledgers = [quietly(sii_ledger, at, one) for one in (settings, by_hand)]
    for row, other in zip(*(ledger.rows for ledger in ledgers), strict=True):
        np.testing.assert_array_equal(row.watts, other.watts)
    assert (ledgers[0].cut > 0).all()

"""Subsplats against the full sum, against clamps, and against gathering, shadowed lights and the truth (Fig. 13)."""

import math

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.lights.selection import choose_lights, footprints
from refgi.scene import load_scene
from refgi.settings import of, replaced
from refgi.splat import Receivers, irradiance
from refgi.splat.gather.gather import GatherSettings, gather
from refgi.splat.multires.multires import multires
from refgi.splat.multires.settings import MultiresSettings
from refgi.truth import TruthSettings, VplSettings, trace_truth, vpl
from tests.splat.multires.choices import unclamped

ALL_FINEST = {"coarsest": 65536}  # the coarsest level is the picture's
FILTER = 2e-6  # of the maximum: a float32 mean of nine
SAME_TERM = 1e-5  # of the mean: a clamp that is not reached divides in another order
WHOLE_MAP = 1.4142  # map widths from any place to any other
LEAST_SQUARE = 0.01  # m^2, in a room 0.55 m wide; the authors' demo has 0.2 in a room of some metres


@pytest.fixture(scope="module")
def box():
    return Frame(load_scene("cornell_box"), width=96, height=96, rsm_resolution=64)


def every_pixel(frame, settings):
    buffer = frame.gbuffer
    receivers = Receivers(*buffer.resolve("position", "normal", "covered"))
    lights, pairs = choose_lights(frame, settings.lights), settings.effective_pairs
    return irradiance(receivers, lights, pairs, footprints(frame, settings.lights, pairs))


def tent(picture, covered):
    """3 x 3 tent over covered pixels; a diagonal one counts only beside a covered edge pixel [P7]."""
    m = np.pad(covered, 1).astype(float)
    C = np.pad(picture * covered, ((0, 0), (1, 1), (1, 1))).astype(float)
    height, width = covered.shape
    total, weight = np.zeros(picture.shape), np.zeros(covered.shape)
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            rows, columns = slice(1 + dy, 1 + dy + height), slice(1 + dx, 1 + dx + width)
            beside = np.maximum(m[rows, 1 : 1 + width], m[1 : 1 + height, columns])
            w = (2 - abs(dy)) * (2 - abs(dx)) * m[rows, columns] * beside
            total, weight = total + w * C[:, rows, columns], weight + w
    return total / np.maximum(weight, 1) * covered


@pytest.mark.feature("AMS-10")
def test_all_finest_subsplats_are_the_full_sum(box, evidence):
    """Oracle: `irradiance` at every pixel; the literal upsampling filters it once."""
    settings = unclamped(lights=64, **ALL_FINEST)
    full = every_pixel(box, settings)
    np.testing.assert_array_equal(multires(box, settings), full)
    literal = multires(box, unclamped(lights=64, as_published=frozenset({"ams_filter_all"}), **ALL_FINEST))
    off = np.abs(literal - tent(full, box.gbuffer.covered)).max() / full.max()
    blur = np.abs(literal - full).max() / full.max()
    evidence(f"all finest: 0 bits differ; the literal mode is one tent filter away ({blur:.2f} of the maximum), "
             f"to {off:.0e}")
    assert off < FILTER < blur


@pytest.mark.feature("AMS-17")
def test_a_clamp_takes_light_from_around_the_lights_alone(box, evidence):
    """Analytic: no pair beyond the least distance changes. Every texel has smaller peaks, as the paper says."""
    covered = box.gbuffer.covered
    clamp, few = {"clamp": "distance", "clamp_value": math.sqrt(LEAST_SQUARE)}, {"lights": 64, "pattern": "grid"}
    free, clamped = (every_pixel(box, unclamped(**few, **change)) for change in ({}, clamp))
    all_free, all_clamped = (every_pixel(box, unclamped(pattern="all", **change)) for change in ({}, clamp))
    mean = all_free[:, covered].mean()
    lost, all_lost = (1 - float(b[:, covered].mean() / a[:, covered].mean())
                      for a, b in ((free, clamped), (all_free, all_clamped)))
    place = choose_lights(box, unclamped(**few).lights).position.astype(np.float32)
    away = box.gbuffer.position[:, :, :, None] - place[:, None, None]
    near = ((away**2).sum(axis=0) < LEAST_SQUARE).any(axis=-1)
    map_of_loss = (free - clamped).sum(axis=0) / free.sum(axis=0, where=covered, initial=1e-9)
    peaks = [part[:, covered].max() / mean for part in (free, clamped, all_free)]
    evidence(
        f"r >= {math.sqrt(LEAST_SQUARE):.2f} m takes {lost:.1%} of the light of 64 lights, {all_lost:.1%} of that of "
        f"every texel, all of it on {near[covered].mean():.0%} of the pixels (up to {map_of_loss.max():.0%} of a "
        f"pixel's); peaks of {peaks[0]:.1f}, clamped {peaks[1]:.1f}, every texel {peaks[2]:.1f} times the mean")
    assert np.abs(free - clamped)[:, covered & ~near].max() < SAME_TERM * mean
    assert (clamped <= free * (1 + SAME_TERM)).all()
    assert lost > 0.02
    assert 0.5 * lost < all_lost < 2 * lost  # light of near surfaces, however many lights stand for them
    assert peaks[1] < peaks[2] < peaks[0]


@pytest.mark.filterwarnings("ignore:.* of the indirect light")  # of some of the pictures
@pytest.mark.feature("AMS-18")
def test_against_gathering_shadowed_lights_and_truth(box, evidence):
    """Picture: plain RMSE over all pixels and channels over the mean of the truth, with and without visibility."""
    light = of(MultiresSettings, lights=1024)
    found = _errors(box, {
        "multires": multires(box, light),
        "multires with rays": multires(box, replaced(light, {"visibility": "rays"})),
        "multires with val's shadows": multires(box, replaced(light, {"visibility": "val"})),
        "every pixel": every_pixel(box, light),
        "vpl": vpl(box, of(VplSettings, lights=1024, pattern="grid")),
        "every texel": gather(box, of(GatherSettings, samples=4096, radius=WHOLE_MAP, interpolation="none")),
        "gather": gather(box, of(GatherSettings, interpolation="none"))})
    evidence("; ".join(f"{name} {shadowed:.3f} from the truth, {bare:.3f} from that without visibility"
                       for name, (shadowed, bare) in found.items()))
    shadowed, bare = ({name: errors[k] for name, errors in found.items()} for k in (0, 1))
    for name in ("multires", "every pixel", "every texel"):
        assert bare[name] < 0.75 * shadowed[name]
    for name in ("multires with rays", "multires with val's shadows"):
        assert shadowed[name] < 0.9 * min(bare[name], shadowed["multires"])
    assert bare["every texel"] < 0.8 * bare["every pixel"]  # four times as many lights
    assert bare["every pixel"] < bare["multires"] < 1.3 * bare["every pixel"]
    assert bare["gather"] > 3 * bare["multires"]


@pytest.mark.filterwarnings("ignore:.* of the indirect light")
@pytest.mark.feature("AMS-18")
def test_more_lights_come_nearer_to_the_truth_without_visibility(box, evidence):
    """Picture: plain RMSE over the mean; what subsplats add is beside what lights leave."""
    found = _errors(box, {(name, n): render(box, of(MultiresSettings, lights=n)) for n in (256, 1024, 4096)
                          for name, render in (("multires", multires), ("every pixel", every_pixel))})
    evidence("; ".join(f"{name}, {n} lights {bare:.3f}" for (name, n), (_, bare) in found.items()))
    for name in ("multires", "every pixel"):
        few, some, many = (found[name, n][1] for n in (256, 1024, 4096))
        assert many < 0.8 * some < 0.8 * 0.8 * few


def _errors(frame, pictures):
    """Return for each picture the RMSE over the mean: to the truth, and to that without visibility."""
    covered = frame.gbuffer.covered
    truths = [trace_truth(frame, TruthSettings(samples=24 * 16, visibility=rays)).mean[:, covered]
              for rays in (True, False)]
    return {name: tuple(math.sqrt(((picture[:, covered] - truth) ** 2).mean()) / truth.mean() for truth in truths)
            for name, picture in pictures.items()}

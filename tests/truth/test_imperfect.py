"""Imperfect shadow maps: against their twin, a wall that is known, and rays to the same pixel lights."""

import dataclasses
import itertools
import math

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.frame import Frame
from refgi.jit import threads
from refgi.lights import choose_pixel_lights
from refgi.literal.imperfect import looked_up, map_frames
from refgi.method import Extent
from refgi.methods import find_method
from refgi.pairs.shadow_rays import fill_shadow_rays, receivers, senders_of
from refgi.scene import Geometry, load_scene
from refgi.settings import of
from refgi.truth import VplSettings, vpl
from refgi.truth.imperfect import Imperfect, ImperfectDepth, fill_hidden, imperfect_maps
from tests.literal.whole import vpl as naive

SINGLE = 1e-6  # maps are float32
ON_BORDERS = 1e-4  # of the pairs: where a place lies between two texels
AT_EDGES = 0.01  # of the texels: a box's end on a texel's centre may round either way
CHANCE = 0.02  # of the pairs


@pytest.fixture(scope="module")
def frame():
    return Frame(load_scene("cornell_box"), width=32, height=32, rsm_resolution=64)


@pytest.fixture(scope="module")
def lights(frame):
    return choose_pixel_lights(frame.rsms, count=24, pattern="halton")


@pytest.mark.feature("REF-17")
@pytest.mark.parametrize(("splat", "levels"), [(1.0, 0), (0.5, 1), (0.0, 4), (2.0, 0)])
def test_maps_are_those_of_the_literal_text(frame, lights, splat, levels):
    geometry, settings = frame.scene.geometry, Imperfect(points=300, resolution=16, splat=splat, levels=levels)
    found = imperfect_maps(geometry, lights, settings, seed=5)
    expected, _, radius = naive.imperfect_maps(geometry, lights, settings, 5)
    off = ~np.isclose(found.depth, expected, rtol=SINGLE)
    assert off.mean(axis=(1, 2)).max() <= AT_EDGES
    assert found.radius == pytest.approx(radius.item())
    assert np.isfinite(expected).any()


@pytest.mark.feature("REF-17")
def test_what_is_hidden_is_that_of_the_literal_text(frame, lights):
    pairs = _pairs(frame, lights, Imperfect(points=300, resolution=16, bias=0.5))
    at = [part[:, None].astype(float) for part in (pairs.to.position, pairs.to.normal)]
    seen = looked_up(*at, np.zeros((1, len(pairs.to.pixel)), int), pairs.to.facing[:, None].astype(float),
                     pairs.senders.position, pairs.senders.normal, map_frames(pairs.senders.normal), pairs.maps.depth,
                     pairs.maps.radius, 0.5)[:, 0].T
    sends = pairs.reach > 0
    assert 0.1 < seen[sends].mean() < 0.9
    assert np.mean(seen[sends] == pairs.hidden[sends]) < ON_BORDERS


@pytest.mark.feature("REF-17")
def test_a_wall_hides_what_is_behind_it_and_nothing_else(evidence):
    """A light at the origin shines up; a square of 2 x 2 m hangs 1 m above it: seen under |x|, |y| <= z."""
    corners = np.array([[-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], float)
    wall = Geometry(corners, np.array([[0, 1, 2], [0, 2, 3]]), np.zeros(2, np.int32))
    lights, direction = _one_light((0, 0, 0), (0, 0, 1)), np.random.default_rng(1).normal(size=(3, 4000))
    direction[2] = np.abs(direction[2]) + 0.05
    sideways = np.abs(direction[:2]).max(axis=0) / direction[2]
    direction, behind = direction[:, np.abs(sideways - 1) > 0.05], (sideways <= 1)[np.abs(sideways - 1) > 0.05]
    leaks = {}
    for splat, levels in ((1.0, 0), (1.0, 1), (1.6, 0)):
        maps = imperfect_maps(wall, lights, Imperfect(points=20000, resolution=256, splat=splat, levels=levels))
        far, near = (_hidden(maps, direction / np.abs(direction).max(axis=0) * scale, lights) for scale in (3.0, 0.9))
        assert not near.any()
        assert far[~behind].mean() < (0.01 if levels else 1e-9)  # what is filled reaches past the rim
        leaks[splat, levels] = 1 - far[behind].mean()
    evidence("light through a wall of 20000 points: " + ", ".join(
        f"{100 * leak:.2f} % (boxes of {splat:g}, {levels} levels)" for (splat, levels), leak in leaks.items()))
    assert 0.01 < leaks[1.0, 0] < 0.06
    assert leaks[1.0, 1] < 0.4 * leaks[1.0, 0]
    assert leaks[1.6, 0] == 0
    empty = dataclasses.replace(wall, faces=wall.faces[:0], material_of_face=wall.material_of_face[:0])
    assert np.isinf(imperfect_maps(empty, lights, Imperfect()).depth).all()


@pytest.mark.feature("REF-17")
@pytest.mark.parametrize("name", ["cornell_box", "atrium"])
def test_more_points_agree_more_often_with_rays(name, evidence):
    frame = Frame(load_scene(name), width=24, height=24, rsm_resolution=64)
    lights = choose_pixel_lights(frame.rsms, count=64, pattern="halton")
    rates = []
    for points, side in ((512, 32), (4096, 64), (32768, 128), (262144, 256)):
        pairs = _pairs(frame, lights, Imperfect(points=points, resolution=side))
        rates.append(_agreement(pairs))
    nothing = _agreement(pairs._replace(hidden=pairs.reach <= 0))
    evidence(f"{name}: {', '.join(f'{100 * rate:.1f}' for rate in rates)} % of pairs, by their light, agree with a ray "
             f"at 512, 4096, 32768, 262144 points; {100 * nothing:.1f} % without maps")
    assert all(more > fewer - CHANCE for fewer, more in itertools.pairwise(rates))
    assert rates[-1] > 0.9
    assert rates[-1] > 1 - 0.5 * (1 - nothing)


@pytest.mark.feature("REF-17")
def test_filled_holes_agree_more_often_with_rays(frame, lights, evidence):
    """Points of one texel leave holes; boxes as wide as discs leave fewer, and filling adds shadows at their rims."""
    rates = {(splat, levels): _agreement(_pairs(frame, lights, Imperfect(points=4000, splat=splat, levels=levels)))
             for splat in (0.0, 1.0) for levels in (0, 1)}
    evidence("cornell_box, 4000 points: " + ", ".join(
        f"boxes of {splat:g}, holes {'filled' if levels else 'left'}: {100 * rate:.1f} %"
        for (splat, levels), rate in rates.items()))
    assert rates[0.0, 1] > rates[0.0, 0] + 0.02
    assert rates[1.0, 0] > rates[0.0, 1]


def test_the_picture_lies_between_those_with_rays_and_without(frame):
    shadowed, free = vpl(frame, of(VplSettings, lights=200)), vpl(frame, of(VplSettings, lights=200, visibility=False))
    mapped = vpl(frame, of(VplSettings, lights=200, maps="imperfect"))
    assert (mapped <= free * (1 + 1e-6)).all()
    assert abs(mapped.mean() - shadowed.mean()) < 0.2 * (free.mean() - shadowed.mean())
    with threads(1):
        assert np.array_equal(mapped, vpl(frame, of(VplSettings, lights=200, maps="imperfect")))
    few = vpl(frame, of(VplSettings, lights=200, maps="imperfect", batch=3000))
    assert np.array_equal(mapped, few)


def test_memory_of_the_maps_is_counted():
    """Closed form: float32 texels of a map for each light of all lamps together, or for each texel of their maps."""
    def counted(**how):
        return find_method("vpl").extra_bytes(of(VplSettings, **how), Extent((64, 48), maps=6, texels=32**2))

    assert counted(maps="imperfect", resolution=16, lights=100) == 100 * 16 * 16 * 4
    assert counted(maps="imperfect", resolution=16, pattern="all") == 6 * 32 * 32 * 16 * 16 * 4
    assert counted(maps="imperfect", resolution=16, lights=2000) == 2000 * 16 * 16 * 4
    assert counted(lights=100) == 0
    assert counted(visibility=False, maps="imperfect") == 0


def test_settings_are_checked():
    with pytest.raises(InputError, match=r"maps\.resolution: expected a power of two, got 96"):
        Imperfect(resolution=96)
    with pytest.raises(InputError, match=r"maps\.levels: expected at most 4 for 16 texels, got 5"):
        Imperfect(resolution=16, levels=5)


@dataclasses.dataclass
class Pairs:
    """All pairs of some receivers and lights."""

    maps: ImperfectDepth
    to: object
    senders: object
    reach: np.ndarray  # (receivers, lights)
    hidden: np.ndarray
    blocked: np.ndarray
    light: np.ndarray

    def _replace(self, **changes):
        return dataclasses.replace(self, **changes)


def _pairs(frame, lights, settings):
    buffer, tracer = frame.gbuffer, frame.tracer
    to = receivers(frame.scene.geometry, buffer.position, buffer.normal, buffer.triangle_id, tracer.grain)
    senders, shape = senders_of(lights), (len(to.pixel), lights.flux.shape[1])
    count = math.prod(shape)
    rays = tuple(np.zeros((count, 3), np.float32) for _ in range(2))
    reach, light = np.zeros(count, np.float32), np.zeros((count, 3), np.float32)
    fill_shadow_rays(to, (0, shape[0]), senders, (0, shape[1]), tracer.grain, (*rays, reach, light))
    hidden, blocked = np.empty(count, np.bool_), np.empty(count, np.bool_)
    maps = imperfect_maps(frame.scene.geometry, lights, settings)
    fill_hidden(maps, to, (0, shape[0]), senders, (0, shape[1]), reach, hidden)
    tracer.fill_occluded(*rays, reach, blocked)
    sent = np.where(reach > 0, light.sum(axis=1), 0)
    return Pairs(maps, to, senders, *(part.reshape(shape) for part in (reach, hidden, blocked, sent)))


def _agreement(pairs):
    """Return the share of the light of all pairs for which map and ray agree; no pair counts for more than 20."""
    weight = np.minimum(pairs.light, 20 * pairs.light.mean())
    return float((weight * (pairs.hidden == pairs.blocked)).sum() / weight.sum())


def _one_light(position, normal):
    lights = choose_pixel_lights(Frame(load_scene("cornell_box"), width=4, height=4, rsm_resolution=8).rsms, count=1,
                                 pattern="grid")
    place, up = (np.array(one, lights.position.dtype)[:, None] for one in (position, normal))
    return lights._replace(position=place, normal=up)


def _hidden(maps, points, lights):
    from refgi.pairs.shadow_rays import RayReceivers

    columns = np.ascontiguousarray(points, np.float32)
    facing = -columns / np.linalg.norm(columns, axis=0)
    to = RayReceivers(np.arange(points.shape[1]), columns, facing, facing, columns)
    reach, hidden = np.ones(points.shape[1], np.float32), np.empty(points.shape[1], np.bool_)
    fill_hidden(maps, to, (0, points.shape[1]), senders_of(lights), (0, 1), reach, hidden)
    return hidden

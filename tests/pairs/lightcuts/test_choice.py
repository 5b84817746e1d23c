"""When sums are made by clusters: where their counted work is less than that of the full sum, and never for few."""

import math

import numpy as np
import pytest

from refgi.diagnostics import diagnosing
from refgi.jit import threads
from refgi.pairs.irradiance import Receivers, irradiance
from refgi.pairs.lightcuts import cuts as choice
from refgi.pairs.lightcuts.cuts import sum_groups
from refgi.pairs.lightcuts.groups import group_receivers
from refgi.pairs.lightcuts.tree import light_tree
from refgi.pairs.pixel_lights import pack
from refgi.pairs.settings import AutoLightcuts, Lightcuts, PairSettings, SphereClamp
from refgi.pairs.tile_counts import tiles_behind
from refgi.pairs.tiles import block_by_block, taken
from refgi.stages import observe, standing_for
from tests.pairs.lightcuts.scenes import CLAMPS, scene

COUNT, SIDE = 20000, 96
NEAR = 2.0  # of the work that is counted in full, an estimate


def apart(name, height, side=SIDE):
    """Return lights, areas and a picture of a plane that faces down at a height over them."""
    lights, area, _ = scene(name, COUNT, 1)
    grid = np.stack(np.meshgrid(np.arange(side), np.arange(side))).astype(np.float32) / side
    position = np.stack([grid[0], np.full_like(grid[0], height), grid[1]])
    normal = np.zeros_like(position)
    normal[1] = -1.0
    return lights, area, Receivers(position, normal, np.ones((side, side), np.bool_))


@pytest.fixture
def no_least(monkeypatch):
    monkeypatch.setattr(choice, "LEAST_PAIRS", 0)


@pytest.mark.parametrize(("name", "height"), [("floor", 1.0), ("floor", 0.2), ("cube", 0.5), ("colours", 2.0)])
def test_the_estimate_is_near_what_is_counted(name, height):
    """Oracle: pairs and bounds of all receivers and all lights, at the costs that the estimate has."""
    lights, area, points = apart(name, height)
    packed = pack(lights, PairSettings(clamp=CLAMPS["disc"]), area, np.float32)
    position, normal = (taken(part, block_by_block(points.covered)) for part in points[:2])
    number, tiles = SIDE * SIDE, choice.TILES * choice.TILE
    tree = light_tree(packed.diffuse, packed.clamp, 0.02)
    pairs, bounds = sum_groups(position, normal, *group_receivers(position, normal), tree, np.zeros_like(position))
    behind, every = tiles_behind(position, normal, packed.diffuse)
    cuts = choice.CUT_PAIR * pairs + choice.BOUND * bounds + choice.NODE * COUNT + choice.RECEIVER * number
    full = number * COUNT * (choice.PAIR * (1 - behind / every) + choice.TEST / choice.TILE)
    some = np.linspace(0, number - tiles // choice.TILES, choice.TILES).astype(int)[:, None] + np.arange(choice.TILE)
    found = choice.estimated_share(*(np.ascontiguousarray(part[:, some.ravel()]) for part in (position, normal)),
                                   packed.diffuse, packed.clamp, 0.02, number)
    assert 1 / NEAR < found / (cuts / full) < NEAR


@pytest.mark.usefixtures("no_least")
def test_clusters_where_they_pay():
    """Far from flat lights they do, to the bits of those asked for by name; among scattered ones they do not."""
    lights, area, points = apart("floor", 1.0)
    pairs = PairSettings(clamp=CLAMPS["disc"])
    with diagnosing() as found, observe() as log:
        got = irradiance(points, lights, pairs, area, AutoLightcuts(0.05))
    np.testing.assert_array_equal(got, irradiance(points, lights, pairs, area, Lightcuts(0.05)))
    assert found.lightcuts[:2] == (COUNT, 0.05)
    assert [run.reason for run in log.runs if run.name == "pairs.full_sum"] == [found.lightcuts.statement]
    lights, area, points = apart("cube", 0.5)
    with diagnosing() as found, observe() as log:
        got = irradiance(points, lights, pairs, area, AutoLightcuts(0.001))
    np.testing.assert_array_equal(got, irradiance(points, lights, pairs, area))
    assert found.lightcuts is None
    assert "times the time" in next(run.reason for run in log.runs if run.name == "pairs.lightcuts")


@pytest.mark.usefixtures("no_least")
def test_few_and_unbounded_lights_are_summed_in_full(monkeypatch):
    lights, area, points = apart("floor", 1.0)
    few = lights._replace(**{key: getattr(lights, key)[:, :8191] for key in ("position", "normal", "flux")})
    below = lights._replace(flux=lights.flux * np.where(np.arange(COUNT) == 7, -1, 1))
    monkeypatch.setattr(choice, "estimated_share", lambda *_: math.nan)  # is not asked
    for some, clamp in ((few, None), (below, None), (lights, SphereClamp())):
        packed = pack(some, PairSettings(clamp=clamp), area[: some.flux.shape[1]], np.float32)
        assert choice.chosen(AutoLightcuts(), packed, points[:2], points.covered) is None
    monkeypatch.setattr(choice, "LEAST_PAIRS", SIDE * SIDE * COUNT + 1)
    packed = pack(lights, PairSettings(clamp=None), area, np.float32)
    assert choice.chosen(AutoLightcuts(), packed, points[:2], points.covered) is None


def test_a_small_picture_sums_as_the_one_that_it_stands_for():
    lights, area, points = apart("floor", 1.0)
    packed = pack(lights, PairSettings(clamp=None), area, np.float32)
    enough = choice.LEAST_PAIRS // COUNT + 1
    for pixels, clusters in ((enough - 1, None), (enough, Lightcuts(0.02))):
        with standing_for(pixels):
            assert choice.chosen(AutoLightcuts(), packed, points[:2], points.covered) == clusters


def test_the_choice_knows_no_threads():
    lights, area, points = apart("floor", 0.2)
    packed = pack(lights, PairSettings(clamp=CLAMPS["disc"]), area, np.float32)
    position, normal = (np.ascontiguousarray(part.reshape(3, -1)[:, : 16 * 256]) for part in points[:2])
    shares = set()
    for count in (1, 2):
        with threads(count):
            shares.add(choice.estimated_share(position, normal, packed.diffuse, packed.clamp, 0.02, SIDE * SIDE))
    assert len(shares) == 1

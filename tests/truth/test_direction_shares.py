"""Directions shared out to blocks of pixels: who gets how many, and what that is worth."""

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.rays import Tracer
from refgi.scene import Material, SpotLight, load_scene
from refgi.truth import TruthSettings
from refgi.truth.passes import FEWEST, MOST, _hemisphere
from refgi.truth.task import Draw
from refgi.truth.truth import task_of
from tests.truth.scenes import corner_room, rectangle, scene

SIZE, DIRECTIONS, PASSES = 64, 8, 32
# 24 x 24 receivers of a block and its neighbours, four directions each, tell its deviation to a factor of sqrt(2) where
# many of them find something; the next power of two is off by as much.
OFF = 1.0  # octaves


SPOT = SpotLight((0.5, 1.5, 0.6), (-0.6, -0.8, -0.7), 0.3, 0.6, (2.0, 1.5, 1.0))


def made(given, **settings):
    frame = Frame(given, width=SIZE, height=SIZE)
    buffer = frame.gbuffer
    return task_of(frame.scene, frame.tracer, buffer.position, buffer.normal, buffer.triangle_id,
                   TruthSettings(**settings))


@pytest.fixture(scope="module")
def task():
    return made(load_scene("cornell_box"))


def counts_of(task):
    """Return the directions of each receiver; 0 where it is in no group or in two."""
    counts, groups = np.zeros((2, len(task.receivers.pixel)), np.int64)
    for group in task.groups:
        counts[group.chosen] = group.directions
        groups[group.chosen] += 1
    return np.where(groups == 1, counts, 0)


def spread_of(task, passes=PASSES):
    """Return the variance (r,) of what the hemisphere estimator finds in a pass."""
    found = np.zeros((passes, 3, len(task.receivers.pixel)))
    for k, sums in enumerate(found):
        words = np.random.SeedSequence([11, k]).generate_state(5)
        _hemisphere(task, Draw(words, words, 0), sums)
    return found.var(axis=0, ddof=1).mean(axis=0)


def test_every_receiver_is_in_one_group_of_a_power_of_two(task):
    counts = counts_of(task)
    assert (counts >= max(1, FEWEST * DIRECTIONS)).all()
    assert (counts <= MOST * DIRECTIONS).all()
    assert (np.log2(counts) % 1 == 0).all()
    assert counts.mean() <= DIRECTIONS
    for group in task.groups:
        for field, whole in zip(group.receivers, task.receivers, strict=True):
            assert np.array_equal(field, whole[..., group.chosen])


def test_blocks_have_directions_in_proportion_to_their_deviation(task, evidence):
    """Oracle: the deviation of many passes with as many directions everywhere, over blocks and their neighbours."""
    counts, variance = counts_of(task), np.full((SIZE, SIZE), np.nan)
    variance.reshape(-1)[task.receivers.pixel] = spread_of(task._replace(groups=()))
    wide = np.pad(variance, 8, constant_values=np.nan)
    block = np.array([[np.nanmean(wide[y : y + 24, x : x + 24]) for x in range(0, SIZE, 8)] for y in range(0, SIZE, 8)])
    y, x = task.receivers.pixel // SIZE // 8, task.receivers.pixel % SIZE // 8
    deviation = np.sqrt(block[y, x])
    expected = np.clip(deviation / np.sqrt((deviation**2).mean()), FEWEST, MOST) * DIRECTIONS
    octaves = np.log2(counts / expected)
    evidence(f"directions of a block are at most {np.abs(octaves).max():.2f} octaves off the rule; "
             f"{counts.mean():.1f} a receiver on average, of {DIRECTIONS}")
    assert np.abs(octaves).max() <= OFF
    assert len(np.unique(counts)) >= 4


def test_shares_are_worth_more_than_their_rays(task, evidence):
    """Variance times directions: below half of that of even ones."""
    even, shared = (spread_of(each).mean() * count for each, count in (
        (task._replace(groups=()), DIRECTIONS), (task, counts_of(task).mean())))
    evidence(f"variance times directions, shared out over even: {shared / even:.2f}")
    assert shared < 0.5 * even


@pytest.mark.parametrize("settings", [{"estimator": "hemisphere"}, {"estimator": "light"}, {"bounces": 2}])
def test_directions_that_carry_more_than_the_rest_are_even(settings):
    assert made(load_scene("cornell_box"), **settings).groups == ()


def test_senders_with_lobes_and_empty_pictures_have_even_directions():
    glossy = Material("glossy", (0.2, 0.2, 0.2), (0.5, 0.4, 0.3), 20.0)
    assert made(corner_room(SPOT, material=glossy)).groups == ()
    empty = Frame(corner_room(SPOT), width=8, height=8)
    nothing = np.full((8, 8), -1, np.int32)
    buffer = empty.gbuffer
    assert task_of(empty.scene, empty.tracer, buffer.position, buffer.normal, nothing, TruthSettings()).groups == ()


def test_where_directions_find_nothing_all_have_the_fewest():
    """A lone floor sends nothing to itself."""
    room = scene([rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2))], SPOT)
    x, z = np.meshgrid(np.linspace(-0.9, 0.9, 16), np.linspace(-0.9, 0.9, 16))
    up = np.broadcast_to(np.array([0.0, 1.0, 0.0])[:, None, None], (3, 16, 16))
    task = task_of(room, Tracer(room.geometry), np.stack([x, np.zeros_like(x), z]), up, np.zeros((16, 16), np.int32),
                   TruthSettings())
    assert set(counts_of(task).tolist()) == {FEWEST * DIRECTIONS}

"""Clustering of a spot that moves from a wall to the ceiling (Fig. 8): kept from frame to frame they are lost."""

from itertools import pairwise

import numpy as np
import pytest

from refgi.cluster.kmeans import cluster, in_use

FRAMES, LIGHTS, AREAS = 41, 1024, 30
ROOM = np.array([4.0, 3.0, 4.0])
DIAGONAL = float(np.linalg.norm(ROOM))
HALF_ANGLE = np.radians(25)


def radical_inverse(count, base):
    values = np.zeros(count)
    for i in range(count):
        share, k = 1.0, i + 1
        while k:
            share /= base
            values[i] += share * (k % base)
            k //= base
    return values


U, V = radical_inverse(LIGHTS, 2), radical_inverse(LIGHTS, 3)


def lit_points(elevation):
    """Where the rays of a spot in the middle of the room meet its walls, and the walls' normals."""
    radius, turn = np.sqrt(U) * np.tan(HALF_ANGLE), 2 * np.pi * V
    ray = np.stack([np.ones(LIGHTS), radius * np.cos(turn), radius * np.sin(turn)])
    c, s = np.cos(elevation), np.sin(elevation)
    ray = np.stack([c * ray[0] - s * ray[1], s * ray[0] + c * ray[1], ray[2]])
    with np.errstate(divide="ignore"):
        reach = ROOM[:, None] / 2 / np.abs(ray)
    wall, normal = reach.argmin(axis=0), np.zeros((3, LIGHTS))
    normal[wall, np.arange(LIGHTS)] = -np.sign(ray[wall, np.arange(LIGHTS)])
    return ray * reach.min(axis=0), normal


def frames():
    return [lit_points(np.pi / 2 * frame / (FRAMES - 1)) for frame in range(FRAMES)]


@pytest.mark.feature("VAL-07")
@pytest.mark.parametrize("mode", ["normalised", "raw"])
def test_a_warm_start_loses_clusters_and_a_restart_keeps_them(mode, evidence):
    sequence = frames()
    kept, warm = None, []
    for position, normal in sequence + sequence[::-1]:
        kept = cluster(position, normal, AREAS, distance=mode, diagonal=DIAGONAL, start=kept)
        warm.append(in_use(kept))
    restarted = [in_use(cluster(*lights, AREAS, distance=mode, diagonal=DIAGONAL)) for lights in sequence]
    evidence(f"{mode}: warm start {warm[:FRAMES:5]} of {AREAS} clusters wall to ceiling, {warm[-1]} when back; "
             f"restart {min(restarted)} at least")
    assert set(restarted) == {AREAS}
    assert warm[0] == AREAS
    assert warm[FRAMES - 1] <= 5
    assert all(later <= before for before, later in pairwise(warm[:FRAMES]))
    assert warm[FRAMES - 1] < warm[-1] < AREAS  # some come back to life, not all


@pytest.mark.feature("VAL-06")
def test_the_same_frame_twice_is_the_same_bits_after_any_other():
    first, last = lit_points(0.0), lit_points(1.0)
    before = cluster(*first, AREAS, diagonal=DIAGONAL)
    cluster(*last, AREAS, diagonal=DIAGONAL)
    again = cluster(*first, AREAS, diagonal=DIAGONAL)
    assert all(np.array_equal(a, b) for a, b in zip(before, again, strict=True))

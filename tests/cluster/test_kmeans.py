"""Clustering of lights: against the literal text, and what must hold whatever the lights (Dong et al. 2009, Sec. 5)."""

import math
from itertools import pairwise

import numpy as np
import pytest

from refgi.cluster.kmeans import Clustering, cluster, in_use, mean_angle
from refgi.cluster.rounds import angle
from refgi.errors import InputError
from refgi.literal.val_areas import kmeans_assign, kmeans_rounds, kmeans_start
from refgi.stages import observe

MODES = ("raw", "normalised", "squared")
WEIGHTS = (0.7, 0.3)
ROUNDING = 1e-13  # relative; sums of some hundred terms in another order
ANGLE_ERROR = 1e-15  # rad: two roundings of pi/2
RISE = 1e-12  # relative, of a sum of 400 roundings
RUNS = 300


def random_lights(seed, axes=False):
    rng = np.random.default_rng(seed)
    total, count = int(rng.integers(50, 400)), int(rng.integers(2, 31))
    position, normal = rng.random((3, total)), rng.normal(size=(3, total))
    if axes:
        normal = np.eye(3)[:, rng.integers(0, 3, total)] * rng.choice([-1, 1], total)
    return position, normal, count


def unit_vectors(normal):
    return normal / np.linalg.norm(normal, axis=0)


def box(diagonal):
    return np.array([[0.0, 0, 0], [diagonal, 0, 0]])


@pytest.mark.feature("VAL-05", "VAL-08", "VAL-25")
@pytest.mark.parametrize("mode", MODES)
def test_the_rounds_are_those_of_the_literal_text(mode, evidence):
    lights = 0
    for seed in range(25):
        rng = np.random.default_rng(seed)
        total, count = int(rng.integers(1, 90)), int(rng.integers(1, 12))
        position, normal = rng.random((3, total)), rng.normal(size=(3, total))
        ours = cluster(position, normal, count, distance=mode, weights=WEIGHTS, diagonal=1.7)
        if count >= total:
            continue
        given = position, unit_vectors(normal)
        start = kmeans_start(*given, count)
        for rounds in (50, ours.rounds):
            center, axis, of = kmeans_rounds(*given, box(1.7), *start, mode, *WEIGHTS, rounds)
            np.testing.assert_array_equal(ours.of, of)
            np.testing.assert_allclose(ours.center, center, rtol=0, atol=ROUNDING)
            np.testing.assert_allclose(ours.normal, axis, rtol=0, atol=ROUNDING)
        np.testing.assert_array_equal(ours.members, np.bincount(of, minlength=count))
        ends = [kmeans_assign(*given, box(1.7), *one, mode, *WEIGHTS)[1].sum() for one in (start, (center, axis))]
        np.testing.assert_allclose(ours.objective[[0, -1]], ends, rtol=ROUNDING)
        assert len(ours.objective) == ours.rounds + 1
        lights += total
    evidence(f"{mode}: C(i) and rounds of {lights} lights are those of the text, means to 1e-13")


@pytest.mark.feature("VAL-05")
@pytest.mark.parametrize(("mode", "rises"), [("raw", True), ("normalised", True), ("squared", False)])
def test_only_the_sum_of_squares_never_rises(mode, rises, evidence):
    risen, rounds = 0, []
    for seed in range(RUNS):
        position, normal, count = random_lights(seed, axes=seed % 2 == 1)
        found = cluster(position, normal, count, distance=mode, diagonal=3**0.5)
        assert len(found.objective) == found.rounds + 1
        risen += bool((np.diff(found.objective) > RISE * found.objective[:-1]).any())
        rounds.append(found.rounds)
    evidence(f"{mode}: objective rose in {risen} of {RUNS} runs; {np.mean(rounds):.1f} rounds, {max(rounds)} at most")
    assert (risen > 0) == rises
    assert max(rounds) < 50


@pytest.mark.feature("VAL-10")
@pytest.mark.parametrize("mode", MODES)
def test_every_light_belongs_to_the_cluster_at_least_distance(mode, evidence):
    lights, worst = 0, 0.0
    for seed in range(20):
        position, normal, count = random_lights(seed, axes=seed % 2 == 1)
        found = cluster(position, normal, count, distance=mode, diagonal=1.3, rounds=1 + seed % 4)
        least = kmeans_assign(position, unit_vectors(normal), box(1.3), found.center, found.normal, mode)[1].sum()
        worst = max(worst, abs(found.objective[-1] / least - 1))
        np.testing.assert_array_equal(found.members, np.bincount(found.of, minlength=count))
        lights += len(found.of)
    assert worst <= ROUNDING
    evidence(f"{mode}: distances of {lights} lights sum up to the least there are, to {worst:.1e}")


@pytest.mark.feature("VAL-10")
def test_the_lowest_cluster_wins_a_tie():
    position = np.zeros((3, 5))
    position[0] = [-1, -1, 0, 1, 1]  # the middle one is as far from both
    normal = np.repeat([[0.0], [0.0], [1.0]], 5, axis=1)
    for first, expected in (((-1.0, 1.0), 0), ((1.0, -1.0), 0)):
        start = Clustering(np.array([first, (0, 0), (0, 0)], float), normal[:, :2], np.zeros(2, np.int64),
                         np.zeros(5, np.int32), 0, np.zeros(1))
        for mode in MODES:
            found = cluster(position, normal, 2, distance=mode, diagonal=1.0, rounds=1, start=start)
            # the middle light joined cluster 0, whose mean moved towards it
            assert found.of[2] == expected
            assert abs(found.center[0, 0]) == pytest.approx(2 / 3)


@pytest.mark.feature("VAL-06")
def test_reruns_and_other_numbers_of_threads_give_the_same_bits(monkeypatch, evidence):
    import numba

    from refgi.jit import threads

    monkeypatch.setattr("refgi.cluster.kmeans.SMALL", 0)
    rng = np.random.default_rng(7)
    position, normal = rng.random((3, 5000)), rng.normal(size=(3, 5000))
    runs = []
    for workers in (1, numba.config.NUMBA_NUM_THREADS, 1):
        with threads(workers):
            runs.append(cluster(position, normal, 60, diagonal=1.7, rounds=8))
    for other in runs[1:]:
        assert all(np.array_equal(a, b) for a, b in zip(runs[0], other, strict=True))
    evidence(f"5000 lights, 60 clusters, {runs[0].rounds} rounds: bits equal on 1 and "
             f"{numba.config.NUMBA_NUM_THREADS} threads and again")


@pytest.mark.feature("VAL-08")
def test_normals_keep_clusters_planar(evidence):
    rng = np.random.default_rng(5)
    wall = rng.integers(0, 3, 1024)  # three walls of a corner, each of unit size
    position, normal = rng.random((3, 1024)), np.zeros((3, 1024))
    position[wall, np.arange(1024)] = 0
    normal[wall, np.arange(1024)] = 1
    alone = cluster(position, normal, 30, weights=(1.0, 0.0), diagonal=3**0.5)
    both = cluster(position, normal, 30, diagonal=3**0.5)
    before, after = (math.degrees(mean_angle(normal, found)) for found in (alone, both))
    mixed = [sum(len(set(wall[found.of == k])) > 1 for k in range(30)) for found in (alone, both)]
    evidence(f"mean angle inside clusters at a corner {before:.2f} deg by position alone, {after:.2f} deg with the "
             f"normal; clusters of several walls {mixed[0]}, {mixed[1]}")
    assert after < 0.1 * before
    assert mixed[1] < mixed[0]
    angles = [kmeans_assign(position[:, both.of == k], normal[:, both.of == k], box(1.0), both.center[:, [k]],
                            both.normal[:, [k]], "raw", 0.0, 1.0)[1] for k in range(30)]
    assert mean_angle(normal, both) == pytest.approx(np.concatenate(angles).mean(), abs=ANGLE_ERROR)


@pytest.mark.feature("VAL-08")
def test_angles_are_exact_near_zero_and_near_a_half_turn():
    rng = np.random.default_rng(2)
    worst = 0.0
    for size in (1e-12, 1e-8, 1e-4, 0.01, 0.5, 1.0, 10.0):
        for sign in (1.0, -1.0):
            for _ in range(50):
                a = unit_vectors(rng.normal(size=3))
                b = unit_vectors(sign * a + size * rng.normal(size=3))
                dot = float(a @ b)
                apart, across = a - math.copysign(1.0, dot) * b, np.cross(a, b)
                expected = math.atan2(math.sqrt(across @ across), dot)
                worst = max(worst, abs(angle(dot, float(apart @ apart)) - expected))
    assert worst <= ANGLE_ERROR
    assert angle(0.0, 2.0) == math.pi / 2
    assert angle(1.0, 0.0) == 0.0
    assert angle(-1.0, 0.0) == math.pi


@pytest.mark.feature("VAL-05")
def test_the_normalised_clusters_do_not_depend_on_the_unit_of_length():
    position, normal, count = random_lights(11)
    metres = cluster(position, normal, count, diagonal=1.5)
    inches = cluster(64 * position, normal, count, diagonal=96.0)
    np.testing.assert_array_equal(metres.of, inches.of)
    np.testing.assert_array_equal(64 * metres.center, inches.center)
    raw = [cluster(scale * position, normal, count, distance="raw", diagonal=1.0).of for scale in (1, 64)]
    assert (raw[0] != raw[1]).any()


@pytest.mark.parametrize("mode", MODES)
def test_all_lights_in_one_point(mode):
    position = np.full((3, 40), 0.3)
    normal = np.repeat([[0.0], [0.6], [0.8]], 40, axis=1)
    found = cluster(position, normal, 6, distance=mode, diagonal=1.0)
    assert in_use(found) == 1
    assert found.members[0] == 40
    assert found.objective[-1] < 40 * ROUNDING
    assert (found.center == 0.3).all()  # the mean has what all have in common; empty clusters stay where they were


@pytest.mark.feature("VAL-04")
def test_as_many_clusters_as_lights_are_the_lights_themselves():
    position, normal, _ = random_lights(4)
    position[:, 5], normal[:, 5] = position[:, 2], normal[:, 2]  # two of them in one place
    total = position.shape[1]
    for count in (total, total + 20):
        with observe() as log:
            found = cluster(position, normal, count, diagonal=1.0)
        np.testing.assert_array_equal(found.of, np.arange(total))
        np.testing.assert_array_equal(found.center, position)
        assert (found.members == 1).all()
        said = [run.reason for run in log.runs if run.status == "skipped"]
        assert said == ([] if count == total else [f"20 of {count} area lights: there are {total} pixel lights"])


@pytest.mark.feature("VAL-07", "VAL-08")
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("turns", [(0, 180), (10, 130, 250)])
def test_a_cluster_whose_normals_cancel_keeps_its_normal(mode, turns):
    """Cancel exactly, or but for rounding, which is no direction."""
    position, normal = np.zeros((3, len(turns) + 1)), np.zeros((3, len(turns) + 1))
    position[0] = [*(0.1 * i for i in range(len(turns))), 9.0]
    normal[:2] = np.cos(np.radians([*turns, 0])), np.sin(np.radians([*turns, 0]))
    start = Clustering(np.array([[0.05, 9.0], [0.0, 0.0], [0.0, 0.0]]), np.array([[0.0, 1.0], [0.6, 0.0], [0.8, 0.0]]),
                     np.zeros(2, np.int64), np.zeros(3, np.int32), 0, np.zeros(1))
    found = cluster(position, normal, 2, distance=mode, weights=(0.9, 0.1), diagonal=1.0, start=start)
    assert found.of.tolist() == [0] * len(turns) + [1]
    np.testing.assert_array_equal(found.normal[:, 0], [0.0, 0.6, 0.8])


def test_no_light_and_one_light():
    none = np.zeros((3, 0))
    found = cluster(none, none, 30, diagonal=1.0)
    assert found.center.shape == (3, 0)
    assert found.of.shape == (0,)
    one = cluster(np.ones((3, 1), np.float32), np.eye(3, 1, dtype=np.float32), 30, diagonal=1.0)
    assert one.center.shape == (3, 1)
    assert one.center.dtype == np.float64
    before = cluster(*random_lights(1)[:2], 5, diagonal=1.0)
    dark = cluster(none, none, 5, diagonal=1.0, start=before)  # the light went out
    np.testing.assert_array_equal(dark.center, before.center)
    assert in_use(dark) == 0


@pytest.mark.parametrize(("given", "name"), [
    ({"position": np.zeros((2, 4))}, "position"), ({"normal": np.full((3, 4), np.nan)}, "normal"),
    ({"count": 0}, "count"), ({"diagonal": 0.0}, "diagonal"), ({"rounds": 0}, "rounds"),
    ({"start": cluster(np.eye(3), np.eye(3), 2, diagonal=1.0)}, "start")])  # fmt: skip
def test_what_cannot_be_clustered_is_said(given, name):
    usual = {"position": np.ones((3, 4)), "normal": np.ones((3, 4)), "count": 3, "diagonal": 1.0}
    with pytest.raises(InputError, match=f"^{name}"):
        cluster(**{**usual, **given})


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
        before, kept = kept, cluster(position, normal, AREAS, distance=mode, diagonal=DIAGONAL, start=kept)
        warm.append(in_use(kept))
        if before is not None and len(warm) % 10 == 0:
            _, _, of = kmeans_rounds(position, normal, box(DIAGONAL), before.center, before.normal, mode, *WEIGHTS, 50)
            np.testing.assert_array_equal(kept.of, of)
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

"""Passes of a series stratify each other; series are independent."""

import numpy as np
import pytest
from scipy.stats import chi2

from refgi.frame import Frame
from refgi.scene import load_scene
from refgi.truth import TruthSettings
from refgi.truth.hemisphere import scrambled_points
from refgi.truth.light_grid import stratified_sets
from refgi.truth.light_side import random_shift
from refgi.truth.lobe_cells import glossy_triangles
from refgi.truth.lobe_pass import lobe_pass
from refgi.truth.passes import one_pass
from refgi.truth.result import SERIES
from refgi.truth.task import drawn
from refgi.truth.truth import _guided, _with_lobes, without_pilot
from tests.glossy import glossy_box

CERTAIN = 1e-4
# Of n turns around a circle, each a golden section on, the widest gap times n is at most 1 + 2 / sqrt(5) (three gaps).
WIDEST = 1 + 2 / np.sqrt(5)
WORD = 2.0**-24  # a shift's last place


def test_numbers_of_passes():
    """Passes k and k + 8 share their series' numbers, have others of their own; all else is different."""
    draws = [drawn(TruthSettings(seed=3, bounces=2), k, *kind) for kind in ((), (1,)) for k in range(3 * SERIES)]
    assert [one.turn for one in draws] == 2 * [k // SERIES for k in range(3 * SERIES)]
    for k in range(SERIES):
        assert np.array_equal(draws[k].shared, draws[k + SERIES].shared)
    assert all(len(one.shared) == len(one.own) == 6 for one in draws)
    assert len({one.shared.tobytes() for one in draws}) == 2 * SERIES
    assert len({one.own.tobytes() for one in draws}) == 2 * 3 * SERIES


def test_shifts_of_picks_are_even_over_any_number_of_turns():
    shifts = np.array([[random_shift(pixel, 7, turn) for turn in range(300)] for pixel in (0, 5)], np.float64)
    for n in range(2, 301):
        around = np.sort(shifts[:, :n], axis=1)
        gaps = np.diff(around, axis=1, append=around[:, :1] + 1)
        assert gaps.max() * n < WIDEST + n * 2 * WORD
    assert shifts[0, 0] != shifts[1, 0]


@pytest.mark.parametrize("turn", [0, 1, 5])
def test_a_shift_is_uniform_over_pixels_in_every_turn(turn):
    met = np.bincount([int(32 * random_shift(pixel, 9, turn)) for pixel in range(6400)], minlength=32)
    statistic = ((met - 200) ** 2 / 200).sum()
    assert chi2.ppf(CERTAIN, 31) < statistic < chi2.ppf(1 - CERTAIN, 31)


@pytest.mark.parametrize("count", [2, 8])
def test_directions_of_a_series_are_one_net(count):
    """Of 2^m points, over all turns, one lies in each box of area 2^-m, whatever its shape: a (0, m, 2)-net."""
    points = np.concatenate([scrambled_points(count, 123, turn) for turn in range(64 // count)])
    for wide in range(7):
        box = (points[:, 0] >> np.uint32(32 - wide) if wide else 0) * (1 << (6 - wide)) + (
            points[:, 1] >> np.uint32(26 + wide) if wide < 6 else 0)
        assert np.array_equal(np.sort(box), np.arange(64))


def test_light_vertices_go_on_in_their_cells(evidence):
    """Mean of x y over a cell against the sequence of Roberts (2018) from everywhere. Sets stay jittered."""
    n, side, turns, seeds = 2, 2, 16, 400
    found = np.array([[stratified_sets(n, side, np.random.default_rng(seed), turn) for turn in range(turns)]
                      for seed in range(seeds)])  # (seed, turn, set, cell, 2)
    assert np.array_equal(np.floor(found * n), np.broadcast_to(np.floor(found[:1, :1, :1] * n), found.shape))
    place = found * n % 1
    gap = (place[:, :, :, None] - place[:, :, None] + 0.5) % 1 - 0.5  # between sets, around the edges: none depends
    assert np.abs(np.abs(gap) - np.abs(gap[:, :1])).max() < 1e-9  # on the turn
    part = np.floor(place[:, 0] * side).astype(int) @ [side, 1]
    assert np.array_equal(np.sort(part, axis=1), np.broadcast_to(np.arange(4)[:, None], part.shape))
    for turn in (1, 9):
        met = np.bincount((place[:, turn] * 4).astype(int).reshape(-1, 2) @ [4, 1], minlength=16)
        # points of a cell go together: 4 of them as one, at the least
        assert ((met - met.mean()) ** 2 / met.mean()).sum() / 4 < chi2.ppf(1 - CERTAIN, 15)
    spread = place.prod(axis=-1).mean(axis=1).var(ddof=1)
    start = (np.arange(200) + 0.5) / 200
    x, y = ((start + np.arange(turns)[:, None] / 1.32471795724474602596**power) % 1 for power in (1, 2))  # g^3 = g + 1
    expected = (np.einsum("ti,tj->ij", x, y) / turns).var()
    apart = 7 / 144 / turns  # of independent turns
    evidence(f"mean of x y over {turns} turns: {spread / apart:.2f} of the variance of independent ones")
    assert spread == pytest.approx(expected, rel=0.1)  # of 6,400 values
    assert expected < 0.5 * apart


CASES = {"combined": ("cornell_box", {}, 0.7), "hemisphere": ("cornell_box", {"estimator": "hemisphere"}, 0.4),
         "light": ("cornell_box", {"estimator": "light"}, 0.75),
         "two bounces": ("cornell_box", {"estimator": "hemisphere", "bounces": 2}, 0.6),
         "lobes": (glossy_box(exponent=20.0), {"picks": 8, "directions": 8}, 0.65)}


@pytest.mark.slow("light", "lobes")
@pytest.mark.parametrize("case", list(CASES))
def test_sixteen_passes_of_a_series_are_better_than_independent_ones(case, evidence):
    """Variance of a pixel's mean over a series against that of as many independent passes, from 12 seeds."""
    given, options, most = CASES[case]
    frame = Frame(load_scene(given) if isinstance(given, str) else given, width=32, height=32)
    buffer = frame.gbuffer
    ids = buffer.triangle_id
    if case == "lobes":
        ids = glossy_triangles(frame.scene, buffer.position, buffer.normal, ids)
    prepare, once = (_with_lobes, lobe_pass) if case == "lobes" else (without_pilot, one_pass)
    tasks = [_guided(prepare(frame.scene, frame.tracer, buffer.position, buffer.normal, ids,
                             TruthSettings(seed=seed, **options))) for seed in range(12)]
    found = np.array([[once(task, SERIES * turn) for turn in range(16)] for task in tasks])
    together, apart = found.mean(axis=1).var(axis=0, ddof=1), found.var(axis=0, ddof=1).mean(axis=0) / 16
    usual = np.median((together / np.maximum(apart, 1e-30))[apart > 0])  # either side alone has rare large terms
    evidence(f"{case}: a series of 16 passes has {usual:.2f} of the variance of independent passes (median pixel)")
    assert usual < most

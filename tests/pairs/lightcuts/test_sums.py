"""Sums by lightcuts: never above their bound, the same bits for all threads, and what is refused."""

import itertools

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.jit import threads
from refgi.pairs.irradiance import Receivers, irradiance
from refgi.pairs.lightcuts.groups import LANES, group_receivers
from refgi.pairs.lightcuts.tree import FAN, level_starts, light_tree
from refgi.pairs.pair_sum import TILE
from refgi.pairs.pixel_lights import Unpacked, clustered, pack
from refgi.pairs.settings import Lightcuts, PairSettings, SphereClamp
from refgi.stages import observe
from tests.naive import lightcuts as naive
from tests.pairs.lightcuts.scenes import CLAMPS, GRID, scene
from tests.pairs.sets import unit

ROUNDING = {np.float32: 2e-5, np.float64: 1e-12}  # of the sum: terms near a light's plane, and 66 U
ERRORS = (0.001, 0.02, 0.3)


def off_by(got, full):
    """Return the largest error of a receiver's sum over channels, as a share of it."""
    full, got = full.astype(np.float64), got.astype(np.float64)
    total = full.sum(axis=0)
    off = np.abs(got - full).sum(axis=0)
    assert not off[total == 0].any()
    return float((off[total > 0] / total[total > 0]).max(initial=0.0))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize(("name", "clamp"), GRID)
def test_no_receiver_is_off_by_more(name, clamp, dtype):
    for number, (count, receivers) in enumerate(((7, 3), (300, 40), (2500, 700))):
        lights, area, points = scene(name, count, receivers, seed=number, dtype=dtype)
        pairs = PairSettings(clamp=CLAMPS[clamp])
        full = irradiance(points, lights, pairs, area)
        for error in ERRORS:
            assert off_by(irradiance(points, lights, pairs, area, Lightcuts(error)), full) <= error + ROUNDING[dtype]


def test_clusters_are_summed():
    """Far from the lights a few clusters do, at an error that is seen; near to what is asked nearly all lights do."""
    lights, _, points = scene("floor", 20000, 512, dtype=np.float64)
    points.position[1] += 3.0
    points.normal[:] = [[[0.0]], [[-1.0]], [[0.0]]]
    full = irradiance(points, lights, PairSettings(clamp=None))
    found = []
    for error in (1e-6, 1e-3, 0.1):
        with observe(counting=True) as log:
            got = irradiance(points, lights, PairSettings(clamp=None), None, Lightcuts(error))
        found.append((log.counts["pairs"], off_by(got, full)))
    (many, least), (some, little), (few, most) = found
    assert few <= some < many
    assert few < 0.03 * 20000 * 512
    assert least <= little <= most <= 0.1
    assert most > 1e-7


@pytest.mark.parametrize("name", ["cube", "corner", "colours"])
def test_the_cut_of_the_twin(name):
    """A receiver's own cut, refined node by node: its sum is within the error, and the kernels' is as well."""
    lights, area, points = scene(name, 200, 3, dtype=np.float64)
    packed = pack(lights, PairSettings(clamp=None), area, np.float64)
    tree = light_tree(packed.diffuse, None, 0.05)
    rows = [(row[:3].tolist(), row[3:6].tolist(), row[6:9].tolist(), 0.0) for row in tree.nodes[: tree.starts[1]]]

    def cluster(level, place):
        span = FAN**level
        children = [] if level == 0 else [cluster(level - 1, k) for k in range(
            FAN * place, min(FAN * place + FAN, int(tree.starts[level] - tree.starts[level - 1])))]
        return rows[place * span : (place + 1) * span], children

    top = len(tree.starts) - 2
    roots = [cluster(top, k) for k in range(int(tree.starts[top + 1] - tree.starts[top]))]
    got = irradiance(points, lights, PairSettings(clamp=None), None, Lightcuts(0.05))[:, 0]
    for lane in range(3):
        receiver = points.position[:, 0, lane].tolist(), points.normal[:, 0, lane].tolist()
        full = np.array(naive.irradiance(rows, receiver))
        found, nodes = naive.cut(roots, receiver, 0.05)
        assert nodes <= 200
        assert np.abs(np.array(found) - full).sum() <= 0.05 * full.sum() + 1e-12
        assert np.abs(got[:, lane] - full).sum() <= 0.05 * full.sum() + 1e-12


def test_halves_of_a_group_that_spent_its_error():
    """Many clusters that are accepted one by one may be off by more than all are allowed; halves then begin anew."""
    lights, area, points = scene("cube", 40000, 256)
    lights.position[:] *= 4.0
    lights.flux[:] = 1.0
    points.position[:] = 0.5 + np.array([0.08, 0.0, 0.08])[:, None, None] * points.position
    points.normal[:] = [[[0.0]], [[1.0]], [[0.0]]]
    pairs = PairSettings(clamp=CLAMPS["disc"])
    full = irradiance(points, lights, pairs, 0.1 * area)
    assert off_by(irradiance(points, lights, pairs, 0.1 * area, Lightcuts(0.05)), full) <= 0.05


def test_same_bits_for_all_threads_and_reruns():
    lights, area, points = scene("ball", 5000, 3000)
    found = []
    for count in (1, 2, 2):
        with threads(count):
            found.append(irradiance(points, lights, PairSettings(clamp=CLAMPS["disc"]), area, Lightcuts(0.02)))
    np.testing.assert_array_equal(found[0], found[1])
    np.testing.assert_array_equal(found[0], found[2])


@pytest.mark.parametrize("count", [1, 2, 4, 5, 16, 17, 63, 64, 65, 1000])
def test_the_tree(count):
    """Every light is a leaf once; each level has the flux of all lights, and its parts have that of theirs."""
    lights, area, _ = scene("colours", count, 1, dtype=np.float64)
    packed = pack(lights, PairSettings(clamp=CLAMPS["disc"]), area, np.float64)
    tree = light_tree(packed.diffuse, packed.clamp, 0.02)
    assert tree.starts.tolist() == level_starts(count).tolist()
    leaves = tree.nodes[:count]
    np.testing.assert_array_equal(leaves[np.lexsort(leaves[:, :3].T), :9],
                                  packed.diffuse[:, :-1].T[np.lexsort(packed.diffuse[:3, :-1])])
    for level in range(len(tree.starts) - 1):
        nodes = tree.nodes[tree.starts[level] : tree.starts[level + 1]]
        np.testing.assert_allclose(nodes[:, 6:9].sum(axis=0), packed.diffuse[6:].sum(axis=1), rtol=1e-12)
        weights = nodes[:, 6:9].sum(axis=1)
        total = packed.diffuse[6:, :-1].sum(axis=0)
        for row in range(6):
            np.testing.assert_allclose((weights * nodes[:, row]).sum(), (total * packed.diffuse[row, :-1]).sum(),
                                       rtol=1e-9, atol=1e-12)
    assert not tree.nodes[-1].any()


@pytest.mark.parametrize("unlike", [None, "area", "position", "normal"])
def test_lights_of_one_texel_are_one_leaf(unlike):
    """The tree has the flux of all, at as many places as there are; what is not alike at a texel stays apart."""
    pairs = PairSettings(clamp=CLAMPS["disc"])
    lights, area, points = scene("floor", 60, 50, dtype=np.float64)
    texel, index = np.random.default_rng(4).integers(0, 20, 60), np.arange(60) % 2
    _, first, of = np.unique(texel + 20 * index, return_index=True, return_inverse=True)
    lights = lights._replace(position=lights.position[:, first][:, of], normal=lights.normal[:, first][:, of],
                             texel=texel.astype(np.int32), map_index=index.astype(np.int32))
    area = area if unlike == "area" else area[first][of]
    last = np.flatnonzero(of == np.argmax(np.bincount(of)))[-1]  # of several at its texel
    if unlike == "position":
        lights.position[1, last] += 0.1
    if unlike == "normal":
        lights.normal[:, last] = unit(lights.normal[:, last] + np.array([0.3, 0.0, 0.0]))
    packed = clustered(Unpacked(lights, pairs, area, np.float64), 1e-6)
    assert packed.tree.starts[1] == (60 if unlike else len(first))
    np.testing.assert_allclose(packed.tree.nodes[: packed.tree.starts[1], 6:9].sum(axis=0),
                               lights.flux.sum(axis=1) / np.pi, rtol=ROUNDING[np.float64])
    full = irradiance(points, lights, pairs, area)
    assert off_by(irradiance(points, lights, pairs, area, Lightcuts(1e-6)), full) <= 1e-6


def test_clusters_are_compact():
    """Aligned runs of the order are patches: on a grid, those of 64 lights are little wider than 8 by 8."""
    side = 64
    lights, area, _ = scene("floor", side * side, 1)
    grid = np.stack(np.meshgrid(np.arange(side), np.arange(side))).reshape(2, -1) / side
    lights.position[0], lights.position[2] = grid
    packed = pack(lights, PairSettings(clamp=None), area, np.float32)
    tree = light_tree(packed.diffuse, None, 0.02)
    runs = tree.nodes[: side * side, [0, 2]].reshape(-1, 64, 2)
    assert (np.ptp(runs, axis=1).max(axis=1) <= 8 / side).mean() > 0.9


def test_groups():
    """Groups hold every receiver once, fit a tile and face one way; their parts begin at multiples of LANES."""
    _, _, points = scene("ball", 1, 10000)
    position, normal = points.position[:, 0], points.normal[:, 0]
    order, starts = group_receivers(position, normal)
    assert np.sort(order).tolist() == list(range(10000))
    assert starts[0] == 0
    assert starts[-1] == 10000
    sizes = np.diff(starts)
    assert sizes.min() > 0
    assert sizes.max() <= TILE
    for first, last in itertools.pairwise(starts):
        if last - first > LANES:
            assert np.ptp(normal[:, order[first:last]], axis=1).max() <= 0.31


def test_black_lights_and_none():
    lights, area, points = scene("cube", 10, 5)
    dark = lights._replace(flux=np.zeros((3, 10)))
    assert not irradiance(points, dark, PairSettings(clamp=None), area, Lightcuts()).any()
    turned = points._replace(normal=np.zeros_like(points.normal))
    assert not irradiance(turned, lights, PairSettings(clamp=None), area, Lightcuts()).any()


def test_receivers_without_surface():
    lights, area, points = scene("cube", 500, 64)
    covered = np.zeros((1, 64), np.bool_)
    covered[0, ::3] = True
    got = irradiance(Receivers(points.position, points.normal, covered), lights, PairSettings(clamp=None), area,
                     Lightcuts(0.01))
    full = irradiance(points, lights, PairSettings(clamp=None), area)
    assert not got[:, ~covered].any()
    assert off_by(got[:, covered], full[:, covered]) <= 0.01 + 2e-5


def test_lobes_are_summed_in_full():
    lights, _, points = scene("cube", 300, 50, dtype=np.float64)
    glossy = lights._replace(lobe_flux=lights.flux[::-1].copy(), lobe_axis=lights.normal,
                             lobe_exponent=np.full(300, 20.0))
    bare = glossy._replace(flux=np.zeros((3, 300)))
    pairs = PairSettings(clamp=None)
    lobes = irradiance(points, bare, pairs)
    np.testing.assert_array_equal(irradiance(points, bare, pairs, None, Lightcuts(0.3)), lobes)
    both = irradiance(points, glossy, pairs, None, Lightcuts(0.3))
    diffuse = irradiance(points, lights, pairs, None, Lightcuts(0.3))
    np.testing.assert_allclose(both, diffuse + lobes, rtol=1e-12)


def test_what_is_refused():
    lights, area, points = scene("cube", 10, 5)
    with pytest.raises(InputError, match="clamp"):
        irradiance(points, lights, PairSettings(clamp=SphereClamp()), area, Lightcuts())
    below = lights._replace(flux=-lights.flux)
    with pytest.raises(InputError, match=r"lights\.flux"):
        irradiance(points, below, PairSettings(clamp=None), area, Lightcuts())
    for error in (0.0, 1.5, np.nan):
        with pytest.raises(InputError, match="error"):
            Lightcuts(error)

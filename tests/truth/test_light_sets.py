"""Sets of light vertices, densities from the pilot: same expectation, same bits."""

import dataclasses

import numpy as np
import pytest
from scipy.stats import chi2

from refgi import jit
from refgi.frame import Frame
from refgi.rays import Tracer
from refgi.scene import DirectionalLight, Geometry, Material, PointLight, Scene, SpotLight, load_scene
from refgi.truth import TruthSettings, trace_truth
from refgi.truth.light_grid import cell_centres, density_of, light_rays, rays_through, stratified_sets, warp
from refgi.truth.light_pass import fresh_points, pick_points
from refgi.truth.light_side import TILE, tiles
from refgi.truth.light_vertices import BLOCK, LightVertices, PointSets
from refgi.truth.task import sets_of
from refgi.truth.truth import accumulate, task_of
from tests.truth.scenes import CAMERA, corner_room, floor, receivers_in_corner, rectangle, scene

SIGMAS = 4.0  # a mean of a few dozen passes lies outside once in some 5,000 runs
SPOT = SpotLight((0.5, 1.5, 0.6), (-0.6, -0.8, -0.7), 0.3, 0.6, (2.0, 1.5, 1.0))
SUN = DirectionalLight((-0.3, -1.0, -0.4), (0.5, 0.4, 0.3))
BUMP = np.exp(-((np.mgrid[:8, :8] - 3.0) ** 2).sum(axis=0) / 4)


def frame_task(frame, settings):
    buffer = frame.gbuffer
    return task_of(frame.scene, frame.tracer, buffer.position, buffer.normal, buffer.triangle_id, settings)


@pytest.fixture(scope="module")
def frame():
    return Frame(load_scene("cornell_box"), width=48, height=48)


def test_each_set_is_jittered_and_all_of_them_together_finer():
    n, side = 4, 3
    sets = stratified_sets(n, side, np.random.default_rng(3))
    assert sets.shape == (side * side, n * n, 2)
    for one in sets:
        assert len(np.unique(np.floor(one * n), axis=0)) == n * n
    assert len(np.unique(np.floor(sets.reshape(-1, 2) * n * side), axis=0)) == (n * side) ** 2
    assert np.array_equal(np.floor(sets[0] * n), np.floor(sets[5] * n))  # along one curve


def test_every_point_of_a_set_is_uniform_in_its_cell():
    places = np.array([stratified_sets(2, 2, np.random.default_rng(k))[1] * 2 % 1 for k in range(4000)])
    counts = np.stack([np.bincount((places[:, i] * 4).astype(int) @ [4, 1], minlength=16) for i in range(4)])
    chi2 = ((counts - 250) ** 2 / 250).sum(axis=1)
    assert (chi2 < 44).all()  # 15 degrees of freedom: beyond 44 once in 10,000


@pytest.mark.slow
def test_points_follow_the_density():
    density = density_of(BUMP, 0.3)
    points, weight = warp(density, stratified_sets(512, 1, np.random.default_rng(6))[0])
    found = np.histogram2d(*points.T, bins=8, range=((0, 1), (0, 1)))[0] / len(points)
    expected = 0.7 * BUMP / BUMP.sum() + 0.3 / 64
    assert found == pytest.approx(expected, rel=0.03)  # jittered: a cell of 1,000 points or more
    cell = np.floor(points * 8).astype(int)
    assert weight == pytest.approx(1 / (64 * expected[cell[:, 0], cell[:, 1]]), rel=1e-12)
    assert weight.max() <= 1 / 0.3
    assert weight.mean() == pytest.approx(1, rel=2e-3)


def test_a_density_without_contributions_is_even():
    points, weight = warp(density_of(np.zeros((8, 8)), 0.3), cell_centres(64))
    assert points == pytest.approx(cell_centres(64), abs=1e-12)
    assert weight == pytest.approx(1, rel=1e-12)
    assert (warp(density_of(BUMP, 0.1), np.array([[0.0, 0.0], [1 - 2.0**-53, 1 - 2.0**-53]]))[0] < 1).all()


@pytest.mark.parametrize("light", [SPOT, PointLight((0.1, 0.2, 0.3), (1, 1, 1)), SUN])
def test_weights_make_up_for_the_density(light):
    """The integral of a smooth function of direction or start is the same with and without density."""
    geometry = corner_room(SPOT).geometry
    square = stratified_sets(512, 1, np.random.default_rng(6))[0]

    def integral(density):
        rays = rays_through(light, geometry, square, len(square), density)
        value = np.exp(rays.directions @ [0.3, -0.5, 0.8] + 0.2 * rays.origins @ [0.4, 0.1, -0.6])
        return (value * rays.weight).sum() * rays.measure

    even = light_rays(light, geometry, np.full((512 * 512, 2), 0.5))
    assert (even.weight == 1).all()
    assert integral(density_of(BUMP, 0.25)) == pytest.approx(integral(None), rel=1e-3)


def test_neighbouring_pixels_take_turns():
    sets = sets_of(np.arange(60), 10, 4).reshape(6, 10)  # a width that 4 does not divide
    assert sets[:2].tolist() == [[0, 1, 2, 3, 0, 1, 2, 3, 0, 1], [4, 5, 6, 7, 4, 5, 6, 7, 4, 5]]
    assert np.array_equal(sets[:2], sets[4:])
    assert len(np.unique(sets[1:5, 3:7])) == 16


def test_tiles_hold_every_receiver_once_and_one_set_each():
    set_of = np.random.default_rng(1).integers(0, 3, 2000)
    members, table = tiles(set_of, 100, 1900)
    assert np.array_equal(np.sort(members), np.arange(100, 1900))
    assert np.array_equal(table[1:, 0], table[:-1, 1])
    assert (table[0, 0], table[-1, 1]) == (0, 1800)
    for low, high, number in table:
        assert 0 < high - low <= TILE
        assert (set_of[members[low:high]] == number).all()


def test_sets_hold_diffuse_parts_in_whole_blocks():
    """Lobes of senders come by cells of light."""
    glossy = Material("glossy", (0.2, 0.2, 0.2), (0.5, 0.4, 0.3), 20.0)
    room = corner_room(SPOT, SUN, material=glossy)
    x, n, triangles = receivers_in_corner()
    task = task_of(room, Tracer(room.geometry), x.T.reshape(3, 1, -1), n.T.reshape(3, 1, -1),
                   triangles.reshape(1, -1).astype(np.int32), TruthSettings(light_grid=8, interleave=2))
    points, starts = fresh_points(task, np.random.default_rng(4))
    assert task.cells is not None
    assert starts.shape == (4, 2)
    assert np.array_equal(starts[1:, 0], starts[:-1, 1])
    assert starts[-1, 1] * BLOCK == len(points.power)
    rays = []
    for first, last in starts * BLOCK:
        lit = points.power[first:last] > 0
        assert lit.sum() > BLOCK / 2
        rays.append(points.ray[first:last][lit])
    assert len(np.unique(np.concatenate(rays))) == sum(map(len, rays))
    assert all(set(found % 256 // 64) == {number} for number, found in enumerate(rays))


VARIANTS = ({"interleave": 1, "uniform_share": 1.0}, {"interleave": 4, "uniform_share": 0.1}, {"interleave": 3})


@pytest.mark.feature("REF-03")
@pytest.mark.slow("spot")
@pytest.mark.parametrize("lights", ["spot", pytest.param("several", marks=pytest.mark.slow)])
def test_sets_and_densities_change_no_expectation(lights, evidence):
    """Against one set of even rays, the estimator without both: pixel by pixel and for the picture."""
    glossy = Material("glossy", (0.3, 0.3, 0.3), (0.3, 0.2, 0.1), 15.0)
    room = corner_room(*((SPOT,) if lights == "spot" else (SPOT, SUN, PointLight((-0.6, 0.9, -0.5), (0.1, 0.2, 0.4)))),
                       material=glossy)
    points, normals, triangles = receivers_in_corner(8)
    place, up = (np.repeat(a.T.reshape(3, -1, 1), 8, axis=2) for a in (points, normals))
    ids = np.repeat(triangles.reshape(-1, 1), 8, axis=1).astype(np.int32)
    results = [accumulate(room, Tracer(room.geometry), place, up, ids,
                          TruthSettings(estimator="light", samples=16 * 100, light_grid=16, seed=k, **variant))
               for k, variant in enumerate(VARIANTS)]
    worst = 0.0
    for other in results[1:]:
        z = np.abs(other.mean.mean(axis=2) - results[0].mean.mean(axis=2)) / np.sqrt(
            # pixels of a row are equal but not independent: the mean's variance is at most that of one
            other.variance_of_mean.mean(axis=2) + results[0].variance_of_mean.mean(axis=2))
        picture = np.abs(other.picture_mean - results[0].picture_mean) / np.sqrt(
            other.picture_variance + results[0].picture_variance)
        worst = max(worst, z.max(), picture.max())
    assert worst < SIGMAS
    evidence(f"{lights}: variants differ by at most {worst:.1f} standard errors")


FACES, POLYHEDRON = 20_000, 1.2e-3  # the polyhedron lies inside the sphere: E grows by about 20 / faces


@pytest.mark.parametrize("share", [0.1, 0.5])
def test_the_part_of_a_sphere_that_is_lit_off_centre(share, evidence):
    """E = rho Phi / (4 pi R^2) at every point of a sphere, wherever the lamp and the receivers are."""
    found = load_scene(f"integrating_sphere:faces={FACES},albedo=0.5")
    flat = Geometry(found.geometry.vertices, found.geometry.faces, found.geometry.material_of_face)
    light = PointLight((0.3, -0.2, 0.4), (0.8, 1.6, 0.4))
    sphere = Scene("sphere", flat, found.materials, CAMERA, (light,))
    chosen = np.linspace(0, 2000, 400).astype(int).reshape(20, 20)  # on one side: the pilot sends rays its way
    points = flat.vertices[flat.faces[chosen]].mean(axis=2)
    up = -points / np.linalg.norm(points, axis=2, keepdims=True)
    result = accumulate(sphere, Tracer(flat), np.moveaxis(points, 2, 0), np.moveaxis(up, 2, 0),
                        chosen.astype(np.int32), TruthSettings(samples=24 * 30, uniform_share=share))
    expected = 0.5 * np.array(light.intensity)
    error = np.abs(result.picture_mean / expected - 1)
    assert (error < POLYHEDRON + SIGMAS * np.sqrt(result.picture_variance) / expected).all()
    assert result.picture_error < 1e-3
    evidence(f"uniform share {share}: off by {error.max():.1e}, stated {result.picture_error:.1e}")


def test_the_pilot_sends_rays_where_they_light_the_picture():
    """A wall between two rooms: the half of the light's cone that shines into the unseen room gets fewer rays."""
    white = Material("white", (0.7, 0.7, 0.7))
    wall = rectangle((0, 0, 3), (0, 0, -6), (0, 4, 0), white)
    room = scene([rectangle((-3, 0, 3), (6, 0, 0), (0, 0, -6), white), wall],
                 PointLight((0.0, 5.0, 0.0), (1.0, 1.0, 1.0)))
    x = np.stack([np.linspace(0.3, 2.5, 64), np.full(64, 1.0), np.linspace(-1, 1, 64)]).reshape(3, 8, 8)
    up = np.broadcast_to(np.reshape((0.0, -1.0, 0.0), (3, 1, 1)), x.shape)  # they look down on the floor
    task = task_of(room, Tracer(room.geometry), x, up, np.zeros((8, 8), np.int32), TruthSettings())
    rays = rays_through(room.lights[0], room.geometry, stratified_sets(64, 1, np.random.default_rng(0))[0], 4096,
                        task.densities[0])
    below = rays.directions[:, 1] < -0.75
    seen = rays.directions[:, 0] > 0
    assert (below & seen).sum() > 1.8 * (below & ~seen).sum()
    assert task_of(room, Tracer(room.geometry), x, up, np.zeros((8, 8), np.int32),
                   TruthSettings(uniform_share=1.0)).densities == ()


def test_same_bits_for_threads_and_batches_with_many_sets(frame):
    settings = TruthSettings(samples=48, interleave=5)
    first = trace_truth(frame, settings)
    for threads, batch in ((1, 1 << 18), (2, 1001), (1, 117)):
        with jit.threads(threads):
            again = trace_truth(frame, dataclasses.replace(settings, batch=batch))
        assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(first, again, strict=True))


PICKS = 16
ROUNDING = 1e-4  # of a pick: float32 terms against float64, a few ULP of the total


def terms_of(points, receivers):
    """Return p min(G, b) of each sender (columns) at each receiver (rows), by NumPy in float64."""
    position, axis, to, up = (np.asarray(a, np.float64) for a in (
        points.position, points.axis, receivers.position, receivers.normal))
    d = position[:, None, :] - to[:, :, None]
    square = (d**2).sum(axis=0)
    leaving, arriving = -(axis[:, None, :] * d).sum(axis=0), (up[:, :, None] * d).sum(axis=0)
    geometry = np.maximum(leaving, 0) * np.maximum(arriving, 0) / square**2
    return points.power * np.minimum(geometry, points.bound)


def test_picks_are_spaced_evenly_over_the_terms(frame, evidence):
    """Oracle: of any run of senders from the first on a receiver picks its share of 16, to less than one."""
    task = frame_task(frame, TruthSettings())
    sets, count = fresh_points(task, np.random.default_rng(3)), 400
    rays, picked = pick_points(task, sets, (0, count), PICKS, 5)
    off, error = 0.0, 0.0
    for number in range(16):
        low, high = BLOCK * sets.starts[number]
        mine = np.flatnonzero(task.set_of[:count] == number)
        terms = terms_of(type(sets.points)(*(field[..., low:high] for field in sets.points)),
                         type(task.receivers)(*(field[..., mine] for field in task.receivers)))
        total = terms.sum(axis=1)
        chosen = picked.reshape(count, PICKS)[mine] - low
        met = np.stack([np.bincount(row, minlength=high - low).cumsum() for row in chosen])
        off = max(off, np.abs(met - PICKS * terms.cumsum(axis=1) / total[:, None]).max())
        share = rays.contribution.reshape(count, PICKS, 3)[mine] / sets.points.colour.T[chosen + low]
        error = max(error, np.nanmax(np.abs(share * PICKS / total[:, None, None] - 1)))
    evidence(f"picks of runs of senders are at most {off:.4f} off their share; totals {error:.1e}")
    assert off < 1 + ROUNDING
    assert error < 1e-5


def test_picks_of_many_passes_follow_the_terms(frame):
    """Chi-square of the first receiver's picks over 512 shifts, in runs of senders of about a sixteenth each."""
    task, shifts = frame_task(frame, TruthSettings()), 512
    sets = fresh_points(task, np.random.default_rng(4))
    low, high = BLOCK * sets.starts[task.set_of[0]]
    terms = terms_of(type(sets.points)(*(field[..., low:high] for field in sets.points)),
                     type(task.receivers)(*(field[..., :1] for field in task.receivers)))
    share = terms[0].cumsum() / terms[0].sum()
    run = np.minimum((share * 61).astype(int), 60)  # runs that the spacing of the picks does not fit
    expected = np.bincount(run, terms[0] / terms[0].sum(), 61)
    one = np.concatenate([pick_points(task, sets, (0, 1), 1, seed)[1] for seed in range(shifts)]) - low
    met = np.bincount(run[one], minlength=61)
    kept = expected > 0
    statistic = ((met - shifts * expected)[kept] ** 2 / (shifts * expected[kept])).sum()
    assert chi2.ppf(1e-4, kept.sum() - 1) < statistic < chi2.ppf(1 - 1e-4, kept.sum() - 1)


def test_each_of_equal_senders_is_picked_once_the_last_one_too():
    """A whole block of senders in one place, as many picks."""
    down, place = (np.repeat(np.array([[0.0], [y], [0.0]], np.float32), BLOCK, axis=1) for y in (-1.0, 2.0))
    ones = np.ones(BLOCK, np.float32)
    points = LightVertices(place, down, down, down, ones, np.ones((3, BLOCK), np.float32), ones, ones,
                           np.full(BLOCK, np.inf, np.float32), np.zeros(BLOCK, np.int32))
    room = scene([floor()], SPOT)
    task = task_of(room, Tracer(room.geometry), np.zeros((3, 1, 1)), np.array([0.0, 1, 0]).reshape(3, 1, 1),
                   np.zeros((1, 1), np.int32), TruthSettings())
    _, picked = pick_points(task, PointSets(points, np.array([[0, 1]])), (0, 1), BLOCK, 1)
    assert sorted(picked) == list(range(BLOCK))


def test_many_weak_senders_behind_a_strong_one_are_not_lost_to_rounding():
    """A strong sender and 2^15 of 2e-8 of it, each less than half a ULP of the sum: 6.6e-4 together."""
    weak, count = 2e-8, 1 << 15
    power = np.full(count, weak, np.float32)
    power[0] = 1
    down, place = (np.repeat(np.array([[0.0], [y], [0.0]], np.float32), count, axis=1) for y in (-1.0, 2.0))
    points = LightVertices(place, down, down, down, power, np.ones((3, count), np.float32), np.ones(count, np.float32),
                           np.ones(count, np.float32), np.full(count, np.inf, np.float32), np.zeros(count, np.int32))
    room = scene([floor()], SPOT)
    task = task_of(room, Tracer(room.geometry), np.zeros((3, 1, 1)), np.array([0.0, 1, 0]).reshape(3, 1, 1),
                   np.zeros((1, 1), np.int32), TruthSettings())
    rays, _ = pick_points(task, PointSets(points, np.array([[0, count // BLOCK]])), (0, 1), PICKS, 1)
    total = (1 + (count - 1) * weak) / 4  # G = 1 / r^2
    assert rays.contribution[:, 0] * PICKS == pytest.approx(total, rel=1e-6)

"""Cells of light: maps of a light's directions, chances of cells, and contributions that lobes cannot raise."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2

from refgi.frame import Frame
from refgi.rays import MISS, Tracer
from refgi.scene import DirectionalLight, Material, PointLight, SpotLight, load_scene
from refgi.truth import TruthSettings, trace_truth
from refgi.truth import lobe_cells as lobe_cells_module
from refgi.truth.cell_densities import even_density, image_of, receiver_at
from refgi.truth.cell_pass import beside_of
from refgi.truth.cell_rays import pick_cells, picks_for
from refgi.truth.cell_walk import fill_tops, found_up
from refgi.truth.light_grid import LightRays, fill_rays, light_squares, place_of
from refgi.truth.light_vertices import closest_of
from refgi.truth.lobe_cells import _guard, cell_at, glossy_triangles
from refgi.truth.lobe_tree import Lobe
from refgi.truth.passes import one_pass
from refgi.truth.task import spans
from refgi.truth.truth import _guided, _with_lobes, task_of
from tests.truth.glossy_scenes import SCENES, frame
from tests.truth.scenes import rectangle
from tests.truth.scenes import scene as by_hand

LIGHTS = {"spot": SpotLight((0.1, 0.5, 0.2), (0.3, -1.0, 0.1), 0.4, 0.7, (2.0, 1.0, 1.0)),
          "wide spot": SpotLight((0.1, 0.5, 0.2), (0.0, -1.0, 0.0), 1.5, math.pi / 2, (2.0, 1.0, 1.0)),
          "point": PointLight((0.1, 0.5, 0.2), (1.0, 1.0, 1.0)), "sun": DirectionalLight((-0.3, -1.0, -0.4), (1, 1, 1))}
CERTAIN = 1e-5  # chance of a false alarm


def shiny(scene, exponent, *lights):
    """Return a scene of which every material has a lobe."""
    materials = tuple(dataclasses.replace(material, specular=(0.4,) * 3, exponent=exponent,
                                          diffuse=tuple(0.5 * c for c in material.diffuse))
                      for material in scene.materials)
    return dataclasses.replace(scene, materials=materials, lights=lights or scene.lights)


def task_for(scene, size=12, *, lobes=False, **settings):
    frame = Frame(scene, width=size, height=size)
    buffer, chosen = frame.gbuffer, TruthSettings(**settings)
    if not lobes:
        return task_of(scene, frame.tracer, buffer.position, buffer.normal, buffer.triangle_id, chosen)
    glossy = glossy_triangles(scene, buffer.position, buffer.normal, buffer.triangle_id)
    return _guided(_with_lobes(scene, frame.tracer, buffer.position, buffer.normal, glossy, chosen))


def rays_of(light, points):
    squares = light_squares((light,), load_scene("cornell_box").geometry)
    origins, directions = np.empty((len(points), 3)), np.empty((len(points), 3))
    fill_rays(squares, 0, points, origins, directions)
    return squares, origins, directions


@pytest.mark.parametrize("light", LIGHTS)
def test_a_point_on_a_ray_has_the_ray_s_place(light):
    points = np.random.default_rng(1).random((2000, 2))
    squares, origins, directions = rays_of(LIGHTS[light], points)
    found = np.array([place_of(squares, 0, tuple(at)) for at in origins + 0.7 * directions])
    np.testing.assert_allclose(found, points, atol=1e-11)


@pytest.mark.parametrize("light", ["spot", "wide spot", "point"])
def test_equal_parts_of_the_square_are_equal_solid_angles(light):
    """Uniform places: 1 - cos to the axis is uniform, as is the turn around it."""
    lamp, points = LIGHTS[light], np.random.default_rng(2).random((40000, 2))
    squares, _, directions = rays_of(lamp, points)
    axis = np.asarray(lamp.direction) / np.linalg.norm(lamp.direction) if light != "point" else np.array([0.0, 0, 1])
    gap = 1 - directions @ axis
    assert gap.max() <= squares.height[0] * (1 + 1e-12)
    counts = np.histogram(gap, bins=20, range=(0, squares.height[0]))[0]
    assert ((counts - 2000) ** 2 / 2000).sum() < chi2.isf(CERTAIN, 19)
    across = np.cross(axis, (0.3, 0.5, 0.9))
    across /= np.linalg.norm(across)
    turn = np.arctan2(directions @ np.cross(axis, across), directions @ across)
    counts = np.histogram(turn, bins=20, range=(-math.pi, math.pi))[0]
    assert ((counts - 2000) ** 2 / 2000).sum() < chi2.isf(CERTAIN, 19)


def light_of(cells):
    """Return which light each node belongs to; node k is the root of light k."""
    light = np.full(len(cells.child), -1)
    for k in range(len(cells.squares.kind)):
        below = np.array([k])
        while len(below):
            light[below] = k
            below = (cells.child[below[cells.child[below] >= 0], None] + np.arange(4)).ravel()
    return light


@pytest.mark.parametrize(("lamps", "lobes"), [
    (("point",), False), (("spot", "sun", "point"), False), (("spot",), True)])
def test_rays_fall_as_densely_as_their_weights_say(lamps, lobes, evidence):
    """n_b integrates to the picks, and picks of many passes fall into 8 x 8 parts of each square as it says."""
    scene = shiny(load_scene("cornell_box"), 60.0, *(LIGHTS[lamp] for lamp in lamps))
    task = task_for(scene, lobes=lobes, estimator="light")
    r, picks, cells = len(task.receivers.pixel) // 3, task.counts.cells, task.cells
    beside, to = beside_of(task, r), receiver_at(task.receivers, task.lobes, r)
    found, sums = np.empty(len(cells.tree.top), np.float32), np.empty(len(cells.tree.top) + 1)
    fill_tops(cells.tree, to, found, sums)
    grid, leaf = 8, np.flatnonzero(cells.child < 0)
    corner, light = cells.corner[leaf], light_of(cells)[leaf]
    chance = np.array([found_up(cells, at, to, sums).chance for at in leaf])
    assert chance.sum() == pytest.approx(1, abs=1e-6)
    rays_in = [even_density(cells, k, at, p, picks) * cells.squares.measure[k] * 0.25**level
               for k, at, p, level in zip(light, leaf, chance, corner[:, 2], strict=True)]
    assert np.sum(rays_in) == pytest.approx(picks, rel=1e-6)
    assert corner[:, 2].min() >= math.log2(grid)  # no leaf is larger than a part
    row, column = (corner[:, :2] >> (corner[:, 2:] - int(math.log2(grid)))).T
    expected = np.bincount((light * grid + row) * grid + column, rays_in, len(lamps) * grid * grid)
    expected = expected.reshape(len(lamps), -1)
    passes, got = 400, np.zeros((len(lamps), grid * grid))
    for seed in range(passes):
        rays = picks_for(picks)
        pick_cells(beside, (r, r + 1), seed, task.tracer.grain, rays)
        assert (rays.paths.reach > 0).all()
        for k, start, way in zip(rays.light, rays.paths.origin, rays.paths.direction, strict=True):
            a, b = place_of(cells.squares, k, tuple(start.astype(float) + 0.3 * way))
            got[k, int(a * grid) * grid + int(b * grid)] += 1
    expected = expected * passes
    off = np.abs(got - expected) / np.sqrt(expected + (0.05 * expected) ** 2 + 1)
    evidence(f"{len(lamps)} lamps: parts off by {off.max():.1f} at most")
    assert off.max() < 5


def test_images_are_aimed_at_as_their_density_says(evidence):
    """D = s c^(s - 1) / (2 pi), c the cosine from a light's image: c^s is even in 0 to 1, -s ln c has a mean of 1."""
    task = task_for(shiny(load_scene("cornell_box"), 20.0, LIGHTS["spot"]), lobes=True)
    r, first, passes = 53, task.counts.cells, 5000  # a receiver whose images stand high above its horizon
    beside, count, logs, exponents = beside_of(task, r), first + task.counts.mirrors, [], []
    rays = picks_for(count)
    for seed in range(passes):
        pick_cells(beside, (r, r + 1), seed, task.tracer.grain, rays)
        for ray in first + np.flatnonzero(rays.paths.reach[first:] > 0):
            image, s = image_of(task.cells, rays.light[ray], rays.mirror[ray], tuple(task.receivers.position[:, r]))
            logs.append(-s * np.log(image @ rays.paths.direction[ray]))
            exponents.append(s)
    assert len(logs) > 0.999 * passes * task.counts.mirrors
    assert np.mean(2 / np.array(exponents)) > 5 / math.sqrt(len(logs))  # what an exponent off by 2 moves the mean by
    evidence(f"mean of {len(logs)} rays: {np.mean(logs):.3f}")
    assert np.mean(logs) == pytest.approx(1, abs=4 / math.sqrt(len(logs)))


def glossy_task(name):
    scene, buffer = frame(name).scene, frame(name).gbuffer
    return task_of(scene, frame(name).tracer, buffer.position, buffer.normal, buffer.triangle_id, TruthSettings())


@pytest.mark.parametrize("name", [name for name in SCENES if name != "diffuse"])
def test_no_lobe_is_lit_outside_the_cells_that_picks_draw(name):
    """Light through points of faces with lobes, those at their edges among them, lies in a cell that has a chance."""
    task, geometry = glossy_task(name), frame(name).scene.geometry
    has_lobe = task.surfaces.specular.any(axis=1)[geometry.material_of_face]
    random, count = np.random.default_rng(5), 4000
    corners = geometry.vertices[geometry.faces[random.choice(np.flatnonzero(has_lobe), count)]]
    points = (corners * random.dirichlet((0.5, 0.5, 0.5), count)[..., None]).sum(axis=1)
    for k in range(len(task.scene.lights)):
        places = np.array([place for place in (place_of(task.cells.squares, k, tuple(at)) for at in points)
                           if place[0] >= 0])
        origins, directions = np.empty((2, len(places), 3))
        fill_rays(task.cells.squares, k, places, origins, directions)
        triangle, _ = closest_of(task.tracer, LightRays(origins, directions, 1.0, np.ones(len(places))))
        lit = (triangle != MISS) & has_lobe[triangle]
        ranks = [task.cells.rank[cell_at(task.cells.child, k, *place)] for place in places[lit]]
        assert len(ranks) > 100
        assert min(ranks) >= 0


@pytest.mark.parametrize("name", ["corner", "sun_on_blocks"])
def test_dark_cells_beside_lit_ones_are_a_tenth_as_bright(name, monkeypatch):
    """Oracle: all pairs of cells of a light whose squares touch; together they send a quarter of the rest at most."""
    found = glossy_task(name).cells
    monkeypatch.setattr(lobe_cells_module, "GUARD", 0.0)
    bare, leaf = glossy_task(name).cells, np.flatnonzero(found.child < 0)
    side, light = 0.25 ** found.corner[leaf, 2], light_of(found)[leaf]
    power, lit = (np.where(cells.rank[leaf] >= 0, cells.tree.row[cells.tree.single[cells.rank[leaf]], 8], 0.0)
                  for cells in (found, bare))
    unit = 2.0 ** -found.corner[leaf, 2, None]
    low = found.corner[leaf, :2] * unit
    expected = np.zeros(len(leaf))
    for at in np.flatnonzero(lit == 0):
        touching = ((low <= low[at] + unit[at]) & (low + unit >= low[at])).all(axis=1) & (light == light[at])
        expected[at] = 0.1 * side[at] * (lit / side)[touching].max()
    expected *= min(1.0, 0.25 * lit.sum() / expected.sum())
    assert (expected > 0).sum() > 100
    np.testing.assert_allclose(power, np.where(lit > 0, lit, expected), rtol=1e-5)


def test_dark_cells_hold_a_copy_and_at_most_a_quarter_of_the_light():
    """Four cells, the first of them four again, of which the one in the middle of the square is lit."""
    child = np.array([1, 5, *[-1] * 7], np.int32)
    corner = np.array([(0, 0, 0), *((i, j, level) for level in (1, 2) for i in (0, 1) for j in (0, 1))])
    lobes = Lobe.dark(9)
    for number, field in enumerate(lobes):
        field[8] = number + 1.0
    _guard(child, corner, np.zeros(9, np.int64), lobes)
    _guard(child[:1], corner[:1], np.zeros(1, np.int64), Lobe.dark(1))  # nothing is lit: no warning of NumPy
    shares = np.array([4.0, 4.0, 4.0, 1.0, 1.0, 1.0])  # of areas
    np.testing.assert_allclose(lobes.power[2:8], 0.25 * lobes.power[8] * shares / shares.sum())
    assert not lobes.power[:2].any()
    for number, field in enumerate(lobes._replace(power=np.full(9, lobes._fields.index("power") + 1.0))):
        np.testing.assert_array_equal(field[2:], number + 1.0)


def test_cells_are_split_where_mirrors_bend():
    flat, bent = (task_for(shiny(load_scene(scene), 400.0)).cells for scene in
                  ("cornell_box", "cornell_sphere:faces=320"))
    deepest = {tuple(corner[2:]) for corner in bent.corner}
    assert max(deepest) > max({tuple(corner[2:]) for corner in flat.corner})
    assert len(np.unique(flat.tree.plane[:, 0])) < 200  # walls and sides of blocks, not single cells


@pytest.mark.slow("1.0-0.3", "20.0-0.005", "200.0-0.3", "900.0-0.3", "10000.0-0.005", "29999.0-0.005")
@pytest.mark.parametrize("distance", [0.005, 0.3])
@pytest.mark.parametrize("exponent", [1.0, 20.0, 200.0, 900.0, 1e4, 29999.0])
def test_no_exponent_makes_a_pass_burst(exponent, distance, evidence):
    """A floor before a wall with a lobe: a pass of a pixel never brings more than a few times its mean."""
    wall = rectangle((0, 0, -1), (0, 2, 0), (0, 0, 2), Material("wall", (0.0,) * 3, (0.8,) * 3, exponent))
    floor = rectangle((distance, 0, -0.5), (0, 0, 1), (0.4, 0, 0), Material("floor", (0.5,) * 3))
    seen = by_hand([wall, floor], PointLight((1.0, 1.0, 0.0), (3.0, 2.0, 1.0)))
    task = Tracer(seen.geometry)
    places = np.random.default_rng(4).random((64, 2)) * (0.02, 0.4) + (distance, -0.2)
    position = np.stack([places[:, 0], np.zeros(64), places[:, 1]]).reshape(3, 8, 8)
    normal = np.broadcast_to(np.array([0.0, 1.0, 0.0])[:, None, None], (3, 8, 8)).copy()
    found = task_of(seen, task, position.astype(np.float32), normal.astype(np.float32), np.full((8, 8), 2, np.int32),
                    TruthSettings())
    passes = np.array([one_pass(found, number)[0] for number in range(40)])
    mean = passes.mean(axis=0)
    worst = float((passes / mean).max())
    evidence(f"P = {exponent:g} at {distance} m: {worst:.1f} times the mean of a pixel")
    assert (mean > 0).all()
    assert worst < 12
    # the image of the lamp, of full reflectance, bounds what a sharp lobe sends
    image = 0.8 * 3.0 * 1.0 / ((places[:, 0] + 1.0) ** 2 + 1.0 + places[:, 1] ** 2) ** 1.5
    if exponent >= 900:
        np.testing.assert_allclose(mean.mean(), image.mean(), rtol=0.05)


def test_without_lobes_nothing_is_cut_into_cells():
    assert task_for(load_scene("cornell_box")).cells is None
    assert task_for(shiny(load_scene("cornell_box"), 20.0), estimator="hemisphere").cells is None


def test_the_same_bits_for_any_batch():
    scene = shiny(load_scene("cornell_box"), 200.0)
    frame = Frame(scene, width=16, height=12)
    results = [trace_truth(frame, TruthSettings(samples=48, batch=batch)).mean for batch in (1 << 18, 500)]
    np.testing.assert_array_equal(*results)


@pytest.mark.parametrize("count", [0, 1, 7, 8, 9, 16, 17])
@pytest.mark.parametrize(("batch", "per_receiver", "most"), [(32, 4, 8), (35, 4, 8), (3, 4, 1)])
def test_each_receiver_is_in_one_span(count, batch, per_receiver, most):
    task = SimpleNamespace(settings=SimpleNamespace(batch=batch), receivers=SimpleNamespace(pixel=np.zeros(count)))
    found = spans(task, per_receiver)
    assert [k for first, end in found for k in range(first, end)] == list(range(count))
    assert all(0 < end - first <= most for first, end in found)
    assert len(found) == -(-count // most)

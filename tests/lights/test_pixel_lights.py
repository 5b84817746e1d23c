"""Pixel lights: which texels, the weight T/N, footprints that keep the flux, several lights."""

import math

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.lights import Warp, choose_pixel_lights, importance
from refgi.lights.shares import cells_of_nearest, map_shares
from refgi.literal.lights import grid_points, halton_points, pixel_lights, texels
from refgi.rsm import reflective_shadow_map
from refgi.scene import Material, PointLight, SpotLight, load_scene, material_table
from refgi.stages import observe
from tests.naive import pixel_lights as naive
from tests.rsm.shapes import geometry, sphere

ROUNDING = 1e-12  # float64 sums of thousands of fluxes
GLOSSY = Material(diffuse=(0.1, 0.2, 0.3), specular=(0.3, 0.4, 0.5), exponent=20.0)


def box_map(resolution=24, dtype=np.float64, **changes):
    box = load_scene("cornell_box")
    light = box.lights[0]
    for key, value in changes.items():
        light = light.__class__(**{**light.__dict__, key: value})
    return reflective_shadow_map(box.geometry, material_table(box.materials, dtype), light, resolution, dtype)


def cube_map(resolution=10):
    box = load_scene("cornell_box")
    light = PointLight(box.lights[0].position, (1.0, 2.0, 3.0))
    materials = material_table(box.materials, np.float64)
    return reflective_shadow_map(box.geometry, materials, light, resolution, np.float64)


def with_flux(rsm, flux):
    return rsm._replace(flux=rsm.flux * (flux / rsm.flux.sum()))


@pytest.mark.feature("SII-13")
@pytest.mark.parametrize(("pattern", "count"), [("grid", 25), ("grid", 49), ("halton", 50), ("halton", 700)])
def test_lights_equal_those_of_the_literal_text(pattern, count, evidence):
    rsm = box_map()
    points = grid_points(math.isqrt(count)) if pattern == "grid" else halton_points([count], np.zeros((1, 2)), 0)
    texel, weight = texels(points, [count], 0, 1, 24, 24)
    p, m, phi, *_ = pixel_lights([texel], [weight], [rsm.position], [rsm.normal], [rsm.flux])
    lights = choose_pixel_lights([rsm], count=count, pattern=pattern)
    assert lights.drawn == count
    np.testing.assert_allclose(lights.flux, phi, rtol=ROUNDING)
    np.testing.assert_array_equal(lights.position, p)
    np.testing.assert_array_equal(lights.normal, m)
    evidence(f"{pattern} N={count}: {phi.shape[1]} lights with flux, weights T/N")


@pytest.mark.feature("SII-13")
def test_the_mean_over_draws_is_the_maps_flux_for_every_count(evidence):
    rsm = box_map()
    total = rsm.flux.sum(axis=(1, 2))
    for count in (1, 7, 64, 1000):
        sums = np.array([choose_pixel_lights([rsm], count=count, pattern="random", seed=seed).flux.sum(axis=1)
                         for seed in range(400)])  # fmt: skip
        error = sums.mean(axis=0) - total
        standard = sums.std(axis=0, ddof=1) / 20
        z = np.abs(error / standard).max()
        assert z < 4
        evidence(f"N={count}: mean of 400 draws {z:.1f} standard errors off")


def test_all_texels_have_weight_one():
    rsm = box_map()
    lights = choose_pixel_lights([rsm], count=None, pattern="all")
    bright = rsm.flux.any(axis=0)
    np.testing.assert_array_equal(lights.flux, rsm.flux[:, bright])
    np.testing.assert_array_equal(lights.position, rsm.position[:, bright])
    assert lights.drawn == rsm.texels == 576
    assert 0 < lights.flux.shape[1] < 576


@pytest.mark.feature("SII-03")
@pytest.mark.parametrize("pattern", ["grid", "halton", "random"])
@pytest.mark.parametrize("source", ["spot", "cube"])
def test_filtering_keeps_the_flux(pattern, source, evidence):
    rsm = box_map(31) if source == "spot" else cube_map()
    for count in (6, 54, 150) if source == "cube" else (1, 16, 49, 225):
        lights = choose_pixel_lights([rsm], count=count, pattern=pattern, filtered=True)
        error = np.abs(lights.flux.sum(axis=1) / rsm.flux.sum(axis=(1, 2)) - 1).max()
        assert error < ROUNDING
        assert lights.drawn == count
        assert (np.linalg.norm(lights.normal, axis=0) > 0.99).all()  # each stands on a surface
    evidence(f"{pattern}, {source}: flux sum changes by {error:.0e}")


@pytest.mark.feature("SII-03")
@pytest.mark.parametrize(("n", "resolution"), [(4, 24), (5, 24), (24, 24), (7, 31)])
def test_grid_cells_equal_those_of_a_literal_twin(n, resolution):
    rsm = box_map(resolution)
    lights = choose_pixel_lights([rsm], count=n * n, pattern="grid", filtered=True)
    expected = np.array(naive.grid_cell_sums(rsm.flux, n))
    np.testing.assert_allclose(lights.flux, expected[:, expected.any(axis=0)], rtol=ROUNDING)


@pytest.mark.feature("SII-03")
def test_nearest_cells_equal_those_of_a_literal_twin():
    rsm = box_map()
    chosen, _ = texels(halton_points([9], np.zeros((1, 2)), 0), [9], 0, 1, 24, 24)
    lights = choose_pixel_lights([rsm], count=9, pattern="halton", filtered=True)
    expected = np.array(naive.nearest_cell_sums(rsm.flux, [divmod(int(t), 24) for t in chosen]))
    np.testing.assert_allclose(lights.flux, expected[:, expected.any(axis=0)], rtol=ROUNDING)


@pytest.mark.parametrize(("maps", "height", "width", "count"),
                         [(1, 13, 17, 40), (3, 9, 7, 12), (4, 6, 11, 2), (2, 5, 5, 1)])
def test_cells_of_stacked_maps_belong_to_their_own_map_first(maps, height, width, count):
    """Texels of other maps are farther than any of one's own, those of the next map nearer than those behind it."""
    projection = cube_map().projection._replace(
        height=height, width=width, origin=np.zeros((maps, 3)), frame=np.zeros((maps, 3, 3)))
    chosen = np.random.default_rng(count).integers(0, maps * height * width, count)
    row, column = np.divmod(np.arange(maps * height * width), width)
    row = row + row // height * 4 * (height + width)
    square = np.subtract.outer(row, row[chosen]) ** 2 + np.subtract.outer(column, column[chosen]) ** 2
    np.testing.assert_array_equal(cells_of_nearest(projection, chosen), square.argmin(axis=1))


@pytest.mark.feature("SII-03")
def test_a_filtered_light_on_a_dark_texel_moves_to_the_nearest_bright_one():
    rsm = box_map()
    lights = choose_pixel_lights([rsm], count=1, pattern="grid", filtered=True)
    dark = np.zeros_like(rsm.flux)
    dark[:, 3, 20] = 1.0
    moved = choose_pixel_lights([rsm._replace(flux=dark)], count=1, pattern="grid", filtered=True)
    np.testing.assert_array_equal(moved.position[:, 0], rsm.position[:, 3, 20])
    np.testing.assert_array_equal(lights.position[:, 0], rsm.position[:, 12, 12])


@pytest.mark.feature("SII-13")
def test_several_lights_share_the_count_and_each_keeps_its_flux():
    first, second = box_map(), box_map(16)
    glossy = reflective_shadow_map(sphere(10, 2.0), material_table([GLOSSY], np.float64),
                                   SpotLight((0, 0, 0), (0, -1, 0), 0.4, 0.8, (1, 1, 1)), 16, np.float64)  # fmt: skip
    joined = choose_pixel_lights([first, second, glossy], count=32, pattern="halton", seed=3)
    assert joined.drawn == 32
    alone = [choose_pixel_lights([rsm], count=count, pattern="all" if count is None else "random")
             for rsm, count in ((first, None), (second, None), (glossy, None))]  # fmt: skip
    every = choose_pixel_lights([first, second, glossy], count=None, pattern="all")
    np.testing.assert_array_equal(every.flux, np.concatenate([part.flux for part in alone], axis=1))
    assert every.lobe_flux.shape == every.flux.shape == every.lobe_axis.shape
    dark = alone[0].flux.shape[1] + alone[1].flux.shape[1]
    assert (every.lobe_flux[:, :dark] == 0).all()
    np.testing.assert_array_equal(every.lobe_flux[:, dark:], alone[2].lobe_flux)
    np.testing.assert_array_equal(every.lobe_exponent[dark:], 20)
    grid = choose_pixel_lights([first, second], count=16 + 16, pattern="grid")
    for part, rsm in ((slice(0, 10), first),):
        assert set(map(tuple, grid.position[:, part].T)) <= set(map(tuple, rsm.position.reshape(3, -1).T))


@pytest.mark.parametrize(("faces", "count", "shares"), [
    ((1, 1), 256, [121, 121]), ((1, 1, 1), 256, [81, 81, 81]), ((1, 6), 256, [121, 150]), ((6,), 256, [6 * 49]),
    ((6, 1, 1), 192, [54, 64, 64]), ((6, 6), 2, [6, 6]), ((1, 1), 3, [1, 1]), ((1, 1), 5, [4, 1]), ((1,), 2, [1]),
    ((1,), 3, [4]), ((6,), 15, [6]), ((6,), 16, [24])])
@pytest.mark.feature("AMS-01", "SII-13")
def test_a_grid_puts_n_by_n_on_each_face_as_near_to_each_share_as_can_be(faces, count, shares, evidence):
    """By hand; lights of one map are those that it draws alone, and the flux is that of the maps."""
    rsms = [with_flux(box_map() if maps == 1 else cube_map(), 7.0) for maps in faces]
    lights = choose_pixel_lights(rsms, count=count, pattern="grid")
    assert lights.drawn == sum(shares)
    assert [one.drawn for one in map_shares(rsms, count, "grid")] == shares
    for index, (rsm, share) in enumerate(zip(rsms, shares, strict=True)):
        alone, here = choose_pixel_lights([rsm], count=share, pattern="grid"), lights.map_index == index
        np.testing.assert_array_equal(lights.texel[here], alone.texel)
        np.testing.assert_array_equal(lights.flux[:, here], alone.flux)
        np.testing.assert_allclose(lights.flux[:, here], rsm.at(alone.texel, "flux")[0] * (rsm.texels / share),
                                   rtol=ROUNDING)
    if max(faces) == 1 or count > 2:
        filtered = choose_pixel_lights(rsms, count=count, pattern="grid", filtered=True).flux.sum(axis=1)
        np.testing.assert_allclose(filtered, sum(rsm.flux.sum(axis=(1, 2)) for rsm in rsms), rtol=ROUNDING)
    evidence(f"{count} lights on maps of {faces} faces: {shares}")


def test_a_grid_that_is_rounded_is_logged_with_the_number_used():
    with observe() as log:
        choose_pixel_lights([box_map(), with_flux(box_map(16), box_map().flux.sum())], count=32, pattern="grid")
        choose_pixel_lights([box_map(), with_flux(box_map(16), box_map().flux.sum())], count=256, pattern="grid")
    assert [run.reason for run in log.runs if run.name == "lights.grid_cells"] == [
        "242 texels for 256: n x n on each map of 2 lights"]


@pytest.mark.feature("SII-13")
def test_lobes_carry_the_same_weight_as_the_diffuse_part():
    light = SpotLight((0, 0, 0), (0, -1, 0), 0.4, 0.8, (1, 1, 1))
    rsm = reflective_shadow_map(sphere(10, 2.0), material_table([GLOSSY], np.float64), light, 16, np.float64)
    for filtered in (False, True):
        lights = choose_pixel_lights([rsm], count=64, pattern="grid", filtered=filtered)
        np.testing.assert_allclose(lights.lobe_flux[0] / lights.flux[0], 3.0)
    assert lights.lobe_flux.sum() == pytest.approx(rsm.lobe_flux.sum())


def flat(plane):
    return plane.reshape(3, -1)


@pytest.mark.feature("SII-13")
@pytest.mark.parametrize("method", ["A", "B"])
@pytest.mark.parametrize("source", ["spot", "cube", "uneven"])
def test_warped_lights_have_the_maps_flux_in_the_mean_for_every_count(source, method, evidence):
    rsm = {"spot": lambda: box_map(32), "cube": cube_map, "uneven": lambda: box_map(37)}[source]()
    total = rsm.flux.sum(axis=(1, 2))
    worst = 0.0
    for count in (3, 200):
        for levels in (2, 20):
            sums = np.array([choose_pixel_lights([rsm], count=count, pattern="random", seed=seed,
                                                 warp=Warp(method, levels)).flux.sum(axis=1)
                             for seed in range(100)])  # fmt: skip
            z = np.abs((sums.mean(axis=0) - total) / (sums.std(axis=0, ddof=1) / math.sqrt(100)))
            worst = max(worst, z[sums.std(axis=0) > ROUNDING * total].max())
    assert worst < 4
    evidence(f"{source}, method {method}, N = 3 and 200: mean of 100 draws {worst:.1f} standard errors off")


@pytest.mark.feature("SII-13")
def test_warped_lights_are_texels_with_their_weight_times_t_over_n():
    for rsm in (box_map(), cube_map()):
        lights = choose_pixel_lights([rsm], count=200, pattern="halton", seed=4, warp=Warp("A", 20))
        np.testing.assert_array_equal(lights.position, flat(rsm.position)[:, lights.texel])
        np.testing.assert_array_equal(lights.normal, flat(rsm.normal)[:, lights.texel])
        brightest = lights.flux.max(axis=0)  # w Phi is the map's mean at full depth
        np.testing.assert_allclose(brightest, rsm.flux.max(axis=0).sum() / 200, rtol=ROUNDING)
        assert lights.texel.dtype == lights.map_index.dtype == np.int32
        assert lights.flux.shape[1] == lights.drawn == 200


def test_no_levels_give_the_lights_of_no_warp():
    rsm = box_map(31)
    for pattern, count in (("grid", 49), ("halton", 60), ("random", 60)):
        plain, warped = (choose_pixel_lights([rsm], count=count, pattern=pattern, seed=2, warp=warp)
                         for warp in (None, Warp("B", 0)))
        np.testing.assert_array_equal(plain.texel, warped.texel)
        np.testing.assert_array_equal(plain.flux, warped.flux)


def test_equally_important_faces_get_the_lights_of_no_warp():
    rsm = cube_map()
    for pattern in ("grid", "halton"):
        plain, warped = (choose_pixel_lights([rsm], count=54, pattern=pattern, seed=2, warp=warp, importance=worth)
                         for warp, worth in ((None, None), (Warp("A", 0), [np.ones(rsm.depth.shape)])))
        np.testing.assert_array_equal(plain.texel, warped.texel)
        np.testing.assert_allclose(plain.flux, warped.flux, rtol=ROUNDING)


@pytest.mark.feature("SII-03")
@pytest.mark.parametrize("source", ["spot", "cube"])
def test_filtered_warped_lights_carry_the_flux_nearest_to_them_without_weight(source, evidence):
    rsm = box_map() if source == "spot" else cube_map()
    for pattern, count in (("grid", 54 if source == "cube" else 49), ("halton", 40), ("random", 500)):
        warp = Warp("A", 3)
        lights = choose_pixel_lights([rsm], count=count, pattern=pattern, warp=warp, filtered=True)
        error = np.abs(lights.flux.sum(axis=1) / rsm.flux.sum(axis=(1, 2)) - 1).max()
        assert error < ROUNDING
        assert lights.drawn == count
        if source == "spot" and pattern == "halton":
            places = choose_pixel_lights([rsm._replace(flux=np.ones_like(rsm.flux))], count=count, pattern=pattern,
                                         warp=warp, importance=[importance(rsm)]).texel  # fmt: skip
            expected = np.array(naive.nearest_cell_sums(rsm.flux, [divmod(int(t), 24) for t in places]))
            np.testing.assert_allclose(lights.flux, expected[:, expected.any(axis=0)], rtol=ROUNDING)
    evidence(f"{source}: a warped, filtered set has the map's flux to {error:.0e}")


def test_lights_name_their_texel_and_map():
    first, second = box_map(), cube_map()
    for options in ({"pattern": "halton", "count": 64}, {"pattern": "all", "count": None},
                    {"pattern": "random", "count": 64, "warp": Warp("B", 3)},
                    {"pattern": "halton", "count": 64, "filtered": True}):  # fmt: skip
        lights = choose_pixel_lights([first, second], **options)
        for index, rsm in enumerate((first, second)):
            here = lights.map_index == index
            assert here.any()
            np.testing.assert_array_equal(lights.position[:, here], flat(rsm.position)[:, lights.texel[here]])


@pytest.mark.feature("SII-13")
def test_renormalised_weights_sum_to_the_count_and_bring_variance_back():
    rsm = box_map()
    worth = importance(rsm)
    plain, scaled = (choose_pixel_lights([rsm], count=100, pattern="halton", seed=1, warp=Warp("A", 20),
                                         importance=[worth], renormalise=flag) for flag in (False, True))
    assert plain.flux.max(axis=0).sum() == pytest.approx(worth.sum(), rel=ROUNDING)
    weights = scaled.flux.max(axis=0) / worth.reshape(-1)[scaled.texel] * 100 / rsm.texels
    assert weights.sum() == pytest.approx(100, rel=ROUNDING)
    assert abs(scaled.flux.max(axis=0).sum() / worth.sum() - 1) > 1e-3


@pytest.mark.feature("SII-10", "SII-28")
def test_same_seed_same_lights_other_seed_others():
    rsm = box_map()
    for pattern in ("halton", "random"):
        first, again, other = (choose_pixel_lights([rsm], count=50, pattern=pattern, seed=s) for s in (5, 5, 6))
        np.testing.assert_array_equal(first.position, again.position)
        assert first.position.shape != other.position.shape or (first.position != other.position).any()


def test_float32_maps_give_float32_lights():
    for options in ({"filtered": True}, {"warp": Warp("A", 2)}):
        lights = choose_pixel_lights([box_map(dtype=np.float32)], count=16, pattern="grid", **options)
        assert lights.flux.dtype == lights.position.dtype == np.float32


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"count": 0, "pattern": "halton"}, "an integer, at least 1, got 0"),
        ({"count": None, "pattern": "random"}, "an integer, at least 1, got None"),
        ({"count": 10, "pattern": "all"}, "None or 576 with pattern 'all', got 10"),
        ({"count": 10, "pattern": "hex"}, "grid or halton or all or random, got 'hex'"),
        ({"count": 625, "pattern": "grid", "filtered": True}, "at most 576 with filtering, got 625"),
        ({"count": None, "pattern": "all", "warp": Warp("A", 1)}, "'halton' or 'random' with a warp, got 'all'"),
        ({"count": 9, "pattern": "grid", "importance": [np.ones((24, 24))]}, "importance: expected None without a"),
        ({"count": 9, "pattern": "grid", "warp": Warp("A", 1), "importance": []}, "importance: expected one for each"),
        ({"count": 9, "pattern": "grid", "warp": Warp("A", 1), "importance": [np.ones((3, 3))]},
         r"importance: expected shape \(24, 24\) as its map, got \(3, 3\)"),
    ],
)
def test_errors_name_what_is_wrong(options, message):
    with pytest.raises(InputError, match=message):
        choose_pixel_lights([box_map()], **options)


def test_a_light_without_a_map_is_refused():
    with pytest.raises(InputError, match="rsms: expected at least one map"):
        choose_pixel_lights([], count=4, pattern="grid")


def test_a_map_without_flux_gives_no_lights():
    light = PointLight((0, 0, 0), (1, 1, 1))
    empty = reflective_shadow_map(geometry(np.zeros((0, 3)), np.zeros((0, 3))), material_table([GLOSSY]), light, 4)
    for pattern, count in (("grid", 24), ("halton", 5), ("all", None)):
        for filtered in (False, True):
            for warp in (None, Warp("A", 3)) if count else (None,):
                lights = choose_pixel_lights([empty], count=count, pattern=pattern, filtered=filtered, warp=warp)
                assert lights.flux.shape == (3, 0)

"""A page's pictures: what the script is told, and what becomes coarse where all are more than the limit."""

import functools
import json

import numpy as np
import pytest

from refgi.compare.page.album import Judge, Picture, View, album
from refgi.compare.page.floats import COARSEST, FIRST, SECOND, THIRD, Store
from refgi.compare.pictures import luminance
from tests.compare.page.test_floats import unpacked

HEIGHT, WIDTH = 40, 50


def light(seed):
    rng = np.random.default_rng(seed)
    return rng.uniform(0.5, 2, (3, HEIGHT, WIDTH)).astype(np.float32)


def lit(irradiance):
    return irradiance, (0.2 + irradiance / 4).astype(np.float32)


def make_view(importances=(SECOND, THIRD, THIRD, SECOND), judges=("truth", "unoccluded"), radiance=None):
    references = {name: Judge(lit(light(i))[0], np.full((3, HEIGHT, WIDTH), 0.01), lit(light(i))[1], name)
                  for i, name in enumerate(judges)}
    covered = np.ones((HEIGHT, WIDTH), bool)
    covered[:10, :10] = False
    pictures = [Picture(f"p{i}", f"picture {i}", "said", judges, functools.partial(lit, light(10 + i)), importance)
                for i, importance in enumerate(importances)]
    if radiance is not None:
        pictures[0] = pictures[0]._replace(load=lambda: (light(10), radiance))
    ids = {"face": np.arange(HEIGHT * WIDTH, dtype=np.uint32).reshape(HEIGHT, WIDTH) + 70_000}
    return View("v", "a <view>", 0.5, covered, references, pictures, ids)


def planes(made, number):
    facts = made.data["planes"][number]
    height, width = (-(-side // 2 ** facts["level"]) for side in (HEIGHT, WIDTH))
    return unpacked(made.blobs[number], facts["channels"], height, width), facts


def numbers(made, number):
    bits, facts = planes(made, number)
    return bits.view(np.float16).astype(np.float64) * 2.0 ** facts["exponent"]


def test_the_script_is_told_all_planes():
    made = album([make_view()])
    view, = made.data["views"]
    assert (view["title"], view["width"], view["height"], view["exposure"]) == ("a <view>", WIDTH, HEIGHT, 0.5)
    assert [one["key"] for one in view["references"]] == ["truth", "unoccluded"]
    assert np.array_equal(numbers(made, view["mask"])[0] == 1, make_view().covered)
    for one, seed in zip((*view["references"], *view["pictures"]), (0, 1, 10, 11, 12, 13), strict=True):
        assert numbers(made, one["irradiance"]) == pytest.approx(light(seed), rel=2**-11)
        assert "radiance" not in one
    assert numbers(made, view["emitted"]) == pytest.approx(np.full((3, HEIGHT, WIDTH), 0.2), rel=1e-3)
    assert numbers(made, view["reflectance"]) == pytest.approx(np.full((3, HEIGHT, WIDTH), 0.25), rel=1e-3)
    deviation = numbers(made, view["references"][0]["deviation"])
    assert deviation == pytest.approx(np.full((1, HEIGHT, WIDTH), 0.1), rel=1e-3)
    low, high = planes(made, view["ids"]["face"])[0].astype(int)
    assert (low + 65536 * high)[3, 4] == 3 * WIDTH + 4 + 70_000
    json.dumps(made.data, allow_nan=False)


def test_pixels_that_are_not_finite_stay_so_and_stop_nothing():
    broken = light(10)
    broken[:, 20, 20], broken[1, 30, 30] = np.nan, np.inf
    view = make_view(importances=(FIRST, FIRST))
    picture = view.pictures[0]._replace(load=lambda: lit(broken))
    made = album([view._replace(pictures=[picture, *view.pictures[1:]])])
    described = made.data["views"][0]["pictures"][0]
    found = numbers(made, described["irradiance"])
    assert np.isnan(found[:, 20, 20]).all()
    assert found[1, 30, 30] == np.inf
    assert np.isfinite(found).sum() == found.size - 4
    assert "radiance" not in described
    json.dumps(made.data, allow_nan=False)


def test_radiance_that_the_surface_does_not_explain_is_stored():
    other = light(99)
    made = album([make_view(radiance=other)])
    picture = made.data["views"][0]["pictures"][0]
    assert numbers(made, picture["radiance"]) == pytest.approx(other, rel=2**-11)


def test_a_picture_is_described_by_the_reference_it_converges_to_and_its_worst_places_by_the_truth():
    view = make_view(importances=(FIRST,))
    picture = view.pictures[0]._replace(load=lambda: lit(0.8 * light(1)))
    described, = album([view._replace(pictures=[picture])]).data["views"][0]["pictures"]
    finding, = described["findings"]
    assert finding["name"] == "too dark by 20% all over"
    assert "against the truth without visibility: " in finding["about"]
    assert finding["about"].endswith("named from 0.5 on")
    error = ((0.8 * luminance(light(1)) - luminance(light(0))) * view.covered) ** 2
    x, y, side = (described["crops"][0][key] for key in ("x", "y", "side"))
    assert described["crops"][0]["share"] == pytest.approx(error[y:y + side, x:x + side].sum() / error.sum(), rel=1e-3)


def test_equal_views_give_equal_albums():
    assert album([make_view()]) == album([make_view()])


def test_least_important_pictures_become_coarse_first_and_the_truth_last():
    whole = sum(map(len, album([make_view()]).blobs))
    levels = []
    for share in (1.0, 0.95, 0.6, 0.4, 0.2, 0.05):
        made = album([make_view()], int(share * whole))
        assert sum(map(len, made.blobs)) <= share * whole
        view = made.data["views"][0]
        levels.append([made.data["planes"][one["irradiance"]]["level"]
                       for one in (*view["references"], *view["pictures"])])
        assert made.data["planes"][view["mask"]]["level"] == 0
    assert levels[0] == [0] * 6
    assert levels[1] == [0, 0, 0, 0, 1, 0]  # the last of the least important
    for truth, _, a, b, c, d in levels:
        assert truth <= min(a, d) <= max(a, d) <= min(b, c)
    assert min(levels[-1]) > 0


def test_coarse_planes_are_means_over_covered_pixels():
    covered = np.ones((HEIGHT, WIDTH), bool)
    covered[:, 0] = False
    store = Store()
    store.add(light(1), covered, FIRST)
    store.add(light(2), covered, THIRD)
    store.fit(len(store.texts()[0]) + len(store.texts()[1]) - 1)
    assert [one["level"] for one in store.facts()] == [0, 1]
    bits = unpacked(store.texts()[1], 3, HEIGHT // 2, WIDTH // 2)
    found = bits.view(np.float16) * 2.0 ** store.facts()[1]["exponent"]
    assert found[0, 3, 0] == pytest.approx(light(2)[0, 6:8, 1].mean(), rel=2**-11)
    assert found[2, 3, 5] == pytest.approx(light(2)[2, 6:8, 10:12].mean(), rel=2**-11)


def test_a_limit_that_cannot_be_met_ends_at_the_coarsest():
    store = Store()
    store.add(light(1), np.ones((HEIGHT, WIDTH), bool), SECOND)
    store.fit(0)
    assert store.facts()[0]["level"] == COARSEST

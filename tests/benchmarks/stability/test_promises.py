"""Promises of stages: short forms hold, a fault put into a stage breaks its promise, and a case comes again."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.stability import (
    again,
    buffers,
    kernels,
    lobes,
    map_promises,
    promise,
    rays,
    shadows,
    sum_promises,
)
from benchmarks.stability.promise import Case, case_of, row_of
from refgi.rays import Tracer

pytestmark = pytest.mark.slow  # tests/benchmarks/test_smoke.py runs a task of each part

KNOWN = kernels.promises() | rays.promises()
FEW = {"sum.many": 1, "lobe.norm_bias": 2, "map.wide": 3, "buffers.unit": 4, "shadows.far": 3, "shadows.off_face": 3}


def held(name, cases=20):
    """Return whether some cases keep a promise."""
    return row_of(KNOWN[name]._replace(brief=FEW.get(name, cases)), "kernels", short=True).passed


@pytest.mark.parametrize("name", KNOWN)
def test_a_few_cases_keep_each_promise(name, monkeypatch):
    monkeypatch.setattr(sum_promises, "MOST_GROUPS", 1500)
    assert held(name, 8)


def test_the_worst_case_is_the_row_and_counts_add_up():
    def draw(rng):
        return Case(float(rng.integers(10)), "some")

    some = KNOWN["map.spot_power"]._replace(draw=draw, cases=30, limit=8.5)
    figures = [case_of(some, promise.SEED, case).figure for case in range(30)]
    row = row_of(some, "kernels", short=False)
    assert (row.figure, row.passed, row.cases) == (9, False, 30)
    assert row.reproduce.endswith(f" map.spot_power {promise.SEED} {figures.index(9)}")
    assert row_of(some._replace(adds=True), "kernels", short=False).figure == sum(figures)
    lost = some._replace(draw=lambda rng: Case(math.nan if rng.integers(10) > 8 else 0.0, ""))
    assert not row_of(lost, "kernels", short=False).passed


def test_a_case_comes_again(capsys):
    assert again.main(["kernels", "map.directional", "17", "3"]) == 0
    found = case_of(KNOWN["map.directional"], 17, 3)
    assert f"{found.figure:.6g} of the limit" in capsys.readouterr().out
    assert again.main(["rays", "shadows.far", "17", "1"]) == 0
    assert "of 200 lose light" in capsys.readouterr().out
    assert again.main(["kernels", "shadows.far", "17", "1"]) == 2
    assert "map.directional" in capsys.readouterr().err
    assert again.main(["rays", "shadow.far", "17", "1"]) == 2
    assert "shadows.far" in capsys.readouterr().err


def drifting(receivers, lights, settings):
    """Add groups of 64 in float32, without compensation."""
    total = np.zeros((3, *receivers.covered.shape), np.float32)
    for first in range(0, lights.position.shape[1], 64):
        some = [None if one is None else one[..., first : first + 64] for one in lights[:6]]
        total += plain_sum(receivers, type(lights)(*some, 64), settings)
    return total


plain_sum = sum_promises.irradiance


def test_sums_that_drift_show(monkeypatch):
    monkeypatch.setattr(sum_promises, "MOST_GROUPS", 1500)
    assert held("sum.many")
    monkeypatch.setattr(sum_promises, "irradiance", drifting)
    assert not held("sum.many")


def rounded_places(receivers, lights, settings):
    return plain_sum(receivers, lights._replace(position=lights.position.astype(np.float32).astype(float)), settings)


def one_off(receivers, lights, settings):
    return plain_sum(receivers, lights, settings) * np.float32(1 + 1e-4)


def test_sums_of_rounded_or_too_strong_lights_show(monkeypatch):
    monkeypatch.setattr(sum_promises, "irradiance", rounded_places)
    assert not held("sum.float64")
    monkeypatch.setattr(sum_promises, "irradiance", one_off)
    assert not held("sum.float32")
    assert held("sum.bright")
    monkeypatch.setattr(sum_promises, "irradiance", lambda *a: plain_sum(*a) * np.float32(1e30))
    with np.errstate(all="ignore"):
        assert not held("sum.bright")


def test_norms_that_are_off_to_one_side_show(monkeypatch):
    plain = lobes.filled

    def leaning(fill):
        return lambda x: plain(fill)(x) * (1 + 2.0**-52 * x[1])

    monkeypatch.setattr(lobes, "filled", leaning)
    assert not held("lobe.norm_bias")


def test_steps_that_know_a_length_show(monkeypatch):
    def faces(geometry, _, normal):
        return normal * (geometry.diagonal > 1e-6)

    monkeypatch.setattr(buffers, "facing_normals", faces)
    assert not held("buffers.unit")
    assert "face normals" in row_of(KNOWN["buffers.unit"]._replace(brief=4), "kernels", short=True).detail


@pytest.mark.parametrize("of", ["depth", "distance", "position"])
def test_a_floor_that_is_off_or_has_holes_shows(of, monkeypatch):
    plain = buffers.Frame

    def off(share):
        def make(scene, **options):
            buffer = plain(scene, **options).gbuffer
            kept = {key: getattr(buffer, key) for key in ("depth", "distance", "position", "covered")}
            kept[of] = kept[of] * (1 + share)
            kept["covered"] = kept["covered"] & (np.arange(kept["covered"].size).reshape(kept["covered"].shape) != 1200)
            return SimpleNamespace(gbuffer=SimpleNamespace(**kept))

        return make

    monkeypatch.setattr(buffers, "Frame", off(1e-6))
    assert not held("floor.float32", 4)
    monkeypatch.setattr(buffers, "Frame", off(1e-9))
    assert held("floor.float32", 4)
    assert not held("floor.float64", 4)
    assert not held("floor.holes", 4)


def test_maps_that_are_off_show(monkeypatch):
    plain = map_promises.project, map_promises.spot_power, map_promises.directional_projection

    def next_map(maps, points):
        row, column, depth = plain[0](maps, points)
        return np.where(row % maps.height > maps.height * (1 - 1e-12), np.ceil(row), row), column, depth

    monkeypatch.setattr(map_promises, "project", next_map)
    assert not held("map.borders", 4)
    monkeypatch.setattr(map_promises, "spot_power", lambda *a: plain[1](*a) * (1 + 1e-8))
    assert not held("map.spot_power", 4)
    for margin in (0.0, 1e-6):
        monkeypatch.setattr(map_promises, "directional_projection", lambda light, box, n, m=margin: plain[2](
            light, box, n)._replace(half=np.ptp(box, axis=0).max() * np.ones(2) + m))
        assert not held("map.directional")


def test_a_triangle_that_is_cut_short_shows(monkeypatch):
    plain = map_promises.draw_paraboloids

    def cut(maps, corners, faces, workers, nearness, ids):
        plain(maps, corners, faces, workers, nearness, ids)
        ids[:, 60:] = -1

    monkeypatch.setattr(map_promises, "draw_paraboloids", cut)
    assert not held("map.wide")


def test_shadows_where_there_are_none_show(monkeypatch):
    plain = shadows.receivers

    def as_they_are(*arguments):
        to = plain(*arguments)
        return to._replace(origin=to.position)

    monkeypatch.setattr(shadows, "receivers", as_they_are)
    assert not held("shadows.off_face")
    monkeypatch.setattr(shadows, "receivers", plain)
    sums = shadows.shadowed_sum
    monkeypatch.setattr(shadows, "shadowed_sum", lambda *a, **k: sums(*a, **k) * k.get("visibility", 2))
    with pytest.raises(AssertionError):
        held("shadows.far")


def test_segments_that_end_upon_their_sender_show(monkeypatch):
    plain = shadows.shadowed_sum

    def without_offset(tracer, to, lights, **options):
        return plain(tracer, to, lights._replace(position=lights.position - lights.normal * 1e-6 * np.abs(
            to.position).max()), **options)

    monkeypatch.setattr(shadows, "shadowed_sum", without_offset)
    assert not held("shadows.far")


def test_rays_of_no_reach_that_find_something_show(monkeypatch):
    plain = Tracer.fill_closest

    def keeping(self, origins, directions, reach, face, distance):
        plain(self, origins, directions, reach, face, distance)
        face[1:] = np.where(reach[1:] <= 0, face[:-1], face[1:])

    monkeypatch.setattr(Tracer, "fill_closest", keeping)
    assert not held("rays.no_reach", 2)

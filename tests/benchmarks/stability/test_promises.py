"""Promises of stages: each holds, each fails with a fault in, and its line shows the worst case again."""

import math
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.stability import (
    again,
    buffers,
    kernels,
    lobes,
    map_promises,
    places,
    promise,
    rays,
    shadows,
    sums,
    written_promises,
)
from benchmarks.stability.promise import Case, case_of, row_of
from refgi.rays import Tracer, ray_offset
from refgi.scene import motion, repair

pytestmark = pytest.mark.slow  # tests/benchmarks/test_smoke.py runs a task of each part

KNOWN = {name: (one, part) for part, found in (
    ("kernels", kernels.promises()), ("rays", rays.promises()),
    ("files", {one.name: one for one in written_promises.PROMISES})) for name, one in found.items()}
FEW = {"sum.many": 1, "lobe.norm_bias": 2, "map.wide": 3, "buffers.unit": 4, "shadows.far": 3, "shadows.off_face": 3,
       "sum.float32": 20, "sum.float64": 20, "map.directional": 20}


@pytest.fixture(autouse=True)
def _fewer_lights(monkeypatch):
    monkeypatch.setattr(sums, "MOST_GROUPS", 1500)


def row(name, cases=12):
    one, part = KNOWN[name]
    return row_of(one._replace(brief=FEW.get(name, cases)), part, short=True)


@pytest.mark.parametrize("name", KNOWN)
def test_promises_hold_and_their_line_shows_the_worst_case(name, capsys):
    found = row(name)
    assert found.passed
    command = found.reproduce.split()
    assert command[:4] == ["python", "-m", "benchmarks.stability.again", KNOWN[name][1]]
    assert again.main(command[3:]) == 0
    shown = capsys.readouterr().out
    assert found.detail in shown
    if not KNOWN[name][0].adds:
        assert f"figure     {found.figure:.6g} " in shown


@pytest.mark.parametrize(("asked", "told"), [
    (["files", "glb", "1", "2"], "expected one of exr-changed"),
    (["kernels", "shadows.far", "17", "1"], "map.directional"), (["rays", "shadow.far", "17", "1"], "shadows.far")])
def test_what_is_not_promised_is_refused(asked, told, capsys):
    assert again.main(asked) == 2
    assert told in capsys.readouterr().err


def test_the_worst_case_is_the_row_and_counts_add_up():
    def draw(rng):
        return Case(float(rng.integers(10)), "some")

    some = KNOWN["map.spot_power"][0]._replace(draw=draw, cases=30, limit=8.5)
    figures = [case_of(some, promise.SEED, case).figure for case in range(30)]
    row = row_of(some, "kernels", short=False)
    assert (row.figure, row.passed, row.cases) == (9, False, 30)
    assert row.reproduce.endswith(f" map.spot_power {promise.SEED} {figures.index(9)}")
    assert row_of(some._replace(adds=True), "kernels", short=False).figure == sum(figures)
    lost = some._replace(draw=lambda rng: Case(math.nan if rng.integers(10) > 8 else 0.0, ""))
    assert not row_of(lost, "kernels", short=False).passed


def float32_sums(texels):
    return tuple(one.astype(np.float32).astype(one.dtype) for one in real["importance_pyramid"](texels))


def from_the_left(v, sums):
    ends = np.cumsum(sums) / sums.sum()
    chosen = np.searchsorted(ends, v, side="left")
    starts = np.concatenate([[0.0], ends[:-1]])
    width = (ends - starts)[chosen]
    return chosen, np.clip((v - starts[chosen]) / width, 0, 1 - 2.0**-53), 1 / (len(sums) * width)


def kept_on_map(position, normal, centre, *rest):
    real["gather_discs"](position, normal, np.maximum(centre, 0), *rest)


def single_rays(light, geometry, jitter):
    found = real["light_rays"](light, geometry, jitter)
    return found._replace(directions=found.directions.astype(np.float32))


def slightly_off(*arguments):
    found = real["walk_lights"](*arguments)
    return found._replace(position=found.position * 1.00001)


def metric_areas(*arguments):
    found = real["area_lights"](*arguments)
    found.side[found.side < 1e-5] = 0
    return found


def on_a_grid(position, *arguments):
    return real["surface_levels"]((1e6 * position).round() / 1e6, *arguments)


def infinite_as_black(rgb, exposure):
    return real["tone_map"](np.where(np.isinf(rgb), 0, rgb), exposure)


def copied(self, target):
    Path(target).write_bytes(self.read_bytes())
    self.unlink()
    return Path(target)


def drifting(receivers, lights, settings):
    """Add groups of 64 in float32, without compensation."""
    total = np.zeros((3, *receivers.covered.shape), np.float32)
    for first in range(0, lights.position.shape[1], 64):
        some = [None if one is None else one[..., first : first + 64] for one in lights[:6]]
        total += real["irradiance"](receivers, type(lights)(*some, 64), settings)
    return total


def rounded_places(receivers, lights, settings):
    return real["irradiance"](receivers, lights._replace(position=lights.position.astype(np.float32).astype(float)),
                              settings)


def leaning(x):
    return real["norms"](x) * (1 + 2.0**-52 * x[1])


def next_map(maps, points):
    row, column, depth = real["project"](maps, points)
    return np.where(row % maps.height > maps.height * (1 - 1e-12), np.ceil(row), row), column, depth


def with_margin(margin):
    return lambda light, box, n: real["directional_projection"](light, box, n)._replace(
        half=np.ptp(box, axis=0).max() * np.ones(2) + margin)


def cut_short(maps, corners, faces, workers, nearness, ids):
    real["draw_paraboloids"](maps, corners, faces, workers, nearness, ids)
    ids[:, 60:] = -1


def as_they_are(*arguments):
    to = real["receivers"](*arguments)
    return to._replace(origin=to.position)


def without_offset(tracer, to, lights, **options):
    return real["shadowed_sum"](tracer, to, lights._replace(position=lights.position - lights.normal * 1e-6 * np.abs(
        to.position).max()), **options)


def keeping(self, origins, directions, reach, face, distance):
    real["fill_closest"](self, origins, directions, reach, face, distance)
    face[1:] = np.where(reach[1:] <= 0, face[:-1], face[1:])


def floor_of(of, share):
    """Return frames whose floor is off by a share, and has one hole."""
    def make(scene, **options):
        buffer = real["Frame"](scene, **options).gbuffer
        kept = {key: getattr(buffer, key) for key in ("depth", "distance", "position", "covered")}
        kept[of] = kept[of] * (1 + share)
        kept["covered"] = kept["covered"] & (np.arange(kept["covered"].size).reshape(kept["covered"].shape) != 1200)
        return SimpleNamespace(gbuffer=SimpleNamespace(**kept))

    return make


real = {name: getattr(module, name) for module, name in (
    (sums, "importance_pyramid"), (sums, "gather_discs"), (places, "light_rays"),
    (places, "walk_lights"), (map_promises, "area_lights"), (map_promises, "shadow_maps"),
    (places, "surface_levels"), (places, "reproject"), (written_promises, "tone_map"), (sums, "irradiance"),
    (lobes, "norms"), (map_promises, "project"), (map_promises, "spot_power"), (map_promises, "directional_projection"),
    (map_promises, "draw_paraboloids"), (shadows, "receivers"), (shadows, "shadowed_sum"), (Tracer, "fill_closest"),
    (buffers, "Frame"))}
module = sys.modules.__getitem__
FAULTS = {
    "lights stay behind": ("place.kept", motion, "_moved_light", lambda light, _: light),
    "far scenes stay": ("place.resolved", motion, "FAR", 16384.0),
    "slivers are flat": ("place.slivers", repair, "FLAT", 1e-6),
    "flat faces are none": ("place.slivers", repair, "FLAT", -1.0),
    "sums in float32": ("importance.sums", sums, "importance_pyramid", float32_sums),
    "discs kept on the map": ("gather.discs", sums, "gather_discs", kept_on_map),
    "map from the left": ("importance.warp", module("refgi.lights.warp"), "_choose_map", from_the_left),
    "rows beside their texel": ("importance.warp", module("refgi.lights.warp"), "_clamped_to_texel",
                                lambda row, rows: np.minimum(np.nextafter(row / rows, 1), 1 - 2.0**-53)),
    "directions of float32": ("sent.spot", places, "light_rays", single_rays),
    "lights off": ("sent.walk", places, "walk_lights", slightly_off),
    "not lifted from where it is": ("sent.lift", places, "lift", lambda *one: ray_offset(*one[2], one[4])),
    "areas in metres": ("val.rectangles", map_promises, "area_lights", metric_areas),
    "maps of the whole file": ("val.maps", map_promises, "shadow_maps",
                               lambda *arguments, **_: real["shadow_maps"](*arguments)),
    "cells in metres": ("blends.unit", places, "surface_levels", on_a_grid),
    "origin forgotten": ("reproject.origin", places, "reproject",
                         lambda *arguments, **others: real["reproject"](*arguments, **others | {"origin": None})),
    "grain of the largest": ("ground.sheet", module("refgi.rays.tracer"), "grain_of",
                             lambda vertices, _: 8 * float(np.abs(vertices).max())),
    "digest of nothing": ("exr-changed", module("refgi.image.exr"), "_digest", lambda *_: ""),
    "moments of nothing": ("checkpoint-changed", module("refgi.truth.checkpoint"), "_digest", lambda *_: bytes(32)),
    "infinity is black": ("png-magenta", written_promises, "tone_map", infinite_as_black),
    "copied over": ("replaced", Path, "replace", copied),
    "sums drift": ("sum.many", sums, "irradiance", drifting),
    "places of float32": ("sum.float64", sums, "irradiance", rounded_places),
    "light too strong": ("sum.float32", sums, "irradiance", lambda *a: real["irradiance"](*a) * np.float32(1 + 1e-4)),
    "brighter than float32": ("sum.bright", sums, "irradiance", lambda *a: real["irradiance"](*a) * np.float32(1e30)),
    "norms lean": ("lobe.norm_bias", lobes, "norms", leaning),
    "normals in metres": ("buffers.unit", buffers, "facing_normals", lambda g, _, n: n * (g.diagonal > 1e-6)),
    **{f"{of} of a floor off": (name, buffers, "Frame", floor_of(of, share)) for of in ("depth", "distance", "position")
       for name, share in (("floor.float32", 1e-6), ("floor.float64", 1e-9))},
    "a hole": ("floor.holes", buffers, "Frame", floor_of("depth", 0.0)),
    "border of the next map": ("map.borders", map_promises, "project", next_map),
    "power off": ("map.spot_power", map_promises, "spot_power", lambda *a: real["spot_power"](*a) * (1 + 1e-8)),
    "no margin": ("map.directional", map_promises, "directional_projection", with_margin(0.0)),
    "margin in metres": ("map.directional", map_promises, "directional_projection", with_margin(1e-6)),
    "a triangle cut short": ("map.wide", map_promises, "draw_paraboloids", cut_short),
    "receivers as they are": ("shadows.off_face", shadows, "receivers", as_they_are),
    "segments end upon senders": ("shadows.far", shadows, "shadowed_sum", without_offset),
    "reach of others": ("rays.no_reach", Tracer, "fill_closest", keeping),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_show(fault, monkeypatch):
    name, place, attribute, other = FAULTS[fault]
    monkeypatch.setattr(place, attribute, other)
    with np.errstate(all="ignore"):
        assert not row(name).passed


def test_shadows_are_asked_where_there_is_light(monkeypatch):
    monkeypatch.setattr(shadows, "shadowed_sum", lambda *a, **k: real["shadowed_sum"](*a, **k) * 0)
    with pytest.raises(AssertionError):
        row("shadows.far")

"""Promises of stages: each holds, each fails with a fault in, and its line shows the worst case again."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.stability import (
    again,
    area_promises,
    hssil,
    level_promises,
    place_promises,
    sampled_promises,
    sent_promises,
    shadows,
    written_promises,
)
from benchmarks.stability.ladder import measure
from benchmarks.stability.maths import DIGITS, EXTENDED
from benchmarks.stability.promise import row_of
from refgi.rays import ray_offset
from refgi.scene import motion, repair

pytestmark = pytest.mark.slow  # tests/benchmarks/test_smoke.py runs a task of each part

PART = {shadows: "rays", written_promises: "files"}
MODULES = (place_promises, sampled_promises, sent_promises, level_promises, area_promises, shadows,
           written_promises)
PROMISES = {one.name: (one, PART.get(module, "kernels")) for module in MODULES for one in module.PROMISES}
LADDERS = {one.name: one for module in (sent_promises, hssil, level_promises, area_promises)
           for one in module.LADDERS}
FEW = 12  # cases


def row(name):
    promise, part = PROMISES[name]
    return row_of(promise._replace(brief=FEW), part, short=True)


@pytest.mark.parametrize("name", PROMISES)
def test_promises_hold_and_their_line_shows_the_worst_case(name, capsys):
    found = row(name)
    assert found.passed
    command = found.reproduce.split()
    assert command[:4] == ["python", "-m", "benchmarks.stability.again", PROMISES[name][1]]
    assert again.main(command[3:]) == 0
    shown = capsys.readouterr().out
    assert found.detail in shown
    if not PROMISES[name][0].adds:
        assert f"figure     {found.figure:.6g} " in shown


def test_what_is_not_promised_is_refused(capsys):
    assert again.main(["files", "glb", "1", "2"]) == 2
    assert "expected one of exr-changed" in capsys.readouterr().err


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


real = {name: getattr(module, name) for module, name in (
    (sampled_promises, "importance_pyramid"), (sampled_promises, "gather_discs"), (sent_promises, "light_rays"),
    (sent_promises, "walk_lights"), (area_promises, "area_lights"), (area_promises, "shadow_maps"),
    (level_promises, "surface_levels"), (level_promises, "reproject"), (written_promises, "tone_map"))}
module = sys.modules.__getitem__
FAULTS = {
    "lights stay behind": ("place.kept", motion, "_moved_light", lambda light, _: light),
    "far scenes stay": ("place.resolved", motion, "FAR", 16384.0),
    "slivers are flat": ("place.slivers", repair, "FLAT", 1e-6),
    "flat faces are none": ("place.slivers", repair, "FLAT", -1.0),
    "sums in float32": ("importance.sums", sampled_promises, "importance_pyramid", float32_sums),
    "discs kept on the map": ("gather.discs", sampled_promises, "gather_discs", kept_on_map),
    "map from the left": ("importance.warp", module("refgi.lights.warp"), "_choose_map", from_the_left),
    "rows beside their texel": ("importance.warp", module("refgi.lights.warp"), "_clamped_to_texel",
                                lambda row, rows: np.minimum(np.nextafter(row / rows, 1), 1 - 2.0**-53)),
    "directions of float32": ("sent.spot", sent_promises, "light_rays", single_rays),
    "lights off": ("sent.walk", sent_promises, "walk_lights", slightly_off),
    "not lifted from where it is": ("sent.lift", sent_promises, "lift", lambda *one: ray_offset(*one[2], one[4])),
    "areas in metres": ("val.rectangles", area_promises, "area_lights", metric_areas),
    "maps of the whole file": ("val.maps", area_promises, "shadow_maps",
                               lambda *arguments, **_: real["shadow_maps"](*arguments)),
    "cells in metres": ("blends.unit", level_promises, "surface_levels", on_a_grid),
    "origin forgotten": ("reproject.origin", level_promises, "reproject",
                         lambda *arguments, **others: real["reproject"](*arguments, **others | {"origin": None})),
    "grain of the largest": ("ground.sheet", module("refgi.rays.tracer"), "grain_of",
                             lambda vertices, _: 8 * float(np.abs(vertices).max())),
    "digest of nothing": ("exr-changed", module("refgi.image.exr"), "_digest", lambda *_: ""),
    "moments of nothing": ("checkpoint-changed", module("refgi.truth.checkpoint"), "_digest", lambda *_: bytes(32)),
    "infinity is black": ("png-magenta", written_promises, "tone_map", infinite_as_black),
    "copied over": ("replaced", Path, "replace", copied),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_show(fault, monkeypatch):
    name, place, attribute, other = FAULTS[fault]
    monkeypatch.setattr(place, attribute, other)
    assert not row(name).passed


def figure(name, run, maths=EXTENDED, real="float64", count=2000):
    ladder = LADDERS[name]._replace(run=run)
    return measure(ladder, maths, real, 17, count).figure / ladder.limit


def squares(x):
    """Heights with y from the root of d^2 - x^2."""
    p, n, s, thickness = x[:3], x[3:6], x[6:9], x[9]
    d, length = s - p, np.sqrt((p * p).sum(axis=0))
    facing, out = -(n * p).sum(axis=0) / length, []
    for share in (0 * thickness, thickness / np.sqrt((s * s).sum(axis=0))):
        back = d + share * s
        along, up = -(p * back).sum(axis=0) / length, (n * back).sum(axis=0)
        y = np.sqrt(np.maximum((back * back).sum(axis=0) - along * along, 0))
        a, b = np.maximum(up, 0) * y, facing * (along * along + y * y) - up * along
        part = a / np.maximum(a + abs(b), 1e-37)
        out.append(np.where((b < 0) & (a > 0), 2 - part, part))
    return np.stack(out).astype(x.dtype)


def short_series(x):
    turn = 4 * x[1]
    t = math.pi / 2 * (turn - np.floor(turn + 0.5))
    square = t * t
    cosine = 1 - square / 2 * (1 - square / 12 * (1 - square / 30))
    sine = np.sqrt(1 - cosine * cosine) * np.sign(t)
    c, s = (np.choose(np.floor(turn + 0.5).astype(int) % 4, choices)
            for choices in ([cosine, -sine, -cosine, sine], [sine, cosine, -sine, -cosine]))
    return np.sqrt(x[0]) * np.stack([c, s, np.zeros_like(s)]) + np.stack([0 * c, 0 * c, np.sqrt(1 - x[0])])


def cancelling(x):
    n = np.maximum(x[0], 2.0)
    below = -4 / (n + 2)
    power = below * math.log(0.71)
    slope = 1 - (1 + below) * np.exp(power)
    half = (0.71 + 0.71 * np.expm1(power) / slope) / 2
    out = np.stack([half, half, half * np.sqrt(np.maximum(slope, 0))])
    return np.where(x[0] < 2, level_promises.ellipsoid_of(x), out)


def test_faults_of_kernels_show():
    with np.errstate(all="ignore"):
        assert figure("hssil.height", squares, real="float32") > 1
        assert not figure("bounds.tangent", cancelling, DIGITS, count=60) <= 1  # it ends in NaN
    assert figure("hemisphere.cosine", short_series) > 1
    assert figure("val.angle", lambda x: np.arccos(np.clip((x[:3] * x[3:]).sum(axis=0), -1, 1))[None]) > 1


@pytest.mark.parametrize("name", LADDERS)
def test_kernels_keep_their_formulas(name):
    ladder = LADDERS[name]
    maths, count = (EXTENDED, 2000) if ladder.extended else (DIGITS, 60)
    for real in ladder.reals:
        found = measure(ladder, maths, real, 17, count)
        assert found.figure <= ladder.limit
        assert found.bad == 0


def formula(name, *numbers):
    return [float(one[0]) for one in LADDERS[name].formula(DIGITS, [DIGITS.number(np.array([n])) for n in numbers])]


def test_references_agree_with_closed_forms():
    assert formula("val.angle", 1, 0, 0, 0, 2, 0) == pytest.approx([math.pi / 2])
    assert formula("val.angle", 1, 0, 0, -1, 0, 0) == pytest.approx([math.pi])
    assert formula("hemisphere.cosine", 0.25, 0.25) == pytest.approx([0, 0.5, math.sqrt(0.75)])
    assert formula("bounds.tangent", 1) == pytest.approx([3**-0.75, 1 - 3**-0.75, 3**-0.25 * math.sqrt(2 / 3)])
    assert formula("bounds.tangent", 2) == pytest.approx([0.5] * 3)  # F^2 = x - x^2, a sphere
    # a floor seen along its normal: beside it 0, before it a / (a + b) = 1.5 / (1.5 + 1), on its normal 1
    floor = (0, 0, -1, 0, 0, 1)
    assert formula("hssil.height", *floor, 1, 0, -1, 0) == [0, 0]
    assert formula("hssil.height", *floor, 1, 0, 0.5, 0) == pytest.approx([0.6] * 2)
    assert formula("hssil.height", *floor, 1e-9, 0, -0.5, 0)[0] == pytest.approx(1)

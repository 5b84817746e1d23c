"""Stages of crown sampling: shifted points, offsets and weights of samples, sum of their light (HSS Sec. 3.1, 3.2).

The points of a level are one Kronecker sequence (u, v): u says how far from the receiver, 2 pi v in which direction.
Each texel of a tile adds its own shift modulo 1. The random start of the shifts is given.
"""

import math
from typing import Any

import numpy as np

from refgi.settings import replaced
from refgi.sssil.crown.gather import gather
from refgi.sssil.crown.pattern import PHASES, tile_offsets
from refgi.sssil.crown.points import (
    FIRST_STEP,
    SECOND_STEP,
    key_shift,
    level_key,
    sample_points,
    tile_shifts,
)
from refgi.sssil.settings import HssilSettings, SamplingSettings
from refgi.vectors.recipe import Recipe, reading, writing
from refgi.vectors.spec import Array, Arrays, Bug, Run, Spec
from refgi.vectors.stages.levels import level_names, level_of

EQ4 = "HSS Eq. 4 with its pi (E-HSS-04): pi cos R^2 / (r^2 + R^2), R^2 = cos' ds / pi"
CROWN = "HSS Sec. 3.2: from r to 2 r around the receiver, at the first level the disc as well"
RECEIVER = ("position", "normal")
SENDER = ("position", "normal", "radiance", "area")
GOLDEN = 0.6180339887498949


def add_samples(recipe: Recipe, sampling: SamplingSettings, index: int, rows: int, radius: float) -> None:
    """Add shifts, offsets and weights of the samples of a level with a number of rows; patterns with tiles alone."""
    inner, crown = sampling.counts(index)
    tile = (rows, PHASES) if sampling.pattern == "row" else (sampling.tile, sampling.tile)
    name = f"samples{index}"
    shift, points, shifts = f"{name}.shift", f"{name}.points", f"{name}.shifts"
    start = key_shift(level_key(sampling.seed, sampling.first_level + index))
    recipe.give(shift, np.minimum(start, 1.0 - 2.0**-24), Spec("uv", "1", "random numbers: shift of the tile's first "
                                                               "texel"))
    recipe.facts[name] = {"disc": inner, "crown": crown, "radius": radius, "tile": list(tile),
                          "pattern": sampling.pattern, "density": sampling.density, "steps": [FIRST_STEP, SECOND_STEP]}
    _add_shifts(recipe, name, (inner, crown), tile)

    def run(arrays: Arrays, real: Any, r: float = radius, density: Any = sampling.density) -> Arrays:
        offsets, weight = tile_offsets(np.ascontiguousarray(arrays[points], real), inner,
                                       np.ascontiguousarray(arrays[shifts], real), r, density)
        return {f"{name}.offsets": offsets, f"{name}.weight": weight}

    def literal(**bugs: Any) -> Run:
        return lambda a, r: {**run(a, r), f"{name}.offsets": _offsets(
            a[points], a[shifts], inner, radius, sampling.density, **bugs)}

    other = "uniform" if sampling.density == "inverse_distance" else "inverse_distance"
    even = f"{name}__weight"
    bugs = [
        Bug(f"the density of samples is {other.replace('_', ' ')}", lambda a, r: run(a, r, density=other), CROWN),
        Bug("the crown reaches from 2 r to 4 r", lambda a, r: run(a, r, 2 * radius), CROWN),
        Bug("columns and rows are exchanged", writing(run, **{f"{name}__offsets": lambda a: a[..., ::-1]}), ""),
        Bug("rows run upwards", writing(run, **{f"{name}__offsets": lambda a: a * (1, -1)}), "row 0 is the top row"),
        Bug("offsets are cut off instead of rounded", literal(half=0.0), "texel centres (E-HSS-10)"),
        Bug("the disc is sampled by the crown's formula", literal(whole=True), CROWN) if inner else
        Bug("the crown is sampled by the disc's formula", literal(disc=True), CROWN),
        Bug("distance and direction are exchanged", literal(exchanged=True), "u is how far, v which way"),
        Bug("the crown has the weight of the disc", writing(run, **{even: lambda a: np.concatenate(
            [a[..., :inner], a[..., inner:] / 3], axis=-1)}), "3 pi r^2 / N (E-HSS-06)"),
        Bug("each sample stands for one texel", writing(run, **{even: np.ones_like}), "E-HSS-06"),
    ]
    bugs += [Bug("weights do not follow the density", writing(run, **{even: lambda a: np.broadcast_to(
        a.mean(axis=-1, keepdims=True), a.shape)}), CROWN)] if sampling.density != "uniform" else []
    recipe.add(name, "texels around a receiver that are its samples, and how many texels each stands for", run,
               (points, shifts), {
                   f"{name}.offsets": Spec("row modulo tile, column modulo tile, sample, (right, down)", "1",
                                           "texels from the receiver to the sample, the disc's first", tier="T0"),
                   f"{name}.weight": Spec("row modulo tile, column modulo tile, sample; 1: all alike", "1",
                                          "texels of this level that a sample stands for", paper="E-HSS-06"),
               }, paper=CROWN, bugs=tuple(bugs))


def add_gather(recipe: Recipe, settings: HssilSettings, index: int) -> None:
    """Add the light that each texel of a level receives of its samples."""
    name, number = f"gather{index}.irradiance", settings.sampling.first_level + index
    samples = f"samples{index}.offsets", f"samples{index}.weight"
    planes = level_names(index, *SENDER)
    plain = replaced(settings, {"sampling.pattern": "interleaved"})

    def run(arrays: Arrays, real: Any, how: HssilSettings = plain) -> Arrays:
        chosen = np.ascontiguousarray(arrays[samples[0]], np.int32), np.ascontiguousarray(arrays[samples[1]], real)
        return {name: gather(level_of(arrays, index, number, real), index, how, samples=chosen)}

    def literal(**bugs: Any) -> Run:
        return lambda arrays, real: {name: _gathered(arrays, index, **bugs)}  # noqa: ARG005

    def changed(**values: Any) -> Run:
        return lambda a, r: run(a, r, replaced(plain, values))

    printed = {key: changed(as_published=frozenset({key})) for key in ("hss_disc_pi", "hss_level_factor")}
    bugs = [
        Bug("Eq. 4 lacks its pi", printed["hss_disc_pi"], "E-HSS-04"),
        Bug("Eq. 3 in place of Eq. 4", changed(**{"senders.form_factor": "point"}), "HSS Eq. 4"),
        Bug("the disc is that of one texel, not of all that a sample stands for",
            changed(**{"senders.form_factor": "texel"}), "E-HSS-06"),
        Bug("the receiver's cosine is missing", literal(receiver=False), EQ4),
        Bug("the sender's cosine is missing", literal(sender=False), EQ4),
        Bug("senders that face away send light", literal(sender="abs"), EQ4),
        Bug("light arrives from behind the receiver", literal(receiver="abs"), EQ4),
        Bug("samples outside the picture are moved to its edge", literal(outside="edge"), "E-HSS-08"),
        Bug("samples outside the picture are made up for by those within", literal(outside="scaled"), "E-HSS-08"),
        Bug("weights of samples are left out", reading(run, **{f"samples{index}__weight": np.ones_like}), "E-HSS-06"),
        Bug("rows and columns of the tile are exchanged", literal(turned=True), "offsets[row % m, column % P]"),
        Bug("samples of the receiver's left neighbour", literal(moved=1), "offsets[row % m, column % P]"),
        Bug("rows run upwards", reading(run, **{f"samples{index}__offsets": lambda a: a * np.array(
            [1, -1], a.dtype)}), "row 0 is the top row"),
    ]
    if index:
        bugs.append(Bug("areas are scaled by 4^k a second time", printed["hss_level_factor"], "E-HSS-06"))
    recipe.facts[name.split(".")[0]] = {"form_factor": settings.senders.form_factor}
    recipe.add(name.split(".")[0], "irradiance of a level's texels by their samples, those outside the picture, on "
               "nothing or on the texel itself left out", run, (*planes, *samples), {
                   name: Spec("rgb, row, column", "W/m^2", "irradiance by this level; 0 without surface", "linear RGB",
                              EQ4)}, paper=f"HSS Eq. 1; {EQ4}", exact=(planes[0],), bugs=tuple(bugs))


def _add_shifts(recipe: Recipe, name: str, counts: tuple[int, int], tile: tuple[int, int]) -> None:
    inner, crown = counts

    def run(arrays: Arrays, real: Any, stretch: int = crown) -> Arrays:  # noqa: ARG001 one precision: double
        start = np.asarray(arrays[f"{name}.shift"], np.float64)
        return {f"{name}.points": sample_points(inner, crown),
                f"{name}.shifts": np.minimum(tile_shifts(start, tile, stretch), 1.0 - 2.0**-24)}

    def literal(
        steps: tuple[float, float] = (FIRST_STEP, SECOND_STEP), first: float = 0.5, column: bool = False
    ) -> Run:
        def wrong(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
            count = np.concatenate([np.arange(inner), np.arange(crown)])
            u, v = ((first + count * step) % 1 for step in steps)
            places = np.arange(tile[0] * tile[1]).reshape(tile[::-1] if column else tile)
            blocks = (places.T if column else places)[..., None] * crown
            return {f"{name}.points": np.stack([u, np.cos(2 * np.pi * v), np.sin(2 * np.pi * v)], axis=1),
                    f"{name}.shifts": (np.asarray(arrays[f"{name}.shift"], np.float64) + blocks * np.array(steps)) % 1}

        return wrong

    bugs = [
        Bug("the steps of u and v are exchanged", literal((SECOND_STEP, FIRST_STEP)), "1/g and 1/g^2, g^3 = g + 1"),
        Bug("steps of the golden ratio", literal((GOLDEN, GOLDEN**2)), "1/g and 1/g^2, g^3 = g + 1"),
        Bug("the sequence starts at 0 instead of 1/2", literal(first=0.0), "(1/2 + j step) mod 1"),
        Bug("all texels of the tile have the same shift", lambda a, r: run(a, r, 0), "n crown points further on"),
        Bug("the tile's texels are counted column by column", literal(column=True), "row by row"),
    ]
    bugs += [Bug("the disc's points count as skipped as well", lambda a, r: run(a, r, inner + crown),
                 "n crown points further on")] if inner else []
    recipe.add(f"shifts of {name}", "points of the sequence, j steps from 1/2, the disc's then the crown's; texel n of "
               "the tile, row by row, is shifted by n times the crown's number of steps more; all modulo 1, in double "
               "precision", run, (f"{name}.shift",), {
                   f"{name}.points": Spec("sample, (u, cos 2 pi v, sin 2 pi v)", "1", "points that all texels share"),
                   f"{name}.shifts": Spec("row of the tile, column of the tile, uv", "1",
                                          "what each texel of a tile adds to u and v, modulo 1"),
               }, paper=CROWN, exact=(f"{name}.shift",), bugs=tuple(bugs))


def _offsets(
    points: Array, shifts: Array, inner: int, radius: float, density: str, *, half: float = 0.5, whole: bool = False,
    disc: bool = False, exchanged: bool = False,
) -> Array:
    """Return the offsets of samples, in float64, with a bug."""
    share, turn = np.asarray(points[:, 0], np.float64), np.arctan2(points[:, 2], points[:, 1]) / (2 * np.pi)
    u, v = (share + shifts[..., :1]) % 1, (turn + shifts[..., 1:]) % 1
    u, v = (v, u) if exchanged else (u, v)
    near = np.where((np.arange(len(points)) < inner) & (not whole), 0.0, 0.0 if disc else 1.0)
    far = radius * (np.sqrt(near + (1 + 2 * near) * u) if density == "uniform" else near + u)
    place = np.stack([far * np.cos(2 * np.pi * v), far * np.sin(2 * np.pi * v)], axis=-1)
    return np.floor(place + half).astype(np.int32)


def _gathered(
    arrays: Arrays, index: int, *, receiver: Any = True, sender: Any = True, outside: str = "", turned: bool = False,
    moved: int = 0,
) -> Array:
    """Return the light of the samples, in float64, with a bug."""
    place, normal, radiance, area = (np.asarray(arrays[name], np.float64) for name in level_names(index, *SENDER))
    offsets, weight = arrays[f"samples{index}.offsets"], np.asarray(arrays[f"samples{index}.weight"], np.float64)
    row, column = np.arange(area.shape[0])[:, None], np.arange(area.shape[1])
    down, across = (column, row) if turned else (row, column - moved)
    here = offsets[down % len(offsets), across % offsets.shape[1]]
    stands_for = weight[down % len(weight), across % weight.shape[1]]
    i, j = row[..., None] + here[..., 1], column[..., None] + here[..., 0]
    known = (i >= 0) & (i < area.shape[0]) & (j >= 0) & (j < area.shape[1])
    i, j = np.clip(i, 0, area.shape[0] - 1), np.clip(j, 0, area.shape[1] - 1)
    stands_for = stands_for * (known | (outside == "edge")) * ((i != row[..., None]) | (j != column[..., None]))
    if outside == "scaled":
        stands_for = stands_for * known.shape[-1] / np.maximum(known.sum(axis=-1, keepdims=True), 1)
    d = place[:, i, j] - place[..., None]
    square = (d**2).sum(axis=0)
    r = np.sqrt(np.maximum(square, 1e-30))
    arriving, leaving = (normal[..., None] * d).sum(axis=0) / r, -(normal[:, i, j] * d).sum(axis=0) / r
    arriving, leaving = _cosine(arriving, receiver), _cosine(leaving, sender)
    disc = leaving * area[i, j] * stands_for / math.pi
    factor = math.pi * arriving * disc / np.maximum(square + disc, 1e-30)
    return np.asarray((factor * radiance[:, i, j]).sum(axis=-1))


def _cosine(cosine: Array, kind: Any) -> Array:
    return np.asarray(np.abs(cosine) if kind == "abs" else np.maximum(cosine, 0) if kind else (cosine > 0) * 1.0)

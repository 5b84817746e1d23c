"""Stages of one map's disc: places on the map, texels of the samples, their sum (Dachsbacher, Stamminger 2005)."""

import math
from typing import Any, NamedTuple

import numpy as np

from refgi.rsm.raster.projection import Projection, project
from refgi.splat.gather.gather_sum import GatherMap, centers, fill_texels, gather_discs
from refgi.vectors.recipe import Recipe, reading, writing
from refgi.vectors.spec import Array, Arrays, Bug, Run, Spec
from refgi.vectors.stages.pairs import RECEIVERS

OFFSET, WEIGHT = "gather.offset", "gather.weight"
PAPER = "RSM 2005, Sec. 4; docs/methods/gather"


class Disc(NamedTuple):
    """What scales a disc on one map."""

    radius: float  # map widths
    rows: int  # of one map
    columns: int

    @property
    def texels(self) -> float:
        """Texels in a square of the radius on one map."""
        return self.radius**2 * self.rows * self.columns


def add_centers(recipe: Recipe, index: int, maps: Projection, decided: bool) -> None:
    """Add the place of each pixel's surface point on a map; `decided`: as for `add_gather`."""
    name, center, depth = f"rsm{index}", f"gather{index}.center", f"gather{index}.depth"
    planes = (f"{name}.origin", f"{name}.frame", f"{name}.half")

    def run(arrays: Arrays, real: Any, inside: bool = True) -> Arrays:
        origin, frame, half = (np.ascontiguousarray(arrays[plane], np.float64) for plane in planes)
        here = maps._replace(origin=origin, frame=frame, half=half)
        shape, covered = arrays[RECEIVERS[2]].shape, np.asarray(arrays[RECEIVERS[2]]).reshape(-1) >= 0
        points = np.ascontiguousarray(np.asarray(arrays[RECEIVERS[0]], real).reshape(3, -1)[:, covered])
        places, depths = np.zeros((2, covered.size)), np.full(covered.size, np.inf)
        if covered.any():
            row, column, found = project(here, points)
            depths[covered] = np.where(np.isnan(found), np.inf, found)
            places[:, covered] = centers(here, points) if inside else np.where(np.isnan(row), -1, (row, column))
        return {center: places.reshape(2, *shape), depth: depths.reshape(shape)}

    scale = np.array([maps.height, maps.width])
    bugs = [
        Bug("rows run upwards", reading(run, **{f"{name}__frame": lambda a: a * np.array([[1], [-1], [1]])}),
            "row 0 is the top row"),
        Bug("rows and columns are exchanged", writing(run, **{f"gather{index}__center": lambda a: a[::-1]}),
            "row, column"),
        Bug("half a texel is subtracted", writing(run, **{f"gather{index}__center": lambda a: a - 0.5}),
            "centres at + 1/2"),
        Bug("places are shares of the map's side", writing(run, **{f"gather{index}__center": lambda a: (
            a.T / scale).T}), "texels"),
        Bug("points outside of the map gather nothing", lambda a, r: run(a, r, False),
            "the border on the straight way to the map's middle"),
        Bug("depth is the distance from the map's centre", _with_distance(run, f"{name}.origin", depth),
            "depth along the map's axis")]
    if maps.maps > 1:
        bugs.append(Bug("all maps are taken for the first", writing(run, **{f"gather{index}__center": lambda a: (
            np.stack([a[0] % maps.height, a[1]]))}), "maps are stacked along rows"))
    if maps.kind == 0:
        bugs.append(Bug("the perspective division is left out", _undivided(run, maps, name, center), "(x, y) / z"))
    recipe.add(f"gather{index}.center", "where on the map each pixel's surface point lies", run,
               (RECEIVERS[0], RECEIVERS[2], *planes), {
                   center: Spec("(row, column), row, column", "texel", "place on the stacked maps, texel centres at + "
                                "1/2; outside: where the straight way to the middle of the first map meets its border, "
                                "behind the lamp as far out as can be; 0 without surface"),
                   depth: Spec("row, column", "m", "depth along the axis of the map it lies on, whose border is part "
                               "of it; inf outside of all and without surface")},
               paper=PAPER, exact=(RECEIVERS[0], *planes) if decided else (), bugs=tuple(bugs))


def _with_distance(run: Run, origin: str, depth: str) -> Run:
    def altered(arrays: Arrays, real: Any) -> Arrays:
        made = dict(run(arrays, real))
        away = np.asarray(arrays[RECEIVERS[0]]) - np.asarray(arrays[origin])[0][:, None, None]
        return {**made, depth: np.where(np.isfinite(made[depth]), np.linalg.norm(away, axis=0), np.inf)}

    return altered


def _undivided(run: Run, maps: Projection, name: str, center: str) -> Run:
    def altered(arrays: Arrays, real: Any) -> Arrays:
        flat = np.asarray(arrays[RECEIVERS[0]], np.float64).reshape(3, -1)
        away = flat - np.asarray(arrays[f"{name}.origin"])[0][:, None]
        right, down, _ = np.asarray(arrays[f"{name}.frame"])[0] @ away
        half = np.asarray(arrays[f"{name}.half"])
        plane = np.clip(np.stack([down / half[1], right / half[0]]), -1, 1)
        made = dict(run(arrays, real))
        places = (plane + 1) / 2 * np.array([[maps.height], [maps.width]])
        return {**made, center: np.where(np.asarray(arrays[RECEIVERS[2]]) >= 0,
                                         places.reshape(2, *made[center].shape[1:]), 0)}

    return altered


def add_texels(recipe: Recipe, index: int, maps: Projection, disc: Disc, decided: bool) -> None:
    """Add the texel of each sample of each pixel's disc."""
    center, texel = f"gather{index}.center", f"gather{index}.texel"
    (rows, columns), side = maps.shape, np.array([disc.rows, disc.columns])

    def run(arrays: Arrays, real: Any, scale: Any = 1.0, cut: bool = True) -> Arrays:
        covered = np.asarray(arrays[RECEIVERS[2]]).reshape(-1) >= 0
        places = np.ascontiguousarray(np.asarray(arrays[center], real).reshape(2, -1)[:, covered])
        offsets = np.ascontiguousarray(arrays[OFFSET] * np.asarray(disc.radius * side * scale, real), real)
        found = np.full((len(offsets), covered.size), -1, np.int32)
        found[:, covered] = fill_texels(places, offsets, rows, columns, cut)
        return {texel: found.reshape(len(offsets), *np.asarray(arrays[RECEIVERS[2]]).shape)}

    dotted = f"gather{index}__center"
    recipe.add(f"gather{index}.texels", "the texel that each sample of each pixel's disc falls on", run,
               (center, OFFSET, RECEIVERS[2]), {texel: Spec(
                   "sample, row, column", "1", "row * columns + column over the stacked maps; -1 outside and without "
                   "surface", tier="T0", index_of=(rows, columns))}, paper=PAPER, exact=(center, OFFSET)
                   if decided else (), bugs=(
                   Bug("texels are rounded instead of cut", reading(run, **{dotted: lambda a: a + 0.5}), "floor"),
                   Bug("beyond the border the nearest texel is taken", lambda a, r: run(a, r, cut=False),
                       "texels outside of the map count 0"),
                   Bug("the radius is one of texels, not of map widths", lambda a, r: run(a, r, 1 / side),
                       "radius times the map's side"),
                   Bug("the radius is a share of half the map", lambda a, r: run(a, r, 0.5), "map widths"),
                   Bug("offsets along rows and columns are exchanged", reading(
                       run, gather__offset=lambda a: a[:, ::-1]), "down, right"),
                   Bug("the disc is turned over: up for down", reading(run, gather__offset=lambda a: a * (-1, 1)),
                       "down, right")))


def add_disc_sum(recipe: Recipe, index: int, disc: Disc, offset: float) -> None:
    """Add the irradiance of one map's texels."""
    name, texel, light = f"rsm{index}", f"gather{index}.texel", f"gather{index}.irradiance"
    surface = tuple(f"{name}.{key}" for key in ("position", "normal", "flux"))

    def run(arrays: Arrays, real: Any) -> Arrays:
        covered = np.asarray(arrays[RECEIVERS[2]]).reshape(-1) >= 0
        points, normals = (np.ascontiguousarray(np.asarray(arrays[one], real).reshape(3, -1)[:, covered])
                           for one in RECEIVERS[:2])
        position, normal, flux = (np.asarray(arrays[one], real) for one in surface)
        source = GatherMap(*(np.ascontiguousarray(one) for one in (position - real(offset) * normal, normal, flux)))
        samples, total = np.asarray(arrays[texel]).reshape(-1, covered.size)[:, covered], np.zeros_like(points)
        scale = real(disc.texels / (math.pi * len(samples)))
        for chosen, weight in zip(samples, np.asarray(arrays[WEIGHT], np.float64), strict=True):
            middle = np.where(chosen < 0, -1.0, np.stack(np.divmod(chosen, flux.shape[2])) + 0.5)
            gather_discs(points, normals, np.ascontiguousarray(middle), source, np.array([[0.0, 0.0, weight]]), scale,
                         total)
        light_of = np.zeros((3, covered.size), real)
        light_of[:, covered] = total
        return {light: light_of.reshape(arrays[RECEIVERS[0]].shape)}

    def literal(**bugs: Any) -> Run:
        def altered(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
            return {light: literal_sum(arrays, index, disc, offset, **bugs)}

        return altered

    recipe.add(f"gather{index}.sum", "irradiance of the texels in each pixel's disc", run,
               (*RECEIVERS, texel, WEIGHT, *surface), {light: Spec(
                   "rgb, row, column", "W/m^2", "R^2 T / S sum of weight E_t, T texels of one map, S samples, R radius "
                   "in map widths, E_t the light of one texel by Eq. 2; without albedo/pi", "linear RGB")},
               paper=PAPER, exact=(RECEIVERS[0], surface[0]), bugs=(
                   Bug("the distance does not count", literal(power=0), "RSM 2005: 1/r^4 with vectors not "
                       "normalised"),
                   Bug("1/r^4 with unit directions", literal(power=4), "E-SII-02"),
                   Bug("1/r in place of 1/r^2", literal(power=1), "E-SII-02"),
                   Bug("the receiver's cosine is missing", literal(receiver=False), "Eq. 2"),
                   Bug("the texel's cosine is missing", literal(sender=False), "Eq. 2"),
                   Bug("cosines are taken as absolute values", literal(either=True), "<a.b> = max(0, a.b)"),
                   Bug("weights do not count", reading(run, gather__weight=np.ones_like), "papers A.5"),
                   Bug("the number of texels is left out", writing(run, **{
                       f"gather{index}__irradiance": lambda a: a / (disc.rows * disc.columns)}), "papers A.5"),
                   Bug("the radius is not squared", writing(run, **{
                       f"gather{index}__irradiance": lambda a: a / disc.radius}), "papers A.5"),
                   Bug("only samples on the map are counted", literal(on_map=True), "texels outside count 0"),
                   Bug("1/pi is left out", writing(run, **{f"gather{index}__irradiance": lambda a: a * np.pi}),
                       "Eq. 1")))


def literal_sum(
    arrays: Arrays, index: int, disc: Disc, offset: float, *, power: int = 2, receiver: bool = True,
    sender: bool = True, either: bool = False, on_map: bool = False,
) -> Array:
    """Return the gathered sum with a bug, in float64: (3, h, w)."""
    x, n = (np.asarray(arrays[name], np.float64) for name in RECEIVERS[:2])
    texel, weight = np.asarray(arrays[f"gather{index}.texel"]), np.asarray(arrays[WEIGHT], np.float64)
    p, normal, flux = (np.asarray(arrays[f"rsm{index}.{key}"], np.float64).reshape(3, -1) for key in (
        "position", "normal", "flux"))
    total, counted = np.zeros_like(x), np.zeros(x.shape[1:])
    for one, share in zip(texel, weight, strict=True):
        here = one >= 0
        d = x - (p - offset * normal)[:, one]
        r = np.linalg.norm(d, axis=0)
        w = np.divide(d, r, out=np.zeros_like(d), where=r > 0)
        cut = np.abs if either else lambda cosine: np.maximum(0, cosine)
        leaving, arriving = (normal[:, one] * w).sum(axis=0), -(n * w).sum(axis=0)
        fall = np.divide(1.0, r**power, out=np.zeros_like(r), where=r > 0)
        term = (cut(leaving) if sender else leaving > 0) * fall / math.pi
        term = term * (cut(arriving) if receiver else arriving > 0)
        total += np.where(here, share * term, 0) * flux[:, one]
        counted += here
    scale = disc.texels / (np.maximum(counted, 1) if on_map else len(texel))
    return np.asarray(total * scale)



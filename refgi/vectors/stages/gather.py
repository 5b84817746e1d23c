"""Stages of gathering from reflective shadow maps: discs of texels, sums, interpolation (Dachsbacher, Stamminger 2005).

The samples xi_1, xi_2 are data. A disc's radius is a share of a map's side; texels of several maps lie on one sheet.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from refgi.pairs.irradiance import Receivers
from refgi.rsm.buffers.light_projection import light_projection
from refgi.rsm.raster.projection import Projection, project
from refgi.scene import Scene
from refgi.splat.gather.gather import DiscSettings, Interpolation
from refgi.splat.gather.gather_sum import GatherMap, centers, disc_offsets, fill_texels, gather_discs
from refgi.splat.gather.interpolation import SimilarityLimits, coarse_pixels, interpolate
from refgi.vectors.recipe import Recipe, reading, writing
from refgi.vectors.spec import Array, Arrays, Decoy, Run, Spec
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


def add_gather(
    recipe: Recipe, scene: Scene, resolution: int, disc: DiscSettings, points: Array, *, decided: bool = False
) -> None:
    """Add the gathered light of all maps; `points` (samples, 2) are xi_1 and xi_2.

    `decided`: places on the maps are exact numbers, such as those on a border, and decide.
    """
    count = len(scene.lights)
    squared = "rsm_weight_squared" in disc.as_published
    _add_pattern(recipe, points, squared)
    recipe.facts["gather"] = {"samples": len(points), "radius": disc.radius, "offset": disc.offset,
                              "weights_squared": squared}
    recipe.factors["samples"] = float(len(points))
    for index in range(count):
        maps = light_projection(scene.lights[index], scene.geometry, resolution)
        here = Disc(disc.radius, maps.height, maps.width)
        recipe.factors[f"texels of a map of rsm{index}"] = float(maps.height * maps.width)
        _add_centers(recipe, index, maps, decided)
        _add_texels(recipe, index, maps, here, decided)
        _add_disc_sum(recipe, index, here, disc.offset)
    _add_total(recipe, count)


def _add_pattern(recipe: Recipe, points: Array, squared: bool) -> None:
    recipe.give("gather.xi", points, Spec("sample, (xi1, xi2)", "1", "numbers in [0, 1): radius and angle of samples"))

    def run(arrays: Arrays, real: Any, square: bool = squared) -> Arrays:
        pattern = disc_offsets(np.asarray(arrays["gather.xi"], real), square)
        return {OFFSET: pattern[:, :2], WEIGHT: pattern[:, 2]}

    def equal_area(arrays: Arrays, real: Any) -> Arrays:
        return run({"gather.xi": np.asarray(arrays["gather.xi"], real) ** (0.5, 1)}, real)

    weights = "2 pi xi1; the weights' mean is the disc's area, pi" if not squared else "3 pi xi1^2, as is often done"
    recipe.add("gather.pattern", "offsets in a disc of radius 1 and their weights", run, ("gather.xi",), {
        OFFSET: Spec("sample, (down, right)", "1", "xi1 (cos, sin)(2 pi xi2), radii"),
        WEIGHT: Spec("sample", "1", weights)}, paper=PAPER, decoys=(
            Decoy("weights are xi1" if squared else "weights are xi1^2", lambda a, r: run(a, r, not squared),
                  "papers A.5: density 1 / (2 pi rho)"),
            Decoy("all weights are equal", writing(run, gather__weight=lambda a: np.full_like(a, np.pi)), "papers A.5"),
            Decoy("samples are spread evenly over the disc's area", equal_area, "radius xi1, not its root"),
            Decoy("cosine and sine are exchanged", writing(run, gather__offset=lambda a: a[:, ::-1]), "down, right"),
            Decoy("xi2 is the radius and xi1 the angle", reading(run, gather__xi=lambda a: a[:, ::-1]), "xi1: radius"),
            Decoy("the angle runs over half a turn", reading(run, gather__xi=lambda a: a * (1, 0.5)), "2 pi xi2"),
            Decoy("2 pi is left out of the weights", writing(run, gather__weight=lambda a: a / (2 * np.pi)), "papers A.5")))


def _add_centers(recipe: Recipe, index: int, maps: Projection, decided: bool) -> None:
    name, center, depth = f"rsm{index}", f"gather{index}.center", f"gather{index}.depth"
    planes = (f"{name}.origin", f"{name}.frame", f"{name}.half")

    def run(arrays: Arrays, real: Any, inside: bool = True) -> Arrays:
        here = maps._replace(**{key: np.ascontiguousarray(arrays[f"{name}.{key}"], np.float64) for key in (
            "origin", "frame", "half")})
        shape, covered = arrays[RECEIVERS[2]].shape, np.asarray(arrays[RECEIVERS[2]]).reshape(-1) >= 0
        points = np.ascontiguousarray(np.asarray(arrays[RECEIVERS[0]], real).reshape(3, -1)[:, covered])
        places, depths = np.zeros((2, covered.size)), np.full(covered.size, np.inf)
        if covered.any():
            row, column, found = project(here, points)
            depths[covered] = np.where(np.isnan(found), np.inf, found)
            places[:, covered] = centers(here, points) if inside else np.where(np.isnan(row), -1, (row, column))
        return {center: places.reshape(2, *shape), depth: depths.reshape(shape)}

    scale = np.array([maps.height, maps.width])
    decoys = [
        Decoy("rows run upwards", reading(run, **{f"{name}__frame": lambda a: a * np.array([[1], [-1], [1]])}),
              "row 0 is the top row"),
        Decoy("rows and columns are exchanged", writing(run, **{f"gather{index}__center": lambda a: a[::-1]}),
              "row, column"),
        Decoy("half a texel is subtracted", writing(run, **{f"gather{index}__center": lambda a: a - 0.5}),
              "centres at + 1/2"),
        Decoy("places are shares of the map's side", writing(run, **{f"gather{index}__center": lambda a: (
            a.T / scale).T}), "texels"),
        Decoy("points outside of the map gather nothing", lambda a, r: run(a, r, False),
              "the border on the straight way to the map's middle"),
        Decoy("depth is the distance from the map's centre", _with_distance(run, f"{name}.origin", depth),
              "depth along the map's axis")]
    if maps.maps > 1:
        decoys.append(Decoy("all maps are taken for the first", writing(run, **{f"gather{index}__center": lambda a: (
            np.stack([a[0] % maps.height, a[1]]))}), "maps are stacked along rows"))
    if maps.kind == 0:
        decoys.append(Decoy("the perspective division is left out", _undivided(run, maps, name, center), "(x, y) / z"))
    recipe.add(f"gather{index}.center", "where on the map each pixel's surface point lies", run,
               (RECEIVERS[0], RECEIVERS[2], *planes), {
                   center: Spec("(row, column), row, column", "texel", "place on the stacked maps, texel centres at + 1/2; "
                                "outside: where the straight way to the middle of the first map meets its border, behind "
                                "the lamp as far out as can be; 0 without surface"),
                   depth: Spec("row, column", "m", "depth along the axis of the map it lies on, whose border is part of it; inf outside "
                               "of all and without surface")},
               paper=PAPER, exact=(RECEIVERS[0], *planes) if decided else (), decoys=tuple(decoys))


def _with_distance(run: Run, origin: str, depth: str) -> Run:
    def altered(arrays: Arrays, real: Any) -> Arrays:
        made = dict(run(arrays, real))
        away = np.asarray(arrays[RECEIVERS[0]]) - np.asarray(arrays[origin])[0][:, None, None]
        return {**made, depth: np.where(np.isfinite(made[depth]), np.linalg.norm(away, axis=0), np.inf)}

    return altered


def _undivided(run: Run, maps: Projection, name: str, center: str) -> Run:
    def altered(arrays: Arrays, real: Any) -> Arrays:
        flat = np.asarray(arrays[RECEIVERS[0]], np.float64).reshape(3, -1)
        right, down, _ = np.asarray(arrays[f"{name}.frame"])[0] @ (flat - np.asarray(arrays[f"{name}.origin"])[0][:, None])
        half = np.asarray(arrays[f"{name}.half"])
        plane = np.clip(np.stack([down / half[1], right / half[0]]), -1, 1)
        made = dict(run(arrays, real))
        places = (plane + 1) / 2 * np.array([[maps.height], [maps.width]])
        return {**made, center: np.where(np.asarray(arrays[RECEIVERS[2]]) >= 0, places.reshape(2, *made[center].shape[1:]), 0)}

    return altered


def _add_texels(recipe: Recipe, index: int, maps: Projection, disc: Disc, decided: bool) -> None:
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
                   "surface", tier="T0", index_of=(rows, columns))}, paper=PAPER, exact=(center, OFFSET) if decided else (), decoys=(
                   Decoy("texels are rounded instead of cut", reading(run, **{dotted: lambda a: a + 0.5}), "floor"),
                   Decoy("beyond the border the nearest texel is taken", lambda a, r: run(a, r, cut=False),
                         "texels outside of the map count 0"),
                   Decoy("the radius is one of texels, not of map widths", lambda a, r: run(a, r, 1 / side),
                         "radius times the map's side"),
                   Decoy("the radius is a share of half the map", lambda a, r: run(a, r, 0.5), "map widths"),
                   Decoy("offsets along rows and columns are exchanged", reading(
                       run, gather__offset=lambda a: a[:, ::-1]), "down, right"),
                   Decoy("the disc is turned over: up for down", reading(run, gather__offset=lambda a: a * (-1, 1)),
                         "down, right")))


def _add_disc_sum(recipe: Recipe, index: int, disc: Disc, offset: float) -> None:
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
            gather_discs(points, normals, np.ascontiguousarray(middle), source, np.array([[0.0, 0.0, weight]]), scale, total)
        light_of = np.zeros((3, covered.size), real)
        light_of[:, covered] = total
        return {light: light_of.reshape(arrays[RECEIVERS[0]].shape)}

    def literal(**bugs: Any) -> Run:
        def altered(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
            return {light: literal_sum(arrays, index, disc, offset, **bugs)}

        return altered

    recipe.add(f"gather{index}.sum", "irradiance of the texels in each pixel's disc", run,
               (*RECEIVERS, texel, WEIGHT, *surface), {light: Spec(
                   "rgb, row, column", "W/m^2", "R^2 T / S sum of weight E_t, T texels of one map, S samples, R radius in "
                   "map widths, E_t the light of one texel by Eq. 2; without albedo/pi", "linear RGB")},
               paper=PAPER, exact=(RECEIVERS[0], surface[0]), decoys=(
                   Decoy("the distance does not count", literal(power=0), "RSM 2005: 1/r^4 with vectors not normalised"),
                   Decoy("1/r^4 with unit directions", literal(power=4), "E-SII-02"),
                   Decoy("1/r in place of 1/r^2", literal(power=1), "E-SII-02"),
                   Decoy("the receiver's cosine is missing", literal(receiver=False), "Eq. 2"),
                   Decoy("the texel's cosine is missing", literal(sender=False), "Eq. 2"),
                   Decoy("cosines are taken as absolute values", literal(either=True), "<a.b> = max(0, a.b)"),
                   Decoy("weights do not count", reading(run, gather__weight=np.ones_like), "papers A.5"),
                   Decoy("the number of texels is left out", writing(run, **{
                       f"gather{index}__irradiance": lambda a: a / (disc.rows * disc.columns)}), "papers A.5"),
                   Decoy("the radius is not squared", writing(run, **{
                       f"gather{index}__irradiance": lambda a: a / disc.radius}), "papers A.5"),
                   Decoy("only samples on the map are counted", literal(on_map=True), "texels outside count 0"),
                   Decoy("1/pi is left out", writing(run, **{f"gather{index}__irradiance": lambda a: a * np.pi}), "Eq. 1")))


def literal_sum(
    arrays: Arrays, index: int, disc: Disc, offset: float, *, power: int = 2, receiver: bool = True, sender: bool = True,
    either: bool = False, on_map: bool = False,
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
        term = (cut(leaving) if sender else leaving > 0) * (cut(arriving) if receiver else arriving > 0) * fall / math.pi
        total += np.where(here, share * term, 0) * flux[:, one]
        counted += here
    scale = disc.texels / (np.maximum(counted, 1) if on_map else len(texel))
    return np.asarray(total * scale)


def _add_total(recipe: Recipe, count: int) -> None:
    names = tuple(f"gather{index}.irradiance" for index in range(count))

    def run(arrays: Arrays, real: Any, maps: int = count) -> Arrays:
        total = np.zeros_like(np.asarray(arrays[names[0]], real))
        for name in names[:maps]:
            total += arrays[name]
        return {"gather.sum": total}

    recipe.add("gather.sum", "light of all maps", run, names, {"gather.sum": Spec(
        "rgb, row, column", "W/m^2", "gathered irradiance where every pixel runs the sum", "linear RGB")}, paper=PAPER,
        decoys=() if count == 1 else (
            Decoy("only the first map", lambda a, r: run(a, r, 1), "all lamps"),
            Decoy("the mean over the maps", writing(run, gather__sum=lambda a: a / count), "the sum of all lamps")))


def add_interpolation(recipe: Recipe, settings: Interpolation) -> None:
    """Add the light interpolated between coarse pixels, where these are similar, in place of the sum."""
    known = recipe.expected()
    covered = known[RECEIVERS[2]] >= 0
    reach = settings.reach * float(np.linalg.norm(np.ptp(known[RECEIVERS[0]][:, covered].astype(np.float64), axis=1)))
    coarse = coarse_pixels(*covered.shape, settings.grid)
    recipe.facts["gather.interpolation"] = {"rows": coarse[0].tolist(), "columns": coarse[1].tolist(),
                                            "least_cosine": settings.least_cosine, "reach": reach, "least_similar": 3}

    alike = SimilarityLimits(settings.least_cosine, reach)

    def run(arrays: Arrays, real: Any, limits: SimilarityLimits = alike, places: tuple[Array, Array] = coarse) -> Arrays:
        position, normal, light = (np.ascontiguousarray(arrays[name], real) for name in (*RECEIVERS[:2], "gather.sum"))
        at = Receivers(position, normal, np.asarray(arrays[RECEIVERS[2]]) >= 0)
        result, chosen = interpolate(at, light, places, limits)
        return {"gather.interpolated": chosen, "gather.irradiance": np.where(chosen, result, light)}

    def between(low: Array, size: int) -> Array:
        return np.asarray(np.minimum(low + 1, size - 1))

    recipe.add("gather.interpolate", "light of similar coarse pixels where three of four around a pixel are, else its sum",
               run, (*RECEIVERS, "gather.sum"), {
                   "gather.interpolated": Spec("row, column", "1", "true where light is interpolated, and at coarse pixels",
                                               tier="T0"),
                   "gather.irradiance": Spec("rgb, row, column", "W/m^2", "indirect irradiance", "linear RGB")},
               paper="RSM 2005, Sec. 4; SII Fig. 12", exact=(RECEIVERS[0],), decoys=(
                   Decoy("normals are not compared", lambda a, r: run(a, r, SimilarityLimits(-2.0, reach)), "similar pixels"),
                   Decoy("places are not compared", lambda a, r: run(a, r, SimilarityLimits(
                       settings.least_cosine, math.inf)), "similar pixels"),
                   Decoy("the reach is not scaled by the picture's extent", lambda a, r: run(a, r, SimilarityLimits(
                       settings.least_cosine, settings.reach)), "reach times the diagonal"),
                   Decoy("coarse pixels are the first of their cells", lambda a, r: run(a, r, places=_first(coarse, covered)),
                         "the middles of cells"),
                   Decoy("coarse pixels are one further", lambda a, r: run(a, r, places=(
                       between(coarse[0], covered.shape[0]), between(coarse[1], covered.shape[1]))), "the middles of cells"),
                   Decoy("every pixel runs the sum", lambda a, r: {**run(a, r), "gather.irradiance": np.asarray(
                       a["gather.sum"])}, "interpolated where similar"),
                   Decoy("coarse pixels of any surface count", lambda a, r: run(a, r, SimilarityLimits(-2.0, math.inf)),
                         "similar pixels")))


def _first(coarse: tuple[Array, Array], covered: Array) -> tuple[Array, Array]:
    rows, columns = (np.arange(len(one)) * size // len(one) for one, size in zip(coarse, covered.shape, strict=True))
    return rows, columns

"""Stages of one map's disc: places on the map, texels of the samples, their sum (Dachsbacher, Stamminger 2005)."""

import math
from typing import Any, NamedTuple

import numpy as np

from refgi.literal import gather as literal
from refgi.rsm.raster.projection import ORTHOGRAPHIC, PARABOLOID, PERSPECTIVE, Projection, project
from refgi.splat.gather.gather_sum import GatherMap, centers, fill_texels, gather_discs
from refgi.vectors.recipe import Recipe
from refgi.vectors.rows import Form
from refgi.vectors.spec import Arrays, Spec
from refgi.vectors.stages.pairs import RECEIVERS

KINDS = {PERSPECTIVE: "perspective", ORTHOGRAPHIC: "orthographic", PARABOLOID: "paraboloid"}
OFFSET, WEIGHT = "gather.offset", "gather.weight"
PAPER = "RSM 2005, Sec. 4; docs/methods/gather"


class Disc(NamedTuple):
    """What scales a disc on one map."""

    radius: float  # map widths
    rows: int  # of one map
    columns: int

    @property
    def texels(self) -> int:
        """Texels of one map."""
        return self.rows * self.columns


def add_centers(recipe: Recipe, index: int, maps: Projection, decided: bool) -> None:
    """Add the place of each pixel's surface point on a map; `decided`: as for `add_gather`."""
    name, center, depth = f"rsm{index}", f"gather{index}.center", f"gather{index}.depth"
    planes = (f"{name}.origin", f"{name}.frame", f"{name}.half")

    def run(arrays: Arrays, real: Any) -> Arrays:
        origin, frame, half = (np.ascontiguousarray(arrays[plane], np.float64) for plane in planes)
        here = maps._replace(origin=origin, frame=frame, half=half)
        shape, covered = arrays[RECEIVERS[2]].shape, np.asarray(arrays[RECEIVERS[2]]).reshape(-1) >= 0
        points = np.ascontiguousarray(np.asarray(arrays[RECEIVERS[0]], real).reshape(3, -1)[:, covered])
        places, depths = np.zeros((2, covered.size)), np.full(covered.size, np.inf)
        if covered.any():
            found = project(here, points)[2]
            depths[covered] = np.where(np.isnan(found), np.inf, found)
            places[:, covered] = centers(here, points)
        return {center: places.reshape(2, *shape), depth: depths.reshape(shape)}

    kind = KINDS[maps.kind]
    form = Form(literal.centers, {"position": RECEIVERS[0], "triangle_id": RECEIVERS[2], **dict(zip(
        ("origin", "frame", "half"), planes, strict=True))}, (center, depth), {
            "rows": maps.height, "columns": maps.width, "kind": kind})
    lists = ("centers", *(["centers/stacked"] if maps.maps > 1 else []), *(
        ["centers/perspective"] if kind == "perspective" else []))
    recipe.add(f"gather{index}.center", "where on the map each pixel's surface point lies", run,
               (RECEIVERS[0], RECEIVERS[2], *planes), {
                   center: Spec("(row, column), row, column", "texel", "place on the stacked maps, texel centres at + "
                                "1/2; outside: where the straight way to the middle of the first map meets its border, "
                                "behind the lamp as far out as can be; 0 without surface"),
                   depth: Spec("row, column", "m", "depth along the axis of the map it lies on, whose border is part "
                               "of it; inf outside of all and without surface")},
               paper=PAPER, exact=(RECEIVERS[0], *planes) if decided else (), bugs=form.bugs(*lists),
               variants=(form,))


def add_texels(recipe: Recipe, index: int, maps: Projection, disc: Disc, decided: bool) -> None:
    """Add the texel of each sample of each pixel's disc."""
    center, texel = f"gather{index}.center", f"gather{index}.texel"
    (rows, columns), side = maps.shape, np.array([disc.rows, disc.columns])

    def run(arrays: Arrays, real: Any) -> Arrays:
        covered = np.asarray(arrays[RECEIVERS[2]]).reshape(-1) >= 0
        places = np.ascontiguousarray(np.asarray(arrays[center], real).reshape(2, -1)[:, covered])
        offsets = np.ascontiguousarray(arrays[OFFSET] * np.asarray(disc.radius * side, real), real)
        found = np.full((len(offsets), covered.size), -1, np.int32)
        found[:, covered] = fill_texels(places, offsets, rows, columns)
        return {texel: found.reshape(len(offsets), *np.asarray(arrays[RECEIVERS[2]]).shape)}

    form = Form(literal.disc_texels, {"center": center, "offset": OFFSET, "triangle_id": RECEIVERS[2]}, (texel,), {
        "radius": disc.radius, "maps": maps.maps, "rows": disc.rows, "columns": disc.columns})
    recipe.add(f"gather{index}.texels", "the texel that each sample of each pixel's disc falls on", run,
               (center, OFFSET, RECEIVERS[2]), {texel: Spec(
                   "sample, row, column", "1", "row * columns + column over the stacked maps; -1 outside and without "
                   "surface", tier="T0", index_of=(rows, columns))}, paper=PAPER, exact=(center, OFFSET)
                   if decided else (), bugs=form.bugs("texels"), variants=(form,))


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
        scale = real(disc.radius**2 * disc.texels / (math.pi * len(samples)))
        for chosen, weight in zip(samples, np.asarray(arrays[WEIGHT], np.float64), strict=True):
            middle = np.where(chosen < 0, -1.0, np.stack(np.divmod(chosen, flux.shape[2])) + 0.5)
            gather_discs(points, normals, np.ascontiguousarray(middle), source, np.array([[0.0, 0.0, weight]]), scale,
                         total)
        light_of = np.zeros((3, covered.size), real)
        light_of[:, covered] = total
        return {light: light_of.reshape(arrays[RECEIVERS[0]].shape)}

    form = Form(literal.disc_sum, {
        "position": RECEIVERS[0], "normal": RECEIVERS[1], "triangle_id": RECEIVERS[2], "texel": texel, "weight": WEIGHT,
        **dict(zip(("surface", "surface_normal", "flux"), surface, strict=True))}, (light,), {
            "radius": disc.radius, "texels": disc.texels, "offset": offset})
    recipe.add(f"gather{index}.sum", "irradiance of the texels in each pixel's disc", run,
               (*RECEIVERS, texel, WEIGHT, *surface), {light: Spec(
                   "rgb, row, column", "W/m^2", "R^2 T / S sum of weight E_t, T texels of one map, S samples, R radius "
                   "in map widths, E_t the light of one texel by Eq. 2; without albedo/pi", "linear RGB")},
               paper=PAPER, exact=(RECEIVERS[0], surface[0]), bugs=form.bugs("sum"), variants=(form,))

"""Stages of light at subsplats: points, Eq. 2, upsampling by levels, Eq. 3 (Nichols and Wyman 2009, Sec. 3.4, 3.5).

A level is the irradiance of its cells and a mask of those that hold any, evaluated there or at a coarser level.
"""

from typing import Any

import numpy as np

from refgi.pairs.settings import PairSettings
from refgi.settings import replaced
from refgi.splat.multires.settings import Representative
from refgi.splat.multires.subsplats.detail import surface_detail
from refgi.splat.multires.subsplats.evaluate import evaluate, points_of
from refgi.vectors.bugs.detail import detail_bugs, light_bugs
from refgi.vectors.bugs.pair import pair_bugs
from refgi.vectors.bugs.subsplat import point_bugs
from refgi.vectors.recipe import Recipe, reading
from refgi.vectors.spec import Arrays, Bug, Run, Spec
from refgi.vectors.stages.buffers import VECTOR
from refgi.vectors.stages.lights import light_names, pixel_lights_of
from refgi.vectors.stages.multires_list import SUBSPLATS, subsplats_of
from refgi.vectors.stages.multires_ranges import covered_of, everywhere
from refgi.vectors.stages.multires_upsample import LIGHT
from refgi.vectors.stages.pairs import RECEIVERS

POINTS = ("multires.point", "multires.normal")
EQ2 = "AMS Eq. 2, E only; E-AMS-02"


def add_points(recipe: Recipe, representative: Representative, top: int) -> None:
    """Add the point and normal that each subsplat is evaluated at."""
    def run(arrays: Arrays, real: Any, how: Representative = representative) -> Arrays:
        position, normal = (np.ascontiguousarray(arrays[name], real) for name in RECEIVERS[:2])
        return dict(zip(POINTS, points_of(position, normal, covered_of(arrays), subsplats_of(arrays, top), how),
                        strict=True))

    def exchanged(arrays: Arrays, real: Any) -> Arrays:
        (height, width), pixel = covered_of(arrays).shape, np.asarray(arrays[SUBSPLATS[3]])
        turned = np.minimum(pixel % width, height - 1) * width + np.minimum(pixel // width, width - 1)
        return run({**arrays, SUBSPLATS[3]: turned}, real)

    other: Representative = "pixel" if representative == "mean" else "mean"
    bugs = [Bug("the mean (average) of the cell's surface, not its representative pixel" if other == "mean" else
                "the representative pixel alone, not the mean of the cell's surface",
                lambda a, r: run(a, r, other), "E-AMS-11"),
            Bug("rows and columns of pixels are exchanged", exchanged, "row * width + column")]
    if representative == "mean":
        bugs += [Bug("pixels without surface count as points at 0", reading(
            run, gbuffer__triangle_id=everywhere), "mean of the surface"),
            Bug("mean normals are not made unit vectors (not normalised)", _shortened(run, top), "unit vectors")]
    bugs += point_bugs(representative)
    recipe.add("multires.points", "where each subsplat is evaluated: its " + (
        "representative pixel" if representative == "pixel" else "mean surface"), run, (*RECEIVERS, *SUBSPLATS), {
            POINTS[0]: Spec("xyz, subsplat", "m", "surface point", "world"),
            POINTS[1]: Spec("xyz, subsplat", VECTOR, "its normal", "world")},
        paper="AMS Sec. 3.4; E-AMS-11", exact=RECEIVERS[:2] if representative == "pixel" else (), bugs=tuple(bugs))


def _shortened(run: Run, top: int) -> Run:
    """Return the stage with means of normals as they are, on the side and at the place of the unit ones."""
    def altered(arrays: Arrays, real: Any) -> Arrays:
        made, here = dict(run(arrays, real)), covered_of(arrays)
        subsplats, means = subsplats_of(arrays, top), np.array(made[POINTS[1]])
        for k, (level, row, column) in enumerate(zip(*subsplats[:3], strict=True)):
            cell = np.s_[int(row) << level : int(row + 1) << level, int(column) << level : int(column + 1) << level]
            means[:, k] = np.asarray(arrays[RECEIVERS[1]])[:, *cell][:, here[cell]].mean(axis=1)
        return {**made, POINTS[1]: means}

    return altered


def add_irradiance(recipe: Recipe, pairs: PairSettings) -> None:
    """Add Eq. 2 at every subsplat."""
    names, area = light_names(recipe), ("lights.area",) if pairs.needs_footprints else ()

    def sums(arrays: Arrays, real: Any, how: PairSettings = pairs) -> Arrays:
        points, normals = (np.ascontiguousarray(arrays[name][:, 0], real) for name in RECEIVERS[:2])
        footprint = np.ascontiguousarray(arrays["lights.area"], np.float64) if area else None
        return {"sum.irradiance": evaluate(points, normals, pixel_lights_of(arrays, real), how, footprint)[:, None]}

    def at_points(inner: Run) -> Run:
        """Return the stage at subsplats of what reads pixels and writes their sum."""
        def run(arrays: Arrays, real: Any) -> Arrays:
            pixels = {RECEIVERS[0]: arrays[POINTS[0]][:, None], RECEIVERS[1]: arrays[POINTS[1]][:, None],
                      RECEIVERS[2]: np.zeros((1, arrays[POINTS[0]].shape[1]), np.int32)}
            return {LIGHT: inner({**arrays, **pixels}, real)["sum.irradiance"][:, 0]}

        return run

    bugs = [Bug(one.cause, at_points(one.run), EQ2) for one in pair_bugs(sums, bool(area), _glossy(recipe))
            if one.cause != "the distance is clamped at 0.1 m"]
    bugs += [Bug("1/pi is left out", at_points(reading(sums, lights__flux=lambda a: a * np.pi)), "E-AMS-02"),
             Bug("pairs count as at least sqrt(0.2) m apart, as in the authors' demo", at_points(
                   lambda a, r: sums(a, r, replaced(pairs, {"clamp": "distance", "clamp.value": 0.2**0.5}))),
                   "E-AMS-05")]
    if area:
        bugs.append(Bug("nothing is clamped", at_points(lambda a, r: sums(a, r,
            replaced(pairs, {"clamp": "none"}))),
                        "r^2 + A / pi"))
    bugs += light_bugs(at_points(sums), LIGHT)
    recipe.facts["multires.clamp"] = "none" if pairs.clamp is None else pairs.clamp.name()
    recipe.add("multires.irradiance", "irradiance of every pixel light at every subsplat, without albedo/pi",
               at_points(sums), (*POINTS, *names, *area),
               {LIGHT: Spec("rgb, subsplat", "W/m^2", "indirect irradiance", "linear RGB", EQ2)}, paper=EQ2,
               exact=(POINTS[0], "lights.position"), bugs=tuple(bugs))


def _glossy(recipe: Recipe) -> bool:
    return "lights.lobe_flux" in recipe.specs


def add_detail(recipe: Recipe, a: float) -> None:
    """Add Eq. 3, which darkens what turns away from the camera."""
    def run(arrays: Arrays, real: Any) -> Arrays:
        light, position, normal = (np.ascontiguousarray(arrays[name], real) for name in (
            "multires.upsampled.0", *RECEIVERS[:2]))
        eye = np.asarray(arrays["camera.origin"], real)[0]
        return {"multires.detailed": surface_detail(light, position, normal, covered_of(arrays), eye, a)}

    recipe.facts["multires.detail"] = a
    recipe.add("multires.detail", "E (a <V, N> + 1 - a)", run, ("multires.upsampled.0", *RECEIVERS, "camera.origin"), {
        "multires.detailed": Spec("rgb, row, column", "W/m^2", "indirect irradiance", "linear RGB", "AMS Eq. 3")},
        paper="AMS Eq. 3", exact=(RECEIVERS[0], "camera.origin"), bugs=tuple(detail_bugs(a)))

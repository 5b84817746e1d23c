"""Stages of light at subsplats: points, Eq. 2, upsampling by levels, Eq. 3 (Nichols and Wyman 2009, Sec. 3.4, 3.5).

A level is the irradiance of its cells and a mask of those that hold any, evaluated there or at a coarser level.
"""

from typing import Any

import numpy as np

from refgi.literal import multires_lights as literal
from refgi.pairs.settings import PairSettings
from refgi.splat.multires.settings import Representative
from refgi.splat.multires.subsplats.detail import surface_detail
from refgi.splat.multires.subsplats.evaluate import evaluate, points_of
from refgi.vectors.recipe import Recipe
from refgi.vectors.rows import Form
from refgi.vectors.spec import Arrays, Bug, Spec
from refgi.vectors.stages.buffers import VECTOR
from refgi.vectors.stages.lights import light_names, pixel_lights_of
from refgi.vectors.stages.multires_list import SUBSPLATS, subsplats_of
from refgi.vectors.stages.multires_ranges import covered_of
from refgi.vectors.stages.multires_upsample import LIGHT
from refgi.vectors.stages.pairs import LOBES, READS, RECEIVERS

POINTS = ("multires.point", "multires.normal")
EQ2 = "AMS Eq. 2, E only; E-AMS-02"


def add_points(recipe: Recipe, representative: Representative, top: int) -> None:
    """Add the point and normal that each subsplat is evaluated at."""
    form = Form(literal.points, {"position": RECEIVERS[0], "normal": RECEIVERS[1], "triangle_id": RECEIVERS[2],
                                 **dict(zip(("level", "row", "column", "pixel"), SUBSPLATS, strict=True))},
                POINTS, {"mean": representative == "mean"})

    def run(arrays: Arrays, real: Any) -> Arrays:
        position, normal = (np.ascontiguousarray(arrays[name], real) for name in RECEIVERS[:2])
        return dict(zip(POINTS, points_of(position, normal, covered_of(arrays), subsplats_of(arrays, top),
                                          representative), strict=True))

    recipe.add("multires.points", "where each subsplat is evaluated: its " + (
        "representative pixel" if representative == "pixel" else "mean surface"), run, (*RECEIVERS, *SUBSPLATS), {
            POINTS[0]: Spec("xyz, subsplat", "m", "surface point", "world"),
            POINTS[1]: Spec("xyz, subsplat", VECTOR, "its normal", "world")},
        paper="AMS Sec. 3.4; E-AMS-11", exact=RECEIVERS[:2] if representative == "pixel" else (),
        variants=(form,), bugs=form.bugs("points", f"points/{representative}"))


def add_irradiance(recipe: Recipe, pairs: PairSettings) -> None:
    """Add Eq. 2 at every subsplat."""
    names, area = light_names(recipe), ("lights.area",) if pairs.needs_footprints else ()

    def run(arrays: Arrays, real: Any) -> Arrays:
        points, normals = (np.ascontiguousarray(arrays[name], real) for name in POINTS)
        footprint = np.ascontiguousarray(arrays["lights.area"], np.float64) if area else None
        return {LIGHT: evaluate(points, normals, pixel_lights_of(arrays, real), pairs, footprint)}

    form = Form(literal.subsplat_irradiance, {
        "point": POINTS[0], "point_normal": POINTS[1], **light_parameters(recipe, bool(area))}, (LIGHT,))
    bugs = [Bug(one.cause, one.run, EQ2) for one in pair_bugs(form, recipe, bool(area))]
    own = form.bugs("subsplat_irradiance", *(("subsplat_irradiance/disc",) if area else ()))
    recipe.facts["multires.clamp"] = "none" if pairs.clamp is None else pairs.clamp.name()
    recipe.add("multires.irradiance", "irradiance of every pixel light at every subsplat, without albedo/pi",
               run, (*POINTS, *names, *area),
               {LIGHT: Spec("rgb, subsplat", "W/m^2", "indirect irradiance", "linear RGB", EQ2)}, paper=EQ2,
               exact=(POINTS[0], "lights.position"), variants=(form,), bugs=(*bugs, *own))


def light_parameters(recipe: Recipe, area: bool) -> dict[str, str]:
    """Return the arrays of pixel lights by the parameters of literal forms."""
    found = {key: name for key, name in (READS | LOBES | {"area": "lights.area"}).items() if name in recipe.specs}
    return {key: name for key, name in found.items() if name.startswith("lights.") and (area or key != "area")}


def pair_bugs(form: Form, recipe: Recipe, area: bool) -> tuple[Bug, ...]:
    """Return likely bugs of Eq. 2 in a sum over lights: of each list of `pairs` the first rows, the plainest."""
    lists: dict[str, int | None] = {"pair/disc": 2} if area else {"pair/free": 16, "irradiance/free": None}
    if "lights.lobe_flux" in recipe.specs:
        lists |= {"pair/glossy": 5} | ({} if area else {"pair/glossy free": None})
    return tuple(bug for name, count in lists.items() for bug in form.bugs(name, of="pairs")[:count])


def add_detail(recipe: Recipe, a: float) -> None:
    """Add Eq. 3, which darkens what turns away from the camera."""
    form = Form(literal.detail, {
        "light": "multires.upsampled.0", "position": RECEIVERS[0], "normal": RECEIVERS[1], "triangle_id": RECEIVERS[2],
        "camera": "camera.origin"}, ("multires.detailed",), {"a": a})

    def run(arrays: Arrays, real: Any) -> Arrays:
        light, position, normal = (np.ascontiguousarray(arrays[name], real) for name in (
            "multires.upsampled.0", *RECEIVERS[:2]))
        eye = np.asarray(arrays["camera.origin"], real)[0]
        return {"multires.detailed": surface_detail(light, position, normal, covered_of(arrays), eye, a)}

    recipe.facts["multires.detail"] = a
    recipe.add("multires.detail", "E (a <V, N> + 1 - a)", run, ("multires.upsampled.0", *RECEIVERS, "camera.origin"), {
        "multires.detailed": Spec("rgb, row, column", "W/m^2", "indirect irradiance", "linear RGB", "AMS Eq. 3")},
        paper="AMS Eq. 3", exact=(RECEIVERS[0], "camera.origin"), variants=(form,),
        bugs=form.bugs("detail"))

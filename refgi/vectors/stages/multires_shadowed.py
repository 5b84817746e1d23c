"""Stages of subsplats with visibility by rays, and of pictures rendered at twice the width and height.

Visibility at subsplats is that of `vpl` at pixels: its stages run at the subsplats' points, on the triangles of their
representative pixels.
"""

from typing import Any

import numpy as np

from refgi.literal import multires_lights as literal
from refgi.scene import Scene
from refgi.splat.multires.multires import halved
from refgi.vectors.recipe import Recipe
from refgi.vectors.rows import Form
from refgi.vectors.spec import Array, Arrays, Bug, Run, Spec, Stage
from refgi.vectors.stages import vpl
from refgi.vectors.stages.multires_light import POINTS
from refgi.vectors.stages.multires_upsample import LIGHT
from refgi.vectors.stages.pairs import RECEIVERS

PIXEL = "multires.pixel"
NAMES = {vpl.FACING: "multires.facing", vpl.VISIBLE: "multires.visible", vpl.LIGHT: LIGHT}
SPECS = {
    "multires.facing": "the normal of the face that each subsplat's pixel sees, on the side of its normal",
    "multires.visible": "true where the subsplat's point, its normal and its face look at the light, it at them, and "
                        "nothing lies between",
}


def add_shadowed_irradiance(recipe: Recipe, scene: Scene) -> None:
    """Add faces, visibility and the sum of the visible lights at every subsplat."""
    inner = Recipe(recipe.id, recipe.method, recipe.what)
    inner.specs.update(recipe.specs)
    vpl.add_at_receivers(inner, scene)
    recipe.facts["vpl"] = inner.facts["vpl"]
    for step in inner.stages:
        name = {vpl.FACING: "multires.facing", vpl.VISIBLE: "multires.visible"}.get(step.writes[0], LIGHT)
        _add_at_subsplats(recipe, step, name, inner.specs[step.writes[0]])


def _add_at_subsplats(recipe: Recipe, step: Stage, name: str, spec: Spec) -> None:
    (own,) = step.writes
    reads = [NAMES.get(one, one) for one in step.reads if one not in RECEIVERS]
    axes = spec.axes.replace("row, column", "subsplat")
    about = Spec(axes, spec.unit, SPECS.get(NAMES[own], spec.what), spec.space, spec.paper, spec.tier)
    recipe.add(name, step.what.replace("pixel light", "light").replace("each pixel", "each subsplat").replace(
        "every pixel", "every subsplat").replace("every light", "every pixel light"), _at_points(step.run, own),
        (*POINTS, PIXEL, RECEIVERS[2], *reads), {NAMES[own]: about}, paper=step.paper,
        exact=tuple(POINTS[0] if one == RECEIVERS[0] else one for one in step.exact),
        bugs=tuple(Bug(one.cause.replace("pixel", "subsplat"), _at_points(one.run, own), one.paper)
                   for one in step.bugs if not one.cause.startswith("interpolated normals")))


def _at_points(run: Run, own: str) -> Run:
    """Return a stage of pixels at subsplats: one row of them."""
    def altered(arrays: Arrays, real: Any) -> Arrays:
        ids = np.asarray(arrays[RECEIVERS[2]]).reshape(-1)[np.asarray(arrays[PIXEL])]
        pixels = {RECEIVERS[0]: arrays[POINTS[0]][:, None], RECEIVERS[1]: arrays[POINTS[1]][:, None],
                  RECEIVERS[2]: ids[None]}
        there = {name: arrays[other][:, None] for name, other in NAMES.items() if other in arrays}
        return {NAMES[own]: np.asarray(run({**arrays, **pixels, **there}, real)[own])[:, 0]}

    return altered


def add_halved(recipe: Recipe, covered: Array, source: str) -> None:
    """Add the mean of four pixels of a picture of twice the width and height; `covered`: what the picture shows."""
    shown = "picture.covered"
    recipe.give(shown, covered, Spec("row, column", "1", "pixels of the picture itself that show a surface", tier="T0"))

    def run(arrays: Arrays, real: Any) -> Arrays:
        light = np.ascontiguousarray(arrays[source], real)
        return {"multires.halved": halved(light, np.asarray(arrays[RECEIVERS[2]]) >= 0, np.asarray(arrays[shown]))}

    form = Form(literal.halved, {"light": source, "triangle_id": RECEIVERS[2], "covered": shown}, ("multires.halved",))
    recipe.add("multires.halved", "mean over those of four finer pixels that show a surface; where none does but the "
               "pixel itself, the mean of the pixels around it", run, (source, RECEIVERS[2], shown), {
                   "multires.halved": Spec("rgb, row, column", "W/m^2", "indirect irradiance", "linear RGB")},
               paper="AMS Sec. 4", variants=(form,), bugs=form.bugs("halved"))

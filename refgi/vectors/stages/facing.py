"""Normals of the faces that pixels see: what planes, sides and offsets of receivers are taken from."""

from typing import Any

import numpy as np

from refgi.literal import val_areas as literal
from refgi.rsm import facing_normals
from refgi.scene import Scene
from refgi.vectors.recipe import Recipe
from refgi.vectors.rows import Form
from refgi.vectors.spec import Arrays, Spec
from refgi.vectors.stages.buffers import VECTOR, geometry_of

FACING = "gbuffer.facing"


def add_facing(recipe: Recipe, scene: Scene) -> None:
    """Add the normals of the triangles that pixels see; those of the G-buffer where nothing is interpolated."""
    smooth = scene.geometry.vertex_normals is not None
    source = ("scene.vertices", "scene.faces", "scene.material_of_face", "scene.vertex_normals") if smooth else ()

    def run(arrays: Arrays, real: Any) -> Arrays:
        normal = np.ascontiguousarray(arrays["gbuffer.normal"], real)
        if not smooth:
            return {FACING: normal}
        return {FACING: facing_normals(geometry_of(arrays, scene), np.asarray(arrays["gbuffer.triangle_id"]), normal)}

    reads = {"vertices": "scene.vertices", "faces": "scene.faces"} if smooth else {}
    form = Form(literal.facing, {"normal": "gbuffer.normal", "triangle_id": "gbuffer.triangle_id", **reads}, (FACING,))
    recipe.add("facing", "normals of the triangles that pixels see, on the side of the interpolated ones", run,
               ("gbuffer.normal", "gbuffer.triangle_id", *source),
               {FACING: Spec("xyz, row, column", VECTOR, "plane of what a pixel sees; 0 without surface", "world")},
               paper="E-VAL-14; docs/conventions: which normal serves what",
               bugs=form.bugs("facing/smooth" if smooth else "facing/flat"), variants=(form,))

"""Stages of imperfect shadow maps: points of each light's map, their splats, filled holes, what receivers see.

The maps of a case are small and their boxes narrow, so that holes are left to pull and push.
"""

import math
from typing import Any

import numpy as np

from refgi.draws import IMPERFECT_MAPS, draws
from refgi.jit import kernel
from refgi.literal import imperfect as literal
from refgi.sampling import FIRST_STEP, SECOND_STEP
from refgi.scene import Geometry, Scene
from refgi.truth.imperfect import (
    HORIZON,
    Imperfect,
    areas_of,
    fill_frame,
    fill_holes,
    splat_box,
)
from refgi.vectors.recipe import Recipe
from refgi.vectors.rows import Form
from refgi.vectors.spec import Array, Arrays, Spec
from refgi.vectors.stages.buffers import VECTOR

GEOMETRY = ("scene.vertices", "scene.faces")
MESH = {"vertices": GEOMETRY[0], "faces": GEOMETRY[1]}
LIGHTS = ("lights.position", "lights.normal")
POINTS = ("vpl.point", "vpl.point_face", "vpl.point_radius")
FRAME = "vpl.frame"
PAPER = "Ritschel et al. 2008, Sec. 3"
MAP = "light, row, column"
LIMITS = {"least cosine at the light": 1e-3, "farther by, and still of one surface": 0.1,
          "least cosine of the bias's slope": 0.05}


def add_maps(recipe: Recipe, scene: Scene, settings: Imperfect, seed: int) -> str:
    """Add a map of points for each pixel light; return the name of the maps that receivers are to look up."""
    count = recipe.expected()["lights.flux"].shape[1]
    recipe.give("vpl.shift", np.stack([draws(seed, IMPERFECT_MAPS, 3, part=k) for k in range(count)]), Spec(
        "light, (area, a, b)", "1", "random numbers in [0, 1) of each light's points"))
    recipe.facts["vpl.maps"] = {"points": settings.points, "texels a side": settings.resolution,
                                "boxes, in the width of a point's disc": settings.splat, "levels": settings.levels,
                                "bias": settings.bias} | LIMITS
    _add_points(recipe, scene, settings.points)
    _add_frames(recipe)
    _add_depth(recipe, scene, settings)
    return _add_filled(recipe, settings.levels) if settings.levels else "vpl.depth"


def _geometry(arrays: Arrays, scene: Scene) -> Geometry:
    return Geometry(np.asarray(arrays[GEOMETRY[0]], np.float64), np.asarray(arrays[GEOMETRY[1]], np.int32),
                    scene.geometry.material_of_face, None)


def _add_points(recipe: Recipe, scene: Scene, points: int) -> None:
    def run(arrays: Arrays, real: Any) -> Arrays:
        corners, _, upto = areas_of(_geometry(arrays, scene))
        shift = np.ascontiguousarray(arrays["vpl.shift"], np.float64)
        place, face = np.zeros((len(shift), points, 3)), np.zeros((len(shift), points), np.int32)
        for k in range(len(shift)):
            _place(corners, upto, shift[k], place[k], face[k])
        return {POINTS[0]: place.astype(real), POINTS[1]: face,
                POINTS[2]: np.full(1, math.sqrt(upto[-1] / (math.pi * points)), real)}

    form = Form(literal.scattered_points, {**MESH, "shift": "vpl.shift"}, POINTS, {"count": points})
    recipe.add("vpl.points", "points of each light's map, all over the surfaces: point k at (k + x0) / n of the area, "
               "in the order of the faces, and at a = sqrt(x1 + k / g), b = x2 + k / g^2 modulo 1 of its face, "
               "(1 - a) A + a (1 - b) B + a b C; g^3 = g + 1", run, (*GEOMETRY, "vpl.shift"), {
                   POINTS[0]: Spec("light, point, xyz", "m", "the points", "world"),
                   POINTS[1]: Spec("light, point", "1", "the triangle that each lies on", tier="T0"),
                   POINTS[2]: Spec("number", "m", "r of a point's disc, pi r^2 = A / n", paper="docs/methods/vpl")},
               paper=PAPER, exact=("vpl.shift",), bugs=form.bugs("points"), variants=(form,))


@kernel
def _place(corners: Array, upto: Array, shift: Array, place: Array, face: Array) -> None:
    """Fill one light's points and their faces; the method draws each as soon as it is found."""
    count = len(place)
    for k in range(count):
        f = min(np.searchsorted(upto, (k + shift[0]) / count * upto[-1], side="right"), len(upto) - 1)
        a, b = math.sqrt((shift[1] + k * FIRST_STEP) % 1.0), (shift[2] + k * SECOND_STEP) % 1.0
        face[k] = f
        for c in range(3):
            place[k, c] = (1 - a) * corners[f, 0, c] + a * (1 - b) * corners[f, 1, c] + a * b * corners[f, 2, c]


def _add_frames(recipe: Recipe) -> None:
    def run(arrays: Arrays, real: Any) -> Arrays:
        normal = np.ascontiguousarray(arrays[LIGHTS[1]].T, np.float64)
        frame = np.zeros((len(normal), 3, 3))
        for k in range(len(normal)):
            fill_frame(normal[k], frame[k])
        return {FRAME: frame.astype(real)}

    form = Form(literal.map_frames, {"normal": LIGHTS[1]}, (FRAME,))
    recipe.add("vpl.frames", "axes of each light's map: with n its normal and e the sign of n_z, a = -1 / (e + n_z), "
               "right (1 + e n_x^2 a, e n_x n_y a, -e n_x), down (n_x n_y a, e + n_y^2 a, -n_y), forward n", run,
               (LIGHTS[1],), {FRAME: Spec("light, (right, down, forward), xyz", VECTOR, "axes of s, t and z", "world")},
               paper="Duff et al. 2017", exact=(LIGHTS[1],), bugs=form.bugs("frames"), variants=(form,))


def _add_depth(recipe: Recipe, scene: Scene, settings: Imperfect) -> None:
    side, splat = settings.resolution, settings.splat

    def run(arrays: Arrays, real: Any) -> Arrays:
        facing = areas_of(_geometry(arrays, scene))[1]
        place, position, frame = (np.ascontiguousarray(one, np.float64) for one in (
            arrays[POINTS[0]], arrays[LIGHTS[0]].T, arrays[FRAME]))
        face, radius = np.asarray(arrays[POINTS[1]], np.int64), float(arrays[POINTS[2]][0])
        made = np.full((len(place), side, side), np.inf, real)
        for k in range(len(place)):
            _splat_all(place[k], facing[face[k]], position[k], frame[k], radius, splat, made[k])
        return {"vpl.depth": made}

    names = ("point", "point_face", "radius", "light_position", "frame")
    form = Form(literal.depth_maps, {**MESH, **dict(zip(names, (*POINTS, LIGHTS[0], FRAME), strict=True))},
                ("vpl.depth",), {"side": side, "splat": splat})
    recipe.add("vpl.depth", "distance of the nearest point in each texel of a paraboloid map along the light's normal, "
               "(s, t) = (x, y) / (1 + z); a box r sqrt(c) (1 + s^2 + t^2) / d wide, c the cosine at the point, times "
               "its width in discs; points nearer than r or beside the light's plane are left out", run,
               (*GEOMETRY, *POINTS, LIGHTS[0], FRAME), {"vpl.depth": Spec(
                   MAP, "m", "rows along t, columns along s; inf where no box covers a texel's centre")},
               paper=PAPER, exact=(GEOMETRY[0],), bugs=form.bugs("depth"), variants=(form,))


@kernel
def _splat_all(place: Array, facing: Array, position: Array, frame: Array, radius: float, splat: float,
               depth: Array) -> None:
    for k in range(len(place)):
        d = place[k] - position
        x, y, z = (d * frame[0]).sum(), (d * frame[1]).sum(), (d * frame[2]).sum()
        distance = math.sqrt(x * x + y * y + z * z)
        if z > HORIZON * distance and distance > radius:
            wide = splat * radius * math.sqrt(abs((d * facing[k]).sum()) / distance)
            splat_box(x / (distance + z), y / (distance + z), distance, wide, depth)


def _add_filled(recipe: Recipe, levels: int) -> str:
    def run(arrays: Arrays, real: Any) -> Arrays:
        made = np.array(arrays["vpl.depth"], real)
        for one in made:
            fill_holes(one, levels)
        return {"vpl.filled": made}

    form = Form(literal.filled, {"depth": "vpl.depth"}, ("vpl.filled",), {"levels": levels})
    recipe.add("vpl.filled", "pull: the mean of those of four texels that are no farther than 1.1 times the nearest; "
               "push: holes take from the coarser level, bilinearly, what is no farther than 1.1 times the nearest of "
               "the four", run, ("vpl.depth",), {"vpl.filled": Spec(MAP, "m", "maps whose holes are filled")},
               paper=PAPER, bugs=form.bugs("filled"), variants=(form,))
    return "vpl.filled"

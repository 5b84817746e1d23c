"""Stages of pixel lights with visibility: faces, one shadow ray for each pair, the sum of what arrives.

A ray leaves the face, not the interpolated surface: what lies below the face of a pixel does not light it.
"""

import dataclasses
from typing import Any

import numpy as np

from refgi.literal import vpl as literal
from refgi.literal.imperfect import looked_up
from refgi.pairs.pixel_lights import PixelLights
from refgi.pairs.shadow_rays import RayReceivers, add_unoccluded, fill_shadow_rays, receivers, senders_of
from refgi.rays import Tracer
from refgi.scene import Geometry, Scene
from refgi.truth.imperfect import Imperfect, ImperfectDepth, fill_hidden
from refgi.truth.vpl import VplSettings
from refgi.vectors.recipe import Recipe
from refgi.vectors.rows import Form
from refgi.vectors.spec import Array, Arrays, Spec
from refgi.vectors.stages.buffers import VECTOR, geometry_of
from refgi.vectors.stages.lights import light_names, pixel_lights_of
from refgi.vectors.stages.pairs import EQ2, LOBES, READS, RECEIVERS
from refgi.vectors.stages.vpl_maps import add_maps

GEOMETRY = ("scene.vertices", "scene.faces")
LIGHTS = ("lights.position", "lights.normal")
FACING, VISIBLE, LIGHT = "vpl.facing", "vpl.visible", "vpl.irradiance"
RADIUS = "vpl.point_radius"
LIFT = 1e-3  # m: ports lift the ends of their rays off the surfaces by up to that; what it decides is masked
# what shows only where surfaces block the light, or never in these cases
SHADOWED = ("clamped", "absolute", "at least", "largest light", "first half", "horizon")
MESH = {"vertices": GEOMETRY[0], "faces": GEOMETRY[1]}
PAIRS = {"position": RECEIVERS[0], "normal": RECEIVERS[1], "triangle_id": RECEIVERS[2], "face_normal": FACING,
         "light_position": LIGHTS[0], "light_normal": LIGHTS[1]}


def add_vpl(recipe: Recipe, scene: Scene, settings: VplSettings) -> None:
    """Add the visibility of every pixel light from every pixel, by rays or by maps, and the sum of the visible ones."""
    recipe.factors["number of lights"] = float(recipe.expected()["lights.flux"].shape[1])
    if settings.maps is None:
        add_at_receivers(recipe, scene)
        return
    recipe.facts["vpl"] = {"largest_lift_of_ray_ends": LIFT}
    _add_facing(recipe, scene)
    _add_looked_up(recipe, scene, settings.maps, add_maps(recipe, scene, settings.maps, settings.lights.seed))
    _add_sum(recipe)


def add_at_receivers(recipe: Recipe, scene: Scene) -> None:
    """Add faces, visibility by rays and the sum of the visible lights at pixels, or at what is in their place."""
    recipe.facts["vpl"] = {"largest_lift_of_ray_ends": LIFT}
    _add_facing(recipe, scene)
    _add_visible(recipe, scene)
    _add_sum(recipe)


def _add_facing(recipe: Recipe, scene: Scene) -> None:
    def run(arrays: Arrays, real: Any) -> Arrays:
        ids = np.asarray(arrays[RECEIVERS[2]])
        facing = np.zeros((3, ids.size), real)
        to = _receivers(_geometry(arrays, scene), arrays, 1.0)
        facing[:, to.pixel] = to.facing
        return {FACING: facing.reshape(3, *ids.shape)}

    form = Form(literal.facing, {**MESH, "normal": RECEIVERS[1], "triangle_id": RECEIVERS[2]}, (FACING,))
    recipe.add("vpl.facing", "normal of the triangle that each pixel sees", run, (*GEOMETRY, *RECEIVERS), {FACING: Spec(
        "xyz, row, column", VECTOR, "the face's normal, on the side of the pixel's normal; 0 without surface",
        "world")},
        paper="docs/conventions", exact=(GEOMETRY[0],), bugs=form.bugs("facing"), variants=(form,))


def _geometry(arrays: Arrays, scene: Scene) -> Geometry:
    materials = np.zeros(len(arrays[GEOMETRY[1]]), np.int32)
    return geometry_of({GEOMETRY[0]: arrays[GEOMETRY[0]], GEOMETRY[1]: arrays[GEOMETRY[1]],
                        "scene.material_of_face": materials}, scene)


def _receivers(geometry: Geometry, arrays: Arrays, grain: float) -> RayReceivers:
    position, normal, ids = (np.asarray(arrays[name]) for name in RECEIVERS)
    return receivers(geometry, position, normal, ids, grain)


class _Rays:
    """Shadow rays of all pairs, light by light for each covered pixel.

    `lift`, m, is added to that of refgi.
    """

    def __init__(self, arrays: Arrays, scene: Scene, lift: float = 0.0) -> None:
        geometry = _geometry(arrays, scene)
        self.tracer = Tracer(dataclasses.replace(geometry, uv=None, cut_outs=None))
        to = _receivers(geometry, arrays, self.tracer.grain)
        facing = np.ascontiguousarray(np.asarray(arrays[FACING], np.float32).reshape(3, -1)[:, to.pixel])
        position, normal = (np.asarray(arrays[name], np.float64) for name in LIGHTS)
        sent = PixelLights(position + lift * normal, normal, np.ones_like(normal), None, None, None, normal.shape[1])
        senders = self.senders = senders_of(sent)  # where lobes fade out is no question of visibility
        self.to = to._replace(facing=facing, origin=(to.origin + np.float32(lift) * facing).astype(np.float32))
        self.count, self.shape = senders.flux.shape[1], np.asarray(arrays[RECEIVERS[2]]).shape
        pairs = len(to.pixel) * self.count
        self.origin, self.direction, self.contribution = (np.zeros((pairs, 3), np.float32) for _ in range(3))
        self.reach = np.zeros(pairs, np.float32)
        fill_shadow_rays(self.to, (0, len(to.pixel)), senders, (0, self.count), self.tracer.grain,
                         (self.origin, self.direction, self.reach, self.contribution))

    def visible(self) -> Array:
        """Return which rays nothing blocks, (light, row, column); those of no reach count as blocked."""
        blocked = np.ones(len(self.reach), np.bool_)
        self.tracer.fill_occluded(self.origin, self.direction, self.reach, blocked)
        return self.placed(~blocked.reshape(len(self.to.pixel), self.count))

    def placed(self, seen: Array) -> Array:
        """Return what pairs (pixel with a surface, light) see as (light, row, column)."""
        whole = np.zeros((self.count, self.shape[0] * self.shape[1]), np.bool_)
        whole[:, self.to.pixel] = seen.T
        return whole.reshape(self.count, *self.shape)


def _add_visible(recipe: Recipe, scene: Scene) -> None:
    def run(arrays: Arrays, real: Any) -> Arrays:
        # of the runs that measure the bound the one in float32 lifts as ports do
        return {VISIBLE: _Rays(arrays, scene, LIFT if real == np.float32 else 0.0).visible()}

    form = Form(literal.visible, {**MESH, **PAIRS}, (VISIBLE,))
    recipe.add("vpl.visible", "whether light reaches each pixel from each pixel light", run,
               (*GEOMETRY, *RECEIVERS, FACING, *LIGHTS), {VISIBLE: Spec(
                   "light, row, column", "1", "true where the normals of light and pixel and the pixel's face look at "
                   "the other, whatever the lobe, and nothing lies "
                   "between", tier="T0")}, paper="SII Eq. 2 with V", bugs=form.bugs("visible"), variants=(form,))


def _add_looked_up(recipe: Recipe, scene: Scene, settings: Imperfect, maps: str) -> None:
    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001 one precision: double
        rays = _Rays(arrays, scene)
        depth, hidden = np.ascontiguousarray(arrays[maps], np.float64), np.zeros(len(rays.reach), np.bool_)
        found = ImperfectDepth(depth, float(arrays[RADIUS][0]), settings.bias)
        fill_hidden(found, rays.to, (0, len(rays.to.pixel)), rays.senders, (0, rays.count), rays.reach, hidden)
        return {VISIBLE: rays.placed(~hidden.reshape(len(rays.to.pixel), rays.count))}

    form = Form(looked_up, {**PAIRS, "frame": "vpl.frame", "depth": maps, "radius": RADIUS}, (VISIBLE,),
                {"bias": settings.bias})
    recipe.add("vpl.visible", "whether each pixel is no farther from each pixel light than the light's map says, by "
               "more than the bias", run,
               (*GEOMETRY, *RECEIVERS, FACING, *LIGHTS, "vpl.frame", maps, RADIUS), {VISIBLE: Spec(
                   "light, row, column", "1", "true where the normals of light and pixel and the pixel's face look at "
                   "the other and the texel does not hide the pixel", tier="T0")},
               paper="Ritschel et al. 2008, Sec. 3", exact=(maps,), bugs=form.bugs("looked up"),
               variants=(form,))


def _add_sum(recipe: Recipe) -> None:
    names = light_names(recipe)

    def run(arrays: Arrays, real: Any) -> Arrays:
        position, normal, ids = (np.asarray(arrays[name]) for name in RECEIVERS)
        pixel = np.flatnonzero(ids.reshape(-1) >= 0)
        at, up = (np.ascontiguousarray(plane.reshape(3, -1)[:, pixel], np.float32) for plane in (position, normal))
        senders = senders_of(pixel_lights_of(arrays, np.float64))
        count, total = senders.flux.shape[1], np.zeros((3, len(pixel)))
        rays = tuple(np.zeros((len(pixel) * count, 3), np.float32) for _ in range(3))
        fill_shadow_rays(RayReceivers(pixel, at, up, up, at), (0, len(pixel)), senders, (0, count), 1.0,
                         (rays[0], rays[1], np.zeros(len(pixel) * count, np.float32), rays[2]))
        blocked = ~np.asarray(arrays[VISIBLE]).reshape(count, ids.size)[:, pixel].T
        add_unoccluded(total, 0, len(pixel), count, np.ascontiguousarray(blocked).reshape(-1), rays[2])
        light = np.zeros((3, ids.size), real)
        light[:, pixel] = total
        return {LIGHT: light.reshape(3, *ids.shape)}

    glossy = "lights.lobe_flux" in recipe.specs
    form = Form(literal.shadowed_sum, {**READS, "triangle_id": RECEIVERS[2], "seen": VISIBLE,
                                       **(LOBES if glossy else {})}, (LIGHT,))
    lists = ("pair/free", *(("pair/glossy", "pair/glossy free") if glossy else ()))
    bugs = [one for one in form.bugs(*lists, of="pairs") if not any(word in one.cause for word in SHADOWED)]
    recipe.add("vpl.sum", "irradiance of the visible pixel lights at every pixel, without albedo/pi", run,
               (*RECEIVERS, VISIBLE, *names), {LIGHT: Spec(
                   "rgb, row, column", "W/m^2", "indirect irradiance", "linear RGB", EQ2)}, paper=EQ2,
               exact=(RECEIVERS[0], "lights.position"), bugs=(*bugs, *form.bugs("sum")), variants=(form,))

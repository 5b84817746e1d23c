"""Stages of pixel lights with visibility: faces, one shadow ray for each pair, the sum of what arrives.

A ray leaves the face, not the interpolated surface: what lies below the face of a pixel does not light it.
"""

import dataclasses
from typing import Any

import numpy as np

from refgi.pairs.pixel_lights import PixelLights
from refgi.pairs.shadow_rays import RayReceivers, add_unoccluded, fill_shadow_rays, receivers, senders_of
from refgi.rays import Tracer
from refgi.scene import Geometry, Scene
from refgi.truth.imperfect import Imperfect, ImperfectDepth, fill_hidden
from refgi.truth.vpl import VplSettings
from refgi.vectors.bugs.imperfect_lookup import hidden_bugs, literal_hidden
from refgi.vectors.bugs.pair import pair_bugs
from refgi.vectors.recipe import Recipe, reading, writing
from refgi.vectors.spec import Array, Arrays, Bug, Run, Spec
from refgi.vectors.stages.buffers import VECTOR, geometry_of
from refgi.vectors.stages.lights import light_names, pixel_lights_of
from refgi.vectors.stages.pairs import EQ2, RECEIVERS
from refgi.vectors.stages.vpl_maps import add_maps

GEOMETRY = ("scene.vertices", "scene.faces")
LIGHTS = ("lights.position", "lights.normal")
FACING, VISIBLE, LIGHT = "vpl.facing", "vpl.visible", "vpl.irradiance"
RADIUS = "vpl.point_radius"
LIFT = 1e-3  # m: ports lift the ends of their rays off the surfaces by up to that; what it decides is masked
# what shows only where surfaces block the light, or never in these cases
SHADOWED = ("clamped", "absolute", "at least", "largest light", "first half", "horizon")
LEAK = 0.05  # m: a lift through which light leaks


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

    def wound(arrays: Arrays, real: Any) -> Arrays:
        ids = np.asarray(arrays[RECEIVERS[2]])
        a, b, c = (np.asarray(arrays[GEOMETRY[0]])[np.asarray(arrays[GEOMETRY[1]])[:, k]] for k in range(3))
        face = np.cross(b - a, c - a)
        face /= np.linalg.norm(face, axis=1, keepdims=True)
        return {FACING: np.where(ids >= 0, np.moveaxis(face[ids], -1, 0), 0).astype(real)}

    recipe.add("vpl.facing", "normal of the triangle that each pixel sees", run, (*GEOMETRY, *RECEIVERS), {FACING: Spec(
        "xyz, row, column", VECTOR, "the face's normal, on the side of the pixel's normal; 0 without surface",
        "world")},
        paper="docs/conventions", exact=(GEOMETRY[0],), bugs=(
            Bug("faces are not turned to the side that is seen", wound, "docs/conventions"),
            Bug("interpolated normals in place of faces'", lambda a, r: {FACING: np.asarray(a[RECEIVERS[1]], r)},
                "rays leave faces"),
            Bug("normals are not made unit vectors", writing(run, vpl__facing=lambda a: 0.5 * a), "unit vectors")))


def _geometry(arrays: Arrays, scene: Scene) -> Geometry:
    materials = np.zeros(len(arrays[GEOMETRY[1]]), np.int32)
    return geometry_of({GEOMETRY[0]: arrays[GEOMETRY[0]], GEOMETRY[1]: arrays[GEOMETRY[1]],
                        "scene.material_of_face": materials}, scene)


def _receivers(geometry: Geometry, arrays: Arrays, grain: float) -> RayReceivers:
    position, normal, ids = (np.asarray(arrays[name]) for name in RECEIVERS)
    return receivers(geometry, position, normal, ids, grain)


class _Rays:
    """Shadow rays of all pairs, light by light for each covered pixel.

    `lift`, m, is added to that of refgi; the first `blockers` triangles block, all where absent.
    """

    def __init__(self, arrays: Arrays, scene: Scene, lift: float = 0.0, blockers: int | None = None) -> None:
        geometry = _geometry(arrays, scene)
        self.tracer = Tracer(dataclasses.replace(geometry, faces=geometry.faces[:blockers],
                                                 material_of_face=geometry.material_of_face[:blockers], uv=None,
                                                 cut_outs=None))
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

    def visible(self, reach: Array, origin: Array | None = None, direction: Array | None = None) -> Array:
        """Return which rays nothing blocks, (light, row, column); those of no reach count as blocked."""
        blocked = np.ones(len(reach), np.bool_)
        self.tracer.fill_occluded(self.origin if origin is None else origin,
                                  self.direction if direction is None else direction, reach, blocked)
        return self.placed(~blocked.reshape(len(self.to.pixel), self.count))

    def placed(self, seen: Array) -> Array:
        """Return what pairs (pixel with a surface, light) see as (light, row, column)."""
        whole = np.zeros((self.count, self.shape[0] * self.shape[1]), np.bool_)
        whole[:, self.to.pixel] = seen.T
        return whole.reshape(self.count, *self.shape)


def _add_visible(recipe: Recipe, scene: Scene) -> None:
    def run(arrays: Arrays, real: Any, lift: float = 0.0) -> Arrays:
        # of the runs that measure the bound the one in float32 lifts as ports do
        rays = _Rays(arrays, scene, LIFT if real == np.float32 else lift)
        return {VISIBLE: rays.visible(rays.reach)}

    def traced(change: Any) -> Run:
        def altered(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
            rays = _Rays(arrays, scene)
            return {VISIBLE: change(rays)}

        return altered

    def from_points(rays: _Rays) -> Array:
        origin = np.ascontiguousarray(np.repeat(rays.to.position.T, rays.count, axis=0))
        return rays.visible(rays.reach, origin, rays.direction + rays.origin - origin)

    def fewer(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
        rays = _Rays(arrays, scene, blockers=-2)
        return {VISIBLE: rays.visible(rays.reach)}

    recipe.add("vpl.visible", "whether light reaches each pixel from each pixel light", run,
               (*GEOMETRY, *RECEIVERS, FACING, *LIGHTS), {VISIBLE: Spec(
                   "light, row, column", "1", "true where the normals of light and pixel and the pixel's face look at "
                   "the other, whatever the lobe, and nothing lies "
                   "between", tier="T0")}, paper="SII Eq. 2 with V", bugs=(
                   Bug("the ray goes on behind the light", traced(lambda rays: rays.visible(rays.reach * 1e4)), "V"),
                   Bug("rays start on the surface without any lift", traced(from_points), "ends are lifted"),
                   Bug("rays start below the surface", lambda a, r: run(a, r, -LIFT), "lifted to the lit side"),
                   Bug("ends are lifted by 5 cm: light leaks", lambda a, r: run(a, r, LEAK), "a thousandth at most"),
                   Bug("nothing blocks", traced(lambda rays: rays.visible(np.where(rays.reach > 0, 1e-9, 0).astype(
                       np.float32))), "V"),
                   Bug("visibility is inverted", writing(run, vpl__visible=np.logical_not), "V = 1: nothing between"),
                   Bug("pairs that face away count as visible", traced(lambda rays: rays.visible(np.ones_like(
                       rays.reach)) | ~_sends(rays)), "facing each other"),
                   Bug("lights are in reverse order", writing(run, vpl__visible=lambda a: a[::-1]),
                       "light, row, column"),
                   Bug("the last two triangles are left out", fewer, "all triangles"),
                   Bug("rays end halfway", traced(lambda rays: rays.visible(0.5 * rays.reach)), "V")))


def _add_looked_up(recipe: Recipe, scene: Scene, settings: Imperfect, maps: str) -> None:
    def seen(rays: _Rays, hidden: Array) -> Arrays:
        return {VISIBLE: rays.placed(~hidden.reshape(len(rays.to.pixel), rays.count))}

    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001 one precision: double
        rays = _Rays(arrays, scene)
        depth, hidden = np.ascontiguousarray(arrays[maps], np.float64), np.zeros(len(rays.reach), np.bool_)
        found = ImperfectDepth(depth, float(arrays[RADIUS][0]), settings.bias)
        fill_hidden(found, rays.to, (0, len(rays.to.pixel)), rays.senders, (0, rays.count), rays.reach, hidden)
        return seen(rays, hidden)

    def by(how: dict[str, Any]) -> Run:
        def altered(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
            rays, knobs = _Rays(arrays, scene), {"bias": settings.bias} | how
            hidden = literal_hidden(np.asarray(arrays["vpl.frame"], np.float64), np.asarray(arrays[maps], np.float64),
                                    float(arrays[RADIUS][0]), points=np.asarray(rays.to.position, np.float64),
                                    facing=np.asarray(rays.to.facing, np.float64),
                                    position=np.asarray(arrays[LIGHTS[0]], np.float64), **knobs)
            return seen(rays, hidden | (rays.reach.reshape(hidden.shape) <= 0))

        return altered

    recipe.add("vpl.visible", "whether each pixel is no farther from each pixel light than the light's map says, by "
               "more than the bias", run,
               (*GEOMETRY, *RECEIVERS, FACING, *LIGHTS, "vpl.frame", maps, RADIUS), {VISIBLE: Spec(
                   "light, row, column", "1", "true where the normals of light and pixel and the pixel's face look at "
                   "the other and the texel does not hide the pixel", tier="T0")},
               paper="Ritschel et al. 2008, Sec. 3", exact=(maps,), bugs=(
                   *hidden_bugs(by, settings.bias),
                   Bug("visibility is inverted", writing(run, vpl__visible=np.logical_not), "V = 1: nothing between"),
                   Bug("lights are in reverse order", writing(run, vpl__visible=lambda a: a[::-1]),
                       "light, row, column")))


def _sends(rays: _Rays) -> Array:
    return rays.placed(rays.reach.reshape(len(rays.to.pixel), rays.count) > 0)


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

    def every(arrays: Arrays, real: Any) -> Arrays:
        return run({**arrays, VISIBLE: np.ones_like(arrays[VISIBLE])}, real)

    def mean(arrays: Arrays, real: Any) -> Arrays:
        seen = np.asarray(arrays[VISIBLE])
        return {LIGHT: every(arrays, real)[LIGHT] * seen.sum(axis=0) / max(1, len(seen))}

    def unshadowed(arrays: Arrays, real: Any) -> Arrays:
        return {"sum.irradiance": run(arrays, real)[LIGHT]}

    def shadowed(inner: Run) -> Run:
        """Return the sum of a bug's terms under the visibility of each light."""
        def altered(arrays: Arrays, real: Any) -> Arrays:
            total = np.zeros(np.asarray(arrays[RECEIVERS[0]]).shape)
            for k, seen in enumerate(np.asarray(arrays[VISIBLE])):
                one = {name: arrays[name][..., k : k + 1] for name in names}
                total += inner({**arrays, **one, VISIBLE: seen[None]}, real)["sum.irradiance"] * seen
            return {LIGHT: total}

        return altered

    bugs = [one for one in pair_bugs(unshadowed, False, "lights.lobe_flux" in recipe.specs)
            if not any(word in one.cause for word in SHADOWED)]
    recipe.add("vpl.sum", "irradiance of the visible pixel lights at every pixel, without albedo/pi", run,
               (*RECEIVERS, VISIBLE, *names), {LIGHT: Spec(
                   "rgb, row, column", "W/m^2", "indirect irradiance", "linear RGB", EQ2)}, paper=EQ2,
               exact=(RECEIVERS[0], "lights.position"), bugs=(
                   *(Bug(one.cause, shadowed(one.run), EQ2) for one in bugs),
                   Bug("visibility does not count", every, "V"),
                   Bug("one visibility, the mean of all lights, for the whole sum", mean, "V of each pair"),
                   Bug("each light has the visibility of the next", reading(run, vpl__visible=lambda a: np.roll(
                       a, 1, axis=0)), "V of each pair"),
                   Bug("the sum is divided by the number of visible lights", _averaged(run), "T/N is in the flux")))


def _averaged(run: Run) -> Run:
    def altered(arrays: Arrays, real: Any) -> Arrays:
        return {LIGHT: run(arrays, real)[LIGHT] / np.maximum(np.asarray(arrays[VISIBLE]).sum(axis=0), 1)}

    return altered

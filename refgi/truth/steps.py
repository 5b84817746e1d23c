"""The ground truth, and imperfect shadow maps, one step after the other."""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from refgi.jit import kernel
from refgi.pairs.pixel_lights import PixelLights
from refgi.pairs.shadow_rays import BATCH
from refgi.pairs.steps import facing, placed, shadow_rays, shadowed_sum, visible
from refgi.rays import Tracer
from refgi.sampling import FIRST_STEP, IMPERFECT_MAPS, SECOND_STEP, draws
from refgi.scene import Geometry, Scene
from refgi.scene.material import MaterialTable, material_table
from refgi.scene.model import Light
from refgi.stages import stage
from refgi.truth.imperfect import (
    HORIZON,
    Imperfect,
    ImperfectDepth,
    areas_of,
    fill_frame,
    fill_hidden,
    fill_holes,
    splat_box,
)
from refgi.truth.settings import TruthSettings
from refgi.truth.truth import averaged, without_pilot
from refgi.types import Array


@stage("vpl.scattered_points", kept=False)
def scattered_points(vertices: Array, faces: Array, shift: Array, count: int) -> tuple[Array, Array, Array]:
    """Scatter the points of each light's map all over the surfaces (docs/methods/vpl).

    shift (light, number): Random numbers x0, x1, x2 in [0, 1) of each light's points.
    count: n, points of a map.
    -> point (light, point, 3): Point k at (k + x0) / n of the area, in the order of the faces, and at a = sqrt(x1 + k /
        g), b = x2 + k / g^2 modulo 1 of its face, (1 - a) A + a (1 - b) B + a b C, m; g^3 = g + 1.
    -> point_face (light, point) int32: The triangle that each lies on.
    -> radius (number,): r of a point's disc, pi r^2 = A / n, m.
    """
    corners, _, upto = areas_of(_triangles(vertices, faces))
    place, face = np.zeros((len(shift), count, 3)), np.zeros((len(shift), count), np.int32)
    for k in range(len(shift)):
        _place(corners, upto, shift[k].astype(np.float64), place[k], face[k])
    return place.astype(vertices.dtype), face, np.full(1, math.sqrt(upto[-1] / (math.pi * count)))


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


@stage("vpl.map_frames", kept=False)
def map_frames(normal: Array) -> Array:
    """Compute the axes of each light's map, forward along its normal (docs/methods/vpl).

    With e the sign of n_z, a = -1 / (e + n_z): right (1 + e n_x^2 a, e n_x n_y a, -e n_x), down (n_x n_y a,
    e + n_y^2 a, -n_y), forward n.

    normal (3, light): Unit normals of the lights.
    -> (light, axis, 3): Right, down and forward: axes of s, t and z.
    """
    frame, rows = np.zeros((normal.shape[1], 3, 3)), np.ascontiguousarray(normal.T, np.float64)
    for k in range(len(rows)):
        fill_frame(rows[k], frame[k])
    return frame.astype(normal.dtype)


@stage("vpl.depth_maps", kept=False)
def depth_maps(
    vertices: Array, faces: Array, point: Array, point_face: Array, radius: Array, light_position: Array, frame: Array,
    side: int, splat: float,
) -> Array:
    """Draw points as boxes into a paraboloid map along each light's normal, nearest first (docs/methods/vpl).

    (s, t) = (x, y) / (1 + z); a box r sqrt(c) (1 + s^2 + t^2) / d wide, c the cosine at the point, times its width in
    discs; points nearer than r or beside the light's plane are left out.

    point (light, point, 3): Points of each light's map, m.
    point_face (light, point) int32: Their triangles.
    radius (number,): r of a point's disc, m.
    frame (light, axis, 3): Axes of their maps.
    side: Texels along a side of a map.
    splat: Side of a box in the width of a point's disc.
    -> (light, h, w): Distance, m; rows along t, columns along s; inf where no box covers a texel's centre.
    """
    normals = areas_of(_triangles(vertices, faces))[1]
    made = np.full((len(point), side, side), np.inf, vertices.dtype)
    place, position, axes = (np.ascontiguousarray(one, np.float64) for one in (point, light_position.T, frame))
    for k in range(len(place)):
        _splat_all(place[k], normals[point_face[k]], position[k], axes[k], float(radius[0]), splat, made[k])
    return made


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


@stage("vpl.filled", kept=False)
def filled(depth: Array, levels: int) -> Array:
    """Fill holes of maps from coarser levels: pull, then push (docs/methods/vpl).

    Pulling takes the mean of those of four texels that are no farther than 1.1 times the nearest; pushing fills holes
    from the coarser level, bilinearly, with what is no farther than 1.1 times the nearest of the four.

    depth (light, h, w): Distance, m; inf where nothing is.
    levels: Of pulling and pushing.
    -> (light, h, w): Distance, m; maps whose holes are filled.
    """
    made = depth.copy()
    for one in made:
        fill_holes(one, levels)
    return made


@stage("vpl.looked_up", kept=False)
def looked_up(
    vertices: Array, faces: Array, position: Array, normal: Array, triangle_id: Array, face_normal: Array,
    light_position: Array, light_normal: Array, frame: Array, depth: Array, radius: Array,  # noqa: ARG001 axes for ports
    bias: float,
) -> Array:
    """Look up whether a pixel is no farther from each light than its map says, by more than a bias (docs/methods/vpl).

    face_normal (3, h, w): Unit normals of the triangles that pixels see, on the side of the pixels' normals.
    frame (light, axis, 3): Axes of their maps.
    depth (light, h, w): Distance, m; inf where nothing is.
    radius (number,): r of a point's disc, m.
    bias: In what a pixel's own surface may differ by within a box or a texel.
    -> (light, h, w) bool: True where the normals of light and pixel and the pixel's face look at the other and the
        texel does not hide the pixel.
    """
    to, senders, reach, _ = shadow_rays(_triangles(vertices, faces), 1.0, (position, normal, triangle_id), face_normal,
                                        light_position, light_normal)
    count, hidden = senders.flux.shape[1], np.zeros(len(reach), np.bool_)
    fill_hidden(ImperfectDepth(depth.astype(np.float64), radius, bias), to, (0, len(to.pixel)), senders, (0, count),
                reach, hidden)
    return placed(to, ~hidden.reshape(len(to.pixel), count).T, triangle_id.shape)


def map_steps(
    geometry: Geometry, lights: PixelLights, settings: Imperfect, seed: int = 0
) -> dict[str, Array] | None:
    """Return the map of each pixel light, made by steps; None where surfaces have holes or there is none."""
    count = lights.flux.shape[1]
    if geometry.cut is not None or count == 0:
        return None
    shift = np.stack([draws(seed, IMPERFECT_MAPS, 3, part=k) for k in range(count)])
    point, face, radius = scattered_points(geometry.vertices, geometry.faces, shift, settings.points)
    depth = depth_maps(geometry.vertices, geometry.faces, point, face, radius, lights.position,
                       map_frames(lights.normal), settings.resolution, settings.splat)
    return {"depth": filled(depth, settings.levels) if settings.levels else depth, "radius": radius}


def light_steps(
    geometry: Geometry, position: Array, normal: Array, triangle_id: Array, lights: PixelLights,
    maps: ImperfectDepth | None, visibility: bool, tracer: Tracer, batch: int = BATCH,  # noqa: ARG001
) -> Array:
    """Return the irradiance of pixel lights at pixels, made by steps."""
    seen = None
    if visibility:
        face = facing(geometry.vertices, geometry.faces, normal, triangle_id)
        pairs = position, normal, triangle_id, face, lights.position, lights.normal
        seen = visible(geometry, *pairs) if maps is None else looked_up(
            geometry.vertices, geometry.faces, *pairs, map_frames(lights.normal), maps.depth, maps.radius, maps.bias)
    return shadowed_sum(position, normal, triangle_id, seen, *lights[:6])


def _triangles(vertices: Array, faces: Array) -> Geometry:
    return Geometry(vertices, faces, np.zeros(len(faces), np.int32), None)


class Lamps(NamedTuple):
    """Numbers of a scene's lamps, one row each, 0 where a lamp has none; falloffs are the scene's."""

    position: Array  # (lamp, 3) place, m
    direction: Array  # (lamp, 3) along which light travels
    intensity: Array  # (lamp, 3) W/sr on the axis; of a directional lamp perpendicular irradiance, W/m^2
    half_angles: Array  # (lamp, 2) rad, inner and outer half-angle of a spot's cone


def lamps_of(lights: Sequence[Light]) -> Lamps:
    """Return the numbers of lamps."""
    none = (0.0, 0.0, 0.0)
    rows = [(getattr(one, "position", none), getattr(one, "direction", none),
             getattr(one, "intensity", None) or getattr(one, "irradiance", none),
             (getattr(one, "inner_half_angle", 0.0), getattr(one, "outer_half_angle", 0.0))) for one in lights]
    return Lamps(*(np.array(column, np.float64) for column in zip(*rows, strict=True)))


@stage("truth.path_traced", kept=False)
def path_traced(
    scene: Scene, materials: MaterialTable, lights: Lamps, position: Array, normal: Array, triangle_id: Array,
    settings: TruthSettings,
) -> tuple[Array, Array, Array]:
    """Trace irradiance by light of so many bounces before the pixel, and its estimated variance (docs/radiometry).

    E is the integral of L cos over the hemisphere, L = albedo/pi of the direct irradiance there; without direct light
    and the receiver's albedo/pi.

    lights: The scene's lamps, (lamp, number) each.
    -> mean (3, h, w): Mean of all samples, W/m^2.
    -> variance_of_mean (3, h, w): Estimated variance of that mean, in units of its square; 0 without surface.
    -> samples (h, w) int32: Samples of each pixel; 0 without surface.
    """
    given = dataclasses.replace(scene, materials=tuple(
        dataclasses.replace(one, diffuse=tuple(diffuse), specular=tuple(specular), exponent=exponent)
        for one, diffuse, specular, exponent in zip(scene.materials, *(
            np.asarray(array, np.float64).tolist() for array in materials[:3]), strict=True)),
        lights=tuple(_with_row(light, lights, k) for k, light in enumerate(scene.lights)))
    found = averaged(without_pilot, given, Tracer(given.geometry), (position, normal, triangle_id), settings)
    return found.mean, found.variance_of_mean, found.samples


def _with_row(light: Light, lamps: Lamps, row: int) -> Light:
    position, direction, intensity, angles = (np.asarray(one[row], np.float64).tolist() for one in lamps)
    values = {"position": tuple(position), "direction": tuple(direction), "intensity": tuple(intensity),
              "irradiance": tuple(intensity), "inner_half_angle": angles[0], "outer_half_angle": angles[1]}
    return dataclasses.replace(light, **{name: value for name, value in values.items() if hasattr(light, name)})


def truth_steps(
    scene: Scene, tracer: Any, position: Array, normal: Array, triangle_id: Array,  # noqa: ARG001
    settings: TruthSettings,
) -> dict[str, Array]:
    """Return the path-traced irradiance, made by a step that has a tracer of its own."""
    mean, variance, samples = path_traced(scene, material_table(scene.materials), lamps_of(scene.lights), position,
                                          normal, triangle_id, settings)
    return {"mean": mean, "variance_of_mean": variance, "samples": samples}

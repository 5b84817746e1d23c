"""What files lack, put in their place: camera and lamp where none is, lamps for emissive surfaces.

What a material emits is seen by the camera and lights nothing: the papers have no area lights. Where lamps are asked
for, each connected emissive part gets one: a spot with the part's power Phi = pi sum(L A), along its mean normal, whose
intensity falls with the cosine off it, I_0 = Phi / pi, as that of a diffuse emitter does far away. It stands at the
part's middle, just before all of it. This is an approximation: near the part light comes from one point, and where
the part's faces look to several sides only the mean one is lit.

What is seen from a place is estimated from points all over the mesh: in each cell of a coarse picture the nearest one
is seen, and with it those of which it does not lie in front of the plane.
"""

import math
import warnings
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from refgi.errors import RefgiWarning
from refgi.scene.files import wants_lamps
from refgi.scene.light import SpotLight
from refgi.scene.material import Material
from refgi.scene.model import Camera, Geometry
from refgi.scene.values import Vector
from refgi.types import Array

LIFT = 1e-3  # of a part's size, before the surface that the lamp stands for
FACING = 1e-6  # of a part's area: what has less of a mean normal looks to all sides


def emissive_parts(geometry: Geometry, materials: Sequence[Material]) -> list[Array]:
    """Return the faces of each connected part of the surfaces that emit, in the order of its first face."""
    glows = np.array([any(material.emission) for material in materials], np.bool_)
    faces = np.flatnonzero(glows[geometry.material_of_face]) if glows.any() else np.zeros(0, np.int64)
    if not len(faces):
        return []
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    corners = geometry.vertices[geometry.faces[faces]].reshape(-1, 3)
    point, number = np.unique(corners, axis=0, return_inverse=True)  # seams of a mesh have a vertex each side
    at = number.reshape(-1)
    owner = np.repeat(np.arange(len(faces)), 3)
    links = coo_array((np.ones(len(at), np.int8), (owner, len(faces) + at)), shape=(len(faces) + len(point),) * 2)
    label = connected_components(links, directed=False)[1][: len(faces)]
    first = np.sort(np.unique(label, return_index=True)[1])
    return [faces[label == label[k]] for k in first]


def emissive_lamps(geometry: Geometry, materials: Sequence[Material]) -> tuple[SpotLight, ...]:
    """Return a lamp for each connected emissive part, as this module says."""
    colour = np.array([_emission(material) for material in materials]).reshape(-1, 3)
    return tuple(_lamp(geometry, faces, colour[geometry.material_of_face[faces]])
                 for faces in emissive_parts(geometry, materials))


APPROXIMATION = "each in place of an emissive part: all of its power comes from one point with a cosine falloff"


def lamps_where_asked(geometry: Geometry, materials: Sequence[Material], where: str) -> tuple[SpotLight, ...]:
    """Return the lamps, none unless they are asked for; warn of them, or that emissive surfaces light nothing."""
    lamps = emissive_lamps(geometry, materials) if wants_lamps() else ()
    count = len(lamps) if wants_lamps() else len(emissive_parts(geometry, materials))
    if wants_lamps():
        text = f"{count:,} lamp(s), {APPROXIMATION} (an approximation)"
    else:
        one = count == 1
        text = (f"{count:,} emissive {'surface lights' if one else 'surfaces light'} nothing here, the camera alone "
                f"sees {'it' if one else 'them'}; --emissive lamps puts a lamp on each")
    if count:
        warnings.warn(RefgiWarning(f"{where}: {text}"), stacklevel=4)
    return lamps


def _emission(material: Material) -> Array:
    """Return the radiance of a material, of an emissive texture the mean."""
    emission = np.asarray(material.emission, np.float64)
    if material.emission_texture is None or not emission.any():
        return emission
    mean: Array = material.emission_texture.image.linear().reshape(-1, 3).mean(axis=0, dtype=np.float64)
    return emission * mean


def _lamp(geometry: Geometry, faces: Array, radiance: Array) -> SpotLight:
    a, b, c = (geometry.vertices[geometry.faces[faces, k]] for k in range(3))
    normal = 0.5 * np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1)
    middle = (area[:, None] * (a + b + c)).sum(axis=0) / (3 * area.sum())
    axis = normal.sum(axis=0)
    if np.linalg.norm(axis) < FACING * area.sum():  # a closed part: towards the middle of the scene, or down
        axis = np.mean(geometry.bounds, axis=0) - middle
        axis = axis if np.linalg.norm(axis) > FACING * geometry.diagonal else np.array([0.0, -1.0, 0.0])
    axis = axis / np.linalg.norm(axis)
    before = max(float(((corner - middle) @ axis).max()) for corner in (a, b, c))
    place = middle + (before + LIFT * math.sqrt(area.sum())) * axis
    red, green, blue = (area[:, None] * radiance).sum(axis=0).tolist()  # Phi / pi
    return SpotLight(_as_vector(place), _as_vector(axis), 0.0, math.pi / 2, (red, green, blue), "ramp")


def _as_vector(values: Array) -> Vector:
    x, y, z = values.tolist()
    return x, y, z


VFOV = math.radians(35.0)
SMALLEST_RADIUS = 1e-9  # m; eye and target of a camera must differ
FULL_IRRADIANCE = math.pi  # W/m^2 at the middle of the mesh: an albedo's radiance is then the albedo itself
LIGHT_DISTANCE = 4.0  # radii of the bounding sphere
# From the middle of the mesh towards the eye: front right, and where that shows little, the other corners and sides.
VIEWS = ((0.55, 0.4, 1.0), (-0.55, 0.4, 1.0), (0.55, 0.4, -1.0), (-0.55, 0.4, -1.0), (0.0, 0.0, 1.0), (0.0, 0.0, -1.0),
         (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.3, 1.0, 0.5), (0.3, -1.0, 0.5))
LIGHT_DIRECTION = (-0.8, 1.1, 0.7)  # from the middle towards the lamp: front left, above
MUCH_MORE = 1.2  # of the mesh that another view must show to be taken
ENOUGH_LIT, LEAST_LIT = 0.33, 0.1  # of what the camera sees: to take a place at once, and at all
POINTS, CELLS = 2048, 24  # on the mesh; a side of the coarse picture
MOST_FACES = 1 << 14  # that points are put on
EDGE_ON = 1e-3  # cosine; what is seen at less shows nothing
IN_FRONT = 0.02  # radii; what is further in front of a point's plane, on its way to the eye, hides it
# of a sequence that fills a cube evenly, whatever period the order of the faces has
STEP = np.array((0.8191725133961645, 0.6710436067037893, 0.5497004779019703))


class Points(NamedTuple):
    """Points all over a mesh, each for the same area."""

    position: Array  # (k, 3) m
    normal: Array  # (k, 3) of their faces; either side
    radius: float  # of the bounding sphere, m


def default_camera(geometry: Geometry) -> Camera:
    """Return a camera with the whole bounding box in view and much of the mesh: into an open box from its open side."""
    middle, radius = _sphere(geometry)
    cameras = [Camera(_vector(middle + _unit(view) * (radius / math.sin(VFOV / 2))), _vector(middle), vfov=VFOV)
               for view in VIEWS]
    points = _points(geometry)
    shares = [float(np.count_nonzero(_seen(points, np.array(camera.eye)))) / POINTS for camera in cameras]
    best = int(np.argmax(shares))
    return cameras[best if shares[best] > MUCH_MORE * shares[0] else 0]


def default_light(geometry: Geometry, camera: Camera | None = None) -> SpotLight:
    """Return a spot light that lights what a camera sees: its cone holds the bounding box, or it is at an eye in there.

    White, with an irradiance of pi W/m^2 at the middle; the camera is `default_camera`'s where absent.
    """
    camera = default_camera(geometry) if camera is None else camera
    middle, radius = _sphere(geometry)
    points, eye, (low, high) = _points(geometry), np.array(camera.eye), geometry.bounds
    seen = _seen(points, eye)
    if ((eye > low) & (eye < high)).all():
        return _at_the_eye(camera, points, seen)
    # the usual place, then others nearer and nearer to the eye's direction
    towards = _unit(eye - middle) if np.any(eye != middle) else _unit(VIEWS[0])
    places = [middle + _unit((1 - share) * _unit(LIGHT_DIRECTION) + share * towards) * (LIGHT_DISTANCE * radius)
              for share in (0.0, 0.4, 0.7, 0.9)]
    lit: list[float] = []
    for place in places:
        lit.append(_lit(points, seen, eye, place))
        if lit[-1] >= ENOUGH_LIT:
            break
    if max(lit) > LEAST_LIT or not seen.any():
        return _spot(places[int(np.argmax(lit))], middle, 1.2 * math.asin(1 / LIGHT_DISTANCE))
    return _at_the_eye(camera, points, seen)


def _at_the_eye(camera: Camera, points: Points, seen: Array) -> SpotLight:
    """Return a lamp for the inside of what is closed: where the eye is, bright enough for what is seen."""
    eye, target = np.array(camera.eye), np.array(camera.target)
    distance = np.linalg.norm(points.position[seen] - eye, axis=1)
    far = float(np.median(distance)) if len(distance) else points.radius
    return _spot(eye, eye + _unit(target - eye) * max(far, SMALLEST_RADIUS), math.radians(60.0))


def _spot(place: Array, target: Array, outer: float) -> SpotLight:
    power = FULL_IRRADIANCE * float(np.sum((target - place) ** 2))
    return SpotLight(_vector(place), _vector(target - place), outer / 1.2, outer, (power, power, power))


def _points(geometry: Geometry) -> Points:
    faces = geometry.faces
    if len(faces) > MOST_FACES:
        faces = faces[(np.arange(MOST_FACES) * STEP[0] % 1 * len(faces)).astype(np.int64)]
    a, b, c = (geometry.vertices[faces[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    area = np.linalg.norm(across, axis=1)
    place, u, v = (np.arange(POINTS)[:, None] * STEP % 1).T
    face = np.minimum(np.searchsorted(np.cumsum(area), place * area.sum()), len(faces) - 1)
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    a, b, c = a[face], b[face], c[face]
    normal = across[face] / np.maximum(area[face], np.finfo(np.float64).tiny)[:, None]
    return Points(a + u[:, None] * (b - a) + v[:, None] * (c - a), normal, _sphere(geometry)[1])


def _seen(points: Points, eye: Array) -> Array:
    """Return which points a place sees, (k,) bool, on the six sides of a cube around it."""
    offset = points.position - eye
    size = np.abs(offset)
    axis = np.argmax(size, axis=1)
    depth = np.take_along_axis(offset, axis[:, None], axis=1)[:, 0]
    others = np.take_along_axis(offset, (axis[:, None] + np.array((1, 2))) % 3, axis=1)
    nearest = np.maximum(np.abs(depth), np.finfo(np.float64).tiny)
    side = 2 * axis + (depth > 0)
    place = others / nearest[:, None]
    low, high = place.min(axis=0), place.max(axis=0)
    width = max(float(np.max(high - low)), SMALLEST_RADIUS) / CELLS
    cell = np.minimum(((place - low) / width).astype(np.int64), CELLS - 1)
    key = (side * CELLS + cell[:, 0]) * CELLS + cell[:, 1]
    far_first = np.argsort(-np.einsum("ij,ij->i", offset, offset))
    nearest_in = np.zeros(6 * CELLS * CELLS, np.int64)
    nearest_in[key[far_first]] = far_first  # the last one assigned stays
    to_eye = -np.einsum("ij,ij->i", points.normal, offset)
    to_nearest = np.einsum("ij,ij->i", points.normal, points.position[nearest_in[key]] - points.position)
    shows = np.abs(to_eye) > EDGE_ON * np.linalg.norm(offset, axis=1)
    return np.asarray(shows & (np.sign(to_eye) * to_nearest <= IN_FRONT * points.radius))


def _lit(points: Points, seen: Array, eye: Array, lamp: Array) -> float:
    """Return the share of the seen points that a lamp lights on the side that is seen."""
    to_eye = np.einsum("ij,ij->i", points.normal, eye - points.position)
    to_lamp = np.einsum("ij,ij->i", points.normal, lamp - points.position)
    lit = seen & (to_eye * to_lamp > 0) & _seen(points, lamp)
    return float(np.count_nonzero(lit)) / max(1, int(np.count_nonzero(seen)))


def _sphere(geometry: Geometry) -> tuple[Array, float]:
    low, high = geometry.bounds
    return (low + high) / 2, max(float(np.linalg.norm(high - low)) / 2, SMALLEST_RADIUS)


def _unit(vector: "Array | tuple[float, ...]") -> Array:
    return np.asarray(np.asarray(vector) / np.linalg.norm(vector))


def _vector(values: Array) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z

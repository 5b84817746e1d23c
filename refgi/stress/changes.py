"""Changes of a scene after which a picture is known: brighter lamps, other units, another place, other triangles.

A change gives the changed scene, the options of its frame, and what brings its picture back to that of the scene as it
was. Powers of two and whole multiples of the coordinates' grid round nothing; other factors round each number anew.
"""

import dataclasses
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, Literal, NamedTuple

import numpy as np

from refgi.errors import InputError
from refgi.scene import Camera, DirectionalLight, Geometry, Light, Scene, SpotLight
from refgi.scene.mesh import at_corners
from refgi.scene.motion import rotation_about
from refgi.scene.values import BRIGHTEST, LARGEST, Vector
from refgi.types import Array

Map = Callable[[Array], Array]  # (n, 3) to (n, 3)
Promise = Literal["bits", "rounding", "estimate", "mean"]
FAR = (1e6, -1e6, 1e6)  # m
ASIDE = (0.3713, 0.1237, -0.2719)  # shares of the diagonal: no multiple of any grid
ANGLE = 0.7  # rad
SHUFFLE = 5  # seed
HIDDEN = (1e3, 10.0, 0.2)  # half the side of the hidden plane, in diagonals: the first that is hidden


class NotPromisedError(InputError):
    """A change that a scene has no room for; its text says why."""


class Changed(NamedTuple):
    """A changed scene, and how its buffers relate to those of the scene as it was."""

    scene: Scene
    options: Mapping[str, Any] = MappingProxyType({})  # of the frame
    flux: float = 1.0  # irradiance over that of the scene as it was
    length: float = 1.0  # depth over that of the scene as it was
    mirrored: bool = False  # left and right of the picture are exchanged
    part: tuple[slice, slice] = (slice(None), slice(None))  # of the picture as it was that is shown

    def back(self, plane: Array, *, light: bool = True) -> Array:
        """Return a buffer (..., h, w) of the changed scene as that of the part of the scene as it was."""
        plane = plane[..., ::-1] if self.mirrored else plane
        return plane / self.flux if light else plane


class Change(NamedTuple):
    """What is done to a scene, and what of its picture is promised then."""

    name: str
    about: str
    promise: Promise  # the strongest that any method gives
    apply: Callable[[Scene, int, int], Changed]  # of scene, width and height


def mapped(scene: Scene, places: Map, directions: Map = lambda d: d, power: float = 1.0) -> Scene:
    """Return a scene with places and directions, (n, 3), changed; NotPromisedError where it leaves a scene's range."""
    def one(of: Map, vector: Vector) -> Vector:
        x, y, z = (float(c) for c in of(np.array([vector], np.float64))[0])
        return x, y, z

    def light(old: Light) -> Light:
        if isinstance(old, DirectionalLight):
            return dataclasses.replace(old, direction=one(directions, old.direction))
        placed: Any = {"position": one(places, old.position)}
        if isinstance(old, SpotLight):
            placed["direction"] = one(directions, old.direction)
        return dataclasses.replace(_brighter(old, power), **placed)

    shape, camera = scene.geometry, scene.camera
    vertices = places(np.asarray(shape.vertices, np.float64))
    if max(np.abs(vertices).max(), np.abs(places(np.array([camera.eye, camera.target]))).max()) > LARGEST:
        raise NotPromisedError(f"coordinates would pass {LARGEST:g} m")
    normals = None if shape.vertex_normals is None else directions(np.asarray(shape.vertex_normals, np.float64))
    return dataclasses.replace(
        scene, geometry=dataclasses.replace(shape, vertices=vertices, vertex_normals=normals),
        camera=dataclasses.replace(camera, eye=one(places, camera.eye), target=one(places, camera.target),
                                   up=one(directions, camera.up)),
        lights=tuple(light(old) for old in scene.lights))


def _brighter(light: Light, factor: float) -> Light:
    key = "irradiance" if isinstance(light, DirectionalLight) else "intensity"
    values = tuple(factor * c for c in getattr(light, key))
    if max(values) > BRIGHTEST:
        raise NotPromisedError(f"a lamp would be brighter than {BRIGHTEST:g}")
    brighter: Any = {key: values}
    return dataclasses.replace(light, **brighter)


def _flux(power: int) -> Change:
    def apply(scene: Scene, _: int, __: int) -> Changed:
        factor = 2.0**power
        return Changed(scene.with_lights(*(_brighter(light, factor) for light in scene.lights)), flux=factor)

    return Change(f"flux x 2^{power}", "all lamps brighter by a power of two", "bits", apply)


def _length(power: int) -> Change:
    def apply(scene: Scene, _: int, __: int) -> Changed:
        factor = 2.0**power
        return Changed(mapped(scene, lambda p: p * factor, power=factor**2), length=factor)

    return Change(f"length x 2^{power}", "all lengths in another unit, lamps such that irradiance stays", "bits", apply)


def _moved_far(scene: Scene, _: int, __: int) -> Changed:
    return Changed(mapped(scene, lambda p: p + FAR))


def _moved_aside(scene: Scene, _: int, __: int) -> Changed:
    return Changed(mapped(scene, lambda p: p + scene.geometry.diagonal * np.array(ASIDE)))


def _turned(rotation: Array) -> Callable[[Scene, int, int], Changed]:
    def turn(vectors: Array) -> Array:
        return np.asarray(vectors @ rotation.T)

    return lambda scene, _, __: Changed(mapped(scene, turn, turn))


def _mirrored(scene: Scene, _: int, __: int) -> Changed:
    across = np.array([-1.0, 1.0, 1.0])
    return Changed(mapped(scene, lambda p: p * across, lambda d: d * across), mirrored=True)


def _remeshed(remesh: Callable[[Geometry], Geometry]) -> Callable[[Scene, int, int], Changed]:
    return lambda scene, _, __: Changed(dataclasses.replace(scene, geometry=remesh(scene.geometry)))


def _permuted(shape: Geometry) -> Geometry:
    order = np.random.default_rng(SHUFFLE).permutation(len(shape.faces))
    return dataclasses.replace(shape, faces=shape.faces[order], material_of_face=shape.material_of_face[order],
                               **at_corners(shape, lambda values: values[order]))


def _unwelded(shape: Geometry) -> Geometry:
    corners = shape.faces.reshape(-1)
    return dataclasses.replace(
        shape, vertices=shape.vertices[corners], faces=np.arange(len(corners), dtype=np.int32).reshape(-1, 3),
        vertex_normals=None if shape.vertex_normals is None else shape.vertex_normals[corners])


def _doubled(shape: Geometry) -> Geometry:
    return dataclasses.replace(shape, faces=np.concatenate([shape.faces] * 2),
                               material_of_face=np.concatenate([shape.material_of_face] * 2),
                               **at_corners(shape, lambda values: np.concatenate([values] * 2)))


def _split(shape: Geometry) -> Geometry:
    corners, count, faces = shape.faces.T, len(shape.vertices), len(shape.faces)
    ab, bc, ca = (count + k * faces + np.arange(faces) for k in range(3))
    a, b, c = corners
    quarters = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]

    def with_middles(values: Array) -> Array:
        return np.concatenate([values, *(0.5 * (values[p] + values[q]) for p, q in ((a, b), (b, c), (c, a)))])

    return dataclasses.replace(
        shape, vertices=with_middles(np.asarray(shape.vertices, np.float64)),
        faces=np.concatenate([np.stack(quarter, axis=1) for quarter in quarters]).astype(np.int32),
        material_of_face=np.concatenate([shape.material_of_face] * 4),
        vertex_normals=None if shape.vertex_normals is None else with_middles(shape.vertex_normals),
        **at_corners(shape, _split_corners))


def _split_corners(values: Array) -> Array:
    a, b, c = np.moveaxis(values, 1, 0)
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    quarters = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.concatenate([np.stack(quarter, axis=1) for quarter in quarters])


def _two_lamps(scene: Scene, _: int, __: int) -> Changed:
    halves = [_brighter(light, 0.5) for light in scene.lights]
    return Changed(scene.with_lights(*(half for half in halves for _ in range(2))))


def _hidden_plane(scene: Scene, width: int, height: int) -> Changed:
    (low, high), diagonal = scene.geometry.bounds, scene.geometry.diagonal
    for half in (share * diagonal for share in HIDDEN):
        for axis in range(3):
            for side in (low[axis] - 1e-3 * diagonal, high[axis] + 1e-3 * diagonal):
                with_plane = _with_plane(scene, axis, float(side), half)
                if half + np.abs((low, high)).max() <= LARGEST and _is_hidden(with_plane, scene.face_count, width,
                                                                              height):
                    return Changed(with_plane)
    raise NotPromisedError("every plane beside the scene is seen or lit")


def _with_plane(scene: Scene, axis: int, place: float, half: float) -> Scene:
    shape = scene.geometry
    corners = np.tile(0.5 * np.add(*shape.bounds), (4, 1))
    corners[:, axis] = place
    corners[:, (axis + 1) % 3] += (-half, half, half, -half)
    corners[:, (axis + 2) % 3] += (-half, -half, half, half)
    normals = shape.vertex_normals
    faces = np.array([[0, 1, 2], [0, 2, 3]]) + len(shape.vertices)
    return dataclasses.replace(scene, geometry=dataclasses.replace(
        shape, vertices=np.concatenate([shape.vertices, corners]),
        faces=np.concatenate([shape.faces, faces]).astype(np.int32),
        material_of_face=np.append(shape.material_of_face, [0, 0]).astype(np.int32),
        vertex_normals=None if normals is None else np.concatenate([normals, np.tile(np.eye(3)[axis], (4, 1))]),
        **at_corners(shape, lambda values: np.concatenate([values, np.zeros((2, *values.shape[1:]))]))))


def _is_hidden(scene: Scene, faces: int, width: int, height: int) -> bool:
    """Whether neither the camera nor any lamp sees faces from number `faces` on."""
    from refgi.frame import Frame

    frame = Frame(scene, width=width, height=height, rsm_resolution=256)
    seen = [frame.gbuffer.triangle_id, *(rsm.triangle_id for rsm in frame.rsms)]
    return not any((ids >= faces).any() for ids in seen)


def _cropped(scene: Scene, width: int, height: int) -> Changed:
    """Show the middle half of the picture: its pixels look where they looked before."""
    if width % 4 or height % 4:
        raise NotPromisedError("width and height are no multiples of 4")
    camera: Camera = dataclasses.replace(scene.camera, vfov=2 * np.arctan(0.5 * np.tan(0.5 * scene.camera.vfov)))
    middle = tuple(slice(n // 4, n - n // 4) for n in (height, width))
    return Changed(dataclasses.replace(scene, camera=camera), {"width": width // 2, "height": height // 2},
                   part=(middle[0], middle[1]))


def _doubled_resolution(scene: Scene, width: int, height: int) -> Changed:
    return Changed(scene, {"width": 2 * width, "height": 2 * height})


QUARTER = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
CHANGES: tuple[Change, ...] = (
    *(_flux(power) for power in (27, -27, 60, -60)),
    *(_length(power) for power in (27, -27)),
    Change("moved far", "moved by 1e6 m along each axis", "rounding", _moved_far),
    Change("moved aside", "moved by shares of its size that are on no grid", "rounding", _moved_aside),
    Change("quarter turn", "turned about y by 90 degrees", "rounding", _turned(QUARTER)),
    Change("turned", "turned about y by 0.7 rad", "rounding", _turned(rotation_about((0.0, 1.0, 0.0), ANGLE))),
    Change("mirrored", "x for -x", "rounding", _mirrored),
    Change("faces permuted", "the same triangles in another order", "bits", _remeshed(_permuted)),
    Change("faces split", "each triangle in four", "rounding", _remeshed(_split)),
    Change("faces unwelded", "no vertex shared", "bits", _remeshed(_unwelded)),
    Change("faces doubled", "each triangle twice", "bits", _remeshed(_doubled)),
    Change("two lamps of half", "each lamp as two of half its flux at its place", "rounding", _two_lamps),
    Change("hidden plane", "a plane up to 2,000 diagonals wide that nothing sees and no lamp reaches", "rounding",
           _hidden_plane),
    Change("cropped", "the middle half of the picture alone", "rounding", _cropped),
    Change("resolution x 2", "twice the width and height; the pictures' means are compared", "mean",
           _doubled_resolution),
    Change("float64", "float64 for float32", "rounding",
           lambda scene, _, __: Changed(scene, {"dtype": np.dtype(np.float64)})),
)

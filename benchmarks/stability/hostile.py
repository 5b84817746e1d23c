"""Random scenes that nobody would build: needles, soups, lamps and cameras in walls, all sizes and exponents.

A scene is a list of pieces under some lamps, so that a shrinker can leave out what a failure does not need.
"""

import dataclasses
import math
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from refgi.scene import Camera, DirectionalLight, Light, Material, Mesh, PointLight, Scene, SpotLight, merge
from refgi.types import Array

MOST_PIXELS = 17  # along a side
ANGLES = (179.999, 0.001, 40.0, 90.0, 120.0)  # vertical fields of view, degrees
EXPONENTS = (0.0, 1.0, 30.0, 1e3, 1e6, 1e20)


class Hostile(NamedTuple):
    """A scene in pieces."""

    meshes: tuple[Mesh, ...]
    lights: tuple[Light, ...]
    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    vfov_deg: float
    size: tuple[int, int]  # pixels

    def scene(self) -> Scene:
        """Return it as a scene; raises InputError where refgi refuses it."""
        geometry, materials = merge(self.meshes)
        camera = Camera(self.eye, self.target, (0.0, 1.0, 0.0), math.radians(self.vfov_deg), *self.size)
        return Scene("hostile", geometry, materials, camera, self.lights)

    def written(self) -> str:
        """Return it as Python that makes it again."""
        meshes = ",\n    ".join(f"Mesh(np.array({mesh.vertices.tolist()}), np.array({mesh.faces.tolist()}), None, "
                                f"{mesh.material!r})" for mesh in self.meshes)
        return f"Hostile(({meshes},),\n  {self.lights!r},\n  {self.eye}, {self.target}, {self.vfov_deg}, {self.size})"


def hostile(seed: int) -> Hostile:
    """Return a random scene."""
    rng = np.random.default_rng(seed)
    scale = 10.0 ** rng.uniform(-8, 8)
    place = np.zeros(3) if rng.random() < 0.7 else scale * 10.0 ** rng.uniform(0, 4) * _direction(rng)
    place = np.where(np.abs(place) + 20 * scale < 1e9, place, 0.0)
    pieces = [PIECES[int(k)](rng) for k in rng.integers(0, len(PIECES), rng.integers(1, 4))]
    meshes = [Mesh(scale * vertices + place, faces, None, _material(rng, k)) for k, (vertices, faces) in
              enumerate(pieces)]
    corners = np.concatenate([mesh.vertices for mesh in meshes])
    eye = _spot(rng, corners, scale, place)
    target = _spot(rng, corners, scale, place)
    target = target if np.linalg.norm(target - eye) > 1e-3 * scale else eye + scale * _direction(rng)
    lights = tuple(_light(rng, corners, scale, place) for _ in range(rng.integers(1, 4)))
    width, height = (int(n) for n in rng.integers(1, MOST_PIXELS + 1, 2))
    return Hostile(tuple(meshes), lights, _tuple(eye), _tuple(target), float(rng.choice(ANGLES)), (width, height))


def shrunk(scene: Hostile, fails: Callable[[Hostile], bool]) -> Hostile:
    """Return a scene that still fails and of which no piece can be left out."""
    again = True
    while again:
        again = False
        for smaller in _smaller(scene):
            if fails(smaller):
                scene, again = smaller, True
                break
    return scene


def _smaller(scene: Hostile) -> Iterator[Hostile]:
    for k in range(len(scene.meshes)):
        if len(scene.meshes) > 1:
            yield scene._replace(meshes=(*scene.meshes[:k], *scene.meshes[k + 1 :]))
    for k in range(len(scene.lights)):
        if len(scene.lights) > 1:
            yield scene._replace(lights=(*scene.lights[:k], *scene.lights[k + 1 :]))
    for k, mesh in enumerate(scene.meshes):
        half = len(mesh.faces) // 2
        for faces in (mesh.faces[:half], mesh.faces[half:]) if half else ():
            yield _with_mesh(scene, k, dataclasses.replace(mesh, faces=faces))
        if mesh.material != Material():
            yield _with_mesh(scene, k, dataclasses.replace(mesh, material=Material()))
    width, height = scene.size
    if width * height > 1:
        yield scene._replace(size=((width + 1) // 2, (height + 1) // 2))


def _with_mesh(scene: Hostile, k: int, mesh: Mesh) -> Hostile:
    used, faces = np.unique(mesh.faces, return_inverse=True)
    mesh = dataclasses.replace(mesh, vertices=mesh.vertices[used], faces=faces.reshape(-1, 3))
    return scene._replace(meshes=(*scene.meshes[:k], mesh, *scene.meshes[k + 1 :]))


Piece = tuple[Array, Array]


def _direction(rng: np.random.Generator) -> Array:
    found = rng.normal(size=3)
    return np.asarray(found / np.linalg.norm(found))


def _tuple(vector: Any) -> tuple[float, float, float]:
    x, y, z = (float(c) for c in vector)
    return x, y, z


def _spot(rng: np.random.Generator, corners: Array, scale: float, place: Array) -> Array:
    """Return a place for a lamp or an eye: anywhere, on a vertex, in a wall, beside one."""
    kind = rng.integers(0, 4)
    if kind == 0:
        return np.asarray(place + scale * rng.uniform(-3, 3, 3))
    if kind == 1:
        return np.asarray(corners[rng.integers(len(corners))], np.float64)
    a, b, c = corners[rng.integers(0, len(corners), 3)]
    inside = (a + b + c) / 3
    return np.asarray(inside if kind == 2 else inside + scale * 10.0 ** rng.uniform(-9, -2) * _direction(rng))


def _light(rng: np.random.Generator, corners: Array, scale: float, place: Array) -> Light:
    power = 10.0 ** rng.uniform(-6, 6) * rng.random(3)
    kind = rng.integers(0, 3)
    if kind == 2:
        return DirectionalLight(_tuple(_direction(rng)), _tuple(power))
    where = _tuple(_spot(rng, corners, scale, place))
    if kind == 1:
        return PointLight(where, _tuple(power))
    outer = float(np.radians(rng.choice([1e-4, 0.1, 10.0, 45.0, 80.0, 90.0])))
    return SpotLight(where, _tuple(_direction(rng)), outer * float(rng.choice([0.0, 0.9, 1.0])), outer, _tuple(power))


def _material(rng: np.random.Generator, number: int) -> Material:
    name, kind = f"m{number}", rng.integers(0, 4)
    if kind == 0:
        return Material(name, diffuse=_tuple(rng.choice([0.0, 1.0], 3)))
    if kind == 1:
        share = float(rng.random())
        return Material(name, diffuse=(1 - share,) * 3, specular=(share,) * 3, exponent=float(rng.choice(EXPONENTS)))
    if kind == 2:
        return Material(name, diffuse=(0.0,) * 3, ior=float(rng.choice([1.0, 1.5, 1000.0])))
    return Material(name, diffuse=_tuple(rng.random(3)))


def _room(rng: np.random.Generator) -> Piece:
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    walls = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    kept = walls if rng.random() < 0.5 else walls[:-1]
    return corners, np.array([face for a, b, c, d in kept for face in ((a, b, c), (a, c, d))])


def _triangles(rng: np.random.Generator) -> Piece:
    count = int(rng.integers(1, 12))
    return rng.uniform(-1, 1, (3 * count, 3)), np.arange(3 * count).reshape(-1, 3)


def _needles(rng: np.random.Generator) -> Piece:
    count = int(rng.integers(1, 30))
    base, along = rng.uniform(-1, 1, (count, 3)), rng.normal(size=(count, 3))
    aside = 10.0 ** rng.uniform(-8, -3, (count, 1)) * rng.normal(size=(count, 3))
    return np.stack([base, base + along, base + along + aside], axis=1).reshape(-1, 3), \
        np.arange(3 * count).reshape(-1, 3)


def _soup(rng: np.random.Generator) -> Piece:
    """Coplanar triangles over each other."""
    count = int(rng.integers(2, 20))
    flat = np.concatenate([rng.uniform(-1, 1, (3 * count, 2)), np.zeros((3 * count, 1))], axis=1)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return flat @ (turn if rng.random() < 0.5 else np.eye(3)), np.arange(3 * count).reshape(-1, 3)


def _fan(rng: np.random.Generator) -> Piece:
    """Triangles around one vertex."""
    count = int(rng.integers(3, 40))
    angle = 2 * np.pi * np.arange(count) / count
    rim = np.stack([np.cos(angle), 0.1 * rng.normal(size=count), np.sin(angle)], axis=1)
    corners = np.concatenate([np.zeros((1, 3)), rim])
    ring = np.arange(count)
    return corners, np.stack([np.zeros(count, int), 1 + ring, 1 + (ring + 1) % count], axis=1)


def _flat(rng: np.random.Generator) -> Piece:
    """Faces without area among others."""
    vertices, faces = _triangles(rng)
    return vertices, np.concatenate([faces, [[0, 0, 1]], [[1, 1, 1]]])


PIECES = (_room, _room, _triangles, _needles, _soup, _fan, _flat)

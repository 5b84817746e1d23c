"""Pictures: what `refgi stress` promises, on built-in scenes, and random scenes that nobody would build.

`python -m benchmarks.stability.pictures METHOD SEED` shows one of these, `METHOD FIRST LAST` tries many. A hostile
scene is a list of pieces under some lamps, so that a shrinker can leave out what a failure does not need.
"""

import dataclasses
import math
import sys
import time
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from typing import Any, NamedTuple

import numba
import numpy as np

from benchmarks.stability.promise import Task, Tell
from refgi import load_scene
from refgi.errors import InputError, RefgiWarning
from refgi.methods import BUILT_IN, render
from refgi.scene import Camera, DirectionalLight, Light, Material, Mesh, PointLight, Scene, SpotLight, merge
from refgi.stress.promises import Row, settings_of
from refgi.stress.run import PART, stress
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


SIZE = 64
SCENES = ("cornell_box", "stage", "ring:faces=3000", "glass_ball:faces=3000", "metaballs",
          "integrating_sphere:faces=1000", "textured_atrium", "leaf_grid")
SHORT_METHODS = ("sii", "multires", "hssil", "gather")
# a few lights each: what breaks on a strange scene breaks with few
FEW = {"sii": ("lights=64",), "multires": ("lights=64",), "val": ("lights=64", "clusters=4", "maps=16"),
       "vpl": ("lights=64",), "truth": ("samples=8", "photons=4096")}
MAP = 32  # texels of a lamp's map
HOSTILE, SHORT_HOSTILE = 3000, 6
PROCESSES, SHARE = 2, 200  # of the full form; scenes that one of them tries at once
SLOWEST = 10.0  # s of a processor, a picture
DOMAIN = ("needles, soups, fans, lamps and cameras in walls, 1e-8 to 1e8 m, exponents to 1e20, 1 to 17 pixels "
          "along a side")
SOUND = "no number that is no light, no exception but InputError, no warning of Python, within 10 s"


def tasks(short: bool) -> list[Task]:
    """Return the tasks: each scene's changes, and hostile scenes by method."""
    scenes = SCENES[:1] if short else SCENES
    methods = SHORT_METHODS if short else tuple(BUILT_IN)
    changed = [Task(f"changes-{name.partition(':')[0]}", lambda _, name=name: _changed(name, methods))
               for name in scenes]
    count = SHORT_HOSTILE if short else HOSTILE
    processes = 1 if short else PROCESSES
    return [*changed, *(Task(f"hostile-{name}",
                             lambda tell, name=name: [hostile_row(name, range(count), tell, processes)])
                        for name in methods)]


def _changed(name: str, methods: Sequence[str]) -> list[Row]:
    scene = load_scene(name)
    return [found.row for found in stress(scene, methods, width=SIZE, height=SIZE, source=name)]


def hostile_row(method: str, seeds: Sequence[int], tell: Tell, processes: int = 1) -> Row:
    """Return how many hostile scenes break a method; in this process, or in some others."""
    if processes == 1:
        broken = broken_by(method, seeds)
    else:
        shares = [seeds[first : first + SHARE] for first in range(0, len(seeds), SHARE)]
        with ProcessPoolExecutor(processes, get_context("spawn"), numba.set_num_threads, (1,)) as pool:
            broken = [one for share in pool.map(partial(broken_by, method), shares) for one in share]
    for seed, why in broken:
        tell(f"{method}, seed {seed}: {why}")
    worst = ""
    if broken:
        smallest = shrunk(hostile(broken[0][0]), lambda one: bool(fault_of(one, method)))
        worst = f"{broken[0][1]}; smallest scene: {smallest.written()}"
    seed = broken[0][0] if broken else None
    return Row(part=PART, property="hostile scenes", subject=method, domain=DOMAIN, figure=len(broken), unit="scenes",
               limit=0, kind="exact", source=SOUND, cases=len(seeds), seed=seed, detail=worst,
               reproduce=f"python -m benchmarks.stability.pictures {method} {seed or 0}")


def broken_by(method: str, seeds: Iterable[int]) -> list[tuple[int, str]]:
    """Return the hostile scenes that break a method, and how."""
    found = ((seed, fault_of(hostile(seed), method)) for seed in seeds)
    return [(seed, why) for seed, why in found if why]


def fault_of(scene: Hostile, method: str) -> str:
    """Return what breaks when a method renders a scene; nothing where it is refused or rendered well."""
    begin = time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", RefgiWarning)
            picture = render(scene.scene(), method, settings_of(method, FEW.get(method, ())), rsm_resolution=MAP)
    except InputError:
        return ""
    except Exception as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        return f"{type(error).__name__}: {error} ({where.name}, line {where.lineno})"
    for what in ("irradiance", "lobes", "radiance"):
        light = getattr(picture, what)
        if light is not None and not (np.isfinite(light).all() and (light >= 0).all()):
            return (f"{what}: {np.count_nonzero(~np.isfinite(light))} numbers not finite, "
                    f"{np.count_nonzero(light < 0)} below 0")
    spent = time.process_time() - begin
    return f"{spent:.0f} s" if spent > SLOWEST else ""


def main(arguments: list[str]) -> int:
    """Show one scene, or count those that break of as many as are wanted."""
    method, first, *last = arguments
    if last:
        row = hostile_row(method, range(int(first), int(last[0])), print, PROCESSES)
        print(f"{method}: {row.figure:g} of {row.cases} scenes break it\n{row.detail}".rstrip())
        return int(not row.passed)
    print(hostile(int(first)).written())
    fault = fault_of(hostile(int(first)), method)
    print(fault or "nothing breaks")
    return int(bool(fault))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

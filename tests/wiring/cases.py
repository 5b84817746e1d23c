"""Cases of wiring: settings that a method must heed, and the scenes on which heeding them shows.

A case sets some keys. What is asked of it: the picture is that of the method assembled by hand (`tests/naive`), and
each of its keys alone, put back to its default, makes another picture. `uncovered` lists what no case of a method sets,
from the settings classes, so that a new field without a case fails.
"""

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from typing import Any, Literal, get_args, get_origin

import numpy as np

from refgi.errors import InputError
from refgi.frame import Frame
from refgi.scene import Camera, DirectionalLight, Material, Mesh, PointLight, Scene, SpotLight, merge
from refgi.settings import of
from refgi.settings.fields import choices_of, hints, is_choice, may_be_none, members
from tests.truth.scenes import rectangle

NOTHING: Mapping[str, Any] = MappingProxyType({})
COUNTS = 1e-3  # of the brightest pixel, that a key changes at least
# strongest and weakest differ by a factor of 8 and in hue, so that neither order nor channel can be mistaken
LAMPS = (
    SpotLight((0.5, 1.5, 0.6), (-0.6, -0.8, -0.7), 0.4, 0.8, (4.0, 2.6, 1.3)),
    PointLight((0.2, 0.9, 0.3), (0.10, 0.25, 0.5)),
    DirectionalLight((-0.5, -0.9, -0.3), (0.5, 0.3, 0.9)),
)
# rolled: no two pixels are mirror images
VIEW = Camera((1.7, 1.4, 1.5), (-0.4, 0.35, -0.5), (0.1, 1.0, 0.0), math.radians(70))


@dataclasses.dataclass(frozen=True)
class Case:
    """Settings under test.

    `values` are the keys under test; `over` holds what it takes for them to matter, which other cases test. `scene`
    names one of `SCENES`, `frame` are options of `Frame`. `same` says why the picture stays as it is without
    `values`, if it does: a bound, an order of passes. `parts` are the cases that are folded into it.
    """

    values: Mapping[str, Any]
    over: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    scene: str = "lamps"
    frame: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    same: str = ""
    parts: tuple[str, ...] = ()

    def settings(self, kind: type, base: Mapping[str, Any] = NOTHING) -> Any:
        """Return the settings of the case over those that make every case small."""
        return of(kind, **{**base, **self.over, **self.values})

    def without(self, kind: type, base: Mapping[str, Any] = NOTHING) -> Iterator[tuple[str, Any]]:
        """Yield each key under test, and the settings with that key as its default has it.

        A key without a default, a number that its choice must be given, has twice its value there.
        """
        for key, value in self.values.items():
            rest = {other: kept for other, kept in self.values.items()
                    if other != key and not other.startswith(f"{key}.")}
            try:
                yield key, of(kind, **{**base, **self.over, **rest})
            except InputError as error:
                if error.key is None or not key.endswith(error.key):
                    raise
                yield key, of(kind, **{**base, **self.over, **rest, key: 2 * value})

    def seen(self) -> Frame:
        """Return the frame of the case, in float64."""
        options = {"width": 17, "height": 13, "rsm_resolution": 16, "dtype": np.float64} | dict(self.frame)
        return Frame(SCENES[self.scene](), **options)


def room(*lights, smooth=False, glass=False, matte=False):
    """A corner with a diffuse floor, a diffuse and glossy wall, and a purely glossy block before the other wall."""
    glossy = Material("glossy", (0.3, 0.2, 0.4), (0, 0, 0) if matte else (0.4, 0.5, 0.2), 12.0)
    mirror = Material("purely glossy", (0.0, 0.0, 0.0), (0, 0, 0) if matte else (0.7, 0.5, 0.6), 40.0)
    floor, green = Material("floor", (0.6, 0.55, 0.4)), Material("green", (0.1, 0.6, 0.2))
    meshes = [
        rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2), floor),
        rectangle((-1, 0, -1), (2, 0, 0), (0, 2, 0), glossy),
        rectangle((-1, 0, 1), (0, 0, -2), (0, 2, 0), green),
        rectangle((-0.4, 0.5, -0.1), (0.6, 0, 0), (0, 0, -0.5), mirror),
    ]
    if smooth or glass:
        meshes.append(ball((0.3, 0.35, -0.2), 0.3, Material("glass", (0, 0, 0), ior=1.5) if glass else
                           Material("ball", (0.5, 0.3, 0.2), (0.2, 0.3, 0.4), 20.0)))
    geometry, materials = merge(meshes, smooth=smooth)
    return Scene("wiring", geometry, materials, VIEW, lights)


def painted(scene):
    """The scene with reflectances on its glass, which reflects nothing all the same."""
    return dataclasses.replace(scene, materials=tuple(
        dataclasses.replace(one, diffuse=(0.3, 0.4, 0.5), specular=(0.2, 0.2, 0.1), exponent=9.0) if one.ior else one
        for one in scene.materials))


def ball(center, radius, material):
    """An octahedron's eight faces cut in four each, pushed out to a sphere."""
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    faces = [(a, b, c) if np.linalg.det(axes[[a, b, c]]) > 0 else (a, c, b)
             for a in (0, 3) for b in (1, 4) for c in (2, 5)]
    corners = []
    for face in faces:
        p, q, r = axes[list(face)]
        pq, qr, rp = p + q, q + r, r + p
        corners += [p, pq, rp, pq, q, qr, rp, qr, r, pq, qr, rp]
    vertices = np.asarray(corners, float)
    vertices /= np.linalg.norm(vertices, axis=1)[:, None]
    return Mesh(np.asarray(center) + radius * vertices, np.arange(len(vertices)).reshape(-1, 3),
                vertices, material)


def tilted(scene):
    """Return a scene with vertex normals up to 35 degrees off those of its triangles, and wide lobes.

    Sharp ones would be met by few of an estimator's samples where they point below the horizon that normals make.
    """
    corners = scene.geometry.vertices[scene.geometry.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.repeat(normals / np.linalg.norm(normals, axis=1, keepdims=True), 3, axis=0)
    normals += 0.5 * np.sin(np.multiply.outer(np.arange(len(normals)), (1.0, 2.0, 3.0)))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    geometry = dataclasses.replace(scene.geometry, vertices=corners.reshape(-1, 3), vertex_normals=normals,
                                   faces=np.arange(len(normals), dtype=np.int32).reshape(-1, 3))
    materials = tuple(dataclasses.replace(m, exponent=min(m.exponent, 4.0)) for m in scene.materials)
    return dataclasses.replace(scene, geometry=geometry, materials=materials)


SCENES = {
    "lamps": lambda: room(*LAMPS),
    "smooth": lambda: room(*LAMPS, smooth=True),
    "close": lambda: tilted(room(*LAMPS)).with_camera(vfov=math.radians(25)),
    "tilted": lambda: tilted(room(*LAMPS)),
    "glass": lambda: room(*LAMPS, glass=True),
    "smooth glass": lambda: room(*LAMPS, smooth=True, glass=True),
    "painted glass": lambda: painted(room(*LAMPS, glass=True)),
    "spot": lambda: room(LAMPS[0]),
    "bulbs": lambda: room(*LAMPS[:2]),
    # the ball fills half of the height, so that neighbouring normals differ by little
    "ball": lambda: room(*LAMPS, smooth=True).with_camera(eye=(0.9, 0.6, 0.4), target=(0.3, 0.35, -0.2)),
    "matte": lambda: room(*LAMPS, matte=True),
}


def assert_each_key_counts(
    case: Case, kind: type, picture_of: Callable[[Frame, Any], Any], base: Mapping[str, Any] = NOTHING,
    frame: Frame | None = None, same: float = 0.0,
) -> None:
    """Expect another picture with each key put back to its default, or where the case says why the same one.

    Differences are shares of the brightest pixel.
    """
    frame = case.seen() if frame is None else frame
    picture = picture_of(frame, case.settings(kind, base))
    for key, other in case.without(kind, base):
        change = np.abs(picture_of(frame, other) - picture).max() / picture.max()
        assert change <= same if case.same else change > COUNTS, (key, change)


def under(part: str, cases: Mapping[str, Case], base: Mapping[str, Any] = NOTHING) -> dict[str, Case]:
    """Return the cases of a part of a settings class as cases of the whole, over what else it takes."""
    def whole(keys: Mapping[str, Any]) -> dict[str, Any]:
        return {f"{part}.{key}": value for key, value in keys.items()}

    return {name: dataclasses.replace(case, values=whole(case.values), over={**base, **whole(case.over)})
            for name, case in cases.items()}


def uncovered(kind: type, cases: Mapping[str, Case], base: Mapping[str, Any] = NOTHING) -> set[str]:
    """Return what no case sets: fields, names of choices, of literals and of printed forms, but for the defaults."""
    met = {setting for case in cases.values() for _, other in case.without(kind, base)
           for setting in differences(case.settings(kind, base), other)}
    return set(needed(kind)) - met


def needed(kind: type) -> Iterator[str]:
    """Yield what a class of settings has to have a case for, as `Owner.field` or `Owner.field = name`."""
    for field in dataclasses.fields(kind):
        hint, word = hints(kind)[field.name], f"{kind.__name__}.{field.name}"
        plain = members(hint)[0]
        if is_choice(hint):
            yield from (f"{word} = {name}" for name in {*choices_of(hint), "none"} - {name_of(field.default)}
                        if name != "none" or may_be_none(hint))
        elif get_origin(plain) is frozenset:
            yield from (f"{word} = {name}" for name in kind.SWITCHES)
        elif get_origin(plain) is Literal:
            yield from (f"{word} = {value}" for value in get_args(plain) if value != field.default)
        elif not choices_of(hint):
            yield word
        for one in choices_of(hint).values():
            yield from needed(one)


def differences(one: Any, other: Any) -> Iterator[str]:
    """Yield in what settings of one class differ, in the words of `needed`."""
    for field in dataclasses.fields(one):
        hint, word = hints(type(one))[field.name], f"{type(one).__name__}.{field.name}"
        here, there = getattr(one, field.name), getattr(other, field.name)
        if here == there:
            continue
        if is_choice(hint) and name_of(here) != name_of(there):
            yield f"{word} = {name_of(here)}"
        elif choices_of(hint):
            yield from differences(here, there)
        elif isinstance(here, frozenset):
            yield from (f"{word} = {name}" for name in here ^ there)
        else:
            yield f"{word} = {here}" if get_origin(members(hint)[0]) is Literal else word


def name_of(choice: Any) -> str:
    return "none" if choice is None else choice.name()

"""Paths from TOML files, as pydantic models: strict, no unknown keys, every error of a file at once.

Angles are in degrees here; times (`at`) are shares of the sequence, so that one file serves any number of frames. What
no key of the camera or a light names stays as the scene has it. A file has ::

    frames = 48
    curve = "catmull_rom"  # or "linear"

    [[camera]]
    at = 0.0
    eye = [0.0, 1.0, 3.0]  # also target, up, vfov_deg

    [[lights]]
    light = 0
    keys = [{at = 0.0, position = [0.0, 2.0, 0.0]}, {at = 1.0, position = [1.0, 2.0, 0.0]}]

    [[objects]]
    material = "red"  # or faces = [first, end]; also axis, center
    keys = [{at = 0.0}, {at = 1.0, turn_deg = 90.0, move = [0.1, 0.0, 0.0]}]
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path as FilePath
from typing import Annotated, Any, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from refgi.errors import InputError, expect, first_faults, shortened
from refgi.scene.files import read_toml
from refgi.scene.light import DirectionalLight, PointLight, SpotLight
from refgi.scene.model import Scene
from refgi.scene.motion import faces_of
from refgi.scene.path import Curve, Motion, Path, Track, changed
from refgi.scene.values import LARGEST, is_direction, is_place
from refgi.types import Array

MOST_FRAMES = 100_000
Number = Annotated[float, Field(allow_inf_nan=False)]
Time = Annotated[float, Field(allow_inf_nan=False, ge=0, le=1)]
Triple = tuple[Number, Number, Number]
# by key of the file: the field of the camera or light
CAMERA = {"eye": "eye", "target": "target", "up": "up", "vfov_deg": "vfov"}
LIGHTS: dict[type, dict[str, str]] = {
    SpotLight: {"position": "position", "direction": "direction", "intensity_w_per_sr": "intensity"},
    PointLight: {"position": "position", "intensity_w_per_sr": "intensity"},
    DirectionalLight: {"direction": "direction", "irradiance_w_per_m2": "irradiance"}}


class Entry(BaseModel):
    """What every table of the file has in common."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class Key(Entry):
    """Some values at one time."""

    at: Time

    @model_validator(mode="after")
    def not_idle(self) -> Self:
        """Refuse a key that names no value: one could take it for the scene's own."""
        if self.model_fields_set <= {"at"}:
            raise ValueError(f"expected a value at {self.at:g}, nothing given")
        return self


class CameraKey(Key):
    """The camera at one time."""

    eye: Triple | None = None
    target: Triple | None = None
    up: Triple | None = None
    vfov_deg: Number | None = None


class LightKey(Key):
    """A light at one time."""

    position: Triple | None = None
    direction: Triple | None = None
    intensity_w_per_sr: Triple | None = None
    irradiance_w_per_m2: Triple | None = None


class ObjectKey(Entry):
    """An object at one time: how far it is turned and moved from where the scene has it."""

    at: Time
    turn_deg: Number = 0.0
    move: Triple = (0.0, 0.0, 0.0)


class LightEntry(Entry):
    """A light on its way."""

    light: Annotated[int, Field(ge=0)] = 0
    keys: Annotated[list[LightKey], Field(min_length=1)]


class ObjectEntry(Entry):
    """Faces on their way: those of a material, or from one number up to, not including, another."""

    material: str | None = None
    faces: tuple[int, int] | None = None
    axis: Triple = (0.0, 1.0, 0.0)
    center: Triple | None = None
    keys: Annotated[list[ObjectKey], Field(min_length=1)]

    @model_validator(mode="after")
    def sound(self) -> Self:
        """Refuse faces named twice or not at all, and an axis without direction."""
        if (self.material is None) == (self.faces is None):
            raise ValueError("expected either material or faces")
        if not is_direction(self.axis):
            raise ValueError("axis: expected a finite vector, not zero, up to 1e+100 long")
        return self


class PathFile(Entry):
    """The whole file."""

    frames: Annotated[int, Field(ge=1, le=MOST_FRAMES)] | None = None
    curve: Curve = "catmull_rom"
    camera: list[CameraKey] = []
    lights: list[LightEntry] = []
    objects: list[ObjectEntry] = []


def read_path(file: str | FilePath, scene: Scene) -> tuple[Path, int | None]:
    """Read what moves through a scene, and how.

    `scene`: its lights and materials are what the file's can be. Returns `path`: the way of camera, lights and objects.
    `frames`: how many frames the file asks for. Raises `InputError`: one error with all faults of the file, one a line.
    """
    file = FilePath(file)
    entry = _validated(file)
    faults: list[str] = []
    camera = _tracks(entry.camera, CAMERA, "camera", faults)
    faults += _unusable(scene.camera, entry.camera, camera, "camera", entry.curve)
    lights = dict(_lights(entry, scene, faults))
    objects = tuple(_objects(entry, scene, faults))
    if faults:
        raise InputError(first_faults([f"{file}: {fault}" for fault in faults]))
    return Path(entry.curve, camera, lights, objects, str(file)), entry.frames


def _validated(file: FilePath) -> PathFile:
    tree = read_toml(file)
    try:
        return PathFile.model_validate_json(json.dumps(tree, default=str))  # as JSON, a list may be a tuple
    except ValidationError as error:
        faults = [f"{file}: {_fault(detail)}" for detail in error.errors(include_url=False)]
        raise InputError(first_faults(faults)) from error


def _fault(detail: Any) -> str:
    """Return "key: what was expected, got value" of one pydantic error."""
    key = "".join(f"[{part}]" if isinstance(part, int) else f".{shortened(part)}" for part in detail["loc"])
    text = str(detail["msg"]).removeprefix("Value error, ").replace("Input should be", "expected")
    if detail["type"] == "extra_forbidden":
        text = "unknown key"
    shown = repr(detail["input"]) if detail["type"] not in ("value_error", "missing") else ""
    return f"{key.removeprefix('.') or 'file'}: {text}{f', got {shortened(shown, 80)}' if shown else ''}"


def _tracks(keys: Sequence[Any], fields: Mapping[str, str], where: str, faults: list[str]) -> dict[str, Track]:
    """Return a track for each field that any of the keys names; angles come out in rad."""
    times = [key.at for key in keys]
    if times != sorted(set(times)):
        faults.append(f"{where}: expected keys with ascending times (at), got {times}")
        return {}
    tracks = {}
    for name, field in fields.items():
        timed = [(key.at, value) for key in keys if (value := getattr(key, name)) is not None]
        if timed:
            values = np.array([value for _, value in timed], np.float64).reshape(len(timed), -1)
            in_rad = np.radians(values) if name.endswith("_deg") else values
            tracks[field] = Track(np.array([at for at, _ in timed]), in_rad)
    return tracks


def _unusable(
    element: Any, keys: Sequence[Any], tracks: Mapping[str, Track], where: str, curve: Curve
) -> Iterator[str]:
    """Yield a fault for each key at whose time a camera or a light is not usable."""
    for number, key in enumerate(keys):
        try:
            changed(element, tracks, key.at, curve)
        except InputError as error:
            yield f"{where}[{number}]: {str(error).removeprefix('camera: ').removeprefix('light: ')}"


def _lights(entry: PathFile, scene: Scene, faults: list[str]) -> Iterator[tuple[int, dict[str, Track]]]:
    numbers = set()
    for number, light_entry in enumerate(entry.lights):
        where = f"lights[{number}]"
        if light_entry.light >= len(scene.lights) or light_entry.light in numbers:
            faults.append(f"{where}.light: expected 0 to {len(scene.lights) - 1}, each once, got {light_entry.light}")
            continue
        numbers.add(light_entry.light)
        known = LIGHTS[type(scene.lights[light_entry.light])]
        named = {name for key in light_entry.keys for name in key.model_fields_set} - {"at"}
        faults += [f"{where}.keys: {name}: light {light_entry.light} has none, but {', '.join(known)}"
                   for name in sorted(named - set(known))]
        tracks = _tracks(light_entry.keys, known, f"{where}.keys", faults)
        faults += _unusable(scene.lights[light_entry.light], light_entry.keys, tracks, f"{where}.keys", entry.curve)
        yield light_entry.light, tracks


def _objects(entry: PathFile, scene: Scene, faults: list[str]) -> Iterator[Motion]:
    for number, item in enumerate(entry.objects):
        where = f"objects[{number}]"
        try:
            faces = _faces(item, scene)
        except InputError as error:
            faults.append(f"{where}.{error}")
            continue
        corners = scene.geometry.vertices[scene.geometry.faces[faces]].reshape(-1, 3)
        middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
        tracks = _tracks(item.keys, {"turn_deg": "turn", "move": "move"}, f"{where}.keys", faults)
        far = {f"{where}.center": item.center or (0.0, 0.0, 0.0)}
        far |= {f"{where}.keys[{k}].move": key.move for k, key in enumerate(item.keys)}
        faults += [f"{key}: expected three lengths up to {LARGEST:g} m, got {place}" for key, place in far.items()
                   if not is_place(place)]
        x, y, z = middle.tolist() if item.center is None else item.center
        yield Motion(faces, item.axis, (x, y, z), tracks.get("turn"), tracks.get("move"))


def _faces(item: ObjectEntry, scene: Scene) -> Array:
    if item.material is not None:
        return faces_of(scene, item.material)
    assert item.faces is not None  # checked by ObjectEntry.sound
    first, end = item.faces
    expect(0 <= first < end <= scene.face_count, "faces", f"first and end within 0 to {scene.face_count}", item.faces)
    selected = np.zeros(scene.face_count, np.bool_)
    selected[first:end] = True
    return selected

"""Animation of camera, lights and objects by keyframes, linear or Catmull-Rom."""

import dataclasses
import math
from collections.abc import Iterator, Mapping
from typing import Any, Literal, NamedTuple

import numpy as np

from refgi.errors import InputError
from refgi.scene.model import Camera, Geometry, Light, Scene
from refgi.scene.motion import moved, rotation_about, with_own_vertices
from refgi.scene.values import Vector
from refgi.types import Array

Curve = Literal["linear", "catmull_rom"]


class Track(NamedTuple):
    """A value at some times of a path, which lasts from 0 to 1."""

    at: Array  # (k,) ascending
    values: Array  # (k, n)


class Motion(NamedTuple):
    """How some faces move rigidly: turned about an axis through a center, then moved."""

    faces: Array  # (m,) bool
    axis: Vector
    center: Vector  # m
    turn: Track | None  # rad
    move: Track | None  # m


@dataclasses.dataclass(frozen=True, eq=False)
class Path:
    """Which of a scene's values change along a sequence, and how; times are shares of its length.

    `camera` and `lights` (by number) name fields of `Camera` and of the light. `source` is the file that it comes from,
    for the text of an error.
    """

    curve: Curve = "catmull_rom"
    camera: Mapping[str, Track] = dataclasses.field(default_factory=dict)
    lights: Mapping[int, Mapping[str, Track]] = dataclasses.field(default_factory=dict)
    objects: tuple[Motion, ...] = ()
    source: str = ""

    def leaves_at_rest(self, lights: int) -> bool:
        """Return whether the camera's view, or what one of a scene's `lights` sees, is the same in all frames."""
        return not self.objects and (not self.camera or len(self.lights) < lights)

    def place(self, frame: int, frames: int) -> str:
        """Return file, frame and time, for the text of an error."""
        file = f"{self.source}: " if self.source else ""
        return f"{file}frame {frame} of {frames} (at = {frame_time(frame, frames):.6g})"


def value_at(track: Track, time: float, curve: Curve) -> Array:
    """Return the (n,) values of a track at a time, 0 to 1; before the first key and after the last their values hold.

    Linear, or a cubic through all keys with the slope of the chord between each key's neighbours, which leaves values
    that lie on a line on it. A key's value to the bit at its time.
    """
    at, values = track.at, track.values
    if time <= at[0] or time >= at[-1]:
        end: Array = values[0 if time <= at[0] else -1]
        return end
    i = int(np.searchsorted(at, time, side="right")) - 1
    step, s = at[i + 1] - at[i], (time - at[i]) / (at[i + 1] - at[i])
    chord = values[i + 1] - values[i]
    straight: Array = values[i] + s * chord
    if curve == "linear":
        return straight
    before, after = _slope(track, i) * step - chord, _slope(track, i + 1) * step - chord
    bent: Array = straight + s * (1 - s) * ((1 - s) * before - s * after)  # Hermite, relative to the chord
    return bent


def scenes_along(scene: Scene, path: Path, frames: int) -> Iterator[Scene]:
    """Yield the scene of every frame of a path, the first at time 0, the last at time 1.

    Frames between which nothing moves share one geometry. Raises InputError, which names the frame, if its camera, a
    light or an object is not usable.
    """
    for motion in path.objects:
        scene = dataclasses.replace(scene, geometry=with_own_vertices(scene.geometry, motion.faces))
    placed: tuple[list[Array], Geometry] | None = None
    for frame in range(frames):
        time = frame_time(frame, frames)
        camera, lights = camera_and_lights(scene, path, frame, frames)
        keys = [value_at(t, time, path.curve) for m in path.objects for t in (m.turn, m.move) if t is not None]
        if placed is None or not all(map(np.array_equal, keys, placed[0])):
            placed = keys, _placed(scene.geometry, path, frame, frames)
        yield dataclasses.replace(scene, geometry=placed[1], camera=camera, lights=lights)


def camera_and_lights(scene: Scene, path: Path, frame: int, frames: int) -> tuple[Camera, tuple[Light, ...]]:
    """Return the camera and the lights of a frame, the scene's own objects where nothing of them changes.

    Raises InputError, which names the frame, if they are not usable.
    """
    time = frame_time(frame, frames)
    name = ""
    try:
        camera = changed(scene.camera, path.camera, time, path.curve)
        lights = []
        for number, light in enumerate(scene.lights):
            name = f"lights[{number}] of the scene: "
            lights.append(changed(light, path.lights.get(number, {}), time, path.curve))
    except InputError as error:
        raise InputError(f"{path.place(frame, frames)}: {name}{error}") from error
    return camera, tuple(lights)


def frame_time(frame: int, frames: int) -> float:
    """Return when a frame is, 0 to 1."""
    return frame / max(1, frames - 1)


def changed(element: Any, tracks: Mapping[str, Track], time: float, curve: Curve) -> Any:
    """Return a camera or a light with the values that its tracks, by field, have at a time, 0 to 1.

    The same object where there is no track. Raises InputError if a value is not usable.
    """
    values = {key: value_at(track, time, curve).tolist() for key, track in tracks.items()}
    changes = {key: value[0] if len(value) == 1 else tuple(value) for key, value in values.items()}
    return dataclasses.replace(element, **changes) if changes else element


def _placed(geometry: Geometry, path: Path, frame: int, frames: int) -> Geometry:
    time = frame_time(frame, frames)
    for motion in path.objects:
        angle = 0.0 if motion.turn is None else float(value_at(motion.turn, time, path.curve)[0])
        x, y, z = np.zeros(3) if motion.move is None else value_at(motion.move, time, path.curve)
        angle = math.remainder(angle, 2 * math.pi)  # a whole turn is none, to the bit
        try:
            geometry = moved(geometry, motion.faces, rotation_about(motion.axis, angle), motion.center, (x, y, z))
        except InputError as error:
            raise InputError(f"{path.place(frame, frames)}: {error}") from error
    return geometry


def _slope(track: Track, i: int) -> Array:
    """Return the slope of the chord between a key's neighbours; at an end, of the last chord."""
    first, last = max(0, i - 1), min(len(track.at) - 1, i + 1)
    slope: Array = (track.values[last] - track.values[first]) / (track.at[last] - track.at[first])
    return slope

"""One frame of a sequence: its record, and the frame made again with those before it that its light is blended with."""

import hashlib
from collections.abc import Mapping
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

from refgi.errors import InputError, expect
from refgi.methods import KeepingEstimate, Picture, find_method, require_filter, usual_shadows
from refgi.provenance.record import Record, light_json, plain
from refgi.scene import Scene
from refgi.scene.files import read_bytes
from refgi.scene.path import Path as Way
from refgi.scene.path import camera_and_lights, scenes_along
from refgi.scene.pathfile import read_path
from refgi.sssil.temporal import Sequence, TemporalSettings, still_frame


class SequenceFrame(NamedTuple):
    """Which frame of which sequence."""

    number: int
    of: int
    path: str  # TOML file of the path
    temporal: TemporalSettings | None


class StillFrames(NamedTuple):
    """How many frames of a resting scene a picture is blended of."""

    frames: int
    temporal: TemporalSettings

    @property
    def record(self) -> Record:
        """What it adds to the record of scene and method: JSON values."""
        return {"frames": self.frames, "temporal": plain(self.temporal)}


def path_record(path: str, of: int, temporal: TemporalSettings | None) -> Record:
    """Return what all `of` frames of a sequence share beyond scene and method: the path's file and the filter."""
    return {"path": {"source": path, "sha256": _digest(path)}, "of": of, "temporal": plain(temporal)}


def frame_record(scene: Scene, way: Way, number: int, of: int) -> Record:
    """Return what one frame adds: its number, camera and lights in full; `scene`: without the path `way`."""
    camera, lights = camera_and_lights(scene, way, number, of)
    return {"frame": number, "at_frame": {"camera": plain(camera), "lights": [light_json(light) for light in lights]}}


def whole_record(scene: Scene, frame: SequenceFrame) -> Record:
    """Return what a frame adds to the record of a scene without its path: `path_record` and `frame_record`."""
    way, _ = read_path(frame.path, scene)
    return {**path_record(frame.path, frame.of, frame.temporal), **frame_record(scene, way, frame.number, frame.of)}


def same_sequence(a: Mapping[str, Any], b: Mapping[str, Any]) -> list[str]:
    """Return in which keys two frames' records are not of one sequence; names of files and estimates do not count."""
    same = {"estimate": None}
    left, right = (_flat({**one, **same, **{key: {**one.get(key, {}), "source": None} for key in ("scene", "path")}})
                   for one in (a, b))
    return sorted(key for key in left.keys() | right.keys() if left.get(key) != right.get(key))


def require_repeatable(settings: Any) -> None:
    """Refuse settings by which frames of a sequence end by the clock or share a checkpoint: none comes twice alike."""
    for key, why in (("seconds", "as the clock ends no frame of a sequence twice alike: say samples"),
                     ("checkpoint", "as a file holds the passes of one frame alone")):
        value = getattr(settings, key, None)
        expect(value is None, key, f"none, {why}", value)


def render_frame(scene: Scene, method: str, settings: Any, frame: SequenceFrame, options: Mapping[str, Any]) -> Picture:
    """Render one frame of a sequence to the bit as in the whole of it, after those that its temporal filter needs."""
    require_repeatable(settings)
    way, _ = read_path(frame.path, scene)
    first = frame.number if frame.temporal is None else 0
    scenes = islice(scenes_along(scene, way, frame.of), first, frame.number + 1)
    light = KeepingEstimate(find_method(method))
    sequence = Sequence(scenes, settings, frame.temporal, method=light, lobes=light.lobes, **options)
    for step in sequence.over(scenes, first):
        made = step
    return Picture(made.frame, made.irradiance, made.radiance, None if frame.temporal else light.estimate, made.frames,
                   made.lobes, light.lobe_estimate)


def render_still(scene: Scene, method: str, settings: Any, still: StillFrames, options: Mapping[str, Any]) -> Picture:
    """Render the last frame of a resting scene by a method and its temporal filter; InputError if it has none."""
    require_filter([method])
    options = {**options, "shadows": options.get("shadows") or usual_shadows(settings)}
    light = KeepingEstimate(find_method(method))
    last = still_frame(scene, settings, still.temporal, still.frames, method=find_method(method).function,
                       lobes=light.lobes, **options)
    return Picture(last.frame, last.irradiance, last.radiance, frames=last.frames, lobes=last.lobes,
                   lobe_estimate=light.lobe_estimate)


def require_same_path(record: Mapping[str, Any], found: str) -> None:
    """Raise InputError if the content of a path file is not the one of `record`, a `path_record`'s entry "path"."""
    if _digest(found) != record["sha256"]:
        raise InputError(f"{found}: expected the path of the sequence, got another (SHA-256)", file=found, key="path")


def _digest(path: str) -> str:
    return hashlib.sha256(read_bytes(Path(path))).hexdigest()


def _flat(content: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in content.items():
        flat |= _flat(value, f"{prefix}{key}.") if isinstance(value, Mapping) else {f"{prefix}{key}": value}
    return flat

"""The pictures of a bench, in `pictures/SCENE/` of its folder, and as views for its page."""

import functools
import itertools
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple

import numpy as np

from refgi.bench.grid import TRUTH
from refgi.bench.results import Run, SceneResult, in_percent
from refgi.compare.album import SECOND, THIRD, Judge, Picture, View
from refgi.compare.outcome import UNOCCLUDED
from refgi.compare.pages import number
from refgi.compare.pictures import linear_planes
from refgi.errors import expect
from refgi.frame import Frame
from refgi.image import read_exr, write_exr
from refgi.provenance import Record, method_record, scene_record
from refgi.scene import Scene
from refgi.scene.files import is_there
from refgi.types import Array

FOLDER = "pictures"
TRUTH_FILES = {TRUTH: f"{TRUTH}.exr", UNOCCLUDED: f"{TRUTH}_{UNOCCLUDED}.exr"}
IDS_FILE = "ids.exr"


class Place(NamedTuple):
    """Where the pictures of one scene lie."""

    out: Path  # folder of results.json
    folder: str  # inside it

    def name(self, file: str) -> str:
        """Return a file as results.json names it."""
        return f"{self.folder}/{file}"


def places(out: Path, scenes: Sequence[str]) -> list[Place]:
    """Return a place for each of several scenes: folders by their names, the later ones of one name with a number."""
    names: list[str] = []
    for scene in scenes:
        stem = re.sub(r"[^A-Za-z0-9_-]+", "_", scene) or "_"
        numbered = (f"{stem}-{number}" for number in itertools.count(2))
        names.append(next(name for name in itertools.chain([stem], numbered) if name not in names))
    return [Place(out, f"{FOLDER}/{name}") for name in names]


class Writer(NamedTuple):
    """Writes pictures of one scene, each with the record of how it was made."""

    place: Place
    scene: Scene  # as it was loaded
    frame: Frame  # what they show

    def write(self, stem: str, planes: Mapping[str, Array], record: Record) -> str:
        """Write one EXR of planes, (h, w) by channel, whole or not at all; return its path from results.json."""
        frame, name = self.frame, self.place.name(f"{stem}.exr")
        file = self.place.out / name
        file.parent.mkdir(parents=True, exist_ok=True)
        options = {"dtype": frame.dtype.name, "rsm_resolution": frame.rsm_resolution, "shadows": frame.shadows}
        write_exr(file, planes, {**scene_record(self.scene, options, size=(frame.width, frame.height)), **record})
        return name

    def write_runs(self, runs: Sequence[tuple[str, Any, Array, Array | None]]) -> Iterator[str]:
        """Write pictures (method, settings, irradiance W/m^2, lobes W/m^2/sr or None) and yield each file."""
        counts: Counter[str] = Counter()
        for method, settings, irradiance, lobes in runs:
            counts[method] += 1
            planes = linear_planes(self.frame.radiance(irradiance, lobes), irradiance, lobes=lobes)
            yield self.write(f"{method}-{counts[method]:02d}", planes, method_record(method, settings))

    def write_ids(self) -> str:
        """Write what each pixel shows, planes `face` and `material`, 2^32 - 1 where nothing; return the file."""
        buffer = self.frame.gbuffer
        ids = {"face": buffer.triangle_id, "material": buffer.material_id}
        return self.write(Path(IDS_FILE).stem, {key: plane.astype(np.uint32) for key, plane in ids.items()}, {})


Planes = dict[str, Array]


def named(scene: SceneResult, position: int) -> list[tuple[str, Run]]:
    """Return all runs of a scene, methods first, each with a name of its own on the page."""
    return [(f"scene{position}-{run.method}-{i}", run) for i, run in enumerate((*scene.runs, *scene.line), 1)]


def view_of(scene: SceneResult, position: int, folder: Path) -> tuple[View, Record] | None:
    """Return the pictures of a scene that are there and the truth's record; None without truth or any picture."""
    there = [(name, run, file) for name, run in named(scene, position)
             if (file := _file(run, folder)) is not None and file.is_file()]
    truth = there[0][2].with_name(TRUTH_FILES[TRUTH]) if there else None
    if truth is None or not truth.is_file():
        return None
    channels, record = _read(truth, scene)
    judges = {TRUTH: _judge(truth, channels, scene.truth)}
    if (other := truth.with_name(TRUTH_FILES[UNOCCLUDED])).is_file():
        judges[UNOCCLUDED] = _judge(other, _read(other, scene)[0], "")
    ids = _read(truth.with_name(IDS_FILE), scene)[0] if truth.with_name(IDS_FILE).is_file() else {}
    important = _important(scene)
    pictures = [Picture(name, f"{run.method}: {run.label}", _said(run), _judges(run, judges),
                        functools.partial(_light, file, scene), SECOND if run in important else THIRD)
                for name, run, file in there]
    view = View(f"scene{position}", scene.scene, float(record.get("exposure", 1.0)), _covered(channels), judges,
                pictures, {name: plane for name, plane in ids.items() if plane.dtype == np.uint32})
    return view, record


def _file(run: Run, folder: Path) -> Path | None:
    if run.picture is None:
        return None
    path = PurePosixPath(run.picture)
    expect(not path.is_absolute() and ".." not in path.parts, f"{folder / 'results.json'}: picture",
           "a file inside its folder", run.picture)
    return folder / path if is_there(folder / path) else None


def _read(file: Path, scene: SceneResult) -> tuple[Planes, Record]:
    channels, record = read_exr(file)
    shape = next(iter(channels.values())).shape
    expect(shape == (scene.height, scene.width), f"{file}", f"{scene.width} x {scene.height} pixels",
           f"{shape[1]} x {shape[0]}")
    return channels, record


def _light(file: Path, scene: SceneResult) -> tuple[Array, Array]:
    channels = _read(file, scene)[0]
    return _rgb(channels, "irradiance.", file), _rgb(channels, "", file)


def _rgb(channels: Planes, prefix: str, file: Path) -> Array:
    names = [prefix + channel for channel in "RGB"]
    missing = [name for name in names if name not in channels]
    expect(not missing, f"{file}", "the channels of a picture of refgi", f"none named {', '.join(missing)}")
    return np.stack([channels[name] for name in names])


def _judge(file: Path, channels: Planes, said: str) -> Judge:
    return Judge(_rgb(channels, "irradiance.", file), _rgb(channels, "variance.", file), _rgb(channels, "", file), said)


def _covered(channels: Planes) -> Array:
    """Return the pixels that show a surface: those with samples or, where they are not counted, with any light."""
    counted = [channels["samples"]] if "samples" in channels else list(channels.values())
    covered: Array = np.any([plane != 0 for plane in counted], axis=0)
    return covered


def _judges(run: Run, judges: Mapping[str, Judge]) -> tuple[str, ...]:
    return tuple(name for name in judges if name in run.errors)


def _important(scene: SceneResult) -> list[Run]:
    """Return the runs on the front and each method's nearest."""
    nearest = {run.method: run for run in sorted((*scene.runs, *scene.line), key=lambda one: -one.rmse)}
    return [*nearest.values(), *(run for run in scene.runs if run.front)]


def _said(run: Run) -> str:
    return f"RMSE {in_percent(run.rmse)} % in {number(1e3 * run.seconds)} ms"


def provenance_of(record: Record) -> Iterator[tuple[str, str]]:
    """Yield what a picture's record says of its scene, as (name, value); nothing where the picture holds no record."""
    from refgi.compare.report import provenance_rows

    if "scene" in record:
        yield from provenance_rows(record)

"""A picture made again from its record: the same scene, looked for where it may lie now, and the same settings.

A record comes with an EXR, which may be a stranger's: before anything is done by it, its keys and the kinds and sizes
of what is taken as it is are judged. Scene, camera, lights and settings are judged where they are made.
"""

import dataclasses
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from refgi.errors import InputError, RefgiWarning, blame, expect, first_faults
from refgi.image import read_exr
from refgi.methods import find_method
from refgi.provenance.record import (
    VERSION,
    Record,
    camera_from,
    geometry_digest,
    light_from,
    materials_digest,
    program,
    versions,
)
from refgi.scene import Scene, builtin_scenes, load_scene
from refgi.scene.files import is_there
from refgi.settings import Settings, flat, of_record

if TYPE_CHECKING:
    from refgi.provenance.frames import SequenceFrame, StillFrames

Number = Annotated[float, Field(allow_inf_nan=False)]
Count = Annotated[int, Field(ge=0, lt=2**31)]
Objects = dict[str, Any]


class _Entry(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class ProgramEntry(_Entry):
    """Which refgi made it."""

    version: str
    git: str | None = None


class LampsEntry(_Entry):
    """Lamps that stand for emissive surfaces."""

    count: Count
    approximation: str


class ExposureEntry(_Entry):
    """What an exposure was taken from."""

    percentile: Annotated[float, Field(ge=0, le=100)]


class SceneEntry(_Entry):
    """Which scene, and as seen and lit by what."""

    source: str | None
    files: dict[str, str]
    name: str
    faces: Count
    geometry_sha256: str
    materials_sha256: str
    camera: Objects
    lights: list[Objects]
    emissive_lamps: LampsEntry | None = None


class OptionsEntry(_Entry):
    """Options of a `Frame`."""

    dtype: Literal["float32", "float64"]
    rsm_resolution: Annotated[int, Field(ge=1, le=65536)]
    shadows: Literal["map", "exact"] | None = None


class EstimateEntry(_Entry):
    """What an estimate came to; its figures are of no consequence."""

    model_config = ConfigDict(extra="allow")

    passes: Annotated[int, Field(ge=1, lt=2**31)] | None = None


class PathEntry(_Entry):
    """The path that a sequence follows."""

    source: str
    sha256: str


class PictureRecord(_Entry):
    """All of it."""

    provenance: int
    refgi: ProgramEntry
    versions: dict[str, str | None]
    scene: SceneEntry
    options: OptionsEntry
    exposure: Annotated[float, Field(allow_inf_nan=False, gt=0)]
    auto_exposure: ExposureEntry | None = None
    engine: Literal["literal"] | None = None  # what ran stages in place of kernels
    units: dict[str, str]
    content: str
    method: str
    settings: Objects
    estimate: EstimateEntry = EstimateEntry()
    sampling_error: Objects | None = None
    lightcuts: Objects | None = None
    path: PathEntry | None = None
    of: Count = 0
    temporal: Objects | None = None
    frame: Count = 0
    at_frame: Objects = {}
    frames: Annotated[int, Field(ge=1, lt=2**31)] = 1


def require_sound(record: Mapping[str, Any], path: Path) -> None:
    """Raise InputError, with all keys that are missing, unknown or of another kind, if a record is not whole."""
    try:
        PictureRecord.model_validate(dict(record))
    except ValidationError as error:
        faults = [f"{path}: {'.'.join(map(str, one['loc']))}: {one['msg']}" for one in error.errors()]
        raise InputError(first_faults(faults), key=".".join(map(str, error.errors()[0]["loc"]))) from error


COMPUTES = ("numpy", "numba", "llvmlite", "scipy", "embreex")  # what may change a bit of a picture
PARTS = {"geometry": geometry_digest, "materials": materials_digest}


class Job(NamedTuple):
    """What is to be rendered, and by what."""

    scene: Scene
    method: str
    settings: Any  # as they were asked for
    options: dict[str, Any]  # of the frame: dtype, rsm_resolution, shadows
    exposure: float
    passes: int | None = None  # that an estimate bounded by time or error came to
    frame: "SequenceFrame | None" = None  # where it is one of a sequence
    still: "StillFrames | None" = None  # where it is blended of frames of a resting scene

    @property
    def repeatable(self) -> Any:
        """Settings that end after the recorded passes, and not by the clock or in some earlier run's checkpoint."""
        if self.passes is None:
            return self.settings
        samples = self.passes * (self.settings.picks_per_pass + self.settings.directions_per_pass)
        return dataclasses.replace(self.settings, samples=samples, seconds=None, target_error=None, checkpoint=None)


def read_record(path: Path) -> Record:
    """Read the record of a picture.

    Parameters
    ----------
    path : Path
        An EXR that refgi wrote.

    Returns
    -------
    dict
        Whole and of a known version.

    Raises
    ------
    InputError
        If the file is missing, damaged, not from refgi, or holds no record of a picture, or one with a key that this
        version does not know.
    """
    with blame(file=str(path)):
        record = read_exr(path)[1]
        expect(bool(record), str(path), "an EXR that refgi wrote", "another program's")
        expect("provenance" in record and "method" in record, str(path), "the record of how a picture was made",
               "an EXR of refgi without one")
        expect(record["provenance"] == VERSION, f"{path}: provenance", f"version {VERSION} of the record",
               record["provenance"])
        require_sound(record, path)
    return record


def job_of(record: Mapping[str, Any], path: Path, scene: str | None = None) -> Job:
    """Return what a record says was rendered, with the scene loaded and found to be the same.

    Parameters
    ----------
    record : mapping
        What `read_record` gave.
    path : Path
        The picture, for messages and as a place from where its scene is looked for.
    scene : str, optional
        Where the scene is now; looked for where absent.

    Returns
    -------
    Job
        Ready to be rendered.

    Raises
    ------
    InputError
        If the scene is not found or not the same any more, or a setting is not known to this version.

    Warns
    -----
    RefgiWarning
        If the picture was made by another version, or with a file that its record names and that is left alone.
    """
    with blame(file=str(path)):
        _warn_of_other_versions(record, path)
        if "engine" in record:
            raise InputError(f"{path}: made by the {record['engine']} engine, whose bits are not promised: render its "
                             f"scene with --engine {record['engine']}")
        if (checkpoint := record["settings"].get("checkpoint")) is not None:
            warnings.warn(RefgiWarning(f"{path}: checkpoint {checkpoint!r}: neither read nor written; only --out is"),
                          stacklevel=2)
        try:
            settings = _settings(find_method(record["method"]).settings, record["settings"], path)
            passes = record.get("estimate", {}).get("passes")
            if passes is None and getattr(settings, "checkpoint", None) is not None:
                settings = dataclasses.replace(settings, checkpoint=None)  # a stranger's file may name any of ours
            return Job(_same_scene(record["scene"], path, scene), record["method"], settings, dict(record["options"]),
                       record["exposure"], passes, _frame(record, path), _still(record, path))
        except InputError:
            raise
        except (KeyError, TypeError, AttributeError, ValueError, OverflowError) as error:
            raise InputError(f"{path}: expected a whole record, got one without {error}") from error


def _same_scene(record: Mapping[str, Any], path: Path, moved: str | None) -> Scene:
    camera, lights = camera_from(record["camera"]), [light_from(light) for light in record["lights"]]
    name = moved if moved is not None else _found(record["source"], path)
    scene = load_scene(name, camera=camera, lights=lights)
    changed = [part for part, digest in PARTS.items() if digest(scene) != record[f"{part}_sha256"]]
    if changed:
        now = dict(scene.source.files) if scene.source else {}
        files = [file for file, digest in record["files"].items() if now.get(file) != digest]
        raise InputError(f"{path}: scene {name}: expected the scene of the picture, got other "
                         f"{' and '.join(changed)}" + (f" (changed: {', '.join(files)})" if files else ""),
                         key="scene")
    return dataclasses.replace(scene, emissive_lamps=record.get("emissive_lamps", {}).get("count", 0))


def _found(source: str | None, path: Path) -> str:
    """Return where a scene or path lies: from the current folder, or from a folder above the picture."""
    if source is None:
        raise InputError(f"{path}: the scene was made in Python; --scene names one in a file", key="scene")
    if source.partition(":")[0] in builtin_scenes():
        return source
    for place in (Path(source), *(folder / source for folder in path.resolve().parents)):
        if is_there(place):
            return str(place)
    raise InputError(f"{path}: {source}: not there, neither from the current folder nor from one above the "
                     "picture (--scene says where a scene is)", key="scene")


def _settings(wanted: type[Settings], values: Mapping[str, Any], path: Path) -> Any:
    """Return settings of a record, which holds every key of their tree."""
    try:
        made = of_record(wanted, values)
    except InputError as error:
        raise InputError(f"{path}: {wanted.__name__}: {error}", key="settings") from error
    if set(flat(made)) != set(values):
        raise InputError(f"{path}: {wanted.__name__}: expected {', '.join(flat(made))}; got {', '.join(values)}",
                         key="settings")
    return made


def _frame(record: Mapping[str, Any], path: Path) -> "SequenceFrame | None":
    if "frame" not in record:
        return None
    from refgi.provenance.frames import SequenceFrame, require_same_path
    from refgi.sssil.temporal import TemporalSettings

    found, temporal = _found(record["path"]["source"], path), record["temporal"]
    require_same_path(record["path"], found)
    return SequenceFrame(record["frame"], record["of"], found,
                         None if temporal is None else _settings(TemporalSettings, temporal, path))


def _still(record: Mapping[str, Any], path: Path) -> "StillFrames | None":
    if "frames" not in record:
        return None
    from refgi.provenance.frames import StillFrames
    from refgi.sssil.temporal import TemporalSettings

    return StillFrames(record["frames"], _settings(TemporalSettings, record["temporal"], path))


def _warn_of_other_versions(record: Mapping[str, Any], path: Path) -> None:
    then, now = _identity(record), _identity({"refgi": program(), "versions": versions()})
    other = [name for name in now if then.get(name) != now[name]]
    if other:
        text = ", ".join(f"{name} {then.get(name) or 'unknown'} (here {now[name] or 'unknown'})" for name in other)
        warnings.warn(RefgiWarning(f"{path}: made by {text}: bits may differ"), stacklevel=3)


def _identity(record: Mapping[str, Any]) -> dict[str, str | None]:
    program, versions = record["refgi"], record["versions"]
    return {"refgi": program["version"], "git": program.get("git")} | {name: versions.get(name) for name in COMPUTES}

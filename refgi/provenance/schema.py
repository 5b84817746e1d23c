"""The record of a picture as a schema: what a file may say before anything is done by it.

A record comes with an EXR, which may be a stranger's. Scene, camera, lights and settings are judged where they are
made; here stand the keys that there are, and the kinds and sizes of what is taken as it is.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from refgi.errors import InputError, first_faults

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
    """Raise InputError, with all keys that are missing, unknown or of another kind, if a picture's record is not whole.

    `path`: the picture, for messages.
    """
    try:
        PictureRecord.model_validate(dict(record))
    except ValidationError as error:
        faults = [f"{path}: {'.'.join(map(str, one['loc']))}: {one['msg']}" for one in error.errors()]
        raise InputError(first_faults(faults), key=".".join(map(str, error.errors()[0]["loc"]))) from error

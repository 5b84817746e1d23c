"""PLAN.toml: a grid of settings with the scenes, the frames and the thresholds of a batch.

`[batch]` names the scenes and what is seen of them, `[expect]` the thresholds; every other table is one of the grid
(`refgi.bench.grid`). Files are named from the plan's folder.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from refgi.batch.thresholds import Threshold, read_threshold
from refgi.bench.grid import Grid, grid_of, value_text
from refgi.errors import InputError, expect, first_faults, shortened
from refgi.scene import builtin_scenes
from refgi.scene.files import read_toml, text_of
from refgi.settings import from_text
from refgi.sssil.settings import TemporalSettings
from refgi.truth import TruthSettings

BATCH, EXPECT = "batch", "expect"
Pixels = Annotated[int, Field(ge=1, le=65536)]


class BatchTable(BaseModel):
    """The table `[batch]`."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    scenes: list[str] | dict[str, str]
    size: Pixels | list[Pixels] | None = None
    rounds: int = Field(3, ge=1, le=1000)
    rsm_resolution: int = Field(512, ge=1, le=16384)
    truth: dict[str, Any] = {}
    path: str | None = None
    frames: int | None = Field(None, ge=1, le=100_000)
    temporal: dict[str, Any] | None = None

    @model_validator(mode="after")
    def sound(self) -> Self:
        """Refuse no scene, a size of more than two numbers, and frames of nothing that moves."""
        if not self.scenes:
            raise ValueError("scenes: expected one or more, got none")
        if isinstance(self.size, list) and len(self.size) != 2:
            raise ValueError("size: expected one number or [width, height]")
        if self.path is None and (self.frames is not None or self.temporal is not None):
            raise ValueError("frames and temporal: expected a path beside them")
        return self


class Plan(NamedTuple):
    """What a batch runs and what is expected of it."""

    file: Path
    scenes: dict[str, str]  # what `load_scene` takes, by name
    size: tuple[int, int] | None  # pixels; the scenes' own where absent
    rounds: int  # seeds of each choice
    rsm_resolution: int
    truth: TruthSettings
    grid: Grid
    path: str | None  # TOML file of camera, lights and objects on their way
    frames: int | None  # as the path's file says where absent
    temporal: TemporalSettings | None  # of methods with a temporal filter
    thresholds: tuple[Threshold, ...]


def read_plan(file: Path) -> Plan:
    """Read a plan from TOML; its scenes are not loaded yet.

    InputError if the file cannot be read, or a table, a method, a key or a value is not usable.
    """
    tables = read_toml(file)
    expect(BATCH in tables, str(file), "a table [batch] with the key scenes", ", ".join(tables) or "no table")
    table, thresholds = tables.pop(BATCH), tables.pop(EXPECT, {})
    own = _validated(table, file)
    grid = grid_of(tables, file)
    expect(bool(grid.choices or grid.passes), str(file), "a table of some method", "none")
    scenes = _named(own.scenes, file)
    expect(isinstance(thresholds, dict), f"{file}: {EXPECT}", "a table", type(thresholds).__name__)
    methods = {choice.method for choice in grid.choices}
    size = (own.size, own.size) if isinstance(own.size, int) else own.size and (own.size[0], own.size[1])
    return Plan(file, scenes, size or None, own.rounds, own.rsm_resolution,
                _settings(TruthSettings(), own.truth, f"{file}: batch.truth"), grid,
                None if own.path is None else str(file.parent / own.path), own.frames,
                own.temporal if own.temporal is None else _settings(
                    TemporalSettings(), own.temporal, f"{file}: batch.temporal"),
                tuple(read_threshold(key, text, scenes, methods, str(file)) for key, text in thresholds.items()))


def _validated(table: Any, file: Path) -> BatchTable:
    try:
        return BatchTable.model_validate(table)
    except ValidationError as error:
        faults = [f"{file}: {_key(detail['loc'])}: {detail['msg'].lower()}"
                  for detail in error.errors(include_url=False)]
        raise InputError(first_faults(faults), file=str(file), key=BATCH) from error


def _key(place: Sequence[str | int]) -> str:
    return ".".join([BATCH, *(shortened(str(part), 80) for part in place)])


def _named(scenes: list[str] | dict[str, str], file: Path) -> dict[str, str]:
    """Return scenes by name, files from the plan's folder; a list's names are those without folder and parameters."""
    named = scenes if isinstance(scenes, dict) else {_stem(scene): scene for scene in scenes}
    expect(len(named) == len(scenes), f"{file}: {BATCH}.scenes", "scenes of different names, or a table of names",
           ", ".join(scenes))
    for name in named:
        expect(name != "" and not set(name) & set("@/\\"), f"{file}: {BATCH}.scenes", "names without @ and slashes",
               name)
    return {name: scene if scene.partition(":")[0] in builtin_scenes() else str(file.parent / scene)
            for name, scene in named.items()}


def _stem(scene: str) -> str:
    base = scene.partition(":")[0]
    return base if base in builtin_scenes() else text_of(Path(scene).stem)


def _settings(settings: Any, table: dict[str, Any], where: str) -> Any:
    try:
        return from_text(settings, [f"{key}={value_text(value)}" for key, value in table.items()])
    except InputError as error:
        raise InputError(f"{where}: {error}", key=error.key) from error

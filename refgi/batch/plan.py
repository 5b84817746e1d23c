"""PLAN.toml: a grid of settings with the scenes, the frames and the thresholds of a batch (docs/batch.md).

`[batch]` names the scenes and what is seen of them, `[expect]` the thresholds by scene, method, setting and figure;
every other table is one of the grid (`refgi.bench.grid`). Files are named from the plan's folder.
"""

import operator
import re
from collections.abc import Callable, Collection, Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from refgi.bench.grid import Grid, grid_of, value_text
from refgi.bench.results import Result, Run, SceneResult
from refgi.errors import InputError, expect, first_faults, shortened
from refgi.scene import builtin_scenes
from refgi.scene.files import read_toml, text_of
from refgi.settings import from_text
from refgi.sssil.settings import TemporalSettings
from refgi.truth import TruthSettings

FRAME = "@"  # between a scene and the number of a frame
ERRORS = ("rmse", "bias", "spread", "noise")  # against the truth, over its mean
FIGURES = (*ERRORS, "relmse", "flip", "ssim", "seconds", "rmse_unoccluded")
OVER_TIME = ("flicker", "lag")
COMPARISONS: dict[str, Callable[[float, float], bool]] = {
    "<=": operator.le, ">=": operator.ge, "<": operator.lt, ">": operator.gt}

COMPARISON = re.compile(r"\s*(<=|>=|<|>)\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*")


class Threshold(NamedTuple):
    """What is expected of one figure."""

    key: str  # as in the plan
    scene: str
    method: str
    label: str | None  # of the setting; None for all
    figure: str
    sign: str  # of `COMPARISONS`
    bound: float


class Finding(NamedTuple):
    """What is not as it should be."""

    place: str  # scene, method and setting
    figure: str
    text: str  # what was expected and what was found
    pictures: tuple[str, ...] = ()
    stage: str | None = None  # the first whose output is another

    def __str__(self) -> str:
        first = [] if self.stage is None else [f"first stage that changed: {self.stage}"]
        return "; ".join([f"{self.place}: {self.figure} {self.text}", *self.pictures, *first])


def read_threshold(key: str, text: object, scenes: Collection[str], methods: Collection[str], file: str) -> Threshold:
    """Read a line of `[expect]`, such as ``"atrium.val.clusters.count=8, lights=256.rmse" = "<= 0.31"``."""
    where = f'{file}: expect."{key}"'
    scene = max((name for name in scenes if key.startswith(f"{name}.")), key=len, default="")
    expect(scene != "", where, f"a scene of the plan ({', '.join(scenes)}) first", key)
    method, *middle = key[len(scene) + 1:].split(".")
    expect(method in methods, where, f"a method of the plan ({', '.join(sorted(methods))}) after the scene", method)
    figure = middle.pop() if middle else ""
    known = (*FIGURES, *OVER_TIME)
    expect(figure in known, where, f"a figure at the end, one of {', '.join(known)}", figure)
    found = COMPARISON.fullmatch(text) if isinstance(text, str) else None
    expect(found is not None, where, 'a comparison such as "<= 0.31"', text)
    assert found is not None
    return Threshold(key, scene, method, ".".join(middle) or None, figure, found[1], float(found[2]))


def broken(thresholds: Collection[Threshold], result: Result, *, whole: bool = True) -> list[Finding]:
    """Return a finding for each threshold that is missed, in doubt or, of a `whole` plan, without a figure."""
    found = []
    for one in thresholds:
        values = list(_values(one, result))
        if not values and whole:
            found.append(Finding(one.key, one.figure, f"expected {one.sign} {one.bound:g}, nothing was measured"))
        for place, value, picture, in_doubt in values:
            if value is None or not COMPARISONS[one.sign](value, one.bound):
                text = "is not known" if value is None else f"is {value:.4g}"
                found.append(Finding(place, one.figure, f"{text}, expected {one.sign} {one.bound:g}",
                                     () if picture is None else (picture,)))
            elif in_doubt:
                found.append(Finding(place, one.figure, f"is {value:.4g}, expected {one.sign} {one.bound:g}, but in "
                                     "doubt: the truth's error is not to be trusted",
                                     () if picture is None else (picture,)))
    return found


def figure_of(run: Run, figure: str) -> float | None:
    """Return a figure, of `FIGURES`, of a run; None where it is not known."""
    if figure in ERRORS:
        value: float | None = getattr(run.errors["truth"], figure)
        return value
    if figure == "rmse_unoccluded":
        return run.errors["unoccluded"].rmse if "unoccluded" in run.errors else None
    own: float | None = getattr(run, figure)
    return own


def place_of(scene: str, method: str, label: str) -> str:
    """Return how a run is named in a finding: scene, method and setting."""
    return f"{scene}.{method} ({label})"


def _values(one: Threshold, result: Result) -> Iterator[tuple[str, float | None, str | None, bool]]:
    """Yield place, value and picture of each figure that a threshold speaks of, and whether it is in doubt."""
    runs = [(scene, run) for scene in result.scenes for run in _runs(scene) if run.method == one.method
            and (scene.scene == one.scene or scene.scene.startswith(f"{one.scene}{FRAME}"))]
    if one.figure in OVER_TIME:
        for way in result.paths:
            if (way.scene, way.method) == (one.scene, one.method) and one.label in (None, way.label):
                doubted = any(_in_doubt(run, one.figure) for _, run in runs if run.label == way.label)
                yield place_of(way.scene, way.method, way.label), getattr(way, one.figure), None, doubted
        return
    for scene, run in runs:
        if one.label in (None, run.label):
            yield (place_of(scene.scene, run.method, run.label), figure_of(run, one.figure), run.picture,
                   _in_doubt(run, one.figure))


def _in_doubt(run: Run, figure: str) -> bool:
    """Return whether a figure rests on a reference whose error is not to be trusted."""
    judge = "unoccluded" if figure == "rmse_unoccluded" else "truth"
    return figure != "seconds" and judge in run.errors and run.errors[judge].in_doubt


def _runs(scene: SceneResult) -> tuple[Run, ...]:
    return (*scene.runs, *scene.line)


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
    """Read a plan from TOML; its scenes are not loaded yet. An InputError names what is not usable."""
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

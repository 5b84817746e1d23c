"""What a bench found, as data: results.json by its schema, tables as CSV and Markdown, sentences of split errors."""

import json
import math
from collections.abc import Iterator, Sequence
from typing import Any, Self

import pydantic

from refgi.bench.error import Error
from refgi.compare.pages import number, require_environment

SPLIT_COLUMNS = ("approximation", "mean, %", "RMS, %", "spread, %", "share, %", "RMSE without, %", "mean without, %")
ALL = "all together"
REASONS = 6  # why settings were left out that are said
LEAST = 0.01  # of the mean square: what is taken back and not said


def rows_of_split(split: "Split") -> list[tuple[str, ...]]:
    """Return a row by `SPLIT_COLUMNS` for each part and one for the whole, over the truth's mean."""
    parts = [(part.name, percent(part.mean), percent(part.error.rmse), percent(part.error.spread),
              percent(part.share), percent(part.alone.rmse if part.alone else None),
              percent(_mean_without(split, part))) for part in split.parts]
    return [*parts, (ALL, percent(split.mean), percent(split.error.rmse), percent(split.error.spread), "100", "", "")]


def said_of_split(split: "Split") -> str:
    """Return what a split says: its largest share, what takes most back, how squares add up, what helps most."""
    known = [part for part in split.parts if part.share is not None]
    if not known or split.squares is None or split.cross is None:
        return f"{split.label}: not known."
    main = max(known, key=lambda part: part.share or 0.0)
    least = min(known, key=lambda part: part.share or 0.0)
    taken = -(least.share or 0.0)
    back = f", of which {least.name} takes back {percent(taken)} %" if taken > LEAST else ""
    text = (f"{split.label}: RMSE {percent(split.error.rmse)} %, of whose square {percent(main.share)} % is "
            f"{main.name}{back}. Mean squares of the parts sum to {percent(split.squares)} % of the truth's mean "
            f"squared, twice their cross terms to {percent(split.cross)} %, both together to "
            f"{percent(split.squares + split.cross)} %.")
    without = [(part.alone.rmse, part.name) for part in known if part.alone and part.alone.rmse is not None]
    if not without:
        return text
    rmse, name = min(without)
    return f"{text} With {name} alone switched off RMSE would be {percent(rmse)} %."


def tables_of(splits: "Sequence[Split]") -> Iterator[str]:
    """Yield the tables of a scene's splits as lines of Markdown."""
    for split in splits:
        yield from ("", f"Error split of {split.label}, {split.width} x {split.height}:", "")
        yield from (f"| {' | '.join(SPLIT_COLUMNS)} |", f"|---|{'--:|' * (len(SPLIT_COLUMNS) - 1)}")
        yield from (f"| {' | '.join(row)} |" for row in rows_of_split(split))
        yield from ("", said_of_split(split))


def percent(value: float | None) -> str:
    """Return a share in %, with its sign; nothing where it is not known."""
    return "" if value is None else number(100 * value)


def _mean_without(split: "Split", part: "Part") -> float | None:
    if part.alone is None or part.alone.mean is None or split.mean is None:
        return None
    return split.mean - part.alone.mean


FORMAT = "bench 1"
LIMITED = ("unoccluded", "seen", "seen_unoccluded")  # truths of which nothing blocks light, whose senders are in view


class Strict(pydantic.BaseModel):
    """Data of which every key is known."""

    model_config = pydantic.ConfigDict(extra="forbid", frozen=True)


class Figures(Strict):
    """Errors over the mean of the reference (`refgi.bench.error.Error`); None where not known."""

    in_doubt: bool = False  # the reference's own error is not to be trusted

    rmse: float | None
    low: float | None
    high: float | None
    bias: float | None
    spread: float | None
    noise: float | None


class Work(Strict):
    """What a frame takes beside time (`refgi.bench.measure`)."""

    pairs: int  # of light, or other sender, and receiver that sums are given, before skips within a sum
    rays: int  # traced
    bytes: int | None = None  # of the arrays that stages make, each once
    peak_bytes: int  # most memory of arrays and objects above that of the scene


class Run(Strict):
    """One method with one choice of settings on one scene."""

    method: str
    changes: tuple[str, ...]  # beside the defaults
    settings: dict[str, Any]
    times: tuple[float, ...]  # s of whole frames with their buffers, a seed each
    stages: dict[str, float]  # s of the first of them, outermost stages
    errors: dict[str, Figures]  # by reference: "truth" and those of `LIMITED` that share the method's limits
    work: Work | None = None  # of the first seed
    flip: float | None = None  # of the first seed's picture
    ssim: float | None = None
    relmse: float | None = None
    picture: str | None = None  # EXR of the first seed, from the folder of results.json
    hashes: tuple[tuple[str, str], ...] = ()  # stages in the order in which they ended, and of each one's output
    in_equal_time: float | None = None  # rmse over that of the path tracer in equal time: above 1 it is beaten
    front: bool = False  # nothing measured here is both faster and nearer

    @pydantic.field_validator("errors")
    @classmethod
    def judged(cls, errors: dict[str, Figures]) -> dict[str, Figures]:
        """Refuse a run that no truth judges."""
        if "truth" not in errors:
            raise ValueError("expected errors against the truth")
        return errors

    @pydantic.field_validator("times")
    @classmethod
    def timed(cls, times: tuple[float, ...]) -> tuple[float, ...]:
        """Refuse a run without a time."""
        if not times:
            raise ValueError("expected the time of a frame")
        return times

    @property
    def label(self) -> str:
        """The settings in short."""
        return ", ".join(self.changes) or "default"

    @property
    def seconds(self) -> float:
        """Median time."""
        ordered = sorted(self.times)
        return 0.5 * (ordered[(len(ordered) - 1) // 2] + ordered[len(ordered) // 2])

    @property
    def rmse(self) -> float:
        """Plain RMSE against the truth over its mean; nan where not known."""
        value = self.errors["truth"].rmse
        return math.nan if value is None else value

    @property
    def own_limits(self) -> float | None:
        """RMSE against the truth that shares most limits with the method; None where there is no such truth."""
        return next((rmse_against(self, name) for name in reversed(LIMITED) if name in self.errors), None)


class Alone(Strict):
    """What switching one approximation off alone does, the truth's noise taken out; None where not known."""

    rmse: float | None  # without it
    square: float | None  # mean square error with it less that without: what it costs; below 0: what it saves
    mean: float | None  # change of the mean that it makes


class Part(Strict):
    """What one approximation changes in the picture of those before it, over the mean of the truth."""

    name: str
    about: str
    error: Figures  # of the change
    mean: float | None  # change of the mean
    share: float | None  # of the whole's mean square error: its own square and half of what it has with others
    alone: Alone | None = None  # None for what no approximation accounts for


class Split(Strict):
    """The error of one method and setting as a sum of its approximations, over the mean of the truth."""

    method: str
    changes: tuple[str, ...]  # beside the defaults
    knee: bool  # of the method's curve on this scene
    width: int
    height: int
    truth: str  # how well it is known
    error: Figures  # of the whole
    mean: float | None  # change of the mean, the sum of the parts'
    squares: float | None  # sum of the parts' mean squares
    cross: float | None  # mean square of the whole less that sum
    cross_alone: float | None  # mean square of the whole less what each costs alone
    parts: tuple[Part, ...]

    @property
    def label(self) -> str:
        """Method and settings in short."""
        return f"{self.method}, {', '.join(self.changes) or 'default'}{' (knee)' if self.knee else ''}"


class SceneResult(Strict):
    """All runs on one scene."""

    scene: str
    width: int
    height: int
    covered: int  # pixels that show a surface
    mean: float  # W/m^2, of the truth
    truth: str  # how well it is known
    runs: tuple[Run, ...]
    line: tuple[Run, ...]  # the path tracer, stopped early
    failures: dict[str, str]  # what gave no picture, and why
    left_out: dict[str, str] = {}  # what a budget of time has not run, or not as often as others, and what it takes
    cold: dict[str, float] = {}  # s to the first frame of a new process, by method, kernels in the cache
    splits: tuple[Split, ...] = ()

    @property
    def doubts(self) -> list[str]:
        """What is not known: a sentence for each reference whose error is not to be trusted."""
        names = {name: None for run in (*self.runs, *self.line) for name, one in run.errors.items() if one.in_doubt}
        return [f"the error of the {'truth' if name == 'truth' else f'truth ({name})'} is not to be trusted, nor are "
                "figures against it" for name in names]


    @property
    def left_out_said(self) -> list[str]:
        """What a budget of time has left out: settings of the same reason together, and of the reasons the first."""
        names: dict[str, list[str]] = {}
        for name, what in self.left_out.items():
            names.setdefault(what, []).append(name)
        groups = sorted(names.items(), key=lambda one: -len(one[1]))
        said = [f"{some[0] if len(some) == 1 else f'{len(some)} settings'}: {what}" for what, some in groups[:REASONS]]
        more = sum(len(some) for _, some in groups[REASONS:])
        return [*said, f"{more} more, which results.json names"] if more else said


class PathResult(Strict):
    """One method with one choice of settings over all frames of a path (`refgi.batch.outcome`)."""

    scene: str
    method: str
    changes: tuple[str, ...]
    frames: int
    flicker: float | None  # RMS of what changes from frame to frame beside the truth's change, over the truth's mean
    noise: float | None  # flicker of a perfect picture
    lag: float | None  # frames that the light is behind the truth's

    @property
    def label(self) -> str:
        """The settings in short."""
        return ", ".join(self.changes) or "default"


class Result(Strict):
    """results.json."""

    refgi: str = FORMAT
    environment: dict[str, Any]
    scenes: tuple[SceneResult, ...]
    paths: tuple[PathResult, ...] = ()  # of a batch along a path

    @pydantic.model_validator(mode="after")
    def on_a_machine(self) -> Self:
        """Refuse an environment that a page cannot name."""
        require_environment(self.environment)
        return self


def figures_of(error: Error, *, in_doubt: bool = False) -> Figures:
    """Return an error as data, None for nan and infinity; `in_doubt`: the reference's error is not to be trusted."""
    return Figures(**{key: known(value) for key, value in error._asdict().items()}, in_doubt=in_doubt)


def known(value: float) -> float | None:
    """Return a figure as data: None for nan and infinity."""
    return value if math.isfinite(value) else None


def schema_text() -> str:
    """Return the JSON Schema of results.json, as the repository holds it."""
    return json.dumps(Result.model_json_schema(), indent=1, sort_keys=True) + "\n"


def rmse_against(run: Run, reference: str) -> float | None:
    """Return the RMSE of a run against one of its references; None where it has no such reference."""
    known = run.errors.get(reference)
    return None if known is None else known.rmse


def markdown(result: Result) -> str:
    """Return the table of each scene in Markdown, fastest first: errors in % of the truth's mean, times in ms."""
    lines = [f"<!-- refgi {result.refgi} -->", ""]
    for scene in result.scenes:
        lines += [f"## {scene.scene}, {scene.width} x {scene.height}", "", scene.truth, "",
                  *(line for doubt in scene.doubts for line in (f"**{doubt}**", "")),
                  "| method | settings | ms | RMSE % | bias % | spread % | own limits % | over truth in equal time | "
                  "pairs, M | rays, M | stages, MiB | peak, MiB | front |",
                  "|---|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|---|"]
        for run in sorted((*scene.runs, *scene.line), key=lambda one: one.seconds):
            error = run.errors["truth"]
            lines.append(f"| {run.method} | {run.label} | {number(1e3 * run.seconds)} | {in_percent(error.rmse)} | "
                         f"{in_percent(error.bias)} | {in_percent(error.spread)} | {in_percent(run.own_limits)} | "
                         f"{times(run.in_equal_time)} | {' | '.join(text for text, _ in taken(run.work))} | "
                         f"{'yes' if run.front else ''} |")
        if scene.cold:
            told = (f"{name} {number(seconds)} s" for name, seconds in scene.cold.items())
            lines += ["", f"First frame of a new process, kernels in the cache: {', '.join(told)}."]
        lines += tables_of(scene.splits)
        lines += ["", *(f"{name} gave no picture: {why}" for name, why in scene.failures.items()),
                  *(f"Left out for time: {said}" for said in scene.left_out_said), ""]
    return "\n".join(lines).rstrip() + "\n"


def in_percent(value: float | None) -> str:
    """Return a share in %; nothing where it is not known."""
    return "" if value is None else f"{100 * value:.3g}"


def times(value: float | None) -> str:
    """Return a ratio; nothing where it is not known."""
    return "" if value is None else f"{value:.3g}"


def taken(work: Work | None) -> tuple[tuple[str, int | None], ...]:
    """Return millions of pairs and of rays, MiB that stages make and at the peak, each with the number it is of."""
    known = [None] * 4 if work is None else [work.pairs, work.rays, work.bytes, work.peak_bytes]
    return tuple(("" if value is None else number(value / unit), value)
                 for value, unit in zip(known, (1e6, 1e6, 2**20, 2**20), strict=True))

"""Methods run and judged on one scene: a grid of settings in turn, a seed a round, and the path tracer stopped early.

Every round runs each choice once on a frame of its own, whose buffers are part of the time, with the round's seed; so a
slow moment of the machine falls on all, and each picture counts for the spread over seeds. Kernels are compiled, or
loaded, before the first round.
"""

import contextlib
import dataclasses
import json
import math
import subprocess
import sys
import time
import tracemalloc
import warnings
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from refgi import stages
from refgi.bench.error import error_in, error_of, front
from refgi.bench.grid import TRUTH, Choice, Grid
from refgi.bench.pictures import TRUTH_FILES, Place, Writer
from refgi.bench.results import Run, SceneResult, Work, figures_of, known
from refgi.compare.comparison import WARM_UP_SIZE, WITHOUT_VISIBILITY, limited, trace_reference
from refgi.compare.metrics import flip
from refgi.compare.outcome import UNOCCLUDED, Reference, measure
from refgi.errors import RefgiError, RefgiWarning, expect
from refgi.frame import Frame
from refgi.methods import METHODS
from refgi.provenance import plain
from refgi.scene import Scene
from refgi.settings import Settings, from_text, leaves
from refgi.truth import TruthSettings
from refgi.types import Array, Tell

FIRST_FRAME = """
import json, sys, warnings
warnings.simplefilter("ignore")
from refgi.methods import render
render(sys.argv[1], sys.argv[2], **json.loads(sys.argv[3]))
"""
LONGEST = 600.0  # s that a new process may take


def works_of(scene: Scene, choices: Mapping[int, Choice], options: Mapping[str, Any], tell: Tell) -> dict[int, Work]:
    """Count what each of some choices takes, by its number; those that give no picture are left out."""
    found = {}
    for done, (number, choice) in enumerate(choices.items()):
        tell(f"counting {choice.method}: {choice.label}", done / len(choices))
        with quietly():
            found[number] = work_of(scene, choice, options)
    return found


def first_frames(source: str, methods: Sequence[str], options: Mapping[str, Any], tell: Tell) -> dict[str, float]:
    """Return `cold_seconds` of each of some methods by name; those that give no picture are left out."""
    found = {}
    for number, name in enumerate(methods):
        tell(f"new process: {name}", number / len(methods))
        with quietly():
            found[name] = cold_seconds(source, name, options)
    return found


@contextlib.contextmanager
def quietly() -> Iterator[None]:
    """Leave warnings and errors to the real run, which says them."""
    with warnings.catch_warnings(), contextlib.suppress(RefgiError):
        warnings.simplefilter("ignore", RefgiWarning)
        yield


def work_of(scene: Scene, choice: Choice, options: Mapping[str, Any]) -> Work:
    """Count what one frame takes, buffers included; memory is that of arrays and objects above the scene's."""
    running = tracemalloc.is_tracing()
    if not running:
        tracemalloc.start()
    try:
        tracemalloc.reset_peak()
        before, _ = tracemalloc.get_traced_memory()
        with stages.observe(counting=True) as log:
            METHODS[choice.method].made(Frame(scene, **options), choice.settings)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        if not running:
            tracemalloc.stop()
    counts = log.counts or Counter()
    return Work(pairs=counts["pairs"], rays=counts["rays"], bytes=counts["bytes"], peak_bytes=max(0, peak - before))


def cold_seconds(source: str, method: str, options: Mapping[str, Any]) -> float:
    """Return how long a new process takes to a method's first frame, s, kernels cached; RefgiError without one."""
    command = [sys.executable, "-c", FIRST_FRAME, source, method, json.dumps(dict(options))]
    started = time.perf_counter()
    try:
        subprocess.run(command, check=True, capture_output=True, text=True, timeout=LONGEST)
    except (subprocess.SubprocessError, OSError) as error:
        last = (getattr(error, "stderr", None) or str(error)).strip().splitlines()[-1:]
        raise RefgiError(f"{method}: a new process gave no frame of {source}: {''.join(last)}") from error
    return time.perf_counter() - started


RUNS = 0.95  # of a budget
WRITING = 0.3  # of the time of judging a picture: what its file and its share of the page take
REFERENCE_SEED = 2**31  # of the truth: none of the rounds'
SEEN, SEEN_UNOCCLUDED = "seen", "seen_unoccluded"  # names of references, beside those of a comparison
LIMITS: Mapping[str, Mapping[str, Any]] = MappingProxyType({  # what each further reference leaves out
    UNOCCLUDED: WITHOUT_VISIBILITY, SEEN: {"emitters": "visible"},
    SEEN_UNOCCLUDED: {**WITHOUT_VISIBILITY, "emitters": "visible"},
})


class Made(NamedTuple):
    """Pictures of one choice with their times, a seed each."""

    pictures: list[Array]
    times: list[float]
    stages: dict[str, float]
    work: Work | None = None
    lobes: Array | None = None  # of the first picture, where a glossy surface is seen


def bench_scene(
    scene: Scene, grid: Grid, *, rounds: int = 3, truth: TruthSettings | None = None, tell: Tell = lambda *_: None,
    place: Place | None = None, source: str | None = None, budget: float = math.inf, **frame_options: Any,
) -> SceneResult:
    """Run a grid on a scene, each choice `rounds` times, a seed each; from two on bias and variance are told apart.

    The truth's seed is one that no round has. Pictures of the first seed and of the references are written to `place`,
    if any; new processes load the scene from `source` for `SceneResult.cold`. A choice that gives no picture is in
    `failures` and stops none of the others. InputError if the camera sees no surface.

    Of a `budget`, s, runs and judging may take `RUNS`, the cheapest choices first; what does not fit is in `left_out`,
    and new processes are not timed.
    """
    ends = time.perf_counter() + RUNS * budget
    frame = Frame(scene, **frame_options)
    covered = frame.gbuffer.covered
    expect(bool(covered.any()), f"scene {scene.name!r}: camera", "a view of some surface", "a view past all of it")
    settings = dataclasses.replace(truth or TruthSettings(), seed=REFERENCE_SEED)
    names = {name: None for choice in grid.choices for name in references_of(choice) if name != TRUTH}
    references = {TRUTH: traced(frame, settings, tell)}
    references |= {name: traced(frame, limited(settings, name, LIMITS[name]), tell, name) for name in names}
    stops = [stop(settings, passes) for passes in grid.passes]
    size = {"width": frame.width, "height": frame.height}
    judging = 0.0 if budget == math.inf else _judging([*grid.choices, *stops], references, frame)
    made, failures, left_out = _in_turn(scene, [*grid.choices, *stops], rounds, {**frame_options, **size}, tell, ends,
                                        judging)
    methods = dict.fromkeys(choice.method for choice in grid.choices)
    cold = {} if source is None or budget < math.inf else first_frames(
        source, list(methods), {**frame_options, **size}, tell)
    done = [(choice, made[number]) for number, choice in enumerate((*grid.choices, *stops)) if number in made]
    runs = [judged(choice, one, references, frame) for choice, one in done]
    if place is not None:
        writer = Writer(place, scene, frame)
        _write(writer, references)
        firsts = [(choice.method, with_seed(choice.settings, 0), one.pictures[0], one.lobes) for choice, one in done]
        runs = [run.model_copy(update={"picture": file})
                for run, file in zip(runs, writer.write_runs(firsts), strict=True)]
    others = [run for run in runs if run.method != TRUTH]
    line = [run for run in runs if run.method == TRUTH]
    return SceneResult(scene=scene.name, width=frame.width, height=frame.height, covered=int(covered.sum()),
                       mean=float(references[TRUTH].irradiance[:, covered].mean(dtype=np.float64)),
                       truth=references[TRUTH].statement, runs=compared(others, line), line=tuple(line),
                       failures=failures, left_out=left_out, cold=cold)


def references_of(choice: Choice) -> list[str]:
    """Return by which references a choice is judged: the truth, and those that share its limits; keys of `LIMITS`."""
    method = METHODS[choice.method]
    knows = method.knows_visibility(choice.settings)
    limits = {key: value for one in method.approximations for key, value in one.shared_by(choice.settings).items()}
    names = [TRUTH] if knows else [TRUTH, UNOCCLUDED]
    return [*names, SEEN if knows else SEEN_UNOCCLUDED] if limits.get("emitters") == "visible" else names


def traced(frame: Frame, settings: TruthSettings, tell: Tell, name: str = TRUTH) -> Reference:
    """Trace a reference of a frame."""
    return trace_reference(frame, name, settings, lambda stage, done: tell(f"{TRUTH}: {stage}", done))


def _write(writer: Writer, references: Mapping[str, Reference]) -> None:
    for name, file in TRUTH_FILES.items():
        if name in references:
            writer.write(Path(file).stem, references[name].planes, references[name].record)
    writer.write_ids()


def stop(settings: TruthSettings, passes: int) -> Choice:
    """Return the truth, stopped after some passes that no file holds already."""
    samples = passes * (settings.picks_per_pass + settings.directions_per_pass)
    return Choice(TRUTH, (f"samples={samples}",), stopped(settings, samples))


def stopped(settings: TruthSettings, samples: int) -> TruthSettings:
    """Return settings that stop after some samples a pixel, whatever else would, and that read no file."""
    return dataclasses.replace(settings, samples=samples, seconds=None, target_error=None, checkpoint=None)


def _in_turn(
    scene: Scene, choices: list[Choice], rounds: int, options: Mapping[str, Any], tell: Tell, ends: float,
    judging: float,
) -> tuple[dict[int, Made], dict[str, str], dict[str, str]]:
    """Run all choices once a round; return what they made by number, why others made nothing, and what was left out.

    All ends at `ends`, of `time.perf_counter`, with the `judging` of each choice, s, that comes later.
    """
    made: dict[int, Made] = {}
    failures: dict[str, str] = {}
    names = [f"{choice.method}: {choice.label}" for choice in choices]
    takes = _expected(scene, choices, options, tell, ends)
    works: dict[int, Work] = {}
    for turn in range(rounds):
        for place, number in enumerate(sorted(takes, key=lambda one: takes[one])):
            new = judging if number not in made else 0.0
            if names[number] in failures or not _fits(takes[number] + new, ends):
                continue
            choice = choices[number]
            tell(f"{names[number]}, run {turn + 1} of {rounds}{_left(ends)}", (turn + place / len(choices)) / rounds)
            try:
                run = timed(Frame(scene, **options), choice.method, with_seed(choice.settings, turn))
            except RefgiError as error:
                failures[names[number]] = str(error)
                made.pop(number, None)
                continue
            if ends < math.inf:
                ends -= new
                alike = [one for one in takes if choices[one].method == choice.method and one not in made]
                ratio = min(1.0, run.seconds / takes[number])  # fixed costs do not grow with pixels
                takes |= {one: takes[one] * ratio for one in alike} | {number: run.seconds}
            one = made.setdefault(number, Made([], [], run.stages, None, run.lobes))
            one.pictures.append(run.picture)
            one.times.append(run.seconds)
        if turn == 0:
            works = works_of(scene, {number: choices[number]._replace(settings=with_seed(choices[number].settings, 0))
                                     for number in made if _fits(takes[number], ends)}, options, tell)
    made = {number: made[number]._replace(work=works.get(number)) for number in sorted(made)}
    left_out = {names[number]: f"some {takes[number]:.3g} s a run" if number in takes else "no time to load it"
                for number in range(len(choices)) if number not in made and names[number] not in failures}
    left_out |= {names[number]: f"{rounds - len(one.times)} of {rounds} runs" for number, one in made.items()
                 if len(one.times) < rounds}
    return made, failures, left_out


def _expected(scene: Scene, choices: Sequence[Choice], options: Mapping[str, Any], tell: Tell,
              ends: float) -> dict[int, float]:
    """Load all kernels; return what a run of each choice takes by a small picture, s, 0 where time has no end."""
    small, takes = small_frame(scene, options), {}
    pixels = options["width"] * options["height"]
    for number, choice in enumerate(choices):
        if not _fits(0.0, ends):
            break
        tell(f"warming up {choice.method}: {choice.label}{_left(ends)}", number / len(choices))
        load_kernels(small, choice, pixels)
        takes[number] = 0.0
        if ends < math.inf:
            started = time.perf_counter()
            load_kernels(small_frame(scene, options), choice, pixels)
            takes[number] = (time.perf_counter() - started) * max(1.0, pixels / WARM_UP_SIZE**2)
    return takes


def _judging(choices: Sequence[Choice], references: Mapping[str, Reference], frame: Frame) -> float:
    """Return what judging and writing a picture takes, s, by those that have most to be judged by."""
    choice = max(choices, key=lambda one: len(references_of(one)))
    made = Made([references[TRUTH].irradiance.astype(frame.dtype)], [0.0], {})
    judged(choice, made, references, frame)  # loads what judges
    started = time.perf_counter()
    judged(choice, made, references, frame)
    return (1 + WRITING) * (time.perf_counter() - started)


def _fits(seconds: float, ends: float) -> bool:
    return time.perf_counter() + seconds < ends


def _left(ends: float) -> str:
    return f", {max(0.0, ends - time.perf_counter()):.0f} s left" if ends < math.inf else ""


class Timed(NamedTuple):
    """One picture and what it took."""

    picture: Array  # (3, h, w) irradiance, W/m^2
    seconds: float
    log: stages.Log
    lobes: Array | None = None  # (3, h, w) radiance of receivers' lobes by indirect light, W/m^2/sr

    @property
    def stages(self) -> dict[str, float]:
        """Seconds of outermost stages."""
        spent: dict[str, float] = {}
        for run in self.log.runs:
            if run.depth == 0 and run.status == "ran":
                spent[run.name] = spent.get(run.name, 0.0) + run.seconds
        return spent

    @property
    def skips(self) -> tuple[tuple[str, str], ...]:
        """Stages that were left out, and why, each once."""
        return tuple(dict.fromkeys((run.name, run.reason) for run in self.log.runs if run.status == "skipped"))


def timed(frame: Frame, method: str, settings: Settings, memory: stages.Memory | None = None) -> Timed:
    """Run a method on a frame; what `memory` keeps is not computed again."""
    with stages.observe(memory=memory) as log:
        started = time.perf_counter()
        light = METHODS[method].made(frame, settings)
        seconds = time.perf_counter() - started
    return Timed(light.irradiance, seconds, log, light.lobes)


def small_frame(scene: Scene, options: Mapping[str, Any]) -> Frame:
    """Return a frame to load kernels by."""
    return Frame(scene, **{**options, "width": WARM_UP_SIZE, "height": WARM_UP_SIZE})


def load_kernels(frame: Frame, choice: Choice, pixels: int) -> None:
    """Run a choice on a small frame as on one of so many pixels: no time measured later has compiling in it."""
    with quietly(), stages.standing_for(pixels):
        METHODS[choice.method].made(frame, choice.settings)


def with_seed(settings: Settings, seed: int) -> Settings:
    """Return settings with another seed; the same where they draw no random numbers."""
    if not any(leaf.key.rpartition(".")[2] == "seed" for leaf in leaves(type(settings))):
        return settings
    return from_text(settings, [f"seed={seed}"])


def judged(choice: Choice, made: Made, references: Mapping[str, Reference], frame: Frame) -> Run:
    """Return all figures of a choice's pictures; `references` by name, the truth among them."""
    covered = frame.gbuffer.covered
    errors = {name: figures_of(error_of(made.pictures, references[name].irradiance, references[name].variance, covered),
                               in_doubt=bool(references[name].doubts))
              for name in references_of(choice) if name in references}
    figures = measure(made.pictures[0], references[TRUTH].irradiance, references[TRUTH].variance, covered).figures
    seen = flip(frame.radiance(made.pictures[0], made.lobes), references[TRUTH].radiance, covered)
    return Run(method=choice.method, changes=choice.changes, settings=plain(choice.settings), times=tuple(made.times),
               stages=made.stages, errors=errors, flip=known(seen.mean), ssim=known(figures["ssim"].value),
               relmse=known(figures["relmse"].value), work=made.work)


def compared(runs: list[Run], line: list[Run]) -> tuple[Run, ...]:
    """Return the runs with their place among all: on the front or not, and beside the path tracer."""
    on_front = front([(run.seconds, run.rmse) for run in (*runs, *line)])
    tracer = [(run.seconds, run.rmse) for run in line]
    said = []
    for run, best in zip(runs, on_front, strict=False):
        ratio = run.rmse / error_in(tracer, run.seconds)
        said.append(run.model_copy(update={"front": best, "in_equal_time": ratio if ratio > 0 else None}))
    return tuple(said)

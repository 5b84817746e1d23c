"""Results of jobs: one as a file, all as a bench's, flicker and lag of a sequence, and those of an earlier batch.

x_k is a method's picture of frame k, r_k the truth, v_k the variance of its mean, w = v_k + v_k-1; truths of two frames
have independent noise. flicker^2 = mean |(x_k - x_k-1) - (r_k - r_k-1)|^2, of a perfect picture mean w; lag
d = (mean (x_k - r_k)(r_k-1 - r_k) - v) / (mean (r_k-1 - r_k)^2 - w), a / (1 - a) of a blend with the share a.
"""

import contextlib
import math
import time
from collections.abc import Iterator, Sequence
from itertools import groupby, zip_longest
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
import pydantic

from refgi.batch.jobs import FORMAT, Job, Shot
from refgi.batch.plan import Finding, figure_of, place_of
from refgi.bench.grid import TRUTH
from refgi.bench.measure import compared
from refgi.bench.results import PathResult, Result, Run, SceneResult, Strict, known
from refgi.compare.pictures import rgb_of
from refgi.image import is_dead, read_exr, write_text
from refgi.provenance.record import environment
from refgi.types import Array

SECONDS_OF_A_LEFTOVER = 3600.0


class View(Strict):
    """What the results of one frame share."""

    width: int
    height: int
    covered: int  # pixels that show a surface
    mean: float  # W/m^2, of the truth
    truth: str  # how well it is known


class Outcome(Strict):
    """jobs/NAME.json."""

    refgi: str = FORMAT
    job: str
    scene: str
    method: str
    changes: tuple[str, ...]
    status: Literal["done", "failed"]
    message: str = ""  # why it failed
    view: View | None = None
    run: Run | None = None


def outcome_file(folder: Path, job: Job) -> Path:
    """Return where the result of a job lies in the folder of a batch."""
    return folder / "jobs" / f"{job.name}.json"


def is_done(folder: Path, job: Job) -> bool:
    """Return whether there is a result of a job, be it an error."""
    return outcome_file(folder, job).exists()


def failed(job: Job, message: str) -> Outcome:
    """Return the result of a job that gave no picture."""
    return Outcome(job=job.name, scene=job.shot.name, method=job.choice.method, changes=job.choice.changes,
                   status="failed", message=message)


def write_outcome(folder: Path, outcome: Outcome) -> None:
    """Write the result of a job into the batch's folder; InputError if it cannot be written."""
    write_text(folder / "jobs" / f"{outcome.job}.json", outcome.model_dump_json(indent=1) + "\n")


def read_outcome(folder: Path, job: Job) -> Outcome | None:
    """Return the result of a job from the batch's folder; None without one, or where its file is not whole."""
    try:
        found = Outcome.model_validate_json(outcome_file(folder, job).read_bytes())
    except (OSError, pydantic.ValidationError):
        return None
    return found if found.job == job.name and found.refgi == FORMAT else None


def remove_leftovers(folder: Path) -> None:
    """Remove temporary files of processes that were killed: their writer is dead, or has not written for long."""
    for place in ("jobs", "pictures", "store"):
        for file in (folder / place).rglob("*.part*"):
            with contextlib.suppress(OSError):
                if is_dead(file.name) or time.time() - file.stat().st_mtime > SECONDS_OF_A_LEFTOVER:
                    file.unlink()


LEAST_CHANGE = 4.0  # of the truth from frame to frame over its noise, both squared, from which a lag can be told


class Still(NamedTuple):
    """One frame of a path."""

    picture: Array  # (3, h, w) W/m^2
    truth: Array
    variance: Array  # of the truth's mean
    covered: Array  # (h, w) bool, pixels with light


class OverTime(NamedTuple):
    """Figures of a sequence; nan where they cannot be told."""

    flicker: float  # over the truth's mean
    noise: float  # flicker of a perfect picture
    lag: float  # frames


def over_time(frames: Iterator[Still]) -> OverTime:
    """Judge a sequence of frames by that of the truth, two held at a time; nan for what cannot be told."""
    sums = np.zeros(6)  # of squared flicker, its noise, x - r along the change, v, squared change, r; a value each
    count, before = 0, None
    for still in frames:
        if before is not None:
            both = still.covered & before.covered
            sums += _sums(still, before, both)
            count += 3 * int(both.sum())
        before = still
    if count == 0 or sums[5] <= 0:
        return OverTime(math.nan, math.nan, math.nan)
    flicker, noise, along, own, change, mean = sums / count
    lag = (along - own) / (change - noise) if change > LEAST_CHANGE * noise else math.nan
    return OverTime(math.sqrt(flicker) / mean, math.sqrt(noise) / mean, lag)


def paths_of(folder: Path, jobs: Sequence[Job], outcomes: dict[str, Outcome]) -> tuple[PathResult, ...]:
    """Return the figures of each choice whose frames are all there; nothing for scenes at rest."""
    ways: dict[Any, list[Job]] = {}
    for job in jobs:
        if job.shot.path is not None and job.choice.method != TRUTH:
            ways.setdefault((job.shot.scene, job.choice), []).append(job)
    return tuple(_path(folder, way) for way in ways.values()
                 if len(way) > 1 and all(job.name in outcomes and outcomes[job.name].run for job in way))


def _path(folder: Path, way: Sequence[Job]) -> PathResult:
    shot, choice = way[0].shot, way[0].choice
    figures = over_time(_still(folder, job) for job in way)
    return PathResult(scene=shot.scene, method=choice.method, changes=choice.changes, frames=len(way),
                      **{key: known(value) for key, value in figures._asdict().items()})


def _still(folder: Path, job: Job) -> Still:
    picture = read_exr(folder / job.picture)[0]
    truth = read_exr((folder / job.picture).with_name(f"{TRUTH}.exr"))[0]
    light, right, variance = (rgb_of(planes, name).astype(np.float64) for planes, name in (
        (picture, "irradiance."), (truth, "irradiance."), (truth, "variance.")))
    return Still(light, right, variance, ((light != 0) | (right != 0)).any(axis=0))


def _sums(still: Still, before: Still, both: Array) -> Array:
    x, r, v = (plane[:, both] for plane in still[:3])
    x0, r0, v0 = (plane[:, both] for plane in before[:3])
    return np.array([(((x - x0) - (r - r0)) ** 2).sum(), (v + v0).sum(), ((x - r) * (r0 - r)).sum(), v.sum(),
                     ((r0 - r) ** 2).sum(), r.sum()])


Outcomes = dict[str, Outcome]  # by name of the job


def read_outcomes(folder: Path, jobs: Sequence[Job]) -> Outcomes:
    """Return by name the results that the folder holds of a plan's jobs."""
    return {job.name: found for job in jobs if (found := read_outcome(folder, job)) is not None}


def result_of(folder: Path, jobs: Sequence[Job], outcomes: Outcomes) -> Result:
    """Return what a batch has found so far, as a bench does: a scene for each frame that has some result."""
    scenes = []
    for shot, group in groupby(jobs, lambda job: job.shot):
        found = [outcomes[job.name] for job in group if job.name in outcomes]
        if found:
            scenes.append(_scene(shot, found))
    return Result(environment=environment(), scenes=tuple(scenes), paths=paths_of(folder, jobs, outcomes))


def _scene(shot: Shot, outcomes: Sequence[Outcome]) -> SceneResult:
    runs = [one.run for one in outcomes if one.run is not None]
    views = [one.view for one in outcomes if one.view is not None]
    line = [run for run in runs if run.method == TRUTH]
    failures = {f"{one.method}: {', '.join(one.changes) or 'default'}": one.message
                for one in outcomes if one.status == "failed"}
    seen = views[0].model_dump() if views else {"width": 0, "height": 0, "covered": 0, "mean": 0.0, "truth": ""}
    return SceneResult(scene=shot.name, **seen, line=tuple(line), failures=failures,
                       runs=compared([run for run in runs if run.method != TRUTH], line))


LESS_IS_BETTER = ("rmse", "rmse_unoccluded", "relmse", "flip")
MORE_IS_BETTER = ("ssim",)


def worse(result: Result, baseline: Result, tolerance: float, folder: str = "") -> list[Finding]:
    """Return a finding for each figure worse than a baseline's by more than a share of it; `folder`: its pictures."""
    before = dict(_runs(baseline))
    return [finding for key, run in _runs(result) if key in before
            for finding in _worse(key, run, before[key], tolerance, folder)]


def first_change(now: Run, before: Run) -> str | None:
    """Return the first stage whose output is not what it was; None where all are the same or one has no digests."""
    if not (now.hashes and before.hashes):
        return None
    return next((one[0] if one else other[0] for one, other in zip_longest(now.hashes, before.hashes)
                 if one != other), None)


def _runs(result: Result) -> Iterator[tuple[tuple[str, str, tuple[str, ...]], Run]]:
    for scene in result.scenes:
        yield from (((scene.scene, run.method, run.changes), run) for run in (*scene.runs, *scene.line))


def _worse(key: tuple[str, str, tuple[str, ...]], now: Run, before: Run, tolerance: float, folder: str
           ) -> Iterator[Finding]:
    for figure in (*LESS_IS_BETTER, *MORE_IS_BETTER):
        old, new = figure_of(before, figure), figure_of(now, figure)
        if old is None or new == old:
            continue
        if new is None or (new - old if figure in LESS_IS_BETTER else old - new) > tolerance * abs(old):
            text = f"was {old:.4g} and is {'not known' if new is None else f'{new:.4g}'}"
            pictures = [*([now.picture] if now.picture else []),
                        *([f"before: {Path(folder) / before.picture}"] if before.picture else [])]
            yield Finding(place_of(key[0], key[1], now.label), figure, text, tuple(pictures),
                          first_change(now, before))

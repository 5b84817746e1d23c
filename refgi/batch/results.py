"""Results of jobs put together as a bench's: results.json, results.csv and results.md."""

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

from refgi.batch.jobs import Job, Shot
from refgi.batch.outcome import Outcome, read_outcome
from refgi.batch.temporal import paths_of
from refgi.bench.grid import TRUTH
from refgi.bench.measure import compared
from refgi.bench.results import Result, SceneResult
from refgi.compare.provenance import environment

Outcomes = dict[str, Outcome]  # by name of the job


def read_outcomes(folder: Path, jobs: Sequence[Job]) -> Outcomes:
    """Return by name the results that the folder holds of a plan's jobs."""
    return {job.name: found for job in jobs if (found := read_outcome(folder, job)) is not None}


def result_of(folder: Path, jobs: Sequence[Job], outcomes: Outcomes) -> Result:
    """Return what a batch has found so far, as a bench does: a scene for each frame of which there is some result.

    The jobs of one frame are side by side.
    """
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

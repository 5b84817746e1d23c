"""`refgi batch`: scenes x methods x settings x frames as jobs that are done once."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from refgi.cli.options import WRITING, Asked, verb
from refgi.cli.session import DONE, FAILED, Session, progress, say
from refgi.texts import annotation

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from refgi.batch.jobs import Job
    from refgi.batch.plan import Plan
    from refgi.batch.shared import Common
    from refgi.bench.results import Result
    from refgi.types import Tell

FILES = ("results.json", "results.csv", "results.md")
SECONDS_BETWEEN_RESULTS = 30.0


@verb("batch", "PLAN", "out", "store", "workers", "executor", "shard", "since", "retry-failed", "dry-run", "baseline",
      "tolerance", "format", *WRITING,
      out={"required": True, "help": "Folder for results, jobs, pictures and, unless --store, truths."})
def _batch(session: Session, asked: Asked) -> int:
    """Run the methods, settings, scenes and frames of PLAN, a TOML file.

    Every job is done once: its result is named by all that it depends on. An interrupted batch goes on where it was.
    Exits with 1 where a job failed, a threshold of [expect] is missed or a figure is worse than the baseline's.
    """
    from refgi.batch.jobs import jobs_of
    from refgi.batch.outcome import worse
    from refgi.batch.plan import broken, read_plan
    from refgi.bench.folder import read_result
    from refgi.cli.destination import Permission, folder, make

    plan = read_plan(Path(asked.plan))
    baseline = read_result(Path(asked.baseline), "--baseline") if asked.baseline else None
    path = folder(asked.out, Permission(asked.parents, asked.force), FILES)
    request = _request(plan, _since(jobs_of(plan), asked.since), path, asked)
    if asked.dry_run:
        with progress() as tell:
            return _say_what_would_be(session, request, tell)
    for needed in (path, path / "jobs", request.common.store):
        make(needed)
    with progress() as tell:
        begun = _do(request, asked.executor, tell)
        result = _written(request)
    whole = not (asked.since or _open_jobs(request._replace(jobs=request.all_jobs, retry=False)))
    findings = [*broken(plan.thresholds, result, whole=whole), *(worse(
        result, baseline, asked.tolerance, str(Path(asked.baseline).parent)) if baseline else [])]
    failures = {f"{scene.scene} {name}": why for scene in result.scenes for name, why in scene.failures.items()}
    doubts = [f"{scene.scene}: {doubt}" for scene in result.scenes for doubt in scene.doubts]
    said = [*(("no picture", f"{name} gave no picture: {why}") for name, why in failures.items()),
            *(("in doubt", doubt) for doubt in doubts),
            *((f"{finding.place} {finding.figure}", str(finding)) for finding in findings)]
    count, github = len(request.jobs), asked.form == "github" and not session.as_json
    lines = [f"{count} jobs: {begun} done now, {count - begun} were there, {len(failures)} without a picture -> "
             f"{asked.out}"]
    for title, text in said:
        lines += [annotation(f"refgi: {title}", text)] if github else []
        say(text)
    lines += [] if github else [f"refgi report {asked.out} shows times, errors and pictures"]
    content = {"jobs": count, "done_now": begun, "failures": failures, "doubts": doubts,
               "findings": [finding._asdict() for finding in findings], "out": asked.out}
    session.result("\n".join(lines), content)
    return FAILED if failures or findings else DONE


class _Request(NamedTuple):
    plan: "Plan"
    all_jobs: "list[Job]"  # of the plan: those that results are of
    jobs: "list[Job]"  # that this run is to do, unless they are done
    common: "Common"
    workers: int
    retry: bool


def _request(plan: "Plan", jobs: "list[Job]", path: Path, asked: Asked) -> _Request:
    from refgi.batch.schedule import chunks_of
    from refgi.batch.shared import Common

    store = Path(asked.store) if asked.store else path / "store"
    common = Common(path, store, plan.truth, plan.rsm_resolution, asked.workers)
    chosen = set(jobs)
    if asked.shard is not None:
        part, parts = asked.shard
        chosen = {job for chunk in chunks_of(jobs, common, parts)[part - 1::parts] for job in chunk.jobs}
    return _Request(plan, jobs, [job for job in jobs if job in chosen], common, asked.workers, asked.retry_failed)


def _since(jobs: "list[Job]", commit: str | None) -> "list[Job]":
    """Return the jobs of methods whose code changed since a commit; all where there is none."""
    if commit is None:
        return jobs
    from refgi.batch.code import changed_methods

    names = dict.fromkeys(job.choice.method for job in jobs)
    changed = changed_methods(names, commit)
    for name in names:
        modules = changed.get(name, [])
        say(f"{name}: {'unchanged since' if not modules else 'changed since'} {commit}"
            + (f" ({', '.join(modules[:3])}{' ...' if len(modules) > 3 else ''})" if modules else ""))
    return [job for job in jobs if job.choice.method in changed]


def _open_jobs(request: _Request) -> "list[Job]":
    """Return jobs without a result; damaged results count as none, and with --retry-failed errors do."""
    from refgi.batch.outcome import read_outcome

    found = [(job, read_outcome(request.common.folder, job)) for job in request.jobs]
    return [job for job, one in found if one is None or (request.retry and one.status == "failed")]


def _do(request: _Request, executor: str | None, tell: "Tell") -> int:
    """Do what is not done; return how many jobs that was."""
    from refgi.batch.outcome import outcome_file, remove_leftovers
    from refgi.batch.schedule import SCHEME, chunks_of, run_here, run_in_processes, run_on_cluster
    from refgi.cli.view import warm_up
    from refgi.errors import expect

    expect(executor is None or executor.startswith(SCHEME), "--executor", "dask:ADDRESS", executor)
    jobs = _open_jobs(request)
    if not jobs:
        return 0
    _require_memory(jobs, request.common, request.workers)
    remove_leftovers(request.common.folder)
    for job in jobs:
        outcome_file(request.common.folder, job).unlink(missing_ok=True)
    warm_up(dict.fromkeys(job.choice.method for job in jobs), "float32", tell)
    written = _from_time_to_time(request)
    try:
        if executor is not None:
            run_on_cluster(executor.removeprefix(SCHEME), jobs, request.common, tell, written)
        elif request.workers == 1:
            run_here(chunks_of(jobs, request.common, 1), tell, written)
        else:
            run_in_processes(chunks_of(jobs, request.common, request.workers), request.workers, tell, written)
    finally:
        remove_leftovers(request.common.folder)  # workers end at once where this process is interrupted
    return len(jobs)


def _from_time_to_time(request: _Request) -> "Callable[[], None]":
    """Return what writes the results so far, when called long enough after the last time."""
    last = time.monotonic()

    def write() -> None:
        nonlocal last
        if time.monotonic() - last > SECONDS_BETWEEN_RESULTS:
            _written(request)
            last = time.monotonic()

    return write


def _written(request: _Request) -> "Result":
    from refgi.batch.outcome import read_outcomes, result_of
    from refgi.bench.folder import write_results

    folder = request.common.folder
    result = result_of(folder, request.all_jobs, read_outcomes(folder, request.all_jobs))
    write_results(result, folder)
    return result


def _say_what_would_be(session: Session, request: _Request, tell: "Tell") -> int:
    """Print what a batch would do, in how much time and memory."""
    from refgi.batch.schedule import estimate

    jobs, workers = _open_jobs(request), request.workers
    found, needed = estimate(jobs, request.common, tell), _memory_needed(jobs, request.common, workers)
    lines = [f"{len(request.jobs)} jobs on {len({job.shot for job in request.jobs})} frames; {len(jobs)} have no "
             f"result\nabout {duration(found.seconds)} for them, and up to {duration(found.truth_seconds)} for the "
             f"truths of {len({job.shot for job in jobs})} frames where the store has none",
             f"about {needed / 2**20:,.0f} MB of memory in {workers} {'process' if workers == 1 else 'processes'}"]
    lines += [f"  {job.name}  {job.label}" for job in jobs]
    session.result("\n".join(lines), {
        "jobs": len(request.jobs), "open": [{"job": job.name, "label": job.label} for job in jobs], "bytes": needed,
        **found._asdict()})
    return DONE


def duration(seconds: float) -> str:
    """Return a time, s, in the unit that suits it.

    >>> duration(3.21), duration(200), duration(20000)
    ('3.2 s', '3.3 min', '5.6 h')
    """
    for unit, length, most in (("s", 1, 90), ("min", 60, 90)):
        if seconds < most * length:
            return f"{seconds / length:.1f} {unit}"
    return f"{seconds / 3600:.1f} h"


def _memory_needed(jobs: "Sequence[Job]", common: "Common", workers: int) -> int:
    """Estimate the memory that jobs take, bytes: the most that a job takes, in every one of `workers` processes."""
    from refgi.batch.jobs import scene_at
    from refgi.cli.view import map_count, needed_bytes
    from refgi.method import Extent
    from refgi.methods import find_method

    most = 0
    for first in {job.shot.scene: job for job in jobs}.values():  # frames of a path differ little
        scene = scene_at(first.shot)
        size = scene.camera.width, scene.camera.height
        extent = Extent(size, maps=map_count(scene), texels=common.rsm_resolution**2)
        own = needed_bytes(scene, *size, rsm_resolution=common.rsm_resolution, traced=True,
                           compared=2 + max(len(job.seeds) for job in jobs))
        extra = max(find_method(job.choice.method).extra_bytes(job.choice.settings, extent)
                    for job in jobs if job.shot.scene == first.shot.scene)
        most = max(most, own + extra)
    return most * workers


def _require_memory(jobs: "Sequence[Job]", common: "Common", workers: int) -> None:
    """Refuse more processes than there is memory for; an InputError names what is needed and what is available."""
    from refgi import memory
    from refgi.errors import expect

    needed, available = _memory_needed(jobs, common, workers), memory.available_bytes()
    expect(available is None or needed <= available, "--workers",
           f"so few that about {needed:,} bytes of memory are there, or a smaller size", f"{available} available")

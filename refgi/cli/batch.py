"""`refgi batch`: scenes x methods x settings x frames as jobs that are done once."""

import re
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from refgi.cli.options import speech, writing
from refgi.cli.session import DONE, FAILED, Session, progress, say
from refgi.texts import annotation

if TYPE_CHECKING:
    from refgi.batch.jobs import Job
    from refgi.batch.plan import Finding, Plan
    from refgi.batch.shared import Common
    from refgi.bench.results import Result
    from refgi.types import Tell


class Done(NamedTuple):
    """What became of a batch."""

    jobs: int  # of the plan, or of the part that was asked for
    begun: int  # that had no result before
    failures: dict[str, str]  # why jobs gave no picture, by what is said of them
    findings: "list[Finding]"
    out: str
    doubts: list[str]  # truths whose error is not to be trusted


def say_done(session: Session, done: Done, form: str) -> int:
    """Print what became of a batch, as "text" or as annotations of "github"; return the exit code."""
    github = form == "github" and not session.as_json
    lines = [f"{done.jobs} jobs: {done.begun} done now, {done.jobs - done.begun} were there, "
             f"{len(done.failures)} without a picture -> {done.out}"]
    for name, why in done.failures.items():
        text = f"{name} gave no picture: {why}"
        lines += [annotation("refgi: no picture", text)] if github else []
        say(text)
    for doubt in done.doubts:
        lines += [annotation("refgi: in doubt", doubt)] if github else []
        say(doubt)
    for finding in done.findings:
        lines += [annotation(f"refgi: {finding.place} {finding.figure}", str(finding))] if github else []
        say(str(finding))
    content = {"jobs": done.jobs, "done_now": done.begun, "failures": done.failures, "doubts": done.doubts,
               "findings": [finding._asdict() for finding in done.findings], "out": done.out}
    lines += [] if github else [f"refgi report {done.out} shows times, errors and pictures"]
    session.result("\n".join(lines), content)
    return FAILED if done.failures or done.findings else DONE


def say_what_would_be(
    session: Session, jobs: "Sequence[Job]", open_jobs: "Sequence[Job]", common: "Common", workers: int, tell: "Tell"
) -> int:
    """Print what a batch would do, in how much time and memory; return the exit code.

    `jobs` are all that are asked for, `open_jobs` those without a result.
    """
    from refgi.batch.schedule import estimate

    found = estimate(open_jobs, common, tell)
    needed = memory_needed(open_jobs, common, workers)
    frames = len({job.shot for job in open_jobs})
    lines = [f"{len(jobs)} jobs on {len({job.shot for job in jobs})} frames; {len(open_jobs)} have no result",
             f"about {duration(found.seconds)} for them, and up to {duration(found.truth_seconds)} for the truths of "
             f"{frames} frames where the store has none", f"about {needed / 2**20:,.0f} MB of memory in {workers} "
             f"{'process' if workers == 1 else 'processes'}"]
    lines += [f"  {job.name}  {job.label}" for job in open_jobs]
    session.result("\n".join(lines), {
        "jobs": len(jobs), "open": [{"job": job.name, "label": job.label} for job in open_jobs], "bytes": needed,
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


def memory_needed(jobs: "Sequence[Job]", common: "Common", workers: int) -> int:
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


def require_memory(jobs: "Sequence[Job]", common: "Common", workers: int) -> None:
    """Refuse more processes than there is memory for; an InputError names what is needed and what is available."""
    from refgi import memory
    from refgi.errors import expect

    needed, available = memory_needed(jobs, common, workers), memory.available_bytes()
    expect(available is None or needed <= available, "--workers",
           f"so few that about {needed:,} bytes of memory are there, or a smaller size", f"{available} available")


def failures_of(result: "Result") -> dict[str, str]:
    """Return why jobs gave no picture, by what is said of them."""
    return {f"{scene.scene} {name}": why for scene in result.scenes for name, why in scene.failures.items()}


def folder_of(baseline: str | None) -> str:
    """Return where the pictures of a baseline lie."""
    return str(Path(baseline).parent) if baseline else ""


FILES = ("results.json", "results.csv", "results.md")
SECONDS_BETWEEN_RESULTS = 30.0


class Shard(click.ParamType[tuple[int, int]]):
    """Which part of how many."""

    name = "I/N"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, int]:
        """Read one part."""
        match = re.fullmatch(r"(\d+)/(\d+)", str(value))
        if match is None or not 1 <= int(match[1]) <= int(match[2]):
            self.fail(f"expected a part such as 2/8, from 1 on, got {value!r}", param, ctx)
        return int(match[1]), int(match[2])


class Share(click.ParamType[float]):
    """A share, as 0.02 or 2%."""

    name = "SHARE"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Read one share."""
        match = re.fullmatch(r"(\d+(?:\.\d*)?(?:e-?\d+)?)(%?)", str(value))
        if match is None:
            self.fail(f"expected a share such as 0.02 or 2%, got {value!r}", param, ctx)
        return float(match[1]) / (100 if match[2] else 1)


@click.command("batch")
@click.argument("plan_file", metavar="PLAN")
@click.option("--out", required=True, help="Folder for results, jobs, pictures and, unless --store, truths.")
@click.option("--store", metavar="DIR", help="Folder of truths that batches share; in --out where absent.")
@click.option("--workers", type=click.IntRange(1, 1024), default=1, show_default=True,
              help="Processes of a machine, each with its part of the cores.")
@click.option("--executor", metavar="dask:ADDRESS", help="Scheduler of dask.distributed; its workers see all folders.")
@click.option("--shard", type=Shard(), help="Do this part of the jobs alone, such as 2/8.")
@click.option("--since", metavar="COMMIT", help="Do jobs of methods alone whose code differs from a commit's.")
@click.option("--retry-failed", is_flag=True, help="Do jobs again that gave no picture.")
@click.option("--dry-run", is_flag=True, help="Say what would be done and what it will take.")
@click.option("--baseline", metavar="FILE", help="results.json of an earlier batch: fail where a figure is worse.")
@click.option("--tolerance", type=Share(), default="0.01", show_default=True,
              help="By which share of itself a figure may be worse than in the baseline.")
@click.option("--format", "form", type=click.Choice(["text", "github"]), default="text", show_default=True,
              help="How failures are said: as text, or as annotations of GitHub Actions.")
@writing
@speech
@click.pass_obj
def _batch(session: Session, /, plan_file: str, out: str, parents: bool, force: bool, **options: Any) -> int:
    """Run the methods, settings, scenes and frames of PLAN, a TOML file.

    Every job is done once: its result is named by all that it depends on. An interrupted batch goes on where it was.
    Exits with 1 where a job failed, a threshold of [expect] is missed or a figure is worse than the baseline's.
    """
    from refgi.batch.jobs import jobs_of
    from refgi.batch.outcome import read_baseline, worse
    from refgi.batch.plan import broken, read_plan
    from refgi.cli.destination import Permission, folder, make

    plan = read_plan(Path(plan_file))
    baseline = read_baseline(Path(options["baseline"])) if options["baseline"] else None
    path = folder(out, Permission(parents, force), FILES)
    request = _request(plan, _since(jobs_of(plan), options["since"]), path, options)
    if options["dry_run"]:
        with progress() as tell:
            return say_what_would_be(session, request.jobs, _open_jobs(request), request.common, request.workers, tell)
    for needed in (path, path / "jobs", request.common.store):
        make(needed)
    with progress() as tell:
        begun = _do(request, options["executor"], tell)
        result = _written(request)
    whole = not (options["since"] or _open_jobs(request._replace(jobs=request.all_jobs, retry=False)))
    findings = [*broken(plan.thresholds, result, whole=whole), *(worse(
        result, baseline, options["tolerance"], folder_of(options["baseline"])) if baseline else [])]
    doubts = [f"{scene.scene}: {doubt}" for scene in result.scenes for doubt in scene.doubts]
    return say_done(session, Done(len(request.jobs), begun, failures_of(result), findings, out, doubts),
                    options["form"])


command = _batch


class _Request(NamedTuple):
    """What is asked for."""

    plan: "Plan"
    all_jobs: "list[Job]"  # of the plan: those that results are of
    jobs: "list[Job]"  # that this run is to do, unless they are done
    common: "Common"
    workers: int
    retry: bool


def _request(plan: "Plan", jobs: "list[Job]", path: Path, options: dict[str, Any]) -> _Request:
    from refgi.batch.schedule import chunks_of
    from refgi.batch.shared import Common

    workers = options["workers"]
    store = Path(options["store"]) if options["store"] else path / "store"
    common = Common(path, store, plan.truth, plan.rsm_resolution, workers)
    chosen = set(jobs)
    if options["shard"] is not None:
        part, parts = options["shard"]
        chosen = {job for chunk in chunks_of(jobs, common, parts)[part - 1::parts] for job in chunk.jobs}
    return _Request(plan, jobs, [job for job in jobs if job in chosen], common, workers, options["retry_failed"])


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
    from refgi.cli.warm import warm_up
    from refgi.errors import expect

    expect(executor is None or executor.startswith(SCHEME), "--executor", "dask:ADDRESS", executor)
    jobs = _open_jobs(request)
    if not jobs:
        return 0
    require_memory(jobs, request.common, request.workers)
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


def _from_time_to_time(request: _Request) -> Any:
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
    from refgi.bench.results import write_results

    folder = request.common.folder
    result = result_of(folder, request.all_jobs, read_outcomes(folder, request.all_jobs))
    write_results(result, folder)
    return result

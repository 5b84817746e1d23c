"""What `refgi batch` says: what it would do and need, what it did, and what is not as it should be."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from refgi.cli.session import DONE, FAILED, Session, say
from refgi.texts import annotation

if TYPE_CHECKING:
    from refgi.batch.jobs import Job
    from refgi.batch.shared import Common
    from refgi.batch.thresholds import Finding
    from refgi.bench.results import Result
    from refgi.cli.session import Tell


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
    from refgi.batch.estimate import estimate

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
    from refgi.cli.memory import map_count, needed_bytes
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

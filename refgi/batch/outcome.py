"""The result of one job as a file, written whole or not at all: figures where it is done, the error where it failed."""

import contextlib
import time
from pathlib import Path
from typing import Literal

import pydantic

from refgi.batch.jobs import FORMAT, Job
from refgi.bench.results import Run
from refgi.image import is_dead, write_text

SECONDS_OF_A_LEFTOVER = 3600.0


class View(pydantic.BaseModel):
    """What the results of one frame share."""

    model_config = pydantic.ConfigDict(extra="forbid", frozen=True)

    width: int
    height: int
    covered: int  # pixels that show a surface
    mean: float  # W/m^2, of the truth
    truth: str  # how well it is known


class Outcome(pydantic.BaseModel):
    """jobs/NAME.json."""

    model_config = pydantic.ConfigDict(extra="forbid", frozen=True)

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
    """Return the result of a job from the batch's folder.

    None where there is none, or a file that is not whole: whoever damaged it, the job is run again.
    """
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

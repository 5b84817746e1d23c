"""Jobs done one after the other in one process, each leaving its picture and then its result.

A job runs once with every stage recorded, which loads kernels and fills buffers, then once a seed, timed: its time has
that of the buffers it used, whichever job computed them. A process that goes on in the middle of a path makes the
temporal filter's state again from the picture of the frame before.
"""

import contextlib
import os
import warnings
from typing import Any, NamedTuple

from refgi import stages
from refgi.batch.jobs import Job, Shot, picture_of, scene_at
from refgi.batch.outcome import Outcome, failed, is_done, write_outcome
from refgi.batch.shared import BUFFERS, Buffers, Common, Shared, hashes_of, within
from refgi.bench.grid import TRUTH
from refgi.bench.measure import Made, judged, timed, with_seed
from refgi.compare.outcome import UNOCCLUDED
from refgi.compare.pictures import linear_planes, rgb_of
from refgi.errors import RefgiError, RefgiWarning, expect
from refgi.frame import Frame
from refgi.image import read_exr, write_exr
from refgi.jit import threads
from refgi.method import Method
from refgi.methods import METHODS
from refgi.provenance import Record, plain
from refgi.sssil.temporal_filter import Filtered, History, first_light, history_of, temporal_filter, with_frames
from refgi.types import Array, Tell


class _Left(NamedTuple):
    """What a filtered frame leaves to the job of the next."""

    job: str
    history: History


_left: list[_Left] = []  # of the last filtered job of this process


def blended(job: Job, common: Common, shared: Shared, irradiance: Array) -> Filtered:
    """Blend a frame's irradiance, (3, h, w), W/m^2, with that of the frame before, and leave it to the next."""
    assert job.temporal is not None
    frame, geometry = shared.frame, shared.scene.geometry
    history = None if job.before is None else _history(job, common)
    if history is None:
        made = Filtered(first_light(irradiance, job.temporal), 0.0)
    else:
        made = temporal_filter(irradiance, frame, geometry, history, job.temporal)
    light = with_frames(irradiance, made.frames) if job.temporal.form == "printed" else made.light
    _left[:] = [_Left(job.name, history_of(frame, geometry, light))]
    return made


def filter_record(job: Job) -> Record:
    """Return what frame and filter add to the record of a picture."""
    if job.shot.path is None:
        return {}
    return {"path": job.shot.path, "frame": job.shot.frame, "of": job.shot.frames, "temporal": plain(job.temporal)}


def _history(job: Job, common: Common) -> History:
    if _left and _left[0].job == job.before:
        return _left[0].history
    assert job.before is not None
    assert job.temporal is not None
    shot = job.shot._replace(frame=job.shot.frame - 1)
    file = common.folder / picture_of(shot, job.choice.method, job.before)
    expect(file.exists(), "temporal", "a picture of the frame before", str(file))
    scene = scene_at(shot)
    frame = Frame(scene, **common.options)
    if job.temporal.form == "printed":  # needs the light before it was filtered
        light = METHODS[job.choice.method].function(frame, with_seed(job.choice.settings, shot.frame))
    else:
        channels = read_exr(file)[0]
        light = with_frames(rgb_of(channels, "irradiance."), channels.get("frames"))
    return history_of(frame, scene.geometry, light)


class Chunk(NamedTuple):
    """Jobs that one process does in their order."""

    jobs: tuple[Job, ...]
    common: Common
    working_folder: str = os.curdir  # from which scenes are named


_kept: dict[tuple[Shot, str, Common], Shared] = {}  # of this process: what the jobs of a frame share


def run_chunk(chunk: Chunk, tell: Tell = lambda *_: None) -> int:
    """Do jobs without a result one after the other; return how many. Errors of a job are its result."""
    done = 0
    with contextlib.chdir(chunk.working_folder), threads(chunk.common.threads), warnings.catch_warnings():
        warnings.simplefilter("ignore", RefgiWarning)  # of each of many settings with each seed
        for number, job in enumerate(chunk.jobs):
            if not is_done(chunk.common.folder, job):
                share = number / len(chunk.jobs)
                tell(job.label, share)
                outcome = outcome_of(job, chunk.common, within(tell, share, 0.0))
                write_outcome(chunk.common.folder, outcome)
                done += 1
    return done


def outcome_of(job: Job, common: Common, tell: Tell) -> Outcome:
    """Do a job and write its picture; return the figures, or the error of whatever went wrong."""
    try:
        return _done(job, common, _shared(job, common, tell))
    except RefgiError as error:
        return failed(job, str(error))
    except Exception as error:  # a fault of refgi or of the machine ends this job alone
        return failed(job, f"{type(error).__name__}: {' '.join(str(error).split())}")


def forget() -> None:
    """Let go of what this process keeps for the next job."""
    _kept.clear()


def _shared(job: Job, common: Common, tell: Tell) -> Shared:
    key = job.shot, job.scene_key, common
    if key not in _kept:
        _kept.clear()  # a process keeps one frame
        _kept[key] = Shared(job.shot, job.scene_key, common, tell)
    return _kept[key]


def _done(job: Job, common: Common, shared: Shared) -> Outcome:
    method, references = METHODS[job.choice.method], {TRUTH: shared.reference(TRUTH)}
    if not method.knows_visibility(job.choice.settings):
        references[UNOCCLUDED] = shared.reference(UNOCCLUDED)
    settings = [with_seed(job.choice.settings, seed) for seed in job.seeds]
    hashes = _hashes(method, settings[0], shared)
    made = Made([], [], {})
    for one in settings:
        lobes = _timed(job, one, made, shared)
        made = made if made.lobes is not None else made._replace(lobes=lobes)
    frames = None
    if job.temporal is not None:
        filtered = blended(job, common, shared, made.pictures[0])
        made.pictures[0], frames = filtered.irradiance, filtered.frames
    _write(job, common, shared, settings[0], made, frames)
    run = judged(job.choice, made, references, shared.frame)
    run = run.model_copy(update={"picture": job.picture, "hashes": hashes})
    return Outcome(job=job.name, scene=job.shot.name, method=job.choice.method, changes=job.choice.changes,
                   status="done", view=shared.view(), run=run)


def _hashes(method: Method, settings: Any, shared: Shared) -> tuple[tuple[str, str], ...]:
    """Run a method with every stage recorded, and return what each gave."""
    frame, buffers = shared.fresh_frame(), shared.buffers
    buffers.start_anew()
    with stages.observe(record=True, memory=buffers) as log:
        method.made(frame, settings)
    digests: dict[str, list[str]] = {name: [] for name in BUFFERS}
    for buffer in buffers.used:
        digests[buffer.stage].append(buffer.digest)
    return hashes_of(log, digests)


def _timed(job: Job, settings: Any, made: Made, shared: Shared) -> Array | None:
    """Run a method on the shared buffers, add its picture and its time, and return its lobes if there are any."""
    frame: Frame = shared.fresh_frame()
    buffers: Buffers = shared.buffers
    buffers.start_anew()
    run = timed(frame, job.choice.method, settings, buffers)
    if not made.times:
        made.stages.update({name: run.stages.get(name, 0.0) + buffers.seconds.get(name, 0.0)
                            for name in (*buffers.seconds, *run.stages)})
    made.pictures.append(run.picture)
    made.times.append(run.seconds + sum(buffers.seconds.values()))
    return run.lobes


def _write(job: Job, common: Common, shared: Shared, settings: Any, made: Made, frames: Array | None) -> None:
    """Write the picture of the first seed."""
    irradiance, lobes = made.pictures[0], made.lobes
    file = common.folder / job.picture
    file.parent.mkdir(parents=True, exist_ok=True)
    planes = linear_planes(shared.frame.radiance(irradiance, lobes), irradiance, frames=frames, lobes=lobes)
    write_exr(file, planes, shared.record(job.choice.method, settings) | filter_record(job))

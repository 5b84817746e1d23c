"""Temporal filter of a batch: the light of each frame of a path blended with what the job of the frame before left.

The state stays in the process that does the frames in turn; a process that goes on in the middle of a path makes it
again from the picture of the frame before.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.batch.jobs import Job, picture_of, scene_at
from refgi.batch.shared import Common, Shared
from refgi.bench.measure import with_seed
from refgi.errors import expect
from refgi.frame import Frame
from refgi.image import read_exr
from refgi.methods import METHODS
from refgi.provenance import Record, plain
from refgi.sssil.temporal.filter import Filtered, History, first_light, history_of, temporal_filter, with_frames

Array = npt.NDArray[Any]


class _Left(NamedTuple):
    """What a filtered frame leaves to the job of the next."""

    job: str
    history: History


_left: list[_Left] = []  # of the last filtered job of this process


def blended(job: Job, common: Common, shared: Shared, irradiance: Array) -> Filtered:
    """Blend a frame's irradiance, (3, h, w), W/m^2, with that of the frame before, and leave it to the next.

    That of the first frame stays as it was. InputError if the frame before gave no picture.
    """
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
        light = with_frames(np.stack([channels[f"irradiance.{c}"] for c in "RGB"]), channels.get("frames"))
    return history_of(frame, scene.geometry, light)

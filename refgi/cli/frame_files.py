"""Frames of a sequence as files, from which an interrupted sequence can go on."""

from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from refgi.cli.destination import make
from refgi.compare.pictures import linear_planes, write_preview
from refgi.errors import InputError, expect
from refgi.frame import Frame
from refgi.image import is_from_refgi, read_exr, write_exr
from refgi.provenance import Record, estimate_record
from refgi.provenance.frames import same_sequence
from refgi.scene.model import Scene
from refgi.sssil.temporal import Sequence, SequenceFrame, seeded
from refgi.sssil.temporal_filter import History, history_of, with_frames
from refgi.types import Array

EXR, PNG = ".exr", ".png"


class FrameFiles(NamedTuple):
    """Where frames go, and what makes a frame found there one of these."""

    folder: Path
    stem: str
    suffixes: tuple[str, ...]
    record: Record  # what all frames share
    moving: Callable[[int], Record]  # what a frame adds, by number

    def of(self, number: int) -> list[Path]:
        """Return the files of a frame."""
        return [self.folder / f"{self.stem}_{number:05d}{suffix}" for suffix in self.suffixes]

    def kept(self, frames: int, *, resume: bool) -> Iterator[str]:
        """Return the files that must be refgi's own: all but EXRs that a resumed sequence finds damaged."""
        return (file.name for number in range(frames) for file in self.of(number) if not (resume and _is_damaged(file)))

    def record_of(self, number: int) -> Record:
        """Return the record of a frame."""
        return {**self.record, **self.moving(number)}

    def write(self, step: SequenceFrame, number: int, estimate: Any = None, lobe_estimate: Any = None) -> None:
        """Write a frame, each file whole or not at all, the EXR last: where it is, so are the others."""
        record = self.record_of(number)
        spread: tuple[Any, Any] = (None, None)
        if estimate is not None:
            record |= estimate_record(estimate, lobe_estimate)
            spread = estimate.variance_of_mean, estimate.samples
        lobe_variance = None if lobe_estimate is None or step.lobes is None else lobe_estimate.variance_of_mean
        make(self.folder)
        for file in sorted(self.of(number), reverse=True):
            if file.suffix == PNG:
                write_preview(file, step.radiance, record)
            else:
                write_exr(file, linear_planes(step.radiance, step.irradiance, *spread, step.frames, step.lobes,
                                              lobe_variance), record)

    def done(self, frames: int) -> int:
        """Return how many of `frames`, from the first on, are there: up to one with a file missing or EXR damaged.

        InputError if a frame found is one of another sequence.
        """
        for number in range(frames):
            file = self._exr(number)
            try:
                said = read_exr(file)[1]
            except InputError:
                return number
            other = same_sequence(said, self.record_of(number))
            if other:
                raise InputError(f"{file}: expected a frame of this sequence, to go on after it; got one of other "
                                 f"settings ({', '.join(other)})", file=str(file), key=", ".join(other))
            if not all(other.exists() for other in self.of(number)):
                return number
        return frames

    def light(self, number: int) -> tuple[Array, Array | None]:
        """Return the indirect irradiance of a frame that is there, (3, h, w), W/m^2, and of how many frames."""
        channels = read_exr(self._exr(number))[0]
        return np.stack([channels[f"irradiance.{c}"] for c in "RGB"]), channels.get("frames")

    def _exr(self, number: int) -> Path:
        return self.folder / f"{self.stem}_{number:05d}{EXR}"


def _is_damaged(file: Path) -> bool:
    if file.suffix != EXR or not file.is_file() or is_from_refgi(file):
        return False
    try:
        read_exr(file)
    except InputError:
        return True
    return False  # another program's


def resumed(sequence: Sequence, scenes: Iterable[Scene], files: FrameFiles, done: int) -> Iterator[SequenceFrame]:
    """Render the frames of a sequence after the first `done`, to the bit as if it had not been interrupted.

    `scenes` are all frames, from the first. InputError if the frame before cannot be had back to the bit from its file.
    """
    rest = iter(scenes)
    history = None
    if done:
        last = next(islice(rest, done - 1, None))
        history = _history_after(sequence, last, files, done - 1)
    yield from sequence.over(rest, done, history)


def _history_after(sequence: Sequence, scene: Scene, files: FrameFiles, number: int) -> History | None:
    if sequence.temporal is None:
        return None
    frame = Frame(scene, **sequence.frame_options)
    if sequence.temporal.form == "printed":  # needs the light before it was filtered
        return history_of(frame, scene.geometry, sequence.method(frame, seeded(sequence.settings, number)))
    expect(frame.dtype == np.float32, "dtype", "float32 to go on from, which an EXR holds whole", frame.dtype.name)
    return history_of(frame, scene.geometry, with_frames(*files.light(number)))

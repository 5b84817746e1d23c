"""What all jobs of one frame share: scene, buffers and the truth.

Each buffer is computed once in a process, with all its channels; its time counts for each job that uses it. Truths stay
in a store that batches share, by how they are traced and by which sources; who needs one that is traced waits for it.
"""

import contextlib
import dataclasses
import hashlib
import os
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from refgi import stages
from refgi.batch.code import code_key
from refgi.batch.jobs import Shot, key_of_scene, reference_settings, scene_at
from refgi.batch.outcome import View
from refgi.bench.grid import TRUTH
from refgi.bench.measure import traced
from refgi.bench.pictures import FOLDER, Place, Writer
from refgi.compare.comparison import WITHOUT_VISIBILITY, limited
from refgi.compare.outcome import Reference
from refgi.errors import InputError, expect
from refgi.frame import Frame
from refgi.image import canonical_json, read_exr, write_exr
from refgi.jit import most_threads
from refgi.jit.ahead import cores
from refgi.provenance import Record, method_record, plain, scene_record
from refgi.scene import Scene
from refgi.stages import Log
from refgi.truth import TruthSettings
from refgi.types import Tell

DIGITS = 16  # of digests


def hashes_of(log: Log, buffers: Mapping[str, Sequence[str]]) -> tuple[tuple[str, str], ...]:
    """Return the name and the digest of each stage's output of a recorded log, in the order in which stages ended.

    `buffers`: digests of shared buffers by stage, in the order in which they were used. They stand for what the stage
    gives whether it ran or gave back an earlier result; stages inside it are left out.
    """
    left = {name: list(digests) for name, digests in buffers.items()}
    ended: list[tuple[str, str]] = []
    running: list[tuple[int, str, str]] = []  # depth, name, digest of stages that are not known to have ended
    for run in log.runs:  # in the order in which they began
        while running and running[-1][0] >= run.depth:
            ended.append(running.pop()[1:])
        if run.status == "skipped" or any(name in left for _, name, _ in running):
            continue
        running.append((run.depth, run.name, left[run.name].pop(0) if run.name in left else digest_of(run.output)))
    return (*ended, *(one[1:] for one in reversed(running)))


def digest_of(value: Any) -> str:
    """Return a digest of arrays, numbers, text and None in containers; of any other object its type alone."""
    digest = hashlib.sha256()
    for part in _parts(value):
        digest.update(part)
    return digest.hexdigest()[:DIGITS]


def _parts(value: Any) -> Iterator[bytes | memoryview]:
    if isinstance(value, np.ndarray):
        yield f"{value.dtype.str} {value.shape}".encode()
        yield np.ascontiguousarray(value).reshape(-1).view(np.uint8).data
    elif value is None or isinstance(value, bool | int | float | str | np.generic):
        yield f"{type(value).__name__} {value!r}".encode()
    elif isinstance(value, dict):
        for key in sorted(value, key=str):
            yield str(key).encode()
            yield from _parts(value[key])
    elif isinstance(value, tuple | list):
        yield f"{type(value).__name__} {len(value)}".encode()
        for item in value:
            yield from _parts(item)
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        yield type(value).__name__.encode()
        yield from _parts([getattr(value, field.name) for field in dataclasses.fields(value)])
    else:
        yield type(value).__name__.encode()


BUFFERS = frozenset({"rsm.gbuffer", "rsm.reflective_shadow_map", "rays.build"})  # stages
TINY = 8  # pixels along a side


class Buffer(NamedTuple):
    """What is known of a buffer."""

    stage: str
    seconds: float  # that it took with all its channels
    digest: str


class Buffers(stages.Memory):
    """Memory of a frame's buffers alone, which says what those that it gave back took and what they hold."""

    MOST = None  # a scene may have many lights

    def __init__(self) -> None:
        super().__init__()
        self._begun: dict[str, float] = {}
        self.used: list[Buffer] = []  # since `start_anew`, in order

    def recall(self, name: str, inputs: tuple[Any, ...]) -> tuple[bool, Any]:
        """Return whether a buffer is known, and the buffer."""
        if name not in BUFFERS:
            return False, None
        known, kept = super().recall(name, inputs)
        if not known:
            self._begun[name] = time.perf_counter()
            return False, None
        output, buffer = kept
        self.used.append(buffer)
        return True, output

    def keep(self, name: str, inputs: tuple[Any, ...], output: Any) -> None:
        """Keep a buffer with all its channels and the time that they took."""
        if name not in BUFFERS:
            return
        with stages.observe():  # apart from the log of the job that happens to be the first
            content = output.recorded() if hasattr(output, "recorded") else output
        seconds = time.perf_counter() - self._begun.pop(name)
        buffer = Buffer(name, seconds, digest_of(content))
        super().keep(name, inputs, (output, buffer))
        self.used.append(buffer)

    def start_anew(self) -> None:
        """Forget what was used, not what is kept."""
        self.used = []

    @property
    def seconds(self) -> dict[str, float]:
        """What the buffers used took, by stage, s."""
        spent: dict[str, float] = {}
        for buffer in self.used:
            spent[buffer.stage] = spent.get(buffer.stage, 0.0) + buffer.seconds
        return spent


def load_kernels(scene: Scene) -> None:
    """Make the smallest of a scene's buffers, so that no other's time holds that of loading kernels."""
    small = Frame(scene, width=TINY, height=TINY, rsm_resolution=TINY)
    small.gbuffer.recorded()
    for rsm in small.rsms:
        rsm.recorded()


if sys.platform != "win32":
    import fcntl

STOPS = ("samples", "seconds", "target_error")  # settings of the truth that no checkpoint knows


def within(tell: Tell, first: float, length: float) -> Tell:
    """Return what says the progress of a part, which begins at some share of the whole and has some length of it."""
    return lambda what, share: tell(what, first + share * length)


class Common(NamedTuple):
    """What all jobs of a batch share."""

    folder: Path
    store: Path
    truth: TruthSettings
    rsm_resolution: int
    processes: int = 1  # that share the cores of a machine

    @property
    def threads(self) -> int | None:
        """Of compiled kernels on this machine; None for all there are."""
        return None if self.processes == 1 else min(most_threads(), max(1, cores() // self.processes))

    @property
    def options(self) -> dict[str, Any]:
        """Of every `Frame`."""
        return {"rsm_resolution": self.rsm_resolution, "shadows": "exact"}


class Shared:
    """What all jobs of one frame share, each part made on first use; InputError if the scene is another by now."""

    def __init__(self, shot: Shot, scene_key: str, common: Common, tell: Tell) -> None:
        self.scene = scene_at(shot)
        self.shot, self._key, self._common, self._tell = shot, scene_key, common, tell
        expect(key_of_scene(self.scene) == scene_key, f"scene {shot.name!r}", "what it was when the batch began",
               "another")
        self.buffers = Buffers()
        self._frame: Frame | None = None
        self._record: Record = {}
        self.references: dict[str, Reference] = {}

    @property
    def frame(self) -> Frame:
        """A frame with its own G-buffer and tracer, which shows all pictures; never timed."""
        if self._frame is None:
            frame = Frame(self.scene, **self._common.options)
            load_kernels(frame.scene)
            with stages.observe(memory=self.buffers):
                covered = frame.gbuffer.covered
                expect(bool(covered.any()), f"scene {self.shot.name!r}: camera", "a view of some surface",
                       "a view past all of it")
                frame.tracer  # noqa: B018  # for the truth, the direct light and jobs
            self._frame = frame
        return self._frame

    def fresh_frame(self) -> Frame:
        """Return a frame with nothing computed, of the geometry that the buffers are of."""
        return Frame(self.frame.scene, **self._common.options)

    def reference(self, name: str) -> Reference:
        """Return the truth or the one in which nothing blocks indirect light; its picture is written."""
        if name not in self.references:
            settings = reference_settings(self._common.truth, self.shot)
            settings = settings if name == TRUTH else limited(settings, name, WITHOUT_VISIBILITY)
            self.references[name] = self._traced(name, settings)
            self._write(name, settings, self.references[name])
        return self.references[name]

    def view(self) -> View:
        """Return what the results of the frame share."""
        covered, truth = self.frame.gbuffer.covered, self.reference(TRUTH)
        return View(width=self.frame.width, height=self.frame.height, covered=int(covered.sum()),
                    mean=float(truth.irradiance[:, covered].mean(dtype=np.float64)), truth=truth.statement)

    def record(self, method: str, settings: Any) -> Record:
        """Return the record of a picture."""
        if not self._record:
            self._record = scene_record(self.scene, {"dtype": self.frame.dtype.name, **self._common.options})
        return {**self._record, **method_record(method, settings)}

    def _traced(self, name: str, settings: TruthSettings) -> Reference:
        chosen = canonical_json([code_key("refgi.truth:trace_truth", "refgi.frame:Frame"),
                                 {key: plain(settings)[key] for key in STOPS}])
        how = hashlib.sha256(chosen.encode()).hexdigest()
        folder = self._common.store / "truths" / how[:DIGITS] / self._key[:DIGITS]
        folder.mkdir(parents=True, exist_ok=True)
        with _alone_in(folder):
            return traced(self.frame, dataclasses.replace(settings, checkpoint=folder), self._tell, name)

    def _write(self, name: str, settings: TruthSettings, reference: Reference) -> None:
        """Write a reference's picture unless the same is there."""
        file = self._common.folder / FOLDER / self.shot.name / f"{TRUTH}{'' if name == TRUTH else f'_{name}'}.exr"
        record = self.record(TRUTH, settings)
        if _record_in(file) != record:
            file.parent.mkdir(parents=True, exist_ok=True)
            write_exr(file, reference.planes, record)
            Writer(Place(self._common.folder, f"{FOLDER}/{self.shot.name}"), self.scene, self.frame).write_ids()


def _record_in(file: Path) -> Record | None:
    try:
        return read_exr(file)[1] if file.exists() else None
    except InputError:
        return None


@contextlib.contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """Wait until no other process is in a block on the same folder; a killed process leaves nothing behind."""
    if sys.platform == "win32":  # two processes may trace the same truth; the last one's file stays
        yield
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)

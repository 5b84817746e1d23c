"""Buffers of one frame that its jobs share, and digests of what stages give.

Each buffer is computed once in a process, with all its channels; the time that took counts for each job that uses it,
so that a job's time is that of a whole frame.
"""

import dataclasses
import hashlib
import time
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from refgi import stages
from refgi.frame import Frame
from refgi.scene import Scene
from refgi.stages import Log

DIGITS = 16


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
    """Return a digest of a stage's output, in hexadecimal digits.

    Of arrays, numbers, text and None, in tuples, lists, mappings and dataclasses; of any other object its type alone.
    """
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
    """Make the smallest of buffers, so that the time of no other holds that of loading its kernels.

    The scene's materials and lights decide on the kernels.
    """
    small = Frame(scene, width=TINY, height=TINY, rsm_resolution=TINY)
    small.gbuffer.recorded()
    for rsm in small.rsms:
        rsm.recorded()

"""Buffers of one frame that its jobs share: G-buffer, RSMs and Embree's tree.

Each is computed once in a process, with all its channels; the time that took counts for each job that uses it, so that
a job's time is that of a whole frame.
"""

import time
from typing import Any, NamedTuple

from refgi import stages
from refgi.batch.digest import digest_of
from refgi.frame import Frame
from refgi.scene import Scene

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

"""Diagnostics of a picture: what its method says of its own errors, and whether it is asked to.

They cost a few of 100 of a picture. A picture by itself has them; of frames of one scene the first one has, and those
with other objects, materials or another number of lamps. Camera and lamps may move without.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, NamedTuple

from refgi.stages import skip


class SamplingError(NamedTuple):
    """How far pictures of one method differ by the lights or samples that were drawn; shares of the mean light."""

    pixel: float  # RMS over pixels and channels of the error, over their mean, from sampled ones
    mean: float  # of that mean; of one difference alone, so rather a hint
    most: float  # that RMS in 95 of 100 draws at most
    samples: int  # lights, or samples of a pixel, that it is of
    of: str = "pixel lights"

    @property
    def statement(self) -> str:
        """In a line."""
        percent, most = (f"{100 * share:.{1 if share < 0.1 else 0}f}" for share in (self.pixel, self.most))
        return (f"sampling error: {percent} % of the indirect light, at most {most} % in 95 of 100 draws (RMS over "
                f"pixels, by two halves of {self.samples:,} {self.of})")


class LightcutsChoice(NamedTuple):
    """Clusters of pixel lights that a method chose to sum in place of the lights."""

    lights: int
    error: float  # of a receiver's sum over channels, at most, as a share of it
    share: float  # estimated time over that of the full sum

    @property
    def statement(self) -> str:
        """In a line."""
        return (f"lightcuts: clusters of {self.lights:,} lights, within {100 * self.error:g} % of every sum, in about "
                f"{self.share:.2g} of its time")


class Diagnosis:
    """What a method found of the picture that it is making."""

    def __init__(self, due: bool) -> None:
        self.due = due
        self.sampling_error: SamplingError | None = None
        self.lightcuts: LightcutsChoice | None = None


_open: ContextVar[Diagnosis | None] = ContextVar("refgi_diagnosis", default=None)


@contextmanager
def diagnosing(due: bool | None = None) -> Iterator[Diagnosis]:
    """Collect what methods find of a picture that is made inside the block, in a `Diagnosis` that fills while it runs.

    `due`: whether they are to look; where absent, as for the block around, and if there is none they are.
    """
    around = _open.get()
    found = Diagnosis(due if due is not None else around is None or around.due)
    token = _open.set(found)
    try:
        yield found
    finally:
        _open.reset(token)


def is_due(name: str) -> bool:
    """Return whether the diagnostic stage `name` is to run: also where nobody collects; logs why it does not."""
    found = _open.get()
    if found is None or found.due:
        return True
    skip(name, "estimated on an earlier frame")
    return False


def tell_lightcuts(choice: LightcutsChoice) -> None:
    """Tell whoever collects diagnostics that lights are summed by clusters."""
    if (found := _open.get()) is not None:
        found.lightcuts = choice


def asked(name: str) -> Diagnosis | None:
    """Return who collects what the diagnostic stage `name` finds; None where nobody does, or it is not due."""
    return _open.get() if is_due(name) else None


class FrameSession:
    """Frames of one scene: whose diagnostics are due."""

    def __init__(self) -> None:
        self._scene: tuple[Any, Any, int] | None = None

    @contextmanager
    def frame(self, scene: Any) -> Iterator[bool]:
        """Let diagnostics run inside the block, a frame, where its scene is another than the last frame's; yield that.

        Another one has other objects or materials, or another number of lamps. Inside a block that asks for none there
        are none.
        """
        around = _open.get()
        now = (scene.geometry, scene.materials, len(scene.lights))
        last = self._scene
        changed = last is None or now[0] is not last[0] or now[1:] != last[1:]
        with diagnosing(changed and (around is None or around.due)) as found:
            yield found.due
        self._scene = now

"""What the figures of one run share: how large everything is, frames that stay warm, things made once."""

import dataclasses
from collections.abc import Callable
from typing import Any, TypeVar

from refgi.frame import Frame
from refgi.scene import Scene, load_scene

T = TypeVar("T")


@dataclasses.dataclass(frozen=True)
class Scale:
    """How large and how often."""

    name: str
    size: int  # pixels along a side of every picture
    rsm_resolution: int  # texels along a side of every shadow map
    repeats: int  # timed rounds
    truth_samples: int  # of path tracing, a pixel
    photons: int  # of caustics, a pass


FULL = Scale("full", 512, 256, 7, 192, 1 << 20)
QUICK = Scale("quick", 256, 128, 3, 48, 1 << 18)


class Workbench:
    """Gives every figure the same frames, so that buffers are computed once and never timed.

    Parameters
    ----------
    scale : Scale
        Sizes and repeats.
    """

    def __init__(self, scale: Scale) -> None:
        self.scale = scale
        self._made: dict[Any, Any] = {}

    def scene(self, name: str) -> Scene:
        """Return a scene whose camera takes square pictures of this run's size."""
        size = self.scale.size
        return self.once(("scene", name), lambda: load_scene(name).with_camera(width=size, height=size))

    def frame(self, name: str, **options: Any) -> Frame:
        """Return a frame of a scene with this run's sizes; its buffers stay once they are computed."""
        chosen = {"rsm_resolution": self.scale.rsm_resolution} | options
        return self.once(("frame", name, *sorted(chosen.items())), lambda: Frame(self.scene(name), **chosen))

    def once(self, key: Any, make: Callable[[], T]) -> T:
        """Return what was made under this key before, or make it."""
        if key not in self._made:
            self._made[key] = make()
        found: T = self._made[key]
        return found

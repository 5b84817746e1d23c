"""`Method`: what a method's package declares of itself, so that every command can use it."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy.typing as npt

from refgi.errors import InputError
from refgi.settings import Settings

Array = npt.NDArray[Any]

DEFAULT = "default"
NONE: Mapping[str, Any] = MappingProxyType({})


class Method(NamedTuple):
    """A method by name."""

    name: str  # short, as on the command line
    summary: str  # one line
    function: Callable[[Any, Any], Array]  # frame and settings to (3, h, w) indirect irradiance, W/m^2
    settings: type[Settings]
    visibility: bool | Callable[[Any], bool]  # whether it knows what blocks indirect light; may depend on settings
    ledger: Callable[[Any, Any], Any] | None = None  # accounts for the power of the lights
    estimate: Callable[[Any, Any], Any] | None = None  # gives the picture with its own error
    memory: Callable[[Any, tuple[int, int], int], int] | None = None  # bytes that settings add to a picture
    presets: Mapping[str, Settings] = NONE  # named settings beside the default; "paper": the values printed
    temporal: Settings | None = None  # of its temporal filter over frames, where it has one

    def preset(self, name: str) -> Settings:
        """Return named settings; "default" are those of the class."""
        if name == DEFAULT:
            return self.settings()
        if name not in self.presets:
            raise InputError(f"preset: expected one of {', '.join([DEFAULT, *self.presets])} for {self.name}, "
                             f"got {name!r}", key="preset")
        return self.presets[name]

    def knows_visibility(self, settings: Any) -> bool:
        """Return whether the method, with some settings, knows what blocks indirect light."""
        return self.visibility(settings) if callable(self.visibility) else self.visibility

    def compute(self, frame: Any, settings: Any) -> tuple[Array, Any]:
        """Return the indirect irradiance in the frame's dtype, and the estimate it is the mean of, if it is one."""
        if self.estimate is None:
            return self.function(frame, settings), None
        estimate = self.estimate(frame, settings)
        return estimate.mean.astype(frame.dtype), estimate

    def extra_bytes(self, settings: Any, size: tuple[int, int], float_bytes: int) -> int:
        """Return what settings add to the memory of a picture of some width and height and floats of 4 or 8 bytes."""
        return self.memory(settings, size, float_bytes) if self.memory is not None else 0

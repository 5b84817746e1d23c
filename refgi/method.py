"""`Method`: what a method's package declares of itself, so that every command can use it; its approximations too."""

import warnings
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from refgi.diagnostics import LightcutsChoice, SamplingError, diagnosing
from refgi.errors import InputError, RefgiWarning
from refgi.settings import Settings
from refgi.stages import sharing
from refgi.types import Array

DEFAULT = "default"
NONE: Mapping[str, Any] = MappingProxyType({})
_WARNED: set[str] = set()  # methods without lobes that have said so


class Approximation(NamedTuple):
    """What a method leaves out or does coarsely, and what switches that off.

    It is switched off by other settings, by other options of the frame, or, where no settings of the method do
    without it, by a truth that has it as well: then `limit` is not empty.
    """

    name: str  # the same in all methods that have it
    about: str  # one line: what takes the place of what
    off: Callable[[Any, Mapping[str, Any]], Any] | None = None  # settings without it, in a frame of some options
    frame: Callable[[Mapping[str, Any]], Mapping[str, Any]] | None = None  # options of the frame without it
    limit: Callable[[Any], Mapping[str, Any]] | None = None  # settings of the truth that has it as well
    from_truth: Callable[[Any], bool] | None = None  # whether pictures without it and what follows are the truth

    def shared_by(self, settings: Any) -> Mapping[str, Any]:
        """Return settings of the truth that has it as well; empty where it is switched off in the method."""
        return NONE if self.limit is None else self.limit(settings)

    def without(self, settings: Any, options: Mapping[str, Any]) -> tuple[Any, Mapping[str, Any]]:
        """Return settings and options of the frame with it switched off; both as they are where it is off already."""
        changed = settings if self.off is None else self.off(settings, options)
        return changed, options if self.frame is None else self.frame(options)


class Light(NamedTuple):
    """What a method makes of a frame."""

    irradiance: Array  # (3, h, w) indirect, W/m^2
    estimate: Any = None  # that the irradiance is the mean of, of a method that states its own error
    lobes: Array | None = None  # (3, h, w) radiance of receivers' lobes by indirect light, W/m^2/sr, if any
    lobe_estimate: Any = None  # that the lobes are the mean of
    sampling_error: SamplingError | None = None  # of a method that draws lights or samples, where it was asked for
    lightcuts: LightcutsChoice | None = None  # of a method that chose to sum clusters of lights


class Extent(NamedTuple):
    """What the memory of a picture depends on, beside settings."""

    size: tuple[int, int]  # width and height, pixels
    float_bytes: int = 4  # or 8
    maps: int = 1  # of all lamps
    texels: int = 512**2  # of a map


class Method(NamedTuple):
    """A method by name."""

    name: str  # short, as on the command line
    summary: str  # one line
    function: Callable[[Any, Any], Array]  # frame and settings to (3, h, w) indirect irradiance, W/m^2
    settings: type[Settings]
    visibility: bool | Callable[[Any], bool]  # whether it knows what blocks indirect light; may depend on settings
    ledger: Callable[[Any, Any], Any] | None = None  # accounts for the power of the lights
    estimate: Callable[[Any, Any], Any] | None = None  # gives the picture with its own error
    memory: Callable[[Any, Extent], int] | None = None  # bytes that settings add to a picture
    presets: Mapping[str, Settings] = NONE  # named settings beside the default; "paper": the values printed
    temporal: Settings | None = None  # of its temporal filter over frames, where it has one
    temporal_presets: Mapping[str, Settings] = NONE  # the same that belong to presets of the method
    approximations: tuple[Approximation, ...] = ()  # in the order of its pipeline
    lobes: Callable[[Any, Any], Array] | None = None  # (3, h, w) radiance of receivers' lobes by indirect light
    lobe_estimate: Callable[[Any, Any], Any] | None = None  # gives that radiance with its own error, W/m^2/sr

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

    def compute_lobes(self, frame: Any, settings: Any) -> tuple[Array | None, Any]:
        """Return the radiance that receivers' lobes make of indirect light, and the estimate it is the mean of, if any.

        (3, h, w), W/m^2/sr, in the frame's dtype. None where no visible surface is glossy, or the method knows diffuse
        receivers alone, of which it warns once.
        """
        if not frame.glossy_receivers:
            return None, None
        if self.lobe_estimate is not None:
            estimate = self.lobe_estimate(frame, settings)
            return estimate.mean.astype(frame.dtype), estimate
        if self.lobes is None:
            if self.name not in _WARNED:
                _WARNED.add(self.name)
                warnings.warn(RefgiWarning(f"{self.name}: glossy surfaces reflect indirect light by their diffuse part "
                                           "alone; the method has no lobes of receivers"), stacklevel=3)
            return None, None
        return self.lobes(frame, settings), None

    def light(self, frame: Any, settings: Any) -> "Light":
        """Return all that the method makes of a frame; what irradiance and lobes both need is computed once."""
        with diagnosing() as found:
            if not frame.glossy_receivers:
                light = Light(*self.compute(frame, settings))
            else:
                with sharing():
                    light = Light(*self.compute(frame, settings), *self.compute_lobes(frame, settings))
        return light._replace(sampling_error=found.sampling_error, lightcuts=found.lightcuts)

    def made(self, frame: Any, settings: Any) -> "Light":
        """Return what the method makes of a frame, without its estimates."""
        if not frame.glossy_receivers:
            return Light(self.function(frame, settings))
        with sharing():
            return Light(self.function(frame, settings), lobes=self.compute_lobes(frame, settings)[0])

    def extra_bytes(self, settings: Any, extent: Extent) -> int:
        """Return what settings add to the memory of a picture."""
        return self.memory(settings, extent) if self.memory is not None else 0

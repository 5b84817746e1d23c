"""What a comparison found: references, methods judged against them, and how it was made."""

import dataclasses
import functools
from collections.abc import Mapping
from typing import Any

import numpy.typing as npt

from refgi import stages
from refgi.compare.flip import Flip
from refgi.compare.measurement import Measurement
from refgi.provenance import Record, scene_record
from refgi.scene import Scene

Array = npt.NDArray[Any]

TRUTH, UNOCCLUDED = "truth", "unoccluded"  # names of the references


@dataclasses.dataclass(frozen=True)
class Reference:
    """What path tracing says, with or without visibility."""

    name: str
    settings: Any
    irradiance: Array  # (3, h, w) float64 indirect, W/m^2
    variance: Array  # (3, h, w) of its mean
    mean_variance: Array  # (3,) of the picture's mean, with the correlation between pixels
    samples: Array  # (h, w)
    radiance: Array  # (3, h, w) W/m^2/sr
    seconds: float
    runs: tuple[stages.Run, ...]
    estimate: Mapping[str, Any] = dataclasses.field(default_factory=dict)  # what the record of its files adds of it


@dataclasses.dataclass(frozen=True)
class MethodResult:
    """What one method made of the scene and how far it is off."""

    name: str
    summary: str
    settings: Any
    irradiance: Array  # (3, h, w) indirect, W/m^2
    radiance: Array  # (3, h, w) W/m^2/sr
    seconds: float  # with its own buffers, without compiling
    runs: tuple[stages.Run, ...]
    against: Mapping[str, Measurement]  # by reference: "truth", and "unoccluded" for a method without visibility
    flip: Flip
    ledger: Any = None  # where the light's power went, of a method that accounts for it; only where files are written


@dataclasses.dataclass(frozen=True)
class Comparison:
    """All methods on one scene against the truth."""

    scene: Scene
    width: int
    height: int
    options: Mapping[str, Any]  # of the frame
    covered: Array  # (h, w) pixels that see a surface: those that count
    references: Mapping[str, Reference]  # "truth", and "unoccluded" where a method needs it
    results: Mapping[str, MethodResult]
    failures: Mapping[str, str]  # method: why it gave no picture
    environment: Mapping[str, Any]

    @functools.cached_property
    def record(self) -> Record:
        """What all pictures share of the record of how they were made."""
        return scene_record(self.scene, self.options, size=(self.width, self.height))

    @property
    def truth(self) -> Reference:
        """The reference with visibility."""
        return self.references[TRUTH]

    @property
    def is_sound(self) -> bool:
        """Whether every method gave a picture without NaN and infinity."""
        return not self.failures and not any(r.against[TRUTH].non_finite for r in self.results.values())

"""What a comparison found: references, methods judged against them, each figure beside what noise alone gives.

A perfect picture compared with a noisy reference does not score zero: its MSE is the mean of v, the variance of the
reference's mean. A figure that does not rise above that expectation says nothing about the picture.
"""

import dataclasses
import functools
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from refgi import stages
from refgi.compare.metrics import (
    METRICS,
    Flip,
    checked_mask,
    count_non_finite,
    decibels,
    over_magnitude,
    relative_scale,
    samples,
    ssim_of_noise,
)
from refgi.compare.pictures import linear_planes
from refgi.errors import expect
from refgi.provenance import Record, method_record, scene_record
from refgi.scene import Scene
from refgi.types import Array

NOISE_MARGIN = 1.1  # a figure is itself random: within 10 % of the expected noise it is noise
BIAS_MARGIN = 2.0  # standard errors: 95 % of what noise alone gives
MEAN_ABS_OF_NORMAL = math.sqrt(2 / math.pi)  # E|z| for a standard normal z

TRUTH, UNOCCLUDED = "truth", "unoccluded"  # names of the references


@dataclasses.dataclass(frozen=True)
class Figure:
    """One figure of error and what a perfect picture would have got; nan where that is not known."""

    value: float
    noise: float = math.nan
    is_noise: bool = False


@dataclasses.dataclass(frozen=True)
class Measurement:
    """All figures of one picture against one reference."""

    figures: dict[str, Figure]
    pixels: int  # compared
    non_finite: int  # pixels of the picture with a NaN or infinite channel; if any, every figure is nan
    non_finite_reference: int


def measure(image: Array, reference: Array, variance: Array | None = None, covered: Array | None = None,
            mean_variance: Array | None = None, *, trusted: bool = True) -> Measurement:
    """Compute every figure, and beside it what the reference's noise alone would give.

    Parameters
    ----------
    image, reference : (3, h, w) ndarray
        Linear RGB in one unit.
    variance : (3, h, w) ndarray, optional
        Variance of the reference's mean, the unit squared.
    covered : (h, w) ndarray of bool, optional
        Pixels to compare; all where absent.
    mean_variance : (3,) ndarray, optional
        Variance of the mean over covered pixels of each channel, which knows how pixels' errors go together; where
        absent they count as independent.
    trusted : bool
        Whether that variance can be trusted: without, no figure is called noise.

    Returns
    -------
    Measurement
        The figures by name. If any compared pixel is not finite, all of them are nan and the count says why.

    Raises
    ------
    InputError
        If shapes differ or no pixel is covered.
    """
    mask = checked_mask(image, reference, covered)
    bad, bad_reference = count_non_finite(image, mask), count_non_finite(reference, mask)
    if bad or bad_reference:
        figures = {name: Figure(math.nan) for name in METRICS}
    else:
        noise = {} if variance is None else noise_figures(image, reference, variance, mask, mean_variance)
        x, r = (row.reshape(3, 1, -1) for row in samples(image, reference, mask))  # gathered once for all but SSIM
        values = {name: f(image, reference, mask) if name == "ssim" else f(x, r, None) for name, f in METRICS.items()}
        figures = {name: _figure(name, value, noise.get(name, math.nan), trusted) for name, value in values.items()}
    return Measurement(figures, int(mask.sum()), bad, bad_reference)


def noise_figures(image: Array, reference: Array, variance: Array, covered: Array | None = None,
                  mean_variance: Array | None = None) -> dict[str, float]:
    """Return what each figure would be if the picture were perfect and the reference as noisy as it is.

    `bias` is the standard error of the reference's mean. Arguments as of `measure`; with `mean_variance` the channels
    count as fully correlated, as they are where they share their samples.
    """
    mask = checked_mask(image, reference, covered)
    expect(variance.shape == reference.shape, "variance", f"shape {reference.shape}", variance.shape)
    x, r = samples(image, reference, mask)
    v = variance[:, mask].astype(np.float64).ravel()
    expect(bool(np.isfinite(v).all() and (v >= 0).all()), "variance", "finite numbers >= 0", "others")
    absolute = MEAN_ABS_OF_NORMAL * np.sqrt(v)
    scale = relative_scale(r)
    return {
        "mse": float(v.mean()),
        "rmse": math.sqrt(float(v.mean())),
        "relmse": float(np.mean(v / scale)) if scale.all() else math.nan,
        "mae": float(absolute.mean()),
        "smape": float(np.mean(np.minimum(over_magnitude(absolute, x, r), 1.0))),
        "bias": math.sqrt(float(v.sum())) / v.size if mean_variance is None else float(np.sqrt(mean_variance).mean()),
        "psnr": decibels(float(r.max()), float(v.mean())),
        "ssim": ssim_of_noise(reference, variance, mask),
    }


def _figure(name: str, value: float, noise: float, trusted: bool) -> Figure:
    if name == "psnr":
        is_noise = value >= noise - 10 * math.log10(NOISE_MARGIN)
    elif name == "ssim":
        is_noise = 1 - value <= NOISE_MARGIN * (1 - noise)
    else:
        is_noise = abs(value) <= (BIAS_MARGIN if name == "bias" else NOISE_MARGIN) * noise
    return Figure(value, noise, trusted and is_noise)  # every comparison with nan is false


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
    lobes: Any = None  # `TruthResult` of receivers' lobes by indirect light, W/m^2/sr, where a glossy surface is seen
    doubt: str = ""  # why the error of the irradiance is not to be trusted

    @property
    def record(self) -> Record:
        """What it adds to the record of its scene."""
        return {**method_record(TRUTH, self.settings), **self.estimate}

    @property
    def planes(self) -> dict[str, Array]:
        """The planes of its EXR, by channel."""
        lobes = {} if self.lobes is None else {"lobes": self.lobes.mean, "lobe_variance": self.lobes.variance_of_mean}
        return linear_planes(self.radiance, self.irradiance, self.variance, self.samples, **lobes)

    @property
    def statement(self) -> str:
        """How well it is known."""
        said: str = self.estimate["estimate"]["statement"]
        return f"{said}; lobes: {self.lobes.doubt}" if self.lobes is not None and self.lobes.doubt else said

    @property
    def whole_doubt(self) -> str:
        """Why an error is not to be trusted, of the irradiance or of lobes, in a line."""
        of_lobes = f"lobes of receivers: {self.lobes.doubt}" if self.lobes is not None and self.lobes.doubt else ""
        return "; ".join(said for said in (self.doubt, of_lobes) if said)

    @property
    def doubts(self) -> list[str]:
        """Why an error is not to be trusted, of the irradiance and of lobes; empty where nothing speaks against it."""
        name = "truth" if self.name == TRUTH else f"truth ({self.name})"
        of_lobes = "" if self.lobes is None else self.lobes.doubt
        return [f"{what}: {said}" for what, said in ((name, self.doubt), (f"lobes of the {name}", of_lobes)) if said]


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
    still: Any = None  # `StillFrames` that it is blended of, of a method with a temporal filter
    frames: Any = None  # (h, w) frames that each pixel is blended of, where they are counted
    lobes: Array | None = None  # (3, h, w) receivers' lobes by indirect light, W/m^2/sr, where a glossy surface is seen
    lobes_against: Mapping[str, Measurement] = dataclasses.field(default_factory=dict)  # figures of lobes, by reference


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

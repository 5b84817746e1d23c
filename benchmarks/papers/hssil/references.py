"""What pictures are judged by: path tracing, the mean of many pictures, their noise, a line across them."""

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from benchmarks.papers.curves import Curve
from benchmarks.papers.hssil.subjects import lit
from refgi.compare.maps import luminance
from refgi.sssil import HssilSettings
from refgi.truth import TruthResult, TruthSettings, trace_truth

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench
    from refgi.frame import Frame

Array = npt.NDArray[Any]

FAR_SEED = 1 << 20  # pictures that others are judged by share no random numbers with them


def noise_of(frame: "Frame", settings: HssilSettings, first: Array | None = None) -> float:
    """Return how noisy a picture is, whatever it is noisy around: by another picture with other random numbers.

    Parameters
    ----------
    frame : Frame
        The scene, seen and lit.
    settings : HssilSettings
        How it is lit.
    first : (3, h, w) ndarray, optional
        The picture, where it is known.

    Returns
    -------
    float
        Standard deviation, W/m^2: root mean square over pixels with a surface.
    """
    one = lit(frame, settings) if first is None else first
    other = lit(frame, dataclasses.replace(settings, seed=settings.seed + 1))
    return math.sqrt(0.5 * np.mean((one.astype(np.float64) - other)[:, frame.gbuffer.covered] ** 2))


def expected_light(frame: "Frame", settings: HssilSettings, seeds: int) -> Array:
    """Return the mean picture of many: what is left when all noise is gone.

    Parameters
    ----------
    frame : Frame
        The scene, seen and lit.
    settings : HssilSettings
        How it is lit.
    seeds : int
        How many pictures.

    Returns
    -------
    (3, h, w) ndarray of float64
        Irradiance, W/m^2. With Eq. 4 it depends on the number of samples: each is a disc as large as its share.
    """
    total = np.zeros((3, frame.height, frame.width))
    for seed in range(seeds):
        total += lit(frame, dataclasses.replace(settings, seed=FAR_SEED + seed))
    return total / seeds


def traced(bench: "Workbench", frame: "Frame", key: Any, **changes: Any) -> Array:
    """Return one bounce by path tracing.

    Parameters
    ----------
    bench : Workbench
        Keeps it, and says how many samples.
    frame : Frame
        The scene, seen.
    key : object
        What tells this frame from others.
    **changes : object
        Settings of truth: which emitters count, and whether anything blocks.

    Returns
    -------
    (3, h, w) ndarray
        Irradiance, W/m^2.
    """
    return _truth(bench, frame, key, **changes).mean


def doubt(bench: "Workbench", frame: "Frame", key: Any, **changes: Any) -> float:
    """Return how noisy path tracing itself is.

    Parameters
    ----------
    bench : Workbench
        As for `traced`.
    frame : Frame
        As for `traced`.
    key : object
        As for `traced`.
    **changes : object
        As for `traced`.

    Returns
    -------
    float
        Standard error in % of the mean irradiance: root mean square over pixels with a surface.
    """
    found, covered = _truth(bench, frame, key, **changes), frame.gbuffer.covered
    error = math.sqrt(float(found.variance_of_mean[:, covered].mean()))
    return 100 * error / max(mean_of(found.mean, covered), 1e-30)


def mean_of(light: Array, covered: Array) -> float:
    """Return the mean irradiance of the pixels with a surface.

    Parameters
    ----------
    light : (3, h, w) ndarray
        Irradiance, W/m^2.
    covered : (h, w) ndarray of bool
        Pixels with a surface.

    Returns
    -------
    float
        Over all channels; 0 where nothing is seen.
    """
    return float(light[:, covered].mean(dtype=np.float64)) if covered.any() else 0.0


def scan_line(name: str, light: Array, row: int, *, dashed: bool = False) -> Curve:
    """Return the luminance along a row of a picture.

    Parameters
    ----------
    name : str
        What the curve is called.
    light : (3, h, w) ndarray
        Irradiance, W/m^2.
    row : int
        Which row.
    dashed : bool
        How it is drawn.

    Returns
    -------
    Curve
        Over the columns, W/m^2.
    """
    values = luminance(light[:, row : row + 1])[0].tolist()
    return Curve(name, range(len(values)), values, dashed)


def _truth(bench: "Workbench", frame: "Frame", key: Any, **changes: Any) -> TruthResult:
    settings = TruthSettings(samples=bench.scale.truth_samples, **changes)
    return bench.once(("traced", key, *sorted(changes.items())), lambda: trace_truth(frame, settings))

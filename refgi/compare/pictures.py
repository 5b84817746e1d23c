"""A picture's files, the same from every command: the planes of its EXR, and its PNG."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.image import write_png
from refgi.provenance import Record

Array = npt.NDArray[Any]

EXPOSED = 98  # percentile that --exposure auto makes white


def linear_planes(radiance: Array, irradiance: Array, variance: Array | None = None,
                  samples: Array | None = None, frames: Array | None = None, lobes: Array | None = None,
                  lobe_variance: Array | None = None) -> dict[str, Array]:
    """Return the float32 planes, (h, w), of a picture's EXR by channel; quantities that are None have none.

    R, G, B: radiance that the camera receives; lobes: the part of receivers' lobes by indirect light, W/m^2/sr.
    irradiance: indirect, W/m^2. variance and lobe_variance: of the means of estimates, the unit squared. samples: how
    many estimates each pixel has; frames: how many its light is blended of.
    """
    planes = rgb_planes("", radiance) | rgb_planes("irradiance.", irradiance)
    if variance is not None:
        planes |= rgb_planes("variance.", variance)
    if samples is not None:
        planes["samples"] = np.asarray(samples, np.float32)
    if frames is not None:
        planes["frames"] = np.asarray(frames, np.float32)
    if lobes is not None:
        planes |= rgb_planes("lobes.", lobes)
    if lobe_variance is not None:
        planes |= rgb_planes("lobe_variance.", lobe_variance)
    return planes


def write_preview(path: Path, radiance: Array, record: Record) -> None:
    """Write radiance as a PNG, tone-mapped at the exposure of its record, whole or not at all.

    InputError if the file cannot be written.
    """
    write_png(path, np.moveaxis(radiance, 0, -1), record["exposure"], record)


def auto_exposure(radiance: Array) -> float:
    """Return the factor that makes a percentile of a picture white: of the largest channel of all that is not black.

    Above 0; 1 where the picture is black.
    """
    brightest = radiance.max(axis=0)
    lit = brightest[np.isfinite(brightest) & (brightest > 0)]
    return float(1.0 / np.percentile(lit.astype(np.float64), EXPOSED)) if len(lit) else 1.0


def rgb_planes(prefix: str, rgb: Array) -> dict[str, Array]:
    """Return the float32 planes of one quantity, (3, h, w), by channel; names start with `prefix`."""
    return {f"{prefix}{channel}": np.asarray(plane, np.float32) for channel, plane in zip("RGB", rgb, strict=True)}

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
    """Return the float32 planes of a picture's EXR.

    Parameters
    ----------
    radiance : (3, h, w) ndarray
        What the camera receives, W/m^2/sr: R, G, B.
    irradiance : (3, h, w) ndarray
        Indirect irradiance, W/m^2: irradiance.R, .G, .B.
    variance : (3, h, w) ndarray, optional
        Of the irradiance where it is the mean of an estimate, (W/m^2)^2: variance.R, .G, .B.
    samples : (h, w) ndarray, optional
        How many of them each pixel has.
    frames : (h, w) ndarray, optional
        Frames that the light of each pixel is blended of.
    lobes : (3, h, w) ndarray, optional
        Radiance of receivers' lobes by indirect light, W/m^2/sr: lobes.R, .G, .B.
    lobe_variance : (3, h, w) ndarray, optional
        Of the lobes where they are the mean of an estimate, (W/m^2/sr)^2: lobe_variance.R, .G, .B.

    Returns
    -------
    dict of str to (h, w) ndarray
        Planes by channel.
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
    """Write a picture as a PNG, tone-mapped at the exposure of its record, whole or not at all.

    Parameters
    ----------
    path : Path
        Where to.
    radiance : (3, h, w) ndarray
        What the camera receives, W/m^2/sr.
    record : dict
        How it was made.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    write_png(path, np.moveaxis(radiance, 0, -1), record["exposure"], record)


def auto_exposure(radiance: Array) -> float:
    """Return the factor that makes a percentile of a picture white: of the largest channel of all that is not black.

    Parameters
    ----------
    radiance : (3, h, w) ndarray
        What the camera receives, W/m^2/sr.

    Returns
    -------
    float
        Above 0; 1 where the picture is black.
    """
    brightest = radiance.max(axis=0)
    lit = brightest[np.isfinite(brightest) & (brightest > 0)]
    return float(1.0 / np.percentile(lit.astype(np.float64), EXPOSED)) if len(lit) else 1.0


def rgb_planes(prefix: str, rgb: Array) -> dict[str, Array]:
    """Return the float32 planes of one quantity.

    Parameters
    ----------
    prefix : str
        What its channels' names start with.
    rgb : (3, h, w) ndarray
        The quantity.

    Returns
    -------
    dict of str to (h, w) ndarray
        Planes by channel.
    """
    return {f"{prefix}{channel}": np.asarray(plane, np.float32) for channel, plane in zip("RGB", rgb, strict=True)}

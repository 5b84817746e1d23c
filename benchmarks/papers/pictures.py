"""Pictures for a paper's page: light as a camera would show it, irradiance alone, maps of one number a pixel."""

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from benchmarks.papers.records import Picture
from refgi.compare import maps
from refgi.compare.report import number
from refgi.image import tone_map

if TYPE_CHECKING:
    from refgi.frame import Frame

Array = npt.NDArray[Any]

WHITE = 0.9  # what the brightest 1 % of the reference's irradiance shows as


def seen(name: str, title: str, said: str, frame: "Frame", irradiance: Array, settings: Any = None) -> Picture:
    """Show what the camera receives: direct light and this indirect light.

    Parameters
    ----------
    name, title, said : str
        File name, heading, line below.
    frame : Frame
        The scene, seen and lit.
    irradiance : (3, h, w) ndarray
        Indirect, W/m^2.
    settings : object, optional
        What it was made with.

    Returns
    -------
    Picture
        Its planes are radiance (R, G, B) and indirect irradiance.
    """
    radiance = frame.radiance(np.asarray(irradiance, frame.dtype))
    planes = dict(zip("RGB", radiance, strict=True)) | _planes(irradiance)
    return Picture(name, title, said, tone_map(np.moveaxis(radiance, 0, -1), frame.scene.exposure), planes, settings)


def indirect(name: str, title: str, said: str, irradiance: Array, exposure: float, settings: Any = None) -> Picture:
    """Show irradiance as on white surfaces.

    Parameters
    ----------
    name, title, said : str
        File name, heading, line below.
    irradiance : (3, h, w) ndarray
        Indirect, W/m^2.
    exposure : float
        Factor before the sRGB curve; `exposure_of` gives one for all pictures of a figure.
    settings : object, optional
        What it was made with.

    Returns
    -------
    Picture
        Its planes are the irradiance.
    """
    return Picture(name, title, said, tone_map(np.moveaxis(irradiance, 0, -1), exposure), _planes(irradiance), settings)


def mapped(name: str, title: str, said: str, values: Array, covered: Array, scale: maps.Scale) -> Picture:
    """Show one number a pixel in a scale's colours.

    Parameters
    ----------
    name, title, said : str
        File name, heading, line below.
    values : (h, w) ndarray
        The numbers.
    covered : (h, w) ndarray of bool
        Pixels with a surface.
    scale : Scale
        Range and colours.

    Returns
    -------
    Picture
        Its one plane, Y, holds the numbers.
    """
    return Picture(name, title, said, maps.paint(values, covered, scale), {"Y": values})


def errors(made: dict[str, tuple[str, Array]], reference: Array, covered: Array) -> list[Picture]:
    """Show signed luminance errors against one reference, all on one scale.

    Parameters
    ----------
    made : dict of str to tuple of str and (3, h, w) ndarray
        Title and irradiance by file name.
    reference : (3, h, w) ndarray
        What is right.
    covered : (h, w) ndarray of bool
        Pixels with a surface.

    Returns
    -------
    list of Picture
        One for each.
    """
    right = maps.luminance(reference)
    signed = {name: maps.luminance(irradiance) - right for name, (_, irradiance) in made.items()}
    scale = maps.error_scale(list(signed.values()), covered)
    said = f"red too bright, blue too dark, full colour at {number(scale.high)} W/m²"
    return [mapped(f"{name}_error", f"error of {made[name][0]}", said, values, covered, scale)
            for name, values in signed.items()]


def exposure_of(reference: Array, covered: Array) -> float:
    """Return the exposure at which a reference's irradiance just fits.

    Parameters
    ----------
    reference : (3, h, w) ndarray
        Irradiance, W/m^2.
    covered : (h, w) ndarray of bool
        Pixels with a surface.

    Returns
    -------
    float
        1 for a black picture.
    """
    bright = float(np.percentile(maps.luminance(reference)[covered], 99)) if covered.any() else 0.0
    return WHITE / bright if bright > 0 else 1.0


def _planes(irradiance: Array) -> dict[str, Array]:
    return {f"irradiance.{channel}": plane for channel, plane in zip("RGB", irradiance, strict=True)}

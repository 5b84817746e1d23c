"""A picture's files, the same from every command, and maps of one number a pixel in colours.

All methods of a comparison share one scale, so equal colours mean equal errors. What is beyond the scale takes the
last colour; a pixel without surface is grey, and one that is not finite magenta.
"""

import io
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.compare.metrics import LUMINANCE
from refgi.image import NOT_FINITE, write_png
from refgi.provenance import Record
from refgi.types import Array

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
    for name, values in (("variance", variance), ("samples", samples), ("frames", frames), ("lobes", lobes),
                         ("lobe_variance", lobe_variance)):
        if values is not None:
            planes |= {name: np.asarray(values, np.float32)} if values.ndim == 2 else rgb_planes(f"{name}.", values)
    return planes


def write_preview(path: Path, radiance: Array, record: Record) -> None:
    """Write radiance as a PNG, tone-mapped at the exposure of its record, whole or not at all."""
    write_png(path, np.moveaxis(radiance, 0, -1), record["exposure"], record)


def auto_exposure(radiance: Array) -> float:
    """Return the factor that makes the 98th percentile of the largest channel white; 1 for a black picture."""
    brightest = radiance.max(axis=0)
    lit = brightest[np.isfinite(brightest) & (brightest > 0)]
    return float(1.0 / np.percentile(lit.astype(np.float64), EXPOSED)) if len(lit) else 1.0


def rgb_planes(prefix: str, rgb: Array) -> dict[str, Array]:
    """Return the float32 planes of one quantity, (3, h, w), by channel; names start with `prefix`."""
    return {f"{prefix}{channel}": np.asarray(plane, np.float32) for channel, plane in zip("RGB", rgb, strict=True)}


def rgb_of(planes: Mapping[str, Array], prefix: str) -> Array:
    """Return one quantity, (3, h, w), of planes by channel; the reverse of `rgb_planes`."""
    return np.stack([planes[f"{prefix}{channel}"] for channel in "RGB"])


Pixels = npt.NDArray[np.uint8]

DIVERGING, SEQUENTIAL = "RdBu_r", "inferno"
NO_SURFACE = (128, 128, 128)
SCALE_PERCENTILE = 95.0  # of all methods' absolute errors: a few fireflies do not wash out the maps
FALSE_COLOUR_STOPS = 6.0  # below the brightest 0.5 %
INDIRECT_WHITE = 0.9  # what the brightest 1 % of the reference's irradiance shows as


class Scale(NamedTuple):
    """A colour map over a range of numbers."""

    low: float
    high: float
    colours: str  # a name of matplotlib's
    label: str
    logarithmic: bool = False


def luminance(rgb: Array) -> Array:
    """Return the luminance of linear sRGB, (3, h, w), in its unit: 0.2126 R + 0.7152 G + 0.0722 B, float64 (h, w)."""
    weights = np.array(LUMINANCE)
    weighted: Array = np.einsum("c,chw->hw", weights, rgb.astype(np.float64))
    return weighted


def indirect_exposure(reference: Array, covered: Array) -> float:
    """Return the factor at which a reference's irradiance, (3, h, w), just fits; 1 for a black picture."""
    values = luminance(reference)[covered]
    values = values[np.isfinite(values)]
    bright = float(np.percentile(values, 99)) if values.size else 0.0
    return INDIRECT_WHITE / bright if bright > 0 else 1.0


def error_scale(errors: list[Array], covered: Array) -> Scale:
    """Choose one scale from -s to s for all maps; s, 1, 2 or 5 times a power of ten, holds 95 % of the errors."""
    magnitudes = np.abs(np.concatenate([error[covered] for error in errors] or [np.zeros(1)]))
    magnitudes = magnitudes[np.isfinite(magnitudes)]
    reach = float(np.percentile(magnitudes, SCALE_PERCENTILE)) if magnitudes.size else 0.0
    limit = _round_up(reach) if reach > 0 else 1.0
    return Scale(-limit, limit, DIVERGING, "too dark / too bright, W/m²")


def luminance_scale(reference: Array, covered: Array) -> Scale:
    """Choose one logarithmic scale: six stops up to the 99.5th percentile of the truth's luminance."""
    values = luminance(reference)[covered]
    values = values[np.isfinite(values) & (values > 0)]
    high = _round_up(float(np.percentile(values, 99.5))) if values.size else 1.0
    return Scale(high / 2**FALSE_COLOUR_STOPS, high, SEQUENTIAL, "luminance of indirect irradiance, W/m²", True)


def paint(values: Array, covered: Array, scale: Scale) -> Pixels:
    """Colour a map, (h, w), by a scale: display colours (h, w, 3), uint8."""
    finite = np.isfinite(values)
    positions = _position(np.where(finite, values, scale.low), scale)
    pixels: Pixels = (_colours(scale)(positions)[..., :3] * 255 + 0.5).astype(np.uint8)
    pixels[covered & ~finite] = NOT_FINITE
    pixels[~covered] = NO_SURFACE
    return pixels


def gradient(scale: Scale, stops: int = 9) -> list[str]:
    """Return evenly spaced colours of a scale as CSS writes them, such as ``#b2182b``, low to high."""
    from matplotlib.colors import to_hex

    colours = _colours(scale)
    return [to_hex(colours(position)) for position in np.linspace(0, 1, stops)]


def with_legend(pixels: Pixels, scale: Scale, title: str) -> bytes:
    """Return a PNG of a map that `paint` painted by `scale`, beside its colour bar and below its title."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LogNorm, Normalize
    from matplotlib.figure import Figure

    height, width = pixels.shape[:2]
    figure = Figure(figsize=(7.0, max(1.5, 5.6 * min(height / width, 3))), layout="constrained", dpi=120)
    axes = figure.add_subplot()
    axes.imshow(pixels, interpolation="nearest")
    axes.set_axis_off()
    axes.set_title(title, fontsize=10)
    norm = (LogNorm if scale.logarithmic else Normalize)(scale.low, scale.high)
    bar = figure.colorbar(ScalarMappable(norm, scale.colours), ax=axes, extend="both", fraction=0.05)
    bar.set_label(scale.label, fontsize=9)
    stream = io.BytesIO()
    canvas: Any = FigureCanvasAgg(figure)
    canvas.print_png(stream, metadata={"Software": None})
    return stream.getvalue()


def _position(values: Array, scale: Scale) -> Array:
    if scale.logarithmic:
        values = np.log(np.maximum(values, scale.low))
        return np.clip((values - math.log(scale.low)) / math.log(scale.high / scale.low), 0, 1)
    return np.clip((values - scale.low) / (scale.high - scale.low), 0, 1)


def _colours(scale: Scale) -> Any:
    import matplotlib

    return matplotlib.colormaps[scale.colours]


def _round_up(value: float) -> float:
    power = 10.0 ** math.floor(math.log10(value))
    return next(step * power for step in (1, 2, 5, 10) if step * power >= value * (1 - 1e-12))

"""How much light the threshold takes from a picture: what the picture holds at some pixels, and what it would uncut."""

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.pairs.irradiance import Receivers
from refgi.pairs.loss import light_at, lost_share, sample_for, warn_of_loss
from refgi.splat.settings import SplatSettings
from refgi.stages import stage

if TYPE_CHECKING:
    from refgi.lights import PixelLights

Array = npt.NDArray[Any]


@stage("splat.cut_loss")
def cut_loss(
    light: Array, receivers: Receivers, lights: "PixelLights", settings: SplatSettings, footprint: Array | None = None
) -> float:
    """Return the share of the light that the threshold leaves out of a picture.

    Parameters
    ----------
    light : (3, h, w) ndarray
        The picture's irradiance, W/m^2.
    receivers : Receivers
        Its points.
    lights : PixelLights
        Its lights.
    settings : SplatSettings
        How one light lights one receiver.
    footprint : (N,) ndarray, optional
        Surface area each light stands for, m^2; needed by the clamps "disc" and "sphere" alone.

    Returns
    -------
    float
        Of the light without visibility, at sampled pixels.
    """
    sample = sample_for(receivers, lights)
    kept = light.reshape(3, -1)[:, sample.place]
    whole = light_at(sample, lights, settings, footprint)
    return lost_share(whole, float(kept.mean(dtype=np.float64))) if kept.size else 0.0


def warn_of_cut(
    light: Array, receivers: Receivers, lights: "PixelLights", settings: SplatSettings, footprint: Array | None
) -> None:
    """Warn where the threshold of `sii` leaves out more than `LEAST_LOSS` of the light.

    Parameters
    ----------
    light : (3, h, w) ndarray
        The picture's irradiance, W/m^2.
    receivers : Receivers
        Its points.
    lights : PixelLights
        Its lights.
    settings : SplatSettings
        The threshold. A random range takes no light in the mean and is passed over.
    footprint : (N,) ndarray or None
        Surface area each light stands for, m^2.

    Warns
    -----
    RefgiWarning
        With setting and share.
    """
    if not settings.cuts or settings.stochastic_range:
        return
    said = (f"i_low {settings.i_low:g} with reference_length {settings.reference_length:.3g} m"
            if settings.irradiance_low is None else f"irradiance_low {settings.irradiance_low:g} W/m^2")
    warn_of_loss(cut_loss(light, receivers, lights, settings, footprint), f"sii: {said}")

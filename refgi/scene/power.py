"""Lights that shine: one without power is left out, with a count, and a scene needs at least one."""

import warnings
from collections.abc import Sequence

from refgi.errors import RefgiWarning, expect
from refgi.scene.model import DirectionalLight, Light


def shining(lights: Sequence[Light], where: str) -> tuple[Light, ...]:
    """Return the lights that have power.

    Parameters
    ----------
    lights : sequence of Light
        All lights of a scene.
    where : str
        File and key, for texts.

    Returns
    -------
    tuple of Light
        In the given order, at least one.

    Raises
    ------
    InputError
        If none has power: the picture would be silently black.
    """
    kept = tuple(light for light in lights if max(_power(light)) > 0)
    expect(bool(kept), where, "at least one light of power above 0", f"{len(lights)} without" if lights else "none")
    if dropped := len(lights) - len(kept):
        noun = "light" if dropped == 1 else "lights"
        warnings.warn(RefgiWarning(f"{where}: {dropped} {noun} of zero power left out"), stacklevel=3)
    return kept


def _power(light: Light) -> tuple[float, float, float]:
    return light.irradiance if isinstance(light, DirectionalLight) else light.intensity

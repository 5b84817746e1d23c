"""Importance of texels for warping: flux, flux times lobe peak, and both times (1 - openness) (SII Sec. 3.5).

A texel's importance is the largest channel of Phi_diffuse + g(P) Phi_lobe. The largest channel is zero only where all
of the flux is, so no flux is out of reach. g(P) = (P + 1) / 2 is the peak of a normalised Phong lobe over that of a
diffuse light, 1 for P = 1; the paper takes P.
"""

from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.jit import kernel
from refgi.rsm.reflective import Rsm
from refgi.stages import stage

Array = npt.NDArray[Any]
Kind = Literal["flux", "peak", "openness"]


@stage("rsm.importance")
def importance(
    rsm: Rsm, kind: Kind = "flux", openness: Array | None = None, floor: float = 0.05, defensive: float = 0.0
) -> Array:
    """Return what each texel is worth to `warp_samples`.

    Parameters
    ----------
    rsm : Rsm
        The map.
    kind : {"flux", "peak", "openness"}
        Phi; Phi g(P); or Phi g(P) max(floor, 1 - O).
    openness : (H, W) ndarray, optional
        Share O of unoccluded directions, 0 to 1, for the kind "openness".
    floor : float
        Least factor that openness leaves, 0 to 1. With 0 texels in the open are never chosen and their flux is lost.
    defensive : float
        Share beta, 0 to 1, of the samples that are uniform over the map.

    Returns
    -------
    (H, W) ndarray
        W, dtype of the map.

    Raises
    ------
    InputError
        If a name is unknown, a number out of range, or openness is missing or of another shape.

    Notes
    -----
    p = Phi (1 - O) P is zero where O = 1: the estimate then lacks that flux, hence the floor.

    With method A a texel's density is at least beta of the uniform one on every level, so for any f the mean of
    (w Phi f)^2 is at most 1 / beta times that of uniform samples, and the variance at most
    1 / beta Var + (1 / beta - 1) mean^2. Uniform over the map, not over its lit texels alone, because a cell's
    samples spread over all of its texels unless the warp goes down to them. Method B takes products of marginals:
    there the share keeps every texel within reach but gives no such bound.
    """
    expect(kind in get_args(Kind), "kind", " or ".join(get_args(Kind)), kind)
    expect(0 <= floor <= 1, "floor", "0 to 1", floor)
    expect(0 <= defensive <= 1, "defensive", "0 to 1", defensive)
    real = rsm.flux.dtype.type
    if rsm.lobe_flux is None or rsm.lobe_exponent is None:
        worth: Array = rsm.flux.max(axis=0)
    else:
        worth = np.empty_like(rsm.flux[0])
        _add_lobes(rsm.flux, rsm.lobe_flux, rsm.lobe_exponent, kind != "flux", worth)
    if kind == "openness":
        worth = worth * _hidden(rsm, openness, real(floor))
    if defensive:
        worth = real(1 - defensive) * worth + real(defensive * worth.mean(dtype=np.float64))
    return worth


@kernel
def _add_lobes(flux: Array, lobe_flux: Array, exponent: Array, by_peak: bool, worth: Array) -> None:
    """Fill the largest channel of Phi_diffuse + g(P) Phi_lobe; g = 1 unless `by_peak`."""
    real = worth.dtype.type
    one, half = real(1), real(0.5)
    for row in range(worth.shape[0]):
        for column in range(worth.shape[1]):
            peak = half * (exponent[row, column] + one) if by_peak else one
            most = real(0)
            for c in range(3):
                most = max(most, flux[c, row, column] + peak * lobe_flux[c, row, column])
            worth[row, column] = most


def _hidden(rsm: Rsm, openness: Array | None, floor: Any) -> Array:
    """Return max(floor, 1 - O)."""
    if openness is None or np.shape(openness) != rsm.depth.shape:
        expect(False, "openness", f"shape {rsm.depth.shape} for the kind 'openness'",
               None if openness is None else np.shape(openness))
        raise AssertionError
    expect(bool(((openness >= 0) & (openness <= 1)).all()), "openness", "numbers from 0 to 1", "others")
    hidden: Array = np.maximum(1 - openness, floor).astype(rsm.flux.dtype)
    return hidden

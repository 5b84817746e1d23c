"""The sum over area lights under their visibility, as a port gets it wrong (VAL Sec. 4)."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from refgi.vectors.spec import Array, Arrays, Bug, Run

SUM = "E = sum V_m E_m over all area lights"
Joined = Callable[[Array, Array], Array]  # of E_m (M, 3, h, w) and V_m (M, 1, h, w)


def _first_index(array: Array, index: int) -> Array:
    return np.repeat(array[[index]], len(array), axis=0)


def _without(parts: Array, share: Array, index: int) -> Array:
    return np.asarray(np.delete(parts * share, index, axis=0).sum(axis=0))


def _nearest_pixel(share: Array, step: int, axis: int) -> Array:
    return np.roll(share, step, axis=axis)


def _of_three(share: Array) -> Array:
    """Return V as by an index of all channels that counts on over the plane: of (M, 3, h, w)."""
    flat = share.reshape(-1)
    wide = np.arange(3 * len(flat)) % len(flat)
    return np.asarray(flat[wide].reshape(len(share), 3, *share.shape[2:]))


SUMS: Mapping[str, Joined] = {
    "the last cluster's (area light's) light replaces that of the others: overwritten, not accumulated":
        lambda parts, share: parts[-1] * share[-1],
    "the first cluster (area light) alone": lambda parts, share: parts[0] * share[0],
    "the last cluster (area light) is left out: one too few": lambda parts, share: _without(parts, share, -1),
    "the first cluster (area light) is left out: counted from 1": lambda parts, share: _without(parts, share, 0),
    "the hidden share in place of the visible one: 1 - V": lambda parts, share: (parts * (1 - share)).sum(axis=0),
    "the hidden light is subtracted once more: 2 V - 1": lambda parts, share: (parts * (2 * share - 1)).sum(axis=0),
    "V is added, not multiplied": lambda parts, share: (parts + share).sum(axis=0),
    "light is divided by V, not multiplied": lambda parts, share: (parts / np.maximum(share, 1e-6)).sum(axis=0),
    "the first area light's V for all": lambda parts, share: (parts * _first_index(share, 0)).sum(axis=0),
    "the last area light's V for all": lambda parts, share: (parts * _first_index(share, -1)).sum(axis=0),
    "the mean V of all area lights times the sum": lambda parts, share: parts.sum(axis=0) * share.mean(axis=0),
    "the product of all V times the sum": lambda parts, share: parts.sum(axis=0) * share.prod(axis=0),
    "the least V of all area lights times the sum": lambda parts, share: parts.sum(axis=0) * share.min(axis=0),
    "divided by the sum of V: a weighted mean": lambda parts, share: (parts * share).sum(axis=0) / np.maximum(
        share.sum(axis=0), 1e-6),
    "the brightest area light in place of the sum": lambda parts, share: (parts * share).max(axis=0),
    "V by a threshold of 0.5: hidden or seen": lambda parts, share: (parts * (share >= 0.5)).sum(axis=0),
    "V by any hidden texel: below 1 is dark": lambda parts, share: (parts * (share >= 1)).sum(axis=0),
    "the root of V": lambda parts, share: (parts * np.sqrt(share)).sum(axis=0),
    "V is counted from the area light after it: shifted by one": lambda parts, share: (
        parts * np.roll(share, -1, axis=0)).sum(axis=0),
    "V of area lights in reverse order": lambda parts, share: (parts * share[::-1]).sum(axis=0),
    "V of the next pixel (column)": lambda parts, share: (parts * _nearest_pixel(share, -1, 3)).sum(axis=0),
    "V of the pixel before (column)": lambda parts, share: (parts * _nearest_pixel(share, 1, 3)).sum(axis=0),
    "V of the next row": lambda parts, share: (parts * _nearest_pixel(share, -1, 2)).sum(axis=0),
    "V of the row before": lambda parts, share: (parts * _nearest_pixel(share, 1, 2)).sum(axis=0),
    "V upside down: its rows run upwards": lambda parts, share: (parts * share[:, :, ::-1]).sum(axis=0),
    "V mirrored: its columns run leftwards": lambda parts, share: (parts * share[..., ::-1]).sum(axis=0),
    "V's index counts on over the three channels: planes of other area lights": lambda parts, share: (
        parts * _of_three(share)).sum(axis=0),
    "the red channel alone is shadowed by V": lambda parts, share: (
        parts * np.concatenate([share, 1 + 0 * share, 1 + 0 * share], axis=1)).sum(axis=0),
    "light without V is added once more: double counting": lambda parts, share: (parts * (1 + share)).sum(axis=0),
    "every second area light is left out": lambda parts, share: (parts * share)[::2].sum(axis=0),
}


def sum_bugs() -> tuple[Bug, ...]:
    """Return likely bugs of the sum."""
    return tuple(Bug(cause, summed_by(how), SUM) for cause, how in SUMS.items())


def summed_by(how: Joined) -> Run:
    """Return the sum as a port writes it."""
    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
        parts, share = (np.asarray(arrays[name], np.float64) for name in ("parts.irradiance", "visibility.share"))
        return {"sum.irradiance": how(parts, share[:, None])}

    return run

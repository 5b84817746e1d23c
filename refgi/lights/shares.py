"""How many pixel lights each lamp gets: in proportion to the flux that its map's surfaces reflect, none where it is 0.

The count is a total over all lamps. Where it suffices each lamp with flux has at least one light, and its lights carry
T/N of their texels' flux. Where lamps outnumber lights the count is drawn from the lamps by systematic sampling, n_i
lights of lamp i with the mean q_i = count Phi_i / Phi, and its lights carry n_i / q_i more: the mean over seeds is the
flux of all lamps. The grid pattern draws the k m^2 texels nearest to a share, m x m on each of a map's k faces.

Symbols: Phi_i flux of lamp i (W, all channels), q_i its quota of the count.
"""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from refgi.errors import expect
from refgi.rsm.buffers.extent import texel_grid
from refgi.rsm.buffers.gbuffer import values_at
from refgi.sampling import PARTS, PIXEL_LIGHTS, draws
from refgi.stages import skip, stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.rsm import Rsm
Pattern = Literal["grid", "halton", "all", "random"]

SIDE = 128  # texels along a side of a map of which the flux is summed: a share need not be exact to be unbiased
SAME = 1e-9  # quotas that differ by rounding are equal


class MapShare(NamedTuple):
    """What is drawn from one map."""

    drawn: int  # texels, those without flux included
    gain: float = 1.0  # what its lights carry beside T/N: n_i / q_i where lamps are drawn
    place: int = 0  # among the maps with flux, which numbers its stream of points


@stage("lights.map_flux")
def map_flux(rsm: "Rsm") -> float:
    """Return the flux that the surfaces of a map reflect, by its diffuse part and by lobes, all channels together.

    -> float: W, from a grid of texels, 128 x 128 of each face; of all texels where those have none.
    """
    texel = texel_grid(rsm.covered, SIDE)
    found = _flux_at(rsm, texel) * (rsm.texels / len(texel))
    return found if found > 0 else _flux_at(rsm, np.arange(rsm.texels))


def _flux_at(rsm: "Rsm", texel: Array) -> float:
    (flux,) = rsm.at(texel, "flux")
    lobe = rsm.lobe_flux
    glossy = 0.0 if lobe is None else float(values_at(lobe, texel).sum(dtype=np.float64))
    return float(flux.sum(dtype=np.float64)) + glossy


@stage("lights.shares")
def map_shares(rsms: "Sequence[Rsm]", count: int | None, pattern: Pattern, seed: int = 0) -> list[MapShare]:
    """Return how many texels are drawn from each map.

    count: How many are asked for, over all maps; None with pattern "all".
    pattern: As for `choose_pixel_lights`.
    seed: Which lamps are drawn where there are fewer lights than lamps.
    -> list of MapShare: One a map. The numbers sum to the count, but for the grid, whose m x m cells on each of a map's
        faces come as near to the map's share as they can.

    Raises
    ------
    InputError
        If the count does not suit the pattern.
    """
    if pattern == "all":
        total = sum(rsm.texels for rsm in rsms)
        expect(count is None or count == total, "count", f"None or {total} with pattern 'all'", count)
        return [MapShare(rsm.texels) for rsm in rsms]
    expect(isinstance(count, int | np.integer) and count >= 1, "count", "an integer, at least 1", count)
    assert count is not None
    flux = np.ones(1) if len(rsms) == 1 else np.array([map_flux(rsm) for rsm in rsms])
    shares, gains = lamp_shares(int(count), flux, seed)
    place = np.maximum(np.cumsum(flux > 0) - 1, 0).tolist() if flux.any() else range(len(rsms))
    cells = shares if pattern != "grid" else [
        _nearest_grid(share, rsm.projection.maps) if share else 0 for share, rsm in zip(shares, rsms, strict=True)]
    if cells != shares:
        skip("lights.grid_cells", f"{sum(cells)} texels for {count}: n x n on each map of {len(rsms)} lights")
    return [MapShare(*one) for one in zip(cells, gains, place, strict=True)]


def lamp_shares(count: int, flux: Array, seed: int = 0) -> tuple[list[int], list[float]]:
    """Return the number of lights of each lamp, which sum to the count, and what they carry beside their share.

    `flux` (n,) is the lamps', W; lamps without any share the count equally where none has any. `seed`: which lamps are
    drawn where there are fewer lights than lamps with flux.

    >>> lamp_shares(8, np.array([3.0, 0.0, 1.0]))[0]
    [6, 0, 2]
    """
    flux = flux if flux.any() else np.ones(len(flux))
    if count < np.count_nonzero(flux):
        quota = count * flux / flux.sum()
        shares = _systematic(quota, float(draws(seed, PIXEL_LIGHTS, 1, PARTS - 1)[0]))
        return shares.tolist(), np.divide(shares, quota, out=np.ones(len(flux)), where=shares > 0).tolist()
    return _in_proportion(count, flux).tolist(), [1.0] * len(flux)


def _in_proportion(count: int, flux: Array) -> Array:
    """Return whole shares of a count in proportion to flux, at least 1 where there is any; of equal ones first more."""
    least, more = np.zeros(len(flux), np.int64), flux > 0
    while True:
        quota = (count - least.sum()) * np.where(more, flux, 0) / flux[more].sum()
        below = more & (quota < 1 - SAME)
        if not below.any():
            break
        least[below], more = 1, more & ~below
    shares = np.floor(quota + SAME).astype(np.int64)
    order = np.argsort(-np.round(quota - shares, 9), kind="stable")
    shares[order[: count - least.sum() - shares.sum()]] += 1
    return np.asarray(least + shares)


def _systematic(quota: Array, start: float) -> Array:
    """Return how many of the points start, start + 1 .. fall into each of the stretches that quotas make of a line."""
    ends = np.cumsum(quota)
    ends[-1] = round(ends[-1])
    return np.asarray(np.diff(np.ceil(np.concatenate([[0.0], ends]) - start).astype(np.int64)))


def _nearest_grid(share: int, maps: int) -> int:
    """Return the number of cells nearest to a share that puts n x n on each of some maps; of two the smaller."""
    below = max(1, math.isqrt(share // maps))
    return min((maps * n * n for n in (below, below + 1)), key=lambda cells: abs(cells - share))

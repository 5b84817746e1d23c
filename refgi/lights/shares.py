"""How many lights each lamp gets, by the flux its map reflects, and the cells and areas that lights of a map stand for.

Lights of a lamp carry T/N of their texels' flux. Where lamps outnumber lights the count is drawn by systematic
sampling, n_i lights of lamp i with the mean q_i = count Phi_i / Phi, and its lights carry n_i / q_i more. Cells
partition a map's texels, one per chosen texel, for filtered flux (SII Sec. 4); the surface behind a texel is
A = O d^2 / cos (m^2), O its solid angle (sr). `with_equal_solid_angles` is the map as the papers print it, too dim
inside and too bright outside (Nichols and Wyman 2009, Fig. 13).
"""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from refgi.errors import expect
from refgi.jit import kernel, prange
from refgi.rsm.buffers.extent import texel_grid
from refgi.rsm.raster.projection import Projection
from refgi.sampling import PARTS, PIXEL_LIGHTS, draws
from refgi.stages import skip, stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.pairs.pixel_lights import PixelLights
    from refgi.rsm import Rsm
    from refgi.scene.model import Light

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
    flux, lobe = rsm.at(texel, "flux", "lobe_flux")
    glossy = 0.0 if lobe is None else float(lobe.sum(dtype=np.float64))
    return float(flux.sum(dtype=np.float64)) + glossy


@stage("lights.shares")
def map_shares(rsms: "Sequence[Rsm]", count: int | None, pattern: Pattern, seed: int = 0) -> list[MapShare]:
    """Return how many texels are drawn from each map.

    count: How many are asked for, over all maps; None with pattern "all".
    pattern: As for `choose_pixel_lights`.
    seed: Which lamps are drawn where there are fewer lights than lamps.
    -> list of MapShare: One a map. The numbers sum to the count, but for the grid, whose m x m cells on each of a map's
        faces come as near to the map's share as they can.

    Raises `InputError` if the count does not suit the pattern.
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


NOWHERE = 1 << 62  # where a column has no chosen texel
LEAST_COSINE = 1e-3  # at grazing angles areas would grow without limit
DEMO_CONSTANT = 1.5  # pi over the 2 pi / 3 sr of a square 90 degree frustum


def cells_of_grid(maps: Projection, count: int) -> Array:
    """Return the cell (H * W,) of each texel's centre, of `count` = k n^2: n x n on each of k maps, row by row."""
    n = math.isqrt(count // maps.maps)
    shorter = min(maps.height, maps.width)
    expect(n <= shorter, "count", f"at most {maps.maps * shorter**2} with filtering", count)
    row = (2 * np.arange(maps.height) + 1) * n // (2 * maps.height)
    column = (2 * np.arange(maps.width) + 1) * n // (2 * maps.width)
    one = row[:, None] * n + column
    return np.ravel(np.add.outer(np.arange(maps.maps) * (n * n), one))


def cells_of_nearest(maps: Projection, texel: Array) -> Array:
    """Return the index into `texel` (N,) of the chosen texel nearest to each texel, (H * W,).

    On its own map as long as that has one; of equal or equally near ones the first gets the texel.
    """
    unique, first = np.unique(texel, return_index=True)
    nearest = np.full(math.prod(maps.shape), NOWHERE)  # square of the distance, times N, plus the index
    nearest[unique] = first
    nearest = nearest.reshape(maps.shape)
    row = np.arange(len(nearest))
    line = row + row // maps.height * (4 * (maps.height + maps.width))  # keeps stacked maps from being neighbours
    above, below = (np.where(nearest < NOWHERE, row[:, None], none) for none in (-1, len(row)))
    for here in row[1:]:  # not `accumulate`, which takes columns one by one
        np.maximum(above[here - 1], above[here], out=above[here])
        np.minimum(below[-here], below[-here - 1], out=below[-here - 1])
    cell = np.empty_like(nearest)
    _fill_nearest(nearest, line, above, below, len(texel), cell)
    return cell.reshape(-1)


@kernel(parallel=True)
def _fill_nearest(chosen: Array, line: Array, above: Array, below: Array, count: int, cell: Array) -> None:
    """Fill the nearest of the nearest texels of each column, all columns d apart at once."""
    height, width = chosen.shape
    for row in prange(height):
        own, least = np.empty(width, np.int64), cell[row]
        for x in range(width):
            own[x] = NOWHERE
            for other in (above[row, x], below[row, x]):
                if 0 <= other < height:
                    own[x] = min(own[x], (line[other] - line[row]) ** 2 * count + chosen[other, x])
        least[:] = own
        d, most = 1, NOWHERE
        while d < width and d * d <= most:
            left, right, off = least[d:], own[d:], d * d * count
            for x in range(len(left)):
                least[x] = min(least[x], right[x] + off)
            for x in range(len(left)):
                left[x] = min(left[x], own[x] + off)
            d, most = d + 1, 0
            for x in range(width):
                most = max(most, least[x])
            most //= count
        for x in range(width):
            least[x] %= count


def cell_sums(flux: Array, cell: Array, count: int) -> Array:
    """Return the flux of each cell, (3, count) W, summed in float64: flux (3, H, W), cell of each texel (H * W,)."""
    sums = [np.bincount(cell, channel.reshape(-1), minlength=count) for channel in flux]
    return np.stack(sums).astype(flux.dtype)


def texels_with_flux(texel: Array, cell: Array, has_flux: Array) -> Array:
    """Return the texel that stands for each cell: the chosen one (N,), or if that is dark the nearest with flux.

    As `texel` where the whole cell is dark; of equally near texels the first.
    """
    width = has_flux.shape[1]
    emits = has_flux.reshape(-1)
    candidates = np.flatnonzero(emits & ~emits[texel][cell])
    own = texel[cell[candidates]]
    square = (candidates // width - own // width) ** 2 + (candidates % width - own % width) ** 2
    order = np.lexsort((candidates, square, cell[candidates]))
    cells, first = np.unique(cell[candidates][order], return_index=True)
    moved = texel.copy()
    moved[cells] = candidates[order][first]
    return moved


def texel_areas(rsm: "Rsm", texel: Array) -> Array:
    """Return the surface behind each of some texels (n,) that reflects anything, m^2 in the map's dtype; else 0.

    A directional light's texels have an area in place of a solid angle, and d is 1.
    """
    from refgi.scene import DirectionalLight

    light = rsm.light
    far = isinstance(light, DirectionalLight)
    source = np.asarray(light.direction if isinstance(light, DirectionalLight) else light.position, np.float64)
    position, normal, solid_angle, flux, lobe = rsm.at(
        texel, "position", "normal", "solid_angle", "flux", "lobe_flux")
    return areas_of(position, normal, solid_angle, flux, lobe, source, far)


def areas_of(
    position: Array, normal: Array, solid_angle: Array, flux: Array, lobe: Array | None, source: Array, far: bool
) -> Array:
    """Return the surface behind texels (n,), m^2, of those that reflect; `far`: `source` (3,) is a direction."""
    areas = np.zeros_like(solid_angle)
    _fill_areas(position, normal, solid_angle, flux, lobe, source, far, areas)
    return areas


@kernel(parallel=True)
def _fill_areas(
    position: Array, normal: Array, solid_angle: Array, flux: Array, lobe: Array | None, source: Array, far: bool,
    areas: Array,
) -> None:
    for i in prange(len(areas)):
        reflected = flux[0, i] != 0 or flux[1, i] != 0 or flux[2, i] != 0
        if lobe is not None:
            reflected = reflected or lobe[0, i] != 0 or lobe[1, i] != 0 or lobe[2, i] != 0
        if reflected:
            square, along = 0.0, 0.0
            for axis in range(3):
                d = source[axis] - (0.0 if far else float(position[axis, i]))
                square += d * d
                along += d * normal[axis, i]
            cosine = abs(along) / np.sqrt(square) if square > 0.0 else 0.0
            areas[i] = solid_angle[i] * (1.0 if far else square) / max(cosine, LEAST_COSINE)


def with_equal_solid_angles(rsm: "Rsm") -> "Rsm":
    """Return a map with the flux its texels would have if all that the light reaches subtended the same solid angle.

    Diffuse flux, lobes and the areas behind texels follow that angle; that of the whole map is unchanged.
    """
    from refgi.rsm.buffers.light_projection import incident_flux

    exact = rsm.solid_angle
    inside = incident_flux(rsm.light, rsm.projection, exact, exact.dtype).any(axis=0)
    mean = exact[inside].sum(dtype=np.float64) / max(1, np.count_nonzero(inside))
    equal = np.where(inside, mean, exact).astype(exact.dtype)
    factor = np.divide(equal, exact, out=np.zeros_like(exact), where=inside)
    lobe = None if rsm.lobe_flux is None else rsm.lobe_flux * factor
    return rsm._replace(solid_angle=equal, flux=rsm.flux * factor, lobe_flux=lobe)


def demo_footprints(lights: "PixelLights", sources: "Sequence[Light]", shares: "Sequence[int]") -> Array:
    """Return the disc that each light of maps stands for in the authors' demo: pi L^2 / (1.5 N), (N',), m^2.

    That is the area of equal shares of a square 90 degree frustum, at normal incidence. `sources` are the light of each
    map, `shares` N: how many texels were drawn from each. `InputError` if a light is directional: it has no distance L.
    """
    area = np.zeros(lights.position.shape[1])
    for index, (source, count) in enumerate(zip(sources, shares, strict=True)):
        place = getattr(source, "position", None)
        expect(place is not None, "as_published", "no 'ams_disc' under a directional light", "ams_disc")
        mine = lights.map_index == index
        away = lights.position[:, mine] - np.asarray(place, np.float64)[:, None]
        area[mine] = np.pi / (DEMO_CONSTANT * max(1, count)) * (away**2).sum(axis=0)
    return area

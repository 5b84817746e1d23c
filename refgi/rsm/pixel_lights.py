"""Pixel lights: texels of reflective shadow maps taken as point lights (papers.md section 0 and procedure P1).

N texels of a map of T are chosen with equal chance, so each stands for T/N texels: Phi_i = Phi_t T / N. Texels
without flux count in N but are dropped from the list. `filtered` replaces T/N times one texel's flux by the sum over
the texel's cell (SII's filtered flux look-up); the cells partition the map, so the flux sum is that of the map.

With several maps each gets an equal share of the count, the first ones one more where it does not divide.
"""

import math
from collections.abc import Sequence
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.rsm.reflective import Rsm
from refgi.sampling import grid, halton
from refgi.stages import stage

Array = npt.NDArray[Any]
Pattern = Literal["grid", "halton", "all", "random"]


class PixelLights(NamedTuple):
    """N' <= N point lights with a surface normal, in the order they were drawn."""

    position: Array  # (3, N') m, world space
    normal: Array  # (3, N') unit vectors
    flux: Array  # (3, N') W, reflected by the diffuse part, T/N included
    lobe_flux: Array | None  # (3, N') W, reflected by the lobe, T/N included; None: no lobes
    lobe_axis: Array | None  # (3, N') unit vectors
    lobe_exponent: Array | None  # (N',)
    drawn: int  # N: those without flux included


@stage("rsm.pixel_lights")
def choose_pixel_lights(
    rsms: Sequence[Rsm],
    *,
    count: int | None,
    pattern: Pattern,
    seed: int = 0,
    filtered: bool = False,
) -> PixelLights:
    """Choose texels as pixel lights.

    Parameters
    ----------
    rsms : sequence of Rsm
        One map a light.
    count : int or None
        N, over all maps; None with pattern "all".
    pattern : {"grid", "halton", "all", "random"}
        Where the texels lie: the centres of n x n equal cells on each map (on each of a cube's faces); the Halton set
        in bases 2, 3 over the stacked maps; every texel; independently random.
    seed : int
        Of the random pattern, and of the Halton set's shift modulo 1; seed 0 leaves the Halton set unshifted.
    filtered : bool
        Let each light carry the flux of its cell: the grid's cell, or the texels nearest to it.

    Returns
    -------
    PixelLights
        Those with flux.

    Raises
    ------
    InputError
        If the pattern is unknown or the count does not suit it.

    Notes
    -----
    A filtered light whose own texel has no flux moves to the nearest texel of its cell that has.
    """
    expect(len(rsms) > 0, "rsms", "at least one map", "none")
    expect(pattern in get_args(Pattern), "pattern", " or ".join(get_args(Pattern)), pattern)
    parts = []
    for index, (rsm, share) in enumerate(zip(rsms, _shares(rsms, count, pattern), strict=True)):
        texel = _choose(rsm, share, pattern, seed, index)
        if filtered and pattern != "all":
            weights = _cell_sums(rsm, texel, pattern)
        else:
            weights = np.full(len(texel), rsm.texels / len(texel)), texel, None
        parts.append(_lights(rsm, *weights))
    drawn = sum(part.drawn for part in parts)
    return parts[0] if len(parts) == 1 else _joined(parts, drawn)


def _shares(rsms: Sequence[Rsm], count: int | None, pattern: Pattern) -> list[int]:
    """Return how many texels to draw from each map."""
    if pattern == "all":
        total = sum(rsm.texels for rsm in rsms)
        expect(count is None or count == total, "count", f"None or {total} with pattern 'all'", count)
        return [rsm.texels for rsm in rsms]
    expect(isinstance(count, int | np.integer) and count >= len(rsms), "count",
           f"at least one for each of {len(rsms)} lights", count)  # fmt: skip
    assert count is not None
    shares = [count // len(rsms) + (index < count % len(rsms)) for index in range(len(rsms))]
    if pattern == "grid":
        _expect_squares(rsms, shares, count)
    return shares


def _expect_squares(rsms: Sequence[Rsm], shares: list[int], count: int) -> None:
    def fits(total: int) -> bool:
        parts = [total // len(rsms) + (index < total % len(rsms)) for index in range(len(rsms))]
        return all(p % r.projection.maps == 0 and math.isqrt(p // r.projection.maps) ** 2 == p // r.projection.maps
                   and p > 0 for p, r in zip(parts, rsms, strict=True))  # fmt: skip

    if not fits(count):
        below = next((n for n in range(count - 1, 0, -1) if fits(n)), None)
        above = next((n for n in range(count + 1, 4 * count + 64 * len(rsms)) if fits(n)), None)
        near = " or ".join(str(n) for n in (below, above) if n is not None)
        expect(False, "count", f"n x n cells on each map for pattern 'grid', nearest {near or 'none'}", count)


def _choose(rsm: Rsm, share: int, pattern: Pattern, seed: int, index: int) -> Array:
    """Return the chosen texels as indices into the flattened map."""
    height, width = rsm.depth.shape
    if pattern == "all":
        return np.arange(rsm.texels)
    if pattern == "grid":
        maps = rsm.projection.maps
        points = grid(math.isqrt(share // maps))
        rows = np.concatenate([_texel(points[:, 1], rsm.projection.height) + m * rsm.projection.height
                               for m in range(maps)])  # fmt: skip
        return rows * width + np.tile(_texel(points[:, 0], width), maps)
    generator = np.random.default_rng([seed, index])
    if pattern == "random":
        points = generator.random((share, 2))
    else:
        shift = None if seed == 0 and index == 0 else generator.random(2)
        points = halton(share, shift=shift)
    return _texel(points[:, 1], height) * width + _texel(points[:, 0], width)


def _texel(coordinate: Array, size: int) -> Array:
    return np.minimum((coordinate * size).astype(np.int64), size - 1)


def _cell_sums(rsm: Rsm, texel: Array, pattern: Pattern) -> tuple[None, Array, tuple[Array, Array | None]]:
    """Return each light's texel and the flux of its cell."""
    cell = _grid_cells(rsm, len(texel)) if pattern == "grid" else _nearest_cells(rsm, texel)
    sums = [_by_cell(flux, cell, len(texel)) for flux in (rsm.flux, rsm.lobe_flux) if flux is not None]
    power = rsm.flux.sum(axis=0) if rsm.lobe_flux is None else (rsm.flux + rsm.lobe_flux).sum(axis=0)
    moved = _move_to_flux(texel, cell, power.reshape(-1) > 0, rsm.depth.shape[1])
    return None, moved, (sums[0], sums[1] if len(sums) > 1 else None)


def _grid_cells(rsm: Rsm, count: int) -> Array:
    """Return the grid cell that holds each texel's centre."""
    maps, height, width = rsm.projection.maps, rsm.projection.height, rsm.projection.width
    n = math.isqrt(count // maps)
    expect(n <= min(height, width), "count", f"at most {maps * min(height, width) ** 2} with filtering", count)
    rows = (2 * np.arange(height) + 1) * n // (2 * height)
    columns = (2 * np.arange(width) + 1) * n // (2 * width)
    one = rows[:, None] * n + columns
    return np.concatenate([one.reshape(-1) + m * n * n for m in range(maps)])


def _nearest_cells(rsm: Rsm, texel: Array) -> Array:
    """Return the nearest chosen texel of each texel, on its own map as long as that has one."""
    from scipy.spatial import cKDTree

    height, width = rsm.depth.shape
    apart = 4 * (rsm.projection.height + width)

    def place(index: Array) -> Array:
        row, column = index // width, index % width
        return np.stack([row + row // rsm.projection.height * apart, column], axis=1).astype(np.float64)

    unique, first = np.unique(texel, return_index=True)
    _, nearest = cKDTree(place(unique)).query(place(np.arange(rsm.texels)))
    return first[nearest]


def _by_cell(flux: Array, cell: Array, count: int) -> Array:
    sums = [np.bincount(cell, channel.reshape(-1), minlength=count) for channel in flux]
    return np.stack(sums).astype(flux.dtype)


def _move_to_flux(texel: Array, cell: Array, lit: Array, width: int) -> Array:
    """Return for each cell its texel, or where that has no flux the nearest of the cell that has."""
    candidates = np.flatnonzero(lit & ~lit[texel][cell])
    own = texel[cell[candidates]]
    square = (candidates // width - own // width) ** 2 + (candidates % width - own % width) ** 2
    order = np.lexsort((candidates, square, cell[candidates]))
    cells, first = np.unique(cell[candidates][order], return_index=True)
    moved = texel.copy()
    moved[cells] = candidates[order][first]
    return moved


def _lights(rsm: Rsm, weight: Array | None, texel: Array, sums: tuple[Array, Array | None] | None) -> PixelLights:
    """Gather the chosen texels that have flux."""
    def taken(plane: Array) -> Array:
        return plane.reshape(*plane.shape[:-2], -1)[..., texel]

    if sums is None:
        assert weight is not None
        scale = weight.astype(rsm.flux.dtype)
        flux, lobe = taken(rsm.flux) * scale, None if rsm.lobe_flux is None else taken(rsm.lobe_flux) * scale
    else:
        flux, lobe = sums
    kept = flux.any(axis=0) if lobe is None else flux.any(axis=0) | lobe.any(axis=0)
    return PixelLights(
        taken(rsm.position)[:, kept],
        taken(rsm.normal)[:, kept],
        flux[:, kept],
        None if lobe is None else lobe[:, kept],
        None if rsm.lobe_axis is None else taken(rsm.lobe_axis)[:, kept],
        None if rsm.lobe_exponent is None else taken(rsm.lobe_exponent)[kept],
        len(texel),
    )


def _joined(parts: Sequence[PixelLights], drawn: int) -> PixelLights:
    """Join the lights of several maps; those without lobes get dark ones where others have any."""
    if any(part.lobe_flux is not None for part in parts):
        parts = [part if part.lobe_flux is not None else _with_dark_lobes(part) for part in parts]
        lobes = [np.concatenate([part[field] for part in parts], axis=-1) for field in (3, 4, 5)]
    else:
        lobes = [None, None, None]
    return PixelLights(*(np.concatenate([part[field] for part in parts], axis=-1) for field in (0, 1, 2)), *lobes, drawn)


def _with_dark_lobes(part: PixelLights) -> PixelLights:
    zero = np.zeros_like(part.flux)
    return part._replace(lobe_flux=zero, lobe_axis=zero, lobe_exponent=zero[0])

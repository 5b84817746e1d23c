"""Pixel lights (VPLs) chosen from the texels of reflective shadow maps (SII Sec. 3.1; docs/radiometry).

N texels of a map of T are chosen with equal chance, so each stands for T/N texels: Phi_i = Phi_t T / N. Texels
without flux count in N but are dropped from the list. With a `warp` each light's flux is T/N w Phi_t with the weight w
of `refgi.lights.warp`; `filtered` replaces T/N Phi_t by the flux of the texel's cell (SII's filtered look-up).
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple, get_args

import numpy as np

from refgi.errors import expect
from refgi.lights.importance import importance as importance_of
from refgi.lights.shares import (
    Pattern,
    cell_sums,
    cells_of_grid,
    cells_of_nearest,
    map_shares,
    texel_areas,
    texels_with_flux,
)
from refgi.lights.warp import Warp, texel_of, warp_stacked
from refgi.pairs.pixel_lights import PixelLights
from refgi.rsm.buffers.gbuffer import values_at
from refgi.rsm.buffers.reflective import Rsm
from refgi.sampling import PIXEL_LIGHTS, draws, grid, halton
from refgi.stages import stage
from refgi.types import Array


class MapPlanes(NamedTuple):
    """What lights read of a map."""

    position: Array  # (3, H, W) m
    normal: Array  # (3, H, W) unit vectors
    flux: Array  # (3, H, W) W
    lobe_flux: Array | None  # (3, H, W) W
    lobe_axis: Array | None  # (3, H, W) unit vectors
    lobe_exponent: Array | None  # (H, W)

    def at(self, texel: Array, *names: str) -> tuple[Any, ...]:
        """Return channels at some texels (n,), None for those of no lobe."""
        planes = [getattr(self, name) for name in names]
        return tuple(None if plane is None else values_at(plane, texel) for plane in planes)


class Drawn(NamedTuple):
    """Texels of one map, drawn as pixel lights; those without flux included."""

    texel: Array  # (n,) row * W + column
    weight: Array  # (n,) T/N, times w where they are warped
    cell: Array | None  # (H * W,) index of the drawn texel whose light carries a texel's flux; None: own flux alone
    gain: float = 1.0  # what lights of cells carry beside the flux of their cell; weights contain it
    half: Array | None = None  # (n,) bool, whether it is of the second half of the draw; None: no draw


@stage("lights.draw", steps="refgi.lights.steps.draw_steps")
def draw_texels(
    rsms: Sequence[Rsm],
    *,
    count: int | None,
    pattern: Pattern,
    seed: int = 0,
    filtered: bool = False,
    warp: Warp | None = None,
    importance: Sequence[Array] | None = None,
    renormalise: bool = False,
) -> list[Drawn]:
    """Draw texels of maps as pixel lights.

    count: How many are asked for, over all maps; None with pattern "all". `map_shares` says how many each map draws.
    pattern: Where the texels lie: the centres of n x n equal cells on each map (on each of a cube's faces); the Halton
        set in bases 2, 3 over the stacked maps; every texel; independently random.
    seed: Of the random pattern, and of the Halton set's shift modulo 1; seed 0 leaves the Halton set unshifted.
    filtered: Let each light carry the flux of its cell: the grid's cell, or the texels nearest to it.
    warp: Move the pattern to where the map is important; stacked maps are chosen by importance first.
    importance sequence of (H, W): Importance of each map's texels for the warp; the flux if absent.
    renormalise: Scale each map's weights w to a sum of N. Biased, and noisier where the warp goes down to texels.
    -> list of Drawn: One a map.

    Raises `InputError` if the pattern is unknown, the count does not suit it, or there is nothing for the warp to move.

    Filtered lights of a warped pattern stand at warped places and carry the flux of the texels nearest to them, without
    weight, as the cells already are small where the lights are dense. Of several on one texel the first has it all.
    """
    expect(len(rsms) > 0, "rsms", "at least one map", "none")
    expect(pattern in get_args(Pattern), "pattern", " or ".join(get_args(Pattern)), pattern)
    expect(warp is None or pattern != "all", "pattern", "'grid', 'halton' or 'random' with a warp", pattern)
    expect(warp is not None or importance is None, "importance", "None without a warp", "maps")
    expect(importance is None or len(importance) == len(rsms), "importance", f"one for each of {len(rsms)} maps",
           None if importance is None else len(importance))
    drawn = []
    for index, (rsm, (share, gain, place)) in enumerate(zip(rsms, map_shares(rsms, count, pattern, seed), strict=True)):
        if share == 0:
            drawn.append(Drawn(np.zeros(0, np.int64), np.zeros(0), None))
            continue
        weight = np.full(share, rsm.texels / share * gain)
        if warp is None:
            texel = _choose(rsm, share, pattern, seed, place)
        else:
            texel_importance = importance_of(rsm) if importance is None else importance[index]
            texel, own = _warped(rsm, _points(rsm, share, pattern, seed, place), texel_importance, warp)
            weight = weight * (own * (share / own.sum()) if renormalise else own)
        cell = None
        if filtered and pattern != "all":
            on_grid = pattern == "grid" and warp is None
            cell = cells_of_grid(rsm.projection, share) if on_grid else cells_of_nearest(rsm.projection, texel)
        drawn.append(Drawn(texel, weight, cell, gain, _halves(rsm, share, pattern, place)))
    return drawn


@stage("lights.choose", steps="refgi.lights.steps.light_steps")
def lights_of(rsms: Sequence[Rsm], drawn: Sequence[Drawn]) -> PixelLights:
    """Return drawn texels as pixel lights.

    -> PixelLights: Those with flux.

    A filtered light whose own texel has no flux moves to the nearest texel of its cell that has. Where its texel has no
    lobe, what the cell's lobes reflect leaves it diffusely: flux alone is filtered, in the paper as here.
    """
    return gathered_lights(rsms, drawn)


def gathered_lights(rsms: Sequence[Rsm | MapPlanes], drawn: Sequence[Drawn]) -> PixelLights:
    """Return drawn texels as pixel lights, those with flux: `lights_of` unobserved, or of plain arrays."""
    parts = []
    for index in _drawn_from(drawn):
        rsm, (texel, weight, cell, gain, half) = rsms[index], drawn[index]
        part = _weighted_lights(rsm, texel, weight, half) if cell is None else _filtered_lights(
            rsm, texel, cell, gain, half)
        parts.append(part._replace(map_index=np.full(part.flux.shape[1], index, np.int32)))
    return parts[0] if len(parts) == 1 else _joined(parts)


def _drawn_from(drawn: Sequence[Drawn]) -> list[int]:
    """Return which maps any texel is drawn from; the first where there is none."""
    return [index for index, one in enumerate(drawn) if len(one.texel)] or [0]


def choose_pixel_lights(rsms: Sequence[Rsm], **options: Any) -> PixelLights:
    """Return texels of maps as pixel lights.

    Parameters
    ----------
    rsms : sequence of Rsm
        One map a light.
    **options : object
        Those of `draw_texels`.

    Returns
    -------
    PixelLights
        Those with flux: `lights_of` what `draw_texels` draws.
    """
    return lights_of(rsms, draw_texels(rsms, **options))


@stage("lights.areas", steps="refgi.lights.steps.area_steps")
def footprints_of(rsms: Sequence[Rsm], drawn: Sequence[Drawn]) -> Array:
    """Return the surface area that each pixel light of `lights_of` stands for.

    -> (light,): Area, m^2: O d^2 / cos of the texel with the same T/N w as its flux, or of all texels of its cell that
        reflect.
    """
    parts = []
    for index in _drawn_from(drawn):
        rsm, (texel, weight, cell, gain, _) = rsms[index], drawn[index]  # a gain is flux of other lamps, not surface
        if cell is None:
            own = texel_areas(rsm, texel)
            area = own * (weight / gain).astype(own.dtype)
        else:
            (area,) = cell_sums(texel_areas(rsm, np.arange(rsm.texels))[None], cell, len(texel))
        parts.append(area[area != 0])
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


def _choose(rsm: Rsm, share: int, pattern: Pattern, seed: int, index: int) -> Array:
    """Return the chosen texels as indices into the flattened map."""
    height, width = rsm.projection.shape
    if pattern == "all":
        return np.arange(rsm.texels)
    if pattern == "grid":
        maps, rows = rsm.projection.maps, rsm.projection.height
        points = grid(math.isqrt(share // maps))
        row = np.add.outer(np.arange(maps) * rows, texel_of(points[:, 1], rows))
        return np.ravel(row * width + texel_of(points[:, 0], width))
    points = _points(rsm, share, pattern, seed, index)
    return np.asarray(texel_of(points[:, 1], height) * width + texel_of(points[:, 0], width))


def _points(rsm: Rsm, share: int, pattern: Pattern, seed: int, index: int) -> Array:
    """Return the pattern as points (u, v) of the unit square over the stacked maps."""
    if pattern == "grid":
        maps = rsm.projection.maps
        one = grid(math.isqrt(share // maps))
        return np.concatenate([np.stack([one[:, 0], (k + one[:, 1]) / maps], axis=1) for k in range(maps)])
    if pattern == "random":
        return draws(seed, PIXEL_LIGHTS, 2 * share, index).reshape(share, 2)
    shift = None if seed == 0 and index == 0 else draws(seed, PIXEL_LIGHTS, 2, index).tolist()
    return halton(share, shift=shift)


def _halves(rsm: Rsm, share: int, pattern: Pattern, place: int) -> Array | None:
    """Return which texels are of the second half of a draw, each half a sample of the whole map; None for every texel.

    A Halton set's halves are its first and last points: every other one would be a half of the map. Every other cell
    of a grid, rows shifted, is spread over all of it. The odd one goes to either half in turn over the maps.
    """
    if pattern == "all":
        return None
    number = np.arange(share)
    if pattern == "grid":
        return np.asarray((number + number // math.isqrt(share // rsm.projection.maps) + place) % 2 == 1)
    return number >= (share + place % 2) // 2


def _warped(rsm: Rsm, points: Array, importance: Array, warp: Warp) -> tuple[Array, Array]:
    """Return the texels that the warped points fall on, and their weights 1 / (T q)."""
    height, width = rsm.projection.shape
    expect(np.shape(importance) == (height, width), "importance", f"shape {(height, width)} as its map",
           np.shape(importance))
    warped, weight = warp_stacked(points, importance, rsm.projection.maps, warp)
    return texel_of(warped[:, 1], height) * width + texel_of(warped[:, 0], width), weight


def _weighted_lights(rsm: Rsm | MapPlanes, texel: Array, weight: Array, half: Array | None) -> PixelLights:
    """Return the texels as lights with T/N, or T/N w, times their flux."""
    flux, lobe = rsm.at(texel, "flux", "lobe_flux")
    scale = weight.astype(flux.dtype)
    return _lights(rsm, texel, flux * scale, None if lobe is None else lobe * scale, half)


def _filtered_lights(
    rsm: Rsm | MapPlanes, texel: Array, cell: Array, gain: float, half: Array | None
) -> PixelLights:
    by = rsm.flux.dtype.type(gain)
    flux = cell_sums(rsm.flux, cell, len(texel)) * by
    power = rsm.flux.sum(axis=0) if rsm.lobe_flux is None else (rsm.flux + rsm.lobe_flux).sum(axis=0)
    texel = texels_with_flux(texel, cell, power > 0)
    if rsm.lobe_flux is None:
        return _lights(rsm, texel, flux, None, half)
    lobe = cell_sums(rsm.lobe_flux, cell, len(texel)) * by
    glossy = values_at(rsm.lobe_flux, texel).any(axis=0)  # others have no axis for their cell's lobes to leave along
    return _lights(rsm, texel, flux + np.where(glossy, 0, lobe), np.where(glossy, lobe, 0), half)


def _lights(rsm: Rsm | MapPlanes, texel: Array, flux: Array, lobe: Array | None, half: Array | None) -> PixelLights:
    """Gather the chosen texels, leaving out those without flux."""
    has_flux = flux.any(axis=0) if lobe is None else flux.any(axis=0) | lobe.any(axis=0)
    chosen = texel[has_flux]
    position, normal, axis, exponent = rsm.at(chosen, "position", "normal", "lobe_axis", "lobe_exponent")
    return PixelLights(
        position,
        normal,
        flux[:, has_flux],
        None if lobe is None else lobe[:, has_flux],
        axis,
        exponent,
        len(texel),
        chosen.astype(np.int32),
        half=None if half is None else half[has_flux],
    )


def _joined(parts: Sequence[PixelLights]) -> PixelLights:
    """Join the lights of several maps; those without lobes get dark ones where others have any."""
    glossy = any(part.lobe_flux is not None for part in parts)
    if glossy:
        parts = [part if part.lobe_flux is not None else _with_dark_lobes(part) for part in parts]

    def joined(field: int) -> Array:
        return np.concatenate([part[field] for part in parts], axis=-1)

    together = PixelLights(joined(0), joined(1), joined(2), None, None, None, sum(part.drawn for part in parts),
                           joined(7), joined(8), None if parts[0].half is None else joined(9))
    if glossy:
        together = together._replace(lobe_flux=joined(3), lobe_axis=joined(4), lobe_exponent=joined(5))
    return together


def _with_dark_lobes(part: PixelLights) -> PixelLights:
    zero = np.zeros_like(part.flux)
    return part._replace(lobe_flux=zero, lobe_axis=zero, lobe_exponent=zero[0])

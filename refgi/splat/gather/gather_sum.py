"""The sum of RSM gathering: Eq. 2 over a disc of texels around each receiver's place in the map, and interpolation.

The pattern is polar with radius r_max xi_1, so its density falls as 1 / r and each sample weighs xi_1 (Dachsbacher and
Stamminger 2005). `disc_loss` estimates the share of light outside all discs. Symbols as in `pair_sum`.
"""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from refgi.jit import kernel, prange
from refgi.pairs.estimates import lost_share
from refgi.pairs.irradiance import Receivers
from refgi.pairs.pair_sum import geometry_term
from refgi.pairs.sample import sample_pixels
from refgi.radiometry import lobe_gap, lobe_power, receiver_norm
from refgi.rsm.buffers.leaving import GlossyPoints
from refgi.sampling import GATHERING, draws, halton
from refgi.stages import stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.rsm import Projection, Rsm

TEXELS = 1024  # of each map
SAMPLED = 512  # pixels
CORNER = math.sqrt(2)  # map widths: a disc of that radius holds the whole map, wherever its centre lies


class GatherMap(NamedTuple):
    """What gathering reads of a reflective shadow map."""

    position: Array  # (3, H, W) of the texels' surface, moved by the offset, m
    normal: Array  # (3, H, W) unit vectors
    flux: Array  # (3, H, W) reflected flux, W


def disc_pattern(samples: int, seed: int, weight_squared: bool = False) -> Array:
    """Return offsets in the unit disc (down, right) and the weight of each, (samples, 3) float64.

    The integral over the area is the mean of weight times value. Seed 0: the plain Halton set; else a shift of it drawn
    with this seed. `weight_squared` weighs by xi_1^2 as is often done (switch `rsm_weight_squared`), not by xi_1.

    >>> pattern = disc_pattern(10_000, 0)
    >>> round(float(pattern[:, 2].mean()), 2)  # the disc's area, pi
    3.14
    """
    return disc_offsets(disc_points(samples, seed), weight_squared)


def disc_points(samples: int, seed: int) -> Array:
    """Return the points (xi_1, xi_2) of the unit square, (samples, 2), that `disc_pattern` is made of."""
    return halton(samples, shift=draws(seed, GATHERING, 2).tolist() if seed else None, start=1)


def disc_offsets(points: Array, weight_squared: bool = False) -> Array:
    """Return offset down, offset right and weight of points (xi_1, xi_2) of the unit square, (n, 2), as (n, 3)."""
    xi, turn = points.T
    # density 1 / (2 pi xi): the weight is 2 pi xi; with xi^2 the mean weight stays the same, 2 pi * 3/2 xi^2
    weight = 2 * math.pi * (1.5 * xi * xi if weight_squared else xi)
    return np.stack([xi * np.cos(2 * math.pi * turn), xi * np.sin(2 * math.pi * turn), weight], axis=1)


@kernel(parallel=True)
def gather_discs(
    position: Array, normal: Array, center: Array, source: GatherMap, pattern: Array, scale: Any,
    lobes: GlossyPoints | None, irradiance: Array,
) -> None:
    """Add E = scale * sum over the pattern of weight Phi g for every receiver, W/m^2, or what lobes make of it.

    `center` (2, n) float64: rows and columns of receivers (3, n) in the map; `pattern` (S, 3): rows down, columns
    right, weight; `scale`: 1 / (pi S) times the texels in a disc of unit weight.
    """
    real = position.dtype.type
    height, width = source.flux.shape[1:]
    p, n, flux = source
    for i in prange(position.shape[1]):
        red, green, blue = real(0.0), real(0.0), real(0.0)
        x, y, z = position[0, i], position[1, i], position[2, i]
        nx, ny, nz = normal[0, i], normal[1, i], normal[2, i]
        norm = scale
        if lobes is not None:
            norm = receiver_norm(lobes.exponent[i]) * scale
        for s in range(pattern.shape[0]):
            t, u = sample_texel(center, pattern, i, s)
            if 0 <= t < height and 0 <= u < width and (flux[0, t, u] > 0 or flux[1, t, u] > 0 or flux[2, t, u] > 0):
                dx, dy, dz = p[0, t, u] - x, p[1, t, u] - y, p[2, t, u] - z
                # SII Eq. (2), times the lobe
                g = geometry_term(dx, dy, dz, -n[0, t, u], -n[1, t, u], -n[2, t, u], nx, ny, nz)
                if g > 0:
                    weight = real(pattern[s, 2])
                    if lobes is not None:
                        weight *= lobe_power(lobe_gap(lobes.mirrored[0, i], lobes.mirrored[1, i], lobes.mirrored[2, i],
                                                      dx, dy, dz), lobes.exponent[i])
                    g *= weight
                    red, green, blue = red + g * flux[0, t, u], green + g * flux[1, t, u], blue + g * flux[2, t, u]
        irradiance[0, i] += red * norm
        irradiance[1, i] += green * norm
        irradiance[2, i] += blue * norm


@kernel
def sample_texel(center: Array, pattern: Array, i: int, s: int) -> tuple[int, int]:
    """Return row and column of the texel of sample s of receiver i, on the stacked maps or outside of them."""
    return math.floor(center[0, i] + pattern[s, 0]), math.floor(center[1, i] + pattern[s, 1])


def fill_texels(center: Array, pattern: Array, rows: int, columns: int, cut: bool = True) -> Array:
    """Return the texels of discs, (S, n) int32: row * columns + column, -1 outside; not `cut`: the nearest one there.

    `center` (2, n) and `pattern` (S, 2) are those of `gather_discs`, of any type.
    """
    texel = np.empty((len(pattern), center.shape[1]), np.int32)
    _fill_texels(center, pattern, rows, columns, cut, texel)
    return texel


@kernel(parallel=True)
def _fill_texels(center: Array, pattern: Array, rows: int, columns: int, cut: bool, texel: Array) -> None:
    for s in prange(texel.shape[0]):
        for i in range(texel.shape[1]):
            row, column = sample_texel(center, pattern, i, s)
            inside = 0 <= row < rows and 0 <= column < columns
            nearest = min(max(row, 0), rows - 1) * columns + min(max(column, 0), columns - 1)
            texel[s, i] = nearest if inside or not cut else -1


def centers(maps: "Projection", points: Array) -> Array:
    """Return where in the map each point (3, n) gathers: continuous row and column (2, n) on the stacked maps, float64.

    A point outside the map gathers where the straight way to the map's middle meets its border.
    """
    from refgi.rsm.raster.projection import ORTHOGRAPHIC, project

    row, column, _ = project(maps, points)
    center = np.stack([row, column]).astype(np.float64)
    outside = np.isnan(center[0])
    if outside.any():
        right, down, ahead = maps.frame[0] @ (points[:, outside] - maps.origin[0][:, None])
        plane = np.stack([down / maps.half[1], right / maps.half[0]])
        if maps.kind != ORTHOGRAPHIC:
            plane /= np.where(ahead > 0, ahead, 1e-30)  # behind the light: as far out as can be
        plane /= np.maximum(np.abs(plane).max(axis=0), 1)
        center[:, outside] = (plane + 1) / 2 * np.array([[maps.height], [maps.width]])
    return center


@stage("gather.loss")
def disc_loss(receivers: Receivers, rsms: "Sequence[Rsm]", radius: float, offset: float = 0.0) -> float:
    """Return the share of the light that comes from texels outside the pixels' discs.

    radius: Of the discs, map widths.
    offset: By which texels are moved back along their normals, m.
    -> float: Of the diffuse light without visibility, at sampled pixels by sampled texels; 0 where a disc is the whole
        map.
    """
    if radius >= CORNER and all(rsm.projection.maps == 1 for rsm in rsms):
        return 0.0
    sample = sample_pixels(receivers, SAMPLED)
    position, normal = (plane.astype(np.float64) for plane in (sample.position, sample.normal))
    sums = np.zeros((2, position.shape[1]))
    for rsm in rsms:
        side = radius * np.array([[rsm.projection.height], [rsm.projection.width]])
        texel, lights = _texels(rsm, offset)
        _add_shares(position, normal, centers(rsm.projection, sample.position) / side, lights, texel / side, sums)
    inside, whole = sums.sum(axis=1)
    return lost_share(float(whole), float(inside))


def _texels(rsm: "Rsm", offset: float) -> tuple[Array, Array]:
    """Return row and column of some texels, (2, N), and their position, reversed normal and flux, (7, N)."""
    from refgi.lights import choose_pixel_lights

    lights = choose_pixel_lights([rsm], count=TEXELS, pattern="halton")
    assert lights.texel is not None
    place = np.stack(np.divmod(lights.texel, rsm.projection.width)) + 0.5
    normal = np.asarray(lights.normal, np.float64)
    flux = lights.flux.sum(axis=0, dtype=np.float64)
    return place, np.concatenate([lights.position - offset * normal, -normal, flux[None]])


@kernel(parallel=True)
def _add_shares(position: Array, normal: Array, center: Array, lights: Array, texel: Array, sums: Array) -> None:
    """Add what lights inside the disc, and what all lights, give each pixel; places are in radii of the disc."""
    for i in prange(position.shape[1]):
        inside, whole = 0.0, 0.0
        for k in range(lights.shape[1]):
            term = lights[6, k] * geometry_term(
                lights[0, k] - position[0, i], lights[1, k] - position[1, i], lights[2, k] - position[2, i],
                lights[3, k], lights[4, k], lights[5, k], normal[0, i], normal[1, i], normal[2, i])
            whole += term
            if (texel[0, k] - center[0, i]) ** 2 + (texel[1, k] - center[1, i]) ** 2 <= 1.0:
                inside += term
        sums[0, i] += inside
        sums[1, i] += whole


LEAST_SIMILAR = 3  # of the four coarse neighbours that must be similar to a pixel


class SimilarityLimits(NamedTuple):
    """How far a coarse pixel's surface may differ from a pixel's."""

    least_cosine: float  # between their normals
    reach: float  # distance between their surfaces, m


def coarse_pixels(height: int, width: int, grid: int) -> tuple[Array, Array]:
    """Return rows and columns, rising, of the coarse pixels: the middles of grid x grid cells, at most one a pixel.

    >>> coarse_pixels(8, 4, 2)[0].tolist()
    [2, 6]
    """
    rows, columns = (((np.arange(min(grid, size)) + 0.5) * size / min(grid, size)).astype(np.int64)
                     for size in (height, width))
    return rows, columns


def interpolate(
    receivers: Receivers, coarse_light: Array, coarse: tuple[Array, Array], limits: SimilarityLimits
) -> tuple[Array, Array]:
    """Interpolate irradiance (3, h, w) between coarse pixels (rows, columns) where surfaces are similar.

    Returns it, 0 where it could not be, and where it could be, (h, w) bool: three of four neighbours are similar, or
    the pixel is a coarse one itself. Weights are bilinear and made to sum to 1 over the similar neighbours.
    """
    covered = np.asarray(receivers.covered)
    result = np.zeros_like(coarse_light)
    interpolated = np.zeros_like(covered)
    lines = (*_neighbours(coarse[0], covered.shape[0]), *_neighbours(coarse[1], covered.shape[1]))
    _interpolate(receivers.position, receivers.normal, coarse_light, covered, lines, limits, (result, interpolated))
    at_coarse = np.ix_(*coarse)
    interpolated[at_coarse] = covered[at_coarse]
    channels = np.ix_(np.arange(3), *coarse)
    result[channels] = coarse_light[channels]
    return result, interpolated


def _neighbours(coarse: Array, size: int) -> tuple[Array, Array, Array]:
    """Return for each pixel of an axis the coarse pixels around it and the weight of the second, 0 to 1."""
    pixel = np.arange(size)
    first = np.clip(np.searchsorted(coarse, pixel, side="right") - 1, 0, max(0, len(coarse) - 2))
    low, high = coarse[first], coarse[np.minimum(first + 1, len(coarse) - 1)]
    return low, high, np.clip((pixel - low) / np.maximum(high - low, 1), 0, 1)


@kernel(parallel=True)
def _interpolate(
    position: Array, normal: Array, coarse_light: Array, covered: Array, lines: Any, limits: SimilarityLimits, out: Any
) -> None:
    top, bottom, down, left, right, across = lines
    result, interpolated = out
    real = position.dtype.type
    for i in prange(covered.shape[0]):
        for j in range(covered.shape[1]):
            if not covered[i, j]:
                continue
            total, similar = 0.0, 0
            for corner in range(4):
                r, c = bottom[i] if corner & 2 else top[i], right[j] if corner & 1 else left[j]
                if covered[r, c] and _similar(position, normal, i, j, r, c, limits):
                    weight = (down[i] if corner & 2 else 1.0 - down[i]) * (across[j] if corner & 1 else 1.0 - across[j])
                    similar += 1
                    total += weight
                    for channel in range(3):
                        result[channel, i, j] += real(weight) * coarse_light[channel, r, c]
            interpolated[i, j] = total > 0.0 and similar >= LEAST_SIMILAR
            for channel in range(3):
                result[channel, i, j] = result[channel, i, j] / real(total) if interpolated[i, j] else real(0.0)


@kernel
def _similar(position: Array, normal: Array, i: int, j: int, r: int, c: int, limits: SimilarityLimits) -> Any:
    cosine, square = 0.0, 0.0
    for axis in range(3):
        cosine += normal[axis, i, j] * normal[axis, r, c]
        square += (position[axis, i, j] - position[axis, r, c]) ** 2
    return cosine >= limits.least_cosine and square <= limits.reach * limits.reach

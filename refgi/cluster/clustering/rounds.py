"""The rounds of k-means (Sec. 5.1, 6): each light to the nearest area light, each area light to the mean of its lights.

The printed distance obeys the triangle inequality, so a light that is nearer to its area light than any other can have
come since needs no search: `own` is its distance, `lower` a bound on that to every other (Hamerly 2010). The search
that is left is exact, so the result is that of searching always, to the bit.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.cluster.clustering.metric import fill_linear, fill_squares, linear
from refgi.jit import kernel, prange

Array = npt.NDArray[Any]

TILE = 256  # lights
LINES = 9  # of scratch: six of lights, then distance, least and second least
ZERO_MEAN = 1e-9  # a mean normal shorter than this has no direction


@kernel(parallel=True)
def iterate(
    lights: Array, areas: Array, weights: tuple[float, float], squared: bool, slack: float, rounds: int,
    of: Array, members: Array, objective: Array, bounds: Array, scratch: Array, picks: Array,
) -> int:
    """Run k-means until no light changes its area light, or for a number of rounds.

    Parameters
    ----------
    lights : (6, N) ndarray
        Positions, m, and unit normals, float64.
    areas : (6, M) ndarray
        The start; becomes the result.
    weights : tuple of 2 floats
        Of distance and angle, or of their squares.
    squared : bool
        Whether squares are summed.
    slack : float
        More than distances are off by rounding.
    rounds : int
        Most rounds of means.
    of : (N,) int32 ndarray
        -1; filled with the area light of each light.
    members : (M,) int64 ndarray
        Filled with the lights of each.
    objective : (rounds + 1,) ndarray
        Filled with the sum of all distances at the start and after each round.
    bounds : (2, N) ndarray
        Room for the distance to the own area light and a bound on that to any other.
    scratch : (tiles, LINES, TILE) ndarray
        Room for tiles of lights.
    picks : (tiles, 2, TILE) int64 ndarray
        Room for indices.

    Returns
    -------
    int
        Rounds of means made.
    """
    tiles = len(scratch)
    changes = np.zeros(tiles, np.int64)
    moved = (0.0, 0.0, -1)
    done = 0
    while True:
        for tile in prange(tiles):
            changes[tile] = _assign(
                int(tile) * TILE, lights, areas, weights, squared, slack, moved, of, bounds, scratch[tile],
                picks[tile],
            )
        objective[done] = _total(bounds[0])
        if changes.sum() == 0 or done == rounds:
            break
        moved = _move_to_means(lights, of, weights, areas, members)
        done += 1
    _count_members(of, members)
    return done


@kernel
def _assign(
    first: int, lights: Array, areas: Array, weights: tuple[float, float], squared: bool, slack: float,
    moved: tuple[float, float, int], of: Array, bounds: Array, scratch: Array, picks: Array,
) -> int:
    """Find the nearest area light of each light of a tile, the lowest index on ties; return how many changed."""
    size = min(TILE, lights.shape[1] - first)
    pending = _doubtful(first, size, lights, areas, weights, squared, slack, moved, of, bounds, picks[0])
    for j in range(pending):
        for c in range(6):
            scratch[c, j] = lights[c, picks[0, j]]
    _search(scratch, pending, areas, weights, squared, picks[1])
    changed = 0
    for j in range(pending):
        i = picks[0, j]
        changed += of[i] != picks[1, j]
        of[i] = picks[1, j]
        bounds[0, i], bounds[1, i] = scratch[7, j], scratch[8, j]
    return changed


@kernel
def _doubtful(
    first: int, size: int, lights: Array, areas: Array, weights: tuple[float, float], squared: bool, slack: float,
    moved: tuple[float, float, int], of: Array, bounds: Array, pick: Array,
) -> int:
    """List the lights of a tile that may have a new nearest area light; the others get their new distance."""
    pending = 0
    for i in range(first, first + size):
        k = of[i]
        if not squared and k >= 0:
            bounds[0, i] = linear(
                lights[0, i], lights[1, i], lights[2, i], lights[3, i], lights[4, i], lights[5, i], areas[0, k],
                areas[1, k], areas[2, k], areas[3, k], areas[4, k], areas[5, k], weights[0], weights[1],
            )
            bounds[1, i] -= moved[1] if k == moved[2] else moved[0]
            if bounds[0, i] + slack < bounds[1, i]:
                continue
        pick[pending] = i
        pending += 1
    return pending


@kernel
def _search(
    scratch: Array, count: int, areas: Array, weights: tuple[float, float], squared: bool, nearest: Array
) -> None:
    """Find the nearest area light of gathered lights, the lowest index on ties."""
    distance, least, second = scratch[6], scratch[7], scratch[8]
    for j in range(count):
        least[j], second[j], nearest[j] = np.inf, np.inf, 0
    for k in range(areas.shape[1]):
        if squared:
            fill_squares(scratch, count, areas, k, weights[0], weights[1], distance)
        else:
            fill_linear(scratch, count, areas, k, weights[0], weights[1], distance)
        for j in range(count):
            d, best = distance[j], least[j]
            second[j] = min(second[j], max(d, best))
            nearest[j] = k if d < best else nearest[j]
            least[j] = min(d, best)


@kernel
def _move_to_means(
    lights: Array, of: Array, weights: tuple[float, float], areas: Array, members: Array
) -> tuple[float, float, int]:
    """Move each area light to the mean of its lights and return the two farthest moves and whose the first is."""
    _count_members(of, members)
    sums = np.zeros(areas.shape)
    for i in range(lights.shape[1]):
        for c in range(6):
            sums[c, of[i]] += lights[c, i]
    farthest, second, which = 0.0, 0.0, -1
    for k in range(areas.shape[1]):
        if members[k] == 0:
            continue  # keeps its values
        cx, cy, cz = sums[0, k] / members[k], sums[1, k] / members[k], sums[2, k] / members[k]
        nx, ny, nz = sums[3, k], sums[4, k], sums[5, k]
        length = math.sqrt(nx * nx + ny * ny + nz * nz)
        if length > ZERO_MEAN * members[k]:
            nx, ny, nz = nx / length, ny / length, nz / length
        else:
            nx, ny, nz = areas[3, k], areas[4, k], areas[5, k]
        move = linear(areas[0, k], areas[1, k], areas[2, k], areas[3, k], areas[4, k], areas[5, k], cx, cy, cz,
                      nx, ny, nz, weights[0], weights[1])  # fmt: skip
        if move > farthest:
            farthest, second, which = move, farthest, k
        else:
            second = max(second, move)
        areas[0, k], areas[1, k], areas[2, k] = cx, cy, cz
        areas[3, k], areas[4, k], areas[5, k] = nx, ny, nz
    return farthest, second, which


@kernel
def _count_members(of: Array, members: Array) -> None:
    """Count the lights of each area light."""
    members[:] = 0
    for i in range(len(of)):
        members[of[i]] += 1


@kernel
def _total(values: Array) -> float:
    """Return the sum of values in their order."""
    result = 0.0
    for i in range(len(values)):
        result += values[i]
    return result

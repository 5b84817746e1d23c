"""The rounds of k-means (Sec. 5.1, 6): each light to the area light that is nearest in position and normal.

Distances (their roots, where squared) obey the triangle inequality: an area light more than twice as far from a light's
own one as the light itself is cannot be nearer to it (Elkan 2003). Lights that share an area light are looked at
together, against those few that may be nearer to one of them: the result is that of comparing all, to the bit.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from refgi.jit import kernel, prange
from refgi.types import Array

HALF_PI = 0.5 * math.pi


@kernel
def angle(dot: Any, apart: Any) -> Any:
    """Return the angle between two unit vectors, 0 to pi within 1e-15, without branches.

    From their dot product and the squared length of their difference, of the sum where `dot` is negative: an arc cosine
    would lose the small angles of lights of one wall. asin(s) = s + s z P(z) with z = s^2 <= 1/4; P is of degree 11.
    """
    steep = abs(dot) >= 0.5
    z = min(0.25 * apart, 0.3) if steep else dot * dot
    s = math.sqrt(z) if steep else dot
    p = 2.8285381520428275e-02
    p = p * z - 1.0908304349000406e-02
    p = p * z + 1.6129764409156828e-02
    p = p * z + 7.7714397645414456e-03
    p = p * z + 1.1882032645784928e-02
    p = p * z + 1.3928781847841392e-02
    p = p * z + 1.7355334434132383e-02
    p = p * z + 2.2372043664706378e-02
    p = p * z + 3.0381947490254527e-02
    p = p * z + 4.4642857101464970e-02
    p = p * z + 7.5000000000219780e-02
    p = p * z + 1.6666666666666646e-01
    arc = s + s * (z * p)
    return (2.0 * arc if dot > 0.0 else math.pi - 2.0 * arc) if steep else HALF_PI - arc


@kernel
def linear(
    dx: Any, dy: Any, dz: Any, nx: Any, ny: Any, nz: Any, ax: Any, ay: Any, az: Any, per_metre: Any, per_radian: Any
) -> Any:
    """Return w_x |d| + w_a angle(n, a) of a light d from an area light, m, with unit normals n and a."""
    dot = nx * ax + ny * ay + nz * az
    side = math.copysign(1.0, dot)
    ex, ey, ez = nx - side * ax, ny - side * ay, nz - side * az
    turn = angle(dot, ex * ex + ey * ey + ez * ez)
    # Sec. 5.1: d = w_x dx + w_a dalpha
    return per_metre * math.sqrt(dx * dx + dy * dy + dz * dz) + per_radian * turn


@kernel
def fill_linear(lights: Any, count: int, other: Any, k: int, per_metre: float, per_radian: float, out: Any) -> None:
    """Fill out[:count] with w_x |x - c| + w_a angle(n, n_c) of lights (6, r), and area light k of `other`."""
    x, y, z, nx, ny, nz = lights[0], lights[1], lights[2], lights[3], lights[4], lights[5]
    cx, cy, cz, ax, ay, az = other[0, k], other[1, k], other[2, k], other[3, k], other[4, k], other[5, k]
    if per_radian == 0.0:
        for i in range(count):
            dx, dy, dz = x[i] - cx, y[i] - cy, z[i] - cz
            out[i] = per_metre * math.sqrt(dx * dx + dy * dy + dz * dz)
        return
    for i in range(count):
        out[i] = linear(x[i] - cx, y[i] - cy, z[i] - cz, nx[i], ny[i], nz[i], ax, ay, az, per_metre, per_radian)


@kernel
def fill_squares(lights: Any, count: int, other: Any, k: int, per_area: float, per_square: float, out: Any) -> None:
    """Fill out[:count] with w_x |x - c|^2 + w_a |n - n_c|^2, as `fill_linear`."""
    x, y, z, nx, ny, nz = lights[0], lights[1], lights[2], lights[3], lights[4], lights[5]
    cx, cy, cz, ax, ay, az = other[0, k], other[1, k], other[2, k], other[3, k], other[4, k], other[5, k]
    for i in range(count):
        dx, dy, dz = x[i] - cx, y[i] - cy, z[i] - cz
        ex, ey, ez = nx[i] - ax, ny[i] - ay, nz[i] - az
        out[i] = per_area * (dx * dx + dy * dy + dz * dz) + per_square * (ex * ex + ey * ey + ez * ez)


TILE = 256  # lights compared together
LINES = 9  # of scratch: six of lights, then distances to an area light, to the own one, to the nearest
ZERO_MEAN = 1e-9  # a mean normal shorter than this has no direction


class Metric(NamedTuple):
    """How distances are measured."""

    position: float  # weight of distance or its square
    angle: float  # weight of the angle or the square of the normals' difference
    squared: bool  # whether squares are summed
    slack: float  # more than distances are off by rounding


class Rounds(NamedTuple):
    """What the rounds work on."""

    lights: Array  # (6, N) float64: positions, m, and unit normals
    areas: Array  # (6, M) float64: the start, then the result
    of: Array  # (N,) int32: area light of each light; any at the start
    members: Array  # (M,) int64: how many lights each has
    own: Array  # (N,) float64: distance of each light to its area light
    order: Array  # (N,) int64: lights, those of an area light together, in their order
    tiles: Array  # (3, most) int64: first place in `order`, lights, area light
    changed: Array  # (most,) int64: by tile, how many lights went elsewhere
    scratch: Array  # (workers, LINES, TILE) float64
    rows: Array  # (workers, M) float64: from one area light to all
    picks: Array  # (workers, 2, TILE) int64: places in `order`, nearest area lights


@kernel
def iterate(state: Rounds, metric: Metric, rounds: int, objective: Array) -> int:
    """Run k-means until no light changes its area light, or for a number of rounds; return the rounds of means made.

    `objective` (rounds + 1,) is filled with the sum of all distances at the start and after each round.
    """
    done = 0
    while True:
        tiles = sort_lights(state)
        if done > 0:
            move_to_means(state)
        _assign_all(state, metric, tiles)
        objective[done] = _total(state.own)
        if done == rounds or (done > 0 and _total(state.changed[:tiles]) == 0):
            break
        done += 1
    sort_lights(state)
    return done


@kernel(parallel=True)
def _assign_all(state: Rounds, metric: Metric, tiles: int) -> None:
    for worker in prange(len(state.scratch)):
        _assign(state, metric, worker, tiles)


@kernel
def sort_lights(state: Rounds) -> int:
    """Bring the lights of each area light together and split them into tiles; return how many tiles there are."""
    members, tiles = state.members, state.tiles
    members[:] = 0
    for i in range(len(state.of)):
        members[state.of[i]] += 1
    place = np.empty(len(members), np.int64)
    first, count = 0, 0
    for k in range(len(members)):
        place[k] = first
        for start in range(0, members[k], TILE):
            tiles[0, count], tiles[1, count], tiles[2, count] = first + start, min(TILE, members[k] - start), k
            count += 1
        first += members[k]
    for i in range(len(state.of)):
        k = state.of[i]
        state.order[place[k]] = i
        place[k] += 1
    return count


@kernel
def move_to_means(state: Rounds) -> None:
    """Move each area light to the mean of its lights, taken from the first: what all have in common stays."""
    lights, areas, first = state.lights, state.areas, 0
    for k in range(len(state.members)):
        members = state.members[k]
        if members == 0:
            continue
        o = state.order[first]
        ox, oy, oz, onx, ony, onz = lights[0, o], lights[1, o], lights[2, o], lights[3, o], lights[4, o], lights[5, o]
        x, y, z, nx, ny, nz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for j in range(members):
            i = state.order[first + j]
            x, y, z = x + (lights[0, i] - ox), y + (lights[1, i] - oy), z + (lights[2, i] - oz)
            nx, ny, nz = nx + (lights[3, i] - onx), ny + (lights[4, i] - ony), nz + (lights[5, i] - onz)
        first += members
        areas[0, k], areas[1, k], areas[2, k] = ox + x / members, oy + y / members, oz + z / members
        nx, ny, nz = onx + nx / members, ony + ny / members, onz + nz / members
        length = math.sqrt(nx * nx + ny * ny + nz * nz)
        if length > ZERO_MEAN:
            areas[3, k], areas[4, k], areas[5, k] = nx / length, ny / length, nz / length


@kernel
def _assign(state: Rounds, metric: Metric, worker: int, tiles: int) -> None:
    """Find the nearest area light, the lowest index on ties, of each light of a worker's tiles."""
    scratch, pick, nearest = state.scratch[worker], state.picks[worker, 0], state.picks[worker, 1]
    for tile in range(worker, tiles, len(state.scratch)):
        first, count, k = state.tiles[0, tile], state.tiles[1, tile], state.tiles[2, tile]
        _distances(state.areas, len(state.members), state.areas, k, metric, state.rows[worker])
        pending, farthest = _doubtful(state, metric, first, count, k, scratch, state.rows[worker], pick)
        changed = 0
        if pending > 0:
            _search(scratch, pending, state.areas, metric, k, farthest, state.rows[worker], nearest)
            for j in range(pending):
                i = state.order[pick[j]]
                changed += nearest[j] != k
                state.of[i], state.own[i] = nearest[j], scratch[8, j]
        state.changed[tile] = changed


@kernel
def _distances(lights: Array, count: int, areas: Array, k: int, metric: Metric, out: Array) -> None:
    if metric.squared:
        fill_squares(lights, count, areas, k, metric.position, metric.angle, out)
    else:
        fill_linear(lights, count, areas, k, metric.position, metric.angle, out)


@kernel
def _doubtful(
    state: Rounds, metric: Metric, first: int, count: int, k: int, scratch: Array, row: Array, pick: Array
) -> tuple[int, float]:
    """Gather a tile's lights, of area light k, that may be nearer to another; return how many and the farthest."""
    for j in range(count):
        i = state.order[first + j]
        for c in range(6):
            scratch[c, j] = state.lights[c, i]
    _distances(scratch, count, state.areas, k, metric, scratch[7])
    gap = np.inf
    for m in range(len(row)):
        gap = min(gap, row[m]) if m != k else gap
    pending, farthest = 0, 0.0
    for j in range(count):
        own = scratch[7, j]
        state.own[state.order[first + j]] = own
        if gap <= _twice(own, metric):
            for c in range(6):
                scratch[c, pending] = scratch[c, j]
            scratch[7, pending], pick[pending] = own, first + j
            farthest = max(farthest, own)
            pending += 1
    return pending, farthest


@kernel
def _twice(distance: float, metric: Metric) -> float:
    """Return twice a distance, four times where squared, and some more than rounding takes from it."""
    return (4.0 if metric.squared else 2.0) * distance * (1.0 + 1e-9) + metric.slack


@kernel
def _search(
    scratch: Array, count: int, areas: Array, metric: Metric, own: int, farthest: float, row: Array, nearest: Array
) -> None:
    """Find the nearest area light of gathered lights of the area light `own`, the lowest index on ties."""
    within, distance, least = _twice(farthest, metric), scratch[6], scratch[8]
    for j in range(count):
        least[j], nearest[j] = np.inf, own
    for k in range(len(row)):
        if k != own and row[k] > within:
            continue
        _distances(scratch, count, areas, k, metric, distance)
        for j in range(count):
            nearer = distance[j] < least[j]
            nearest[j] = k if nearer else nearest[j]
            least[j] = distance[j] if nearer else least[j]


@kernel
def _total(values: Any) -> Any:
    """Return the sum of values in their order."""
    result = values.dtype.type(0)
    for i in range(len(values)):
        result += values[i]
    return result

"""The soft shadow of one area light by the step itself: every texel compared, none filtered.

What the filtered series approximates, with two rules that the paper lacks. A texel hides the receiver if its depth
lies before the receiver's tangent plane along the texel's own direction (receiver plane), since on a radial map a flat
receiver is nearer to the centre at neighbouring texels; and it counts as a blocker in the search only within the cone
from the receiver to the light (cone), as the search disc is sized for the nearest depth of the whole map.

Symbols: d distance of the receiver (m), z stored depth, s depth along the axis towards the receiver, Delta the light.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.cluster.filters.depth_scale import DepthScale
from refgi.cluster.maps.hard import SLACK
from refgi.cluster.settings import ValSettings
from refgi.cluster.visibility.kernel_size import cone_tangent, disc, published_square, published_tangent
from refgi.cluster.visibility.look import DEPTH, EXTENT, FRAME, NEAREST, RADIUS, Choices, D, S, T, X, Y, Z
from refgi.jit import kernel

Array = npt.NDArray[Any]


class Rules(NamedTuple):
    """What counts as a blocker."""

    receiver_plane: bool  # before the receiver's tangent plane; else nearer than the receiver by a bias
    cone: bool  # within the cone from the receiver to the light, in the search
    share: Any  # of its distance that a receiver keeps, and
    bias: Any  # m that it loses; without `receiver_plane` alone


def rules(settings: ValSettings, scale: DepthScale) -> Rules:
    """Return what counts as a blocker by settings.

    Parameters
    ----------
    settings : ValSettings
        `receiver_plane`, `cone` and, where the receiver's plane does not count, `bias` do.
    scale : DepthScale
        The series' scale, on which a bias is given.

    Returns
    -------
    Rules
        Two flags and the bias, on a logarithmic scale a factor; none where none is given, as the step needs none.
    """
    along = (settings.bias or 0.0) / scale.slope
    moved = (2.0**-along, 0.0) if scale.logarithmic else (1.0, along)
    return Rules(settings.receiver_plane, settings.cone, *moved)


@kernel
def step_lanes(
    numbers: Array, choices: Choices, rule: Rules, depth: Array, facing: Array, size: int, todo: Array, visible: Array,
    room: Array,
) -> None:
    """Compare each receiver with every texel of its search disc, then of its penumbra's disc.

    Parameters
    ----------
    numbers : (NUMBERS,) ndarray
        The area light.
    choices : Choices
        How filters are sized.
    rule : Rules
        What counts as a blocker.
    depth : (n, n) ndarray
        The map, m; inf where nothing is seen.
    facing : (3, >= size) ndarray
        Normals of the receivers' surfaces, on either side.
    size : int
        How many receivers.
    todo : (>= size,) ndarray of bool
        Which of them.
    visible : (>= size,) ndarray
        Filled where `todo`: V = 1 - share of the penumbra's disc that is blocked.
    room : (ROOM_ROWS, >= size) ndarray
        Receivers and search discs; S to RADIUS become those of the penumbra, DEPTH z_avg, m.
    """
    real = room.dtype.type
    one, near = real(1.0), numbers[NEAREST]
    for i in range(size):
        if not todo[i]:
            continue
        x, y, z, d, extent = room[X, i], room[Y, i], room[Z, i], room[D, i], room[EXTENT, i]
        a, b, c = in_frame(numbers, facing, i)
        count, blocked, total = blockers_in(depth, rule, (room[S, i], room[T, i], room[RADIUS, i]), (x, y, z, d),
                                            (a, b, c), extent, True)  # fmt: skip
        if blocked == 0:
            continue
        mean = min(max(total / real(blocked), near), d)
        room[DEPTH, i] = mean
        tangent = published_tangent(extent, d, mean) if choices.alpha else cone_tangent(extent, d, mean)
        where = published_square(x, y, z, d, tangent) if choices.alpha_over_pi else disc(x, y, z, d, tangent)
        room[S, i], room[T, i], room[RADIUS, i] = where
        count, blocked, total = blockers_in(depth, rule, where, (x, y, z, d), (a, b, c), extent, False)
        visible[i] = one - real(blocked) / real(max(count, 1))


@kernel
def in_frame(numbers: Array, vectors: Array, i: int) -> tuple[Any, Any, Any]:
    """Return a vector in the map's frame.

    Parameters
    ----------
    numbers : (NUMBERS,) ndarray
        The area light.
    vectors : (3, n) ndarray
        World space.
    i : int
        Which one.

    Returns
    -------
    tuple of 3 floats
        Along right, down, forward.
    """
    vx, vy, vz = vectors[0, i], vectors[1, i], vectors[2, i]
    return (
        vx * numbers[FRAME] + vy * numbers[FRAME + 1] + vz * numbers[FRAME + 2],
        vx * numbers[FRAME + 3] + vy * numbers[FRAME + 4] + vz * numbers[FRAME + 5],
        vx * numbers[FRAME + 6] + vy * numbers[FRAME + 7] + vz * numbers[FRAME + 8],
    )


@kernel
def blockers_in(
    depth: Array, rule: Rules, where: Any, receiver: Any, normal: Any, extent: Any, search: bool
) -> tuple[int, int, Any]:
    """Count the texels of a disc that hide a receiver.

    Parameters
    ----------
    depth : (n, n) ndarray
        The map, m.
    rule : Rules
        What counts as a blocker.
    where : tuple of 3 floats
        Centre and radius of the disc, in [-1, 1] units.
    receiver : tuple of 4 floats
        In the map's frame, and its distance, m.
    normal : tuple of 3 floats
        Of the receiver's surface, in the map's frame.
    extent : float
        Size of the light, m.
    search : bool
        Whether the cone counts.

    Returns
    -------
    count, blocked : int
        Texels with their centre in the disc, at least the nearest one, and within the hemisphere; those that hide.
    total : float
        Sum of the depths of those, m.
    """
    cs, ct, radius = where
    n = depth.shape[0]
    first, last = _texels(cs, radius, n)
    top, bottom = _texels(ct, radius, n)
    found = _scan(depth, rule, (first, last, top, bottom), (cs, ct, radius * radius), receiver, normal, extent, search)
    if found[0] > 0:
        return found
    column, row = _nearest(cs, n), _nearest(ct, n)
    everywhere = (cs, ct, type(radius)(np.inf))
    return _scan(depth, rule, (column, column, row, row), everywhere, receiver, normal, extent, search)


@kernel
def _scan(
    depth: Array, rule: Rules, box: Any, around: Any, receiver: Any, normal: Any, extent: Any, search: bool
) -> tuple[int, int, Any]:
    real = depth.dtype.type
    one, two, half, n = real(1.0), real(2.0), real(0.5), depth.shape[0]
    cs, ct, square = around
    step = two / real(n)
    first, last, top, bottom = box
    count, blocked, total = 0, 0, real(0.0)
    for row in range(top, bottom + 1):
        t = (real(row) + half) * step - one
        for column in range(first, last + 1):
            s = (real(column) + half) * step - one
            inside = s * s + t * t
            if (s - cs) * (s - cs) + (t - ct) * (t - ct) > square or inside > one:
                continue
            count += 1
            z = depth[row, column]
            scale = one / (one + inside)
            w = (two * s * scale, two * t * scale, (one - inside) * scale)
            width = step * scale  # half of what the texel is wide, as an angle
            if not hides(z, w, rule, receiver, normal) or (
                search and rule.cone and outside(z, w, width, receiver, extent)
            ):
                continue
            blocked += 1
            total += z
    return count, blocked, total


@kernel
def _texels(middle: Any, radius: Any, n: int) -> tuple[int, int]:
    """Return the first and last texel with its centre within the radius."""
    half, size = type(middle)(0.5), type(middle)(n)
    place, reach = (middle + type(middle)(1.0)) * half * size - half, radius * half * size
    return max(math.ceil(place - reach), 0), min(math.floor(place + reach), n - 1)


@kernel
def _nearest(middle: Any, n: int) -> Any:
    place = (middle + type(middle)(1.0)) * type(middle)(0.5) * type(middle)(n)
    return min(max(math.floor(place), 0), n - 1)


@kernel
def hides(z: Any, w: Any, rule: Rules, receiver: Any, normal: Any) -> Any:
    """Tell whether a depth lies before a receiver, along the texel's direction.

    Parameters
    ----------
    z : float
        Stored depth, m.
    w : tuple of 3 floats
        Direction of the texel, in the map's frame.
    rule : Rules
        What counts as a blocker.
    receiver : tuple of 4 floats
        In the map's frame, and its distance, m.
    normal : tuple of 3 floats
        Of its surface.

    Returns
    -------
    bool
        z < d_plane(w) (1 - slack); where the plane is not met, the receiver's own distance stands in.
    """
    x, y, depth, d = receiver
    limit = d * type(d)(rule.share) - type(d)(rule.bias)
    if rule.receiver_plane:
        a, b, c = normal
        height, slope = a * x + b * y + c * depth, a * w[0] + b * w[1] + c * w[2]
        limit = height / slope if height * slope > type(d)(0.0) else d
    return z < limit * type(d)(1.0 - SLACK)


@kernel
def outside(z: Any, w: Any, width: Any, receiver: Any, extent: Any) -> Any:
    """Tell whether all that a texel stands for lies outside the cone from the receiver to the light.

    Parameters
    ----------
    z : float
        Its depth, m.
    w : tuple of 3 floats
        Its direction, in the map's frame.
    width : float
        Half of its width, as an angle.
    receiver : tuple of 4 floats
        In the map's frame, and its distance, m.
    extent : float
        Size of the light, m.

    Returns
    -------
    bool
        Whether it lies beyond the receiver, or its offset from the axis exceeds (Delta / 2)(1 - s / d) by more than
        half its diagonal: near the receiver the cone is narrower than a texel, and would miss what touches it.
    """
    x, y, depth, d = receiver
    along = (x * w[0] + y * w[1] + depth * w[2]) * z / d
    a, b, c = y * w[2] - depth * w[1], depth * w[0] - x * w[2], x * w[1] - y * w[0]
    offset = math.sqrt(a * a + b * b + c * c) / d - type(d)(math.sqrt(2.0)) * width
    return along >= d or z * offset > extent * type(d)(0.5) * (type(d)(1.0) - along / d)

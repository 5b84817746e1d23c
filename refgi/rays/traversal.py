"""Kernels that call Embree's functions for packets of sixteen rays by address.

A packet lies in a small buffer laid out as Embree's `RTCRayHit16`, a row of float32 for each of origin, tnear,
direction, time, tfar, mask, id, flags, then normal, u, v, triangle id, geometry id, instance ids; one row more says
which lanes are rays. Integers are written through an int32 view of the same memory. Rays that are not to be traced take
no lane. Each ray finds what it finds alone. Addresses are run-time values, so compiled kernels can be kept on disk.
"""

from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from refgi.jit import kernel, prange
from refgi.types import Array

CHUNK = 1024  # rays that one parallel iteration owns
LANES = 16
DIRECTION, REACH, MASK, TRIANGLE, GEOMETRY, VALID, ROWS = 4, 8, 9, 17, 18, 21, 22  # rows of a packet


class Calls(NamedTuple):
    """Addresses of `rtcIntersect16`, `rtcOccluded16` and of a built scene."""

    closest: np.uint64
    occluded: np.uint64
    scene: np.uint64
    first: int  # triangles of its first mesh where there are two: the number of the second mesh's first one


def _call_by_address(_: Any, function: Any, valid: Any, scene: Any, packet: Any) -> Any:  # noqa: ARG001
    """Type and emit a call of `void function(valid, scene, packet, NULL)`."""

    def generate(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        byte = ir.IntType(8).as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [byte, byte, byte, byte])
        target = builder.inttoptr(arguments[0], kind.as_pointer())
        pointers = [builder.inttoptr(argument, byte) for argument in arguments[1:]]
        builder.call(target, [*pointers, ir.Constant(byte, None)])
        return context.get_dummy_value()

    return types.void(types.uint64, types.uint64, types.uint64, types.uint64), generate


_call: Any = intrinsic(_call_by_address)


@kernel
def _empty_packet() -> Array:
    """Return a packet without rays, (ROWS, LANES), aligned as Embree wants it."""
    block = np.zeros((ROWS + 1) * LANES, np.float32)
    skip = (64 - np.int64(block.ctypes.data) % 64) // 4 % LANES
    packet = block[skip : skip + ROWS * LANES].reshape(ROWS, LANES)
    packet.view(np.int32)[MASK] = -1  # every geometry
    return packet


@kernel
def _load(packet: Array, lane: int, origins: Array, directions: Array, reach: Array, i: int) -> None:
    for c in range(3):
        packet[c, lane] = origins[i, c]
        packet[DIRECTION + c, lane] = directions[i, c]
    packet[REACH, lane] = reach[i]


@kernel
def _trace(function: Any, scene: Any, packet: Array, count: int) -> None:
    """Trace the first `count` rays of a packet."""
    bits = packet.view(np.int32)
    for lane in range(LANES):
        bits[VALID, lane] = -1 if lane < count else 0
        bits[TRIANGLE, lane] = bits[GEOMETRY, lane] = bits[GEOMETRY + 1, lane] = -1  # nothing yet
    address = np.uint64(packet.ctypes.data)
    _call(function, address + np.uint64(4 * LANES * VALID), scene, address)


@kernel(parallel=True)
def closest_hits(calls: Calls, origins: Array, directions: Array, reach: Array, triangle_id: Array,
                 distance: Array) -> None:
    """Find the nearest triangle along each ray.

    `calls`: Embree's functions and scene. `origins`, `directions` (n, 3) float32: rays, world space; distances count in
    lengths of `directions`. `reach` (n,) float32: how far to look; inf for no limit, rays of `reach` <= 0 miss
    untraced. `triangle_id` (n,) int32: filled with the triangle, -1 for a miss. `distance` (n,) float32: filled with
    the distance, inf for a miss.
    """
    count = len(origins)
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        _closest_span(calls, origins, directions, reach, triangle_id, distance, chunk * CHUNK,
                      min(count, chunk * CHUNK + CHUNK))


@kernel
def _closest_span(calls: Calls, origins: Array, directions: Array, reach: Array, triangle_id: Array, distance: Array,
                  low: int, high: int) -> None:
    packet, rays, n = _empty_packet(), np.empty(LANES, np.int64), 0
    bits = packet.view(np.int32)
    for i in range(low, high):
        triangle_id[i], distance[i] = -1, np.inf
        if reach[i] > 0:
            _load(packet, n, origins, directions, reach, i)
            rays[n] = i
            n += 1
        if n == LANES or (n > 0 and i == high - 1):
            _trace(calls.closest, calls.scene, packet, n)
            for lane in range(n):
                if bits[TRIANGLE, lane] >= 0:
                    second = calls.first if bits[GEOMETRY, lane] > 0 else 0
                    triangle_id[rays[lane]], distance[rays[lane]] = bits[TRIANGLE, lane] + second, packet[REACH, lane]
            n = 0


@kernel(parallel=True)
def occlusions(calls: Calls, origins: Array, directions: Array, reach: Array, blocked: Array) -> None:
    """Return whether any triangle lies on each ray before `reach`.

    `calls`: Embree's functions and scene. `origins`, `directions` (n, 3) float32: rays, world space; distances count in
    lengths of `directions`. `reach` (n,) float32: how far to look; rays of `reach` <= 0 count as blocked and are not
    traced. `blocked` (n,) bool: filled with the answers.
    """
    count = len(origins)
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        _occluded_span(calls, origins, directions, reach, blocked, chunk * CHUNK, min(count, chunk * CHUNK + CHUNK))


@kernel
def _occluded_span(calls: Calls, origins: Array, directions: Array, reach: Array, blocked: Array, low: int,
                   high: int) -> None:
    packet, rays, n = _empty_packet(), np.empty(LANES, np.int64), 0
    for i in range(low, high):
        blocked[i] = True
        if reach[i] > 0:
            _load(packet, n, origins, directions, reach, i)
            rays[n] = i
            n += 1
        if n == LANES or (n > 0 and i == high - 1):
            _trace(calls.occluded, calls.scene, packet, n)
            for lane in range(n):
                blocked[rays[lane]] = packet[REACH, lane] < 0  # Embree marks a blocked ray by tfar = -inf
            n = 0

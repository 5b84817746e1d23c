"""Kernels that call Embree's single-ray functions by address.

A ray lies in a small float32 buffer laid out as Embree's `RTCRayHit`: origin, tnear, direction, time, tfar, mask,
id, flags, then normal, u, v, triangle id, geometry id, instance ids. The integer fields are written through an int32
view of the same memory. Addresses are run-time values, so compiled kernels can be kept on disk.
"""

from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from refgi.jit import kernel, prange
from refgi.types import Array

CHUNK = 1024  # rays that one parallel iteration owns


class Calls(NamedTuple):
    """Addresses of `rtcIntersect1`, `rtcOccluded1` and of a built scene."""

    closest: np.uint64
    occluded: np.uint64
    scene: np.uint64
    first: int  # triangles of its first mesh where there are two: the number of the second mesh's first one


def _call_by_address(_: Any, function: Any, scene: Any, ray: Any) -> Any:  # noqa: ARG001
    """Type and emit a call of `void function(scene, ray, NULL)`."""

    def generate(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        byte = ir.IntType(8).as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [byte, byte, byte])
        target = builder.inttoptr(arguments[0], kind.as_pointer())
        pointers = [builder.inttoptr(argument, byte) for argument in arguments[1:]]
        builder.call(target, [*pointers, ir.Constant(byte, None)])
        return context.get_dummy_value()

    return types.void(types.uint64, types.uint64, types.uint64), generate


_call: Any = intrinsic(_call_by_address)


@kernel
def _load(ray: Array, bits: Array, origins: Array, directions: Array, reach: Array, i: int) -> None:
    for c in range(3):
        ray[c] = origins[i, c]
        ray[4 + c] = directions[i, c]
    ray[3] = 0
    ray[7] = 0
    ray[8] = reach[i]
    bits[9] = -1  # mask: every geometry
    bits[10] = 0
    bits[11] = 0
    bits[17] = -1  # no triangle yet
    bits[18] = -1
    bits[19] = -1


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
        ray = np.empty(32, np.float32)
        bits = ray.view(np.int32)
        for i in range(chunk * CHUNK, min(count, chunk * CHUNK + CHUNK)):
            bits[17] = bits[18] = -1
            if reach[i] > 0:
                _load(ray, bits, origins, directions, reach, i)
                _call(calls.closest, calls.scene, ray.ctypes.data)
            triangle_id[i] = bits[17] if bits[18] <= 0 else bits[17] + calls.first
            distance[i] = ray[8] if bits[17] >= 0 else np.inf


@kernel(parallel=True)
def occlusions(calls: Calls, origins: Array, directions: Array, reach: Array, blocked: Array) -> None:
    """Return whether any triangle lies on each ray before `reach`.

    `calls`: Embree's functions and scene. `origins`, `directions` (n, 3) float32: rays, world space; distances count in
    lengths of `directions`. `reach` (n,) float32: how far to look; rays of `reach` <= 0 count as blocked and are not
    traced. `blocked` (n,) bool: filled with the answers.
    """
    count = len(origins)
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        ray = np.empty(32, np.float32)
        bits = ray.view(np.int32)
        for i in range(chunk * CHUNK, min(count, chunk * CHUNK + CHUNK)):
            ray[8] = -np.inf
            if reach[i] > 0:
                _load(ray, bits, origins, directions, reach, i)
                _call(calls.occluded, calls.scene, ray.ctypes.data)
            blocked[i] = ray[8] < 0  # Embree marks a blocked ray by tfar = -inf

"""Embree's packets of eight coherent rays, on all threads: the yardstick of `benchmarks.raster`.

The rays of a camera lie in memory beforehand, eight to a packet, in blocks of 4 x 2 pixels; the tree is built
beforehand as well. What is timed is `rtcIntersect8` with the flag for coherent rays, and nothing of what it finds is
turned into positions, normals or colours.
"""

import ctypes
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from refgi.jit import kernel, prange
from refgi.rays import embree
from refgi.rsm.raster.projection import Projection
from refgi.scene import Geometry
from refgi.types import Array

WIDE, HIGH, LANES = 4, 2, 8
# rows of a packet: origin, tnear, direction, time, tfar, mask, id, flags; normal, u, v, triangle, geometry, 2 instances
ROWS, DIRECTION, REACH, MASK, HIT, GEOMETRY = 21, 4, 8, 9, 17, 18
ARGUMENTS = 64  # bytes: flags of RTCIntersectArguments, of which bit 16 says that rays are coherent
COHERENT = 1 << 16
SHARE = 64  # packets that one parallel iteration traces


def _call_by_address(_: Any, function: Any, valid: Any, scene: Any, packet: Any, arguments: Any) -> Any:  # noqa: ARG001
    """Type and emit a call of `void function(valid, scene, packet, arguments)`."""

    def generate(context: Any, builder: Any, _: Any, values: Any) -> Any:
        byte = ir.IntType(8).as_pointer()
        target = builder.inttoptr(values[0], ir.FunctionType(ir.VoidType(), [byte] * 4).as_pointer())
        builder.call(target, [builder.inttoptr(value, byte) for value in values[1:]])
        return context.get_dummy_value()

    return types.void(*[types.uint64] * 5), generate


_call: Any = intrinsic(_call_by_address)


@kernel(parallel=True)
def _trace(function: int, scene: int, arguments: int, rays: Array, triangle_id: Array, distance: Array) -> None:
    packets = len(rays)
    for share in prange((packets + SHARE - 1) // SHARE):
        block = np.empty(ROWS * LANES + 16, np.float32)
        skip = (64 - np.int64(block.ctypes.data) % 64) // 4 % 16  # packets are aligned
        packet = block[skip : skip + ROWS * LANES]
        bits, valid = packet.view(np.int32), np.full(16, -1, np.int32)
        for p in range(share * SHARE, min((share + 1) * SHARE, packets)):
            for lane in range(LANES):
                for axis in range(3):
                    packet[axis * LANES + lane] = rays[p, axis, lane]
                    packet[(DIRECTION + axis) * LANES + lane] = rays[p, 3 + axis, lane]
                packet[3 * LANES + lane], packet[7 * LANES + lane] = 0.0, 0.0
                packet[REACH * LANES + lane], bits[MASK * LANES + lane] = np.inf, -1
                bits[(MASK + 1) * LANES + lane], bits[(MASK + 2) * LANES + lane] = 0, 0
                bits[HIT * LANES + lane], bits[GEOMETRY * LANES + lane] = -1, -1
            _call(function, np.uint64(valid.ctypes.data), scene, np.uint64(packet.ctypes.data), arguments)
            for lane in range(LANES):
                triangle_id[p, lane], distance[p, lane] = bits[HIT * LANES + lane], packet[REACH * LANES + lane]


class Packets:
    """The rays of one perspective map, of a multiple of 4 columns and of 2 rows, and the tree of a scene."""

    def __init__(self, geometry: Geometry, view: Projection) -> None:
        library: Any = embree._library()
        self._backend = embree.AddressBackend(library, geometry.vertices.astype(np.float32), geometry.faces)
        self._function = np.uint64(ctypes.cast(library.rtcIntersect8, ctypes.c_void_p).value or 0)
        self._arguments = np.zeros(ARGUMENTS // 4, np.uint32)
        self._arguments[0] = COHERENT
        self._shape = view.height, view.width
        self._rays = _packed_rays(view)
        self._found = np.empty((len(self._rays), LANES), np.int32), np.empty((len(self._rays), LANES), np.float32)

    def trace(self) -> None:
        """Find the nearest triangle of each ray."""
        _trace(self._function, self._backend.calls.scene, np.uint64(self._arguments.ctypes.data), self._rays,
               *self._found)

    def triangle_id(self) -> Array:
        """Return what the last trace found, (h, w) int32, -1 for nothing."""
        height, width = self._shape
        blocks = self._found[0].reshape(height // HIGH, width // WIDE, HIGH, WIDE)
        return np.ascontiguousarray(blocks.swapaxes(1, 2)).reshape(height, width)


def _packed_rays(view: Projection) -> Array:
    """Return origins and directions, (packets, 6, 8) float32."""
    row, column = np.mgrid[: view.height, : view.width] + 0.5
    x, y = view.half[0] * (2 * column / view.width - 1), view.half[1] * (2 * row / view.height - 1)
    directions = np.stack([x, y, np.ones_like(x)], axis=-1) @ view.frame[0]
    rays = np.concatenate([np.broadcast_to(view.origin[0], directions.shape), directions], axis=-1)
    blocks = rays.reshape(view.height // HIGH, HIGH, view.width // WIDE, WIDE, 6).transpose(0, 2, 4, 1, 3)
    return np.ascontiguousarray(blocks.reshape(-1, 6, LANES), np.float32)

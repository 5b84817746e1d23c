"""Cut-outs along rays: a hit in a hole is none.

Embree asks a filter function for each triangle that it is about to count as a hit, of those triangles alone that may
have holes, which make up a mesh of their own. It goes on with the traversal where the filter says no: nothing behind is
missed, neither at the same distance, and rays are not started anew. The filter is compiled here; its address is what
Embree calls.

The texture coordinates of a hit are those of its barycentric coordinates, from the ray in float64 and the triangle as
the scene has it (Moeller & Trumbore 1997): with the ray's own rounding those of the rasterizer.
"""

from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic
from numba.np.numpy_support import carray

from refgi.jit import kernel, prange
from refgi.scene import Geometry
from refgi.scene.texture.lookup import NO_MASKS, AlphaTable, is_opaque
from refgi.types import Array

CHUNK = 1024  # rays that one parallel iteration owns
BYTES = ir.IntType(8).as_pointer()
# words of Embree's RTCFilterFunctionNArguments
VALID, USER, CONTEXT, RAY, HIT, COUNT = range(6)
PRIMITIVE = 5  # row of a packet's hits: which triangle


class RayHoles(NamedTuple):
    """The triangles that may have holes, c of them."""

    of_face: Array  # (m,) int32: which of them each triangle is, -1 for one without holes; (0,) where none has any
    corner: Array  # (c, 9) float64, m: first corner, the edges from it to the second and the third
    uv: Array  # (c, 6) float64: u and v at the first corner, their change along either edge
    mask: Array  # (c,) int64: row of the table
    table: AlphaTable


def ray_holes(geometry: Geometry) -> RayHoles:
    """Return a geometry's triangles that may have holes, as rays ask for them."""
    cut = geometry.cut
    if cut is None:
        return RayHoles(np.zeros(0, np.int32), np.zeros((0, 9)), np.zeros((0, 6)), np.zeros(0, np.int64), NO_MASKS)
    corner = np.asarray(geometry.vertices, np.float64)[geometry.faces[cut.face]]
    corner[:, 1:] -= corner[:, :1]
    uv = cut.uv.reshape(-1, 3, 2).copy()
    uv[:, 1:] -= uv[:, :1]
    return RayHoles(cut.of_face, corner.reshape(-1, 9), uv.reshape(-1, 6), cut.mask, cut.table)


@kernel
def is_there(holes: RayHoles, k: int, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float) -> bool:
    """Return whether the k-th triangle is there where a ray meets its plane."""
    corner, uv = holes.corner, holes.uv
    ax, ay, az = corner[k, 3], corner[k, 4], corner[k, 5]
    bx, by, bz = corner[k, 6], corner[k, 7], corner[k, 8]
    px, py, pz = dy * bz - dz * by, dz * bx - dx * bz, dx * by - dy * bx
    det = ax * px + ay * py + az * pz
    sx, sy, sz = ox - corner[k, 0], oy - corner[k, 1], oz - corner[k, 2]
    qx, qy, qz = sy * az - sz * ay, sz * ax - sx * az, sx * ay - sy * ax
    p, q = (sx * px + sy * py + sz * pz) / det, (dx * qx + dy * qy + dz * qz) / det
    return is_opaque(holes.table, holes.mask[k], uv[k, 0] + p * uv[k, 2] + q * uv[k, 4],
                     uv[k, 1] + p * uv[k, 3] + q * uv[k, 5])


@kernel(parallel=True)
def mark_holes(holes: RayHoles, numbers: Array, origins: Array, directions: Array, hole: Array) -> None:
    """Mark which rays meet the planes of triangles, each that of one number, in a hole."""
    count = len(numbers)
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        for i in range(chunk * CHUNK, min(count, chunk * CHUNK + CHUNK)):
            hole[i] = not is_there(
                holes, numbers[i], np.float64(origins[i, 0]), np.float64(origins[i, 1]), np.float64(origins[i, 2]),
                np.float64(directions[i, 0]), np.float64(directions[i, 1]), np.float64(directions[i, 2]))


class Filter:
    """What Embree is given: the address of the filter, and that of the record that it reads.

    `numbers`, (p,): which triangle of `holes` each triangle of Embree's mesh is.
    """

    def __init__(self, holes: RayHoles, numbers: Array) -> None:
        table = holes.table
        # kept alive with the record
        self._arrays = (np.ascontiguousarray(numbers, np.int64), holes.corner, holes.uv, holes.mask, table.alpha,
                        table.mask, table.limit)
        self._record = np.array([word for array in self._arrays for word in (array.ctypes.data, len(array))], np.int64)
        self.function = int(filter_address())
        self.record = int(self._record.ctypes.data)


def _pointer_of(_: Any, address: Any) -> Any:  # noqa: ARG001
    def generate(context: Any, builder: Any, _: Any, arguments: Any) -> Any:  # noqa: ARG001
        return builder.inttoptr(arguments[0], BYTES)

    return types.voidptr(types.intp), generate


_pointer: Any = intrinsic(_pointer_of)


@kernel
def _reject(address: int) -> None:
    """Refuse each hit that Embree asks for, one of each of a packet's rays, where it lies in a hole."""
    words = carray(_pointer(address), 6, np.int64)
    record = carray(_pointer(words[USER]), 14, np.int64)
    lanes = words[COUNT] & 0xFFFFFFFF
    ray, hit = carray(_pointer(words[RAY]), 7 * lanes, np.float32), carray(_pointer(words[HIT]), 6 * lanes, np.int32)
    valid = carray(_pointer(words[VALID]), lanes, np.int32)
    table = AlphaTable(carray(_pointer(record[8]), record[9], np.float32),
                       carray(_pointer(record[10]), (record[11], 6), np.int64),
                       carray(_pointer(record[12]), (record[13], 2), np.float64))
    numbers = carray(_pointer(record[0]), record[1], np.int64)
    holes = RayHoles(carray(_pointer(record[0]), 0, np.int32),
                     carray(_pointer(record[2]), (record[3], 9), np.float64),
                     carray(_pointer(record[4]), (record[5], 6), np.float64),
                     carray(_pointer(record[6]), record[7], np.int64), table)
    for k in range(lanes):
        if valid[k] and not is_there(
                holes, numbers[hit[PRIMITIVE * lanes + k]], np.float64(ray[k]), np.float64(ray[lanes + k]),
                np.float64(ray[2 * lanes + k]), np.float64(ray[4 * lanes + k]), np.float64(ray[5 * lanes + k]),
                np.float64(ray[6 * lanes + k])):
            valid[k] = 0


def _entry_of(_: Any, function: Any) -> Any:
    """Type and emit the address of a function `void f(arguments)` that calls a kernel."""
    result = function.dispatcher.lowered((types.intp,))

    def generate(context: Any, builder: Any, _: Any, arguments: Any) -> Any:  # noqa: ARG001
        context.add_linking_libs([result.library])
        kind = ir.FunctionType(ir.VoidType(), [BYTES])
        entry = ir.Function(builder.module, kind, builder.module.get_unique_name(f"{builder.function.name}.entry"))
        entry.linkage = "internal"
        inner = ir.IRBuilder(entry.append_basic_block("entry"))
        callee = context.declare_function(builder.module, result.fndesc)
        address = inner.ptrtoint(entry.args[0], ir.IntType(64))
        context.call_conv.call_function(inner, callee, result.fndesc.restype, result.fndesc.argtypes, [address])
        inner.ret_void()
        return builder.ptrtoint(entry, ir.IntType(64))

    return types.intp(function), generate


_entry: Any = intrinsic(_entry_of)


@kernel
def filter_address() -> int:
    """Return the address of the filter function."""
    address: int = _entry(_reject)
    return address

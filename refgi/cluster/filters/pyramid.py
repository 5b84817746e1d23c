"""Mip maps of the basis (Sec. 6) as they lie in memory: 8 lanes hold a texel's channels.

Sums over a few texels are too short for the compiler to join into SIMD lanes: `load`, `add`, `scale`, `store` and
`transpose` work on 8 neighbours at once, in plain IEEE arithmetic, without checks of bounds. Level l halves level l - 1
by the mean of 2 x 2 texels; of an odd side the last row and column count twice. Level 0, three quarters of a pyramid,
is computed from the depths where it is read, to the same bits.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from llvmlite import ir
from numba import types
from numba.core import cgutils as untyped_cgutils
from numba.extending import intrinsic, models, register_model
from numba.np import arrayobj as untyped_arrayobj

from refgi.cluster.filters.basis import beyond_disc, eight_bits, half_precision, sine_cosine, turned
from refgi.jit import kernel
from refgi.rsm.pool import zeros
from refgi.types import Array

cgutils: Any = untyped_cgutils
arrayobj: Any = untyped_arrayobj

EIGHT = 8
INDEX = ir.IntType(32)
Emitted = tuple[Any, Callable[..., Any]]


class EightType(types.Type):
    """Eight float32 or eight float64, a type of Numba."""

    def __init__(self, real: Any) -> None:
        self.real = real
        super().__init__(name=f"Eight({real})")


@register_model(EightType)
class EightModel(models.PrimitiveModel):
    """Held as an LLVM vector."""

    def __init__(self, manager: Any, kind: EightType) -> None:
        element = ir.FloatType() if kind.real == types.float32 else ir.DoubleType()
        super().__init__(manager, kind, ir.VectorType(element, EIGHT))  # type: ignore[no-untyped-call]


def _place(context: Any, builder: Any, kind: Any, array: Any, index: Any) -> tuple[Any, int]:
    """Return the address of 8 numbers of an array, and its alignment in bytes."""
    data = context.make_array(kind)(context, builder, array).data
    vector = ir.VectorType(context.get_data_type(kind.dtype), EIGHT)
    return builder.bitcast(builder.gep(data, [index]), vector.as_pointer()), kind.dtype.bitwidth // 8


def _load(_: Any, array: Any, index: Any) -> Emitted:  # noqa: ARG001
    """Emit the load of array.flat[index : index + 8]; the array is contiguous."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place, alignment = _place(context, builder, signature.args[0], *arguments)
        return builder.load(place, align=alignment)

    return EightType(array.dtype)(array, types.intp), emit


def _store(_: Any, array: Any, index: Any, value: Any) -> Emitted:  # noqa: ARG001
    """Emit array.flat[index : index + 8] = value; the array is contiguous."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place, alignment = _place(context, builder, signature.args[0], *arguments[:2])
        builder.store(arguments[2], place, align=alignment)
        return context.get_dummy_value()

    return types.void(array, types.intp, value), emit


def _store_at(_: Any, array: Any, row: Any, column: Any, value: Any) -> Emitted:  # noqa: ARG001
    """Emit array[row, column : column + 8] = value; rows are contiguous, the array need not be."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array, row, column, value = arguments
        kind = signature.args[0]
        lines = context.make_array(kind)(context, builder, array)
        stride = builder.extract_value(lines.strides, 0)
        line = cgutils.pointer_add(builder, lines.data, builder.mul(row, stride), lines.data.type)
        place = builder.bitcast(builder.gep(line, [column]), value.type.as_pointer())
        builder.store(value, place, align=kind.dtype.bitwidth // 8)
        return context.get_dummy_value()

    return types.void(array, types.intp, types.intp, value), emit


def _add(_: Any, one: Any, other: Any) -> Emitted:
    """Emit the sum of two eights."""
    return one(one, other), lambda _context, builder, _signature, arguments: builder.fadd(*arguments)


def _scale(_: Any, value: Any, factor: Any) -> Emitted:  # noqa: ARG001
    """Emit the product of an eight and one number."""

    def emit(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        eight, number = arguments
        undefined = ir.Constant(eight.type, ir.Undefined)
        first = builder.insert_element(undefined, number, ir.Constant(INDEX, 0))
        all_lanes = ir.Constant(ir.VectorType(INDEX, EIGHT), [0] * EIGHT)
        return builder.fmul(eight, builder.shuffle_vector(first, undefined, all_lanes))

    return value(value, value.real), emit


def _transpose(_: Any, rows: Any) -> Emitted:
    """Emit the transposition of a tuple of 8 eights: blocks of 1, 2, 4 change places across the diagonal."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        lines = cgutils.unpack_tuple(builder, arguments[0])
        for step in (1, 2, 4):
            upper = [e if not e & step else EIGHT + e - step for e in range(EIGHT)]
            lower = [e + step if not e & step else EIGHT + e for e in range(EIGHT)]
            for i in (i for i in range(EIGHT) if not i & step):
                pair = lines[i], lines[i + step]
                lines[i], lines[i + step] = (
                    builder.shuffle_vector(*pair, ir.Constant(ir.VectorType(INDEX, EIGHT), mask))
                    for mask in (upper, lower))  # fmt: skip
        return context.make_tuple(builder, signature.return_type, lines)

    return rows(rows), emit


def stack_array(rows: int, lanes: int, kind: Any = None) -> Any:
    """Return a function for kernels: ``scratch(like)`` is (rows, lanes) on their stack, the same in every call."""

    def scratch(_: Any, like: Any) -> Emitted:
        array_type = types.Array(kind or like.dtype, 2, "C")

        def emit(context: Any, builder: Any, _signature: Any, _arguments: Any) -> Any:
            element = context.get_data_type(array_type.dtype)
            data = cgutils.alloca_once(builder, element, size=rows * lanes)
            data.align = 64
            size = array_type.dtype.bitwidth // 8
            word = ir.IntType(64)
            array = context.make_array(array_type)(context, builder)
            arrayobj.populate_array(
                array, data=data, shape=cgutils.pack_array(builder, [ir.Constant(word, n) for n in (rows, lanes)]),
                strides=cgutils.pack_array(builder, [ir.Constant(word, n) for n in (lanes * size, size)]),
                itemsize=ir.Constant(word, size), meminfo=None)  # fmt: skip
            return array._getvalue()

        return array_type(like), emit

    return intrinsic(scratch)


load: Any = intrinsic(_load)
store: Any = intrinsic(_store)
store_at: Any = intrinsic(_store_at)
add: Any = intrinsic(_add)
scale: Any = intrinsic(_scale)
transpose: Any = intrinsic(_transpose)


SLACK = 4  # texels behind the last level: the right and lower neighbours of its texels, which weigh 0
CHUNK = 128  # receivers whose texels and weights are kept at once
LEVEL, DIRECT = 4, 5  # rows of whole numbers: the finer level, and the first texel of the map where that is 0
MAP = 8  # first of 4 rows of weights of texels of the map
DEPTHS, SINES, COSINES, BY_SINES, BY_COSINES = (stack_array(1, CHUNK) for _ in range(5))


class Mip(NamedTuple):
    """One map's pyramid, or with a leading axis those of several."""

    depth: Array  # (n, n): t
    basis: Array  # (texels, 2 M padded): S_k, C_k of levels 1 and up
    basis_z: Array  # (texels, 2 M padded): t S_k, t C_k
    mean_depth: Array  # (texels,): means of t
    first: Array  # (levels,) int64: first texel of each level; of no use for level 0
    terms: int  # M
    shift: float  # added to every level that is read
    quantised: bool  # 8 bits for the basis, 16 for basis-z
    beyond: Array  # (count, 2) int32: texels beyond the unit disc and what they copy


def level_offsets(size: int) -> tuple[Array, int]:
    """Return where each level starts, (levels,), and the texels of levels 1 and up, which lie end to end."""
    sides = [size]
    while sides[-1] > 1:
        sides.append((sides[-1] + 1) // 2)
    texels = np.array([side * side for side in sides], np.int64)
    return np.maximum(np.cumsum(texels) - texels - texels[0], 0), int(texels[1:].sum())


def mips(
    count: int, size: int, terms: int, dtype: npt.DTypeLike, *, shift: float = 0.0, quantised: bool = False,
    mirrored: bool = False,
) -> Mip:
    """Allocate the pyramids of `count` maps of n x n texels with M terms, not yet filled; padding is 0.

    `shift` is added to the level of every read: 0 as published, negative for a narrower filter.
    """
    first, total = level_offsets(size)
    shape, width = (count, total + SLACK), -(-2 * terms // EIGHT) * EIGHT
    return Mip(zeros((count, size, size), dtype), zeros((*shape, width), dtype), zeros((*shape, width), dtype),
               zeros(shape, dtype), first, terms, shift, quantised, beyond_disc(size, mirrored))


@kernel
def mip_of(several: Mip, k: Any) -> Mip:
    """Return views of pyramid k of several."""
    return Mip(several.depth[k], several.basis[k], several.basis_z[k], several.mean_depth[k], several.first,
               several.terms, several.shift, several.quantised, several.beyond)


@kernel
def add_level_0(mip: Mip, with_z: bool, lanes: int, whole: Array, weights: Array, out: Array, start: int) -> None:
    """Add what lanes read of the map itself to `out` from lane `start` on; those that read none weigh 0."""
    if mip.quantised:
        _add_rounded(mip.depth, mip.terms, with_z, lanes, whole, weights, out, start)
    else:
        _add_exact(mip.depth, mip.terms, with_z, lanes, whole, weights, out, start)


@kernel
def _add_exact(
    depth: Array, terms: int, with_z: bool, lanes: int, whole: Array, weights: Array, out: Array, start: int
) -> None:
    depths, sines, cosines = DEPTHS(depth)[0], SINES(depth)[0], COSINES(depth)[0]
    by_sines, by_cosines = BY_SINES(depth)[0], BY_COSINES(depth)[0]
    for tap in range(4):
        _fetch(depth, tap, lanes, whole, depths)
        for lane in range(lanes):
            sine, cosine = sine_cosine(depths[lane])
            by_sines[lane], by_cosines[lane] = turned(sine, cosine, sine, cosine)
            sines[lane], cosines[lane] = weights[MAP + tap, lane] * sine, weights[MAP + tap, lane] * cosine
        for k in range(terms):
            _accumulate(sines, lanes, out[k], start)
            _accumulate(cosines, lanes, out[terms + k], start)
            if with_z:
                _accumulate_z(sines, depths, lanes, out[2 * terms + k], start)
                _accumulate_z(cosines, depths, lanes, out[3 * terms + k], start)
            for lane in range(lanes):
                sines[lane], cosines[lane] = turned(sines[lane], cosines[lane], by_sines[lane], by_cosines[lane])
        if with_z:
            _accumulate_z(weights[MAP + tap], depths, lanes, out[4 * terms], start)


@kernel
def _fetch(depth: Array, tap: int, lanes: int, whole: Array, depths: Array) -> None:
    n = len(depth)
    flat = depth.reshape(-1)
    step = tap // 2 * n + tap % 2
    for lane in range(lanes):
        depths[lane] = flat[min(whole[DIRECT, lane] + step, n * n - 1)]


@kernel
def _accumulate(values: Array, lanes: int, row: Array, start: int) -> None:
    for lane in range(lanes):
        row[start + lane] += values[lane]


@kernel
def _accumulate_z(values: Array, depths: Array, lanes: int, row: Array, start: int) -> None:
    for lane in range(lanes):
        row[start + lane] += values[lane] * depths[lane]


@kernel
def _add_rounded(
    depth: Array, terms: int, with_z: bool, lanes: int, whole: Array, weights: Array, out: Array, start: int
) -> None:
    flat, n = depth.reshape(-1), len(depth)
    for lane in range(lanes):
        if whole[LEVEL, lane] > 0:
            continue
        for tap in range(4):
            weight = weights[MAP + tap, lane]
            z = flat[min(whole[DIRECT, lane] + tap // 2 * n + tap % 2, n * n - 1)]
            sine, cosine = sine_cosine(z)
            by_sine, by_cosine = turned(sine, cosine, sine, cosine)
            for k in range(terms):
                out[k, start + lane] += weight * eight_bits(sine)
                out[terms + k, start + lane] += weight * eight_bits(cosine)
                if with_z:
                    out[2 * terms + k, start + lane] += weight * half_precision(z * sine)
                    out[3 * terms + k, start + lane] += weight * half_precision(z * cosine)
                sine, cosine = turned(sine, cosine, by_sine, by_cosine)
            if with_z:
                out[4 * terms, start + lane] += weight * half_precision(z)

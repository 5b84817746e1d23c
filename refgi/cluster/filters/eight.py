"""Vectors of 8 lanes for kernels whose SIMD lanes are a texel's channels.

The compiler joins loops over pixels into SIMD lanes by itself. Sums over a few texels of 8 channels each are too short
for that: it would check anew for every texel whether what is written overlaps what is read. Here a kernel says it:
`load`, `add`, `scale`, `store` and `transpose` work on 8 neighbours at once, in plain IEEE arithmetic. `stack_array` is
memory of the kernel's own stack, which needs no allocation and overlaps nothing. None of it checks bounds.
"""

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils as untyped_cgutils
from numba.extending import intrinsic, models, register_model
from numba.np import arrayobj as untyped_arrayobj

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
    """Return a function for kernels that gives scratch on their stack, the same scratch for every call in one kernel.

    ``scratch(like)`` is a (rows, lanes) array that holds anything, of numbers of `kind`, else of the type of `like`'s.
    """

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

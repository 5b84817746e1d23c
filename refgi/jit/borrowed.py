"""`borrowed`: an array without its reference count, to hand on to small kernels in an inner loop.

A call with arrays counts references, atomically, so that threads wait for each other. Of a borrowed array nothing is
counted; whoever lends it keeps it alive.
"""

from typing import Any

from numba.core import types
from numba.core.imputils import impl_ret_untracked
from numba.extending import intrinsic
from numba.np.arrayobj import make_array


def _without_count(_: Any, array: Any) -> Any:
    """Type and emit the same array, owned by nobody."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kind = signature.args[0]
        lent = make_array(kind)(context, builder, value=arguments[0])
        lent.meminfo = context.get_constant_null(types.MemInfoPointer(kind.dtype))
        lent.parent = context.get_constant_null(types.pyobject)
        return impl_ret_untracked(context, builder, signature.return_type, lent._getvalue())

    return array(array), generate


borrowed: Any = intrinsic(_without_count)

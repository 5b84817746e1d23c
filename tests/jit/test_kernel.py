"""Property tests of compiled kernels: strict arithmetic, and the same function for Python and for other kernels."""

from typing import NamedTuple

import numba
import numpy as np

from refgi import jit


class Pair(NamedTuple):
    first: np.ndarray
    second: np.ndarray


@jit.kernel
def scaled(pair, factor=2.0):
    return pair.first * factor + pair.second


@jit.kernel
def twice(pair):
    return scaled(pair) + scaled(pair, factor=1.0)


def test_kernels_are_strict():
    """Summing 1, 1e16, -1e16 in this order must lose the 1, and a*b - a*b must be exactly rounded twice."""

    @jit.kernel
    def total(values):
        result = 0.0
        for value in values:
            result += value
        return result

    @jit.kernel
    def difference(a, b, c):
        return a * b - c

    assert total(np.array([1.0, 1e16, -1e16])) == 0.0
    a = 1 + 2.0**-30
    assert difference(a, a, a * a) == 0.0  # a fused multiply-add would give 2**-60


def test_threads_are_put_back():
    import numba

    before = numba.get_num_threads()
    with jit.threads(1):
        assert numba.get_num_threads() == 1
    assert numba.get_num_threads() == before


def test_a_callee_equals_its_entry_point():
    pair = Pair(np.array([1.0, 2.0]), np.array([10.0, 20.0]))
    np.testing.assert_array_equal(twice(pair), scaled(pair) + scaled(pair, 1.0))
    assert twice(pair)[1] == 24.0 + 22.0


def test_a_callee_makes_no_native_code():
    @jit.kernel
    def inner(x):
        return x + 1

    @jit.kernel
    def outer(x):
        return inner(x) * 2

    assert outer(1.0) == 4.0
    assert not inner.overloads
    assert numba.typeof(inner) == numba.types.Dispatcher(inner)


def test_exceptions_of_a_callee_reach_python():
    """Kernels of the project do not raise; allocation may."""
    @jit.kernel
    def inner(n):
        return np.empty((n, 1 << 30, 1 << 30))

    @jit.kernel
    def outer(n):
        return inner(n).shape[0]

    try:
        outer(1 << 40)
    except (MemoryError, ValueError):
        return
    raise AssertionError

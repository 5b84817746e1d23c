"""Property tests of compiled kernels: strict arithmetic, and the same function for Python and for other kernels."""

import ctypes
from typing import NamedTuple

import numba
import numpy as np
import pytest

from refgi import jit
from refgi.jit import kernel, prange, threads


class Pair(NamedTuple):
    first: np.ndarray
    second: np.ndarray


@jit.kernel
def scaled(pair, factor=2.0):
    return pair.first * factor + pair.second


@jit.kernel
def both_scaled(pair):
    return scaled(pair) + scaled(pair, factor=1.0)


def test_kernels_are_strict():
    """Summing 1, 1e16, -1e16 in this order must lose the 1, and a*b - a*b must be exactly rounded both_scaled."""

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


def test_a_callee_equals_its_entry_point():
    pair = Pair(np.array([1.0, 2.0]), np.array([10.0, 20.0]))
    np.testing.assert_array_equal(both_scaled(pair), scaled(pair) + scaled(pair, 1.0))
    assert both_scaled(pair)[1] == 24.0 + 22.0


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


class Image(NamedTuple):
    values: np.ndarray
    scale: np.float32


@kernel(parallel=True)
def add_one(count, out):
    for i in prange(count):
        out[i] += 1


@kernel(parallel=True)
def scale_rows(image, offset, flag, out, factor=1.0):
    size = len(image.values)
    scratch = np.zeros(3, out.dtype)
    for i in prange(size):
        scratch[:] = image.values[i] * image.scale
        out[i] = scratch[0]
        if offset is not None:
            out[i] += offset[0]
        if flag:
            out[i] = -out[i]
        out[i] *= factor


@kernel
def twice(n, out, other):
    out[:] = 5
    for _ in range(2):
        add_one(n, out)
    add_one(n, other)


@kernel(parallel=True)
def too_large(n, out):
    for i in prange(len(out)):
        out[i] = np.empty(n)[0]


@pytest.mark.parametrize("count", [1, 2])
@pytest.mark.parametrize("rows", [0, 1, 2, 7, 8, 9, 1000, 1001])
def test_every_iteration_runs_once(rows, count):
    out = np.zeros(rows + 2, np.int64)
    with threads(min(count, numba.config.NUMBA_NUM_THREADS)):
        add_one(rows, out)
    assert out[:rows].tolist() == [1] * rows
    assert out[rows:].tolist() == [0, 0]


def test_arguments_of_every_kind_arrive():
    values = np.arange(100, dtype=np.float32)
    image = Image(values, np.float32(3))
    out = np.empty_like(values)
    scale_rows(image, None, False, out)
    np.testing.assert_array_equal(out, values * 3)
    scale_rows(image, np.array([2], np.float32), True, out, factor=2.0)
    np.testing.assert_array_equal(out, -(values * 3 + 2) * 2)


def test_loops_write_through_fields():
    """Numba's own parallel loops drop such writes without a word."""
    @kernel(parallel=True)
    def fill(image):
        for i in prange(len(image.values)):
            image.values[i] = i

    image = Image(np.zeros(9, np.float32), np.float32(1))
    fill(image)
    assert image.values.tolist() == list(range(9))


def test_scratch_of_a_thread_is_its_own():
    """What stands before the loop runs once a band; no thread sees another's."""
    values = np.arange(100_000, dtype=np.float32)
    out = np.empty_like(values)
    for _ in range(20):
        scale_rows(Image(values, np.float32(1)), None, False, out)
        np.testing.assert_array_equal(out, values)


def test_kernels_call_parallel_kernels():
    out, other = np.zeros(50), np.zeros(50)
    twice(50, out, other)
    assert (out == 7).all()
    assert (other == 1).all()


def test_memory_that_a_band_lacks_is_an_error():
    with pytest.raises(MemoryError, match="bands"):
        too_large(1 << 60, np.zeros(4))


def test_threads_share_the_iterations():
    library = ctypes.CDLL(None)
    sleep, thread = library.usleep, library.pthread_self
    sleep.argtypes, thread.argtypes = (ctypes.c_uint32,), ()
    thread.restype = ctypes.c_uint64

    @kernel(parallel=True)
    def note_thread(seen):
        for i in prange(len(seen)):
            sleep(2000)  # gives the others time to take what is left
            seen[i] = thread()

    seen = np.zeros(50, np.uint64)
    with threads(min(2, numba.config.NUMBA_NUM_THREADS)):
        note_thread(seen)
    assert len(set(seen.tolist())) == min(2, numba.config.NUMBA_NUM_THREADS)
    with threads(1):
        note_thread(seen)
    assert len(set(seen.tolist())) == 1


@pytest.mark.parametrize("name", ["two_loops", "something_after", "no_loop"])
def test_other_shapes_are_refused(name):
    @kernel(parallel=True)
    def two_loops(out):
        for i in prange(len(out)):
            out[i] = 1
        for i in prange(len(out)):
            out[i] = 2

    @kernel(parallel=True)
    def something_after(out):
        for i in prange(len(out)):
            out[i] = 1
        out[0] = 3

    @kernel(parallel=True)
    def no_loop(out):
        out[0] = 3

    with pytest.raises(TypeError, match=f"{name}: a parallel kernel has one loop over prange and ends with it"):
        locals()[name](np.zeros(3))


def test_threads_are_put_back():
    before = numba.get_num_threads()
    with threads(1):
        assert numba.get_num_threads() == 1
    assert numba.get_num_threads() == before

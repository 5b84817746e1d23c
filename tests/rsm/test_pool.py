"""Buffer pool: memory is reused, never while an array still refers to it."""

import gc
import threading

import numpy as np

from refgi.rsm import gbuffer, pool
from refgi.rsm.pool import plane
from refgi.scene import Camera, Material, material_table
from tests.rsm.shapes import height_field

SHAPE = (3, 256, 320)


def place(array):
    return array.__array_interface__["data"][0]


def test_memory_is_reused_once_no_array_refers_to_it():
    first = plane(SHAPE, np.float32)
    where = place(first)
    row = first[1, 2:5].T  # a view keeps the whole block
    del first
    second = plane(SHAPE, np.float32)
    assert place(second) != where
    row[:] = 7
    second[:] = 1
    assert (row == 7).all()
    del row
    gc.collect()
    assert place(plane(SHAPE, np.float32)) == where


def test_pooled_arrays_are_ordinary_arrays():
    for shape, dtype in ((SHAPE, np.float64), ((700, 900), np.bool_), ((1, 1), np.float32), ((3, 0, 0), np.float32)):
        one = plane(shape, dtype)
        assert (one.shape, one.dtype) == (shape, dtype)
        assert one.flags.c_contiguous
        assert one.flags.writeable
        one[...] = 1


def test_idle_memory_is_bounded(monkeypatch):
    monkeypatch.setattr(pool, "MOST_IDLE", 3 << 20)
    idle = pool._Pool()
    blocks = [idle.acquire(1 << 20) for _ in range(5)]
    for count, block in enumerate(blocks, 1):
        idle.release(block)
        assert sum(len(waiting) for waiting in idle._idle.values()) == (count if count <= 3 else count - 3)


def test_threads_never_get_the_same_memory():
    wrong = []

    def work(number):
        for _ in range(200):
            one = plane(SHAPE, np.int32)
            one[0, :2] = number
            one[2, -1] = number
            if (one[0, :2] != number).any() or (one[2, -1] != number).any():
                wrong.append(number)

    workers = [threading.Thread(target=work, args=(number,)) for number in range(4)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert not wrong


def test_a_moved_camera_finds_the_memory_of_the_last_frame(monkeypatch):
    """Of lists, too, whose length depends on the view."""
    fresh = pool._Pool()
    monkeypatch.setattr(pool, "_pool", fresh)
    shape, materials = height_field(160_000), material_table((Material(),), np.float32)
    idle = []
    for step in range(5):
        camera = Camera((0.01 * step, 2.0, 1.2), (0, 0, 0), width=400, height=300)
        gbuffer(shape, materials, camera).resolve("position", "normal", "albedo", "depth")
        gc.collect()
        idle.append(sum(size * len(blocks) for size, blocks in fresh._idle.items()))
    assert idle[0] > 1 << 22
    assert set(idle) == {idle[0]}


def test_a_list_that_is_a_little_longer_finds_the_memory_of_the_last():
    """Lists of triangles and subsplats change their length from frame to frame."""
    first = pool.plane((100_000, 4), np.int32)
    place, size = first.ctypes.data, first.nbytes
    del first
    for count in (100_000, 99_000, 101_000, 98_500):
        again = pool.plane((count, 4), np.int32)
        assert again.ctypes.data == place
        assert again.nbytes == count * 16
        del again
    assert pool.plane((150_000, 4), np.int32).nbytes > size


def test_zeros_are_zeros_on_used_memory():
    used = pool.plane((300, 400), np.float64)
    used[:] = 7.0
    del used
    for shape in ((300, 400), (3, 4)):
        again = pool.zeros(shape, np.float64)
        assert again.shape == shape
        assert not again.any()

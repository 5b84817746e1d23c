"""Digests of stages: what changes them, and in which order they come."""

import dataclasses

import numpy as np

from refgi.batch.shared import digest_of, hashes_of
from refgi.stages import observe, stage


@dataclasses.dataclass
class Pair:
    left: object
    right: object


@stage("test_digest.inner")
def inner(value):
    return value + 1


@stage("test_digest.outer")
def outer(value):
    return inner(value) * inner(value + 1)


@stage("test_digest.last")
def last(value):
    return np.full(3, value)


def test_a_digest_is_of_all_that_a_value_holds():
    a = np.arange(6, dtype=np.float32)
    values = [a, a.reshape(2, 3), a.astype(np.float64), a + np.float32(1e-6), (a,), [a], (a, a), None, 1, 1.0, True,
              "1", {"a": 1}, {"b": 1}, {"a": 2}, Pair(1, 2), Pair(2, 1), {"a": a}, np.float32(1),
              (1, (2, 3)), ((1, 2), 3)]
    assert len({digest_of(value) for value in values}) == len(values)
    assert digest_of(a[::-1]) == digest_of(a[::-1].copy())
    assert digest_of({"a": 1, "b": 2}) == digest_of({"b": 2, "a": 1})


def test_stages_come_in_the_order_in_which_they_end():
    with observe(record=True) as log:
        outer(2)
        last(5)
    assert hashes_of(log, {}) == (
        ("test_digest.inner", digest_of(3)), ("test_digest.inner", digest_of(4)), ("test_digest.outer", digest_of(12)),
        ("test_digest.last", digest_of(np.full(3, 5))))


def test_a_shared_buffer_counts_alike_whether_it_ran_or_not():
    with observe(record=True) as log:
        last(1)
        outer(2)
        outer(3)
        last(5)
    buffers = {"test_digest.outer": ["first", "second"]}
    assert hashes_of(log, buffers) == (
        ("test_digest.last", digest_of(np.full(3, 1))), ("test_digest.outer", "first"), ("test_digest.outer", "second"),
        ("test_digest.last", digest_of(np.full(3, 5))))
    assert buffers == {"test_digest.outer": ["first", "second"]}

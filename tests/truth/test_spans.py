"""Spans of receivers that one batch of rays holds: each receiver once, no more than fit."""

from types import SimpleNamespace

import numpy as np
import pytest

from refgi.truth.task import spans


@pytest.mark.parametrize("count", [0, 1, 7, 8, 9, 16, 17])
@pytest.mark.parametrize(("batch", "per_receiver", "most"), [(32, 4, 8), (35, 4, 8), (3, 4, 1)])
def test_each_receiver_is_in_one_span(count, batch, per_receiver, most):
    task = SimpleNamespace(settings=SimpleNamespace(batch=batch), receivers=SimpleNamespace(pixel=np.zeros(count)))
    found = spans(task, per_receiver)
    assert [k for first, end in found for k in range(first, end)] == list(range(count))
    assert all(0 < end - first <= most for first, end in found)
    assert len(found) == -(-count // most)

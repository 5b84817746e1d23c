"""exp and log1p against extended precision, over the whole range of their arguments."""

import math

import numpy as np
import pytest

from refgi.elementary import exp, log1p
from refgi.jit import kernel

ULP = {"exp": 1.5, "log1p": 3.0}  # as promised in the docstrings
COUNT = 1 << 21


@kernel
def fill_exp(x, out):
    for i in range(x.shape[0]):
        out[i] = exp(x[i])


@kernel
def fill_log1p(x, out):
    for i in range(x.shape[0]):
        out[i] = log1p(x[i])


def worst_ulp(fill, exact, x):
    got = np.empty_like(x)
    fill(x, got)
    expected = exact(x.astype(np.longdouble))
    return float(np.max(np.abs(got - expected) / np.spacing(np.abs(expected).astype(x.dtype))))


@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_exp_and_log1p_within_their_promise(real):
    low = -87.0 if real is np.float32 else -708.0
    near_zero = np.geomspace(1e-30, 1, COUNT)
    for x in (-near_zero, near_zero, np.linspace(low, 80, COUNT)):
        assert worst_ulp(fill_exp, np.exp, x.astype(real)) < ULP["exp"]
    tiny = float(np.finfo(real).eps)
    for x in (near_zero, -near_zero[near_zero < 0.9], tiny - 1 + np.geomspace(tiny, 0.5, COUNT), near_zero * 1e12):
        assert worst_ulp(fill_log1p, np.log1p, x.astype(real)) < ULP["log1p"]


def test_every_float32_of_some_binades():
    for first, fill, exact, limit in ((-1.0, fill_exp, np.exp, 1.5), (-32.0, fill_exp, np.exp, 1.5),
                                      (-0.5, fill_log1p, np.log1p, 3.0), (-0.0078125, fill_log1p, np.log1p, 3.0)):
        start = np.float32(first).view(np.int32)
        x = (start + np.arange(1 << 22, dtype=np.int32)).view(np.float32)  # towards -infinity within the binade
        assert worst_ulp(fill, exact, x) < limit


@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_ends(real):
    x = np.array([0.0, -0.0, -1e30, -math.inf], real)
    got = np.empty_like(x)
    fill_exp(x, got)
    assert got.tolist() == [1, 1, 0, 0]
    fill_log1p(x[:2], got[:2])
    assert got[:2].tolist() == [0, 0]

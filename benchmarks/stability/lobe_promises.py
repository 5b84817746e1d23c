"""Promise of a lobe's norm on average: what its continued fraction leaves is rounding, to either side alike.

About the horizon the fraction loses digits: some P/3 ULP, as its terms are 1 less almost 1. That is rounding; a
fraction which is cut too early, or a wrong term, is off to one side.
"""

import numpy as np

from benchmarks.stability.maths import DIGITS
from benchmarks.stability.pair_ladders import filled, norm
from benchmarks.stability.promise import Case, Promise
from refgi.jit import kernel
from refgi.lobes import lobe_norm

SAMPLES = 100
SIGMAS = 6.0


@kernel
def _norms(x: np.ndarray, out: np.ndarray) -> None:
    for i in range(x.shape[1]):
        out[0, i] = lobe_norm(x[0, i], x[1, i])


def bias(rng: np.random.Generator) -> Case:
    """Return by how many of its standard errors the mean error of some norms of almost one exponent is off 0."""
    middle = 10 ** rng.uniform(2, 4.5)
    exponent = middle * rng.uniform(1, 1.5, SAMPLES)
    widths = 1.7 + 0.2 * rng.random(SAMPLES)  # of the lobe off the horizon: there the fraction has the most terms
    x = np.stack([-widths / np.sqrt(exponent), exponent])
    got = filled(_norms)(x)[0]
    exact = norm(DIGITS, [DIGITS.number(row) for row in x])[0]
    error = np.array([float(DIGITS.number(np.array([g]))[0] / e - 1) for g, e in zip(got, exact, strict=True)])
    error /= 2.0**-52 * (1 + exponent / 3)
    deviation = float(error.std(ddof=1)) / np.sqrt(SAMPLES)
    return Case(abs(float(error.mean())) / deviation, f"exponents {middle:.0f} and more: mean {error.mean():.3g} "
                                                      f"(1 + P / 3) ULP, standard error {deviation:.2g}")


PROMISES = (
    Promise("lobe.norm_bias", "float64 norms, mean error", "lobe.norm", "P 100 .. 45,000, 1.7 to 1.9 widths of the "
            "lobe below the horizon", bias, "standard errors", SIGMAS, "statistics",
            "6 standard errors of 100 values: 200 such means pass it once in 100,000 runs", 200, 8),
)

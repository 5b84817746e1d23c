"""Tasks of a part, promises of stages as drawn cases, and the numbers that these and the ladders are made of.

Of a promise the worst case is the row. A case or block of cases is drawn from a generator of its own, so that case `i`
of a seed is the same in every run. A formula is plain NumPy over rows of inputs, its own or a function of
`refgi.literal`: arrays of longdouble (64 bits on x86; elsewhere maybe fewer, which `trusted` tells) pass through it,
and arrays of numbers of 50 digits as well, for their class has the methods that NumPy's functions ask of objects.
"""

import math
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, NamedTuple

import mpmath
import numpy as np

from refgi.stress.promises import Kind, Row
from refgi.types import Array

Tell = Callable[[str], None]
SEED = 17


class Task(NamedTuple):
    """Some rows that are made together; a run that was interrupted goes on after the last finished one."""

    name: str  # unique in its part
    run: Callable[[Tell], Iterable[Row]]


class Case(NamedTuple):
    """One case: how far it is from what is promised, and what it is in words."""

    figure: float
    about: str


class Promise(NamedTuple):
    """What is promised of a stage, and a generator of cases."""

    name: str  # of the task
    property: str
    subject: str
    domain: str
    draw: Callable[[np.random.Generator], Case]
    unit: str
    limit: float
    kind: Kind
    source: str
    cases: int
    brief: int  # cases of the short form
    adds: bool = False  # the figure is the sum over all cases, as of counts, and not the worst


def case_of(promise: Promise, seed: int, case: int) -> Case:
    return promise.draw(np.random.default_rng((seed, case)))


def row_of(promise: Promise, part: str, short: bool, seed: int = SEED) -> Row:
    """Return the row: the worst case, where a figure that is no number is the worst there can be."""
    count = promise.brief if short else promise.cases
    found = [case_of(promise, seed, case) for case in range(count)]
    figures = [math.inf if math.isnan(one.figure) else one.figure for one in found]
    worst = int(np.argmax(figures))
    return Row(part=part, property=promise.property, subject=promise.subject, domain=promise.domain,
               figure=sum(figures) if promise.adds else figures[worst], unit=promise.unit, limit=promise.limit,
               kind=promise.kind, source=promise.source, cases=count, seed=seed, detail=found[worst].about,
               reproduce=f"python -m benchmarks.stability.again {part} {promise.name} {seed} {worst}")


def promise_tasks(promises: Iterable[Promise], part: str, short: bool) -> list[Task]:
    def run(promise: Promise, _: Tell) -> Iterable[Row]:
        return [row_of(promise, part, short)]

    return [Task(one.name, partial(run, one)) for one in promises]


def again(promise: Promise, seed: int, case: int) -> str:
    found = case_of(promise, seed, case)
    return (f"{promise.name}, seed {seed}, case {case}\n  {found.about}\n  figure     {found.figure:.6g} {promise.unit}"
            f", limit {promise.limit:g}")


digits: Any = mpmath.MPContext()  # of its own: nobody else's precision changes
digits.dps = 50
for _name, _function in {
    "sqrt": digits.sqrt, "exp": digits.exp, "log": digits.log, "log1p": digits.log1p, "sin": digits.sin,
    "cos": digits.cos, "tan": digits.tan, "arctan": digits.atan, "arctan2": digits.atan2,
    "exp2": lambda x: digits.mpf(2) ** x, "log2": lambda x: digits.log(x) / digits.log(2),
}.items():
    setattr(digits.mpf, _name, lambda *x, function=_function: function(*x))

PI = np.longdouble("3.14159265358979323846264338327950288")


class Precision(NamedTuple):
    """A kind of numbers, in arrays."""

    name: str
    of: Callable[[Any], Any]  # exact, from float32 or float64


EXTENDED = Precision("longdouble", lambda x: np.asarray(x).astype(np.longdouble))
DIGITS = Precision("mpmath, 50 digits", np.frompyfunc(lambda one: digits.mpf(float(one)), 1, 1))
# of 50 digits alone: I_x(a, 1/2), regularised, of x and a; erfc
incomplete_beta = np.frompyfunc(lambda x, a: digits.betainc(a, digits.mpf(0.5), 0, x, regularized=True), 2, 1)
complementary_error = np.frompyfunc(digits.erfc, 1, 1)


def trusted() -> bool:
    """Return whether extended precision has the bits that are asked of it."""
    return bool(np.finfo(np.longdouble).nmant >= 63)


def pi_of(x: Array) -> Any:
    """Return pi as a number of the kind of an array."""
    return +digits.pi if x.dtype == object else PI


def dot(a: Any, b: Any) -> Any:
    """Return the dot product of two vectors of arrays."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def spacing(value: Array, real: Any) -> Array:
    """Return the unit in the last place of float32 or float64 at some numbers, as extended numbers."""
    info = np.finfo(real)
    _, exponent = np.frexp(np.abs(value).astype(np.longdouble))
    lowest = info.minexp - info.nmant
    power = np.where(np.asarray(value) == 0, lowest, np.maximum(exponent - (info.nmant + 1), lowest))
    return np.ldexp(np.longdouble(1), power)


BLOCK = 1 << 14  # cases drawn at once
SMALL = (1e-7, 1e-1)  # of a length: components that are tiny, angles that graze


def block_of(seed: int, block: int) -> np.random.Generator:
    """Return the generator of the cases BLOCK block to BLOCK (block + 1) - 1 of a seed."""
    return np.random.default_rng((seed, block))


def sizes(rng: np.random.Generator, low: float, high: float, count: int = BLOCK) -> Array:
    """Return numbers from `low` to `high`, even in their logarithm; a tenth lie at the ends, a tenth on powers of 2."""
    values = np.exp(rng.uniform(np.log(low), np.log(high), count))
    kind = rng.integers(0, 20, count)
    values = np.where(kind == 0, low, np.where(kind == 1, high, values))
    powers = np.clip(2.0 ** np.round(np.log2(values)), low, high)
    return np.where((kind == 2) | (kind == 3), powers, values)


def any_size(rng: np.random.Generator, real: Any, count: int = BLOCK) -> Array:
    """Return numbers of either sign over all that a type can hold: 0, subnormal, 1e-30 to 1e30, the largest."""
    info = np.finfo(real)
    span = np.log2(float(info.smallest_subnormal)), np.log2(float(info.max))
    values = np.exp2(rng.uniform(span[0], span[1] - 1e-6, count)) * rng.choice([-1.0, 1.0], count)
    odd = np.array([0.0, -0.0, float(info.smallest_subnormal), float(info.tiny), float(info.max), 1e-30, 1e30, 1.0])
    return np.where(rng.random(count) < 0.1, rng.choice(odd, count), values)


def directions(rng: np.random.Generator, count: int = BLOCK) -> Array:
    """Return unit vectors (3, count): random, along axes and diagonals, and with one or two tiny components."""
    v = rng.normal(size=(3, count))
    kind = rng.integers(0, 8, count)
    axis = np.eye(3)[rng.integers(0, 3, count)].T * rng.choice([-1.0, 1.0], count)
    tiny = np.exp(rng.uniform(*np.log(SMALL), (3, count))) * rng.choice([-1.0, 1.0], (3, count))
    needle = np.where(axis == 0, tiny, axis)
    flat = np.where(axis == 0, v, tiny)
    v = np.where(kind == 0, axis, np.where(kind == 1, needle, np.where(kind == 2, flat, v)))
    v = np.where(kind == 3, rng.choice([-1.0, 1.0], (3, count)), v)
    return np.asarray(v / np.sqrt((v * v).sum(axis=0)))


def across(rng: np.random.Generator, w: Array) -> Array:
    """Return unit vectors at right angles to `w`, to float64 rounding."""
    other = rng.normal(size=w.shape)
    other -= (other * w).sum(axis=0) * w
    return np.asarray(other / np.sqrt((other * other).sum(axis=0)))


def around(rng: np.random.Generator, w: Array, real: Any) -> Array:
    """Return unit vectors by their place beside `w`: any, along, one ULP off, near, opposite, grazing either way."""
    count = w.shape[1]
    any_way, side = directions(rng, count), across(rng, w)
    tilt = np.exp(rng.uniform(np.log(1e-8), 0, count)) * rng.choice([-1.0, 1.0], count)
    near, grazing = w * np.cos(tilt) + side * np.sin(tilt), side * np.cos(tilt) + w * np.sin(tilt)
    one_off = w * (1 + rng.integers(-1, 2, w.shape) * float(np.finfo(real).eps))
    kind = rng.integers(0, 8, count)
    chosen = np.select([kind == 0, kind == 1, kind == 2, kind == 3, kind == 4, kind == 5],
                       [w, one_off, near, -near, grazing, side], any_way)
    return np.asarray(chosen)


def some(rng: np.random.Generator, values: Array, other: Any, share: float = 0.02) -> Array:
    """Return values of which some are replaced in all their components by another, such as 0."""
    return np.where(rng.random(values.shape[-1]) < share, other, values)

"""Part `kernels`: kernels against their formulas, every float32 through elementary functions, promises of stages."""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from benchmarks.stability import (
    buffers,
    elementary_range,
    lamps,
    lobes,
    map_promises,
    maps,
    pairs,
    places,
    promise,
    sums,
    val,
)
from benchmarks.stability.ladder import Ladder, conditions, errors, inputs_of, rows
from benchmarks.stability.promise import BLOCK, DIGITS, EXTENDED, Task, Tell, digits, trusted
from refgi.stress.promises import Row

MODULES = (pairs, lamps, val, maps, elementary_range, lobes, places)
PROMISED = (sums, lobes, buffers, map_promises, places)  # of stages
ALL = ".all"


def ladders() -> dict[str, Ladder]:
    """Return all ladders by name; without extended precision they go by 50 digits alone."""
    found = [one for module in MODULES for one in module.LADDERS]
    return {one.name: one if trusted() else one._replace(extended=0) for one in found}


def promises() -> dict[str, promise.Promise]:
    """Return all promises of stages by name."""
    return {one.name: one for module in PROMISED for one in module.PROMISES}


def tasks(short: bool) -> list[Task]:
    """Return a task for each kernel and promise, and for each elementary function over all float32 numbers."""
    def measured(ladder: Ladder) -> Callable[[Tell], Iterable[Row]]:
        return lambda _: rows(ladder, short)

    def whole(name: str) -> Callable[[Tell], Iterable[Row]]:
        return lambda _: elementary_range.rows(name, short)

    return [*(Task(name, measured(ladder)) for name, ladder in ladders().items()),
            Task("crown.unit", lambda _: pairs.unit_rows(short)),
            *(Task(f"{name}{ALL}", whole(name)) for name in elementary_range.FILL),
            *promise.promise_tasks(promises().values(), "kernels", short)]


def again(name: str, seed: int, case: int) -> str:
    """Return inputs, answer, reference and error of one case; of a whole range, `case` is the bit pattern."""
    if name.endswith(ALL):
        return _pattern(name.removesuffix(ALL), case)
    if name in promises():
        return promise.again(promises()[name], seed, case)
    known = ladders()
    if name not in known:
        raise ValueError(f"expected a kernel of {', '.join(known | promises())}, got {name}")
    ladder, lines = known[name], []
    for real in ladder.reals:
        x = inputs_of(ladder, seed, case // BLOCK, real)[:, case % BLOCK : case % BLOCK + 1].copy()
        got = ladder.run(x)
        lines.append(f"{name} {real}, seed {seed}, case {case}\n  inputs     {_shown(x[:, 0])}")
        lines.append(f"  got        {_shown(got[:, 0])}")
        for precision in (EXTENDED, DIGITS) if ladder.extended else (DIGITS,):
            with np.errstate(all="ignore"):
                exact = ladder.formula(precision.of(x))
            error, unit = errors(ladder, precision, real, x, got)
            condition = conditions(ladder, precision, real, x, unit) if ladder.conditioned else np.ones_like(error)
            lines += [f"  {precision.name}\n    formula  {_shown([one[0] for one in exact])}",
                      f"    error    {_shown((error / unit)[:, 0].astype(float))} units, condition "
                      f"{_shown(condition[:, 0].astype(float))}, figure "
                      f"{float((error / unit / condition).max()):.4g}, limit {ladder.limit:g}"]
    return "\n".join(lines)


def _pattern(name: str, bits: int) -> str:
    x = np.array([bits], np.uint32)
    worst = elementary_range.of_patterns(name, x)
    value = x.view(np.float32)
    got = np.empty((1, 1), np.float32)
    elementary_range.FILL[name](value[None], got)
    exact = elementary_range.EXACT[name](value.astype(np.float64))
    return (f"{name} float32, bits {bits:#010x}\n  input      {value[0]!r}\n  got        {got[0, 0]!r}\n"
            f"  float64    {exact[0]!r}\n  error      {worst.ulp:.4g} ULP, wrong special answers {worst.wrong}")


def _shown(values: Any) -> str:
    return " ".join(str(v) if isinstance(v, DIGITS_TYPES) else repr(v.item() if hasattr(v, "item") else v)
                    for v in values)


DIGITS_TYPES = (np.longdouble, digits.mpf)

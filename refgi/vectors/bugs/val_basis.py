"""Series, scale, depths and basis of convolution shadow maps as a port gets them wrong (VAL Sec. 4.1)."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from scipy.optimize import brentq

from refgi.cluster.settings import Csm
from refgi.vectors.recipe import reading, writing
from refgi.vectors.spec import Array, Arrays, Bug, Run

LAW = "E-VAL-02: c_k = (2k - 1) pi, k from 1 on"
LEAST_RATIO = 1.05
FREQUENCIES: Mapping[str, Callable[[Array], Array]] = {
    "k pi, not (2k - 1) pi": lambda k: k * np.pi,
    "even multiples of pi, 2 k pi, in place of odd ones": lambda k: 2 * k * np.pi,
    "(2k + 1) pi with k from 1 on: the first term is skipped": lambda k: (2 * k + 1) * np.pi,
    "(2k - 1) pi with k from 0 on: one term too low": lambda k: (2 * k - 3) * np.pi,
    "2 k - 1: pi is missing": lambda k: 2 * k - 1.0,
    "twice as high: (2k - 1) 2 pi": lambda k: (2 * k - 1) * 2 * np.pi,
    "half as high: (2k - 1) pi / 2": lambda k: (2 * k - 1) * np.pi / 2,
    "all that of the first term, pi: first weight": lambda k: 0 * k + np.pi,
}


def chain_bugs(run: Run, csm: Csm) -> tuple[Bug, ...]:
    """Return likely bugs of weights, biases and range of the plain series."""
    m = csm.terms
    top = 0.5 / m
    return (
        *(Bug(f"frequencies are {name}", chain_by(m, law), LAW) for name, law in FREQUENCIES.items()
          if not name.startswith(("even", "twice"))),
        *(Bug(f"frequencies are {name}, in the weights alone",
              writing(run, series__weight=_weights_of(law)), LAW)
          for name, law in FREQUENCIES.items() if not name.startswith("twice")),
        Bug("weights are squares: 2 / c_k^2", writing(run, series__weight=lambda a: a * a / 2), "w_k = 2 / c_k"),
        Bug("weights are the frequencies: c_k / 2 for 2 / c_k", writing(run, series__weight=lambda a: 1 / a),
            "2 / c_k"),
        Bug("the last weight is left out: one term too few",
            writing(run, series__weight=lambda a: a * (np.arange(len(a)) < len(a) - 1)), "M terms"),
        Bug("weights alternate in sign", writing(run, series__weight=lambda a: a * (-1.0) ** np.arange(len(a))),
            "w_k > 0"),
        *(Bug(f"the range {what}", writing(run, series__range=_less_biases(n)), "E-VAL-05: 1 - 2 b*")
          for n, what in ((1, "leaves out one bias only: 1 - b, not twice the bias"),
                          (3, "leaves out three biases: 1 - 3 b"), (4, "leaves out four biases: 1 - 4 b"))),
        Bug("the range is twice the bias: 2 b for 1 - 2 b", writing(run, series__range=lambda a: 1 - a), "1 - 2 b*"),
        Bug("the range is 1 + 2 b: wrong sign of the bias", writing(run, series__range=lambda a: 2 - a), "1 - 2 b*"),
        Bug("the range is one half, that of a period of 1", writing(run, series__range=lambda a: 0 * a + 0.5),
            "1 - 2 b*"),
        Bug("the range is half: 1/2 - b", writing(run, series__range=lambda a: a / 2), "1 - 2 b*"),
        *(Bug(f"the bias is {what}", writing(run, series__bias=change, series__range=_range_of(change)),
              "E-VAL-03: where f_M is 1 for the first time") for what, change in (
                ("half of it", lambda b: b / 2), ("twice as large", lambda b: 2 * b),
                ("1 / (2 M), at the series' top, not where it is 1 first (as of weights 1 / c_k)",
                 lambda b: 0 * b + top),
                ("1 / M, the first wave's end", lambda b: 0 * b + 2 * top),
                ("0: none, where f_M is 1/2", lambda b: 0 * b),
                ("negative: wrong sign", lambda b: -b))),
        *(Bug(f"the bias is {what}, the range right", writing(run, series__bias=change), "E-VAL-03")
          for what, change in (
            ("half of it", lambda b: b / 2), ("twice as large", lambda b: 2 * b),
            ("negative: wrong sign", lambda b: -b),
            ("0 in the search", lambda b: b * (0, 1)), ("0 in the comparison", lambda b: b * (1, 0)))),
        *(Bug(f"the bias is where f_M is {level:g} for the first time, not 1", chain_by(m, level=level), "E-VAL-03")
          for level in (0.75, 0.9, 0.95, 0.99)),
        Bug("the bias is that of one term more", chain_by(m, bias_terms=m + 1), "E-VAL-03: b*(M)"),
        Bug("the bias is that of the first term alone", chain_by(m, bias_terms=1), "E-VAL-03: b*(M)"))


def _weights_of(law: Callable[[Array], Array]) -> Callable[[Array], Array]:
    return lambda weight: 2 / law(np.arange(1.0, len(weight) + 1))


def _less_biases(count: int) -> Callable[[Array], Array]:
    return lambda end: 1 - count * (1 - end) / 2


def _range_of(change: Callable[[Array], Array]) -> Callable[[Array], Array]:
    return lambda end: 1 - 2 * change((1 - end) / 2)


def chain_by(
    terms: int, law: Callable[[Array], Array] = lambda k: (2 * k - 1) * np.pi, level: float = 1.0, factor: float = 2.0,
    weight: float | None = None, bias_terms: int | None = None,
) -> Run:
    """Return the plain series by other frequencies, with the bias where it first is `level`, or at its top."""
    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
        c = law(np.arange(1.0, (bias_terms or terms) + 1))
        x = np.linspace(0, 0.5 if bias_terms == 1 else 0.5 / len(c), 4097)
        value = 0.5 + (factor / c * np.sin(np.multiply.outer(x, c))).sum(axis=1) - level
        above = np.flatnonzero(value >= 0)
        b = x[int(value.argmax())] if not len(above) else x[0] if above[0] == 0 else brentq(
            lambda u: float(0.5 + (factor / c * np.sin(c * u)).sum() - level), x[above[0] - 1], x[above[0]], xtol=1e-14)
        used = law(np.arange(1.0, terms + 1))
        return {"series.weight": (factor if weight is None else weight) / used, "series.bias": np.array([b, b]),
                "series.range": np.array([1 - 2 * b])}

    return run


def scale_bugs(run: Run, csm: Csm) -> tuple[Bug, ...]:
    """Return likely bugs of the scale of depths by what each map holds."""
    logs = csm.depth_scale == "log_map"

    def scale(top: Any = None, span: Any = None, origin: Any = None) -> Run:
        def altered(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
            near, far = (np.asarray(arrays[f"maps.{name}"], np.float64) for name in ("near", "far"))
            some = np.isfinite(near)
            near = np.where(some, near, 1.0)
            end = float(arrays["series.range"][0])
            ratio = np.maximum(far / near, LEAST_RATIO)
            with np.errstate(all="ignore"):
                long = (np.log2(ratio) if logs else near * (ratio - 1)) if span is None else span(near, far, ratio)
                slope = (max(2 * end - 1, end / 2) if top is None else top(end)) / long
            return {"scale.origin": np.where(some, near if origin is None else origin(near, far), 0),
                    "scale.slope": np.where(some, slope, 0)}

        return altered

    spans: dict[str, Any] = {
        "the natural logarithm of far / near: ln for log2": lambda near, far, ratio: np.log(ratio),  # noqa: ARG005
        "the logarithm to base 10 of far / near, for log2": lambda near, far, ratio: np.log10(ratio),  # noqa: ARG005
        "the ratio far / near, not its logarithm": lambda near, far, ratio: ratio,  # noqa: ARG005
        "near / far: the ratio is turned round, cut at 1.05 on all maps": lambda near, far, ratio: np.log2(  # noqa: ARG005
            LEAST_RATIO + 0 * ratio),
        "far alone: the logarithm of far, not of far / near": lambda near, far, ratio: np.log2(1 + far),  # noqa: ARG005
    } if logs else {
        "far alone: near is not subtracted": lambda near, far, ratio: far,  # noqa: ARG005
        "near alone": lambda near, far, ratio: near,  # noqa: ARG005
        "the ratio far / near less 1: near is missing": lambda near, far, ratio: ratio - 1,  # noqa: ARG005
    }
    return (
        *(Bug(f"the scale spans {what}", scale(span=span), "E-VAL-05") for what, span in spans.items()),
        *(Bug(f"the farthest blocker lies at {what}", scale(top=top), "E-VAL-05: max(2 e - 1, e / 2)")
          for what, top in (("1, the end of the period", lambda e: 1.0),  # noqa: ARG005
                            ("half of the range, e / 2: the smaller (min) for the larger (max)", lambda e: e / 2),
                            ("e less half a bias, (3 e - 1) / 2", lambda e: 1.5 * e - 0.5),
                            ("2 e", lambda e: 2 * e))),
        Bug("the slope is turned round: octaves or metres per depth, its reciprocal", writing(
            run, scale__slope=lambda a: np.divide(1, a, out=np.zeros_like(a), where=a > 0)),
            "depths per octave or metre"),
        *(Bug(f"the scale begins at {what}", scale(origin=origin), "E-VAL-05: depth 0 at what is nearest")
          for what, origin in (("1 m, not at the nearest blocker", lambda near, far: np.ones_like(near)),  # noqa: ARG005
                               ("0: the map's centre, not the nearest blocker", lambda near, far: 0 * near),  # noqa: ARG005
                               ("the farthest blocker, not the nearest: far for near", lambda near, far: far))),  # noqa: ARG005
        *(Bug(f"the first map's {what} for all", reading(run, **changes), "E-VAL-05: each map")
          for what, changes in (("nearest distance", {"maps__near": _of_first}), ("farthest distance", {
              "maps__far": _of_first}), ("range, the same for all maps", {
                  "maps__near": _of_first, "maps__far": _of_first}))))


def _of_first(array: Array) -> Array:
    some = np.isfinite(array) & (array > 0)
    return np.where(some, array[some][0], array) if some.any() else array

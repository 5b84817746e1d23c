"""Scale of depths of convolution shadow maps as a port gets it wrong (VAL Sec. 4.1)."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

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

"""What ports get wrong in discontinuities of cells (Nichols and Wyman 2009, Sec. 3.2), in NumPy."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from refgi.splat.multires.settings import Criteria
from refgi.vectors.spec import Array, Arrays, Bug, Run

ANY, OWN = "any test counts", "E-AMS-07"


def marks_bugs(names: tuple[str, ...], criteria: Criteria, finest: int) -> Iterator[Bug]:
    """Yield likely bugs of which cells exceed a threshold; `names` of the arrays of levels 1 to the coarsest."""
    def literal(**bugs: Any) -> Run:
        return lambda arrays, _: literal_marks(arrays, names, criteria, finest, **bugs)

    depth, normal = criteria.depth, criteria.normal
    if depth is not None:
        usual = {"relative": "share", "absolute": "length"}.get(depth.measure, "")
        for cause, of_depth in (
                ("absolute and relative thresholds of depth are exchanged", {"share": "length", "length": "share"}.get(
                    usual, "share")),
                ("depths are compared with a share of the largest depth, not of the least", "largest"),
                ("depths are compared with a share of the mean of least and largest", "mean"),
                ("the threshold of depths is multiplied by the level", "times level"),
                ("the threshold of depths is divided by the level", "over level"),
                ("the threshold of depths is multiplied by the cell's side 2^level", "times side"),
                ("the threshold of depths is divided by the cell's side 2^level", "over side"),
                ("the threshold of depths is multiplied by the depth squared", "square"),
                ("the largest depth alone is compared with the threshold, not its difference to the least", "high"),
                ("the threshold of depths is doubled", "twice"), ("the threshold of depths is halved", "half"),
                ("the absolute difference marks cells without surface as well", "empty")):
            if of_depth != usual:
                yield Bug(cause, literal(of_depth=of_depth), OWN)
    if normal is not None:
        for cause, of_normal in (
                ("the last component of normals is left out", "not last"),
                ("the first component of normals is left out", "not first"),
                ("the first component of normals alone is compared: x", "first"),
                ("the last component of normals alone is compared", "last"),
                ("all components of normals must exceed the threshold, not any of them", "all"),
                ("the largest component alone is compared, not its difference to the least", "high"),
                ("the threshold of normals is doubled", "twice"),
                ("the threshold of normals is squared", "square")):
            yield Bug(cause, literal(of_normal=of_normal), OWN)
    if depth is not None and normal is not None:
        yield Bug("depth and normals must both differ, in place of either of them (and instead of or)",
                  literal(joined=np.logical_and), ANY)
        yield Bug("either depth or normals must differ, not both (exclusive or)", literal(joined=np.logical_xor), ANY)
        yield Bug("thresholds of depth and of normals are exchanged", literal(exchanged=True), OWN)
        yield Bug("the threshold of depth for both", literal(threshold_of="depth"), OWN)
        yield Bug("the threshold of normals for both", literal(threshold_of="normal"), OWN)
    if criteria.derivative is not None:
        yield Bug("the slope's threshold is multiplied by the cell's side 2^level", literal(of_slope="times side"), OWN)
        yield Bug("the slope is compared with half its threshold", literal(of_slope="half"), OWN)
    if criteria.derivative is not None and criteria.curvature is not None:
        yield Bug("slope and curvature must both differ, in place of either of them (and instead of or)",
                  literal(joined=np.logical_and), ANY)
    yield Bug("refinement stops one level before the finest: its cells are not tested", literal(later=1),
              "the finest level is never refined")
    yield Bug("the coarsest level is not tested", literal(coarsest=False), ANY)
    yield Bug("true and false are exchanged: cells below the threshold are marked", literal(turned=True), ANY)


def literal_marks(
    arrays: Arrays, names: tuple[str, ...], criteria: Criteria, finest: int, *, of_depth: str = "",
    of_normal: str = "", of_slope: str = "", joined: Callable[..., Array] = np.logical_or,
    exchanged: bool = False, threshold_of: str = "", later: int = 0, coarsest: bool = True, turned: bool = False,
) -> dict[str, Array]:
    """Return which cells of each level are discontinuous, with bugs."""
    depth, normal = criteria.depth, criteria.normal
    limits = {kind: rule.threshold for kind, rule in (("depth", depth), ("normal", normal)) if rule is not None}
    if exchanged:
        limits = {"depth": limits["normal"], "normal": limits["depth"]}
    limits = dict.fromkeys(limits, limits[threshold_of]) if threshold_of else limits
    made = {}
    for level, name in enumerate(names, start=1):
        tests = []
        if depth is not None:
            low, high = (np.asarray(arrays[f"multires.depth_{key}.{level}"]) for key in ("least", "largest"))
            tests.append(_depth_test(low, high, limits["depth"], of_depth or depth.measure, level, depth.measure))
        if normal is not None:
            low, high = (np.asarray(arrays[f"multires.normal_{key}.{level}"]) for key in ("least", "largest"))
            tests.append(_normal_test(low, high, limits["normal"], of_normal))
        if criteria.derivative is not None:
            limit = criteria.derivative.threshold * (3 / level if criteria.derivative.measure == "demo" else 1)
            tests.append(np.asarray(arrays[f"multires.slope.{level}"]) > limit * {
                "times side": 1 << level, "half": 0.5}.get(of_slope, 1))
        if criteria.curvature is not None:
            tests.append(np.asarray(arrays[f"multires.curvature.{level}"]) > criteria.curvature.threshold)
        found = tests[0]
        for test in tests[1:]:
            found = joined(found, test)
        used = level > finest + later and (coarsest or level < len(names))
        made[name] = (found ^ turned) if used else np.zeros_like(found)
    return made


def _depth_test(low: Array, high: Array, limit: float, how: str, level: int, measure: str) -> Array:
    with np.errstate(invalid="ignore"):
        spread = high - low
        usual = limit if measure == "absolute" else limit * low * (3 / level if measure == "demo" else 1)
        side = 1 << level
        most = {"share": limit * low, "length": limit, "largest": limit * high, "mean": limit * (low + high) / 2,
                "times level": usual * level, "over level": usual / level, "times side": usual * side,
                "over side": usual / side, "square": limit * low**2, "twice": 2 * usual, "half": usual / 2}.get(
                    how, usual)
        if how == "high":
            return np.asarray(high > usual)
        return np.asarray((spread > most) | ((how == "empty") & np.isinf(low)))


def _normal_test(low: Array, high: Array, limit: float, how: str) -> Array:
    limit = {"twice": 2 * limit, "square": limit**2}.get(how, limit)
    with np.errstate(invalid="ignore"):
        spread = high if how == "high" else np.where(np.isinf(low), 0, high - low)
    spread = {"not last": spread[:-1], "not first": spread[1:], "first": spread[:1], "last": spread[-1:]}.get(
        how, spread)
    return np.asarray((spread > limit).all(axis=0) if how == "all" else (spread > limit).any(axis=0))

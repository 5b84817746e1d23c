"""Lists that a port appends to in an order of its own (atomics): which element is which. NumPy alone.

Elements are matched by their whole numbers (texel and map, cell of a subsplat), those alike in them, or all of a list
without any, by the nearest position and then the nearest values.
"""

import math
from collections.abc import Mapping

import numpy as np

from refgi.vectors.manifest import CaseManifest, StageEntry
from refgi.vectors.spec import Array, axes_of
from refgi.vectors.storage import COMPONENTS, component_axis

NO_LIST = ("row", "column", "one", *COMPONENTS)  # axes whose order is no port's choice
ALIKE = 1e-6  # of the largest position: so near elements are told apart by their values


def list_axis(case: CaseManifest, step: StageEntry) -> str | None:
    """Return the name of the axis that all arrays of a stage share and that is a list; None where there is none."""
    shared = set.intersection(*(set(axes_of(case.arrays[name].axes)) for name in step.writes))
    return min(shared - set(NO_LIST), default=None)


def order_of(
    case: CaseManifest, step: StageEntry, expected: Mapping[str, Array], got: Mapping[str, Array]
) -> tuple[str, Array] | None:
    """Return a list's axis and which of a port's elements each expected one is; None where their numbers differ."""
    axis = list_axis(case, step)
    names = [name for name in step.writes if name in got and got[name].shape == expected[name].shape]
    if axis is None or not names:
        return None
    right, own = ({name: _elements(case, name, arrays[name], axis) for name in names} for arrays in (expected, got))
    whole = [name for name in names if case.arrays[name].dtype != "<f4"]
    floats = [name for name in names if case.arrays[name].dtype == "<f4"]
    places = [name for name in floats if case.arrays[name].unit == "m" and component_axis(case.arrays[name])
              is not None]
    count = len(right[names[0]])
    order = np.full(count, -1)
    free = _by_key(own, whole, count)
    for key, wanted in _by_key(right, whole, count).items():
        offered = free.get(key, [])
        for k in wanted[: len(offered)]:
            order[k] = offered.pop(_nearest([(right[name][k], own[name][offered]) for name in places],
                                            [(right[name][k], own[name][offered]) for name in floats]))
    order[order < 0] = np.setdiff1d(np.arange(count), order)  # those with wrong numbers, in the order they have
    return axis, order


def reordered(case: CaseManifest, name: str, array: Array, axis: str, order: Array) -> Array:
    """Return an array with the elements of a list's axis in another order; as it is without that axis."""
    names = axes_of(case.arrays[name].axes)
    if axis not in names or array.ndim != len(names) or array.shape[names.index(axis)] != len(order):
        return array
    return np.take(array, order, names.index(axis))


def _elements(case: CaseManifest, name: str, array: Array, axis: str) -> Array:
    """Return an array as (elements, numbers of each)."""
    rows = np.moveaxis(array, axes_of(case.arrays[name].axes).index(axis), 0)
    return np.nan_to_num(rows.reshape(len(rows), math.prod(rows.shape[1:])).astype(np.float64))


def _by_key(rows: Mapping[str, Array], whole: list[str], count: int) -> dict[tuple[float, ...], list[int]]:
    """Return which elements have which whole numbers."""
    keys = np.concatenate([np.zeros((count, 1)), *(rows[name] for name in whole)], axis=1)
    found: dict[tuple[float, ...], list[int]] = {}
    for k, key in enumerate(map(tuple, keys.tolist())):
        found.setdefault(key, []).append(k)
    return found


def _nearest(places: list[tuple[Array, Array]], values: list[tuple[Array, Array]]) -> int:
    """Return which of some elements is nearest to one: in place, and in values of those at the same place."""
    count = len((places or values)[0][1]) if places or values else 1
    off, size = _distance(places, count), max((np.abs(one).max(initial=0.0) for one, _ in places), default=0.0)
    return int(np.argmin(np.where(off <= off.min() + ALIKE * size, _distance(values, count), np.inf)))


def _distance(pairs: list[tuple[Array, Array]], count: int) -> Array:
    return np.asarray(sum((np.abs(other - one).sum(axis=1) for one, other in pairs), np.zeros(count)))

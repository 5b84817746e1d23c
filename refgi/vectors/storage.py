"""What a GPU's storage does to a port's arrays: texels of four components, packed floats, lists in any order.

A packed float or a depth in few bits moves an element by up to one step of its format, whichever way it is rounded.
NumPy alone.

Elements of lists are matched by their whole numbers (texel and map, cell of a subsplat), those alike in them, or all of
a list without any, by the nearest position and then the nearest values.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from refgi.errors import InputError
from refgi.types import Array
from refgi.vectors.bounds import ROUNDING, SAFETY
from refgi.vectors.manifest import ArrayEntry, CaseManifest, StageEntry
from refgi.vectors.spec import axes_of

COMPONENTS = ("rgb", "xyz", "xyz or rgb", "xy", "uv")  # names of axes that texels hold
TEXEL = 4  # components at most
LAYOUTS = ("planes", "rgba")
PACKED = {"R11G11B10F": (6, 6, 5), "RGB9E5": (9, 9, 9)}  # bits of each component's mantissa
PACKED_ROUNDING = {"R11G11B10F": 2.0**-6, "RGB9E5": 2.0**-9}  # relative, of the coarsest and of the largest component
LARGEST_EXPONENT, LEAST_EXPONENT = 15, -14  # of R11G11B10F: 5 bits, bias 15; below LEAST_EXPONENT steps stay the same
LEAST_HALF = 2.0**-24  # step of half floats below 2^-14
LEAST_SHARED = -15  # of RGB9E5, whose mantissas have no hidden 1: numbers are mantissa 2^(exponent - 9)
ROUNDED_UP = 512 / 511.5  # from 511.5 / 512 on the largest component is rounded to the next power of two
ENCODINGS = ("linear", "ndc", "gl", "reversed")
BITS = (16, 24, 32)
DEPTH_BITS, FLOAT_BITS = 24, 32


def component_axis(entry: ArrayEntry) -> int | None:
    """Return which axis of an array holds components, None where none does."""
    names = axes_of(entry.axes)
    return next((k for k, name in enumerate(names) if name in COMPONENTS and len(names) == len(entry.shape)), None)


def planes_of(entry: ArrayEntry, got: Array) -> tuple[Array, str]:
    """Return what texels of up to four components hold of an array in its own shape, and what was dropped.

    Components come last, as a readback gives them, or where the array has them. An array without components is the
    first of each texel. What fits neither way is returned as it is.
    """
    if got.shape == entry.shape:
        return got, ""
    axis = component_axis(entry)
    count = 1 if axis is None else entry.shape[axis]
    rest = entry.shape if axis is None else entry.shape[:axis] + entry.shape[axis + 1 :]
    for place in (got.ndim - 1, axis):
        if place is None or got.ndim != len(rest) + 1 or not count <= got.shape[place] <= TEXEL:
            continue
        if got.shape[:place] + got.shape[place + 1 :] == rest:
            taken = np.moveaxis(got, place, 0)[:count]
            spare = range(count, got.shape[place])
            dropped = f", without component {' and '.join(str(k + 1) for k in spare)}" if spare else ""
            return (taken[0] if axis is None else np.moveaxis(taken, 0, axis)), f"read as texels {got.shape}{dropped}"
    return got, ""


def can_pack(entry: ArrayEntry) -> bool:
    """Return whether an array has three float components, which a packed format holds."""
    axis = component_axis(entry)
    return entry.dtype == "<f4" and axis is not None and entry.shape[axis] == len(PACKED["RGB9E5"])


def packed_steps(tier: str, entry: ArrayEntry, array: Array) -> Array:
    """Return the step of a packed format at each element of an array; 0 beyond what the format holds."""
    axis = component_axis(entry) or 0
    colours = np.moveaxis(np.where(np.isfinite(array), array, 0.0).astype(np.float64), axis, 0)
    positive, bits = np.maximum(colours, 0.0), np.array(PACKED[tier]).reshape(-1, *[1] * (array.ndim - 1))
    if tier == "RGB9E5":
        largest = np.broadcast_to(positive.max(axis=0, initial=0.0) * ROUNDED_UP, positive.shape)
        exponent = np.frexp(np.maximum(largest, 2.0 ** (LEAST_SHARED - 1)))[1]
        most = (1 - 2.0**-bits) * 2.0 ** (LARGEST_EXPONENT + 1)
    else:
        exponent = np.frexp(np.maximum(positive, 2.0**LEAST_EXPONENT))[1] - 1
        most = (2 - 2.0**-bits) * 2.0**LARGEST_EXPONENT
    return np.moveaxis(np.where((colours >= 0) & (colours <= most), 2.0 ** (exponent - bits), 0.0), 0, axis)


class Depth(NamedTuple):
    """How a port stores depth z, m, as x between two planes; in 16 or 24 bits, or in 32: a float.

    linear: (z - n) / (f - n); ndc: f (z - n) / (z (f - n)), what a depth buffer holds; gl: 2 ndc - 1; reversed:
    1 - ndc.
    """

    encoding: str
    near: float
    far: float
    bits: int = DEPTH_BITS

    def decoded(self, stored: Array) -> Array:
        """Return depth in m, inf where the buffer was cleared, at the far plane; whole numbers are the raw bits."""
        x = stored.astype(np.float64) / (1.0 if stored.dtype.kind == "f" else 2.0**self.bits - 1.0)
        x = 0.5 * x + 0.5 if self.encoding == "gl" else x
        share = 1.0 - self.near / self.far
        with np.errstate(divide="ignore", invalid="ignore"):
            if self.encoding == "reversed":
                return np.where(x <= 0.0, np.inf, self.near / (self.near / self.far + share * x))
            z = self.near + x * (self.far - self.near) if self.encoding == "linear" else self.near / (1.0 - share * x)
        return np.where(x >= 1.0, np.inf, z)

    def steps(self, depth: Array) -> Array:
        """Return how far storage and float32 arithmetic of x move each depth: |dz/dx| times both."""
        z = np.where(np.isfinite(depth) & (depth > 0), depth, self.near or 1.0).astype(np.float64)
        share = 1.0 - self.near / self.far
        slope = np.full(z.shape, self.far - self.near) if self.encoding == "linear" else share * z * z / self.near
        size = np.abs(self.near / z - self.near / self.far) / share if self.encoding == "reversed" else np.ones(z.shape)
        unit = 2.0 if self.encoding == "gl" else 1.0  # length of the range of x
        step = 2.0 * ROUNDING * size if self.bits == FLOAT_BITS else unit / (2.0**self.bits - 1.0)
        return np.where(np.isfinite(depth), slope / unit * (step + SAFETY * ROUNDING * size), 0.0)


def depth_from(text: str) -> tuple[str, Depth]:
    """Return an array's name or its beginning, "" for all, and how its depth is stored; InputError if it says neither.

    From a text such as "ndc:0.1:100" or "rsm.map_surface=linear:0:50:16".
    """
    start, _, said = text.rpartition("=")
    encoding, *numbers = said.split(":")
    try:
        near, far = map(float, numbers[:2])
        bits = int(*numbers[2:] or (DEPTH_BITS,))
    except (TypeError, ValueError):
        near, far, bits = 0.0, 0.0, 0
    between = 0.0 <= near < far and (far < math.inf if encoding == "linear" else near > 0.0)
    if encoding not in ENCODINGS or bits not in BITS or not between:
        raise InputError(f"--depth: expected [ARRAY=]ENCODING:NEAR:FAR[:BITS], an encoding of {', '.join(ENCODINGS)}, "
                         f"0 < NEAR < FAR, and {', '.join(map(str, BITS))} bits, got {text!r}")
    return start, Depth(encoding, near, far, bits)


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

"""A port's arrays of one case in the form that the kit has them, and how far its storage may move them. NumPy alone.

Texels become planes, stored depth becomes m, lists get the kit's order. An array in few bits may be a step of its
format off; a stage that reads it may change by what a rounding of its inputs to half floats changes it by (tier T2),
times the ratio of both roundings. A light whose flux is stored as 0 may be absent from a list that is made of it: the
expected one stands for it, and what a chain makes of such a list is not judged where it is out.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from refgi.types import Array
from refgi.vectors.bounds import HALF_ROUNDING, SAFETY, large_value
from refgi.vectors.kit import Asked, DamagedError, Kit, find_array, fits, read_array
from refgi.vectors.manifest import CaseManifest, StageEntry, Tolerance
from refgi.vectors.spec import axes_of
from refgi.vectors.storage import (
    LEAST_HALF,
    PACKED,
    PACKED_ROUNDING,
    can_pack,
    component_axis,
    list_axis,
    order_of,
    packed_steps,
    planes_of,
    reordered,
)

IN_ORDER = "its elements matched with those of the kit, as --unordered says"


class Got(NamedTuple):
    """What a port has written of one stage."""

    arrays: dict[str, Array]
    read: dict[str, str]  # how arrays were read that do not lie as the kit's
    damaged: dict[str, str]  # why files cannot be read


class Few(NamedTuple):
    """What storage in few bits allows beside other bounds."""

    more: Array  # as the array
    outliers: float  # share of elements


class Port:
    """What a port has written of a case, in its folder `output`; its stages are read in order."""

    def __init__(self, kit: Kit, case: CaseManifest, output: Path, asked: Asked) -> None:
        self.kit, self.case, self.output, self.asked = kit, case, output, asked
        self.few: dict[str, Few] = {}  # arrays that storage moves
        self.halved: set[str] = set()  # chained: arrays in half floats, and those made from them
        self.loose: set[str] = set()  # chained: arrays made from lists without the lights whose flux is stored as 0
        self._filled: set[str] = set()  # such lists
        self._dark: dict[str, int] = {}  # texels and lights whose flux storage may round to 0, by the flux's name
        self._rounding: dict[str, float] = {}  # of arrays in few bits, relative
        self._orders: dict[str, dict[str, tuple[Array, str]]] = {}  # array -> axis of a list -> its order, its stage

    def read(self, step: StageEntry) -> Got:
        """Return what a port has of a stage."""
        got = Got({}, {}, {})
        for name in step.writes:
            file = find_array(self.output, self.case.id, name)
            if file is None:
                continue
            try:
                got.arrays[name] = self._in_form(name, read_array(file), got)
            except DamagedError as error:
                got.damaged[name] = str(error)
        self._fill(step, got)
        orders = {axis: order for name in step.reads for axis, order in self._orders.get(name, {}).items()}
        if self.asked.unordered and fits(step.name, self.asked.unordered):
            expected = {name: self.kit.array(self.case, name) for name in step.writes}
            found = order_of(self.case, step, expected, got.arrays)
            orders |= {} if found is None else {found[0]: (found[1], step.name)}
        self._orders.update(dict.fromkeys(step.writes, orders))
        self.note_storage(step)
        if self.asked.chained and (self.halved & {*step.reads} or any(
                self.asked.tier_of(step.name, name) == "T2" for name in step.writes)):
            self.halved.update(step.writes)
        for name, array in got.arrays.items():
            own = self.in_order_of_lists(name, array, None if self.asked.chained else step.name)
            if own is not None:
                got.arrays[name] = own
                got.read[name] = f"{got.read[name]}; {IN_ORDER}" if name in got.read else IN_ORDER
        return got

    def _fill(self, step: StageEntry, got: Got) -> None:
        """Put the darkest of a list's expected lights where a port has none, as many as storage may round to 0."""
        if self.asked.chained and (self._filled | self.loose) & {*step.reads}:
            self.loose.update(step.writes)
        axis, dark = list_axis(self.case, step), sum(self._dark.get(name, 0) for name in step.reads)
        if axis and dark:
            expected = {name: self.kit.array(self.case, name) for name in step.writes}
            along = {name: axes_of(self.case.arrays[name].axes).index(axis) for name in got.arrays}
            lacking = {_fewer(expected[name].shape, got.arrays[name].shape, k) for name, k in along.items()}
            flux = [np.moveaxis(expected[name], along[name], -1) for name in along if self._is_flux(name)]
            if flux and len(lacking) == 1 and 0 < (count := lacking.pop()) <= dark:
                brightness = sum(one.reshape(-1, one.shape[-1]).sum(axis=0) for one in flux)
                places = np.sort(np.argsort(brightness, kind="stable")[:count])
                for name, k in along.items():
                    got.arrays[name] = np.insert(got.arrays[name], places - np.arange(count),
                                                 np.take(expected[name], places, k), k)
                    got.read[name] = f"without {count} whose flux is stored as 0"
                self._filled.update(step.writes)
        for name in filter(self._is_flux, step.writes):
            tier, entry, right = self.asked.tier_of(step.name, name), self.case.arrays[name], self.kit.array(
                self.case, name)
            steps = packed_steps(tier, entry, right) if tier in PACKED else LEAST_HALF if tier == "T2" else 0.0
            off = ((right < steps).all(axis=(k := component_axis(entry) or 0))) & (right > 0).any(axis=k)
            self._dark[name] = int(np.count_nonzero(off))

    def _is_flux(self, name: str) -> bool:
        return self.case.arrays[name].unit == "W" and can_pack(self.case.arrays[name])

    def note_storage(self, step: StageEntry) -> None:
        """Note what storage in few bits does to a stage's arrays."""
        if self.asked.depth or set(self.asked.tiers.values()) & set(PACKED):
            for name in step.writes:
                self._note_storage(step, name, self.kit.array(self.case, name))

    def in_order_of_lists(self, name: str, array: Array, made_by: str | None = None) -> Array | None:
        """Return an array with lists, one stage's or all, in the kit's order; None where that changes nothing."""
        moved = array
        for axis, (places, stage) in self._orders.get(name, {}).items():
            if made_by in (None, stage) and not np.array_equal(places, np.arange(len(places))):
                moved = reordered(self.case, name, moved, axis, places)
        return None if moved is array else moved

    def _note_storage(self, step: StageEntry, name: str, expected: Array) -> None:
        """Note what storage in few bits allows of an array, its own and that of what its stage reads."""
        entry, size, own, steps = self.case.arrays[name], np.zeros(expected.shape), 0.0, np.zeros(expected.shape)
        tier, depth = self.asked.tier_of(step.name, name), self.asked.depth_of(name)
        if entry.dtype == "<f4":
            size = np.where(np.isfinite(expected), np.abs(expected), 0.0)
            if tier in PACKED and can_pack(entry):
                own, steps = PACKED_ROUNDING[tier], packed_steps(tier, entry, expected)
            elif depth is not None:
                steps = depth.steps(expected)
                own = float((0.5 * steps[size > 0] / size[size > 0]).max(initial=0.0))
            size = size + large_value(expected)
        read = max((self._rounding.get(one, 0.0) for one in step.reads if one not in step.exact), default=0.0)
        ratio = 0.0 if entry.half is None else read / HALF_ROUNDING
        changed = 0.0 if entry.half is None else max(entry.half.relative - (SAFETY - 1) * HALF_ROUNDING, 0.0)
        outliers = 0.0 if entry.half is None else min(1.0, ratio * self._spared_in_half(entry.half))
        self._rounding[name] = max(own, read if self.asked.chained else 0.0)
        if (own or read) and tier != "T0":
            self.few[name] = Few(steps + ratio * changed * size, outliers)

    def _spared_in_half(self, half: Tolerance) -> float:
        """Return the share of an array that half floats may move at will."""
        masked = 0.0 if half.masked is None else float(self.kit.extra(self.case, half.masked).mean())
        return half.outliers + masked

    def _in_form(self, name: str, array: Array, got: Got) -> Array:
        """Return an array as planes and in m."""
        entry, said = self.case.arrays[name], ""
        if self.asked.layout == "rgba":
            array, said = planes_of(entry, array)
        depth = self.asked.depth_of(name)
        if depth is not None and entry.dtype == "<f4":
            array, said = depth.decoded(array), f"{said}{'; ' if said else ''}from {depth.encoding} depth"
        if said:
            got.read[name] = said
        return array


def _fewer(expected: tuple[int, ...], got: tuple[int, ...], axis: int) -> int:
    """Return how many elements fewer there are along an axis; 0 where shapes differ otherwise."""
    alike = len(got) == len(expected) and (*got[:axis], *got[axis + 1 :]) == (*expected[:axis], *expected[axis + 1 :])
    return expected[axis] - got[axis] if alike else 0

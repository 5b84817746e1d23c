"""The packed lights of each area light and each subset, next to each other."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.cluster.lighting.interleave import Subsets
from refgi.pairs.irradiance import add_lights
from refgi.pairs.lobe_shape import Widening
from refgi.pairs.packing import Packed, PackedLobes
from refgi.pairs.pair_sum import Clamp

Array = npt.NDArray[Any]


class MemberLights(NamedTuple):
    """Lights sorted by area light, then subset, then their own order."""

    packed: Packed
    start: Array  # (M, n^2 + 1) int64: first diffuse light of each subset of an area light, and one past its last
    lobe_start: Array  # (M, n^2 + 1) int64: the same of the lobes


def member_lights(packed: Packed, area_of: Array, count: int, subset: Array, subsets: int) -> MemberLights:
    """Sort packed lights by what they belong to.

    Parameters
    ----------
    packed : Packed
        The lights.
    area_of : (N,) ndarray of int
        C(i), the area light of each.
    count : int
        M, how many area lights there are.
    subset : (N,) ndarray of int
        Of interleaved sampling, the subset that each light belongs to.
    subsets : int
        n^2, how many subsets there are.

    Returns
    -------
    MemberLights
        The same lights, sorted.
    """
    key = np.asarray(area_of, np.int64) * subsets + subset
    order, start = _sorted(key[packed.shines], count, subsets)
    lobe_order, lobe_start = _sorted(key[packed.glossy], count, subsets)
    with_black = np.append(order, packed.diffuse.shape[1] - 1)
    return MemberLights(
        Packed(np.ascontiguousarray(packed.diffuse[:, with_black]),
               packed.clamp and packed.clamp._replace(softness=packed.clamp.softness[with_black]),
               None if packed.spheres is None else packed.spheres[order],
               None if packed.lobes is None else _lobes(packed.lobes, lobe_order), packed.shines, packed.glossy),
        start, lobe_start)


def add_members(
    position: Array, normal: Array, parts: Subsets, members: MemberLights, m: int, irradiance: Array
) -> None:
    """Add the lights of one area light, of any kind, to the receivers of each subset.

    Parameters
    ----------
    position, normal : (3, n) ndarray
        Receivers in the order of `parts`.
    parts : Subsets
        Which of them sum which lights.
    members : MemberLights
        The lights.
    m : int
        Which area light.
    irradiance : (3, n) ndarray
        W/m^2; zeros, which are filled.
    """
    for subset, (first, last) in enumerate(zip(parts.start[:-1], parts.start[1:], strict=True)):
        some = _some(members.packed, members.start[m, subset : subset + 2], members.lobe_start[m, subset : subset + 2])
        if first < last and (some.diffuse.shape[1] > 1 or some.lobes is not None):
            here, facing = (np.ascontiguousarray(values[:, first:last]) for values in (position, normal))
            sums = np.zeros_like(here)
            add_lights(here, facing, some, sums)
            irradiance[:, first:last] = sums


def _sorted(key: Array, count: int, subsets: int) -> tuple[Array, Array]:
    order = np.argsort(key, kind="stable")
    edges = np.searchsorted(key[order], np.arange(count * subsets + 1))
    rows = np.arange(count)[:, None] * subsets + np.arange(subsets + 1)
    return order, np.ascontiguousarray(edges[rows])


def _lobes(lobes: PackedLobes, chosen: Array) -> PackedLobes:
    widening: Widening | None = lobes.widening
    if widening is not None:
        widening = widening._replace(cos_theta=widening.cos_theta[chosen])
    clamp: Clamp = lobes.clamp._replace(softness=lobes.clamp.softness[chosen])
    return PackedLobes(np.ascontiguousarray(lobes.lights[:, chosen]), clamp, widening)


def _some(packed: Packed, diffuse: Array, lobes: Array) -> Packed:
    """Return the lights from one place to another."""
    chosen = np.arange(*diffuse)
    with_black = np.append(chosen, packed.diffuse.shape[1] - 1)
    glossy = np.arange(*lobes)
    return Packed(np.ascontiguousarray(packed.diffuse[:, with_black]),
                  packed.clamp and packed.clamp._replace(softness=packed.clamp.softness[with_black]),
                  None if packed.spheres is None else packed.spheres[chosen],
                  None if packed.lobes is None or len(glossy) == 0 else _lobes(packed.lobes, glossy),
                  packed.shines, packed.glossy)

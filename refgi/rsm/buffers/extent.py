"""Extent of a scene: the bounding box of what is visible or illuminated, to which relative settings refer.

Surfaces that are neither visible to the camera nor reflect light have no effect on a picture, so their size must have
none either. Of a light's map a grid of texels is sampled, so that no other texel's position need be computed.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from refgi.jit import kernel, prange
from refgi.rsm.buffers.gbuffer import GBuffer
from refgi.rsm.buffers.reflective import Rsm
from refgi.scene.model import Geometry
from refgi.stages import stage
from refgi.types import Array

SAMPLES = 96  # texels along a side of a light's map: the box is then short of 1 % of what the map shows at either end


class Extent(NamedTuple):
    """An axis-aligned box."""

    low: Array  # (3,) float64, m
    high: Array  # (3,) float64, m; below `low` where nothing is within

    @property
    def empty(self) -> bool:
        """Whether nothing is within."""
        return bool((self.high < self.low).any())

    @property
    def diagonal(self) -> float:
        """Length of the box's diagonal, m; 0 where it is empty."""
        return 0.0 if self.empty else float(np.linalg.norm(self.high - self.low))

    @property
    def largest(self) -> float:
        """Largest coordinate in size, m; 0 where the box is empty."""
        return 0.0 if self.empty else float(max(np.abs(self.low).max(), np.abs(self.high).max()))

    def or_whole(self, geometry: Geometry) -> "Extent":
        """Return the box, or that of all triangles where this one has no size."""
        return self if self.diagonal > 0 else Extent(*geometry.bounds)


@stage("frame.visible_extent", steps="refgi.rsm.buffers.steps.visible_steps")
def visible_extent(buffer: GBuffer) -> Extent:
    """Return the bounding box of the visible surfaces.

    -> Extent: Empty where it sees nothing.
    """
    return bounds_of(*buffer.resolve("position", "covered"))


def bounds_of(position: Array, covered: Array) -> Extent:
    """Return the box of those positions (3, h, w), m, that are `covered` (h, w)."""
    rows = np.empty((6, len(covered)))
    _row_bounds(position, covered, rows)
    return Extent(rows[:3].min(axis=1), rows[3:].max(axis=1))


@stage("frame.illuminated_extent", steps="refgi.rsm.buffers.steps.illuminated_steps")
def illuminated_extent(rsms: Sequence[Rsm]) -> Extent:
    """Return the bounding box of surfaces that reflect direct light, from a grid of each map's texels.

    -> Extent: Empty where nothing reflects light.
    """
    parts = (_reflecting_positions(rsm) for rsm in rsms)
    positions = np.concatenate([np.zeros((3, 0)), *parts], axis=1, dtype=np.float64)
    return Extent(positions.min(axis=1, initial=np.inf), positions.max(axis=1, initial=-np.inf))


def joined(one: Extent, other: Extent) -> Extent:
    """Return the smallest box that holds two."""
    return Extent(np.minimum(one.low, other.low), np.maximum(one.high, other.high))


def texel_grid(covered: Array, side: int) -> Array:
    """Return texels of a map (H, W) on a grid, `side` x `side` of each of its faces, or all where it has fewer."""
    height, width = covered.shape
    maps = max(1, height // width)
    rows, columns = ((np.arange(min(size, count)) + 0.5) * size / min(size, count)
                     for size, count in ((height, maps * side), (width, side)))
    return np.asarray((rows.astype(np.int64)[:, None] * width + columns.astype(np.int64)).ravel())


def _reflecting_positions(rsm: Rsm) -> Array:
    """Return positions of a grid of texels, (3, n): those that reflect light."""
    texel = texel_grid(rsm.covered, SAMPLES)
    texel = texel[rsm.covered.reshape(-1)[texel]]
    position, flux = rsm.at(texel, "position", "flux")
    reflects = flux.any(axis=0)
    lobes = rsm.lobe_flux
    if lobes is not None:
        reflects |= lobes.reshape(3, -1)[:, texel].any(axis=0)
    return np.asarray(position[:, reflects])


@kernel(parallel=True)
def _row_bounds(position: Array, covered: Array, rows: Array) -> None:
    """Fill least and most coordinates of the covered pixels of each row, halves of it against each other."""
    for row in prange(covered.shape[0]):
        real, columns = position.dtype.type, covered.shape[1]
        low, high = np.empty(columns, position.dtype), np.empty(columns, position.dtype)
        for c in range(3):
            for i in range(columns):
                place = position[c, row, i]
                low[i] = place if covered[row, i] else real(np.inf)
                high[i] = place if covered[row, i] else real(-np.inf)
            count = columns
            while count > 1:
                half = (count + 1) // 2
                for i in range(count - half):
                    low[i] = low[half + i] if low[half + i] < low[i] else low[i]
                    high[i] = high[half + i] if high[half + i] > high[i] else high[i]
                count = half
            rows[c, row], rows[3 + c, row] = low[0], high[0]

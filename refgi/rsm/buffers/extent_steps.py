"""Boxes of a scene's extent from planes of its views."""

from collections.abc import Sequence

import numpy as np

from refgi.rsm.buffers.extent import SAMPLES, Extent, bounds_of, texel_grid
from refgi.rsm.buffers.gbuffer import GBuffer
from refgi.rsm.buffers.reflective import Rsm
from refgi.stages import stage
from refgi.types import Array


@stage("rsm.visible_extent", kept=False)
def visible_extent(position: Array, covered: Array) -> tuple[Array, Array]:
    """Bound what the camera sees (docs/methods/val).

    position (3, h, w): Surface points of pixels, m.
    -> low (3,): Least coordinates of the pixels' surface points, m.
    -> high (3,): Greatest ones, m.
    """
    low, high = bounds_of(position, covered)
    return low, high


@stage("rsm.illuminated_extent", kept=False)
def illuminated_extent(
    map_positions: tuple[Array, ...], map_fluxes: tuple[Array, ...], map_lobe_fluxes: tuple[Array | None, ...]
) -> tuple[Array, Array]:
    """Bound what reflects direct light, of all lamps, by a grid of 96 x 96 texels of each map (docs/methods/val).

    map_positions tuple of (3, h, w): Surface points of each lamp's map, m.
    map_fluxes tuple of (3, h, w): Flux that diffuse surfaces reflect, W.
    map_lobe_fluxes tuple of (3, h, w): Flux that lobes reflect, W; none where no material has one.
    -> low (3,): Least coordinates of texels with flux, m.
    -> high (3,): Greatest ones, m.
    """
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for position, flux, lobe_flux in zip(map_positions, map_fluxes, map_lobe_fluxes, strict=True):
        reflects = np.asarray(flux.any(axis=0) if lobe_flux is None else flux.any(axis=0) | lobe_flux.any(axis=0))
        texel = texel_grid(reflects, SAMPLES)
        shown = position.reshape(3, -1)[:, texel[reflects.reshape(-1)[texel]]]
        low, high = np.minimum(low, shown.min(axis=1, initial=np.inf)), np.maximum(
            high, shown.max(axis=1, initial=-np.inf))
    return low, high


def visible_steps(buffer: GBuffer) -> Extent:
    """Return the box of what a camera sees, made by steps."""
    return Extent(*visible_extent(*buffer.resolve("position", "covered")))


def illuminated_steps(rsms: Sequence[Rsm]) -> Extent:
    """Return the box of what reflects direct light, made by steps."""
    return Extent(*illuminated_extent(*(tuple(getattr(rsm, name) for rsm in rsms) for name in (
        "position", "flux", "lobe_flux"))))

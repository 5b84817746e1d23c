"""From pixel lights to radiance of glossy receivers: checks, packing and order around `glossy_sum`, or shadow rays."""

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from refgi.jit import kernel, prange
from refgi.pairs.glossy_sum import Culls, add_diffuse_lights, add_glossy_lights, receiver_lobes_of
from refgi.pairs.irradiance import PAIRS_AT_ONCE, Receivers, checked
from refgi.pairs.packing import Packed
from refgi.pairs.pair_sum import TILE
from refgi.pairs.pixel_lights import Range
from refgi.pairs.ranged_sum import LANES
from refgi.pairs.settings import PairSettings
from refgi.pairs.shadow_rays import BATCH, Hidden, RayReceivers, Senders, summed
from refgi.pairs.tile_counts import lights_off_lobes, lobe_tiles, tiles_behind
from refgi.radiometry import receiver_lobe
from refgi.rsm.buffers.leaving import GlossyPoints
from refgi.skips import left_out
from refgi.stages import report_progress, stage, tally
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.pairs.pixel_lights import PixelLights
    from refgi.rays import Tracer

Listing = Callable[[Array, Array], tuple[Array | None, Array | None]]


@stage("pairs.glossy_sum")
def glossy_radiance(
    points: GlossyPoints, lights: "PixelLights", settings: PairSettings, footprint: Array | None = None, width: int = 0,
) -> Array:
    """Sum the radiance that every receiver's lobe reflects towards the eye, of every pixel light (AMS Eq. 2).

    points: The n receivers; their dtype is that of the result.
    width: Of the picture that the points are pixels of; 0: neighbours follow each other already. Of no other meaning.
    -> (3, n): W/m^2/sr, linear RGB, without visibility.

    Raises
    ------
    InputError
        As `pairs.irradiance.irradiance`.

    Notes
    -----
    L_s = sum f_s(w_i, w_o) I_i cos / r^2 with f_s = specular (P + 2) / (2 pi) <m . w>^P. The paper's rho_s is any BRDF;
    its pi is part of the lights here. Lights are summed one by one, never by clusters. Results do not depend on the
    number of threads or on which receivers follow each other, to the bit.
    """
    return glossy_summed(points, checked(as_receivers(points), lights, settings, footprint), (None, None), width)


def as_receivers(points: GlossyPoints) -> Receivers:
    """Return n glossy points as a picture of one row, (3, 1, n) and (1, n)."""
    return Receivers(points.position[:, None], points.normal[:, None], np.ones((1, len(points.pixel)), np.bool_))


def glossy_summed(
    points: GlossyPoints, packed: Packed, ranges: tuple[Range | None, Range | None], width: int = 0,
    lists: Listing | None = None,
) -> Array:
    """Sum packed lights, in the dtype of the receivers, at n glossy receivers: (3, n), W/m^2/sr.

    `ranges` of the diffuse lights and of the lobes say which pairs count, None: all. `width` as for `glossy_radiance`.
    `lists` returns which diffuse lights and which lobes may count for which tile of LANES receivers, of positions and
    normals (3, m); None: any.
    """
    order = np.arange(len(points.pixel)) if width == 0 else block_order(points.pixel, width)
    tally("pairs", lambda: len(order) * packed.terms)
    result = np.zeros_like(points.position)
    step = max(1 << 14, PAIRS_AT_ONCE // max(1, len(packed.shines)) // TILE * TILE)
    for first in range(0, len(order), step):
        part = order[first : first + step]
        some = GlossyPoints(*(np.ascontiguousarray(plane[..., part]) for plane in points))
        sums = np.zeros((3, len(part)), points.position.dtype)
        _add_lights(some, packed, ranges, (None, None) if lists is None else lists(some.position, some.normal), sums)
        result[:, part] = sums * some.specular
        report_progress(min(1.0, (first + step) / len(order)))
    return result


def _add_lights(
    points: GlossyPoints, packed: Packed, ranges: tuple[Range | None, Range | None],
    listed: tuple[Array | None, Array | None], sums: Array,
) -> None:
    of = receiver_lobes_of(points.mirrored, points.exponent)
    place = points.position, points.normal
    off_lobes = left_out("pairs.receiver_lobes", lambda: lights_off_lobes(*place, of, packed))
    if packed.diffuse.shape[1] > 1:
        behind = listed[0] is None and left_out("pairs.tiles", lambda: tiles_behind(*place, packed.diffuse, LANES))
        add_diffuse_lights(*place, of, packed.diffuse, packed.clamp, packed.spheres, ranges[0], listed[0],
                           Culls(behind, off_lobes), sums)
    lobes = packed.lobes
    if lobes is not None:
        behind = left_out("pairs.lobe_tiles", lambda: lobe_tiles(*place, lobes, LANES))
        add_glossy_lights(*place, of, lobes.lights, lobes.clamp, lobes.widening, ranges[1], listed[1],
                          Culls(behind, off_lobes), sums)


def block_order(pixel: Array, width: int) -> Array:
    """Return the order of flat indices (n,) into a picture by blocks of 16 x 16, within these 8 x 8, then 4 x 4.

    Tiles of receivers that follow each other in it are compact.
    """
    row, column = np.divmod(pixel, width)
    key = row // 16 * (width // 16 + 1) + column // 16
    for side in (8, 4):
        key = key * 4 + row // side % 2 * 2 + column // side % 2
    return np.argsort(key * 16 + row % 4 * 4 + column % 4, kind="stable")


@stage("pairs.glossy_rays")
def shadowed_radiance(
    tracer: "Tracer", to: RayReceivers, points: GlossyPoints, lights: "PixelLights", *, visibility: bool = True,
    batch: int = BATCH, hidden: Hidden | None = None,
) -> Array:
    """Sum the radiance that every receiver's lobe reflects towards the eye of the light that reaches it.

    points: The receivers with their lobes.
    visibility: Whether to trace the rays, none for a light that lies off the lobe; without, every pair counts.
    batch: Pairs held at a time; changes no bit of the result.
    hidden: As for `shadowed_sum`.
    -> (3, n) float64: W/m^2/sr.
    """
    return summed(tracer, to, lights, visibility, batch, hidden, partial(weigh_by_lobes, points))


@kernel(parallel=True)
def weigh_by_lobes(
    points: GlossyPoints, to: RayReceivers, receivers: tuple[int, int], senders: Senders, lights: tuple[int, int],
    reach: Array, contribution: Array,
) -> None:
    """Turn the irradiance of each pair, `contribution` (pairs, 3) of `fill_shadow_rays`, into radiance of the lobe.

    Pairs off the lobe give 0, and their `reach` (pairs,) is 0.
    """
    count = lights[1] - lights[0]
    for i in prange(receivers[1] - receivers[0]):
        for k in range(count):
            _weigh(points, to, receivers[0] + i, senders, lights[0] + k, reach, contribution, i * count + k)


@kernel
def _weigh(
    points: GlossyPoints, to: RayReceivers, r: int, senders: Senders, j: int, reach: Array, contribution: Array,
    ray: int,
) -> None:
    if reach[ray] <= 0:
        return
    mirror, position = points.mirrored, to.position
    lobe = receiver_lobe(
        np.float64(mirror[0, r]), np.float64(mirror[1, r]), np.float64(mirror[2, r]),
        senders.position[0, j] - position[0, r], senders.position[1, j] - position[1, r],
        senders.position[2, j] - position[2, r], np.float64(points.exponent[r]))
    reach[ray] = 0
    for c in range(3):
        # f_s I cos / r^2
        contribution[ray, c] = contribution[ray, c] * (points.specular[c, r] * lobe)
        if contribution[ray, c] > 0:
            reach[ray] = 1

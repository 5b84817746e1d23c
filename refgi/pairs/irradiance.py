"""From pixel lights to irradiance at every pixel, and to radiance of glossy ones: checks, packing, choice of kernels.

What the lights do not need does not run: pixels without surface, lights that cannot reach a tile, lobe code without a
glossy light, all skips that change no bit (`refgi.skips`). A light without diffuse flux is no diffuse light; among
others it would move where sums over 64 lights end, and their rounding.
"""

import inspect
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from refgi.errors import expect
from refgi.pairs.glossy_sum import Culls, add_diffuse_lights, add_glossy_lights, receiver_lobes_of
from refgi.pairs.lightcuts.cuts import add_cuts, chosen
from refgi.pairs.lobe_sum import add_lobes
from refgi.pairs.pair_sum import TILE, sum_pairs
from refgi.pairs.pixel_lights import Packed, PackedLobes, Range, Unpacked, clustered
from refgi.pairs.ranged_sum import LANES
from refgi.pairs.settings import AutoLightcuts, Lightcuts, PairSettings, SphereClamp
from refgi.pairs.sphere_sum import sum_spheres
from refgi.pairs.tile_counts import lights_off_lobes, lobe_tiles, tiles_behind
from refgi.pairs.tiles import block_by_block, clear, put, receiving, taken
from refgi.rsm.buffers.leaving import GlossyPoints
from refgi.rsm.pool import plane, zeros
from refgi.skips import left_out
from refgi.stages import report_progress, skip, stage, tally
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.pairs.pixel_lights import PixelLights

PAIRS_AT_ONCE = 1 << 31  # between two reports of progress


class Receivers(NamedTuple):
    """Points to light."""

    position: Array  # (3, h, w) world space, m
    normal: Array  # (3, h, w) unit vectors
    covered: Array  # (h, w) bool, whether there is a surface


@stage("pairs.sum")
def irradiance(
    receivers: Receivers, lights: "PixelLights", settings: PairSettings, footprint: Array | None = None,
    lightcuts: AutoLightcuts | Lightcuts | None = None,
) -> Array:
    """Sum the irradiance of every pixel light at every receiver (SII Eq. 2).

    receivers: Points to light; their dtype is that of the result.
    lightcuts: Sum diffuse lights by clusters, to an error; lobes are summed in full. "auto": where that is estimated
        to take less time.
    -> (3, h, w): Irradiance, W/m^2, linear RGB; 0 where there is no surface. Contains both cosines and the light's
        1/pi; excludes the receiver's albedo/pi and visibility.

    Raises `InputError` if shapes do not fit, a light is not finite, the clamp lacks its footprints, or a light is
    glossy and the clamp is "sphere".

    E = sum (Phi / pi) <n_l . w> <n_x . -w> / r^2 (Eq. 1 prints no 1/pi: `sii_no_pi`), plus the lobes of Eq. 3. A
    light that coincides with a receiver adds 0. Results do not depend on the number of threads, on how receivers
    are split into calls or on where a pixel stands in the picture, to the bit. With `lightcuts` they depend on which
    receivers follow each other, within the error.
    """
    packed = checked(receivers, lights, settings, footprint, lightcuts)

    def add(here: Array, facing: Array, _: Array, sums: Array) -> None:
        add_lights(here, facing, packed, sums)

    return over_receivers(receivers, packed, add)


summed: Callable[..., Array] = inspect.unwrap(irradiance)  # unobserved


def add_lights(position: Array, normal: Array, packed: Packed, irradiance: Array) -> None:
    """Add every packed light, uncut, to points (3, n) in their order; neighbours should follow each other.

    `irradiance` (3, n), W/m^2, holds zeros before.
    """
    if packed.tree is None:
        tally("pairs", lambda: position.shape[1] * packed.terms)
    if packed.tree is not None:
        add_cuts(position, normal, packed.tree, irradiance)
    elif packed.diffuse.shape[1] > 1 and packed.spheres is not None:
        sum_spheres(position, normal, packed.diffuse, packed.spheres, None, irradiance)
    elif packed.diffuse.shape[1] > 1:
        culls = left_out("pairs.tiles", lambda: tiles_behind(position, normal, packed.diffuse))
        sum_pairs(position, normal, packed.diffuse, packed.clamp, culls, irradiance)
    if packed.lobes is not None:
        add_lobes(position, normal, *packed.lobes, None, _listed_lobes(position, normal, packed.lobes), irradiance)


def _listed_lobes(position: Array, normal: Array, lobes: PackedLobes) -> Array | None:
    """Return None where the kernel finds out which lobes miss which tiles; without that skip a list of all."""
    if left_out("pairs.lobe_tiles", lambda: lobe_tiles(position, normal, lobes)):
        return None
    return np.ones((-(-position.shape[1] // LANES), lobes.lights.shape[1]), np.bool_)


def checked(
    receivers: Receivers, lights: "PixelLights", settings: PairSettings, footprint: Array | None,
    lightcuts: AutoLightcuts | Lightcuts | None = None,
) -> Packed:
    """Check the arguments of a sum over pairs, as `irradiance`, and pack its lights in the dtype of the receivers.

    `footprint` (N,) is the surface each light stands for, m^2; `lightcuts` the clusters to sum diffuse lights by.
    """
    _check(receivers, lights, settings, footprint)
    unpacked = Unpacked(lights, settings, footprint, receivers.position.dtype)
    if isinstance(lightcuts, AutoLightcuts):
        lightcuts = chosen(lightcuts, unpacked.packed, receivers[:2], receivers.covered)
    packed = unpacked.packed if lightcuts is None else clustered(unpacked, lightcuts.error)
    if packed.lobes is None:
        skip("pairs.lobes", "no pixel light is glossy")
    return packed


def over_receivers(receivers: Receivers, packed: Packed, add: Callable[[Array, Array, Array, Array], None]) -> Array:
    """Sum something over the lights at every pixel with a surface, some pixels at a time; (3, h, w), 0 without surface.

    The number of lights says how many pixels go at a time. `add` is called with positions and normals (3, n), flat
    indices (n,) in the picture and zeros (3, n), to which it adds. All but the last call have whole tiles.
    """
    position, covered = np.asarray(receivers.position), np.asarray(receivers.covered, np.bool_)
    normal = np.asarray(receivers.normal, position.dtype)
    shown = receiving(covered)
    places = block_by_block(shown)
    result = (plane if len(places) == covered.size else zeros)(position.shape, position.dtype)
    step = max(1 << 14, PAIRS_AT_ONCE // max(1, len(packed.shines)) // TILE * TILE)
    for first in range(0, len(places), step):
        part = places[first : first + step]
        points, normals = taken(position, part), taken(normal, part)
        sums = zeros(points.shape, points.dtype)
        add(points, normals, part, sums)
        put(result, part, sums)
        report_progress(min(1.0, (first + step) / len(places)))
    clear(result, covered, shown)
    return result


def _check(
    receivers: Receivers, lights: "PixelLights", settings: PairSettings, footprint: Array | None
) -> None:
    position, normal, covered = (np.asarray(part) for part in receivers)
    expect(position.ndim == 3 and len(position) == 3, "receivers.position", "shape (3, h, w)", position.shape)
    expect(position.dtype in (np.float32, np.float64), "receivers.position", "float32 or float64", position.dtype)
    expect(normal.shape == position.shape, "receivers.normal", f"shape {position.shape}", normal.shape)
    expect(covered.shape == position.shape[1:], "receivers.covered", f"shape {position.shape[1:]}", covered.shape)
    count = lights.position.shape[1]
    for key in ("position", "normal", "flux", "lobe_flux", "lobe_axis"):
        values = getattr(lights, key)
        if values is not None:
            expect(values.shape == (3, count), f"lights.{key}", f"shape (3, {count})", values.shape)
            expect(bool(np.isfinite(values).all()), f"lights.{key}", "finite numbers", "NaN or infinity")
    clamp = settings.clamp
    if clamp is not None and settings.needs_footprints:
        expect(footprint is not None and footprint.shape == (count,), "footprint",
               f"the area of each of {count} lights for the clamp {clamp.name()!r}", None if footprint is None else
               footprint.shape)
    if isinstance(clamp, SphereClamp):
        expect(lights.lobe_flux is None or not lights.lobe_flux.any(), "clamp",
               "another one for glossy materials ('sphere' knows diffuse lights alone)", "sphere")


Listing = Callable[[Array, Array], tuple[Array | None, Array | None]]


@stage("pairs.glossy_sum")
def glossy_radiance(
    points: GlossyPoints, lights: "PixelLights", settings: PairSettings, footprint: Array | None = None, width: int = 0,
) -> Array:
    """Sum the radiance that every receiver's lobe reflects towards the eye, of every pixel light (AMS Eq. 2).

    points: The n receivers; their dtype is that of the result.
    width: Of the picture that the points are pixels of; 0: neighbours follow each other already. Of no other meaning.
    -> (3, n): W/m^2/sr, linear RGB, without visibility.

    Raises `InputError` as `pairs.irradiance.irradiance`.

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
        position, normal, mirrored, specular = (
            taken(vector, part) for vector in (points.position, points.normal, points.mirrored, points.specular))
        some = GlossyPoints(part, position, normal, mirrored, points.exponent[part], specular)
        sums = np.zeros((3, len(part)), points.position.dtype)
        _add_lights(some, packed, ranges, (None, None) if lists is None else lists(some.position, some.normal), sums)
        put(result, part, sums * some.specular)
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
    shown = np.zeros((int(pixel.max(initial=0)) // width + 1, width), np.bool_)
    shown.reshape(-1)[pixel] = True
    place = plane((shown.size,), np.int64)
    place[pixel] = np.arange(len(pixel))
    return np.take(place, block_by_block(shown))

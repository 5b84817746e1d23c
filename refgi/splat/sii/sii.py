"""Splatting Indirect Illumination (Dachsbacher and Stamminger 2006): the method, its sum, lobes of glossy receivers.

`sii` chooses pixel lights and adds each one's irradiance to the pixels where it is significant (Eq. 2, Sec. 3). The
paper draws a bound of each light and lights the pixels it covers. Here the bound lists lights for tiles of pixels, and
the pairs of light and pixel with B < I_low are left out one by one, so that the picture is that of the threshold alone,
the same to the bit for every bound. `cut_irradiance` sums what the cut removes.

Symbols: B = I(w) / r^2 (W/m^2), the irradiance a light causes at most, I_low the threshold (W/m^2).
"""

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np

from refgi.lights.selection import choose_lights, footprints, occluded
from refgi.lights.settings import with_clamp
from refgi.pairs.estimates import report_sampling, thinned, warn_of_clamp
from refgi.pairs.irradiance import (
    Receivers,
    as_receivers,
    checked,
    glossy_radiance,
    glossy_summed,
    irradiance,
    over_receivers,
)
from refgi.pairs.lightcuts.cuts import for_lights
from refgi.pairs.lobe_sum import add_lobes
from refgi.pairs.ranged_sum import LANES, sum_pairs_in_range, sum_weighted_pairs
from refgi.pairs.settings import GeometryClamp
from refgi.pairs.sphere_sum import sum_spheres
from refgi.rsm.buffers.leaving import GlossyPoints, spread_over_picture
from refgi.settings import replaced
from refgi.splat.sii.lists import EVERY, LightLists, Some, listed_pairs
from refgi.splat.sii.options import as_stored, half_resolution
from refgi.splat.sii.settings import FullBound, SiiSettings, TangentBound
from refgi.splat.sii.threshold import warn_of_cut, with_reference_length
from refgi.stages import skip, stage, tally
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.frame import Frame
    from refgi.lights import PixelLights
    from refgi.rsm import Projection


def sii(frame: "Frame", settings: SiiSettings) -> Array:
    """Light every pixel by pixel lights.

    Parameters
    ----------
    frame : Frame
        The scene and its buffers.
    settings : SiiSettings
        Which lights, how each lights a receiver and how far it reaches.

    Returns
    -------
    (3, h, w) ndarray
        Indirect irradiance, W/m^2, linear RGB, without visibility but for ambient occlusion where it is asked for.
    """
    settings = with_clamp(settings)
    lights = choose_lights(frame, settings.lights)  # Sec. 3.1, 3.5 to 3.7
    footprint = footprints(frame, settings.lights, settings.pairs)
    receivers = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))  # Sec. 3.2: deferred shading
    receivers, lights = as_stored(receivers, lights, settings)  # Sec. 4

    cuts = for_lights(settings.lightcuts, lights) if settings.reach.cut is None else None
    settings = dataclasses.replace(settings, lightcuts=cuts)
    resolved = with_reference_length(receivers, lights, settings)

    def evaluate(points: Receivers) -> Array:
        return splat(points, lights, resolved, footprint, frame.gbuffer.projection)  # Eq. (2), Sec. 3.4

    light = half_resolution(receivers, evaluate) if settings.half_resolution else evaluate(receivers)
    some = (lights, footprint) if settings.lightcuts is None else thinned(lights, footprint)
    if settings.compensation == "none":
        warn_of_clamp(receivers, some[0], settings.pairs, some[1], "sii")
    warn_of_cut(light, receivers, lights, resolved, footprint)
    report_sampling(frame, receivers, lights, settings.pairs, footprint, "sii",
                    all_summed=settings.lightcuts is None)
    clamp = settings.pairs.clamp
    if settings.compensation == "screen" and isinstance(clamp, GeometryClamp) and clamp.value is not None:
        from refgi.splat.sii.options import screen_compensation  # hssil's levels, which no other sii needs

        depth, normal, albedo = frame.gbuffer.resolve("depth", "normal", "albedo")
        light = light + screen_compensation(depth, normal, albedo, frame.direct, frame.gbuffer.projection, clamp.value)
    return occluded(frame, light, settings.ambient_occlusion, settings.lights.seed)


def splat(
    receivers: Receivers, lights: "PixelLights", settings: SiiSettings, footprint: Array | None = None,
    projection: "Projection | None" = None,
) -> Array:
    """Sum the irradiance of every pixel light at the receivers where it may be significant (SII Eq. 2, Sec. 3.4).

    Parameters
    ----------
    receivers : Receivers
        Points to light; their dtype is that of the result.
    lights : PixelLights
        Lights to sum.
    settings : SiiSettings
        The parts `reach` and `pairs`.
    footprint : (N,) ndarray, optional
        Surface area each light stands for, m^2; needed by the clamps "disc" and "sphere" alone.
    projection : Projection, optional
        The camera's map; needed by the bounds "quad" and "mesh" alone.

    Returns
    -------
    (3, h, w) ndarray
        Irradiance, W/m^2, linear RGB, as that of `irradiance`, of the pairs with B >= I_low. Without a threshold it
        is that of `irradiance` to the bit, by lightcuts where the settings have them.

    Raises
    ------
    InputError
        As `irradiance`; or if the bound lacks its map.
    """
    if settings.reach.cut is None:
        skip("sii.bins", "no cut: every light reaches every pixel")
        return irradiance(receivers, lights, settings.pairs, footprint, settings.lightcuts)
    return _splat(receivers, lights, settings, footprint, projection)


@stage("sii.splat", steps="refgi.splat.sii.steps.splat_steps")
def _splat(
    receivers: Receivers, lights: "PixelLights", settings: SiiSettings, footprint: Array | None,
    projection: "Projection | None",
) -> Array:
    """Sum the irradiance of the pairs within range (SII Eq. 2, Sec. 3.4).

    receivers: Points (3, h, w), world space, m, and unit normals.
    projection: The map the receivers are seen on.
    -> (3, h, w): Irradiance, W/m^2, linear RGB, without albedo/pi and visibility.
    """
    return sum_in_range(receivers, lights, settings, footprint, projection)


@stage("sii.cut_irradiance")
def cut_irradiance(
    receivers: Receivers, lights: "PixelLights", settings: SiiSettings, footprint: Array | None = None
) -> Array:
    """Sum the irradiance of the pairs that `splat` leaves out.

    settings: As for `splat`; the bound does not matter.
    -> (3, h, w): Irradiance, W/m^2, linear RGB: with that of `splat` it makes the full sum, but for rounding. With a
        random range it is the full sum less the weighted one, and may be below 0.
    """
    if settings.reach.cut is None:
        return np.zeros_like(np.asarray(receivers.position))
    return sum_in_range(receivers, lights, settings, footprint, outside=True)


def sum_in_range(
    receivers: Receivers, lights: "PixelLights", settings: SiiSettings, footprint: Array | None,
    projection: "Projection | None" = None, *, outside: bool = False,
) -> Array:
    """Return the irradiance (3, h, w), W/m^2, of the pairs within range, or of those `outside`."""
    packed = checked(receivers, lights, settings.pairs, footprint)
    settings = with_reference_length(receivers, lights, settings)
    lists = LightLists(packed, settings, outside, receivers.covered.shape[1], projection)
    run = sum_weighted_pairs if outside or settings.reach.stochastic else sum_pairs_in_range

    def add(here: Array, facing: Array, places: Array, sums: Array) -> None:
        if lists.diffuse is not None and packed.spheres is not None:
            tally("pairs", lambda: here.shape[1] * np.count_nonzero(packed.shines))
            sum_spheres(here, facing, packed.diffuse, packed.spheres, lists.diffuse, sums)
        elif lists.diffuse is not None:
            for some, listed in lists.of_diffuse(here, facing, places):
                add_listed(run, here, facing, (packed.diffuse, packed.clamp, lists.diffuse), some, listed, sums)
        if packed.lobes is not None:
            for some, listed in lists.of_lobes(here, facing, places):
                add_listed(add_lobes, here, facing, (*packed.lobes, lists.lobes), some, listed, sums)

    def add_listed(
        kernel: Any, here: Array, facing: Array, read: tuple[Any, ...], some: Some, listed: Array, sums: Array
    ) -> None:
        points, normals = (np.ascontiguousarray(part[:, some]) for part in (here, facing))
        found = sums if some is EVERY else np.zeros_like(points)
        tally("pairs", lambda: listed_pairs(listed, LANES, found.shape[1]))
        kernel(points, normals, *read, listed, found)
        if found is not sums:
            sums[:, some] += found

    return over_receivers(receivers, packed, add)


def sii_lobes(frame: "Frame", settings: SiiSettings) -> Array:
    """Return the radiance towards the eye that receivers' lobes make of the pixel lights of `sii`.

    (3, h, w), W/m^2/sr, linear RGB, without visibility; 0 where there is no lobe. Every glossy pixel sums all lights,
    one by one, whatever `half_resolution` and `lightcuts` say of irradiance. A cut leaves out the same pairs as from
    the irradiance: its threshold is of the irradiance that a light causes at most, and knows nothing of the receiver's
    lobe. Lights are as `quantisation` stores them; glossy pixels, which the paper has none of, keep their floats.
    """
    settings = with_clamp(settings)
    receivers, lights = as_stored(Receivers(*frame.gbuffer.resolve("position", "normal", "covered")),
                                  choose_lights(frame, settings.lights), settings)
    footprint = footprints(frame, settings.lights, settings.pairs)
    points = frame.glossy_points
    if settings.reach.cut is None:
        radiance = glossy_radiance(points, lights, settings.pairs, footprint, frame.width)
    else:
        resolved = with_reference_length(receivers, lights, settings)
        radiance = glossy_in_range(points, lights, resolved, footprint, frame.width)
    return spread_over_picture(points, radiance, (frame.height, frame.width))


@stage("sii.glossy_sum")
def glossy_in_range(
    points: GlossyPoints, lights: "PixelLights", settings: SiiSettings, footprint: Array | None = None, width: int = 0,
) -> Array:
    """Sum the radiance that lobes make of the pairs with B >= I_low (SII Sec. 3.4).

    settings: The parts `reach`, with its reference length, and `pairs`; the bound does not matter.
    width: As for `glossy_radiance`.
    -> (3, n): W/m^2/sr, linear RGB.
    """
    packed = checked(as_receivers(points), lights, settings.pairs, footprint)
    if settings.reach.on_screen:  # receivers come as a list, not as a picture
        settings = replaced(settings, {"reach.bound": TangentBound()})
    lists = LightLists(packed, settings, False, 1, None)
    ranges = lists.diffuse, lists.lobes
    if isinstance(settings.reach.bound, FullBound):
        return glossy_summed(points, packed, ranges, width)

    def listed(position: Array, normal: Array) -> tuple[Array | None, Array | None]:
        diffuse = lobes = None
        places = np.arange(position.shape[1])
        if lists.diffuse is not None and packed.spheres is None:  # spheres reach over their horizon
            ((_, diffuse),) = lists.of_diffuse(position, normal, places)
        if lists.lobes is not None:
            ((_, lobes),) = lists.of_lobes(position, normal, places)
        return diffuse, lobes

    return glossy_summed(points, packed, ranges, width, listed)

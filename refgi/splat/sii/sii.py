"""Splatting Indirect Illumination (Dachsbacher and Stamminger 2006): the method and its sum.

`sii` chooses pixel lights and adds each one's irradiance to the pixels where it is significant (Eq. 2, Sec. 3). The
paper draws a bound of each light and lights the pixels it covers. Here the bound lists lights for tiles of pixels, and
the pairs of light and pixel with B < I_low are left out one by one, so that the picture is that of the threshold alone,
the same to the bit for every bound. `cut_irradiance` sums what the cut removes.

Symbols: B = I(w) / r^2 (W/m^2), the irradiance a light causes at most, I_low the threshold (W/m^2).
"""

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from refgi.lights.ambient_occlusion import occluded
from refgi.lights.selection import choose_lights, footprints
from refgi.lights.settings import with_clamp
from refgi.pairs.estimates import report_sampling, thinned, warn_of_clamp
from refgi.pairs.irradiance import Receivers, checked, irradiance, over_receivers
from refgi.pairs.lightcuts.choice import for_lights
from refgi.pairs.lobe_sum import add_lobes
from refgi.pairs.ranged_sum import LANES, sum_pairs_in_range, sum_weighted_pairs
from refgi.pairs.settings import GeometryClamp
from refgi.pairs.sphere_sum import sum_spheres
from refgi.splat.sii.half_resolution import half_resolution
from refgi.splat.sii.reach.lists import EVERY, LightLists, Some, listed_pairs
from refgi.splat.sii.reach.threshold import warn_of_cut, with_reference_length
from refgi.splat.sii.settings import SiiSettings
from refgi.splat.sii.storage import as_stored
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
        from refgi.splat.sii.compensation import screen_compensation  # hssil's levels, which no other sii needs

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


def _splat_steps(
    receivers: Receivers, lights: "PixelLights", settings: SiiSettings, footprint: Array | None,
    projection: "Projection | None",  # noqa: ARG001 bounds change no bit
) -> Array:
    from refgi.splat.sii.reach.steps import splat_steps

    return splat_steps(receivers, lights, settings, footprint)


@stage("sii.splat", steps=_splat_steps)
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
    weighted = outside or settings.reach.stochastic

    def add(here: Array, facing: Array, places: Array, sums: Array) -> None:
        if lists.diffuse is not None and packed.spheres is not None:
            tally("pairs", lambda: here.shape[1] * np.count_nonzero(packed.shines))
            sum_spheres(here, facing, packed.diffuse, packed.spheres, lists.diffuse, sums)
        elif lists.diffuse is not None:
            run = sum_weighted_pairs if weighted else sum_pairs_in_range
            for some, listed in lists.of_diffuse(here, facing, places):
                if some is EVERY:  # all at once, into what holds nothing yet
                    _tally(listed, LANES, sums)
                    run(here, facing, packed.diffuse, packed.clamp, lists.diffuse, listed, sums)
                    continue
                points, normals, found = _chosen(some, here, facing)
                _tally(listed, LANES, found)
                run(points, normals, packed.diffuse, packed.clamp, lists.diffuse, listed, found)
                sums[:, some] += found
        if packed.lobes is not None:
            for some, listed in lists.of_lobes(here, facing, places):
                points, normals, found = _chosen(some, here, facing)
                _tally(listed, LANES, found)
                add_lobes(points, normals, *packed.lobes, lists.lobes, listed, found)
                sums[:, some] += found

    return over_receivers(receivers, packed, add)


def _tally(listed: Array, lanes: int, found: Array) -> None:
    tally("pairs", lambda: listed_pairs(listed, lanes, found.shape[1]))


def _chosen(some: Some, here: Array, facing: Array) -> tuple[Array, Array, Array]:
    """Return positions, normals and zeros (3, m) for some of the receivers."""
    points, normals = (np.ascontiguousarray(part[:, some]) for part in (here, facing))
    return points, normals, np.zeros_like(points)

"""From pixel lights to irradiance at every pixel: checks, packing and the choice of kernels around Eq. 2.

What the lights do not need does not run: pixels without surface are left out, a light without diffuse flux is no
diffuse light, and without a glossy light no lobe code is compiled. The picture is the same to the bit either way.
"""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.splat.lobe_sum import add_lobes
from refgi.splat.packing import pack_clamp, pack_diffuse, pack_lobes, pack_spheres, pack_widening
from refgi.splat.pair_sum import sum_pairs
from refgi.splat.settings import FOOTPRINT_CLAMPS, PairSettings
from refgi.splat.sphere_sum import sum_spheres
from refgi.stages import report_progress, skip, stage

if TYPE_CHECKING:
    from refgi.rsm import PixelLights

Array = npt.NDArray[Any]

PAIRS_AT_ONCE = 1 << 31  # between two reports of progress
BLOCK = 16  # BLOCK^2 pixels fill one tile of the kernels


class Receivers(NamedTuple):
    """The points that are lit."""

    position: Array  # (3, h, w) world space, m
    normal: Array  # (3, h, w) unit vectors
    covered: Array  # (h, w) bool, whether there is a surface


@stage("splat.irradiance")
def irradiance(
    receivers: Receivers, lights: "PixelLights", settings: PairSettings, footprint: Array | None = None
) -> Array:
    """Sum the irradiance of every pixel light at every receiver (SII Eq. 2).

    Parameters
    ----------
    receivers : Receivers
        Points that are lit; their dtype is that of the result.
    lights : PixelLights
        Lights to sum.
    settings : PairSettings
        How one light lights one receiver.
    footprint : (N,) ndarray, optional
        Surface area each light stands for, m^2; needed by the clamps "disc" and "sphere" alone.

    Returns
    -------
    (3, h, w) ndarray
        Irradiance, W/m^2, linear RGB; 0 where there is no surface. Contains both cosines and the light's 1/pi;
        excludes the receiver's albedo/pi and visibility.

    Raises
    ------
    InputError
        If shapes do not fit, a light is not finite, the clamp lacks its footprints, or a light is glossy and the clamp
        is "sphere".

    Notes
    -----
    E = sum (Phi / pi) <n_l . w> <n_x . -w> / r^2 (Eq. 1 prints no 1/pi: `sii_no_pi`), plus the lobes of Eq. 3. A
    light that coincides with a receiver adds 0. Results do not depend on the number of threads, on how receivers
    are split into calls or on where a pixel stands in the picture, to the bit.
    """
    position, normal, covered = (np.asarray(part) for part in receivers)
    normal, covered = normal.astype(position.dtype, copy=False), covered.astype(np.bool_, copy=False)
    _check(position, normal, covered, lights, settings, footprint)
    places = _block_by_block(covered)
    points, normals = (np.take(part.reshape(3, -1), places, axis=1) for part in (position, normal))
    total = np.zeros_like(points)
    _sum(points, normals, lights, settings, footprint, total)
    result = np.zeros_like(position)
    result.reshape(3, -1)[:, places] = total
    return result


def _block_by_block(covered: Array) -> Array:
    """Return the flat indices of covered pixels, 16 x 16 of them after another: a kernel's tile is one block.

    Blocks are compact, so that more lights lie behind all their receivers than behind those of a piece of a row.
    """
    index = np.arange(covered.size).reshape(covered.shape)
    index[~covered] = -1
    height, width = (-(-size // BLOCK) * BLOCK for size in covered.shape)
    padded = np.full((height, width), -1)
    padded[: covered.shape[0], : covered.shape[1]] = index
    blocks = padded.reshape(height // BLOCK, BLOCK, width // BLOCK, BLOCK).transpose(0, 2, 1, 3).reshape(-1)
    return blocks[blocks >= 0]


def _check(
    position: Array, normal: Array, covered: Array, lights: "PixelLights", settings: PairSettings,
    footprint: Array | None,
) -> None:
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
    if settings.clamp in FOOTPRINT_CLAMPS:
        expect(footprint is not None and footprint.shape == (count,), "footprint",
               f"the area of each of {count} lights for the clamp {settings.clamp!r}", None if footprint is None else
               footprint.shape)
    if settings.clamp == "sphere":
        expect(lights.lobe_flux is None or not lights.lobe_flux.any(), "clamp",
               "another one for glossy materials ('sphere' knows diffuse lights alone)", settings.clamp)


def _sum(
    points: Array, normals: Array, lights: "PixelLights", settings: PairSettings, footprint: Array | None, total: Array
) -> None:
    """Run the kernels that the lights need, some receivers at a time."""
    dtype = points.dtype
    shines: Array = (lights.flux != 0).any(axis=0)
    diffuse = pack_diffuse(lights, settings, dtype, shines)
    clamp = None if settings.clamp == "none" else pack_clamp(settings, footprint, shines, diffuse.shape[1], dtype)
    spheres = None
    if settings.clamp == "sphere" and footprint is not None:
        spheres = pack_spheres(settings, footprint, shines, dtype)
    glossy = np.zeros_like(shines) if lights.lobe_flux is None else (lights.lobe_flux != 0).any(axis=0)
    if glossy.any():
        lobes = pack_lobes(lights, settings, dtype, glossy)
        lobe_clamp = pack_clamp(settings, footprint, glossy, lobes.shape[1], dtype)
        widening = pack_widening(lights, settings, dtype, glossy)
    else:
        skip("splat.lobes", "no pixel light is glossy")
    step = max(1 << 14, PAIRS_AT_ONCE // max(1, len(shines)))
    for first in range(0, points.shape[1], step):
        part = np.s_[:, first : first + step]
        here, facing, sums = (np.ascontiguousarray(array[part]) for array in (points, normals, total))
        if diffuse.shape[1] > 1 and spheres is not None:
            sum_spheres(here, facing, diffuse, spheres, sums)
        elif diffuse.shape[1] > 1:
            sum_pairs(here, facing, diffuse, clamp, sums)
        if glossy.any():
            add_lobes(here, facing, lobes, lobe_clamp, widening, sums)
        total[part] = sums
        report_progress(min(1.0, (first + step) / points.shape[1]))

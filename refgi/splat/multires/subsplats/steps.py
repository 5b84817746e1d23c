"""Light at subsplats and its upsampling one step after the other: points, Eq. 2, levels of the picture.

- level, row, column (subsplat) int: The list of subsplats.
"""

from typing import TYPE_CHECKING, Any

from refgi.error_target.grid import Subsplats
from refgi.pairs.pixel_lights import PixelLights
from refgi.pairs.settings import PairSettings
from refgi.splat.multires.refinement.steps import subsplats_of
from refgi.splat.multires.settings import Representative, Upsampling
from refgi.splat.multires.subsplats.evaluate import points_of, sum_at
from refgi.splat.multires.subsplats.upsample import (
    black_level,
    demo_level,
    filled_cells,
    interpolated_apart,
    of_own_subsplat,
    sorted_by_row,
    tent_level,
)
from refgi.stages import stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.rsm import GBuffer


@stage("multires.points", kept=False)
def points(
    position: Array, normal: Array, covered: Array, level: Array, row: Array, column: Array, pixel: Array,
    representative: Representative,
) -> tuple[Array, Array]:
    """Find the point and normal that each subsplat is evaluated at (AMS Sec. 3.4; E-AMS-11).

    pixel (subsplat) int: Each one's representative.
    representative: Its representative pixel's, or the mean surface's.
    -> point (xyz, subsplat): Surface point, m.
    -> normal (xyz, subsplat): Its unit normal.
    """
    cells = Subsplats(level, row, column, pixel, (), covered.shape)
    return points_of(position, normal, covered, cells, representative)


def point_steps(
    buffer: "GBuffer", subsplats: Subsplats, representative: Representative = "pixel"
) -> tuple[Array, Array]:
    """Return points and normals of subsplats, made by a step."""
    return points(buffer.position, buffer.normal, buffer.covered, *subsplats[:4], representative)


@stage("multires.subsplat_irradiance", kept=False)
def subsplat_irradiance(
    point: Array, point_normal: Array, light_position: Array, light_normal: Array, flux: Array,
    lobe_flux: Array | None, lobe_axis: Array | None, lobe_exponent: Array | None, area: Array | None,
    pairs: PairSettings,
) -> Array:
    """Sum the irradiance of every pixel light at every subsplat, without albedo/pi (AMS Eq. 2; E-AMS-02).

    point (3, n): Surface points, m.
    point_normal (3, n): Unit normals.
    area (light,): Surface that each stands for, m^2, where the clamp reads it.
    -> (rgb, subsplat): Indirect irradiance, W/m^2.
    """
    lights = PixelLights(light_position, light_normal, flux, lobe_flux, lobe_axis, lobe_exponent, flux.shape[1])
    return sum_at(point, point_normal, lights, pairs, area)


def evaluate_steps(
    points: Array, normals: Array, lights: PixelLights, settings: PairSettings, footprint: Array | None = None,
    lightcuts: Any = None,
) -> Array:
    """Return the light at subsplats, made by a step that sums all lights."""
    del lightcuts  # change the sum by less than their error
    return subsplat_irradiance(points, normals, *arrays_of(lights), area_read(footprint, settings), settings)


def arrays_of(lights: PixelLights) -> tuple[Array, Array, Array, Array | None, Array | None, Array | None]:
    """Return what sums read of pixel lights."""
    return (lights.position, lights.normal, lights.flux, lights.lobe_flux, lights.lobe_axis, lights.lobe_exponent)


def area_read(footprint: Array | None, pairs: PairSettings) -> Array | None:
    """Return the surfaces that lights stand for where the clamp reads them."""
    return footprint if pairs.needs_footprints else None


@stage("multires.upsample_level", kept=False, each="level")
def upsample_level(
    covered: Array, level: Array, row: Array, column: Array, irradiance: Array, at: int, mode: Upsampling,
    filter_all: bool, corner_rule: bool, coarse: Array | None = None, coarse_known: Array | None = None,
) -> tuple[Array, Array]:
    """Make the light of a level from that of the level above and subsplats (AMS Sec. 3.5; E-AMS-09).

    irradiance (rgb, subsplat): Light at the subsplats, W/m^2.
    at: The level.
    mode: Weights (1, 2, 1) x (1, 2, 1) of the level itself ("tent"), or (1 - f, 1, f) / 2 on the coarser level
        ("demo").
    filter_all, corner_rule: Whether leaves are filtered too; whether a cell across a corner counts only beside one that
        counts.
    coarse (3, h', w'): Light of the level above, W/m^2; none above the coarsest.
    coarse_known (h', w') bool: Its cells with light.
    -> light (rgb, h_l, w_l): Indirect irradiance, W/m^2; 0 where the mask is false.
    -> known (h_l, w_l) bool: Cells with light: evaluated here or coarser, with surface.
    """
    top = max(int(level.max(initial=0)), at + (coarse is not None))
    listed, filled = subsplats_of(covered, level, row, column, top), filled_cells(covered, at)[at]
    above = black_level(filled, irradiance.dtype) if coarse is None or coarse_known is None else (coarse, coarse_known)
    if mode == "demo":
        return demo_level(irradiance, listed, at, above, filled, filter_all)
    return tent_level(irradiance, column, sorted_by_row(listed), at, above, filled, filter_all, corner_rule)


@stage("multires.upsample_at_once", kept=False)
def upsample_at_once(
    covered: Array, level: Array, row: Array, column: Array, irradiance: Array, top: int, mode: Upsampling
) -> Array:
    """Fill pixels from subsplats without levels (AMS Sec. 3.5, Fig. 7).

    irradiance (rgb, subsplat): Light at the subsplats, W/m^2.
    mode: Each pixel has the light of its subsplat ("nearest"), or the sum of all levels, each interpolated as if it
        were black where it holds nothing ("naive_bilinear").
    -> (rgb, h, w): Indirect irradiance, W/m^2; 0 without surface.
    """
    if mode == "nearest":
        return of_own_subsplat(irradiance, level, row, column, covered)
    return interpolated_apart(irradiance, subsplats_of(covered, level, row, column, top), covered)


def upsample_steps(
    values: Array, subsplats: Subsplats, covered: Array, mode: Upsampling = "tent", *, filter_all: bool = False,
    corner_rule: bool = True,
) -> Array:
    """Return the picture of subsplats, made level by level where the mode has levels."""
    listed = (covered, *subsplats[:3], values)
    if mode not in ("tent", "demo"):
        return upsample_at_once(*listed, subsplats.top, mode)
    above: tuple[Array, ...] = ()
    for level in range(subsplats.top, -1, -1):
        above = upsample_level(*listed, level, mode, filter_all, corner_rule, *above)
    return above[0]

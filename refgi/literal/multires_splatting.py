"""Adaptive multiresolution splatting as a whole: subsplats, their light, pixels (AMS: Nichols and Wyman 2009, Fig. 3).

`top` is the coarsest level, `finest` that which is never refined. A test against a threshold that is None is not made.
"""

from typing import Any

from refgi.literal import multires_upsample
from refgi.literal.multires import (
    curvatures,
    depth_ranges,
    discontinuities,
    normal_ranges,
    representatives,
    slopes,
    states,
    subsplats,
)
from refgi.literal.multires_lights import detail, lists, points, samples, splits, subsplat_irradiance


def multires(
    position: Any, normal: Any, depth: Any, triangle_id: Any, camera: Any, light_position: Any, light_normal: Any,
    flux: Any, lobe_flux: Any = None, lobe_axis: Any = None, lobe_exponent: Any = None, area: Any = None, *, top: int,
    finest: int, mean: bool, mode: str, filter_all: bool, corner_rule: bool, a: float, **tests: Any,
) -> Any:
    """Return E (3, h, w), W/m^2, by one list of subsplats for all lights; `tests` are those of `geometry_list`."""
    # Sec. 3.2 and 3.3: which cells of the picture are subsplats
    level, row, column, pixel = geometry_list(position, normal, depth, triangle_id, top=top, finest=finest, **tests)
    # Sec. 3.4: their light
    place, up = points(position, normal, triangle_id, level, row, column, pixel, mean)
    light = subsplat_irradiance(place, up, light_position, light_normal, flux, lobe_flux, lobe_axis, lobe_exponent,
                                area)
    # Sec. 3.5: from subsplats to pixels
    picture = multires_upsample.upsample(triangle_id, level, row, column, light, top, mode, filter_all, corner_rule)
    return detail(picture, position, normal, triangle_id, camera, a)


def multires_of_lights(
    position: Any, normal: Any, triangle_id: Any, camera: Any, light_position: Any, light_normal: Any, flux: Any,
    lobe_flux: Any = None, lobe_axis: Any = None, lobe_exponent: Any = None, area: Any = None, *, top: int,
    finest: int, threshold: float, form: str, mode: str, filter_all: bool, corner_rule: bool, a: float,
) -> Any:
    """Return E (3, h, w), W/m^2, by a list for each light, refined by its own irradiance (Sec. 3.3.1)."""
    pixels = representatives(triangle_id, top)
    sampled = samples(position, normal, pixels, light_position, light_normal, flux, lobe_flux, lobe_axis,
                      lobe_exponent, area)
    split = splits(pixels, sampled, finest, threshold, form)
    listed: tuple[Any, Any, Any, Any, Any] = lists(pixels, sampled, split)
    picture = multires_upsample.sum_of_pictures(triangle_id, *listed, top, mode, filter_all, corner_rule)
    return detail(picture, position, normal, triangle_id, camera, a)


def geometry_list(
    position: Any, normal: Any, depth: Any, triangle_id: Any, *, top: int, finest: int, rim: int, diagonal: str,
    depth_threshold: float | None = None, depth_measure: str = "", slope_threshold: float | None = None,
    slope_measure: str = "", normal_threshold: float | None = None, components: int = 3,
    curvature_threshold: float | None = None, rate: bool = False,
) -> tuple[Any, ...]:
    """Return level, row, column and representative pixel (n,) of the subsplats that geometry asks for (Sec. 3.2)."""
    tests: dict[str, Any] = {}
    if depth_threshold is not None:
        both = depth_ranges(depth, triangle_id, top, rim)
        tests |= {"depth_least": both[:top], "depth_largest": both[top:], "depth_threshold": depth_threshold,
                  "depth_measure": depth_measure}
    if slope_threshold is not None:
        tests |= {"slope": slopes(depth, triangle_id, top, slope_measure != "absolute"),
                  "slope_threshold": slope_threshold, "slope_measure": slope_measure}
    if normal_threshold is not None:
        both = normal_ranges(normal, triangle_id, top, rim, components)
        tests |= {"normal_least": both[:top], "normal_largest": both[top:], "normal_threshold": normal_threshold}
    if curvature_threshold is not None:
        tests |= {"curvature": curvatures(normal, position, triangle_id, top, rate),
                  "curvature_threshold": curvature_threshold}
    marked = discontinuities(top, finest, **tests)
    return subsplats(triangle_id, states(marked, triangle_id, diagonal), finest)

"""Clustered visibility as a whole: area lights, their maps, soft shadows, the light of pixels (VAL Sec. 4 to 6).

Receivers are (3, h, w) with triangle_id (h, w), -1 without surface, and `facing`, the normals of their triangles;
lights (3, N), of which `of` (N,) says the area light; K area lights. Shadows are V (K, h, w) and z_avg, m, 0 where
nothing blocks; they are found area light by area light, as arrays over pixels and texels are large.
"""

from typing import Any, NamedTuple

import numpy as np

from refgi.literal import val_areas, val_filters, val_maps, val_series
from refgi.literal.val_back_projection import back_projection
from refgi.literal.val_visibility import depth_tests, pcss, pcss_penumbra, search, to_map


class AreaLights(NamedTuple):
    """What `val_areas` makes of clusters: (3, K) `center` and `normal`, the rest as `val_areas.areas` returns it."""

    center: Any
    normal: Any
    of: Any
    frame: Any
    axes: Any
    side: Any
    offset: Any
    delta: Any
    radius: Any
    members: Any


class Maps(NamedTuple):
    """Distances (K, n, n) around centres (K, 3) along the rows of frames (K, 3, 3), and the farthest place (K,), m."""

    depth: Any
    center: Any
    frame: Any
    scene_far: Any


def val(
    position: Any, normal: Any, triangle_id: Any, vertices: Any, faces: Any, facing: Any, illuminated: Any,
    light_position: Any, light_normal: Any, flux: Any, lobe_flux: Any = None, lobe_axis: Any = None,
    lobe_exponent: Any = None, area: Any = None, *, clusters: Any, rectangles: Any, texels: int, near_distance: float,
    touching: bool, shadow: str, soft: Any, side: int = 1, assignment: str = "index", window: Any = None,
) -> Any:
    """Return E (3, h, w), W/m^2, of the pixel lights under the visibility of their area lights (VAL Sec. 4).

    `clusters`, `rectangles`, `soft`: named arguments of `area_lights` and of the kind of shadow; `window`: extent,
    least cosine and `every_subset` of the blur of n x n pixels, n = `side`; `illuminated`: a box (2, 3).
    """
    visible = val_areas.box(position[:, triangle_id >= 0])
    # Sec. 5: clusters of pixel lights, and the rectangle around each
    areas = area_lights(light_position, light_normal, illuminated, **clusters, **rectangles)
    # Sec. 4.2: what each sees
    maps = shadow_maps(areas, vertices, faces, triangle_id, light_position, visible, illuminated, texels, near_distance,
                       touching)
    # Sec. 4.1: how much of each a pixel sees
    seen = shadows(shadow, position, triangle_id, facing, areas, maps, **soft)[0]
    # Sec. 6: interleaved sampling
    subset = val_areas.interleaving(areas.of, side, assignment)
    light = val_areas.parts(position, normal, triangle_id, light_position, light_normal, flux, areas.of, areas.center,
                            subset, side, lobe_flux, lobe_axis, lobe_exponent, area)
    picture = val_areas.shadowed(light, seen)
    return picture if window is None else val_filters.blur(picture, position, normal, triangle_id, visible, side,
                                                           *window)


def area_lights(
    position: Any, normal: Any, illuminated: Any, *, count: int, distance: str, w_x: float, w_a: float, rounds: int,
    axes: str, extent: str, unbiased: bool,
) -> AreaLights:
    """Return `count` area lights, or where there are no more pixel lights one for each (Sec. 5)."""
    if count >= position.shape[1]:
        center, axis, of = val_areas.kmeans_each(position, normal)
    else:
        seeds, axes_of_seeds = val_areas.kmeans_start(position, normal, count)
        center, axis, of = val_areas.kmeans_rounds(position, normal, illuminated, seeds, axes_of_seeds, distance, w_x,
                                                   w_a, rounds)
    return AreaLights(center, axis, of, *val_areas.areas(position, center, axis, of, axes, extent, unbiased))


def shadow_maps(
    areas: AreaLights, vertices: Any, faces: Any, triangle_id: Any, light_position: Any, visible: Any, illuminated: Any,
    texels: int, near_distance: float, touching: bool,
) -> Maps:
    """Return the maps of area lights, without what is nearer than a share of the cluster's radius (Sec. 4.2)."""
    center, ball, farthest = val_maps.map_views(visible, illuminated, areas.center, areas.normal, areas.radius,
                                                near_distance)
    seen = val_maps.seen_vertices(vertices, faces, triangle_id)
    blocks = val_maps.occluders(vertices, faces, seen, light_position, visible, illuminated, touching)
    depth = val_maps.depth_maps(vertices, faces, blocks, center, areas.frame, ball, areas.members, texels)
    return Maps(depth, center, areas.frame, farthest)


def shadows(kind: str, position: Any, triangle_id: Any, facing: Any, areas: Any, maps: Maps, **soft: Any) -> Any:
    """Return V and z_avg: "csm", "pcss", "pcf", "hard", "back_projection"; of a point light a hard shadow."""
    found = []
    for k in range(len(maps.depth)):
        depth, center, frame, far = (one[k : k + 1] for one in maps)
        pixels, delta = (position, triangle_id, facing), areas.delta[k : k + 1]
        if kind == "back_projection":
            side, offset, middle, axis = (
                one[:, k : k + 1] for one in (areas.side, areas.offset, areas.center, areas.normal))
            v = back_projection(*pixels, depth, center, frame, areas.axes[k : k + 1], side, offset, middle, axis, far,
                                soft.get("shading"))
            found.append((v, 0 * v))
        elif kind in ("pcf", "hard") or delta == 0:
            near, _ = val_maps.map_ranges(depth)
            v = depth_tests(*pixels, depth, center, frame, delta, near, soft["texels"] if kind == "pcf" else 1)
            found.append((v, 0 * v))
        else:
            by = fourier_shadow if kind == "csm" else percentage_closer_shadow
            found.append(by(*pixels, delta, Maps(depth, center, frame, far), **soft))
    return tuple(np.concatenate(one) for one in zip(*found, strict=True))


def percentage_closer_shadow(
    position: Any, triangle_id: Any, facing: Any, delta: Any, maps: Maps, *, cone: bool, axial: bool,
    bias: float | None = None, bias_scale: str = "", solid_angle: bool = False, alpha: bool = False,
    squares: bool = False, foreshortened: bool = False,
) -> tuple[Any, Any]:
    """Return V and z_avg, m, by PCSS (Sec. 4.1): blockers, the penumbra's region, the share of it that is free.

    `bias`: a share of the range of depths instead of the pixel's plane.
    """
    around, sized = (maps.center, maps.frame), {"squares": squares, "foreshortened": foreshortened}
    near, far = val_maps.map_ranges(maps.depth)
    pending, region, _ = search(position, triangle_id, *around, delta, near, solid_angle, **sized, axial=axial)
    biased = None
    if bias is not None:
        d, end = to_map(position, *around)[1], val_series.series(4, fixed=bias)[2]
        slope = val_maps.depth_scale(near, far, maps.scene_far, end, bias_scale)[1][:, None, None]
        along = bias / np.where(slope > 0, slope, 1)
        biased = d * 2**-along if bias_scale == "log_map" else d - along
    shaded, z_avg, region = pcss_penumbra(position, facing, maps.depth, *around, delta, near, pending, region, alpha,
                                          **sized, axial=axial, cone=cone, biased=biased)
    return pcss(position, facing, maps.depth, *around, shaded, region, biased=biased), z_avg


def fourier_shadow(
    position: Any, triangle_id: Any, facing: Any, delta: Any, maps: Maps, *, terms: int, attenuation: float,  # noqa: ARG001
    rescale: str, bias: float | None, depth_scale: str, mip: bool, in_bytes: bool, solid_angle: bool = False,
    alpha: bool = False, squares: bool = False, foreshortened: bool = False,
) -> tuple[Any, Any]:
    """Return V and z_avg, m, by convolution shadow maps of a Fourier series (Sec. 4.1): means replace comparisons."""
    around, sized = (maps.center, maps.frame), {"squares": squares, "foreshortened": foreshortened}
    near, far = val_maps.map_ranges(maps.depth)
    pending, region, _ = search(position, triangle_id, *around, delta, near, solid_angle, **sized)
    weight, biases, end = val_series.series(terms, attenuation, rescale, bias)
    origin, slope = val_maps.depth_scale(near, far, maps.scene_far, end, depth_scale)
    logs = depth_scale == "log_map"
    basis = val_maps.basis(val_maps.map_depths(maps.depth, origin, slope, end, logs, mip), terms, in_bytes)
    levels = [basis, *val_filters.mip_levels(basis, in_bytes)]
    mean = val_filters.mip_means if mip else val_filters.box_means if squares else val_filters.disc_means
    texels = levels if mip else basis
    shaded, z_avg, region, t = val_series.csm_penumbra(
        position, *around, delta, near, origin, slope, end, weight, biases, pending,
        mean(pending, region, terms, True, texels), logs, alpha, **sized)
    final = mean(shaded, region, terms, False, texels)
    return val_series.csm(shaded, t, final, weight, biases, 2.0 if rescale == "scale2" else 1.0), z_avg

"""All pixel lights under the visibility of their area lights (Sec. 4): E(x) = sum_i E_i(x) V_C(i)(x).

Area light by area light, so that what is read of one shadow map stays near the processor: the light of its members,
then V where there is any.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.cluster.area_lights import AreaLights
from refgi.cluster.lighting.area_sum import add_share, bound_tiles, sum_members
from refgi.cluster.lighting.interleave import Subsets, subsets
from refgi.cluster.lighting.member_lights import MemberLights, add_members, member_lights
from refgi.errors import expect
from refgi.pairs.blocks import put, taken
from refgi.pairs.irradiance import Receivers, checked
from refgi.stages import report_progress, stage

if TYPE_CHECKING:
    from refgi.cluster.maps.shadow_maps import ShadowMaps
    from refgi.cluster.settings import ValSettings
    from refgi.rays import Tracer
    from refgi.rsm import PixelLights

Array = npt.NDArray[Any]
Given = Callable[[int, Array, Array], Array]  # V of an area light at points (3, n) of surfaces that face (3, n)


@stage("cluster.irradiance")
def clustered_irradiance(
    receivers: Receivers, facing: Array, lights: "PixelLights", areas: AreaLights, maps: "ShadowMaps | None",
    settings: "ValSettings", footprint: Array | None = None, given: Given | None = None, interleaving: int = 1,
    tracer: "Tracer | None" = None,
) -> Array:
    """Sum the irradiance of every pixel light under the visibility of its area light.

    Parameters
    ----------
    receivers : Receivers
        Points that are lit; their dtype is that of the result.
    facing : (3, h, w) ndarray
        Normals of the triangles that the points lie on.
    lights : PixelLights
        N lights.
    areas : AreaLights
        The area lights; `of` says which is whose.
    maps : ShadowMaps or None
        Their shadow maps; not read for visibility "none" or where V is given.
    settings : ValSettings
        How one light lights one receiver, and how visibility is found.
    footprint : (N,) ndarray, optional
        Surface area each light stands for, m^2; needed by the clamps "disc" and "sphere" alone.
    given : callable, optional
        V from elsewhere: (m, points (3, n), facing (3, n)) -> (n,).
    interleaving : int
        n: each pixel of n x n sums its own lights, n^2 times; 1: all.
    tracer : Tracer, optional
        Rays against the scene; needed for ``behind == "raytrace"`` alone.

    Returns
    -------
    (3, h, w) ndarray
        Irradiance, W/m^2, linear RGB; 0 where there is no surface. Excludes the receiver's albedo/pi.

    Raises
    ------
    InputError
        As `pairs.irradiance.irradiance`; if `areas` is not of these lights.

    Notes
    -----
    [Dong09] Sec. 4 prints Phi_i where Phi_i / pi is meant. V is found only where the members of an area light give
    light, and is 1 where nothing can occlude it. Area lights are added in their order.
    """
    expect(len(areas.of) == lights.position.shape[1], "areas.of", f"one place for each of {lights.position.shape[1]} "
           "lights", len(areas.of))
    expect(np.shape(facing) == np.shape(receivers.position), "facing", f"shape {np.shape(receivers.position)}",
           np.shape(facing))
    packed = checked(receivers, lights, settings, footprint)
    position = np.asarray(receivers.position)
    parts = subsets(np.asarray(receivers.covered, np.bool_), interleaving)
    members = member_lights(packed, areas.of, len(areas.members), interleaving)
    points, normals, faces = (taken(np.asarray(plane, position.dtype), parts.places)
                              for plane in (position, receivers.normal, facing))
    seen = _visibility(points, faces, areas, maps, settings, given, tracer)
    result = np.zeros(position.shape, position.dtype)
    put(result, parts.places, _sum(points, normals, parts, members, seen) * position.dtype.type(interleaving**2))
    return result


def _sum(
    points: Array, normals: Array, parts: Subsets, members: MemberLights, seen: Callable[[int, Array], Array]
) -> Array:
    """Return E of receivers, (3, n)."""
    total, lost = np.zeros_like(points), np.zeros_like(points)
    packed, tiles = members.packed, np.stack([parts.first, parts.size, parts.subset])
    low, high = np.empty((2, len(parts.first), 6), points.dtype)
    bound_tiles(points, normals, tiles, low, high)
    diffuse_alone = packed.spheres is None and packed.lobes is None
    count = len(members.start)
    for m in range(count):
        part = np.zeros_like(points)
        if diffuse_alone:
            sum_members(points, normals, tiles, low, high, packed.diffuse, packed.clamp, members.start[m], part)
        else:
            add_members(points, normals, parts, members, m, part)
        lit = np.flatnonzero(part.any(axis=0))
        if len(lit):
            add_share(part, lit, seen(m, lit), total, lost)
        report_progress((m + 1) / count)
    return total


def _visibility(
    points: Array, faces: Array, areas: AreaLights, maps: "ShadowMaps | None",
    settings: "ValSettings", given: Given | None, tracer: "Tracer | None",
) -> Callable[[int, Array], Array]:
    """Return what tells V of area light m at some receivers."""
    def seen(m: int, lit: Array) -> Array:
        if given is not None:
            return np.asarray(given(m, points[:, lit], faces[:, lit]), points.dtype)
        if settings.visibility == "none" or maps is None or maps.map_of[m] < 0:
            return np.ones(len(lit), points.dtype)
        from refgi.cluster.visibility.visible import visibility

        return np.asarray(visibility(maps, areas, m, points[:, lit], faces[:, lit], settings, tracer))

    return seen

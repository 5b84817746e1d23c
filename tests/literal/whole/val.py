"""`ValSettings` as arguments of refgi.literal.val, over the n pixels that see a surface.

Of the frame it takes the G-buffer, the shadow maps of lamps and the pixel lights chosen. What the literal text has no
word for: rays in place of maps (tests/naive). A picture of subsplats is within its error of this one, in which every
pixel sums all lights.
"""

import math
from typing import NamedTuple

import numpy as np

from refgi.cluster.settings import BackProjection, GeometryBlur, RaysRectangle, RaysVpls
from refgi.lights.selection import choose_lights, footprints
from refgi.literal import val as literal
from refgi.literal import val_areas, val_maps
from refgi.literal.val_filters import blur
from tests.literal.shadows import shadows_of
from tests.literal.whole.pairs import contributions
from tests.naive import area_rays
from tests.naive.crossings import corners_of


class View(NamedTuple):
    """What a picture is made of."""

    frame: object
    settings: object
    pixels: np.ndarray  # (n, 2) row and column of those that see a surface
    position: np.ndarray  # (n, 3)
    normal: np.ndarray
    facing: np.ndarray
    lights: object
    light: np.ndarray  # (N, n, 3) W/m^2 of each pixel light, not shadowed
    corners: np.ndarray  # (T, 3, 3) of all triangles
    drawn: np.ndarray | None = None  # those of maps, which rays meet where planes are left out


def picture(frame, settings):
    """Return the irradiance, (3, h, w)."""
    view = view_of(frame, settings)
    block = settings.interleaving.block or 1
    areas, shares = grouped(view)
    subset = val_areas.interleaving(areas.of, block, settings.interleaving.assignment)
    (row, column), light = view.pixels.T, np.zeros((3, frame.height, frame.width))
    takes = subset[:, None] == row % block * block + column % block
    light[:, row, column] = block**2 * (view.light * (takes * shares[areas.of])[..., None]).sum(axis=0).T
    if block == 1 or settings.blur is None:
        return light
    by_geometry = isinstance(settings.blur, GeometryBlur)
    extent, cosine = (settings.blur.extent, settings.blur.cosine) if by_geometry else (math.inf, -math.inf)
    buffer = frame.gbuffer
    return blur(light, buffer.position, buffer.normal, buffer.triangle_id, val_areas.box(view.position.T), block,
                extent, cosine, by_geometry and settings.blur.every_subset)


def view_of(frame, settings, areas=None):
    """Return what the picture is made of; by the areas (N,) of lights, m^2, where they are not their footprints."""
    buffer, lights, geometry = frame.gbuffer, choose_lights(frame, settings.lights), frame.scene.geometry
    areas = footprints(frame, settings.lights, settings.pairs) if areas is None else areas
    pixels = np.argwhere(buffer.covered)
    facing = val_areas.facing(buffer.normal, buffer.triangle_id, geometry.vertices, geometry.faces)
    position, normal, facing = (plane[:, *pixels.T].T.astype(float) for plane in (buffer.position, buffer.normal,
                                                                                 facing))
    light = contributions(position, normal, lights, settings.pairs, areas)
    return View(frame, settings, pixels, position, normal, facing, lights, light, corners_of(geometry))


def every_light(view):
    """Return the light of all pixel lights at every pixel that sees a surface, (n, 3)."""
    return clustered(view, *grouped(view))


def clustered(view, areas, shares):
    """Return the light of all pixel lights under the visibility of their area lights, (n, 3)."""
    return (view.light * shares[areas.of][..., None]).sum(axis=0)


# area lights


def grouped(view):
    """Return area lights and V (K, n) of each at every pixel."""
    kind, how, lights = view.settings.clusters, view.settings.area, view.lights
    normal = lights.normal.astype(float) / np.linalg.norm(lights.normal.astype(float), axis=0)
    areas = literal.area_lights(
        lights.position.astype(float), normal, illuminated(view.frame), count=kind.count, distance=kind.distance,
        w_x=kind.position_weight, w_a=kind.normal_weight, rounds=kind.rounds, axes=how.axes, extent=how.extent,
        unbiased=how.unbiased_area)
    return areas, visibility(view, areas)


def illuminated(frame):
    """Return the box of what reflects direct light in any map."""
    lobes = [rsm.flux if rsm.lobe_flux is None else rsm.lobe_flux for rsm in frame.rsms]
    return val_areas.illuminated_extent([rsm.position for rsm in frame.rsms], [rsm.flux for rsm in frame.rsms], lobes)


# visibility


def visibility(view, areas):
    """Return V (K, n) of area lights at every pixel."""
    kind, behind = view.settings.visibility, view.settings.maps.behind
    if kind is None:
        return np.ones((len(areas.members), len(view.pixels)))
    parts = [area_rays.Area(areas.center[:, k], areas.frame[k], areas.axes[k], areas.side[:, k], areas.offset[:, k],
                            areas.radius[k], np.flatnonzero(areas.of == k)) for k in range(len(areas.members))]
    if view.settings.maps.near_geometry == "planes":
        view = view._replace(drawn=drawn(view))
    if isinstance(kind, RaysVpls | RaysRectangle):
        rays = area_rays.visible_rectangle if isinstance(kind, RaysRectangle) else (
            lambda view, area: area_rays.visible_members(view, area.members))
        return np.array([rays(view, part) for part in parts])
    shares = by_maps(view, areas, 1.0)
    if behind == "dual_paraboloid":
        return np.minimum(shares, by_maps(view, areas, -1.0))
    if behind == "raytrace":
        rays = area_rays.visible_rectangle if isinstance(kind, BackProjection) else area_rays.from_behind
        return np.array([np.where(area_rays.ahead_of(view, part), share, rays(view, part))
                         for part, share in zip(parts, shares, strict=True)])
    return shares


def drawn(view):
    """Return the corners of the triangles that maps are drawn from, (T, 3, 3)."""
    seen = val_maps.seen_vertices(*indexed(view.corners), view.frame.gbuffer.triangle_id)
    boxes = val_areas.box(view.position.T), illuminated(view.frame)
    return view.corners[val_maps.occluders(*indexed(view.corners), seen, view.lights.position.astype(float), *boxes,
                                           not view.settings.maps.occluders_alone)]


def by_maps(view, areas, sign):
    """Return V by the maps ahead (1), or by those of the hemispheres behind (-1): right and forward turned round."""
    settings, boxes = view.settings.maps, (val_areas.box(view.position.T), illuminated(view.frame))
    center, ball, far = val_maps.map_views(*boxes, areas.center, areas.normal, areas.radius,
                                           area_rays.near_share(view.settings))
    blockers = drawn(view)
    turned = areas._replace(frame=areas.frame * np.array([sign, 1.0, sign])[:, None], normal=sign * areas.normal)
    ignored = ball if settings.near_geometry == "ball" else 0 * ball
    depth = []
    for k in range(len(center)):
        corners = blockers
        if settings.near_geometry == "planes":
            corners = area_rays.without_near_planes(corners, center[k], ball[k])
        one = slice(k, k + 1)
        depth += list(val_maps.depth_maps(*indexed(corners), np.ones(len(corners), bool), center[one],
                                          turned.frame[one], ignored[one], areas.members[one], settings.resolution))
    return shadows_of(view.settings, turned, literal.Maps(np.stack(depth), center, turned.frame, far),
                      view.position.T, view.facing.T, view.normal.T)[0]


def indexed(corners):
    """Return vertices and faces of triangles of corners (T, 3, 3)."""
    return corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)

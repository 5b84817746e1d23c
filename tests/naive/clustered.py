"""The picture of clustered visibility (Dong et al. 2009) for every setting, by loops over area lights and receivers.

Assembled from the twins of its parts: k-means, maps by rays, visibility, the light of each pixel light, interleaved
sampling and the blur. Of the frame it takes the G-buffer, the shadow maps of lamps and the pixel lights chosen.
"""

import math
from typing import NamedTuple

import numpy as np

from refgi.cluster.settings import (
    AdaptiveClusters,
    BackProjection,
    GeometryBlur,
    RaysRectangle,
    RaysVpls,
)
from refgi.lights.selection import choose_lights, footprints
from refgi.literal import val_areas, val_maps
from refgi.literal.val_filters import blur
from tests.literal.shadows import Seen, projected, shadow
from tests.naive.crossings import LIFT, corners_of, face_normals, free
from tests.naive.pair_term import contributions

BACK = 0.75  # of the area lights that were enough: the one step back
FROM_BEHIND = (np.arange(4) + 0.5) / 4  # points along a side of the rectangle that rays from behind end at
NEAR = {"csm": 0.4, "pcss": 0.7, "pcf": 0.6, "hard": 0.6, "back_projection": 0.25, "rays_rectangle": 0.7}
POINTS = 256  # on a rectangle that rays go to


class Area(NamedTuple):
    """The rectangle of a cluster."""

    center: np.ndarray
    frame: np.ndarray  # (3, 3) right, down, forward of its map
    axes: np.ndarray  # (2, 3) along its sides
    side: np.ndarray  # (2,) m
    offset: np.ndarray  # (2,) m, of its middle, along the axes
    delta: float
    radius: float
    members: list


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


def picture(frame, settings):
    """Return the irradiance, (3, h, w)."""
    view = view_of(frame, settings)
    block = settings.interleaving.block or 1
    areas, shares = grouped(view)
    light = np.zeros((3, frame.height, frame.width))
    subset = val_areas.interleaving(area_of(areas, len(view.light)), block, settings.interleaving.assignment)
    for p, (row, column) in enumerate(view.pixels):
        mine = subset == row % block * block + column % block
        light[:, row, column] = block**2 * sum(
            share[p] * view.light[[i for i in area.members if mine[i]], p].sum(axis=0)
            for area, share in zip(areas, shares, strict=True))
    if block == 1 or settings.blur is None:
        return light
    by_geometry = isinstance(settings.blur, GeometryBlur)
    extent, cosine = (settings.blur.extent, settings.blur.cosine) if by_geometry else (math.inf, -math.inf)
    buffer, box = frame.gbuffer, np.array([one(view.position, axis=0) for one in (np.min, np.max)])
    return blur(light, buffer.position, buffer.normal, buffer.triangle_id, box, block, extent, cosine,
                by_geometry and settings.blur.every_subset)


def view_of(frame, settings, areas=None):
    """Return what the picture is made of; by the areas (N,) of lights, m^2, where they are not their footprints."""
    buffer, lights = frame.gbuffer, choose_lights(frame, settings.lights)
    areas = footprints(frame, settings.lights, settings.pairs) if areas is None else areas
    pixels = np.argwhere(buffer.covered)
    at = tuple(pixels.T)
    position, normal = (plane[:, *at].T.astype(float) for plane in (buffer.position, buffer.normal))
    light = contributions(position, normal, lights, settings.pairs, areas)
    facing = face_normals(frame.scene.geometry, buffer.triangle_id[at], normal)
    return View(frame, settings, pixels, position, normal, facing, lights, light, corners_of(frame.scene.geometry))


def every_light(view):
    """Return the light of all pixel lights at every pixel that sees a surface, (n, 3)."""
    return clustered(view, *grouped(view))


def area_of(areas, count):
    """Return C(i) of each light, (N,)."""
    of = np.zeros(count, int)
    for k, area in enumerate(areas):
        of[area.members] = k
    return of


# how many area lights


def grouped(view):
    """Return area lights and V of each at every pixel, as many as are set or as an error asks for."""
    clusters = view.settings.clusters
    if not isinstance(clusters, AdaptiveClusters):
        return trial(view, clusters.count)
    exact = np.einsum("ipc,ip->pc", view.light, member_shares(view))
    samples = sampled(view)

    def error(attempt):
        off = clustered(view, *attempt)[samples] - exact[samples]
        return math.sqrt((off**2).mean()) / exact[samples].mean()

    most, count = len(view.light), 1
    best = latest = trial(view, 1)
    while error(latest) > clusters.target_error and count < most:
        count = min(2 * count, most)
        latest = trial(view, count)
        best = latest if error(latest) <= clusters.target_error or error(latest) < error(best) else best
    back = math.ceil(BACK * count)
    if error(latest) <= clusters.target_error and (count + 1) // 2 < back < count:
        latest = trial(view, back)
        best = latest if error(latest) <= clusters.target_error else best
    return best


def sampled(view):
    """Return the pixels at which the error is estimated: all of a picture of up to 2048."""
    assert len(view.pixels) <= 2048
    return slice(None)


def member_shares(view):
    """Return V of each pixel light by a ray, (N, n)."""
    return np.array([visible_members(view, [i]) for i in range(len(view.light))])


def clustered(view, areas, shares):
    """Return the light of all pixel lights under the visibility of their area lights, (n, 3)."""
    return sum(view.light[area.members].sum(axis=0) * share[:, None]
               for area, share in zip(areas, shares, strict=True))


def trial(view, count):
    """Return area lights and V of each at every pixel."""
    areas = area_lights(view, count)
    return areas, [shares_of(view, area) for area in areas]


# Sec. 5 and 6, area lights


def area_lights(view, count):
    """Group the pixel lights."""
    kind, how = view.settings.clusters, view.settings.area
    position, normal = (getattr(view.lights, key).astype(float) for key in ("position", "normal"))
    normal = normal / np.linalg.norm(normal, axis=0)
    if count >= position.shape[1]:
        center, axis, of = val_areas.kmeans_each(position, normal)
    else:
        center, axis, of = val_areas.kmeans(
            position, normal, val_areas.box(lit_points(view.frame).T), *val_areas.kmeans_start(position, normal, count),
            kind.distance, kind.position_weight, kind.normal_weight, kind.rounds)
    frame, axes, side, offset, delta, radius, members = val_areas.areas(
        position, center, axis, of, how.axes, how.extent, how.unbiased_area)
    if how.single_light == "footprint":
        for k in np.flatnonzero(members == 1):
            side[:, k] = delta[k] = math.sqrt(footprint(view, int(np.flatnonzero(of == k)[0])))
    return [Area(center[:, k], frame[k], axes[k], side[:, k], offset[:, k], delta[k], radius[k],
                 np.flatnonzero(of == k).tolist()) for k in range(len(members))]


def footprint(view, i):
    """Return the surface that a pixel light stands for, m^2: Omega d^2 / cos of its texel, times that of its flux."""
    here, at = view.frame.rsms[int(view.lights.map_index[i])], int(view.lights.texel[i])
    lamp, power = here.light, here.flux.reshape(3, -1)[:, at].sum()
    times = view.lights.flux[:, i].sum() / power if power else (
        view.lights.lobe_flux[:, i].sum() / here.lobe_flux.reshape(3, -1)[:, at].sum())
    d = view.lights.position[:, i].astype(float) - getattr(lamp, "position", 0.0)
    if hasattr(lamp, "position"):
        square, toward = d @ d, d / math.sqrt(d @ d)
    else:
        square, toward = 1.0, np.asarray(lamp.direction) / np.linalg.norm(lamp.direction)
    cosine = abs(toward @ view.lights.normal[:, i].astype(float))
    return here.solid_angle.reshape(-1)[at] * square / cosine * times


def lit_points(frame):
    """Return the places that reflect direct light, at all texels."""
    points = []
    for rsm in frame.rsms:
        lit = rsm.flux.any(axis=0) | (False if rsm.lobe_flux is None else rsm.lobe_flux.any(axis=0))
        points.append(rsm.position[:, lit].T.astype(float))
    return np.concatenate(points)


def diagonal(points):
    """Return the diagonal of the box of points."""
    return float(np.linalg.norm(np.ptp(points, axis=0)))


# visibility


def shares_of(view, area):
    """Return V of an area light at every pixel."""
    kind = view.settings.visibility
    if kind is None or not area.members:
        return np.ones(len(view.pixels))
    if isinstance(kind, RaysVpls):
        return visible_members(view, area.members)
    if isinstance(kind, RaysRectangle):
        return visible_rectangle(view, area)
    ahead = ahead_of(view, area)
    shares = np.where(ahead, by_map(view, area, 1.0), 1.0)
    behind = view.settings.maps.behind
    if behind == "dual_paraboloid":
        return np.minimum(shares, by_map(view, area, -1.0))
    if behind == "raytrace":
        if isinstance(kind, BackProjection):
            return np.where(ahead, shares, visible_rectangle(view, area))
        return np.where(ahead, shares, from_behind(view, area))
    return shares


def ahead_of(view, area):
    """Tell which receivers lie before an area light's plane."""
    return (view.position - area.center) @ area.frame[2] > 0


def visible_members(view, members):
    """Return the share of a cluster's flux that rays reach, of lights that face the receiver and lie above it.

    Those above the horizon of a receiver's normal and below its face are there, and the face hides them.
    """
    starts = view.position + LIFT * view.facing
    reached, whole = np.zeros((2, len(starts)))
    for i in members:
        place, up = view.lights.position[:, i].astype(float), view.lights.normal[:, i].astype(float)
        toward = place - view.position
        flux = sum(float(part[:, i].sum()) for part in (view.lights.flux, view.lights.lobe_flux) if part is not None)
        counts = flux * (((toward * view.normal).sum(axis=1) > 0) & (toward @ up < 0))
        whole += counts
        above = (toward * view.facing).sum(axis=1) > 0
        reached += counts * (above & free(view.corners, starts, place + LIFT * up))
    return np.divide(reached, whole, out=np.ones_like(whole), where=whole > 0)


def visible_rectangle(view, area):
    """Return the share of Hammersley's points on the rectangle that rays reach; behind it 1, or from behind as well."""
    i = np.arange(POINTS)
    second = np.array([van_der_corput(k) for k in i]) + 0.5 / POINTS
    points = on_rectangle(area, np.stack([(i + 0.5) / POINTS, second]))
    ahead, settings = ahead_of(view, area), view.settings.maps
    near = near_share(view.settings) * area.radius
    ball = near if settings.near_geometry == "ball" else 0.0
    corners = view.corners
    if settings.near_geometry == "planes":
        corners = without_near_planes(corners, area.center, near)
    shares = np.where(ahead, free_points(view, area, points, area.frame[2], ball, corners, ahead), 1.0)
    if settings.behind != "visible":
        shares = np.where(ahead, shares, free_points(view, area, points, -area.frame[2], ball, corners, ~ahead))
    return shares


def van_der_corput(k):
    """Mirror the binary digits of a number at the point."""
    value, digit = 0.0, 0.5
    while k:
        value, digit, k = value + k % 2 * digit, digit / 2, k // 2
    return value


def from_behind(view, area):
    """Return the share of 4 x 4 points of the rectangle that rays from behind reach; nothing near its centre blocks."""
    points = on_rectangle(area, np.array(np.meshgrid(FROM_BEHIND, FROM_BEHIND)).reshape(2, -1))
    ball = near_share(view.settings) * area.radius
    return free_points(view, area, points, -area.frame[2], ball, view.corners, ~ahead_of(view, area))


def near_share(settings):
    """Return the share of a cluster's radius within which nothing blocks."""
    given = settings.maps.near_distance
    return NEAR[settings.visibility.name()] if given is None else given


def on_rectangle(area, on_square):
    """Return points of the rectangle, (k, 3)."""
    return area.center + (area.offset[:, None] + (on_square - 0.5) * area.side[:, None]).T @ area.axes


def free_points(view, area, points, up, ball, corners, asked):
    """Return the share of points above a receiver's horizon that its rays reach, with nothing in a ball to block."""
    shares = np.ones(len(view.pixels))
    for p in np.flatnonzero(asked & view.light[area.members].any(axis=(0, 2))):
        x, facing = view.position[p], view.facing[p]
        above = points[(points - x) @ view.normal[p] > 0]
        if len(above):
            most = way_to_ball(x, above - x, area.center, ball)
            reached = free(corners, x + LIFT * facing, above + LIFT * up, most)
            shares[p] = (reached & ((above - x) @ facing > 0)).mean()  # the face hides what lies below it
    return shares


def way_to_ball(start, toward, center, radius):
    """Return the share of each way that lies before a ball."""
    a, b = (toward**2).sum(axis=1), toward @ (start - center)
    root = b * b - a * ((start - center) @ (start - center) - radius**2)
    share = (-b - np.sqrt(np.maximum(root, 0))) / a
    return np.where((radius > 0) & (root > 0), np.clip(share, 0, 1), 1.0)


def without_near_planes(corners, center, distance):
    """Leave out triangles whose plane passes within a distance of a point."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    height = np.abs((normal * (corners[:, 0] - center)).sum(axis=1)) / np.linalg.norm(normal, axis=1)
    return corners[height >= distance]


# visibility by maps


def by_map(view, area, sign):
    """Return V by the map ahead (1), or by that of the hemisphere behind (-1): right and forward turned round."""
    seen, shares = map_of(view, area, sign), np.ones(len(view.pixels))
    lit = view.light[area.members].any(axis=(0, 2))
    points, facing = view.position[lit].T, view.facing[lit].T
    if isinstance(view.settings.visibility, BackProjection):
        shares[lit] = projected(seen, area, points, facing)
    elif lit.any():
        shares[lit] = shadow(view.settings, seen, area.delta, points, facing)[0]
    return shares


def map_of(view, area, sign):
    """Draw the map of an area light past what cannot block or lies too near."""
    settings = view.settings.maps
    boxes = [val_areas.box(points.T) for points in (view.position, lit_points(view.frame))]
    center, ball, farthest = (one[0] for one in val_maps.map_views(
        *boxes, area.center[:, None], area.frame[2][:, None], np.array([area.radius]), near_share(view.settings)))
    corners = view.corners[val_maps.blockers(
        view.corners.reshape(-1, 3), np.arange(view.corners.size // 3).reshape(-1, 3),
        view.frame.gbuffer.triangle_id, view.lights.position.astype(float), *boxes, not settings.occluders_alone)]
    corners = without_near_planes(corners, center, ball) if settings.near_geometry == "planes" else corners
    frame = area.frame * np.array([sign, 1.0, sign])[:, None]
    depth = val_maps.depth_maps(
        corners.reshape(-1, 3), np.arange(corners.size // 3).reshape(-1, 3), np.ones(len(corners), bool), center[None],
        frame[None], np.array([ball if settings.near_geometry == "ball" else 0.0]), np.ones(1), settings.resolution)
    return Seen(center, frame, depth[0], farthest)

"""Light from further cameras, placed by coarse transport, joined where they show the same surface (Sec. 5, discussion).

They are placed where they see directly lit surfaces that light the picture and that it does not show. T_ij (W/m^2) is
the irradiance of receiver i from sender j, Phi_j / pi cos_i cos_j / r^2 where nothing lies between.
"""

import dataclasses
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from refgi.frame import Frame
from refgi.lights import choose_pixel_lights
from refgi.rays import STEPS, Tracer
from refgi.rsm import reflective_shadow_map
from refgi.rsm.buffers.gbuffer import GBuffer
from refgi.rsm.raster.projection import Projection
from refgi.sampling import halton
from refgi.scene.model import Camera
from refgi.scene.values import Vector
from refgi.sssil.reprojection import SourceView, reproject
from refgi.sssil.settings import CameraSettings
from refgi.stages import skip, stage
from refgi.types import Array

LIT_POINTS, RECEIVERS = 256, 256  # by trial: at equal cost more candidates bring more light than more points
MAP_RESOLUTION = 64  # texels along a side of the maps that senders are drawn from


class Points(NamedTuple):
    """Places on surfaces."""

    position: Array  # (n, 3) float64, m
    normal: Array  # (n, 3) float64 unit vectors on the lit or the visible side


def equal_flux_points(frame: Frame, count: int = LIT_POINTS) -> tuple[Points, float]:
    """Return points of equal reflected flux on directly lit surfaces, and the flux of each, W, of all channels."""
    maps = [reflective_shadow_map(frame.scene.geometry, frame.senders, light, MAP_RESOLUTION, frame.dtype)
            for light in frame.scene.lights]  # fmt: skip
    lights = choose_pixel_lights(maps, count=None, pattern="all")
    cumulative = np.cumsum(lights.flux.sum(axis=0, dtype=np.float64))
    total = float(cumulative[-1]) if cumulative.size else 0.0
    if not total > 0:
        return Points(np.zeros((0, 3)), np.zeros((0, 3))), 0.0
    chosen = np.searchsorted(cumulative, (np.arange(count) + 0.5) / count * total)
    return Points(*(plane.T[chosen].astype(np.float64) for plane in (lights.position, lights.normal))), total / count


def visible_points(buffer: GBuffer, count: int = RECEIVERS) -> Points:
    """Return surface points evenly spread over the picture, of about `count` pixels, without background."""
    height, width = buffer.projection.shape
    rows = min(height, max(1, round(math.sqrt(count * height / width))))
    columns = min(width, max(1, round(count / rows)))
    row, column = (((np.arange(n) + 0.5) * size / n).astype(np.int64) for n, size in ((rows, height), (columns, width)))
    position, normal, covered = buffer.at((row[:, None] * width + column).ravel(), "position", "normal", "covered")
    return Points(position.T[covered].astype(np.float64), normal.T[covered].astype(np.float64))


def transport(tracer: Tracer, receivers: Points, senders: Points, flux: float, nearest: float) -> Array:
    """Return T_ij, (receivers, senders), for senders of `flux`, W; `nearest`: least distance in the denominator."""
    direction = senders.position - receivers.position[:, None]
    square = (direction * direction).sum(axis=2)
    cosines = np.maximum((direction * receivers.normal[:, None]).sum(axis=2), 0)
    cosines = cosines * np.maximum(-(direction * senders.normal).sum(axis=2), 0)
    below = square * np.maximum(square, nearest**2)
    transported = np.divide(cosines, below, out=np.zeros_like(square), where=square > 0)
    i, j = np.nonzero(transported)
    transported[i, j] *= unoccluded(tracer, _off_surface(tracer, receivers, i),
                                    _off_surface(tracer, senders, j, direction[i, j]))
    return np.asarray(flux / math.pi * transported)


class Views(NamedTuple):
    """Pictures of one size and field of view."""

    eye: Array  # (c, 3) m
    axes: Array  # (c, 3, 3) right, down, forward
    half: Array  # (2,) tangents of half the field of view, horizontal and vertical
    pixel: float  # width of a pixel at a depth of 1 m, m


def sampling_quality(tracer: Tracer, views: Views, points: Points, coarsest: float) -> Array:
    """Return how finely each picture samples each point, (c, n): 1 / (1 + (length / coarsest)^2) of a pixel there, m.

    0 where a point is outside the picture, faces away or is occluded.
    """
    direction = points.position - views.eye[:, None]
    right, down, depth = np.moveaxis(np.einsum("cad,cnd->can", views.axes, direction), 1, 0)
    inside = (depth > 0) & (np.abs(right) <= views.half[0] * depth) & (np.abs(down) <= views.half[1] * depth)
    facing = np.maximum(-(direction * points.normal).sum(axis=2), 0)
    c, n = np.nonzero(inside & (facing > 0))
    facing, depth = facing[c, n] / np.linalg.norm(direction[c, n], axis=1), depth[c, n]
    quality = np.zeros(inside.shape)
    quality[c, n] = 1 / (1 + (views.pixel * depth / (coarsest * facing)) ** 2)
    quality[c, n] *= unoccluded(tracer, views.eye[c], _off_surface(tracer, points, n, direction[c, n]))
    return quality


def _off_surface(tracer: Tracer, points: Points, chosen: Array, direction: Array | None = None) -> Array:
    """Return places off the surfaces of points, for rays that start there, or end there along a direction."""
    position = points.position[chosen]
    offset = tracer.offsets(position) + (0 if direction is None else STEPS * np.abs(direction).sum(axis=1))
    return np.asarray(position + offset[:, None] * points.normal[chosen])


def unoccluded(tracer: Tracer, starts: Array, ends: Array) -> Array:
    """Return between which places (n, 3), off surfaces, nothing lies; bare traversal: one ray in 10^7 slips through."""
    blocked = np.zeros(len(starts), np.bool_)
    tracer.fill_occluded(np.ascontiguousarray(starts, np.float32), np.ascontiguousarray(ends - starts, np.float32),
                         np.ones(len(starts), np.float32), blocked)
    return ~blocked


PAIRS, EYES_PER_PAIR = 256, 2  # candidates: pairs of a receiver and a sender, places around the middle of each
WIDEST = math.tan(math.radians(44))  # tangent of half the field of view along the picture's longer side, at least
CLEARANCE = 0.1  # of the free distance: an eye's least distance from the surface that ends it
LEAST_GAIN = 1e-3  # of the light that reaches the picture, that a further camera must add
NEAREST = 1 / 32  # of the scene's diagonal: pairs nearer than that count as if they were that far apart
COARSEST = 1 / 32  # of the scene's diagonal: a pixel that long on a surface shows it half as well
STEEP = 0.99  # cosine between the view and the upward direction from which another direction has to be up
OneView = Callable[[Frame], Array]

SHARED = ("materials", "lights", "rsms", "tracer")  # of a frame: independent of its camera


@stage("sssil.placement", kept=False)
def place_cameras(frame: Frame, count: int) -> tuple[Camera, ...]:
    """Place cameras one after the other, each the candidate that adds most irradiance to the frame's picture.

    count: Number of cameras at most.
    -> tuple of Camera: Fewer than `count`, perhaps none, where no candidate adds a thousandth of the light that there
        is. Places are relative to the origin of `frame.scene`; sizes are the frame's.

    Notes
    -----
    The paper leaves the choice open. A camera lights receiver i by E_i = sum of T_ij over the senders j that it shows,
    if it shows i as well; cameras are joined by the maximum, so a candidate's gain is the sum of max(0, E_i - best_i)
    over the picture, where best_i is the irradiance by the frame's camera and those chosen so far. A candidate's points
    count by `sampling_quality`; those of the frame's camera, fully. T_ij includes occlusion, so that no camera is
    placed for light that would pass through walls. Eyes lie on free lines from the middle of a free segment between a
    visible surface and a sender: never inside a wall. Nothing is random.
    """
    tracer, diagonal, own = frame.tracer, frame.visible_extent.diagonal, frame.gbuffer.projection
    receivers, (senders, flux) = visible_points(frame.gbuffer), equal_flux_points(frame)
    passing = transport(tracer, receivers, senders, flux, NEAREST * diagonal)
    shown = sampling_quality(tracer, _own_view(own), senders, COARSEST * diagonal) > 0
    missed, least = passing * ~shown, LEAST_GAIN * float(passing.sum())
    if not float(missed.sum()) > least:
        skip("sssil.cameras", "the picture shows all surfaces that light it")
        return ()
    eyes, ahead = _candidate_views(tracer, receivers, senders, missed, diagonal)
    views = _wide_views(own, frame.scene.camera.up, eyes, ahead)
    gathered = _irradiance_from_shown(passing, sampling_quality(tracer, views, senders, COARSEST * diagonal))
    gathered *= sampling_quality(tracer, views, receivers, COARSEST * diagonal)
    winners = _greedy(gathered, _irradiance_from_shown(passing, shown)[0], least, count)
    return tuple(_camera(views, winner, own) for winner in winners)


def _irradiance_from_shown(passing: Array, shown: Array) -> Array:
    """Return the irradiance of each receiver from the senders that each view shows."""
    return np.asarray(np.einsum("cj,ij->ci", shown, passing))


def _own_view(own: Projection) -> Views:
    return Views(own.origin, own.frame, own.half, 2 * own.half[1] / own.height)


def _wide_views(own: Projection, up: Vector, eyes: Array, ahead: Array) -> Views:
    """Return views with a camera's field of view, or a wider one of the same shape."""
    upward = _unit(np.asarray(up))
    half = own.half * max(1.0, WIDEST / own.half.max())
    steep = np.abs(ahead @ upward) > STEEP
    right = _unit(np.cross(ahead, np.where(steep[:, None], np.eye(3)[np.argmin(np.abs(upward))], upward)))
    axes = np.stack([right, np.cross(ahead, right), ahead], axis=1)
    return Views(eyes, axes, half, 2 * half[1] / own.height)


def _candidate_views(
    tracer: Tracer, receivers: Points, senders: Points, missed: Array, diagonal: float
) -> tuple[Array, Array]:
    """Return eyes and directions of candidates, distributed like the light that the picture misses."""
    cumulative = np.cumsum(missed.ravel())
    drawn = np.searchsorted(cumulative, (np.arange(PAIRS) + 0.5) / PAIRS * cumulative[-1])
    i, j = np.repeat(np.divmod(drawn, missed.shape[1]), EYES_PER_PAIR, axis=1)
    middle = (receivers.position[i] + senders.position[j]) / 2
    u, v, share = halton(len(i), (2, 3, 5), start=1).T
    round_about, up = 2 * math.pi * u, 2 * v - 1
    flat = np.sqrt(1 - up * up)
    direction = np.stack([flat * np.cos(round_about), up, flat * np.sin(round_about)], axis=1)
    free = np.minimum(tracer.closest(middle, direction).distance, diagonal)
    for point, normal in ((receivers.position[i], receivers.normal[i]), (senders.position[j], senders.normal[j])):
        free = np.minimum(free, _distance_to_plane(middle - point, direction, normal))
    eyes = middle + ((1 - CLEARANCE) * free * np.sqrt(share))[:, None] * direction
    return eyes, _unit(_unit(receivers.position[i] - eyes) + _unit(senders.position[j] - eyes))


def _distance_to_plane(start: Array, direction: Array, normal: Array) -> Array:
    """Return the distance along a direction to the plane through the origin, inf where it never meets it."""
    height, sinking = (start * normal).sum(axis=1), -(direction * normal).sum(axis=1)
    return np.asarray(np.divide(height, sinking, out=np.full_like(height, np.inf), where=sinking > 0))


def _greedy(gathered: Array, best: Array, least: float, count: int) -> list[int]:
    """Return candidates in the order of what each adds to those before it, until the gain falls below `least`."""
    winners: list[int] = []
    while len(winners) < count:
        gain = np.maximum(gathered - best, 0).sum(axis=1)
        winner = int(np.argmax(gain))
        if not gain[winner] > least:
            break
        best = np.maximum(best, gathered[winner])
        winners.append(winner)
    return winners


def _camera(views: Views, index: int, own: Projection) -> Camera:
    eye, (_, down, ahead) = views.eye[index], views.axes[index]
    return Camera(eye.tolist(), (eye + ahead).tolist(), (-down).tolist(), 2 * math.atan(views.half[1]), own.width,
                  own.height)  # fmt: skip


def _unit(vectors: Array) -> Array:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0))


@stage("sssil.cameras", kept=False)
def join_cameras(frame: Frame, light: Array, settings: CameraSettings, one_view: OneView) -> Array:
    """Join the irradiance by a camera's own picture with that by further cameras' pictures.

    light (3, h, w): Irradiance by what this camera alone sees, W/m^2.
    one_view: Irradiance of a frame by its own camera alone.
    -> (3, h, w): For each pixel and channel the largest of all irradiances found for its surface, W/m^2; nowhere less
        than `light`.

    Notes
    -----
    The maximum is a lower bound of the light of all cameras together: of two surfaces that only one camera sees each,
    the light does not add up, but surfaces that both see are not counted twice. Where the irradiances carry noise the
    maximum of several lies above their mean. Each camera renders a picture as large as the frame's.
    """
    cameras = [recentred(view, frame.origin) for view in settings.views]
    if settings.count:
        cameras += place_cameras(frame, settings.count)
    else:
        skip("sssil.placement", "no cameras are to be placed")
    position, normal, covered = frame.gbuffer.resolve("position", "normal", "covered")
    joined = light
    for camera in cameras:
        other = frame_through(frame, camera)
        depth, other_normal = other.gbuffer.resolve("depth", "normal")
        # Sec. 5: the depth and normal test of temporal coherence
        source = SourceView(other.gbuffer.projection, depth, other_normal)
        found, _ = reproject(one_view(other), source, position, normal, covered,
                             depth_tolerance=settings.depth_tolerance, normal_cosine=settings.normal_cosine)
        joined = np.maximum(joined, found, out=found)
    return joined


def frame_through(frame: Frame, camera: Camera) -> Frame:
    """Return a frame of the same scene, size and kind through another camera, relative to the scene's origin."""
    scene = dataclasses.replace(frame.scene, camera=camera)
    other = Frame(scene, width=frame.width, height=frame.height, dtype=frame.dtype,
                  rsm_resolution=frame.rsm_resolution, shadows=frame.shadows)  # fmt: skip
    vars(other).update({name: vars(frame)[name] for name in SHARED if name in vars(frame)})
    return other


def recentred(camera: Camera, origin: Vector) -> Camera:
    """Return the same view, as a camera relative to another origin (m)."""
    if not any(origin):
        return camera
    eye, target = (np.subtract(place, origin).tolist() for place in (camera.eye, camera.target))
    return dataclasses.replace(camera, eye=eye, target=target)

"""Light from further cameras, joined by the maximum where they show the same surface (Sec. 5, discussion).

Where to put further cameras: where they see lit surfaces that light the picture and that the picture misses.
"""

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.frame import Frame
from refgi.rays import Tracer
from refgi.sampling import halton
from refgi.scene.model import Camera
from refgi.scene.values import Vector
from refgi.sssil.camera_transport import Points, Views, lit_points, seen_points, sight, transport
from refgi.sssil.reprojection import Seen, look_up
from refgi.sssil.settings import HssilSettings
from refgi.stages import skip, stage

Array = npt.NDArray[Any]

PAIRS, EYES_PER_PAIR = 256, 2  # candidates: pairs of a receiver and a lit point, places around the middle of each
WIDE = math.tan(math.radians(44))  # tangent of half the field of view along the picture's longer side, at least
CLEARANCE = 0.1  # of a free way: so far an eye stays off what ends it
LEAST_GAIN = 1e-3  # of the light that reaches the picture: less is not worth another picture
NEAREST = 1 / 32  # of the scene's diagonal: pairs nearer than that count as if they were that far apart
COARSEST = 1 / 32  # of the scene's diagonal: a pixel that long on a surface shows it half as well
STEEP = 0.99  # cosine between the view and the upward direction from which another direction has to be up
OneView = Callable[[Frame, HssilSettings], Array]

SHARED = ("materials", "lights", "rsms", "tracer")  # of a frame: what does not depend on its camera


@stage("sssil.placement", kept=False)
def placed_cameras(frame: Frame, count: int) -> tuple[Camera, ...]:
    """Choose cameras one after the other, each the candidate whose picture brings most light into the frame's.

    Parameters
    ----------
    frame : Frame
        The scene, seen and lit.
    count : int
        How many cameras at most.

    Returns
    -------
    tuple of Camera
        Fewer than `count`, perhaps none, where no candidate brings a thousandth of the light that there is. Places are
        relative to the origin of `frame.scene`; sizes are the frame's.

    Notes
    -----
    The paper leaves the choice open. A camera lights receiver i by E_i = sum of T_ij over the lit points j it sees, if
    it sees i as well; cameras are joined by the maximum, so a candidate's gain is the sum of max(0, E_i - best_i) over
    the picture, where best_i is what the frame's camera and those chosen so far give. Of a candidate, points count by
    how well it shows them (`sight`); of the frame's camera, fully. T_ij heeds what blocks light, so that no camera is
    placed to see what only shines through walls. Eyes lie on free lines from the middle of a free segment between a
    surface that the picture shows and a lit point: never inside a wall. Nothing is random.
    """
    tracer, diagonal = frame.tracer, frame.seen_extent.diagonal
    to, (lit, flux) = seen_points(frame), lit_points(frame)
    passing = transport(tracer, to, lit, flux, NEAREST * diagonal)
    shown = sight(tracer, _own_view(frame), lit, COARSEST * diagonal) > 0
    missed, least = passing * ~shown, LEAST_GAIN * float(passing.sum())
    if not float(missed.sum()) > least:
        skip("sssil.cameras", "the picture shows what lights it")
        return ()
    eyes, ahead = _looks(tracer, to, lit, missed, diagonal)
    views = _wide_views(frame, eyes, ahead)
    brought = _brought(passing, sight(tracer, views, lit, COARSEST * diagonal))
    brought *= sight(tracer, views, to, COARSEST * diagonal)
    winners = _greedy(brought, _brought(passing, shown)[0], least, count)
    return tuple(_camera(frame, views, winner) for winner in winners)


def _brought(passing: Array, shown: Array) -> Array:
    """Return what each receiver gets from the lit points that each view shows."""
    return np.asarray(np.einsum("cj,ij->ci", shown, passing))


def _own_view(frame: Frame) -> Views:
    own = frame.gbuffer.projection
    return Views(own.origin, own.frame, own.half, 2 * own.half[1] / own.height)


def _wide_views(frame: Frame, eyes: Array, ahead: Array) -> Views:
    """Return views with the frame's field of view, or a wider one of the same shape."""
    own, upward = frame.gbuffer.projection, _unit(np.asarray(frame.scene.camera.up))
    half = own.half * max(1.0, WIDE / own.half.max())
    steep = np.abs(ahead @ upward) > STEEP
    right = _unit(np.cross(ahead, np.where(steep[:, None], np.eye(3)[np.argmin(np.abs(upward))], upward)))
    axes = np.stack([right, np.cross(ahead, right), ahead], axis=1)
    return Views(eyes, axes, half, 2 * half[1] / own.height)


def _looks(tracer: Tracer, to: Points, lit: Points, missed: Array, diagonal: float) -> tuple[Array, Array]:
    """Return eyes and directions of candidates, drawn after the light that the picture misses."""
    upto = np.cumsum(missed.ravel())
    drawn = np.searchsorted(upto, (np.arange(PAIRS) + 0.5) / PAIRS * upto[-1])
    i, j = np.repeat(np.divmod(drawn, missed.shape[1]), EYES_PER_PAIR, axis=1)
    middle = (to.position[i] + lit.position[j]) / 2
    u, v, share = halton(len(i), (2, 3, 5), start=1).T
    round_about, up = 2 * math.pi * u, 2 * v - 1
    flat = np.sqrt(1 - up * up)
    way = np.stack([flat * np.cos(round_about), up, flat * np.sin(round_about)], axis=1)
    free = np.minimum(tracer.closest(middle, way).distance, diagonal)
    for point, normal in ((to.position[i], to.normal[i]), (lit.position[j], lit.normal[j])):
        free = np.minimum(free, _before_plane(middle - point, way, normal))
    eyes = middle + ((1 - CLEARANCE) * free * np.sqrt(share))[:, None] * way
    return eyes, _unit(_unit(to.position[i] - eyes) + _unit(lit.position[j] - eyes))


def _before_plane(start: Array, way: Array, normal: Array) -> Array:
    """Return how far one gets along a way before the plane through the origin, inf where never to it."""
    height, sinking = (start * normal).sum(axis=1), -(way * normal).sum(axis=1)
    return np.asarray(np.divide(height, sinking, out=np.full_like(height, np.inf), where=sinking > 0))


def _greedy(brought: Array, best: Array, least: float, count: int) -> list[int]:
    """Return candidates in the order of what each adds to those before it, as long as it is worth it."""
    winners: list[int] = []
    while len(winners) < count:
        gain = np.maximum(brought - best, 0).sum(axis=1)
        winner = int(np.argmax(gain))
        if not gain[winner] > least:
            break
        best = np.maximum(best, brought[winner])
        winners.append(winner)
    return winners


def _camera(frame: Frame, views: Views, index: int) -> Camera:
    eye, (_, down, ahead) = views.eye[index], views.axes[index]
    return Camera(eye.tolist(), (eye + ahead).tolist(), (-down).tolist(), 2 * math.atan(views.half[1]), frame.width,
                  frame.height)  # fmt: skip


def _unit(vectors: Array) -> Array:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0))


@stage("sssil.cameras", kept=False)
def several_cameras(frame: Frame, light: Array, settings: HssilSettings, one_view: OneView) -> Array:
    """Add to what a camera's picture lights what the pictures of further cameras light.

    Parameters
    ----------
    frame : Frame
        The scene, seen and lit.
    light : (3, h, w) ndarray
        Irradiance by what this camera alone sees, W/m^2.
    settings : HssilSettings
        `views` to look from, `cameras` to place besides, and when a texel of theirs shows the same surface.
    one_view : callable
        Frame and settings to the irradiance by what that frame's camera alone sees.

    Returns
    -------
    (3, h, w) ndarray
        For each pixel and channel the largest of all irradiances found for its surface, W/m^2; nowhere less than
        `light`.

    Notes
    -----
    The maximum is a lower bound of what all cameras together see: a surface that only one of them sees and another
    that only the next one sees do not add up, but what both see is not counted twice. Where the irradiances carry
    noise the maximum of several lies above their mean. Each camera renders a picture as large as the frame's.
    """
    cameras = [moved(view, frame.origin) for view in settings.views]
    if settings.cameras:
        cameras += placed_cameras(frame, settings.cameras)
    else:
        skip("sssil.placement", "no cameras are to be placed")
    position, normal, covered = frame.gbuffer.resolve("position", "normal", "covered")
    brightest = light
    for camera in cameras:
        there = seen_by(frame, camera)
        depth, normal_there = there.gbuffer.resolve("depth", "normal")
        # Sec. 5: the depth and normal test of temporal coherence
        found, _ = look_up(one_view(there, settings), Seen(there.gbuffer.projection, depth, normal_there), position,
                           normal, covered, depth_tolerance=settings.depth_tolerance,
                           normal_cosine=settings.normal_cosine)  # fmt: skip
        brightest = np.maximum(brightest, found, out=found)
    return brightest


def seen_by(frame: Frame, camera: Camera) -> Frame:
    """Return a frame of the same scene, size and kind through another camera.

    Parameters
    ----------
    frame : Frame
        The frame.
    camera : Camera
        Who looks instead, placed relative to the origin of `frame.scene`; its own size does not count.

    Returns
    -------
    Frame
        What `frame` has computed already and does not depend on the camera (reflective shadow maps, the tracer,
        tables) is taken over, not computed again.
    """
    scene = dataclasses.replace(frame.scene, camera=camera)
    other = Frame(scene, width=frame.width, height=frame.height, dtype=frame.dtype,
                  rsm_resolution=frame.rsm_resolution, shadows=frame.shadows)  # fmt: skip
    vars(other).update({name: vars(frame)[name] for name in SHARED if name in vars(frame)})
    return other


def moved(camera: Camera, origin: Vector) -> Camera:
    """Return a camera as a scene sees it whose origin was moved.

    Parameters
    ----------
    camera : Camera
        The camera.
    origin : tuple of 3 floats
        Where the scene's origin lies now, m.

    Returns
    -------
    Camera
        The same view.
    """
    if not any(origin):
        return camera
    eye, target = (np.subtract(place, origin).tolist() for place in (camera.eye, camera.target))
    return dataclasses.replace(camera, eye=eye, target=target)

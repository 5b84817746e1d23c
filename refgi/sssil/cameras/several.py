"""Light from further cameras, joined by the maximum where they show the same surface (Sec. 5, discussion)."""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.frame import Frame
from refgi.scene.model import Camera
from refgi.scene.values import Vector
from refgi.sssil.cameras.placement import placed_cameras
from refgi.sssil.reprojection.look_up import Seen, look_up
from refgi.sssil.settings import HssilSettings
from refgi.stages import skip, stage

Array = npt.NDArray[Any]
OneView = Callable[[Frame, HssilSettings], Array]

SHARED = ("materials", "lights", "rsms", "tracer")  # of a frame: what does not depend on its camera


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

"""Light from further cameras, joined where they show the same surface (Sec. 5, discussion)."""

import dataclasses
from collections.abc import Callable

import numpy as np

from refgi.frame import Frame
from refgi.scene.model import Camera
from refgi.scene.values import Vector
from refgi.sssil.reprojection import SourceView, reproject
from refgi.sssil.settings import CameraSettings
from refgi.stages import stage
from refgi.types import Array

OneView = Callable[[Frame], Array]

SHARED = ("materials", "lights", "rsms", "tracer")  # of a frame: independent of its camera


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
    position, normal, covered = frame.gbuffer.resolve("position", "normal", "covered")
    joined = light
    for view in settings.views:
        other = frame_through(frame, recentred(view, frame.origin))
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

"""The temporal filter one step after the other: reprojection, entering points, clamp of earlier light, blend (3.3)."""

from typing import TYPE_CHECKING

import numpy as np

from refgi.rsm.raster.projection import Projection
from refgi.scene.model import Geometry
from refgi.sssil.reprojection import SourceView, fetched
from refgi.sssil.settings import Fetch, TemporalSettings
from refgi.sssil.temporal.filter import History, clamp_to_neighbourhood, earlier_geometry
from refgi.sssil.temporal.filter import blend as blended
from refgi.sssil.temporal.motion import fetch_entering, previous_points
from refgi.stages import stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.frame import Frame


@stage("sssil.reprojection", kept=False)
def reprojection(
    position: Array, normal: Array, triangle_id: Array, projection: Projection, depth: Array, normal_before: Array,
    irradiance: Array, depth_tolerance: float, normal_cosine: float, fetch: Fetch, frames: Array | None = None,
) -> tuple[Array, Array, Array | None]:
    """Fetch light of the frame before where it shows the same surface, by depth and normal (HSS Sec. 3.3, E-HSS-11).

    position (3, h, w): Where the picture's surface points were in the frame before, m.
    normal (3, h, w): Their unit normals then.
    projection: The camera of the frame before.
    depth (h, w): Depth in the frame before, m; inf without surface.
    normal_before (3, h, w): Unit normals in the frame before.
    irradiance (3, h, w): Filtered light of the frame before, W/m^2.
    depth_tolerance: Largest difference of depths, a share of the point's.
    normal_cosine: Least cosine between normals.
    fetch: From the four texels around the point, or from the one it falls in.
    frames (h, w): Frames in which the pixel's surface was found.
    -> light (3, h, w): Mean over the texels around that show the same surface, W/m^2; 0 where none does.
    -> weight (h, w): Share of the bilinear weights that those texels have; 0: disoccluded or outside.
    -> count (h, w): Mean of the frames in which their surface was found.
    """
    values = irradiance if frames is None else np.concatenate([irradiance, frames[None]])
    mean, weight = fetched(values, SourceView(projection, depth, normal_before), position, normal, triangle_id >= 0,
                           depth_tolerance, normal_cosine, fetch)
    return mean[:3], weight, None if frames is None else mean[3]


@stage("sssil.entering", kept=False)
def entering(
    light: Array, weight: Array, position: Array, triangle_id: Array, projection: Projection, depth: Array,
    irradiance: Array, speed: float,
) -> tuple[Array, Array]:
    """Give points that lay outside the earlier picture the light at its edge, the less the farther off (HSS Sec. 3.3).

    light (3, h, w): Light as reprojected, W/m^2.
    weight (h, w): 0 where none was found.
    position (3, h, w): Where the picture's surface points were in the frame before, m.
    projection: The camera of the frame before.
    depth (h, w): Depth in the frame before, m; inf without surface.
    irradiance (3, h, w): Filtered light of the frame before, W/m^2.
    speed: Speed at which the share falls to 1 / e, pixels a frame.
    -> made (3, h, w): Light as reprojected, with the edge's light, W/m^2.
    -> share (h, w): exp(-v / speed), v pixels from the edge to where the point was; 0 but for points that entered.
    """
    made = light.copy()
    share = fetch_entering(irradiance, SourceView(projection, depth, irradiance), position, triangle_id >= 0, weight,
                           (0.0, 0.0, 0.0), speed, made)
    return made, share


@stage("sssil.clamp", kept=False)
def clamp(earlier: Array, new: Array, triangle_id: Array, deviations: float, radius: int) -> Array:
    """Clamp earlier light to the mean of the new light around, by standard deviations (docs/methods/hssil).

    earlier (3, h, w): Light of the frame before at this frame's points, W/m^2.
    new (3, h, w): Light of this frame as computed, W/m^2.
    triangle_id (h, w) int32: Triangle that each pixel sees, -1 for none: such pixels do not count.
    deviations: Half the width of the bounds, standard deviations.
    radius: The square has 2 radius + 1 pixels along a side.
    -> (3, h, w): Earlier light, clamped, W/m^2.
    """
    made = earlier.copy()
    clamp_to_neighbourhood(new, triangle_id >= 0, deviations, radius, made)
    return made


@stage("sssil.blend", kept=False)
def blend(
    new: Array, earlier: Array, weight: Array, a: float, falloff: float, frames: Array | None = None,
    entering_share: Array | None = None, speed: Array | None = None,
) -> tuple[Array, Array, Array | None]:
    """Blend light of this frame and of those before: F_i = a W(F_{i-1}) + (1 - a) I_i (HSS Sec. 3.3, E-HSS-11).

    new (3, h, w): I_i, light of this frame as computed, W/m^2.
    earlier (3, h, w): W(F_{i-1}), light of the frame before at this frame's points, W/m^2.
    weight (h, w): 0 where the frame before does not show the surface: a is 0 there.
    a: Share of the frame before; of a surface found in n frames before at most n / (n + 1), where these are counted.
    falloff: Speed at which a falls to a / e, pixels a frame.
    frames (h, w): n.
    entering_share (h, w): Share of a of points that entered.
    speed (h, w): How far surfaces moved, pixels a frame.
    -> irradiance (3, h, w): F_i, W/m^2; I_i where nothing was found.
    -> share (h, w): a of each pixel.
    -> count (h, w): Frames in which the pixel's surface was found, this one included.
    """
    made = earlier.copy() if frames is None else np.concatenate([earlier, frames[None]])
    share = weight.copy()
    blended(new, made, share, TemporalSettings(weight=a, speed=falloff), speed, entering_share)
    return made[:3], share, None if frames is None else made[3]


def temporal_steps(
    irradiance: Array, frame: "Frame", geometry: Geometry, history: History, settings: TemporalSettings
) -> dict[str, Array]:
    """Return the light of a frame and of those before, made by steps."""
    buffer, ids = frame.gbuffer, frame.gbuffer.triangle_id
    position, normal = buffer.resolve("position", "normal")
    view, speed, share = _seen_from(history.view, frame.origin), None, None
    if geometry is not history.geometry:
        before = earlier_geometry(frame.scene, frame.origin, history)
        position, normal, speed = previous_points(buffer, frame.scene.geometry, before)
    old, count = history.light[:3], history.light[3] if settings.counts_frames else None
    light, weight, frames = reprojection(position, normal, ids, view, history.view.depth, history.view.normal, old,
                                         settings.depth_tolerance, settings.normal_cosine, settings.fetch, count)
    if settings.entering_speed is not None:
        light, share = entering(light, weight, position, ids, view, history.view.depth, old, settings.entering_speed)
    if settings.clamp is not None:
        light = clamp(light, irradiance, ids, settings.clamp, settings.clamp_radius)
    made, _, found = blend(irradiance, light, weight, settings.weight, settings.speed, frames, share, speed)
    return {"light": made if found is None else np.concatenate([made, found[None]])}


def _seen_from(view: SourceView, origin: tuple[float, float, float]) -> Projection:
    """Return an earlier view's camera in coordinates of another origin."""
    apart = np.subtract(view.origin, origin)
    return view.projection._replace(origin=view.projection.origin + apart) if apart.any() else view.projection

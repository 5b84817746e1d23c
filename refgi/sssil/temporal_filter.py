"""Temporal filter F_i = a W(F_{i-1}) + (1 - a) I_i (HSS Sec. 3.3), with a clamp to new light around a pixel; by steps.

The clamp is variance clipping of temporal anti-aliasing (Salvi 2016; Karis 2014 clamps to the extremes): the mean of
the new light in a square of pixels, plus and minus some standard deviations. W reprojects; n frames found a surface.
"""

import dataclasses
import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from refgi.elementary import exp2
from refgi.errors import expect
from refgi.jit import kernel, prange
from refgi.rsm.raster.projection import Projection
from refgi.scene.model import Geometry, Scene
from refgi.scene.values import Vector
from refgi.sssil.motion import as_solids, fetch_entering, previous_points
from refgi.sssil.reprojection import SourceView, fetched, reproject
from refgi.sssil.settings import Fetch, TemporalSettings
from refgi.stages import skip, stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.frame import Frame


def clamp_to_neighbourhood(new: Array, covered: Array, deviations: float, radius: int, earlier: Array) -> None:
    """Clamp `earlier` light (3 or 4, h, w) to the mean of the new light in a square of pixels, by deviations."""
    _clamp(new, covered, new.dtype.type(deviations), radius, earlier)


@kernel(parallel=True)
def _clamp(new: Array, covered: Array, deviations: Any, radius: int, earlier: Array) -> None:
    height, width = covered.shape
    for row in prange(height):
        first, end = max(0, int(row) - radius), min(height, int(row) + radius + 1)
        count, total, square = np.zeros(width), np.zeros(width), np.zeros(width)
        for channel in range(3):
            _sum_columns(new[channel], covered, first, end, count, total, square)
            _clamp_row(count, total, square, deviations, radius, covered[row], earlier[channel, row])


@kernel
def _sum_columns(
    new: Array, covered: Array, first: int, end: int, count: Array, total: Array, square: Array
) -> None:
    """Sum number, light and its square over rows `first` to `end` - 1 of each column, in float64."""
    count[:], total[:], square[:] = 0.0, 0.0, 0.0
    for row in range(first, end):
        for column in range(len(count)):
            light = np.float64(new[row, column]) if covered[row, column] else 0.0
            count[column] += 1.0 if covered[row, column] else 0.0
            total[column] += light
            square[column] += light * light


@kernel
def _clamp_row(
    count: Array, total: Array, square: Array, deviations: Any, radius: int, covered: Array, earlier: Array
) -> None:
    real = earlier.dtype.type
    for column in range(len(count)):
        if not covered[column]:
            continue
        n, one, two = 0.0, 0.0, 0.0
        for beside in range(max(0, column - radius), min(len(count), column + radius + 1)):
            n, one, two = n + count[beside], one + total[beside], two + square[beside]
        mean = one / n
        spread = deviations * math.sqrt(max(0.0, two / n - mean * mean))
        earlier[column] = min(max(earlier[column], real(mean - spread)), real(mean + spread))


class History(NamedTuple):
    """State that a frame leaves to the next."""

    light: Array  # (3 or 4, h, w) F, or I for the printed form, W/m^2; then frames in which a pixel's surface was found
    view: SourceView  # its camera, depths and normals
    geometry: Geometry  # the scene's triangles, where the scene has them


class Filtered(NamedTuple):
    """Light blended with that of earlier frames."""

    light: Array  # (3 or 4, h, w) irradiance and, where they are counted, frames
    reused: float  # share of the pixels with a surface that the frame before shows as well

    @property
    def irradiance(self) -> Array:
        """F, (3, h, w) W/m^2."""
        return self.light[:3]

    @property
    def frames(self) -> Array | None:
        """Frames in which each pixel's surface was found, this one included, (h, w); None where they do not count."""
        return self.light[3] if len(self.light) > 3 else None


def history_of(frame: "Frame", geometry: Geometry, light: Array) -> History:
    """Return the state that the next frame needs of this one: depths, normals, light, frames.

    `geometry` is the very object of the next scene if nothing moves; `light` (3 or 4, h, w) is F or I, W/m^2, and
    frames.
    """
    buffer = frame.gbuffer
    depth, normal = buffer.resolve("depth", "normal")
    return History(light, SourceView(buffer.projection, depth, normal, frame.origin), geometry)


def first_light(irradiance: Array, settings: TemporalSettings) -> Array:
    """Return the light (3 or 4, h, w) of a frame that none goes before, with frames of 1 where they are counted."""
    return with_frames(irradiance, np.ones(irradiance.shape[1:], irradiance.dtype) if settings.counts_frames else None)


def with_frames(irradiance: Array, frames: Array | None) -> Array:
    """Return light (3, h, w), W/m^2, and the number of frames (h, w), if there is one, as one array."""
    return irradiance if frames is None else np.concatenate([irradiance, frames[None]])


@stage("sssil.temporal", kept=False, steps="refgi.sssil.temporal_filter.temporal_steps")
def temporal_filter(
    irradiance: Array, frame: "Frame", geometry: Geometry, history: History, settings: TemporalSettings
) -> Filtered:
    """Blend the light of a frame with that of the frame before.

    irradiance (3, h, w): I_i, light as computed, W/m^2.
    -> Filtered: F_i and the share of pixels that are not disoccluded.

    Raises
    ------
    InputError
        If the frame before has other triangles.

    Notes
    -----
    The paper prints W(I_{i-1}), which averages two frames; what it says of a, "the larger, the farther in time", needs
    W(F_{i-1}). A disoccluded pixel, whose point fails the tests, has a = 0. The light of a moving surface is as old as
    that of a resting one: an object that leaves its place takes the light of its old place along, which is why its a
    falls with its speed.
    """
    buffer = frame.gbuffer
    position, normal = buffer.resolve("position", "normal")
    speed = None
    if geometry is history.geometry:
        skip("sssil.motion", "the same geometry")
    else:
        expect_same_triangles(geometry, history.geometry)
        before = earlier_geometry(frame.scene, frame.origin, history)
        position, normal, speed = previous_points(buffer, frame.scene.geometry, before)
    earlier = history.light if settings.counts_frames else history.light[:3]
    reprojected, weight = reproject(earlier, history.view, position, normal, buffer.covered,
                                    origin=frame.origin, depth_tolerance=settings.depth_tolerance,
                                    normal_cosine=settings.normal_cosine, fetch=settings.fetch)
    entering = None
    if settings.entering_speed is not None:
        entering = fetch_entering(earlier, history.view, position, buffer.covered, weight, frame.origin,
                                  settings.entering_speed, reprojected)
    if settings.clamp is not None:
        clamp_to_neighbourhood(irradiance, buffer.covered, settings.clamp, settings.clamp_radius, reprojected)
    reused = blended(irradiance, reprojected, weight, settings, speed, entering)
    return Filtered(reprojected, reused / max(1, int(np.count_nonzero(buffer.covered))))


def blended(
    irradiance: Array, reprojected: Array, weight: Array, settings: TemporalSettings, speed: Array | None = None,
    entering: Array | None = None,
) -> int:
    """Turn `reprojected`, W(F_{i-1}) and frames, into F_i and frames with this; return how many surfaces were found.

    `weight` (h, w), 0 where the frame before does not show the surface, becomes a. `speed` (h, w) is the surfaces',
    pixels a frame; `entering` (h, w) the share of a of pixels that entered.
    """
    real = irradiance.dtype.type
    reused = np.empty(len(weight), np.int64)  # pixels of each row
    falloff = real(-math.log2(math.e) / settings.speed)
    _blend(irradiance, speed, entering, real(settings.weight), falloff, weight, reprojected, reused)
    return int(reused.sum())


def expect_same_triangles(geometry: Geometry, before: Geometry) -> None:
    """Raise `InputError` unless two geometries are one at two times: the same triangles of the same vertices."""
    expect(geometry.vertices.shape == before.vertices.shape, "scenes", f"the {len(before.vertices):,} vertices of the "
           "frame before in each", f"{len(geometry.vertices):,}")
    expect(geometry.faces is before.faces or np.array_equal(geometry.faces, before.faces), "scenes",
           "the triangles of the frame before in each, as objects move by their vertices", "other triangles")
    expect((geometry.vertex_normals is None) == (before.vertex_normals is None), "scenes",
           "vertex normals in all or in none", "some with and some without")


def earlier_geometry(scene: Scene, origin: Vector, history: History) -> Geometry:
    """Return the frame before's triangles relative to a frame's origin, solid objects in its pose (HSS Sec. 4)."""
    before, now = history.geometry, scene.geometry
    if any(origin):
        before = dataclasses.replace(before, vertices=np.asarray(before.vertices, np.float64) - origin)
    solids = np.array([one.solid for one in scene.materials])[now.material_of_face]
    return before if not solids.any() else as_solids(now, before, solids)


@kernel(parallel=True)
def _blend(
    irradiance: Array, speed: Array | None, entering: Array | None, a: float, falloff: float, weight: Array,
    blended: Array, reused: Array,
) -> None:
    """Turn W(F_{i-1}) into F_i, its weight into a, by differences: equal light stays; a fourth plane is n."""
    none, one = weight.dtype.type(0), weight.dtype.type(1)
    for row in prange(weight.shape[0]):
        count = 0
        for column in range(weight.shape[1]):
            count += weight[row, column] > none
        reused[row] = count
        for column in range(weight.shape[1]):
            found = weight[row, column] > none
            share = a if found else none
            if blended.shape[0] > 3:
                n = blended[3, row, column] if found else none
                share = min(share, n / (n + one))
                blended[3, row, column] = n + one
            if entering is not None and not found:
                share = a * entering[row, column]
            if speed is not None:
                share = share * exp2(speed[row, column] * falloff)
            weight[row, column] = share
        for channel in range(3):
            for column in range(weight.shape[1]):
                new = irradiance[channel, row, column]
                # Eq. of Sec. 3.3: F_i = a W(F_{i-1}) + (1 - a) I_i
                blended[channel, row, column] = new + weight[row, column] * (blended[channel, row, column] - new)


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

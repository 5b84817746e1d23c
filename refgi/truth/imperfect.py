"""Imperfect shadow maps: a depth map of few points for each pixel light, its holes filled (Ritschel et al. 2008).

Each map sees the half space before its light as a paraboloid: the direction (x, y, z) in the light's frame, a unit
vector, is at (s, t) = (x, y) / (1 + z). n points of its own lie all over the surfaces, evenly by area, and each stands
for the area A / n: a disc of radius r, r^2 = A / (pi n). Its splat is a box as wide as a disc that faces the light and
looks as large, half of it r sqrt(c) (1 + s^2 + t^2) / (2 d) at the distance d, c the cosine at the point. A texel keeps
the distance of its nearest point.

Holes that narrower boxes leave can be filled by pulling and pushing. Pull: a texel of the next coarser level has the
mean of those of its four that are no farther than 1 + NEAR times the nearest of them. Push: from the coarsest level
down, a texel that holds nothing takes from the level above, bilinearly, what is no farther than 1 + NEAR times the
nearest there.

A receiver is in shadow where its distance exceeds that of its texel by more than the bias, some times what a surface
that goes through it may differ within a box or a texel: w tan(a), a the angle between its normal and the light.
"""

import dataclasses
import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from refgi.errors import expect
from refgi.jit import kernel, prange
from refgi.pairs.shadow_rays import RayReceivers, Senders
from refgi.radiometry import orthonormal_basis
from refgi.sampling import FIRST_STEP, IMPERFECT_MAPS, SECOND_STEP, draws
from refgi.scene import Geometry
from refgi.scene.texture.lookup import is_opaque
from refgi.scene.triangles import NO_CUT, CutFaces
from refgi.settings import Settings, setting
from refgi.stages import stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.pairs.pixel_lights import PixelLights

HORIZON = 1e-3  # least cosine at the light: points of its own face lie at 0, but for rounding
GRAZING = 0.05  # least cosine at a receiver that the bias grows with
NEAR = 0.1  # share of a distance by which others may be farther and still be of one surface
FINEST, COARSEST = 2, 12  # log2 of a map's texels along a side
MOST_POINTS = 1 << 22


@dataclasses.dataclass(frozen=True)
class Imperfect(Settings):
    """Visibility by a depth map of few points for each pixel light."""

    points: int = setting(8192, "points of each map, all over the scene", least=1, most=MOST_POINTS)
    resolution: int = setting(128, "of each map", least=1 << FINEST, most=1 << COARSEST, unit="texels")
    splat: float = setting(1.0, "side of a point's box, in the width of its disc; 0: one texel", least=0.0, most=100.0)
    levels: int = setting(0, "of pulling and pushing: holes of up to 2^levels texels are filled; 0: none", least=0,
                          most=COARSEST)
    bias: float = setting(2.0, "depth by which a receiver must be behind, in what its own surface may differ by",
                          least=0.0, most=1e6)

    def check(self) -> None:
        """Check that the resolution is a power of two, and that there are as many levels."""
        side = self.resolution
        expect(side & (side - 1) == 0, "maps.resolution", "a power of two", side)
        expect(1 << self.levels <= side, "maps.levels", f"at most {side.bit_length() - 1} for {side} texels",
               self.levels)


class ImperfectDepth(NamedTuple):
    """Depth maps of N pixel lights."""

    depth: Array  # (N, R, R) float32, m; row and column grow with t and s; inf where nothing is
    radius: Array  # (1,) float64, m, of a point; 0 where the scene has no area
    bias: float  # in what a receiver's own surface may differ by within a box or a texel


@stage("vpl.imperfect_maps", steps="refgi.truth.steps.map_steps")
def imperfect_maps(geometry: Geometry, lights: "PixelLights", settings: Imperfect, seed: int = 0) -> ImperfectDepth:
    """Draw the map of each pixel light.

    geometry: What may block.
    lights: N lights; each map looks along its light's normal.
    seed: Of the points.
    -> ImperfectDepth: The maps. Light i has points of its own, by the stream i of random numbers.

    Notes
    -----
    Point k lies in the k-th of n equal shares of the area, in the order of the faces, and within its face where a
    sequence of low discrepancy has its k-th point (Roberts 2018), all shifted at random for each light; the paper draws
    points independently. A point nearer than its radius is left out: what it stands for reaches around the light.
    Points reach both sides of faces, as surfaces do; those in holes of cut-outs are left out. Boxes by angle, the bias
    by slope and what counts as near (`HORIZON`, `GRAZING`, `NEAR`) are this module's own: the paper leaves them open.
    """
    corners, facing, upto = areas_of(geometry)
    total = float(upto[-1]) if len(upto) else 0.0
    count = lights.flux.shape[1]
    depth = np.full((count, settings.resolution, settings.resolution), np.inf, np.float32)
    radius = math.sqrt(total / (math.pi * settings.points))
    if total > 0:
        position, normal = (np.ascontiguousarray(one.T, np.float64) for one in (lights.position, lights.normal))
        shifts = np.stack([draws(seed, IMPERFECT_MAPS, 3, part=i) for i in range(count)]) if count else np.empty((0, 3))
        _draw_maps(position, normal, corners, facing, upto, geometry.cut or NO_CUT, settings.points, shifts, radius,
                   settings.splat, settings.levels, depth)
    return ImperfectDepth(depth, np.full(1, radius), settings.bias)


def areas_of(geometry: Geometry) -> tuple[Array, Array, Array]:
    """Return the corners (F, 3, 3) of faces, their unit normals (F, 3) and the sums (F,) of areas up to each, m^2."""
    corners = np.ascontiguousarray(geometry.vertices[geometry.faces], np.float64)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    twice = np.linalg.norm(across, axis=1, keepdims=True)
    return corners, np.divide(across, twice, out=np.zeros_like(across), where=twice > 0), np.cumsum(0.5 * twice)


def fill_hidden(maps: ImperfectDepth, to: RayReceivers, receivers: tuple[int, int], senders: Senders,
                lights: tuple[int, int], reach: Array, hidden: Array) -> None:
    """Fill which pairs a map says are blocked, light by light for each receiver; those of `reach` 0 are, too."""
    _fill_hidden(maps.depth, float(maps.radius[0]), maps.bias, to.position, to.facing, receivers, senders.position,
                 senders.normal, lights, reach, hidden)


@kernel(parallel=True)
def _draw_maps(position: Array, normal: Array, corners: Array, facing: Array, upto: Array, holes: CutFaces, points: int,
               shifts: Array, radius: float, splat: float, levels: int, depth: Array) -> None:
    for i in prange(depth.shape[0]):
        _draw_points(position[i], normal[i], corners, facing, upto, holes, points, shifts[i], radius, splat, depth[i])
        if levels:
            fill_holes(depth[i], levels)


@kernel
def _draw_points(position: Array, normal: Array, corners: Array, facing: Array, upto: Array, holes: CutFaces,
                 points: int, shift: Array, radius: float, splat: float, depth: Array) -> None:
    frame = np.empty((3, 3))
    fill_frame(normal, frame)
    for k in range(points):
        f = min(np.searchsorted(upto, (k + shift[0]) / points * upto[-1], side="right"), len(upto) - 1)
        a, b = math.sqrt((shift[1] + k * FIRST_STEP) % 1.0), (shift[2] + k * SECOND_STEP) % 1.0
        if len(holes.of_face) > 0 and holes.of_face[f] >= 0 and not _is_there(holes, holes.of_face[f], a, b):
            continue
        x, y, z, across = 0.0, 0.0, 0.0, 0.0
        for c in range(3):
            d = ((1 - a) * corners[f, 0, c] + a * (1 - b) * corners[f, 1, c] + a * b * corners[f, 2, c]) - position[c]
            x, y, z = x + d * frame[0, c], y + d * frame[1, c], z + d * frame[2, c]
            across += d * facing[f, c]
        distance = math.sqrt(x * x + y * y + z * z)
        if z > HORIZON * distance and distance > radius:
            wide = splat * radius * math.sqrt(abs(across) / distance)
            splat_box(x / (distance + z), y / (distance + z), distance, wide, depth)


@kernel
def _is_there(holes: CutFaces, k: int, a: float, b: float) -> bool:
    """Return whether a triangle is there at the point of weights 1 - a, a (1 - b) and a b."""
    uv = holes.uv
    return is_opaque(holes.table, holes.mask[k], (1 - a) * uv[k, 0] + a * (1 - b) * uv[k, 2] + a * b * uv[k, 4],
                     (1 - a) * uv[k, 1] + a * (1 - b) * uv[k, 3] + a * b * uv[k, 5])


@kernel
def fill_frame(normal: Array, frame: Array) -> None:
    """Fill the rows of a frame whose last one is a unit normal."""
    frame[0, 0], frame[0, 1], frame[0, 2], frame[1, 0], frame[1, 1], frame[1, 2] = orthonormal_basis(
        normal[0], normal[1], normal[2])
    frame[2, 0], frame[2, 1], frame[2, 2] = normal[0], normal[1], normal[2]


@kernel
def splat_box(s: float, t: float, distance: float, wide: float, depth: Array) -> None:
    """Lower the texels whose centres a point's box holds to its distance, or the one that holds the point."""
    side = depth.shape[0]
    half = 0.25 * side * (1 + s * s + t * t) * wide / distance
    column, row = 0.5 * side * (s + 1), 0.5 * side * (t + 1)
    left, right = math.ceil(column - half - 0.5), math.floor(column + half - 0.5)
    top, bottom = math.ceil(row - half - 0.5), math.floor(row + half - 0.5)
    if left > right:
        left = right = math.floor(column)
    if top > bottom:
        top = bottom = math.floor(row)
    for i in range(max(0, top), min(side - 1, bottom) + 1):
        for j in range(max(0, left), min(side - 1, right) + 1):
            depth[i, j] = min(depth[i, j], np.float32(distance))


@kernel
def fill_holes(depth: Array, levels: int) -> None:
    """Pull and push one map in place."""
    side = depth.shape[0]
    pyramid = np.empty((levels + 1, side, side), np.float32)
    _copy(depth, pyramid[0])
    for level in range(1, levels + 1):
        _pull(pyramid[level - 1], side >> level, pyramid[level])
    for level in range(levels, 0, -1):
        _push(pyramid[level], side >> level, pyramid[level - 1])
    _copy(pyramid[0], depth)


@kernel
def _copy(source: Array, target: Array) -> None:
    """Copy a map; a slice would compile for seconds."""
    for i in range(len(source)):
        for j in range(len(source)):
            target[i, j] = source[i, j]


@kernel
def _pull(fine: Array, side: int, coarse: Array) -> None:
    for i in range(side):
        for j in range(side):
            four = (fine[2 * i, 2 * j], fine[2 * i, 2 * j + 1], fine[2 * i + 1, 2 * j], fine[2 * i + 1, 2 * j + 1])
            coarse[i, j] = _mean_of_nearest(four, (1.0, 1.0, 1.0, 1.0))


@kernel
def _push(coarse: Array, side: int, fine: Array) -> None:
    for i in range(2 * side):
        for j in range(2 * side):
            if fine[i, j] == np.inf:
                # a texel's four neighbours on the coarser level lie a quarter and three quarters of a texel away
                y, x = i // 2, j // 2
                v, u = min(max(y + 2 * (i % 2) - 1, 0), side - 1), min(max(x + 2 * (j % 2) - 1, 0), side - 1)
                four = (coarse[y, x], coarse[y, u], coarse[v, x], coarse[v, u])
                fine[i, j] = _mean_of_nearest(four, (9.0, 3.0, 3.0, 1.0))


@kernel
def _mean_of_nearest(four: Any, weights: Any) -> Any:
    """Return the weighted mean of those distances that are near the least one; inf where there is none."""
    least = min(min(four[0], four[1]), min(four[2], four[3]))
    if least == np.inf:
        return np.float32(np.inf)
    total, weight = 0.0, 0.0
    for k in range(4):
        if four[k] <= (1 + NEAR) * least:
            total, weight = total + weights[k] * four[k], weight + weights[k]
    return np.float32(total / weight)


@kernel(parallel=True)
def _fill_hidden(depth: Array, radius: float, bias: float, points: Array, facing: Array, receivers: tuple[int, int],
                 position: Array, normal: Array, lights: tuple[int, int], reach: Array, hidden: Array) -> None:
    count = lights[1] - lights[0]
    for i in prange(receivers[1] - receivers[0]):
        r = receivers[0] + i
        for k in range(lights[0], lights[1]):
            pair = i * count + k - lights[0]
            hidden[pair] = reach[pair] <= 0 or _is_hidden(depth[k], radius, bias, points[:, r], facing[:, r],
                                                          position[:, k], normal[:, k])


@kernel
def _is_hidden(depth: Array, radius: float, bias: float, point: Array, facing: Array, position: Array,
               normal: Array) -> Any:
    frame = orthonormal_basis(normal[0], normal[1], normal[2])
    dx, dy, dz = point[0] - position[0], point[1] - position[1], point[2] - position[2]
    z = dx * normal[0] + dy * normal[1] + dz * normal[2]
    distance = math.sqrt(dx * dx + dy * dy + dz * dz)
    if z <= 0:
        return True
    s = (dx * frame[0] + dy * frame[1] + dz * frame[2]) / (distance + z)
    t = (dx * frame[3] + dy * frame[4] + dz * frame[5]) / (distance + z)
    side = depth.shape[0]
    j, i = min(int(0.5 * side * (s + 1)), side - 1), min(int(0.5 * side * (t + 1)), side - 1)
    texel = 4 * distance / (side * (1 + s * s + t * t))
    cosine = max(GRAZING, -(dx * facing[0] + dy * facing[1] + dz * facing[2]) / distance)
    slope = math.sqrt(max(0.0, 1 - cosine * cosine)) / cosine
    return depth[i, j] < distance - bias * max(radius * math.sqrt(cosine), texel) * max(1.0, slope)

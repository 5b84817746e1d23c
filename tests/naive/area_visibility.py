"""Slow literal twin of the visibility of area lights for every setting of `val`: receiver by receiver, in float64.

A map `Seen` holds the distances z to what lies around a centre, at the texels (s, t) = (x, y) / (|p| + z) of a
hemisphere. Receivers are Python loops; the texels of a map are NumPy arrays.
"""

import functools
import math
from typing import NamedTuple

import numpy as np

from tests.naive import filters

SLACK = 1e-3  # share of its distance by which a blocker lies before a receiver
STEEPEST = math.tan(math.radians(80))  # of a search's cone
NO_BLOCKER = 0.02  # share of the search disc below which the series has found none
NEARLY_ALL = 0.95  # of its top: where a series that never reaches 1 counts as lit
SCAN = 64  # places for each term at which a series is tried for its top
LEAST_RATIO = 1.05  # farthest over nearest of what a map holds, on the scale of its depths


class Seen(NamedTuple):
    """Distances around the centre of an area light."""

    center: np.ndarray
    frame: np.ndarray  # rows right, down, forward
    depth: np.ndarray  # (n, n) m; inf where nothing is
    scene_far: float  # to the farthest corner of what takes part, m

    @property
    def near(self):
        """Nearest distance that the map holds."""
        return float(self.depth.min())

    @property
    def far(self):
        """Farthest distance that the map holds."""
        return float(self.depth[np.isfinite(self.depth)].max())


@functools.cache
def texels(n):
    """Return (s, t) of texels' centres, whether they lie in the unit disc, and unit vectors, (n, n, 3)."""
    s, t = np.meshgrid(*[(np.arange(n) + 0.5) * 2 / n - 1] * 2)
    square = s * s + t * t
    return s, t, square <= 1, np.stack([2 * s, 2 * t, 1 - square], axis=2) / (1 + square)[..., None]


# filter sizes: tangents of half-angles


def cone(delta, d, z):
    """tan a = Delta (d - z) / (2 d z)."""
    return min(delta * (d - z) / (2 * d * z), STEEPEST) if d > z else 0.0


def printed_angle(delta, d, z):
    """tan(alpha / 2) of alpha = arctan(p cos(beta) / d), the full width as if it began on the axis."""
    return math.tan(math.atan(2 * cone(delta, d, z)) / 2)


def search(delta, d, near, printed):
    """Return the tangent of the blocker search."""
    return min(delta / (2 * d), STEEPEST) if "val_search_solid_angle" in printed else cone(delta, d, near)


def farthest(delta, d, r):
    """Tangent of the widest direction in which a point at distance r has the light behind it, as the receiver sees.

    A receiver at d on the axis: the point (r sin, r cos) is on the line from (0, d) to the light's edge (Delta / 2, 0).
    """
    if r >= d:
        return 0.0
    def beside(a):
        return r * math.sin(a) > delta / 2 * (1 - r * math.cos(a) / d)
    steps = [math.radians(80) * k / 2000 for k in range(2001)]
    first = next((k for k, a in enumerate(steps) if beside(a)), None)
    if not first:
        return 0.0 if first == 0 else STEEPEST
    low, high = steps[first - 1], steps[first]
    for _ in range(60):
        low, high = (low, (low + high) / 2) if beside((low + high) / 2) else ((low + high) / 2, high)
    return math.tan(low)


def penumbra(delta, d, z, printed):
    """Return the tangent of the final filter."""
    return (printed_angle if "val_alpha" in printed else cone)(delta, d, z)


def region(local, tangent, printed):
    """Return centre (s, t) and radius of the disc of a cone; or centre and half side of the square of side alpha / pi.

    The map is 2 wide and its texture 1, so half of the side alpha / pi of a texture is alpha / pi of the map's units.
    """
    d, a = math.hypot(*local), math.atan(tangent)
    if "val_alpha_over_pi" in printed:
        return local[0] / (d + local[2]), local[1] / (d + local[2]), 2 * a / math.pi
    scale = 1 / (local[2] + d * math.cos(a))
    return local[0] * scale, local[1] * scale, d * math.sin(a) * scale


# Sec. 4.1, the series


class Series(NamedTuple):
    """What a series is and how its depths are biased."""

    weight: np.ndarray  # w_k = 2 L_k / c_k
    search_bias: float
    bias: float
    end: float  # the far end of depths
    gain: float


@functools.cache
def series(csm):
    """Return the series of settings `Csm`."""
    k = np.arange(1, csm.terms + 1)
    weight = 2 * np.exp(-csm.attenuation * (k / csm.terms) ** 2) / ((2 * k - 1) * math.pi)
    if csm.rescale == "plateau":
        weight = weight / min(1.0, 2 * plateau(weight))
    first = first_lit(weight)
    bias = (first, 0.0 if csm.rescale == "scale2" else first) if csm.bias is None else (csm.bias, csm.bias)
    return Series(weight, *bias, 1 - first - max(first, bias[0]), 2.0 if csm.rescale == "scale2" else 1.0)


def above_half(gap, weight):
    """f_M - 1/2 = sum_k w_k sin(c_k (z - d))."""
    c = (2 * np.arange(1, len(weight) + 1) - 1) * math.pi
    return np.sin(np.multiply.outer(gap, c)) @ weight


def first_lit(weight):
    """Return b*, the first z - d at which the series is 1, or 95 % of the way to its top where it never is."""
    gaps = np.linspace(0, 0.5, SCAN * len(weight) + 1)
    values = above_half(gaps, weight)
    level = min(0.5, NEARLY_ALL * values.max())
    k = int(np.argmax(values >= level))
    low, high = gaps[k - 1], gaps[k]
    for _ in range(100):
        middle = (low + high) / 2
        low, high = (middle, high) if above_half(middle, weight) < level else (low, middle)
    return (low + high) / 2


def plateau(weight, nodes=200):
    """Return the mean of f_M - 1/2 from b* to 1 - b*, by quadrature."""
    x, w = np.polynomial.legendre.leggauss(nodes)
    first = first_lit(weight)
    return float(w @ above_half(0.5 + x * (0.5 - first), weight)) / 2


class Scale(NamedTuple):
    """Depths t(z) = (log2(z / origin) or z - origin) slope, 0 to `end`."""

    logarithmic: bool
    origin: float
    slope: float
    end: float

    def depth(self, z):
        """Return the depth of a distance."""
        with np.errstate(divide="ignore"):
            along = np.log2(z / self.origin) if self.logarithmic else np.subtract(z, self.origin)
        return np.clip(along * self.slope, 0, self.end)

    def distance(self, t):
        """Return the distance of a depth."""
        along = t / self.slope
        return self.origin * 2**along if self.logarithmic else along + self.origin


def scale_of(seen, kind, end):
    """Return the scale of a map's depths: docs/methods/val_visibility, "The scale of depths"."""
    if kind == "scene":
        return Scale(False, 0.0, end / seen.scene_far, end)
    top, far = max(2 * end - 1, end / 2), max(seen.far, LEAST_RATIO * seen.near)
    span = math.log2(far / seen.near) if kind == "log_map" else far - seen.near
    return Scale(kind == "log_map", seen.near, top / span, end)


class Filtered(NamedTuple):
    """The channels S, C, SZ, CZ, Z of a map: one plane each, or all levels of a mip map."""

    planes: np.ndarray | None
    levels: list | None
    boxes: bool

    def mean(self, s, t, radius):
        """Return the channels' means over a disc or a square."""
        if self.levels is not None:  # a read between texels is twice as wide as a texel: one level finer
            return filters.trilinear(self.levels, s, t, radius, shift=-1.0)
        if self.boxes:
            return filters.box_mean(self.planes, s, t, radius)
        found = in_disc(len(self.planes), s, t, radius)
        return self.planes[found].mean(axis=0)


def in_disc(n, s, t, radius):
    """Return which texels of the hemisphere have their centre in a disc; the one it lies in where none has."""
    a, b, inside, _ = texels(n)
    found = inside & ((a - s) ** 2 + (b - t) ** 2 <= radius * radius)
    if not found.any():
        found[own_texel(n, s, t)] = True
    return found


def own_texel(n, s, t):
    """Return (row, column) of the texel that a place falls into."""
    return tuple(min(max(math.floor((x + 1) / 2 * n), 0), n - 1) for x in (t, s))


def filtered(seen, csm, boxes):
    """Return the filtered map: mean of every texel (brute), or mip map of the map mirrored over the rim."""
    t = scale_of(seen, csm.depth_scale, series(csm).end).depth(seen.depth)
    t = filters.mirrored(t) if csm.prefilter == "mip" else t
    rounded = rounded_channels if csm.quantisation == "published" else np.asarray
    planes = rounded(filters.planes(t, csm.terms))
    if csm.prefilter == "brute":
        return Filtered(planes, None, boxes)
    levels = [planes]
    while len(levels[-1]) > 1:
        levels.append(rounded(filters.mip_levels(levels[-1])[1]))
    return Filtered(None, levels, boxes)


def rounded_channels(planes):
    """Return 8 bits of the basis, 16 of what is multiplied by depth."""
    basis = (planes.shape[2] - 1) // 2
    return np.concatenate([np.vectorize(filters.eight_bits)(planes[..., :basis]),
                           np.vectorize(filters.half_precision)(planes[..., basis:])], axis=2)


def lit_share(means, weight, d):
    """V = 1/2 + sum_k w_k (cos(c_k d) S_k - sin(c_k d) C_k)."""
    m, c = len(weight), (2 * np.arange(1, len(weight) + 1) - 1) * math.pi
    return 0.5 + weight @ (np.cos(c * d) * means[:m] - np.sin(c * d) * means[m : 2 * m])


def blocked_depth(means, weight, d):
    """Z / 2 - sum_k w_k (cos(c_k d) SZ_k - sin(c_k d) CZ_k)."""
    m, c = len(weight), (2 * np.arange(1, len(weight) + 1) - 1) * math.pi
    return means[4 * m] / 2 - weight @ (np.cos(c * d) * means[2 * m : 3 * m] - np.sin(c * d) * means[3 * m : 4 * m])


def csm_share(seen, channels, csm, delta, local, printed):
    """Return V by the series: search, average blocker, final filter."""
    d, chain = math.hypot(*local), series(csm)
    scale = scale_of(seen, csm.depth_scale, chain.end)
    here = float(scale.depth(d))
    means = channels.mean(*region(local, search(delta, d, seen.near, printed), printed))
    blocked = 1 - lit_share(means, chain.weight, here - chain.search_bias)
    if blocked < NO_BLOCKER:
        return 1.0
    # Sec. 4.1: z_avg
    z_avg = scale.distance(blocked_depth(means, chain.weight, here - chain.search_bias) / blocked)
    z_avg = min(max(z_avg, seen.near), d)
    means = channels.mean(*region(local, penumbra(delta, d, z_avg, printed), printed))
    return min(max(chain.gain * lit_share(means, chain.weight, here - chain.bias), 0.0), 1.0)


# depth tests, texel by texel


def plane_distance(n, local, normal):
    """Return how far each texel's direction meets the receiver's plane; the receiver's distance where it does not."""
    slope, height = texels(n)[3] @ normal, float(local @ normal)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(slope * height > 0, height / slope, math.hypot(*local))


def pcss_share(seen, pcss, chain_end, delta, local, normal, printed):
    """Return V: search, mean depth of blockers, share of the final disc that is free."""
    n, d = len(seen.depth), math.hypot(*local)
    limit = plane_distance(n, local, normal)
    if pcss.constant_bias is not None:
        scale = scale_of(seen, pcss.constant_bias.scale, chain_end)
        along = pcss.constant_bias.value / scale.slope
        limit = d * 2**-along if scale.logarithmic else d - along
    hides = seen.depth < limit * (1 - SLACK)
    axial, solid_angle = pcss.blocker_depth == "axial", "val_search_solid_angle" in printed
    wide = farthest(delta, d, seen.near) if axial and not solid_angle else search(delta, d, seen.near, printed)
    blockers = hides & in_disc(n, *region(local, wide, printed))
    blockers &= in_cone(seen, local, delta) if pcss.cone else True
    if not blockers.any():
        return 1.0
    depth, least = (seen.depth * (texels(n)[3] @ local) / d, seen.near * math.cos(math.radians(80))) if axial else (
        seen.depth, seen.near)
    z_avg = min(max(depth[blockers].mean(), least), d)
    return 1 - hides[in_disc(n, *region(local, penumbra(delta, d, z_avg, printed), printed))].mean()


def in_cone(seen, local, delta):
    """Tell which texels, half their diagonal around their centres, touch the cone to a disc of width Delta."""
    n, d = len(seen.depth), math.hypot(*local)
    s, t, _, toward = texels(n)
    z = np.where(np.isfinite(seen.depth), seen.depth, 1e9)
    point, axis = z[..., None] * toward, local / d
    along = point @ axis
    off = np.linalg.norm(point - along[..., None] * axis, axis=2) - z * math.sqrt(2) * 2 / n / (1 + s * s + t * t)
    return (along < d) & (off <= delta / 2 * (1 - along / d))


def pcf_share(seen, local, normal, side):
    """Return the share of side x side texels around the receiver's own that do not hide it."""
    n, d = len(seen.depth), math.hypot(*local)
    row, column = own_texel(n, local[0] / (d + local[2]), local[1] / (d + local[2]))
    limit = np.minimum(d, plane_distance(n, local, normal)) * (1 - SLACK)
    tested = np.zeros((n, n), bool)
    half = side // 2
    tested[max(row - half, 0) : row + half + 1, max(column - half, 0) : column + half + 1] = True
    tested &= texels(n)[2]
    tested[row, column] = True
    return 1 - (seen.depth < limit)[tested].mean()


# back projection


def back_projected(seen, area, local_of, x, facing, cells=32):
    """Return the share of a grid of cells over the rectangle, above the receiver's surface, that no patch hides.

    `local_of` turns vectors into the rectangle's axes and the map's forward; a patch is a texel at its depth.
    """
    n = len(seen.depth)
    local, up = local_of @ (x - seen.center), local_of @ facing
    low = area.offset - area.side / 2
    lift = float(local_of[2] @ (area.center - seen.center))
    grid = [low[a] + (np.arange(cells) + 0.5) * area.side[a] / cells for a in (0, 1)]
    u, v = np.meshgrid(*grid)
    counted = (u - local[0]) * up[0] + (v - local[1]) * up[1] + (lift - local[2]) * up[2] > 0
    if not counted.any():
        return 1.0
    slope, height = texels(n)[3] @ seen.frame @ local_of.T @ up, float(local @ up)
    with np.errstate(divide="ignore", invalid="ignore"):
        limit = np.where(slope * height > 0, height / slope, math.inf)
    hidden = np.zeros(u.shape, bool)
    for row, column in np.argwhere(np.isfinite(seen.depth) & (seen.depth < limit * (1 - SLACK))):
        quad = patch(seen, row, column) @ local_of.T
        if (quad[:, 2] < local[2]).all():
            way = (local[2] - lift) / (local[2] - quad[:, 2])
            hidden |= in_quad(local[:2] + way[:, None] * (quad[:, :2] - local[:2]), u, v)
    return 1 - hidden[counted].mean()


def patch(seen, row, column):
    """Return the corners of a texel at its depth, world axes from the map's centre, (4, 3)."""
    places = np.array([(row, column), (row, column + 1), (row + 1, column + 1), (row + 1, column)])
    t, s = (places * 2 / len(seen.depth) - 1).T
    square = s * s + t * t
    toward = np.stack([2 * s, 2 * t, 1 - square], axis=1) / (1 + square)[:, None]
    return seen.depth[row, column] * toward @ seen.frame


def in_quad(quad, u, v):
    """Tell which places lie in a convex quadrilateral, wound either way."""
    sides = []
    for (a, b), (c, d) in zip(quad, np.roll(quad, -1, axis=0), strict=True):
        sides.append((c - a) * (v - b) - (d - b) * (u - a))
    sides = np.array(sides)
    return (sides >= 0).all(axis=0) | (sides <= 0).all(axis=0)

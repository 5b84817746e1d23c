"""The whole of clustered visibility (Dong et al. 2009) by plain loops, one number at a time, in float64.

Written from the paper and from its calibrated form: k-means over positions and normals, bounding rectangles, paraboloid
maps by a ray for each texel, visibility by a step or a Fourier series over discs of texels, the sum over all lights,
interleaved sampling and the blur. Slow on purpose; for scenes of some dozen triangles and pixels.
"""

import math
from typing import NamedTuple

STEEPEST = math.radians(80)  # half-angle of the widest cone in which blockers are searched
LIFT = 4e-6  # of map centres off their lights, as a share of the lit surfaces' largest coordinate
NEAR = 0.6  # share of a cluster's radius within which nothing blocks
LEAST_RATIO = 1.05  # farthest over nearest of what a map holds, on the scale of its depths
SLACK = 1e-3  # share of its distance by which a blocker lies before a receiver
NO_BLOCKER = 0.02  # share of the search disc below which the series has found none


class AreaLight(NamedTuple):
    """One cluster of lights, as a rectangle."""

    center: list
    normal: list
    right: list
    down: list
    delta: float
    radius: float
    members: list


class Map(NamedTuple):
    """Radial depths around one area light; nothing seen: infinity."""

    depth: list  # n rows of n
    near: float  # nearest and farthest of what it holds
    far: float
    scene_far: float  # farthest corner of what takes part


# vectors


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def minus(a, b):
    return [a[0] - b[0], a[1] - b[1], a[2] - b[2]]


def plus(a, b, factor=1.0):
    return [a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def length(a):
    return math.sqrt(dot(a, a))


def unit(a):
    size = length(a)
    return [a[0] / size, a[1] / size, a[2] / size]


def angle_between(a, b):
    return math.acos(min(1.0, max(-1.0, dot(a, b))))


# Sec. 5, clustering


def k_means(positions, normals, count, diagonal, weight_x=0.7, weight_a=0.3, rounds=50):
    """Return centres, normals and C(i) under d = w_x |dx| / diagonal + w_a angle / pi."""
    n = len(positions)
    count = min(count, n)
    centers = [list(positions[k * n // count]) for k in range(count)]
    axes = [list(normals[k * n // count]) for k in range(count)]
    before = None
    for _ in range(rounds):
        of = nearest_clusters(positions, normals, centers, axes, diagonal, weight_x, weight_a)
        if of == before:
            break
        before = of
        for k in range(count):
            members = [i for i in range(n) if of[i] == k]
            if members:
                centers[k] = mean(positions, members)
                axis = mean(normals, members)
                axes[k] = unit(axis) if length(axis) > 1e-12 else axes[k]
    return centers, axes, nearest_clusters(positions, normals, centers, axes, diagonal, weight_x, weight_a)


def nearest_clusters(positions, normals, centers, axes, diagonal, weight_x, weight_a):
    """Return the nearest cluster of each light, the lowest of equally near ones."""
    of = []
    for position, normal in zip(positions, normals, strict=True):
        best, least = 0, math.inf
        for k in range(len(centers)):
            distance = weight_x * length(minus(position, centers[k])) / diagonal
            distance += weight_a * angle_between(normal, axes[k]) / math.pi
            if distance < least:
                best, least = k, distance
        of.append(best)
    return of


def mean(vectors, members):
    total = [0.0, 0.0, 0.0]
    for i in members:
        total = plus(total, vectors[i])
    return [x / len(members) for x in total]


# Sec. 6, area


def view_frame(forward):
    """Return right and down of a view whose up is +y, or -z where it looks along y."""
    up = [0.0, 1.0, 0.0] if abs(forward[1]) < 0.999 else [0.0, 0.0, -1.0]
    right = unit(cross(forward, up))
    return right, cross(forward, right)


def area_lights(positions, centers, axes, of):
    """Return the rectangle of every cluster: bounds of its lights along right and down, Delta = sqrt(s t)."""
    areas = []
    for k in range(len(centers)):
        right, down = view_frame(axes[k])
        members = [i for i in range(len(of)) if of[i] == k]
        s = [dot(minus(positions[i], centers[k]), right) for i in members]
        t = [dot(minus(positions[i], centers[k]), down) for i in members]
        radius = max((length(minus(positions[i], centers[k])) for i in members), default=0.0)
        delta = math.sqrt((max(s) - min(s)) * (max(t) - min(t))) if members else 0.0
        areas.append(AreaLight(centers[k], axes[k], right, down, delta, radius, members))
    return areas


# Sec. 4.2, parabolic maps


def texel_place(n, row, column):
    """Return (s, t) of a texel's centre in [-1, 1]^2."""
    return (column + 0.5) * 2 / n - 1, (row + 0.5) * 2 / n - 1


def place_to_direction(area, s, t):
    """Return the direction that (x, y) / (1 + z) = (s, t) stands for."""
    k = 1 + s * s + t * t
    along = [x * (1 - s * s - t * t) / k for x in area.normal]
    return plus(plus(along, area.right, 2 * s / k), area.down, 2 * t / k)


def is_between(triangle, points, tolerance):
    """Tell whether a triangle may lie between two of some points: they lie on both sides of its plane."""
    normal = unit(cross(minus(triangle[1], triangle[0]), minus(triangle[2], triangle[0])))
    heights = [dot(normal, minus(v, triangle[0])) for v in points]
    return max(heights) > tolerance and min(heights) < -tolerance


def hit_distance(triangle, origin, direction, least):
    """Return the distance to a triangle along a unit direction, infinity for a miss or a hit nearer than `least`."""
    e1, e2, s = minus(triangle[1], triangle[0]), minus(triangle[2], triangle[0]), minus(origin, triangle[0])
    p = cross(direction, e2)
    volume = dot(e1, p)
    if volume == 0:
        return math.inf
    u, q = dot(s, p) / volume, cross(s, e1)
    v = dot(direction, q) / volume
    tau = dot(e2, q) / volume
    return tau if u >= 0 and v >= 0 and u + v <= 1 and tau > 0 and tau >= least else math.inf


def box_of(points):
    """Return the least and the greatest of each coordinate."""
    return [min(p[axis] for p in points) for axis in range(3)], [max(p[axis] for p in points) for axis in range(3)]


def diagonal_of(box):
    return length(minus(box[1], box[0]))


def lifted(area, box):
    """Return the area light with its centre where its map looks from; `box` is that of what is lit."""
    largest = max(abs(x) for corner in box for x in corner)
    return area._replace(center=plus(area.center, area.normal, LIFT * largest))


def depth_map(area, triangles, n, ends, box, tolerance):
    """Cast a ray for each texel inside the unit disc, past what lies between none of `ends` or is too near."""
    kept = [t for t in triangles if is_between(t, ends, tolerance)]
    depth = [[math.inf] * n for _ in range(n)]
    for row in range(n):
        for column in range(n):
            s, t = texel_place(n, row, column)
            if s * s + t * t <= 1:
                w = place_to_direction(area, s, t)
                hits = [hit_distance(k, area.center, w, NEAR * area.radius) for k in kept]
                depth[row][column] = min(hits, default=math.inf)
    low, high = box
    corner = math.sqrt(sum(max(abs(low[a] - area.center[a]), abs(high[a] - area.center[a])) ** 2 for a in range(3)))
    held = [z for line in depth for z in line if z < math.inf]
    return Map(depth, min(held, default=math.inf), max(held, default=0.0), corner)


# Sec. 4.1, visibility


def disc_of_cone(area, x, half_angle):
    """Return centre (s, t) and radius of the disc that a cone around the direction to x is on the map."""
    local = minus(x, area.center)
    a, b, c = dot(local, area.right), dot(local, area.down), dot(local, area.normal)
    d = length(local)
    sine, cosine = math.hypot(a, b) / d, c / d
    middle = sine / (cosine + math.cos(half_angle))
    size = math.hypot(a, b)
    s, t = (middle * a / size, middle * b / size) if size > 0 else (0.0, 0.0)
    return s, t, math.sin(half_angle) / (cosine + math.cos(half_angle))


def nearest_texel(n, s, t):
    return min(max(math.floor((t + 1) / 2 * n), 0), n - 1), min(max(math.floor((s + 1) / 2 * n), 0), n - 1)


def texels_in_disc(n, s, t, radius):
    """Return the texels whose centres lie in a disc and in the hemisphere; the nearest one where there is none."""
    found = []
    for row in range(n):
        for column in range(n):
            a, b = texel_place(n, row, column)
            if a * a + b * b <= 1 and (a - s) ** 2 + (b - t) ** 2 <= radius * radius:
                found.append((row, column))
    return found or [nearest_texel(n, s, t)]


def distance_to_plane(area, x, facing, direction):
    """Return how far from the centre a direction meets the receiver's plane; that of x itself where it does not."""
    approach, height = dot(direction, facing), dot(minus(x, area.center), facing)
    return height / approach if approach * height > 0 else length(minus(x, area.center))


def is_blocked(area, seen, x, facing, row, column):
    """True step: what is stored is nearer than the receiver's plane in the texel's own direction."""
    w = place_to_direction(area, *texel_place(len(seen.depth), row, column))
    return seen.depth[row][column] < distance_to_plane(area, x, facing, w) * (1 - SLACK)


def in_cone(area, seen, x, row, column):
    """Tell whether a texel, half its diagonal around its centre, touches the cone from x to a disc of width Delta."""
    n = len(seen.depth)
    place, z = texel_place(n, row, column), seen.depth[row][column]
    p, axis = [z * k for k in place_to_direction(area, *place)], unit(minus(x, area.center))
    s, d = dot(p, axis), length(minus(x, area.center))
    half_diagonal = z * math.sqrt(2) * 2 / n / (1 + place[0] ** 2 + place[1] ** 2)
    return s < d and length(plus(p, axis, -s)) - half_diagonal <= area.delta / 2 * (1 - s / d)


def half_angle(delta, d, z):
    """tan a = Delta (d - z) / (2 d z): half of what a point at depth z blurs over, seen from the centre."""
    return math.atan(delta * (d - z) / (2 * d * z))


def is_behind(area, x):
    return dot(minus(x, area.center), area.normal) <= 0


def hard(area, seen, x, facing):
    """Return 0 or 1 from the one texel that x falls into; its surface must be nearer than x itself as well."""
    if is_behind(area, x):
        return 1.0
    s, t, _ = disc_of_cone(area, x, 0.0)
    row, column = nearest_texel(len(seen.depth), s, t)
    before = seen.depth[row][column] < length(minus(x, area.center)) * (1 - SLACK)
    return 0.0 if before and is_blocked(area, seen, x, facing, row, column) else 1.0


def pcf(area, seen, x, facing, texels):
    """Return the share of texels x texels around the one that x falls into that do not hide x."""
    if is_behind(area, x):
        return 1.0
    n, half = len(seen.depth), texels // 2
    s, t, _ = disc_of_cone(area, x, 0.0)
    own = nearest_texel(n, s, t)
    tested, blocked = 0, 0
    for row in range(own[0] - half, own[0] + half + 1):
        for column in range(own[1] - half, own[1] + half + 1):
            a, b = texel_place(n, row, column)
            if 0 <= row < n and 0 <= column < n and ((row, column) == own or a * a + b * b <= 1):
                before = seen.depth[row][column] < length(minus(x, area.center)) * (1 - SLACK)
                tested += 1
                blocked += before and is_blocked(area, seen, x, facing, row, column)
    return 1 - blocked / tested


def pcss(area, seen, x, facing, cone=True):
    """Return V by depth tests of texels: search, mean depth of blockers, share of the final disc that is free."""
    d = length(minus(x, area.center))
    if is_behind(area, x) or seen.near >= d:
        return 1.0
    n = len(seen.depth)
    search = texels_in_disc(n, *disc_of_cone(area, x, min(half_angle(area.delta, d, seen.near), STEEPEST)))
    blockers = [(row, column) for row, column in search if is_blocked(area, seen, x, facing, row, column)
                and (not cone or in_cone(area, seen, x, row, column))]
    if not blockers:
        return 1.0
    z_avg = sum(seen.depth[row][column] for row, column in blockers) / len(blockers)
    z_avg = min(max(z_avg, seen.near), d)
    final = texels_in_disc(n, *disc_of_cone(area, x, half_angle(area.delta, d, z_avg)))
    return 1 - sum(is_blocked(area, seen, x, facing, row, column) for row, column in final) / len(final)


def series_value(gap, terms, attenuation=0.0):
    """f_M(z - d) = 1/2 + 2 sum (L_k / c_k) sin(c_k (z - d))."""
    total = 0.5
    for k in range(1, terms + 1):
        c = (2 * k - 1) * math.pi
        total += 2 * math.exp(-attenuation * (k / terms) ** 2) / c * math.sin(c * gap)
    return total


def first_crossing(terms):
    """b*: the first gap at which the series is 1, by bisection up to its first maximum at 1 / (2 M)."""
    low, high = 0.0, 0.5 / terms
    for _ in range(200):
        middle = (low + high) / 2
        low, high = (middle, high) if series_value(middle, terms) < 1 else (low, middle)
    return (low + high) / 2


def on_scale(z, seen, kind, bias):
    """Return the depth of a distance: 0 to `top` for what the map holds, up to 1 - 2 b* for all beyond.

    `top` is 2 b* below the end, so that the farthest blocker still hides what lies beyond wholly, or half of the end
    where so few terms leave no room for that. "scene": a share of the farthest distance of what takes part.
    """
    end = 1 - 2 * bias
    if z == math.inf:
        return end
    if kind == "scene":
        return min(end * z / seen.scene_far, end)
    top, far = max(end - 2 * bias, end / 2), max(seen.far, LEAST_RATIO * seen.near)
    if kind == "log_map":
        return min(top * math.log(z / seen.near) / math.log(far / seen.near), end)
    return min(top * (z - seen.near) / (far - seen.near), end)


def off_scale(t, seen, kind, bias):
    """Return the distance of a depth."""
    end = 1 - 2 * bias
    if kind == "scene":
        return t * seen.scene_far / end
    top, far = max(end - 2 * bias, end / 2), max(seen.far, LEAST_RATIO * seen.near)
    if kind == "log_map":
        return seen.near * (far / seen.near) ** (t / top)
    return seen.near + t / top * (far - seen.near)


def csm(area, seen, x, terms, kind="log_map"):
    """Return V by M terms of the Fourier series of the step, prefiltered over discs, depths on a scale of some kind."""
    d = length(minus(x, area.center))
    if is_behind(area, x) or seen.near >= d:
        return 1.0
    n, bias = len(seen.depth), first_crossing(terms)
    shifted = on_scale(d, seen, kind, bias) - bias
    stored = [[on_scale(z, seen, kind, bias) for z in line] for line in seen.depth]
    search = texels_in_disc(n, *disc_of_cone(area, x, min(half_angle(area.delta, d, seen.near), STEEPEST)))
    lit = mean_of_series(stored, search, shifted, terms, weighted=False)
    if 1 - lit < NO_BLOCKER:
        return 1.0
    mean_depth = sum(stored[row][column] for row, column in search) / len(search)
    blocked_depth = mean_depth - mean_of_series(stored, search, shifted, terms, weighted=True)
    z_avg = min(max(off_scale(blocked_depth / (1 - lit), seen, kind, bias), seen.near), d)
    final = texels_in_disc(n, *disc_of_cone(area, x, half_angle(area.delta, d, z_avg)))
    return min(max(mean_of_series(stored, final, shifted, terms, weighted=False), 0.0), 1.0)


def mean_of_series(stored, texels, shifted, terms, weighted):
    """Return the mean of f_M over texels, or that of z f_M."""
    total = 0.0
    for row, column in texels:
        z = stored[row][column]
        total += series_value(z - shifted, terms) * (z if weighted else 1.0)
    return total / len(texels)


# Sec. 4, Eq. 3: light


def pair(x, normal, position, light_normal):
    """Return cos cos / r^2, 0 where either faces away."""
    toward = minus(position, x)
    r2 = dot(toward, toward)
    if r2 == 0:
        return 0.0
    return max(dot(toward, normal), 0.0) * max(-dot(toward, light_normal), 0.0) / (r2 * r2)


def irradiance(pixels, lights, areas, visible, block=1):
    """Return E of each pixel (row, column) -> (position, normal, facing), each with the lights of its place in a block.

    `visible(m, x, facing)` is V of area light m; `lights` holds positions, normals and fluxes.
    """
    positions, normals, fluxes = lights
    result = {}
    for (row, column), (x, normal, facing) in pixels.items():
        total = [0.0, 0.0, 0.0]
        for m, area in enumerate(areas):
            part = [0.0, 0.0, 0.0]
            for i in area.members:
                if i % (block * block) == (row % block) * block + column % block:
                    part = plus(part, fluxes[i], pair(x, normal, positions[i], normals[i]) / math.pi)
            if any(part):
                total = plus(total, part, visible(m, x, facing) * block * block)
        result[row, column] = total
    return result


# Sec. 6, geometry-aware blur


def window(middle, block, size):
    """Return block places around one, moved inwards at the ends."""
    first = max(0, min(middle - block // 2, size - block))
    return range(first, min(first + block, size))


def blurred(light, pixels, block, size, extent, cosine):
    """Return means over windows of block x block of size pixels each way, of those near and alike in normal."""
    result = {}
    for (row, column), (x, normal, _) in pixels.items():
        total, count = [0.0, 0.0, 0.0], 0
        for i in window(row, block, size):
            for j in window(column, block, size):
                if (i, j) in pixels:
                    other, other_normal, _ = pixels[i, j]
                    if length(minus(other, x)) <= extent and dot(normal, other_normal) >= cosine:
                        total, count = plus(total, light[i, j]), count + 1
        result[row, column] = [k / count for k in total]
    return result

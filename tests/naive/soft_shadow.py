"""Slow literal twin of soft shadows on a stereographic depth map: plain loops over texels and terms, angles and all.

A map is n rows of n radial depths (inf: nothing seen) around the origin, +z forward; texel centres lie at
((j + 1/2) 2/n - 1, (i + 1/2) 2/n - 1). A light of size `delta` lies in the plane z = 0.
"""

import math

from tests.naive.area_visibility import farthest

CAP = math.radians(80)
NOTHING = 0.02
SLACK = 1e-3


def frequency(k):
    """c_k = (2 k - 1) pi."""
    return (2 * k - 1) * math.pi


def step_series(d, z, terms, attenuation=0.0):
    """f_M(d, z) = 1/2 + 2 sum_k (L_k / c_k) sin(c_k (z - d))."""
    total = 0.5
    for k in range(1, terms + 1):
        total += 2 * math.exp(-attenuation * (k / terms) ** 2) / frequency(k) * math.sin(frequency(k) * (z - d))
    return total


def first_one(terms):
    """The first z - d at which the plain series is 1, by walking and halving."""
    step = 0.01 / terms
    u = step
    while step_series(0, u, terms) < 1:
        u += step
    low, high = u - step, u
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if step_series(0, middle, terms) < 1 else (low, middle)
    return high


def place(n, row, column):
    """(s, t) of a texel's centre."""
    return (column + 0.5) * 2 / n - 1, (row + 0.5) * 2 / n - 1


def direction(s, t):
    """Unit vector that a place of the map stands for."""
    q = s * s + t * t
    return 2 * s / (1 + q), 2 * t / (1 + q), (1 - q) / (1 + q)


def cone_disc(x, y, z, a):
    """Centre and radius of the disc that a cone of half-angle a around (x, y, z) is on the map, from its two ends."""
    theta, phi = math.atan2(math.hypot(x, y), z), math.atan2(y, x)
    inner, outer = math.tan((theta - a) / 2), math.tan((theta + a) / 2)  # stereographic: radius tan(angle / 2)
    middle = (inner + outer) / 2
    return middle * math.cos(phi), middle * math.sin(phi), (outer - inner) / 2


def search_angle(delta, d, near):
    """Half-angle of the search, of the nearest depth."""
    return min(math.atan(delta * (d - near) / (2 * d * near)), CAP) if d > near else 0.0


def texels_in(n, s, t, radius):
    """Texels of the hemisphere with their centre in the disc, or the one that holds its middle."""
    found = []
    for i in range(n):
        for j in range(n):
            u, v = place(n, i, j)
            if (u - s) ** 2 + (v - t) ** 2 <= radius**2 and u * u + v * v <= 1:
                found.append((i, j))
    if not found:
        found = [(min(max(int((t + 1) / 2 * n), 0), n - 1), min(max(int((s + 1) / 2 * n), 0), n - 1))]
    return found


def map_near(depth):
    """Smallest depth of a map."""
    return min(min(row) for row in depth)


def scales(depth, kind, scene_far, first, bias):
    """(to, back): metres to the series' depths and back, on the scale of what a map holds or of the scene."""
    end = 1 - first - max(first, bias)
    top = max(end - first - max(first, bias), end / 2)
    held = [z for row in depth for z in row if z < math.inf]
    near = min(held)
    far = max(*held, 1.05 * near)
    if kind == "scene":
        return lambda z: min(z * end / scene_far, end), lambda t: t * scene_far / end
    if kind == "map":
        return lambda z: min((z - near) * top / (far - near), end), lambda t: near + t / top * (far - near)
    octaves = math.log2(far / near)
    return (lambda z: min(math.log2(z / near) * top / octaves, end)), lambda t: near * 2 ** (t / top * octaves)


def series_shadow(depth, point, delta, far, terms, bias=None, kind="log_map"):
    """(V, z_avg) by the series: each texel's own f_M, averaged; z_avg is None without blockers."""
    x, y, z = point
    d = math.sqrt(x * x + y * y + z * z)
    near, n = map_near(depth), len(depth)
    if z <= 0 or d <= near:
        return 1.0, None
    first = first_one(terms)
    b = first if bias is None else bias
    to, back = scales(depth, kind, far, first, b)

    def lit(texel):
        stored = to(depth[texel[0]][texel[1]])
        return step_series(to(d) - b, stored, terms), stored

    texels = texels_in(n, *cone_disc(x, y, z, search_angle(delta, d, near)))
    blocked = total = 0.0
    for texel in texels:
        share, stored = lit(texel)
        blocked += (1 - share) / len(texels)
        total += (1 - share) * stored / len(texels)
    if blocked < NOTHING:
        return 1.0, None
    mean = min(max(back(total / blocked), near), d)
    texels = texels_in(n, *cone_disc(x, y, z, search_angle(delta, d, mean)))
    value = sum(lit(texel)[0] for texel in texels) / len(texels)
    return min(max(value, 0.0), 1.0), mean


def step_shadow(depth, point, normal, delta, cone=True, receiver_plane=True, axial=False):
    """(V, z_avg) by the step: each texel against the receiver's plane, blockers within the cone to the light.

    `axial`: z_avg is the mean depth along the axis to the receiver, and the search as wide as any blocker asks for.
    """
    x, y, z = point
    d = math.sqrt(x * x + y * y + z * z)
    near, n = map_near(depth), len(depth)
    if z <= 0 or d <= near:
        return 1.0, None
    height = x * normal[0] + y * normal[1] + z * normal[2]

    def hides(texel):
        w = direction(*place(n, *texel))
        slope = w[0] * normal[0] + w[1] * normal[1] + w[2] * normal[2]
        limit = height / slope if receiver_plane and height * slope > 0 else d
        return depth[texel[0]][texel[1]] < limit * (1 - SLACK)

    def in_cone(texel):
        w, stored = direction(*place(n, *texel)), depth[texel[0]][texel[1]]
        along = stored * (w[0] * x + w[1] * y + w[2] * z) / d
        foot = [along * v / d for v in (x, y, z)]
        offset = math.dist([stored * v for v in w], foot)
        s, t = place(n, *texel)
        half_diagonal = stored * math.sqrt(2) * (2 / n) / (1 + s * s + t * t)
        return along < d and offset - half_diagonal <= delta / 2 * (1 - along / d)

    def stored(texel):
        w, far = direction(*place(n, *texel)), depth[texel[0]][texel[1]]
        return far * (w[0] * x + w[1] * y + w[2] * z) / d if axial else far

    wide = math.atan(farthest(delta, d, near)) if axial else search_angle(delta, d, near)
    blockers = [texel for texel in texels_in(n, *cone_disc(x, y, z, wide))
                if hides(texel) and (not cone or in_cone(texel))]
    if not blockers:
        return 1.0, None
    least = near * math.cos(CAP) if axial else near
    mean = min(max(sum(stored(texel) for texel in blockers) / len(blockers), least), d)
    texels = texels_in(n, *cone_disc(x, y, z, search_angle(delta, d, mean)))
    return 1 - sum(hides(texel) for texel in texels) / len(texels), mean


def square_share(point, delta, plates, count):
    """Share of a square light at the origin, seen past plates (x0, x1, y0, y1, z), on count x count points."""
    free = 0
    for i in range(count):
        for j in range(count):
            light = ((i + 0.5) / count - 0.5) * delta, ((j + 0.5) / count - 0.5) * delta
            hidden = False
            for x0, x1, y0, y1, z in plates:
                x = light[0] + (point[0] - light[0]) * z / point[2]
                y = light[1] + (point[1] - light[1]) * z / point[2]
                hidden = hidden or (z < point[2] and x0 <= x <= x1 and y0 <= y <= y1)
            free += not hidden
    return free / count**2

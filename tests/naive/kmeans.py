"""Slow literal twin of clustering lights into area lights (Dong et al. 2009, Sec. 5, 6)."""

import math

ZERO_MEAN = 1e-9  # a mean normal shorter than this has no direction


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def minus(a, b):
    return [a[0] - b[0], a[1] - b[1], a[2] - b[2]]


def length(a):
    return math.sqrt(dot(a, a))


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def unit(a):
    size = length(a)
    return [a[0] / size, a[1] / size, a[2] / size]


def angle(a, b):
    """Angle between two directions; atan2 instead of acos, which is blind near 0 and pi."""
    return math.atan2(length(cross(a, b)), dot(a, b))


def distance(x, n, center, normal, mode, weights, diagonal):
    """Sec. 5.1: d = w_x dx + w_a dalpha, as printed, in shares of the diagonal and of pi, or of squares."""
    dx = length(minus(x, center))
    if mode == "raw":
        return weights[0] * dx + weights[1] * angle(n, normal)
    if mode == "normalised":
        return weights[0] * dx / diagonal + weights[1] * angle(n, normal) / math.pi
    chord = length(minus(n, normal))
    return weights[0] * (dx / diagonal) ** 2 + weights[1] * chord**2


def nearest(x, n, centers, normals, mode, weights, diagonal):
    """Cluster at least distance, the lowest index on ties, and that distance."""
    best, least = 0, math.inf
    for k in range(len(centers)):
        d = distance(x, n, centers[k], normals[k], mode, weights, diagonal)
        if d < least:
            best, least = k, d
    return best, least


def means(positions, directions, of, centers, normals):
    """Averages of each cluster; without lights both stay, without a mean direction the normal stays."""
    for k in range(len(centers)):
        count, x, n = 0, [0.0] * 3, [0.0] * 3
        for i in range(len(positions)):
            if of[i] == k:
                count += 1
                for c in range(3):
                    x[c] += positions[i][c]
                    n[c] += directions[i][c]
        if count:
            centers[k] = [x[c] / count for c in range(3)]
            if length(n) > ZERO_MEAN * count:
                normals[k] = unit(n)


def cluster(positions, normals, count, mode, weights, diagonal, rounds=50, start=None):
    """P5; returns centres, normals, C(i), members and the objective before and after each round of means."""
    directions = [unit(n) for n in normals]
    total = len(positions)
    if start is None:
        count = min(count, total)
        first = [k * total // count for k in range(count)]
        centers, axes = [list(positions[i]) for i in first], [list(directions[i]) for i in first]
    else:
        centers, axes = [list(c) for c in start[0]], [unit(n) for n in start[1]]
    objective, before = [], None
    while True:
        found = [nearest(positions[i], directions[i], centers, axes, mode, weights, diagonal) for i in range(total)]
        of = [k for k, _ in found]
        objective.append(sum(d for _, d in found))
        if of == before or len(objective) > rounds:
            break
        means(positions, directions, of, centers, axes)
        before = of
    members = [of.count(k) for k in range(len(centers))]
    return centers, axes, of, members, objective


def rectangle(points, center, right, down):
    """Sec. 6: sides and middle of the bounding rectangle of points projected onto the plane of two axes."""
    s = [dot(minus(p, center), right) for p in points]
    t = [dot(minus(p, center), down) for p in points]
    return (max(s) - min(s), max(t) - min(t)), ((max(s) + min(s)) / 2, (max(t) + min(t)) / 2)


def least_rectangle(points, right, down, steps=3600):
    """Least area over `steps` rotations of the axes within a quarter turn: a little too large, never too small."""
    least = math.inf
    for step in range(steps):
        turn = math.pi / 2 * step / steps
        c, s = math.cos(turn), math.sin(turn)
        a = [c * right[i] + s * down[i] for i in range(3)]
        b = [c * down[i] - s * right[i] for i in range(3)]
        (width, height), _ = rectangle(points, [0.0, 0.0, 0.0], a, b)
        least = min(least, width * height)
    return least


def mean_angle(normals, of, axes):
    """Mean over lights of the angle to the normal of their cluster (Fig. 6)."""
    return sum(angle(normals[i], axes[of[i]]) for i in range(len(normals))) / len(normals)

"""Slow literal twin of the look-up in another view, and of the temporal filter (Sec. 3.3)."""

import math

import numpy as np

SNAP = 2.0**-8  # texels: nearer to a centre the texel counts alone


def place(point, eye, right, down, forward, tan_half_v, height, width):
    """Column, row (whole numbers at centres) and depth of a point in a perspective view with square pixels."""
    d = np.asarray(point, np.float64) - eye
    z = float(d @ forward)
    if z <= 0:
        return None
    pixel = 2 * tan_half_v / height
    return float(d @ right) / z / pixel + (width - 1) / 2, float(d @ down) / z / pixel + (height - 1) / 2, z


def same_surface(depth, ray, z, d, normal, tolerance):
    """Whether a texel's depth is the point's, or that of the point's tangent plane along the texel's ray."""
    if abs(depth - z) <= tolerance * z:
        return True
    slant = float(normal @ ray)
    return slant < 0 and abs(depth - float(normal @ d) / slant) <= tolerance * z


def reproject(values, depth, normal_there, point, normal, view, depth_tolerance, normal_cosine, fetch="bilinear"):
    """Mean value and weight of the four texels around a point that show its surface, or of the nearest alone."""
    height, width = depth.shape
    seen = place(point, *view, height, width)
    if seen is None:
        return np.zeros(3), 0.0
    x, y, z = seen
    if not (-0.5 <= x <= width - 0.5 and -0.5 <= y <= height - 0.5):
        return np.zeros(3), 0.0
    eye, right, down, forward, tan_half_v = view
    pixel = 2 * tan_half_v / height
    x, y = (round(c) if abs(c - round(c)) <= SNAP or fetch == "nearest" else c for c in (x, y))
    total, weight = np.zeros(3), 0.0
    for i in range(math.floor(y), math.floor(y) + 2):
        for j in range(math.floor(x), math.floor(x) + 2):
            share = (1 - abs(x - j)) * (1 - abs(y - i))
            if 0 <= i < height and 0 <= j < width and share > 0 and np.isfinite(depth[i, j]):
                ray = forward + pixel * ((j - (width - 1) / 2) * right + (i - (height - 1) / 2) * down)
                near = same_surface(depth[i, j], ray, z, np.subtract(point, eye), normal, depth_tolerance)
                if near and float(normal_there[:, i, j] @ normal) >= normal_cosine:
                    total += share * values[:, i, j]
                    weight += share
    return (total / weight if weight > 0 else total), weight


def recursion(frames, a):
    """F_0 = I_0, F_i = a F_{i-1} + (1 - a) I_i."""
    light = frames[0]
    for new in frames[1:]:
        light = a * light + (1 - a) * new
    return light

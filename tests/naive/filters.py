"""Slow literal twins: the series' basis of a depth map, its means over discs and boxes, mip maps and 8 bits.

A map holds t = depth as a share of the range, row by row; texel centres lie at ((j + 1/2) 2/n - 1, (i + 1/2) 2/n - 1).
"""

import math
import struct

import numpy as np


def normalised(depth, scale, most):
    """Depth over the range, with nothing (inf) and all beyond the range at its far end."""
    return np.array([[min(float(z) * scale, most) if math.isfinite(z) else most for z in row] for row in depth])


def frequency(k):
    """c_k = (2 k - 1) pi."""
    return (2 * k - 1) * math.pi


def channels(t, terms):
    """S_1..S_M, C_1..C_M, SZ_1..SZ_M, CZ_1..CZ_M, Z of one depth."""
    sines = [math.sin(frequency(k) * t) for k in range(1, terms + 1)]
    cosines = [math.cos(frequency(k) * t) for k in range(1, terms + 1)]
    return np.array([*sines, *cosines, *(t * v for v in sines), *(t * v for v in cosines), t])


def planes(t, terms):
    """Channels of every texel, (n, n, 4 M + 1)."""
    return np.array([[channels(z, terms) for z in row] for row in t])


def step_series(d, z, terms, attenuation=0.0):
    """f_M(d, z) = 1/2 + 2 sum_k L_k / c_k sin(c_k (z - d)): 1 where d lies before z."""
    total = 0.5
    for k in range(1, terms + 1):
        factor = math.exp(-attenuation * (k / terms) ** 2)
        total += 2 * factor / frequency(k) * math.sin(frequency(k) * (z - d))
    return total


def seen_share(means, d, terms):
    """V = 1/2 + 2 sum_k (cos(c_k d) S_k - sin(c_k d) C_k) / c_k from means of the channels."""
    total = 0.5
    for k in range(1, terms + 1):
        c = frequency(k)
        total += 2 / c * (math.cos(c * d) * means[k - 1] - math.sin(c * d) * means[terms + k - 1])
    return total


def blocker_sum(means, d, terms):
    """Mean of (1 - f) z: Z/2 - 2 sum_k (cos(c_k d) SZ_k - sin(c_k d) CZ_k) / c_k."""
    total = 0.5 * means[4 * terms]
    for k in range(1, terms + 1):
        c = frequency(k)
        total -= 2 / c * (math.cos(c * d) * means[2 * terms + k - 1] - math.sin(c * d) * means[3 * terms + k - 1])
    return total


def centre(i, n):
    """Coordinate of the middle of texel i, in -1 to 1."""
    return (i + 0.5) * 2 / n - 1


def disc_mean(values, s, t, radius):
    """Mean over texels with their centre in the disc and in the unit disc, or the nearest texel of the map."""
    n = len(values)
    total, count = np.zeros(values.shape[2]), 0
    own = tuple(min(range(n), key=lambda i: abs(centre(i, n) - at)) for at in (t, s))
    for i in range(n):
        for j in range(n):
            x, y = centre(j, n), centre(i, n)
            if x * x + y * y <= 1 and (x - s) ** 2 + (y - t) ** 2 <= radius**2:
                total += values[i, j]
                count += 1
    return total / count if count else values[own]


def box_mean(values, s, t, radius):
    """Mean over the part within the map of the box that the disc inscribes, at least a texel wide.

    A texel counts by the area of it that the box holds. A box beyond the map is moved to have its middle on the edge.
    """
    n = len(values)
    half = max(radius, 1 / n)
    s, t = min(max(s, -1), 1), min(max(t, -1), 1)
    total, area = np.zeros(values.shape[2]), 0.0
    for i in range(n):
        for j in range(n):
            x, y = 2 * j / n - 1, 2 * i / n - 1
            width = min(x + 2 / n, s + half) - max(x, s - half)
            height = min(y + 2 / n, t + half) - max(y, t - half)
            if width > 0 and height > 0:
                total += width * height * values[i, j]
                area += width * height
    return total / area


def mip_levels(values):
    """Halve a map until one texel is left; where the side is odd, the last texel counts twice."""
    levels = [np.asarray(values)]
    while len(levels[-1]) > 1:
        fine = levels[-1]
        n = len(fine)
        half = (n + 1) // 2
        coarse = np.zeros((half, half, fine.shape[2]))
        for i in range(half):
            for j in range(half):
                below, right = min(2 * i + 1, n - 1), min(2 * j + 1, n - 1)
                coarse[i, j] = (fine[2 * i, 2 * j] + fine[2 * i, right] + fine[below, 2 * j] + fine[below, right]) / 4
        levels.append(coarse)
    return levels


def bilinear(level, x, y):
    """Value at the continuous texel coordinates (x, y), centres at + 1/2, beyond the last centres constant."""
    n = len(level)
    x, y = min(max(x - 0.5, 0), n - 1), min(max(y - 0.5, 0), n - 1)
    j, i = int(x), int(y)
    fx, fy = x - j, y - i
    right, below = min(j + 1, n - 1), min(i + 1, n - 1)
    above = (1 - fx) * level[i, j] + fx * level[i, right]
    return (1 - fy) * above + fy * ((1 - fx) * level[below, j] + fx * level[below, right])


def trilinear(levels, s, t, radius, shift=0.0):
    """Value between the two levels around log2 of the diameter in texels."""
    n = len(levels[0])
    diameter = radius * n
    level = min(max(math.log2(diameter) + shift, 0), len(levels) - 1) if diameter > 0 else 0.0
    fine = min(int(level), max(len(levels) - 2, 0))
    x, y = (s + 1) / 2 * n, (t + 1) / 2 * n
    one = bilinear(levels[fine], x / 2**fine, y / 2**fine)
    if fine + 1 == len(levels):
        return one
    other = bilinear(levels[fine + 1], x / 2 ** (fine + 1), y / 2 ** (fine + 1))
    return one + (level - fine) * (other - one)


def eight_bits(value):
    """What is left of a number of [-1, 1] that is stored as a whole number of 0 to 255; halves are rounded up.

    Whether a number lies half way is known to 1e-4 of a step, so that its last bit decides nothing.
    """
    return math.floor((value + 1) / 2 * 255 + 0.5001) / 255 * 2 - 1


def half_precision(value):
    """What is left of a number stored in 16 bits; the standard library rounds to nearest, ties to even."""
    return struct.unpack("e", struct.pack("e", value))[0]


def nearest_in_disc(depth, s, t, radius):
    """Smallest depth of all texels that the disc touches with any part of theirs."""
    n = len(depth)
    least = math.inf
    for i in range(n):
        for j in range(n):
            x = min(max(s, 2 * j / n - 1), 2 * (j + 1) / n - 1) - s
            y = min(max(t, 2 * i / n - 1), 2 * (i + 1) / n - 1) - t
            if x * x + y * y <= radius**2:
                least = min(least, depth[i, j])
    return least


def mirrored(depth):
    """Give texels beyond the unit disc the depth in the direction (x, y, -z): (s, t) over its squared length.

    What would fall within a texel and a half of the rim comes from there.
    """
    n = len(depth)
    out = np.array(depth, float)
    for i in range(n):
        for j in range(n):
            x, y = centre(j, n), centre(i, n)
            length = math.sqrt(x * x + y * y)
            if length > 1:
                scale = min(1 / length, 1 - 1.5 / n) / length
                out[i, j] = depth[int((y * scale + 1) * n / 2), int((x * scale + 1) * n / 2)]
    return out

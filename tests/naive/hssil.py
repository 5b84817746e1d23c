"""Hierarchical screen-space indirect illumination once more, slowly: one texel and one sample at a time, in float64.

Written from the paper (Sec. 3.1 to 4) and its corrected formulas alone. A texel is a dict: place (from the eye, m),
depth (m), normal, radiance (of each channel, W/m^2/sr), area (m^2), pixel (row, column) it stands at. What no surface
covers is None. A level is a list of rows of texels.
"""

import math

import numpy as np

LEAST = 1e-20  # smaller sums of weights are none


def first_texels(depth, normal, radiance, frame, half, tan_f=False):
    """Return the picture as a level: positions from depths and pixel centres, areas by Eq. 2 with dP = 1 pixel.

    `frame` holds the unit vectors right, down and forward, `half` the tangents of half the fields of view.
    """
    height, width = depth.shape
    texels = [[None] * width for _ in range(height)]
    for row in range(height):
        for column in range(width):
            z = float(depth[row, column])
            if not math.isfinite(z):
                continue
            u, v = half[0] * (2 * column + 1 - width) / width, half[1] * (2 * row + 1 - height) / height
            place = z * (u * frame[0] + v * frame[1] + frame[2])
            up = normal[:, row, column].astype(float)
            texels[row][column] = {"place": place, "depth": z, "normal": up, "pixel": (row, column),
                                   "radiance": radiance[:, row, column].astype(float),
                                   "area": sample_area(place, z, up, half, (height, width), tan_f)}
    return texels


def sample_area(place, z, normal, half, shape, tan_f=False):
    """Eq. 2: z^2 4 tan(f_h / 2) tan(f_v / 2) / (W H) cos alpha / cos beta; Eq. 3 prints tan f for tan(f / 2)."""
    far = math.sqrt(place @ place)
    cos_alpha, cos_beta = z / far, -(normal @ place) / far
    if cos_beta <= 0:
        return 0.0
    t_h, t_v = (math.tan(2 * math.atan(t)) if tan_f else t for t in half)
    return z * z * 4 * t_h * t_v / (shape[0] * shape[1]) * cos_alpha / cos_beta


def level(texels, k, mode):
    """Return level k of a picture; texel (i, j) stands for the pixels [2^k i, 2^k (i + 1)) x [2^k j, ...) there are."""
    if k == 0:
        return texels
    if mode == "average":
        return averages(level(texels, k - 1, mode))
    size, height, width = 2**k, len(texels), len(texels[0])
    made = []
    for i in range(-(-height // size)):
        made.append([])
        for j in range(-(-width // size)):
            block = [texels[row][column] for row in range(size * i, min(size * i + size, height))
                     for column in range(size * j, min(size * j + size, width))]
            covered = [texel for texel in block if texel is not None]
            if not covered:
                made[-1].append(None)
                continue
            # the least depth; then nearest to the vertical centre line, then the upper row
            nearest = min(covered, key=lambda t: (t["depth"], abs(2 * t["pixel"][1] + 1 - width), t["pixel"]))
            kept = dict(nearest, area=nearest["area"] * len(block))
            if mode == "closest_average":
                kept["radiance"] = sum(texel["radiance"] for texel in covered) / len(covered)
            made[-1].append(kept)
    return made


def averages(below):
    """Return the level above: areas added, all else averaged by area, normals of unit length again."""
    height, width = len(below), len(below[0])
    made = []
    for i in range((height + 1) // 2):
        made.append([])
        for j in range((width + 1) // 2):
            block = [below[row][column] for row in range(2 * i, min(2 * i + 2, height))
                     for column in range(2 * j, min(2 * j + 2, width)) if below[row][column] is not None]
            area = sum(texel["area"] for texel in block)
            if area == 0:
                made[-1].append(None)
                continue
            mean = {key: sum(texel["area"] * texel[key] for texel in block) / area
                    for key in ("place", "depth", "normal", "radiance")}
            length = math.sqrt(mean["normal"] @ mean["normal"])
            made[-1].append(dict(mean, normal=mean["normal"] / length if length else mean["normal"], area=area,
                                 pixel=block[0]["pixel"]))
    return made


def everything(r, index, shape):
    """Return each offset once with weight 1: the disc below 2 r at the first level, the crown from r on at others."""
    height, width = shape
    return [(ox, oy, 1.0) for oy in range(1 - height, height) for ox in range(1 - width, width)
            if (ox, oy) != (0, 0) and math.hypot(ox, oy) < 2 * r and (index == 0 or math.hypot(ox, oy) >= r)]


def weighted(offsets, inner, r):
    """Give samples the texels they stand for: the first `inner` share the disc, pi r^2, others the crown, 3 pi r^2."""
    crown = len(offsets) - inner
    return [(ox, oy, math.pi * r * r / inner if i < inner else 3 * math.pi * r * r / crown)
            for i, (ox, oy) in enumerate(offsets)]


def received(x, y, w, form, disc_pi=False):
    """Return what a texel x receives of a sample y that stands for w texels: Eq. 4 ("disc") or Eq. 3 ("point")."""
    d = y["place"] - x["place"]
    r2 = d @ d
    if r2 == 0:
        return np.zeros(3)
    r = math.sqrt(r2)
    cos_x, cos_y = max(0.0, x["normal"] @ d / r), max(0.0, -(y["normal"] @ d) / r)
    ds = y["area"] * w
    if form == "point":
        return y["radiance"] * cos_x * cos_y * ds / r2
    disc = cos_y * ds / math.pi  # R^2
    return (1 if disc_pi else math.pi) * y["radiance"] * cos_x * disc / (r2 + disc)


def gathered(texels, offsets_at, form, disc_pi=False):
    """Return the irradiance of each texel of a level, (3, h, w); what is off the picture or empty gives nothing."""
    height, width = len(texels), len(texels[0])
    light = np.zeros((3, height, width))
    for row in range(height):
        for column in range(width):
            for ox, oy, w in offsets_at(row, column) if texels[row][column] is not None else ():
                i, j = row + oy, column + ox
                if (ox, oy) != (0, 0) and 0 <= i < height and 0 <= j < width and texels[i][j] is not None:
                    light[:, row, column] += received(texels[row][column], texels[i][j], w, form, disc_pi)
    return light


def upsampled(coarse, below, here, factor, kind, agreement, lean):
    """Carry light from a level to one that is finer by a factor.

    Tents of the three by three taps around a texel's centre, 0 where a tap is empty, for "bilateral" times
    `agreement(cosine of normals, off)`, over their sum; `off` is the share by which a tap's nearness 1/z is off the
    plane through the receiver. Where the sum vanishes, the tap that is least off is taken. A tap stands where its texel
    is closest if `lean`, else in its middle.
    """
    light = np.zeros((3, len(here), len(here[0])))
    for row in range(len(here)):
        for column in range(len(here[0])):
            if here[row][column] is not None:
                light[:, row, column] = one_upsampled(coarse, below, here, (row, column), factor, kind, agreement, lean)
    return light


def one_upsampled(coarse, below, here, at, factor, kind, agreement, lean):
    texel, (row, column) = here[at[0]][at[1]], at
    if kind == "nearest":
        return coarse[:, row // factor, column // factor]
    y, x = (row + 0.5) / factor - 0.5, (column + 0.5) / factor - 0.5
    taps = [(i, j, tent(i - y, y, kind) * tent(j - x, x, kind)) for i in around(y, len(below))
            for j in around(x, len(below[0])) if below[i][j] is not None]
    if not taps:
        return np.zeros(3)
    if kind == "bilateral":
        down, across = (factor * slope(here, row, column, axis) for axis in (0, 1))
        nearer = (factor - 1) / (2 * factor) * (abs(down) + abs(across)) if lean else 0.0
        weighed = []
        for i, j, weight in taps:
            plane = 1 / texel["depth"] + (i - y) * down + (j - x) * across + nearer
            off = texel["depth"] * (1 / below[i][j]["depth"] - plane)
            weighed.append((i, j, weight * agreement(max(0.0, texel["normal"] @ below[i][j]["normal"]), off), abs(off)))
        if sum(weight for _, _, weight, _ in weighed) < LEAST:
            i, j, _, _ = min(weighed, key=lambda tap: tap[3])
            return coarse[:, i, j]
        taps = [tap[:3] for tap in weighed]
    return sum(weight * coarse[:, i, j] for i, j, weight in taps) / sum(weight for _, _, weight in taps)


def around(x, count):
    """Return the taps that are at most one from that which holds x, of those there are."""
    own = math.floor(x + 0.5)
    return range(max(0, own - 1), min(count, own + 2))


def tent(d, x, kind):
    """Return the weight of a tap at the distance d from x: half as wide as keeps linear functions linear, sum 1."""
    half = 1.0 if kind == "bilinear" else (4 + abs(x - math.floor(x + 0.5))) / 3
    own = math.floor(x + 0.5)
    weights = {k: max(0.0, 1 - abs(own + k - x) / half) for k in (-1, 0, 1)}
    return weights[round(d + x) - own] / sum(weights.values())


def slope(here, row, column, axis):
    """Return the change of 1/z from a texel to the next: the smaller of both differences, 0 where signs disagree."""
    def nearness(step):
        i, j = (row + step, column) if axis == 0 else (row, column + step)
        if 0 <= i < len(here) and 0 <= j < len(here[0]):
            return 0.0 if here[i][j] is None else 1 / here[i][j]["depth"]
        back = nearness(-step) if (len(here), len(here[0]))[axis] > 1 else 0.0
        return max(0.0, 2 * nearness(0) - back) if back > 0 else 0.0  # on in a straight line beyond the picture's edge
    before, after = nearness(0) - nearness(-1), nearness(1) - nearness(0)
    if before * after <= 0 or nearness(-1) == 0 or nearness(1) == 0:
        return 0.0
    return before if abs(before) < abs(after) else after


def depth_and_normal(sigma, power):
    """Return exp(-off^2 / (2 sigma^2)) cosine^power, with exp(-16 u) as the 16th power of its cubic series."""
    def agreement(cosine, off):
        u = off * off / (32 * sigma * sigma)
        return max(0.0, 1 - u + u * u / 2 - u**3 / 6) ** 16 * cosine**power
    return agreement


def hssil(texels, *, first, count, offsets, agreement, mode="closest", form="disc", upsampling="bilateral",
          only=None, disc_pi=False, level_factor=False):
    """Return the irradiance of a picture: gather at each level, coarsest first, carry up, add (Sec. 3.2).

    `offsets(index, level, row, column)` lists (ox, oy, w); level 0 is full resolution, `first` the level of index 0.
    """
    levels = [level(texels, first + index, mode) for index in range(count)]
    light = None
    for index in reversed(range(count)):
        here = levels[index]
        added = np.zeros((3, len(here), len(here[0])))
        if only in (None, index):
            added = gathered(here, lambda *at, i=index: offsets(i, first + i, *at), form, disc_pi)
        added *= 4.0**index if level_factor else 1.0
        if light is not None:
            added += upsampled(light, levels[index + 1], here, 2, upsampling, agreement, mode != "average")
        light = added
    if first:
        return upsampled(light, levels[0], texels, 2**first, upsampling, agreement, mode != "average")
    return light

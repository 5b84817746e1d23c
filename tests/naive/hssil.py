"""Hierarchical screen-space indirect illumination once more, slowly: one texel and one sample at a time, in float64.

Written from the paper (Sec. 3.1 to 4) and its corrected formulas alone. A texel is a dict: place (from the eye, m),
depth (m), normal, radiance (of each channel, W/m^2/sr), area (m^2), pixel (row, column) it stands at. What no surface
covers is None. A level is a list of rows of texels.
"""

import math

import numpy as np

from tests.naive import crown_points, upsampling
from tests.naive.draws import mix32


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


def drawn(texels, closest, first, seed):
    """Return levels as senders that stand where one of their parts does, drawn by flux, and send the flux of all.

    `closest` are the levels of the closest texels, from level `first` on.
    """
    below, made = texels, []
    for k, nearest in enumerate(closest, first):
        size = 2**first if k == first else 2
        height, width = len(below), len(below[0])
        below = [[one_of([below[row][column] for row in range(size * i, min(size * i + size, height))
                          for column in range(size * j, min(size * j + size, width))], nearest[i][j], (seed, k, i, j))
                  for j in range(-(-width // size))] for i in range(-(-height // size))]
        made.append(below)
    return made


def one_of(block, closest, place):
    """Return a texel where one of a block is, the last that sends before which less than a share u of all is sent.

    Where none sends it is where the closest is: it may stand in the way of light. `place` is seed, level, row, column.
    """
    block = [texel for texel in block if texel is not None]
    if not block:
        return None
    area = sum(texel["area"] for texel in block)
    flux = [texel["area"] * texel["radiance"].sum() for texel in block]
    if not sum(flux) > 0:
        return dict(closest, area=area, radiance=np.zeros(3))
    seed, k, i, j = place
    key = crown_points.pixel_key(crown_points.row_key(crown_points.level_key(seed, k), i), j)
    u = mix32(key ^ 0x165667B1) / 2**32
    one = [n for n in range(len(block)) if flux[n] > 0 and sum(flux[:n]) <= u * sum(flux)][-1]
    return dict(block[one], area=area, radiance=sum(texel["area"] * texel["radiance"] for texel in block) / area)


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


def received(x, y, w, form, disc_pi=False, share=1.0):
    """Return what a texel x receives of a sample y that stands for w texels.

    Eq. 4 with the disc of a share of all w, at least one ("disc"), or of one ("texel"), as often as that makes w; or
    Eq. 3 ("point"). Where w is less than one the disc is no larger.
    """
    d = y["place"] - x["place"]
    r2 = d @ d
    if r2 == 0:
        return np.zeros(3)
    r = math.sqrt(r2)
    cos_x, cos_y = max(0.0, x["normal"] @ d / r), max(0.0, -(y["normal"] @ d) / r)
    ds = y["area"] * w
    if form == "point":
        return y["radiance"] * cos_x * cos_y * ds / r2
    covered = 1.0 if form == "texel" or share * w < 1 <= w else w if w < 1 else share * w
    disc = cos_y * y["area"] * covered / math.pi  # R^2
    return w / covered * (1 if disc_pi else math.pi) * y["radiance"] * cos_x * disc / (r2 + disc)


def gathered(texels, offsets_at, form, disc_pi=False, see=None, senders=None, share=1.0):
    """Return the irradiance of each texel of a level, (3, h, w); what is off the picture or empty gives nothing.

    `see(receiver, sender)` is the visibility of two texels, where there is one; `senders` are the texels as senders,
    where those are others.
    """
    senders = texels if senders is None else senders
    height, width = len(texels), len(texels[0])
    light = np.zeros((3, height, width))
    for row in range(height):
        for column in range(width):
            for ox, oy, w in offsets_at(row, column) if texels[row][column] is not None else ():
                i, j = row + oy, column + ox
                if (ox, oy) != (0, 0) and 0 <= i < height and 0 <= j < width and senders[i][j] is not None:
                    arriving = received(texels[row][column], senders[i][j], w, form, disc_pi, share)
                    if arriving.any():
                        light[:, row, column] += arriving * (see(texels[row][column], senders[i][j]) if see else 1.0)
    return light


def upsampled(coarse, below, here, factor, kind, closest, sigma, power):
    """Carry light from a level to one that is finer by a factor; `closest` tells where a texel of `below` stands."""
    below_depth, below_normal = seen(below)
    depth, normal = seen(here)
    if kind == "bilateral":
        return upsampling.bilateral(coarse, below_depth, below_normal, depth, normal, factor, sigma, power, closest)
    if kind == "bilinear":
        return upsampling.bilinear(coarse, below_depth, depth, factor)
    rows, columns = np.indices(depth.shape) // factor
    return np.where(np.isinf(depth), 0.0, coarse[:, rows, columns])


def seen(texels):
    """Return depths, inf where there is no surface, and normals of a level."""
    depth = np.array([[math.inf if texel is None else texel["depth"] for texel in row] for row in texels])
    normal = np.array([[np.zeros(3) if texel is None else texel["normal"] for texel in row] for row in texels])
    return depth, np.moveaxis(normal, 2, 0)


def hssil(texels, *, first, count, offsets, mode="closest", form="disc", kind="bilateral", sigma=0.02, power=8.0,
          only=None, disc_pi=False, level_factor=False, seed=0, share=1.0):
    """Return the irradiance of a picture: gather at each level, coarsest first, carry up, add (Sec. 3.2).

    `offsets(index, level, row, column)` lists (ox, oy, w); level 0 is full resolution, `first` the level of index 0.
    """
    levels = [level(texels, first + index, mode) for index in range(count)]
    senders = drawn(texels, levels, first, seed) if mode == "resampled" else levels
    filtering = (kind, mode != "average", sigma, power)
    light = None
    for index in reversed(range(count)):
        here = levels[index]
        added = np.zeros((3, len(here), len(here[0])))
        if only in (None, index):
            added = gathered(here, lambda *at, i=index: offsets(i, first + i, *at), form, disc_pi,
                             senders=senders[index], share=share)
        added *= 4.0**index if level_factor else 1.0
        if light is not None:
            added += upsampled(light, levels[index + 1], here, 2, *filtering)
        light = added
    return upsampled(light, levels[0], texels, 2**first, *filtering) if first else light

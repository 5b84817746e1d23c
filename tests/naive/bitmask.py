"""Slow literal twin of light past a screen-space bitmask, pair by pair in float64 with vectors and sets of sectors.

A level is a dict of position (3, h, w) from the eye, normal, radiance, and area (h, w). Sectors: 32 equal steps of
q(a, b) = a / (a + |b|) (2 - that where b < 0, 0 where a < 0), which runs from 0 on the horizon to 2 on the other one.
"""

import math

import numpy as np

SECTORS = 32


def transfer(level, receiver, sender, weight, form="disc", senders=None, share=1.0):
    """What the sender's radiance is multiplied by: Eq. 4 with its pi, by discs of a share of the texels, or Eq. 3."""
    senders = level if senders is None else senders
    d = senders["position"][:, *sender] - level["position"][:, *receiver]
    distance = math.sqrt(d @ d)
    if distance == 0:
        return 0.0
    cos_i = max(0.0, level["normal"][:, *receiver] @ d / distance)
    cos_j = max(0.0, -(senders["normal"][:, *sender] @ d) / distance)
    area = senders["area"][sender] * weight
    if form == "point":
        return cos_i * cos_j * area / distance**2
    texels = 1.0 if form == "texel" else share * weight if share * weight > 1 else min(weight, 1.0)
    square_radius = cos_j * senders["area"][sender] * texels / math.pi
    return math.pi * cos_i * square_radius / (distance**2 + square_radius) * weight / texels


def light(level, around, form="disc", see=None, share=1.0):
    """The unoccluded sum, or one with a visibility: `around(row, column)` yields (ox, oy, weight)."""
    result = np.zeros(level["position"].shape)
    for receiver in np.ndindex(level["area"].shape):
        for ox, oy, weight in around(*receiver):
            sender = receiver[0] + oy, receiver[1] + ox
            if inside(level, sender) and sender != receiver and weight > 0:
                worth = transfer(level, receiver, sender, weight, form, share=share)
                if worth > 0:
                    seen = see(receiver, sender) if see else 1.0
                    result[:, *receiver] += seen * worth * level["radiance"][:, *sender]
    return result


def inside(level, texel):
    """Whether a texel is part of the picture and sees a surface."""
    h, w = level["area"].shape
    return 0 <= texel[0] < h and 0 <= texel[1] < w and level["position"][:, *texel].any()


def masked_light(level, around, thickness, form="disc", senders=None, share=1.0):
    """The sum past the bitmask: `around(row, column)` yields slices, lists of (ox, oy, weight), nearest first.

    `senders` is the level as senders and occluders, where those are others.
    """
    senders = level if senders is None else senders
    result = np.zeros(level["position"].shape)
    for receiver in np.ndindex(level["area"].shape):
        if inside(level, receiver):
            for samples in around(*receiver):
                result[:, *receiver] += one_slice(level, senders, receiver, samples, thickness, form, share)
    return result


def one_slice(level, senders, receiver, samples, thickness, form, share):
    sum_, blocked, highest = np.zeros(3), set(), 0.0
    for ox, oy, weight in samples:
        sender = receiver[0] + oy, receiver[1] + ox
        if not inside(senders, sender) or sender == receiver:
            continue
        here, there = level["position"][:, *receiver], senders["position"][:, *sender]
        normal = level["normal"][:, *receiver]
        front = height(here, normal, there)
        back = height(here, normal, there + thickness * there / math.sqrt(there @ there))
        seen = 1.0 if front >= highest else free_share(blocked, front)
        if weight > 0:
            light = transfer(level, receiver, sender, weight, form, senders, share)
            sum_ += seen * light * senders["radiance"][:, *sender]
        highest = max(highest, front)
        blocked |= {k for k in range(SECTORS) if back < middle(k) <= front}
    return sum_


def middle(sector):
    return (sector + 0.5) * 2 / SECTORS


def free_share(blocked, at):
    """Between the two middles next to a height, linearly."""
    low = math.floor(at * SECTORS / 2 - 0.5)
    share = at * SECTORS / 2 - 0.5 - low
    ends = [min(max(k, 0), SECTORS - 1) not in blocked for k in (low, low + 1)]
    return (1 - share) * ends[0] + share * ends[1]


def height(here, normal, there):
    """How high a point stands above a receiver's plane, within the plane that the eye, at the origin, lies in too."""
    d = there - here
    across = d - (d @ here) / (here @ here) * here
    if not across.any():
        return 0.0
    plane = np.stack([-here / math.sqrt(here @ here), across / math.sqrt(across @ across)])  # to the eye, and across
    up = plane @ normal
    a, b = up @ (plane @ d), np.array([-up[1], up[0]]) @ (plane @ d)
    if a <= 0:
        return 0.0
    return a / (a + abs(b)) if b >= 0 else 2 - a / (a + abs(b))

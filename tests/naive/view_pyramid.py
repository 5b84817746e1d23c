"""Slow literal twin of hssil's pyramids: one pixel and one texel after the other, with angles, in double precision.

A picture is a dict of W x H pixels seen by a camera: fields of view, the axes right, down and ahead, and lists of depth
(inf: nothing), normal, albedo and direct irradiance by row and column. A level is a list of rows of texels, each a dict
or None where nothing is seen.
"""

import math

import numpy as np


def ray(picture, row, column):
    """A vector through a pixel's centre whose length along the view direction is 1."""
    right, down, ahead = picture["axes"]
    height, width = len(picture["depth"]), len(picture["depth"][0])
    x = ((column + 0.5) / width * 2 - 1) * math.tan(picture["f_h"] / 2)
    y = ((row + 0.5) / height * 2 - 1) * math.tan(picture["f_v"] / 2)
    return np.array(ahead) + x * np.array(right) + y * np.array(down)


def ds(picture, row, column, tangents="half"):
    """Eq. 2 with dP = 1; with tangents "whole" the form that Eq. 3 prints."""
    height, width = len(picture["depth"]), len(picture["depth"][0])
    z, n, along = picture["depth"][row][column], picture["normal"][row][column], ray(picture, row, column)
    cos_alpha = np.dot(along, picture["axes"][2]) / np.linalg.norm(along)
    cos_beta = -np.dot(n, along) / np.linalg.norm(along)
    if cos_beta <= 0:  # seen from behind
        return 0.0
    share = 0.5 if tangents == "half" else 1.0
    pixel = 4 * math.tan(share * picture["f_h"]) * math.tan(share * picture["f_v"]) / (width * height)
    return z**2 * pixel * cos_alpha / cos_beta


def pixel_texel(picture, row, column, tangents="half"):
    """A pixel as a texel of level 0."""
    z = picture["depth"][row][column]
    if math.isinf(z):
        return None
    albedo, direct = np.array(picture["albedo"][row][column]), np.array(picture["direct"][row][column])
    return {"z": z, "p": z * ray(picture, row, column), "n": np.array(picture["normal"][row][column]),
            "L": albedo / math.pi * direct, "A": ds(picture, row, column, tangents), "pixel": (row, column), "seen": 1}


def closest(children, covered, fine_covered, width):
    """The nearest of several texels; `covered` pixels lie below the new one, `fine_covered` below each child."""
    there = [(child, pixels) for child, pixels in zip(children, fine_covered, strict=True) if child is not None]
    if not there:
        return None
    best, pixels = min(there, key=lambda one: (one[0]["z"], abs(2 * one[0]["pixel"][1] + 1 - width), one[0]["pixel"]))
    return dict(best, A=best["A"] / pixels * covered)


def mean(nearest, children, mode):
    """The nearest texel with means of all."""
    there = [child for child in children if child is not None]
    if not there:
        return None
    texel = dict(nearest, seen=sum(child["seen"] for child in there))
    if mode == "closest_average":
        texel["L"] = sum(child["seen"] * child["L"] for child in there) / texel["seen"]
    else:
        texel["A"] = area = sum(child["A"] for child in there)
        if area > 0:
            for key in ("z", "p", "n", "L"):
                texel[key] = sum(child["A"] * child[key] for child in there) / area
            texel["n"] = texel["n"] / np.linalg.norm(texel["n"])
    return texel


def below(fine, i, j, side):
    """Places of the finer texels that a texel joins, side x side or fewer at the edge."""
    return [(r, c) for r in range(i * side, (i + 1) * side) for c in range(j * side, (j + 1) * side)
            if r < len(fine) and c < len(fine[0])]


def pixels(i, j, side, height, width):
    """Count the picture's pixels below a texel."""
    return len(range(i * side, min((i + 1) * side, height))) * len(range(j * side, min((j + 1) * side, width)))


def closest_level(fine, height, width, number, side):
    """Level `number` of the nearest of side x side texels of a finer level."""
    shape = math.ceil(height / 2**number), math.ceil(width / 2**number)
    return [[closest([fine[r][c] for r, c in below(fine, i, j, side)], pixels(i, j, 2**number, height, width),
                     [pixels(r, c, 2**number // side, height, width) for r, c in below(fine, i, j, side)], width)
             for j in range(shape[1])] for i in range(shape[0])]


def mean_level(nearest, fine, side, mode):
    """A level of nearest texels with means of a finer level."""
    return [[mean(nearest[i][j], [fine[r][c] for r, c in below(fine, i, j, side)], mode)
             for j in range(len(nearest[0]))] for i in range(len(nearest))]


def levels(picture, first, count, mode="closest", tangents="half"):
    """The first level from all pixels at once, each further one from that before."""
    height, width = len(picture["depth"]), len(picture["depth"][0])
    full = [[pixel_texel(picture, row, column, tangents) for column in range(width)] for row in range(height)]
    made, fine, side = [], full, 2**first
    for number in range(first, first + count):
        made.append(closest_level(fine, height, width, number, side))
        fine, side = made[-1], 2
    if mode != "closest":
        fine, side = full, 2**first
        for index, nearest in enumerate(made):
            made[index] = fine = mean_level(nearest, fine, side, mode)
            side = 2
    return made

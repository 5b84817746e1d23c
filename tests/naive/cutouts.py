"""Slow literal twin of cut-outs: the mask at a point from its definition, and the nearest triangle that is there."""

import math

import numpy as np

from tests.naive.textures import barycentric, index


def blend(alpha, wrap, chosen, u, v):
    """Alpha at (u, v): weights fall linearly from the texels' centres, or the texel that (u, v) lies in."""
    height, width = alpha.shape
    if chosen == "nearest":
        row, column = index(math.floor(v * height), height, wrap[1]), index(math.floor(u * width), width, wrap[0])
        return float(alpha[row, column])
    total, across, down = 0.0, u * width - 0.5, v * height - 0.5
    for j in (math.floor(down), math.floor(down) + 1):
        for i in (math.floor(across), math.floor(across) + 1):
            texel = float(alpha[index(j, height, wrap[1]), index(i, width, wrap[0])])
            total += (1 - abs(across - i)) * (1 - abs(down - j)) * texel
    return total


def excess(material, u, v):
    """How far factor x alpha is above the cutoff; inf where the material has none."""
    if material.cutoff is None:
        return math.inf
    alpha = 1.0
    if material.texture is not None and material.texture.image.alpha is not None:
        image = material.texture.image
        most = {"uint8": 255, "uint16": 65535}.get(image.alpha.dtype.name, 1)
        alpha = blend(image.alpha / most, material.texture.wrap, material.texture.filter, u, v)
    return material.alpha * alpha - material.cutoff


def hits(origin, direction, geometry, materials):
    """All hits on a ray, nearest first: distance, triangle, how far it is there, least barycentric coordinate."""
    found = []
    for face, corners in enumerate(geometry.faces):
        corner = geometry.vertices[corners]
        normal = np.cross(corner[1] - corner[0], corner[2] - corner[0])
        along = normal @ direction
        if along == 0:
            continue
        t = normal @ (corner[0] - origin) / along
        weights = barycentric(corner, origin, direction)
        if t > 0 and weights.min() >= 0:
            u, v = (0.0, 0.0) if geometry.uv is None else weights @ geometry.uv[face]
            there = excess(materials[geometry.material_of_face[face]], u, v)
            found.append((float(t), face, there, float(weights.min())))
    return sorted(found)


def first(found):
    """Of the hits of a ray: triangle that is met first, -1 for none; its distance; least margin of any decision."""
    margin = math.inf
    for t, face, there, inside in found:
        margin = min(margin, abs(there), inside)
        if there >= 0:
            return face, t, margin
    return -1, math.inf, margin


def nearest(origin, direction, geometry, materials):
    """Triangle, distance and margin of what a ray meets first."""
    return first(hits(origin, direction, geometry, materials))

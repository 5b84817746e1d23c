"""Slow literal twin of pixel lights with true visibility: every pair of light and receiver, and a ray for each."""

import numpy as np

from refgi.pairs.settings import PairSettings
from tests.naive import imperfect
from tests.naive.crossings import LIFT, corners_of, face_normals, free
from tests.naive.pair_term import contributions


def picture(frame, lights, visibility=True, maps=None, seed=0):
    """Return the irradiance, (3, h, w), by lights that were chosen from the frame's shadow maps.

    With visibility nothing arrives from below a face, whatever normals are interpolated, and what leaves below one is
    blocked by it; without, cosines alone bound a pair. With `maps`, settings of imperfect ones, those stand for rays.
    """
    buffer, geometry = frame.gbuffer, frame.scene.geometry
    pixels = np.argwhere(buffer.covered)
    at = tuple(pixels.T)
    position, normal = (plane[:, *at].T.astype(float) for plane in (buffer.position, buffer.normal))
    facing = face_normals(geometry, buffer.triangle_id[at], normal)
    light = contributions(position, normal, lights, PairSettings())
    up = sender_faces(frame, lights)
    result = np.zeros((3, frame.height, frame.width))
    for i, sent in enumerate(light):
        place = lights.position[:, i].astype(float)
        toward = place - position
        counts = sent.any(axis=1) & (((toward * facing).sum(axis=1) > 0) | (not visibility))
        if visibility and maps is not None:
            counts[counts] = unmapped(corners_of(geometry), lights, i, position[counts], facing[counts], maps, seed)
        elif visibility:
            counts &= toward @ up[i] < 0
            counts[counts] = free(corners_of(geometry), position[counts] + LIFT * facing[counts], place + LIFT * up[i])
        result[:, *at] += (sent * counts[:, None]).T
    return result


def unmapped(corners, lights, i, points, facing, maps, seed):
    """Return which points light i reaches by its imperfect shadow map."""
    position, normal = lights.position[:, i].astype(float), lights.normal[:, i].astype(float)
    depth, radius = imperfect.depth_map(corners, position, normal, i, maps.points, maps.resolution, maps.levels, seed,
                                        maps.splat)
    return [not imperfect.is_hidden(depth, radius, maps.bias, point, up, position, normal)
            for point, up in zip(points, facing, strict=True)]


def sender_faces(frame, lights):
    """Return the normals (N, 3) of the triangles that lights lie on, on the side that they shine to."""
    triangle = [frame.rsms[m].triangle_id.reshape(-1)[t] for m, t in zip(lights.map_index, lights.texel, strict=True)]
    return face_normals(frame.scene.geometry, np.array(triangle), lights.normal.T.astype(float))

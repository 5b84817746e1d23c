"""`vpl` as a whole by the literal text: pixel lights with visibility by rays or imperfect maps, in float64."""

import numpy as np

from refgi.literal import imperfect, pairs
from refgi.literal.vpl import facing, shadowed_sum, visible
from tests.naive.crossings import face_normals
from tests.naive.draws import draw

STREAM = 7  # of a light's points: this + 256 times its number


def picture(frame, lights, visibility=True, maps=None, seed=0):
    """Return the irradiance, (3, h, w), by lights that were chosen from the frame's shadow maps.

    With visibility nothing arrives from below a face, whatever normals are interpolated, and what leaves below one is
    blocked by it; without, cosines alone bound a pair. With `maps`, settings of imperfect ones, those stand for rays.
    """
    buffer, geometry = frame.gbuffer, frame.scene.geometry
    vertices, faces = np.asarray(geometry.vertices, float), geometry.faces
    position, normal, ids = (*(np.asarray(one, float) for one in (buffer.position, buffer.normal)),
                             np.where(buffer.covered, buffer.triangle_id, -1))
    sent = [None if one is None else np.asarray(one, float) for one in lights[:6]]
    if not visibility:
        return pairs.irradiance(position, normal, ids, *sent)
    up = facing(vertices, faces, normal, ids)
    if maps is None:
        seen = visible(vertices, faces, position, normal, ids, up, *sent[:2])
    else:
        depth, views, radius = imperfect_maps(geometry, lights, maps, seed)
        seen = imperfect.looked_up(position, normal, ids, up, *sent[:2], views, depth, radius, maps.bias)
    return shadowed_sum(position, normal, ids, seen, *sent)


def imperfect_maps(geometry, lights, maps, seed):
    """Return the maps (N, R, R) of lights, their frames (N, 3, 3) and the radius of a point, m."""
    vertices, faces = np.asarray(geometry.vertices, float), geometry.faces
    shift = np.array([[draw(seed, STREAM + 256 * number, c) for c in range(3)]
                      for number in range(lights.flux.shape[1])])
    point, face, radius = imperfect.scattered_points(vertices, faces, shift, maps.points)
    views = imperfect.map_frames(np.asarray(lights.normal, float))
    depth = imperfect.depth_maps(vertices, faces, point, face, radius, np.asarray(lights.position, float), views,
                                 maps.resolution, maps.splat)
    return imperfect.filled(depth, maps.levels), views, radius


def sender_faces(frame, lights):
    """Return the normals (N, 3) of the triangles that lights lie on, on the side that they shine to."""
    triangle = [frame.rsms[m].triangle_id.reshape(-1)[t] for m, t in zip(lights.map_index, lights.texel, strict=True)]
    return face_normals(frame.scene.geometry, np.array(triangle), lights.normal.T.astype(float))

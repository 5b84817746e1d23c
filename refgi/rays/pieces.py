"""Triangles that are huge beside the rest, cut for Embree alone: float32 tests are off by a share of a triangle's size.

A hit on a quad of 10^8 m is found to some metres, so that it may hide a floor 1 mm above it. Edges longer than the
scene's grain and than 0.4 of their middle's distance from the coordinates' origin are halved, until none is left: then
no piece is longer than the larger of the grain and the distance of its own points, where float32 coordinates are as
coarse. What is cut depends on the edge alone, so neighbours are cut at the same points and no gap opens. A face of
size S becomes some tens of pieces times log2(S / grain).
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]

REACH = 0.4


class Pieces(NamedTuple):
    """Triangles for Embree."""

    vertices: Array  # (n, 3) float32, m
    faces: Array  # (m, 3) int32
    face: Array | None  # (m,) int32: the face each is a piece of; None where nothing is cut


def cut(vertices: Array, faces: Array, grain: float) -> Pieces:
    """Cut huge triangles into pieces that grow with their distance.

    Parameters
    ----------
    vertices : (n, 3) float32 ndarray
        Vertices, m.
    faces : (m, 3) int32 ndarray
        Vertex indices.
    grain : float
        Edges up to this length stay whole, m.

    Returns
    -------
    Pieces
        The same arrays where nothing is cut.
    """
    if not _any_longer(vertices, faces, grain):
        return Pieces(vertices, faces, None)
    places = vertices.astype(np.float64)
    whole: list[tuple[Array, Array]] = []
    left, of = faces, np.arange(len(faces), dtype=np.int32)
    while True:
        start, end = places[left], places[np.roll(left, -1, axis=1)]
        middle, way = (start + end) / 2, end - start
        length = np.sqrt((way * way).sum(axis=2))
        split = length > np.maximum(grain, REACH * np.sqrt((middle * middle).sum(axis=2)))
        cuts = split.any(axis=1)
        whole.append((left[~cuts], of[~cuts]))
        if not cuts.any():
            break
        left, of, split = left[cuts], of[cuts], split[cuts]
        numbers = np.full(split.shape, -1, np.int32)
        numbers[split] = len(places) + np.arange(np.count_nonzero(split))
        places = np.concatenate([places, middle[cuts][split]])
        left, of = _halved(left, numbers, of)
    if len(whole) == 1:
        return Pieces(vertices, faces, None)
    joined = [np.concatenate(parts) for parts in zip(*whole, strict=True)]
    return Pieces(places.astype(np.float32), joined[0].astype(np.int32), joined[1])


def _any_longer(vertices: Array, faces: Array, grain: float) -> bool:
    """Tell whether a side of any triangle's box is longer, which is asked in little memory."""
    lowest, highest = vertices[faces[:, 0]], vertices[faces[:, 0]]
    for k in (1, 2):
        corner = vertices[faces[:, k]]
        np.minimum(lowest, corner, out=lowest)
        np.maximum(highest, corner, out=highest)
    return bool((highest - lowest).max() * np.sqrt(3) > grain)


def _halved(faces: Array, middles: Array, of: Array) -> tuple[Array, Array]:
    """Return the parts of triangles whose edges (from each corner to the next) have the given middles; -1: none."""
    count = (middles >= 0).sum(axis=1)
    parts, owners = [], []
    # turn each so that with one middle it lies on the first edge, with two on the first two
    first = np.where(count == 1, np.argmax(middles >= 0, axis=1), (np.argmax(middles < 0, axis=1) + 1) % 3)
    order = (first[:, None] + np.arange(3)) % 3
    order[count == 3] = (0, 1, 2)
    (a, b, c), (p, q, r) = np.take_along_axis(faces, order, 1).T, np.take_along_axis(middles, order, 1).T
    for number, triangles in ((1, ((a, p, c), (p, b, c))), (2, ((p, b, q), (a, p, q), (a, q, c))),
                              (3, ((a, p, r), (p, b, q), (r, q, c), (p, q, r)))):
        for corners in triangles:
            parts.append(np.stack(corners, axis=1)[count == number])
            owners.append(of[count == number])
    return np.concatenate(parts), np.concatenate(owners)

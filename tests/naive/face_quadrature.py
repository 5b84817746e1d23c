"""Slow literal oracle of the ground truth without random numbers: quadrature over the faces of a scene.

    E(x) = sum_lamps int_A I / d^2 <g.l> V(y, lamp) p(y, l, w) <n.w> / r^2 V(x, y) dA,

with p the diffuse part and the lobe of `tests.naive.light_tracing.pattern`, w from y to x. Of a glossy receiver it is
the integral with <m.w>^P <n.w> in place of <n.w>, m its mirrored view: (P + 2) / (2 pi) of that is what a white lobe
reflects. A face is cut into four
until its integral by seven points (degree 5) and that of its quarters agree. What seven points could pass over is cut
first: cells that are long beside the scene, a spot's cone or their distance from receiver or lamp, and cells whose lobe
is not flat between corners: with e = r - w a lobe is (1 - e^2 / 2)^P, a highlight around e = 0 of a width 1 / sqrt(P).
"""

from typing import NamedTuple

import numpy as np

from refgi.rays import STEPS, Tracer
from refgi.scene import DirectionalLight, PointLight, SpotLight
from tests.naive.crossings import corners_of, face_normals
from tests.naive.light_tracing import Vertices, pattern, shading_normals
from tests.naive.receiver_lobes import unit

NEAR = 1.0  # longest edge of a cell over its distance from receiver and lamp
LARGEST = 1 / 8  # of a cell, over the scene
FLAT = 2.0  # widths of a highlight from corner to corner of a cell
NEGLIGIBLE = 1e-9  # of a lobe's peak: cells whose lobe is below that all over are not cut for it
DEEPEST = 20  # times that a face is halved
BELOW = 1e-6  # of the scene: faces that rise less above a receiver's plane send it nothing
TOGETHER = 4000  # pairs of receiver and face to start with

_A, _B = 0.470142064105115, 0.101286507323456  # Dunavant 1985: 7 points, degree 5
PLACES = np.array([(1 / 3,) * 3, (1 - 2 * _A, _A, _A), (_A, 1 - 2 * _A, _A), (_A, _A, 1 - 2 * _A),
                   (1 - 2 * _B, _B, _B), (_B, 1 - 2 * _B, _B), (_B, _B, 1 - 2 * _B)])
WEIGHTS = np.array([0.225, *(0.132394152788506,) * 3, *(0.125939180544827,) * 3])


class Receivers(NamedTuple):
    """Points (n, 3) with their shading normals and their faces' normals on the same side; lobes, exponent 0: none."""

    position: np.ndarray
    normal: np.ndarray
    facing: np.ndarray
    mirrored: np.ndarray  # m
    exponent: np.ndarray  # (n,)


class Cells(NamedTuple):
    """Parts of faces as receivers see them."""

    receiver: np.ndarray  # (m,)
    face: np.ndarray  # (m,)
    corners: np.ndarray  # (m, 3, 3)
    value: np.ndarray  # (m, 3) by seven points; NaN: not yet known


def receivers_of(frame, lobes=False):
    """Return the covered pixels of a G-buffer, in picture order; with `lobes` those of glossy materials alone."""
    buffer, scene = frame.gbuffer, frame.scene
    seen = glossy_of(frame) if lobes else buffer.covered
    position, normal = (plane[:, seen].T.astype(float) for plane in (buffer.position, buffer.normal))
    n, triangles = unit(normal), buffer.triangle_id[seen]
    facing = face_normals(scene.geometry, triangles, normal)
    if not lobes:
        return Receivers(position, n, facing, n, np.zeros(len(n)))
    to_eye = unit(np.asarray(scene.camera.eye, float) - position)
    exponent = np.array([m.exponent for m in scene.materials])[scene.geometry.material_of_face[triangles]]
    return Receivers(position, n, facing, 2 * (n * to_eye).sum(axis=1, keepdims=True) * n - to_eye, exponent)


def glossy_of(frame):
    """Return which pixels (h, w) see a material with a lobe from the side of its normal."""
    buffer, scene = frame.gbuffer, frame.scene
    glossy = np.array([any(m.specular) for m in scene.materials])[scene.geometry.material_of_face]
    to_eye = np.asarray(scene.camera.eye, float)[:, None, None] - buffer.position
    return buffer.covered & glossy[buffer.triangle_id] & ((to_eye * buffer.normal).sum(axis=0) > 0)


def reflected(scene, receivers, specular, **options):
    """Return the radiance (n, 3) that receivers' lobes of reflectance `specular` (n, 3) reflect, and how far it moved.

    Further options as for `irradiance`.
    """
    factor = specular * ((receivers.exponent + 2) / (2 * np.pi))[:, None]
    value, moved = irradiance(scene, receivers, **options)
    return factor * value, factor * moved


def irradiance(scene, receivers, tolerance=1e-4, tracer=None):
    """Return E (n, 3) at receivers, and how far its last refinement moved it; relative to E, `tolerance` is asked."""
    tracer = tracer or Tracer(scene.geometry)
    total, moved = np.zeros((2, len(receivers.position), 3))
    step = max(1, TOGETHER // scene.face_count)
    for first in range(0, len(total), step):
        chosen = slice(first, first + step)
        part = Receivers(*(field[chosen] for field in receivers))
        known = np.zeros((len(part.position), 3))
        for lamp in scene.lights:
            value, error = _of_lamp(scene, tracer, lamp, part, tolerance, known)
            known += value
            moved[chosen] += error**2
        total[chosen] = known
    return total, np.sqrt(moved)


def _of_lamp(scene, tracer, lamp, receivers, tolerance, known):
    """Return what receivers get of one lamp; `known`: of the lamps before."""
    cells = _whole_faces(scene, lamp, receivers)
    total, squares = np.zeros((2, len(receivers.position), 3))
    for depth in range(DEEPEST + 1):
        if not len(cells.face):
            break
        coarse = np.isnan(cells.value[:, 0])
        if depth < DEEPEST:
            early = coarse & _must_be_cut(scene, lamp, receivers, cells)
            rest, waiting = _only(cells, ~early), _quarters(_only(cells, early))
            coarse = coarse[~early]
        else:
            rest, waiting = cells, _only(cells, np.zeros(len(cells.face), bool))
        rest.value[coarse] = _integrals(scene, tracer, lamp, receivers, _only(rest, coarse))
        fine = _quarters(rest)
        fine.value[:] = _integrals(scene, tracer, lamp, receivers, fine)
        better = fine.value.reshape(-1, 4, 3).sum(axis=1)
        off = np.abs(better - rest.value)
        so_far = known + total + _sums(rest.receiver, better, len(known))
        # a few hundred cells at edges add up, and one by one may agree with their quarters by chance
        allowed = 0.02 * tolerance * np.maximum(so_far, 1e-3 * so_far.max(axis=1, keepdims=True))[rest.receiver]
        done = (off <= allowed).all(axis=1) | (depth == DEEPEST)
        total += _sums(rest.receiver[done], better[done], len(known))
        squares += _sums(rest.receiver[done], off[done] ** 2, len(known))
        fine = _only(fine, np.repeat(~done, 4))
        cells = Cells(*(np.concatenate(pair) for pair in zip(fine, waiting, strict=True)))
    return total, np.sqrt(squares)


def _whole_faces(scene, lamp, receivers):
    """Return pairs of receiver and face: the face rises above the receiver, who is on its lit side."""
    corners = corners_of(scene.geometry)
    g = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    g /= np.linalg.norm(g, axis=1, keepdims=True)
    from_lamp = (g * _toward(lamp, corners[:, 0])[0]).sum(axis=1)
    heights = ((receivers.position[:, None] - corners[:, 0]) * g).sum(axis=2) * np.sign(from_lamp)
    rise = np.einsum("fkc,rc->rfk", corners, receivers.facing).max(axis=2)
    rise -= (receivers.position * receivers.facing).sum(axis=1)[:, None]
    far = BELOW * scene.geometry.diagonal
    receiver, face = np.nonzero((rise > far) & (heights > far))
    return Cells(receiver, face, corners[face], np.full((len(face), 3), np.nan))


def _toward(lamp, y):
    """Return unit vectors (n, 3) from points to a lamp, and distances (n,); inf: parallel light."""
    if isinstance(lamp, DirectionalLight):
        return np.broadcast_to(-unit(np.asarray(lamp.direction)), y.shape), np.full(y.shape[:-1], np.inf)
    away = np.asarray(lamp.position) - y
    distance = np.linalg.norm(away, axis=-1)
    return away / distance[..., None], distance


def _perpendicular(lamp, toward, distance):
    """Return the irradiance (n, 3) on surfaces that face a lamp."""
    if isinstance(lamp, DirectionalLight):
        return np.broadcast_to(np.asarray(lamp.irradiance), toward.shape)
    strength = 1 / distance**2
    if not isinstance(lamp, PointLight):
        inner, outer = np.cos(lamp.inner_half_angle), np.cos(lamp.outer_half_angle)
        cosine = -toward @ unit(np.asarray(lamp.direction))
        t = np.clip((cosine - outer) / (inner - outer), 0, 1) if inner > outer else cosine >= outer
        strength = strength * t * t * (3 - 2 * t)
    return strength[:, None] * np.asarray(lamp.intensity)


def _must_be_cut(scene, lamp, receivers, cells):
    """Tell which cells are too long for seven points: beside a distance, or beside the width of a highlight."""
    edges = np.linalg.norm(cells.corners - np.roll(cells.corners, 1, axis=1), axis=2).max(axis=1)
    x, middle = receivers.position[cells.receiver], cells.corners.mean(axis=1)
    reach = np.linalg.norm(middle - x, axis=1) - edges / 2
    to_lamp = _toward(lamp, middle)[1] - edges / 2
    longest = NEAR * np.maximum(np.minimum(reach, to_lamp), 1e-9)
    result = edges > np.minimum(longest, LARGEST * scene.geometry.diagonal)
    if isinstance(lamp, SpotLight):
        toward, distance = _toward(lamp, middle)
        angle = np.arccos(np.clip(-toward @ unit(np.asarray(lamp.direction)), -1, 1))
        near_cone = angle < lamp.outer_half_angle + edges / distance
        result |= near_cone & (edges > lamp.outer_half_angle / 2 * distance)
    exponents = np.array([m.exponent if any(m.specular) else -1.0 for m in scene.materials])
    exponent = exponents[scene.geometry.material_of_face[cells.face]]
    glossy = np.flatnonzero(~result & (exponent >= 0))
    e = np.stack([_off_axis(scene, lamp, cells.face[glossy], cells.corners[glossy, k], x[glossy])
                  for k in range(3)], axis=1)
    result[glossy] = _is_peaked(e, exponent[glossy])
    rest = np.flatnonzero(~result & (receivers.exponent[cells.receiver] > 0))
    m, exponent = receivers.mirrored[cells.receiver[rest]], receivers.exponent[cells.receiver[rest]]
    result[rest] = _is_peaked(m[:, None] - unit(cells.corners[rest] - x[rest, None]), exponent)
    return result


def _is_peaked(e, exponent):
    """Tell where a lobe (1 - e^2 / 2)^P is not flat between corners; `e` (n, 3, 3): of each corner."""
    spread = np.linalg.norm(e - np.roll(e, 1, axis=1), axis=2).max(axis=1)
    nearest = np.maximum(0, np.linalg.norm(e, axis=2).min(axis=1) - spread)
    return (np.maximum(0, 1 - nearest**2 / 2) ** exponent > NEGLIGIBLE) & (spread > FLAT / np.sqrt(exponent + 1))


def _off_axis(scene, lamp, face, y, x):
    """Return e = r - w at points y of faces, seen from x."""
    toward, _ = _toward(lamp, y)
    n = shading_normals(scene.geometry, face, y, face_normals(scene.geometry, face, toward))
    return 2 * (n * toward).sum(axis=1, keepdims=True) * n - toward - unit(x - y)


def _integrals(scene, tracer, lamp, receivers, cells):
    """Return the integral (m, 3) over each cell by seven points."""
    y = np.einsum("pk,mkc->mpc", PLACES, cells.corners).reshape(-1, 3)
    receiver, face = np.repeat(cells.receiver, len(PLACES)), np.repeat(cells.face, len(PLACES))
    density = _density(scene, tracer, lamp, Receivers(*(field[receiver] for field in receivers)), face, y)
    cross = np.cross(cells.corners[:, 1] - cells.corners[:, 0], cells.corners[:, 2] - cells.corners[:, 0])
    area = np.linalg.norm(cross, axis=1) / 2
    return np.einsum("p,mpc->mc", WEIGHTS, density.reshape(-1, len(PLACES), 3)) * area[:, None]


def _density(scene, tracer, lamp, receivers, face, y):
    """Return the irradiance (n, 3) that a unit of area at each y gives its receiver."""
    toward, distance = _toward(lamp, y)
    g = face_normals(scene.geometry, face, toward)
    n = shading_normals(scene.geometry, face, y, g)
    away = y - receivers.position
    r2 = (away**2).sum(axis=1)
    w = away / np.sqrt(r2)[:, None]
    flux = _perpendicular(lamp, toward, distance) * (g * toward).sum(axis=1)[:, None]
    sent = pattern(scene, Vertices(y, face, toward, flux, g, n), -w) * flux
    cosine = np.where((w * receivers.facing).sum(axis=1) > 0, np.maximum(0, (w * receivers.normal).sum(axis=1)), 0)
    along = np.maximum(0, 1 - ((receivers.mirrored - w) ** 2).sum(axis=1) / 2)
    cosine = np.where(receivers.exponent > 0, along**receivers.exponent, 1.0) * cosine
    result = sent * (cosine / r2)[:, None]
    counts = np.flatnonzero(result.any(axis=1))
    start, x, up = y[counts], receivers.position[counts], receivers.facing[counts]
    start = start + tracer.offsets(start)[:, None] * g[counts]
    if isinstance(lamp, DirectionalLight):
        hidden = _blocked(tracer, start, toward[counts], np.inf)
    else:
        end = np.asarray(lamp.position, float)
        hidden = _blocked(tracer, start, end - start, 1 - tracer.offsets(end) / distance[counts] - STEPS)
    end = x + tracer.offsets(x)[:, None] * up
    hidden[~hidden] = _blocked(tracer, start[~hidden], (end - start)[~hidden], 1 - STEPS)
    seen = np.zeros_like(result)
    seen[counts[~hidden]] = result[counts[~hidden]]
    return seen


def _blocked(tracer, start, direction, reach):
    """Tell which rays meet a face within a share of their directions' lengths."""
    blocked = np.zeros(len(start), bool)
    tracer.fill_occluded(start.astype(np.float32), np.ascontiguousarray(direction, np.float32),
                         np.broadcast_to(reach, len(start)).astype(np.float32), blocked)
    return blocked


def _quarters(cells):
    """Cut each cell at the middles of its edges."""
    a, b, c = np.moveaxis(cells.corners, 1, 0)
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    corners = np.stack([np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))], axis=1)
    return Cells(np.repeat(cells.receiver, 4), np.repeat(cells.face, 4), corners.reshape(-1, 3, 3),
                 np.full((4 * len(a), 3), np.nan))


def _only(cells, chosen):
    return Cells(*(field[chosen] for field in cells))


def _sums(receiver, values, count):
    return np.stack([np.bincount(receiver, channel, count) for channel in values.T], axis=1)

"""Hemisphere sampling at the receiver: where cosine-distributed rays land, what the lights send back from there.

A direction of density cos/pi that finds radiance L is worth pi L. A split at the bounded geometry term G leaves
min(G, b) to the light side; here the rest, the share max(0, (G - b) / G) of each part's radiance, remains (Kollig &
Keller 2004). Without bound the share is 1. Directions are points of a low-discrepancy set that is scrambled anew in
every pass and shifted by a random word per pixel.

The parallel loops only call a kernel for each chunk of paths: Numba drops, without a word, what a parallel loop
itself writes into arrays that it reached through a NamedTuple's attribute.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.radiometry import DIRECTIONAL, incident_light, lobe_fraction
from refgi.rays import MISS
from refgi.sampling import hash_bits, sobol_owen
from refgi.scene import LightTable
from refgi.truth.surfaces import Receivers, Surfaces, around, face_cross, face_normal, lobe_pattern, shading_normal

Array = npt.NDArray[Any]

CHUNK = 1024  # paths or receivers that one parallel iteration owns


class Paths(NamedTuple):
    """The moving ends of a batch of paths: one ray each, what it found, what it carries."""

    origin: Array  # (n, 3) float32, m
    direction: Array  # (n, 3) float32, unit vectors
    reach: Array  # (n,) float32, m; 0 once a path has ended
    travelled: Array  # (n,) float32: distance from the receiver to the origin, m
    cosine: Array  # (n,) float32: <n_x.w> at the receiver
    triangle_id: Array  # (n,) int32
    distance: Array  # (n,) float32
    weight: Array  # (n, 3) float32: factor from found radiance to irradiance at the receiver


class Shadows(NamedTuple):
    """Shadow rays of a batch, and what each is worth if it is free."""

    origin: Array  # (n, 3) float32
    direction: Array  # (n, 3) float32
    reach: Array  # (n,) float32
    blocked: Array  # (n,) bool
    worth: Array  # (n, 3) float32, W/m^2


@kernel
def scrambled_points(count: int, seed: int) -> Array:
    """Return scrambled low-discrepancy points of the square as 32-bit words.

    Parameters
    ----------
    count : int
        Points.
    seed : int
        Which scramble.

    Returns
    -------
    (count, 2) ndarray of uint32
        Coordinates times 2^32.
    """
    points = np.empty((count, 2), np.uint32)
    for i in range(count):
        for axis in range(2):
            points[i, axis] = np.uint32(sobol_owen(np.uint32(i), axis, np.uint32(seed)) * 2.0**32)
    return points


@kernel
def cosine_direction(u: float, v: float) -> tuple[float, float, float]:
    """Return a direction of the upper hemisphere with density cos(theta) / pi, good to 1e-8 and alike everywhere.

    Parameters
    ----------
    u, v : float
        Point of the unit square; u = sin^2 theta, v the share of the turn.

    Returns
    -------
    tuple of 3 floats
        Unit vector, z up.

    Notes
    -----
    The turn is split into quarters and the series of sine and cosine up to pi/4 cut at 2e-9 (rays are float32).
    """
    quarter = math.floor(4 * v + 0.5)
    t = 2 * math.pi * (v - 0.25 * quarter)
    t2 = t * t
    sine = t * (1 - t2 / 6 * (1 - t2 / 20 * (1 - t2 / 42 * (1 - t2 / 72))))
    cosine = 1 - t2 / 2 * (1 - t2 / 12 * (1 - t2 / 30 * (1 - t2 / 56 * (1 - t2 / 90))))
    if quarter == 1 or quarter == 3:
        sine, cosine = cosine, -sine
    radius = math.sqrt(u) if quarter < 2 or quarter == 4 else -math.sqrt(u)
    return radius * cosine, radius * sine, math.sqrt(max(0.0, 1 - u))


@kernel(parallel=True)
def send(to: Receivers, span: tuple[int, int], points: Array, seed: int, reach: float, paths: Paths) -> None:
    """Send one ray for each point of the set from each receiver of a span.

    Parameters
    ----------
    to : Receivers
        Receivers.
    span : tuple of 2 ints
        First receiver and one past the last.
    points : (s, 2) ndarray of uint32
        The pass's point set.
    seed : int
        Random shift: a hash of it and the receiver's pixel.
    reach : float
        How far to look, m.
    paths : Paths
        Origins, directions, reach, lengths, cosines and weights are filled.
    """
    count = span[1] - span[0]
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        _send(to, span[0], (chunk * CHUNK, min(count, chunk * CHUNK + CHUNK)), points, seed, reach, paths)


@kernel
def _send(to: Receivers, first: int, span: tuple[int, int], points: Array, seed: int, reach: float,
          paths: Paths) -> None:
    origins, directions, reaches, travelled, cosines, _, _, weights = paths
    pixel, _, normals, facing, starts = to
    ray = span[0] * len(points)
    for r in range(first + span[0], first + span[1]):
        word = hash_bits(np.uint32(pixel[r]) ^ np.uint32(seed))
        shift_u, shift_v = hash_bits(word ^ np.uint32(0x68E31DA4)), hash_bits(word ^ np.uint32(0xB5297A4D))
        normal = (np.float64(normals[0, r]), np.float64(normals[1, r]), np.float64(normals[2, r]))
        for s in range(len(points)):
            u = ((points[s, 0] ^ shift_u) + 0.5) * 2.0**-32
            v = ((points[s, 1] ^ shift_v) + 0.5) * 2.0**-32
            x, y, z = cosine_direction(u, v)
            w = around(normal, x, y, z)
            above = facing[0, r] * w[0] + facing[1, r] * w[1] + facing[2, r] * w[2]
            reaches[ray] = reach if above > 0 else 0
            travelled[ray] = 0
            cosines[ray] = z
            for c in range(3):
                origins[ray, c] = starts[c, r]
                directions[ray, c] = w[c]
                weights[ray, c] = np.pi / len(points)
            ray += 1


@kernel(parallel=True)
def gather(surfaces: Surfaces, lights: LightTable, k: int, limits: tuple[float, float, float], paths: Paths,
           shadows: Shadows) -> None:
    """Write the shadow ray from each surface that was found to one light, and what it is worth.

    Parameters
    ----------
    surfaces : Surfaces
        The scene.
    lights : LightTable
        The lights, float64.
    k : int
        Which light.
    limits : tuple of 3 floats
        Bound on G in units of 1 / footprint (0: none), measure of one light direction (sr or m^2), and how far rays
        start above faces (m).
    paths : Paths
        What was found.
    shadows : Shadows
        Origins, directions, reach and worth are filled; the reach is 0 where there is nothing to gain.
    """
    count = len(paths.reach)
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        _gather(surfaces, lights, k, limits, paths, shadows, (chunk * CHUNK, min(count, chunk * CHUNK + CHUNK)))


@kernel
def _gather(surfaces: Surfaces, lights: LightTable, k: int, limits: tuple[float, float, float], paths: Paths,
            shadows: Shadows, span: tuple[int, int]) -> None:
    bound, measure, offset = limits
    directional = lights.kind[k] == DIRECTIONAL
    for ray in range(span[0], span[1]):
        triangle = paths.triangle_id[ray]
        shadows.reach[ray] = 0
        if triangle == MISS:
            continue
        material = surfaces.material_of_face[triangle]
        w, y = _found(paths, ray)
        # what ends here most often is asked first, before anything is divided or normalised
        toward = _toward_light(lights, k, y)
        cross = face_cross(surfaces, triangle)
        side, side_out = _dot(cross, toward), _dot(cross, w)
        if side * side_out <= 0:
            continue
        rho, glossy = _row(surfaces.diffuse, material), _row(surfaces.specular, material)
        has_lobe = max(glossy[0], glossy[1], glossy[2]) > 0
        least = 0.0  # pattern that the light side has: b r^2 / <n_x.w>, as G = pattern <n_x.w> / r^2
        if bound > 0:
            length = np.float64(paths.travelled[ray]) + paths.distance[ray]
            area = measure if directional else measure * _dot(toward, toward)
            least = bound * length * length / (area * paths.cosine[ray])
            if least >= 1 and not has_lobe:
                continue
        lx, ly, lz, _, red, green, blue = incident_light(lights, k, y[0], y[1], y[2])
        if max(red, green, blue) <= 0:
            continue
        light, irradiance = (lx, ly, lz), (red, green, blue)
        scale = math.copysign(1 / math.sqrt(_dot(cross, cross)), side)
        g = (cross[0] * scale, cross[1] * scale, cross[2] * scale)
        n = shading_normal(surfaces, triangle, y, g)
        # radiance = rho F / pi * pattern / <g.w>, F = E_perp <g.l>
        factor = _dot(g, light) / (np.pi * _dot(g, w))
        # pattern times max(0, (G - b) / G)
        diffuse, lobe = max(0.0, _dot(n, w) - least), 0.0
        if has_lobe:
            lobe = max(0.0, lobe_pattern(surfaces, material, n, light, w) - least)
        most = 0.0
        for c in range(3):
            worth = paths.weight[ray, c] * factor * irradiance[c] * (rho[c] * diffuse + glossy[c] * lobe)
            most = max(most, worth)
            shadows.worth[ray, c] = worth
            shadows.origin[ray, c] = y[c] + offset * g[c]
            shadows.direction[ray, c] = toward[c] if directional else toward[c] - offset * g[c]
        if most > 0:
            shadows.reach[ray] = np.inf if directional else 1.0


@kernel
def _toward_light(lights: LightTable, k: int, y: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return the vector from a point to a light, of length 1 if that is infinitely far."""
    if lights.kind[k] == DIRECTIONAL:
        return -lights.direction[k, 0], -lights.direction[k, 1], -lights.direction[k, 2]
    return lights.position[k, 0] - y[0], lights.position[k, 1] - y[1], lights.position[k, 2] - y[2]


@kernel
def _dot(a: tuple[float, float, float], b: tuple[float, float, float]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def _found(paths: Paths, ray: int) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Return the direction back along a ray and the point it found."""
    t = np.float64(paths.distance[ray])
    dx, dy, dz = _row(paths.direction, ray)
    ox, oy, oz = _row(paths.origin, ray)
    return (-dx, -dy, -dz), (ox + t * dx, oy + t * dy, oz + t * dz)


@kernel
def _row(rows: Array, i: int) -> tuple[float, float, float]:
    """Return a row of three as scalars: a view of it would count references, over which threads stall."""
    return np.float64(rows[i, 0]), np.float64(rows[i, 1]), np.float64(rows[i, 2])


@kernel(parallel=True)
def pass_through(surfaces: Surfaces, offset: float, paths: Paths) -> None:
    """Move each ray to the far side of what it found, with the same direction.

    Parameters
    ----------
    surfaces : Surfaces
        The scene.
    offset : float
        How far rays start above faces, m.
    paths : Paths
        Origins, reach and lengths are moved on; rays that found nothing end.
    """
    for ray in prange(len(paths.reach)):
        _pass_through(surfaces, offset, paths, ray)


@kernel
def _pass_through(surfaces: Surfaces, offset: float, paths: Paths, ray: int) -> None:
    if paths.triangle_id[ray] == MISS:
        paths.reach[ray] = 0
        return
    w, y = _found(paths, ray)
    g = face_normal(surfaces, paths.triangle_id[ray], w[0], w[1], w[2])  # on the side the ray leaves to
    for c in range(3):
        paths.origin[ray, c] = y[c] + offset * g[c]
    paths.travelled[ray] += paths.distance[ray]
    paths.reach[ray] -= paths.distance[ray]


@kernel(parallel=True)
def scatter(surfaces: Surfaces, offset: float, seed: int, to: Receivers, first: int, per_receiver: int,
            paths: Paths) -> None:
    """Send each path on from the surface it found, by that surface's reflection.

    Parameters
    ----------
    surfaces : Surfaces
        The scene.
    offset : float
        How far rays start above faces, m.
    seed : int
        Random numbers: a hash of it, the receiver's pixel and the path's number there.
    to : Receivers
        Receivers.
    first : int
        Receiver of the first path.
    per_receiver : int
        Paths of each receiver.
    paths : Paths
        Origins, directions, reach and weights are renewed; paths that found nothing or a black surface end.

    Notes
    -----
    One of the two parts is chosen by its largest reflectance, with probability p. With v the way back, the diffuse
    part sends on a cosine-distributed direction around the face normal g with weight rho <n.v> / (<g.v> p), the lobe a
    direction around the mirror direction of v with density (P + 1) / (2 pi) cos^P and weight rho <g.w> / (K <g.v> p),
    K for light that comes from w.
    """
    for ray in prange(len(paths.reach)):
        pixel = to.pixel[first + ray // per_receiver]
        word = hash_bits(hash_bits(np.uint32(pixel) ^ np.uint32(seed)) + np.uint32(ray % per_receiver))
        _scatter(surfaces, offset, word, paths, ray)


@kernel
def _scatter(surfaces: Surfaces, offset: float, word: Any, paths: Paths, ray: int) -> None:
    triangle = paths.triangle_id[ray]
    paths.reach[ray] = 0
    if triangle == MISS:
        return
    material = surfaces.material_of_face[triangle]
    rho, glossy = _row(surfaces.diffuse, material), _row(surfaces.specular, material)
    most, most_glossy = max(rho[0], rho[1], rho[2]), max(glossy[0], glossy[1], glossy[2])
    if most + most_glossy <= 0:
        return
    u, v = _uniform(word ^ np.uint32(0x68E31DA4)), _uniform(word ^ np.uint32(0xB5297A4D))
    chance = most / (most + most_glossy)
    back, y = _found(paths, ray)
    g = face_normal(surfaces, triangle, -back[0], -back[1], -back[2])
    n = shading_normal(surfaces, triangle, y, g)
    cos_g, cos_n = _dot(g, back), _dot(n, back)
    if cos_g <= 0 or cos_n <= 0:
        return
    if _uniform(word ^ np.uint32(0x1B56C4E9)) < chance:
        x0, x1, x2 = cosine_direction(u, v)
        w = around(g, x0, x1, x2)
        part, factor = rho, cos_n / (cos_g * chance)
    else:
        exponent = surfaces.exponent[material]
        z = u ** (1 / (exponent + 1))
        across, phi = math.sqrt(max(0.0, 1 - z * z)), 2 * np.pi * v
        mirror = (2 * cos_n * n[0] - back[0], 2 * cos_n * n[1] - back[1], 2 * cos_n * n[2] - back[2])
        w = around(mirror, across * math.cos(phi), across * math.sin(phi), z)
        part, factor = glossy, _dot(g, w) / (lobe_fraction(_dot(n, w), exponent) * cos_g * (1 - chance))
    if _dot(g, w) <= 0:
        return
    paths.reach[ray] = np.inf
    for c in range(3):
        paths.origin[ray, c] = y[c] + offset * g[c]
        paths.direction[ray, c] = w[c]
        paths.weight[ray, c] *= part[c] * factor


@kernel
def _uniform(word: Any) -> Any:
    return (hash_bits(word) + 0.5) * 2.0**-32

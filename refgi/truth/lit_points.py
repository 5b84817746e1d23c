"""Directly lit surface points, found by fresh rays from every light: the senders of the light side.

Phi = rho I(l) Omega for a spot or point light, rho E_perp A_perp for a directional one (papers' calibrated radiometry):
no cosine and no distance. A point whose material has a lobe appears twice, once for each part.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel
from refgi.lobes import lobe_norm
from refgi.radiometry import DIRECTIONAL, radiant_intensity
from refgi.rays import MISS, Tracer
from refgi.scene import LightTable
from refgi.truth.light_grid import LightRays
from refgi.truth.surfaces import Surfaces, face_normal, height_above, shading_normal

Array = npt.NDArray[Any]

BLOCK = 32  # points whose contributions are summed before a pick looks inside


class LitPoints(NamedTuple):
    """Senders, as float32 arrays padded with dark points to whole blocks."""

    position: Array  # (3, n), m
    axis: Array  # (3, n) unit vector of the emission: shading normal, or mirror direction of a lobe
    normal: Array  # (3, n) shading normal
    facing: Array  # (3, n) face normal on the lit side
    power: Array  # (n,) largest channel of Phi / pi, W/sr
    colour: Array  # (3, n) Phi / pi over `power`
    exponent: Array  # (n,) of cos around the axis: 1 for the diffuse part
    peak: Array  # (n,) pattern on the axis: 1, or (P + 1) / (2 K)
    bound: Array  # (n,) largest geometry term left to the light side, 1/m^2


def trace_lit_points(tracer: Tracer, surfaces: Surfaces, lights: LightTable, k: int, rays: LightRays,
                     bound: float) -> LitPoints:
    """Trace one light's rays to the surface points they light.

    Parameters
    ----------
    tracer : Tracer
        The scene's rays.
    surfaces : Surfaces
        What they find.
    lights : LightTable
        The lights, float64.
    k : int
        Which light.
    rays : LightRays
        Its rays.
    bound : float
        Largest geometry term in units of 1 / footprint; inf for no bound.

    Returns
    -------
    LitPoints
        In the order of the rays, without dark points, not padded.
    """
    # a lamp may lie in a surface: look from just beyond it
    beyond = tracer.offsets(rays.origins)
    origins = (rays.origins + beyond[:, None] * rays.directions).astype(np.float32)
    directions = rays.directions.astype(np.float32)
    count = len(origins)
    triangle_id, distance = np.empty(count, np.int32), np.empty(count, np.float32)
    tracer.fill_closest(origins, directions, np.full(count, np.inf, np.float32), triangle_id, distance)
    distance += beyond.astype(np.float32)
    points = _empty(2 * count)
    used = _fill(surfaces, lights, k, (rays.origins, rays.directions, triangle_id, distance),
                 (rays.measure, bound), points)
    return LitPoints(*(part[..., :used] for part in points))


def join(parts: list[LitPoints]) -> LitPoints:
    """Put the points of several lights in one list, padded with dark points to whole blocks.

    Parameters
    ----------
    parts : list of LitPoints
        One a light.

    Returns
    -------
    LitPoints
        C-contiguous arrays; their length is a multiple of `BLOCK`.
    """
    missing = -sum(len(part.power) for part in parts) % BLOCK
    padded = [*parts, LitPoints(*(field[..., :missing] for field in _empty(BLOCK)))]
    return LitPoints(*(np.concatenate(fields, axis=-1) for fields in zip(*padded, strict=True)))


def _empty(count: int) -> LitPoints:
    position, axis, normal, facing, colour = (np.zeros((3, count), np.float32) for _ in range(5))
    power, exponent, peak, bound = (np.zeros(count, np.float32) for _ in range(4))
    return LitPoints(position, axis, normal, facing, power, colour, exponent, peak, bound)


@kernel
def _fill(surfaces: Surfaces, lights: LightTable, k: int, hits: tuple[Array, Array, Array, Array],
          scale: tuple[float, float], points: LitPoints) -> int:
    origins, directions, triangle_id, distances = hits
    measure, bound = scale
    used = 0
    for i in range(len(triangle_id)):
        if triangle_id[i] == MISS:
            continue
        triangle = triangle_id[i]
        material = surfaces.material_of_face[triangle]
        d = (directions[i, 0], directions[i, 1], directions[i, 2])
        t = np.float64(distances[i])
        y = (origins[i, 0] + t * d[0], origins[i, 1] + t * d[1], origins[i, 2] + t * d[2])
        g = face_normal(surfaces, triangle, d[0], d[1], d[2])
        height = height_above(surfaces, triangle, y, g)
        y = (y[0] - height * g[0], y[1] - height * g[1], y[2] - height * g[2])
        n = shading_normal(surfaces, triangle, y, g)
        cos_in = -(n[0] * d[0] + n[1] * d[1] + n[2] * d[2])
        mirrored = (d[0] + 2 * cos_in * n[0], d[1] + 2 * cos_in * n[1], d[2] + 2 * cos_in * n[2])
        if lights.kind[k] == DIRECTIONAL:
            light, area = (lights.intensity[k, 0], lights.intensity[k, 1], lights.intensity[k, 2]), measure
        else:
            light, area = radiant_intensity(lights, k, d[0], d[1], d[2]), measure * t * t
        for part in range(2):
            rho = surfaces.diffuse[material] if part == 0 else surfaces.specular[material]
            flux = (rho[0] * light[0] * measure / np.pi, rho[1] * light[1] * measure / np.pi,
                    rho[2] * light[2] * measure / np.pi)
            power = max(flux[0], flux[1], flux[2])
            if power <= 0:
                continue
            exponent = 1.0 if part == 0 else surfaces.exponent[material]
            points.power[used] = power
            points.exponent[used] = exponent
            points.peak[used] = 1.0 if part == 0 else np.pi * lobe_norm(cos_in, exponent)
            points.bound[used] = bound / area
            for c in range(3):
                points.position[c, used] = y[c]
                points.axis[c, used] = n[c] if part == 0 else mirrored[c]
                points.normal[c, used] = n[c]
                points.facing[c, used] = g[c]
                points.colour[c, used] = flux[c] / power
            used += 1
    return used

"""Triangles and materials for kernels, and the radiance that a directly lit point reflects.

Symbols: y a lit point, n its shading normal and g its face normal, both on the side of the light, l the direction to
the light, F = I(l) cos(g, l) / d^2 the incident flux per area, w a direction away from y.

- Diffuse: intensity per area rho_d F / pi <n.w>, so that a whole texel sends Phi / pi <n.w>, the RSM's convention.
- Lobe: rho_s F (P + 1) / (2 pi K) <r.w>^P [n.w > 0], r the mirror direction about n, K the part above the surface.

Both are written rho F / pi * pattern(w), where pattern is <n.w>, or (P + 1) / (2 K) <r.w>^P. Light leaves only on the
side of the light, g.w > 0, where faces hide what lies behind them (`refgi.truth.paths.Sides`).
"""

import math
from typing import Any, NamedTuple

import numpy as np

from refgi.jit import kernel
from refgi.radiometry import lobe_gap, lobe_norm, lobe_power, orthonormal_basis
from refgi.rays import ray_offset
from refgi.scene import LightTable, Scene, light_table, material_table
from refgi.scene.material import as_senders
from refgi.scene.texture.table import TextureTable
from refgi.types import Array

ROUNDING = 2.0**-25  # of a float32 sum


class Surfaces(NamedTuple):
    """Triangles and their materials, for kernels."""

    vertices: Array  # (n, 3) float64, m
    faces: Array  # (m, 3) int32
    normals: Array  # (n, 3) float64 vertex normals, or (0, 3) where faces are flat
    material_of_face: Array  # (m,) int32
    diffuse: Array  # (k, 3) float64 reflectances by material; dielectrics are black
    specular: Array  # (k, 3) float64
    exponent: Array  # (k,) float64
    uv: Array | None = None  # (m, 3, 2) float64 texture coordinates, where there are textures
    textures: TextureTable | None = None  # that multiply `diffuse`: `refgi.truth.paths.diffuse_at`
    colours: Array | None = None  # (m, 3, 3) float64 vertex colours that multiply `diffuse`, where there are some


def surfaces(scene: Scene, mirror_exponent: float = math.inf) -> Surfaces:
    """Lay out a scene's triangles and materials for kernels, as they light others.

    `mirror_exponent`: lobes of at least this exponent are left out. Result: dielectrics have no reflectance in it.
    """
    geometry, table = scene.geometry, material_table(as_senders(scene.materials))
    table.diffuse[table.ior > 0] = 0
    table.specular[(table.ior > 0) | (table.exponent >= mirror_exponent)] = 0
    normals = geometry.vertex_normals
    textured = None if table.textures is None else table.textures.table
    return Surfaces(np.ascontiguousarray(geometry.vertices, np.float64), np.ascontiguousarray(geometry.faces, np.int32),
                    np.zeros((0, 3)) if normals is None else np.ascontiguousarray(normals, np.float64),
                    np.ascontiguousarray(geometry.material_of_face, np.int32), table.diffuse, table.specular,
                    table.exponent, None if textured is None else np.ascontiguousarray(geometry.uv, np.float64),
                    textured, None if geometry.colours is None else np.ascontiguousarray(geometry.colours))


def lights_of(scene: Scene) -> LightTable:
    """Return a scene's lights for kernels in float64; one row a light."""
    return light_table(scene.lights)


@kernel
def face_cross(surfaces: Surfaces, triangle: int) -> tuple[float, float, float]:
    """Return the cross product of two edges of a triangle: along its normal, twice its area long."""
    v = surfaces.vertices
    i, j, k = surfaces.faces[triangle, 0], surfaces.faces[triangle, 1], surfaces.faces[triangle, 2]
    ax, ay, az = v[j, 0] - v[i, 0], v[j, 1] - v[i, 1], v[j, 2] - v[i, 2]
    bx, by, bz = v[k, 0] - v[i, 0], v[k, 1] - v[i, 1], v[k, 2] - v[i, 2]
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@kernel
def face_normal(surfaces: Surfaces, triangle: int, dx: float, dy: float, dz: float) -> tuple[float, float, float]:
    """Return a triangle's unit normal on the side against a direction.

    `dx`, `dy`, `dz`: direction of a ray or of light towards the surface. Result: unit vector g with g.d <= 0.
    """
    nx, ny, nz = face_cross(surfaces, triangle)
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    scale = (-1.0 if nx * dx + ny * dy + nz * dz > 0 else 1.0) / length
    return nx * scale, ny * scale, nz * scale


@kernel
def shading_normal(surfaces: Surfaces, triangle: int, y: tuple[float, float, float],
                   g: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return the interpolated unit normal at a point, on the side of the face normal g; g itself on flat faces.

    `triangle`: which one the point lies on. `y`: the point, m. Result: unit vector n with n.g >= 0.
    """
    if len(surfaces.normals) == 0:
        return g
    v, n = surfaces.vertices, surfaces.normals
    faces = surfaces.faces
    nx, ny, nz = 0.0, 0.0, 0.0
    for c in range(3):
        i, j, k = faces[triangle, (c + 1) % 3], faces[triangle, (c + 2) % 3], faces[triangle, c]
        ax, ay, az = v[i, 0] - y[0], v[i, 1] - y[1], v[i, 2] - y[2]
        bx, by, bz = v[j, 0] - y[0], v[j, 1] - y[1], v[j, 2] - y[2]
        # area of the part opposite to corner c, signed along g up to one sign for all three
        part = (ay * bz - az * by) * g[0] + (az * bx - ax * bz) * g[1] + (ax * by - ay * bx) * g[2]
        nx += part * n[k, 0]
        ny += part * n[k, 1]
        nz += part * n[k, 2]
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    if length == 0:
        return g
    scale = (-1.0 if nx * g[0] + ny * g[1] + nz * g[2] < 0 else 1.0) / length
    return nx * scale, ny * scale, nz * scale


@kernel
def height_above(surfaces: Surfaces, triangle: int, y: tuple[float, float, float],
                 g: tuple[float, float, float]) -> Any:
    """Return how far the rounding of a ray's distance moved a found point off its face.

    `triangle`: which triangle was found. `y`: where, m. Result: length along g, m.
    """
    v, i = surfaces.vertices, surfaces.faces[triangle, 0]
    return (y[0] - v[i, 0]) * g[0] + (y[1] - v[i, 1]) * g[1] + (y[2] - v[i, 2]) * g[2]


@kernel
def lift(surfaces: Surfaces, triangle: int, y: tuple[float, float, float], g: tuple[float, float, float],
         grain: float) -> Any:
    """Return how far along the face normal from a found point a ray must start.

    `triangle`: which triangle was found. `y`: where, as the ray's rounded distance has it, m. `g`: unit face normal on
    the side to start on. `grain`: the tracer's, m. Result: length, m: the offset from the face.
    """
    return ray_offset(y[0], y[1], y[2], grain) - height_above(surfaces, triangle, y, g)


@kernel
def lobe_above(pattern: float, glossy: tuple[float, float, float], cosine: float,
               rho: tuple[float, float, float]) -> float:
    """Return a lobe's pattern, 0 where float32 would not tell it beside what the diffuse part sends the same way.

    `glossy`, `rho`: reflectances of both. `cosine`: <n.w>, the diffuse pattern.
    """
    least = ROUNDING * max(0.0, cosine) * min(rho[0], rho[1], rho[2])
    return pattern if pattern * max(glossy[0], glossy[1], glossy[2]) > least else 0.0


@kernel
def lobe_pattern(surfaces: Surfaces, material: int, n: tuple[float, float, float], light: tuple[float, float, float],
                 w: tuple[float, float, float]) -> Any:
    """Return (P + 1) / (2 K) <r.w>^P [n.w > 0], the lobe's emission relative to diffuse rho F / pi.

    `n`, `light`, `w`: shading normal, towards the light, away from the point; unit vectors, but for w, whose length may
    be rounded. Result: the pattern; its integral over directions above the surface is pi.
    """
    exponent = surfaces.exponent[material]
    cos_in = n[0] * light[0] + n[1] * light[1] + n[2] * light[2]
    cos_out = n[0] * w[0] + n[1] * w[1] + n[2] * w[2]
    if cos_out <= 0:
        return 0.0
    twice = 2 * cos_in  # r = 2 (n.l) n - l
    gap = lobe_gap(twice * n[0] - light[0], twice * n[1] - light[1], twice * n[2] - light[2], w[0], w[1], w[2])
    # SII Eq. (3), normalised by K, over the diffuse 1 / pi
    return np.pi * lobe_norm(cos_in, exponent) * lobe_power(gap, exponent) if gap < 1 else 0.0


@kernel
def around(axis: tuple[float, float, float], x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return a local direction (z along the axis) in world space, of the same length."""
    tx, ty, tz, bx, by, bz = orthonormal_basis(axis[0], axis[1], axis[2])
    return (tx * x + bx * y + axis[0] * z, ty * x + by * y + axis[1] * z, tz * x + bz * y + axis[2] * z)

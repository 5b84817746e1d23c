"""The ground truth: irradiance by light of so many bounces, random directions and rays (docs/radiometry, docs/truth).

E(x) = int L(x, w) <n.w> dw over the hemisphere of n. A direction of density cos/pi is worth pi L, and L is what the
surface that its ray meets first reflects of its lamps' irradiance and, with one bounce more, of what one direction from
there is worth. A ray that meets nothing brings nothing: there is no sky. Lamps are no surfaces, and the direct light of
x itself does not count; nor does its albedo/pi. Surfaces reflect on both sides, each what arrives on its own.

Symbols: x, n, g receiver, its normal and that of its face on the same side; w direction from x; y, m, f what its ray
meets, likewise, on the side of x; xi random numbers. Arrays are (3, pixel, sample).
A mesh is vertices, faces, materials of faces, vertex normals or None; materials are diffuse and specular reflectance
and exponents; lamps are places, directions of light, strengths, half-angles of cones, one row each.
"""

from functools import cache
from typing import Any

import numpy as np

from refgi.literal.buffers import barycentric, interpolated, unit
from refgi.literal.direct import distance, lamp_irradiance, map_texels, shadow_rays, to_lamp
from refgi.literal.pairs import lobe_norm
from refgi.literal.vpl import facing

LIFT = 1e-5  # m: rays begin off their surfaces


def path_traced(
    position: Any, normal: Any, triangle_id: Any, xi: Any, mesh: Any, materials: Any, lamps: Any, kinds: Any,
    blocked: bool = True, camera: Any = None,
) -> Any:
    """Return E (3, h, w), W/m^2, the variance of that mean and the samples (h, w) of each pixel.

    `xi` (bounce, 2, sample, h, w), samples in pairs, which may share a cell of the unit square; `kinds`: falloff of
    each spot, else "point" or "directional". Not `blocked`: every surface along a ray counts. With a `camera` (eye,
    axes, half) only what it sees sends light.
    """
    seen, samples = triangle_id >= 0, xi.shape[2]
    face = facing(mesh[0], mesh[1], normal, triangle_id)
    x, n, g = (one[:, seen][:, :, None].repeat(samples, axis=2) for one in (position, normal, face))
    _, each = arriving(x, n, g, np.moveaxis(xi[..., seen], 2, 3), (mesh, materials, lamps, kinds, blocked, camera))
    mean, variance = np.zeros((2, *position.shape))
    mean[:, seen] = each.mean(axis=2)
    variance[:, seen] = ((each[:, :, ::2] - each[:, :, 1::2]) ** 2).sum(axis=2) / samples**2
    return mean, variance, np.where(seen, samples, 0)


def arriving(x: Any, n: Any, g: Any, xi: Any, scene: Any) -> Any:
    """Return a direction w of each sample, and the irradiance pi L that it is worth, W/m^2."""
    (vertices, faces, _, _), _, _, _, blocked, _ = scene
    w = cosine_direction(n, *xi[0])
    above = (g * w).sum(axis=0) > 0
    total = np.zeros_like(x)
    for triangle, t in met(vertices, faces, x + LIFT * g, w, blocked):
        hit = above & (triangle >= 0)
        y, back, one = (x + LIFT * g + t * w)[:, hit], -w[:, hit], triangle[hit]
        L = radiance(y[:, :, None], back[:, :, None], one[:, None], xi[1:][:, :, hit][..., None], scene)
        # E = pi L of a direction of density cos/pi
        total[:, hit] += np.pi * L[:, :, 0]
    return w, total


def met(vertices: Any, faces: Any, o: Any, d: Any, blocked: bool) -> Any:
    """Return triangle, -1 for none, and distance of what rays meet first; all that they meet, if not `blocked`."""
    nearest, triangle, every = np.full(d.shape[1:], np.inf), np.full(d.shape[1:], -1), []
    for k, corners in enumerate(vertices[faces]):
        t = distance(corners, o, d)
        triangle = np.where(t < nearest, k, triangle)
        nearest = np.minimum(t, nearest)
        every.append((np.where(t < np.inf, k, -1), np.where(t < np.inf, t, 0)))
    return [(triangle, np.where(triangle >= 0, nearest, 0))] if blocked else every


def radiance(y: Any, back: Any, triangle: Any, xi: Any, scene: Any) -> Any:
    """Return L, W/m^2/sr, that points of triangles reflect along `back`: of lamps, and of what xi has left."""
    (vertices, faces, material_of_face, vertex_normals), materials, lamps, kinds, _, camera = scene
    f = facing(vertices, faces, back, triangle)
    m = f
    if vertex_normals is not None:
        corner, normals = (np.moveaxis(one[faces[triangle]], (2, 3), (0, 1)) for one in (vertices, vertex_normals))
        m = interpolated(barycentric(corner, f, y), normals, f)
    own = tuple(np.moveaxis(one[material_of_face[triangle]], -1, 0) if one.ndim > 1 else one[
        material_of_face[triangle]] for one in materials)
    L = np.zeros_like(y)
    for place, direction, strength, half_angles, kind in zip(*lamps, kinds, strict=True):
        lamp = (None if kind == "directional" else place), direction
        cone = (None, "") if kind in ("point", "directional") else (half_angles, kind)
        free = shadow_rays(y, f, triangle, vertices, faces, *lamp, LIFT)
        E = lamp_irradiance(y, f, strength, *lamp, *cone) * free
        L += reflected(unit(to_lamp(y, *lamp)), back, m, f, *own) * E
    if len(xi):
        w, E = arriving(y, f, f, xi, scene)
        L += reflected(w, back, m, f, *own) * E
    if camera is not None:
        eye, axes, half = camera
        on_picture = map_texels(y, eye, axes, half, 1, 1, parallel=False)[0] >= 0
        L = L * (on_picture & shadow_rays(y, f, triangle, vertices, faces, eye[0], None, LIFT))
    return L


def reflected(w: Any, back: Any, m: Any, f: Any, diffuse: Any, specular: Any, exponent: Any) -> Any:
    """Return L along `back` per irradiance of the face from w, 1/sr: (rho/pi <m.back> + lobe) / <f.back>.

    Where normals are interpolated the light's flux is that of the face, and its pattern that of m (SII Eq. 3).
    """
    pattern = diffuse / np.pi * np.maximum(0, (m * back).sum(axis=0))
    if specular.any():
        mirror = 2 * (m * w).sum(axis=0) * m - w
        cosine = (mirror * back).sum(axis=0)
        shape = np.where((cosine > 0) & ((m * back).sum(axis=0) > 0), np.maximum(0, cosine) ** exponent, 0)
        norm = np.zeros_like(exponent)
        for power in np.unique(exponent):
            here = exponent == power
            norm[here] = np.interp(np.arccos(np.clip((m * mirror).sum(axis=0)[here], -1, 1)), *norms(power))
        pattern = pattern + specular * norm * shape
    return pattern / (f * back).sum(axis=0)


@cache
def norms(power: float) -> Any:
    """Return angles between axis and normal, rad, and the norm of a lobe there, 1/sr (`pairs.lobe_norm`)."""
    angle = np.linspace(0, np.pi, 1001)
    return angle, lobe_norm(np.cos(angle), power)


def cosine_direction(n: Any, u: Any, v: Any) -> Any:
    """Return directions of density cos/pi about normals, of points of the unit square."""
    sine, cosine = np.sqrt(u), np.sqrt(1 - u)
    aside = np.where(np.abs(n[:1]) < 0.5, np.reshape([1.0, 0, 0], (3, 1, 1)), np.reshape([0, 1.0, 0], (3, 1, 1)))
    s = unit(np.cross(n, aside, axis=0))
    t = np.cross(n, s, axis=0)
    return sine * np.cos(2 * np.pi * v) * s + sine * np.sin(2 * np.pi * v) * t + cosine * n

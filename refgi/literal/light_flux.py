"""Flux that each texel of a light's map reflects (SII Sec. 3.1; docs/radiometry).

Phi_t = albedo int_t I dw, or I Omega_t where I is constant: neither a cosine nor a distance, both are in the solid
angle. A spot's intensity changes over a texel, so it is integrated; a directional light has irradiance in place of
intensity, and texels areas.

Symbols: t share of the way from outer to inner cone, by cosines; a angle off the spot's axis; x, y image plane, whose
density of solid angle is cos^3 a = (1 + x^2 + y^2)^(-3/2). Maps are those of `buffers`: (H, W) texels.
"""

from typing import Any

import numpy as np

from refgi.literal.buffers import rays, surface, texels, tint, unit

NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)


def reflected_flux(
    triangle_id: Any, vertices: Any, faces: Any, material_of_face: Any, diffuse: Any, specular: Any, exponent: Any,
    origin: Any, frame: Any, half: Any, strength: Any, rows: int, columns: int, parallel: bool,
    half_angles: Any = None, falloff: str = "smoothstep", vertex_normals: Any = None, colours: Any = None,
) -> Any:
    """Return solid angle, sr, flux (3, H, W), W, and the lobe's flux, W, axis (3, H, W) and exponent of each texel.

    `strength` (3,): intensity, W/sr; of a directional light (parallel rays) irradiance, W/m^2, and areas, m^2, stand
    for solid angles. `half_angles` (2,): inner and outer, rad, of a spot. Lobes are 0, axis and exponent as well, where
    the surface has none and where no light arrives. Vertex `colours` (m, 3, 3) multiply the diffuse flux.
    """
    x0, x1, y0, y1 = texel_sides(half, len(origin), rows, columns)
    angle = (x1 - x0) * (y1 - y0) if parallel else solid_angle(x0, x1, y0, y1)
    through = angle
    if half_angles is not None:
        inner, outer = half_angles
        through = spot_integral(x0, x1, y0, y1, inner, outer, falloff)
    seen = triangle_id >= 0
    _, d = rays(origin, frame, half, rows, columns, parallel)
    _, point, n, _ = surface(triangle_id, vertices, faces, material_of_face, diffuse, origin, frame, half, rows,
                             columns, parallel, vertex_normals)
    w = unit(d)
    arriving = strength.reshape(3, 1, 1) * np.where(seen, through, 0)
    material = material_of_face[triangle_id]
    flux = np.moveaxis(diffuse[material], -1, 0) * arriving
    if colours is not None:
        flux = flux * tint(triangle_id, point, vertices, faces, colours)
    lobe_flux = np.moveaxis(specular[material], -1, 0) * arriving
    glossy = (lobe_flux > 0).any(axis=0)
    axis = w - 2 * (n * w).sum(axis=0) * n
    own = exponent[material]
    return angle, flux, lobe_flux, np.where(glossy, axis, 0), np.where(glossy, own, 0)


def texel_sides(half: Any, maps: int, rows: int, columns: int) -> Any:
    """Return the bounds x0, x1, y0, y1 of every texel on the image plane: (H, W) each."""
    row, column = texels(maps, rows, columns)
    x0, x1 = ((2 * (column + end) / columns - 1) * half[0] for end in (0, 1))
    y0, y1 = ((2 * (row + end) / rows - 1) * half[1] for end in (0, 1))
    return x0, x1, y0, y1


def solid_angle(x0: Any, x1: Any, y0: Any, y1: Any) -> Any:
    """Return the solid angle, sr, of rectangles of the plane at distance 1: four values of its corner function."""
    return corner_angle(x1, y1) - corner_angle(x0, y1) - corner_angle(x1, y0) + corner_angle(x0, y0)


def corner_angle(x: Any, y: Any) -> Any:
    """Return the solid angle, sr, of the rectangle from the axis to (x, y)."""
    return np.arctan2(x * y, np.sqrt(1 + x * x + y * y))


def spot_share(cosine: Any, inner: Any, outer: Any, falloff: str = "smoothstep") -> Any:
    """Return the share of a spot's intensity at a cosine off its axis: 1 within `inner`, 0 beyond `outer`, rad."""
    span = (np.cos(inner) - np.cos(outer)) or 1e-30  # a hard edge
    t = np.clip((cosine - np.cos(outer)) / span, 0, 1)
    shares = {"smoothstep": t * t * (3 - 2 * t), "squared_ramp": t * t, "ramp": t}
    return shares[falloff]


def spot_integral(x0: Any, x1: Any, y0: Any, y1: Any, inner: Any, outer: Any, falloff: str = "smoothstep") -> Any:
    """Return the integral, sr, of a spot's share over rectangles of the plane at distance 1 on its axis.

    A Gauss-Legendre rule along x, and along y at each of its nodes, for each piece between the circles of the cones.
    """
    low, high = np.ravel(y0), np.ravel(y1)
    circles = np.tan(inner), np.tan(outer)
    cuts = crossings(circles, (low, high, 0 * low), np.ravel(x0), np.ravel(x1))
    texel, x, dx = nodes_between(cuts)
    low, high = (np.repeat(end[texel], len(NODES)) for end in (low, high))
    cuts = crossings(circles, (x.ravel(),), low, high)
    column, y, dy = nodes_between(cuts)
    square = 1 + x.reshape(-1, 1)[column] ** 2 + y**2
    density = square**-1.5
    share = spot_share(square**-0.5, inner, outer, falloff)
    along_column = np.bincount(column, (share * density * dy).sum(axis=1), x.size).reshape(x.shape)
    return np.bincount(texel, (along_column * dx).sum(axis=1), np.size(x0)).reshape(np.shape(x0))


def crossings(circles: Any, edges: Any, low: Any, high: Any) -> Any:
    """Return in order low, high and the places between them where circles cross lines at some distances: (cut, n)."""
    cuts = [low, high]
    for radius in circles:
        for edge in edges:
            reach = np.where(edge**2 < radius**2, np.sqrt(np.maximum(radius**2 - edge**2, 0)), np.inf)
            cuts += [np.clip(-reach, low, high), np.clip(reach, low, high)]
    return np.sort(cuts, axis=0)


def nodes_between(cuts: Any) -> Any:
    """Return of each piece between cuts, where it has a length: whose it is (p,), its nodes and weights (p, 16)."""
    whose, piece = np.nonzero((cuts[1:] > cuts[:-1]).T)
    low, high = cuts[piece, whose], cuts[piece + 1, whose]
    middle, length = (low + high)[:, None] / 2, (high - low)[:, None] / 2
    return whose, middle + length * NODES, length * WEIGHTS

"""Refraction through glass: glass texels of a reflective shadow map become pixel lights with lobes (SII Fig. 4).

The paper says "refraction only at the back-facing surface". In mode "back_face" light crosses the front face unbent and
is refracted at the nearest glass face along the same ray that looks away from the light; "two_interface" refracts at
the front as well and traces the ray to the exit. Either way the texel becomes a light at the exit: normal outwards,
lobe axis along the refracted ray, flux Phi = I(w) O T. Symbols: d direction of light, n normal on the side that light
goes to, eta index of refraction over that of the far side, T share that is not reflected (Fresnel, unpolarised).
"""

from typing import Any, Literal, NamedTuple, Protocol, get_args

import numpy as np

from refgi.errors import expect
from refgi.rsm.buffers.gbuffer import GBuffer
from refgi.rsm.buffers.light_projection import incident_flux
from refgi.rsm.buffers.reflective import Rsm
from refgi.rsm.raster.visibility_buffer import rasterize
from refgi.scene.material import SHARPEST
from refgi.scene.model import DirectionalLight, Geometry, MaterialTable
from refgi.skips import left_out
from refgi.stages import skip, stage
from refgi.types import Array

Mode = Literal["back_face", "two_interface"]


def refract(direction: Array, normal: Array, eta: Array) -> tuple[Array, Array]:
    """Bend rays (3, n) at smooth interfaces (Snell) and return what passes, (n,) (Fresnel, unpolarised).

    `eta` (n,) is the index of refraction on the near side over that on the far side. Where nothing passes, by total
    reflection or for light from the normal's side, directions stay.
    """
    cos_in = (direction * normal).sum(axis=0)
    sin2 = eta**2 * (1 - cos_in**2)
    passes = (sin2 < 1) & (cos_in > 0)
    cos_out = np.sqrt(np.where(passes, 1 - sin2, 1))
    bent = eta * direction + (cos_out - eta * cos_in) * normal
    bent /= np.linalg.norm(bent, axis=0)
    near = np.where(passes, cos_in, 1)
    along = (eta * near - cos_out) / (eta * near + cos_out)  # amplitude reflected, perpendicular polarisation
    across = (near - eta * cos_out) / (near + eta * cos_out)
    return np.where(passes, bent, direction), np.where(passes, 1 - (along**2 + across**2) / 2, 0)


class RayTracer(Protocol):
    """What finds the nearest triangle along rays, such as `refgi.rays.Tracer`."""

    def offsets(self, points: Array) -> Array:
        """Return how far a ray must start from a surface not to hit it at points (n, 3), m."""

    def closest(self, origins: Array, directions: Array) -> Any:
        """Return `triangle_id` (-1: none) and `distance` of the nearest hits of rays, (n, 3) each."""


class Exits(NamedTuple):
    """Where light leaves glass."""

    texel: Array  # (n,) of the flattened map
    position: Array  # (3, n) m, world space
    normal: Array  # (3, n) unit vector, outwards
    direction: Array  # (3, n) unit vector of the light inside
    eta: Array  # (n,) index of refraction
    share: Array  # (n,) that got so far


def refracted(
    rsm: Rsm, geometry: Geometry, materials: MaterialTable, mode: Mode = "back_face", exponent: float = 3000.0, *,
    tracer: RayTracer | None = None, fresnel: bool = True,
) -> Rsm:
    """Let the glass texels of a map send on the light that they take in.

    Parameters
    ----------
    rsm : Rsm
        What a light sees.
    geometry : Geometry
        The triangles of that map.
    materials : MaterialTable
        Their materials.
    mode : {"back_face", "two_interface"}
        Bend light where it leaves the glass alone, as published, or where it enters too.
    exponent : float
        Phong exponent P of the lobes around the refracted rays; the paper states none. A lobe is about a way / sqrt(P)
        wide where it lands, which should be near the distance between lights on the glass: 3000 suits 4096 lights.
    tracer : RayTracer, optional
        Traces rays through `geometry`; "two_interface" needs it where a material is glass.
    fresnel : bool
        Leave out what the faces reflect; False lets all through that is not totally reflected.

    Returns
    -------
    Rsm
        Glass texels have a lobe at the exit point: position, outward normal, `lobe_flux`, `lobe_axis` and
        `lobe_exponent`. Their depth, triangle and solid angle stay those of the front. The same object where light
        meets no glass.

    Raises
    ------
    InputError
        If the mode or exponent is not usable, or "two_interface" lacks its tracer.

    Notes
    -----
    Outside is where a triangle's vertex order says, as for path tracing. Light takes the first exit: of several bodies
    in a row, or of one that it would enter again, only the first passage bends it, and what glass reflects, outside or
    inside, is lost. An opaque surface in front of the exit ends the light, and so does glass without a back.
    """
    expect(mode in get_args(Mode), "mode", "'back_face' or 'two_interface'", mode)
    expect(0 <= exponent <= SHARPEST, "exponent", f"a Phong exponent from 0 to {SHARPEST:g}", exponent)
    has_glass = bool(materials.ior.any())
    if not has_glass and left_out("lights.refraction", lambda: (rsm.texels, rsm.texels)):
        skip("lights.refraction", "no material is glass")
        return rsm
    expect(mode == "back_face" or tracer is not None or not has_glass, "tracer", "one for the mode 'two_interface'",
           None)
    return _refracted(rsm, geometry, materials, exponent, tracer if mode == "two_interface" else None, fresnel)


@stage("lights.refraction")
def _refracted(
    rsm: Rsm, geometry: Geometry, materials: MaterialTable, exponent: float, tracer: RayTracer | None, fresnel: bool
) -> Rsm:
    """Find the exits of the light through glass texels and put lobes there.

    materials: Those of the triangles; `ior` > 0 is glass.
    exponent: Phong exponent of the lobes.
    tracer: Finds the exit of each refracted ray; None: back faces in the map's own projection, as published.
    fresnel: Whether each interface transmits its Fresnel share.
    -> Rsm: The map with texels of glass replaced by their exits: positions, m, and lobes with their flux, W.
    """
    glass = materials.ior[geometry.material_of_face] > 0
    texel = np.flatnonzero(np.append(glass, False)[rsm.triangle_id.reshape(-1)])  # the last for -1, no surface
    if not len(texel):
        return rsm
    away = _looks_away(rsm, geometry, glass)
    front = _fronts(rsm, geometry, materials, texel)
    enters = ~away[rsm.triangle_id.reshape(-1)[texel]]  # a light inside the glass meets its exit at once
    if tracer is None:
        behind = _without_fronts(geometry, glass, away)
        exits = _straight_exits(rsm, behind, materials, front, enters)
    else:
        exits = _bent_exits(geometry, materials, front, enters, tracer)
    axis, share = refract(exits.direction, exits.normal, exits.eta)
    if not fresnel:
        share = np.where(share > 0, 1.0, 0.0)
        exits = exits._replace(share=np.where(exits.share > 0, 1.0, 0.0))
    return _with_lobes(rsm, exits, axis, exits.share * share, exponent)


def _fronts(rsm: Rsm, geometry: Geometry, materials: MaterialTable, texel: Array) -> Exits:
    """Return where light meets glass, with normals along it."""
    position, against = (part.reshape(3, -1)[:, texel].astype(np.float64) for part in (rsm.position, rsm.normal))
    eta = materials.ior[geometry.material_of_face[rsm.triangle_id.reshape(-1)[texel]]].astype(np.float64)
    return Exits(texel, position, -against, _light_direction(rsm, position), eta, np.ones(len(texel)))


def _straight_exits(rsm: Rsm, behind: Geometry, materials: MaterialTable, front: Exits, enters: Array) -> Exits:
    """Find what lies first behind each front: glass that looks away from the light lets light out."""
    view = GBuffer(behind, materials, rsm.projection, rasterize(behind, rsm.projection), rsm.position.dtype)
    position, inward, material = (part.reshape(-1, rsm.texels)[:, front.texel] for part in
                                  view.resolve("position", "normal", "material_id"))
    _, share = refract(front.direction, front.normal, 1 / front.eta)
    eta = np.append(materials.ior, 0)[material[0]]  # -1: nothing
    exits = front._replace(position=position.astype(np.float64), normal=-inward.astype(np.float64),
                           eta=eta.astype(np.float64), share=np.where(enters, share, 1))
    return _select(exits, eta > 0)


def _bent_exits(geometry: Geometry, materials: MaterialTable, front: Exits, enters: Array, tracer: RayTracer) -> Exits:
    """Refract at the front and trace to the next glass face from within."""
    bent, share = refract(front.direction, front.normal, 1 / front.eta)
    start = front.position + tracer.offsets(front.position.T) * bent
    hits = tracer.closest(start.T, bent.T)
    triangle = np.maximum(hits.triangle_id, 0)
    position = start + np.where(hits.triangle_id >= 0, hits.distance, 0) * bent
    normal = _outward_normals(geometry, triangle, position)
    eta = materials.ior[geometry.material_of_face[triangle]].astype(np.float64)
    found = enters & (hits.triangle_id >= 0) & (eta > 0) & ((bent * normal).sum(axis=0) > 0)
    far = _select(Exits(front.texel, position, normal, bent, eta, share), found)
    at_once = _select(front, ~enters)
    return Exits(*(np.concatenate(parts, axis=-1) for parts in zip(far, at_once, strict=True)))


def _select(exits: Exits, chosen: Array) -> Exits:
    return Exits(*(part[..., chosen] for part in exits))


def _looks_away(rsm: Rsm, geometry: Geometry, glass: Array) -> Array:
    """Return which triangles are glass whose outer side looks away from the light."""
    away = np.zeros(len(glass), np.bool_)
    place = geometry.vertices[geometry.faces[glass, 0]].T
    away[glass] = (_face_cross(geometry, np.flatnonzero(glass)) * _light_direction(rsm, place)).sum(axis=0) > 0
    return away


def _without_fronts(geometry: Geometry, glass: Array, away: Array) -> Geometry:
    """Return the glass that looks away from the light, and the opaque triangles that may lie in front of it."""
    corner = geometry.vertices[np.unique(geometry.faces[glass])]
    # one bit a side of the glass's box: a triangle whose corners share one lies outside
    beyond = np.concatenate([geometry.vertices < corner.min(axis=0), geometry.vertices > corner.max(axis=0)], axis=1)
    side = np.packbits(beyond, axis=1)[:, 0][geometry.faces]
    chosen = away | (~glass & (side[:, 0] & side[:, 1] & side[:, 2] == 0))
    return geometry.selected(chosen)


def _light_direction(rsm: Rsm, position: Array) -> Array:
    """Return the unit vectors (3, n) along which light arrives at positions (3, n)."""
    if isinstance(rsm.light, DirectionalLight):
        along = np.broadcast_to(np.reshape(rsm.light.direction, (3, 1)), position.shape)
    else:
        along = position - np.reshape(rsm.light.position, (3, 1))
    return _unit(along)


def _face_cross(geometry: Geometry, triangle: Array) -> Array:
    """Return the triangles' normals (3, n), twice their areas long, on the side of their vertex order."""
    corner = geometry.vertices[geometry.faces[triangle]]
    return np.asarray(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]).T)


def _outward_normals(geometry: Geometry, triangle: Array, position: Array) -> Array:
    """Return the unit normals (3, n) at points of triangles, interpolated where the mesh has vertex normals."""
    normal = _face_cross(geometry, triangle)
    if geometry.vertex_normals is not None:
        faces = geometry.faces[triangle]
        spoke = geometry.vertices[faces] - position.T[:, None]
        # twice the areas opposite to the corners, times the face's normal
        part = [(np.cross(spoke[:, a], spoke[:, b]) * normal.T).sum(axis=1) for a, b in ((1, 2), (2, 0), (0, 1))]
        smooth = np.einsum("cn,nca->an", np.stack(part), geometry.vertex_normals[faces])
        normal = np.where((smooth * normal).sum(axis=0) > 0, smooth, normal)
    return _unit(normal)


def _unit(vectors: Array) -> Array:
    """Return vectors (3, n) at unit length; a light on the surface that it lights, and a flat triangle, give zero."""
    length = np.linalg.norm(vectors, axis=0)
    return np.asarray(np.divide(vectors, length, out=np.zeros(vectors.shape), where=length > 0))


def _with_lobes(rsm: Rsm, exits: Exits, axis: Array, share: Array, exponent: float) -> Rsm:
    """Return the map with lobes of the given axes and shares of the incident flux at the exits."""
    incident = incident_flux(rsm.light, rsm.projection, rsm.solid_angle, rsm.flux.dtype)
    transmits = share > 0
    texel = exits.texel[transmits]
    if rsm.lobe_flux is None or rsm.lobe_axis is None or rsm.lobe_exponent is None:
        dark = np.zeros_like(rsm.flux)
        rsm = rsm._replace(lobe_flux=dark, lobe_axis=dark, lobe_exponent=dark[0])

    def replaced(plane: Array | None, values: Array | float) -> Array:
        changed = np.array(plane)
        changed.reshape(*changed.shape[:-2], -1)[..., texel] = values
        return changed

    return rsm._replace(
        position=replaced(rsm.position, exits.position[:, transmits]),
        normal=replaced(rsm.normal, exits.normal[:, transmits]),
        lobe_flux=replaced(rsm.lobe_flux, incident.reshape(3, -1)[:, texel] * share[transmits]),
        lobe_axis=replaced(rsm.lobe_axis, axis[:, transmits]), lobe_exponent=replaced(rsm.lobe_exponent, exponent),
    )

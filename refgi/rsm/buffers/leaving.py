"""Radiance that leaves towards the camera, L = L_e + albedo/pi E, and receivers that reflect by a Phong lobe.

L_e is a material's emission, times its texture's mean over the pixel.

L_s = sum over lights of f_s(w, w_o) E, with f_s = specular (P + 2) / (2 pi) <m . w>^P (`refgi.radiometry`) and E the
irradiance that a light gives the point. Clear glass has no lobe.

Symbols: n the G-buffer's normal, w_o unit vector to the eye, m that mirrored in the surface, w unit vector to a light.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.radiometry import incident_light, mirrored, receiver_lobe
from refgi.rsm.buffers.gbuffer import GBuffer, PlainAlbedo
from refgi.rsm.pool import plane, zeros
from refgi.scene.model import Light, LightTable, MaterialTable, light_table
from refgi.stages import stage
from refgi.types import Array

NONE = np.zeros((3, 0, 0), np.float32)


def leaving_radiance(irradiance: Array, extra: Array | None, buffer: GBuffer, materials: MaterialTable) -> Array:
    """Return what the camera receives: L = L_e + albedo/pi (E + extra).

    Parameters
    ----------
    irradiance : (3, h, w) ndarray
        Irradiance E, W/m^2.
    extra : (3, h, w) ndarray, optional
        More irradiance, W/m^2.
    buffer : GBuffer
        The camera's.
    materials : MaterialTable
        Their emission.

    Returns
    -------
    (3, h, w) ndarray
        Radiance, W/m^2/sr, linear RGB.
    """
    radiance = plane(irradiance.shape, irradiance.dtype if extra is None else np.result_type(irradiance, extra))
    plain = buffer.plain_albedo
    albedo = buffer.albedo if plain is None else NONE
    _reflect(irradiance, irradiance if extra is None else extra, extra is not None, albedo, plain, radiance)
    if materials.emission.any() and materials.emissive is None:
        _emit(materials.emission, buffer.triangle_id, buffer.material_of_face, radiance)
    elif materials.emission.any():
        radiance += buffer.emission
    return radiance


@stage("rsm.emission", kept=False)
def emission_of(triangle_id: Array, material_of_face: Array, emission: Array) -> Array:
    """Find what each pixel's surface emits (docs/radiometry).

    material_of_face (triangle,) int32: Material of each triangle.
    emission (material, rgb): Radiance of each, W/m^2/sr.
    -> (3, h, w): Radiance, W/m^2/sr; 0 without surface.
    """
    radiance = np.zeros((3, *triangle_id.shape), emission.dtype)
    _emit(emission, triangle_id, material_of_face, radiance)
    return radiance


@stage("rsm.leaving_radiance", kept=False)
def radiance_of(irradiance: Array, extra: Array | None, albedo: Array, emission: Array | None) -> Array:
    """Compute what the camera receives of diffuse surfaces: L = L_e + albedo/pi (E + extra) (docs/radiometry).

    irradiance (3, h, w): Direct irradiance E, W/m^2.
    extra (3, h, w): Indirect irradiance, W/m^2.
    emission (3, h, w): Radiance that surfaces emit, W/m^2/sr.
    -> (3, h, w): Radiance, W/m^2/sr, linear RGB; 0 without surface.
    """
    radiance = np.empty_like(irradiance)
    _reflect(irradiance, irradiance if extra is None else extra, extra is not None, albedo, None, radiance)
    return radiance if emission is None else radiance + emission


def leaving_steps(direct: Array, indirect: Array | None, buffer: GBuffer, materials: MaterialTable) -> Array:
    """Return what the camera receives, made by steps."""
    emission = None
    if materials.emission.any():
        emission = buffer.emission if materials.emissive is not None else emission_of(
            buffer.triangle_id, buffer.material_of_face, materials.emission)
    return radiance_of(direct, indirect, buffer.albedo, emission)


@kernel(parallel=True)
def _reflect(
    irradiance: Array, extra: Array, both: bool, albedo: Array, plain: PlainAlbedo | None, radiance: Array
) -> None:
    pi, width = irradiance.dtype.type(np.pi), radiance.shape[2]
    for row in prange(radiance.shape[1]):
        material = np.empty(width, np.uint64)
        if plain is not None:
            _materials_of(plain, row, material)
        for channel in range(3):
            for x in range(width):
                arriving = irradiance[channel, row, x]
                if both:
                    arriving = arriving + extra[channel, row, x]
                own = albedo[channel, row, x] if plain is None else plain.diffuse[channel, material[x]]
                # L = albedo/pi E, the BRDF of a diffuse surface
                radiance[channel, row, x] = arriving * own / pi


@kernel
def _materials_of(plain: PlainAlbedo, row: int, material: Array) -> None:
    """Fill the material of each pixel of a row, the last one without surface."""
    none = np.uint64(plain.diffuse.shape[1] - 1)
    for x in range(len(material)):
        face = plain.triangle_id[row, x]
        material[x] = np.uint64(plain.material_of_face[np.uint64(max(face, 0))]) if face >= 0 else none


@kernel(parallel=True)
def _emit(emission: Array, triangle_id: Array, material_of_face: Array, radiance: Array) -> None:
    for row in prange(radiance.shape[1]):
        for x in range(radiance.shape[2]):
            face = triangle_id[row, x]
            if face >= 0:
                for channel in range(3):
                    radiance[channel, row, x] += emission[material_of_face[face], channel]


class GlossyPoints(NamedTuple):
    """The n pixels whose surface reflects by a lobe towards the eye, in picture order, in the buffer's dtype."""

    pixel: Array  # (n,) int64, flat index into the picture
    position: Array  # (3, n) m, world space
    normal: Array  # (3, n) unit vectors: the G-buffer's
    mirrored: Array  # (3, n) unit vectors m
    exponent: Array  # (n,)
    specular: Array  # (3, n) reflectance of the lobe

    def at(self, place: Array) -> "GlossyPoints":
        """Return some of the points by index."""
        return GlossyPoints(*(np.take(part, place, axis=-1) for part in self))


def glossy_materials(materials: MaterialTable) -> Array:
    """Return, (m,) bool, which materials reflect by a lobe; clear glass does not."""
    glossy: Array = (materials.specular > 0).any(axis=1) & (materials.ior == 0)
    return glossy


def shows_glossy(buffer: GBuffer, materials: MaterialTable, material_of_face: Array) -> bool:
    """Return whether any visible surface reflects by a lobe; resolves no channel.

    `material_of_face`: (m,), by triangle. Looks at no pixel where no material has a lobe.
    """
    glossy = glossy_materials(materials)
    return bool(glossy.any()) and bool(_any_glossy(glossy, material_of_face, buffer.triangle_id))


@kernel
def _any_glossy(glossy: Array, material_of_face: Array, triangle_id: Array) -> bool:
    for row in range(triangle_id.shape[0]):
        for column in range(triangle_id.shape[1]):
            face = triangle_id[row, column]
            if face >= 0 and glossy[material_of_face[face]]:
                return True
    return False


@stage("rsm.glossy_points")
def glossy_points(buffer: GBuffer, materials: MaterialTable, eye: npt.ArrayLike) -> GlossyPoints:
    """Return the pixels whose surface reflects by a lobe towards the eye.

    eye (3,): Where the camera is, m.
    -> GlossyPoints: Without points whose normal faces away from the eye, as interpolated normals may.
    """
    position, normal = (channel.reshape(3, -1) for channel in buffer.resolve("position", "normal"))
    pixel, material = np.empty(buffer.covered.size, np.int64), np.empty(buffer.covered.size, np.int32)
    count = _list_glossy(glossy_materials(materials), buffer.triangle_id.reshape(-1), buffer.material_of_face, pixel,
                         material)
    real = position.dtype
    vectors = np.empty((4, 3, count), real)
    found = GlossyPoints(pixel[:count].copy(), vectors[0], vectors[1], vectors[2], np.empty(count, real), vectors[3])
    faces_eye = np.empty(count, np.bool_)
    _fill_glossy(position, normal, np.asarray(eye, np.float64), material, materials.exponent.astype(real),
                 materials.specular.T.astype(real), found, faces_eye)
    return found if faces_eye.all() else found.at(np.flatnonzero(faces_eye))


@kernel
def _list_glossy(glossy: Array, triangle_id: Array, material_of_face: Array, pixel: Array, material: Array) -> int:
    """List the pixels of glossy materials, and these; return how many there are."""
    count = np.uint64(0)
    for i in range(len(triangle_id)):
        if triangle_id[i] >= 0:
            m = material_of_face[np.uint64(triangle_id[i])]
            pixel[count], material[count] = i, m
            count += np.uint64(glossy[m])
    return int(count)


@kernel(parallel=True)
def _fill_glossy(
    position: Array, normal: Array, eye: Array, material: Array, exponent: Array, specular: Array,
    points: GlossyPoints, faces_eye: Array,
) -> None:
    """Fill all but the pixels of the points; m computed in float64, and whether n . w_o > 0."""
    for i in prange(len(points.pixel)):
        pixel, m = points.pixel[i], material[i]
        for c in range(3):
            points.position[c, i], points.normal[c, i] = position[c, pixel], normal[c, pixel]
            points.specular[c, i] = specular[c, m]
        points.exponent[i] = exponent[m]
        x, y, z = eye[0] - position[0, pixel], eye[1] - position[1, pixel], eye[2] - position[2, pixel]
        nx, ny, nz = np.float64(normal[0, pixel]), np.float64(normal[1, pixel]), np.float64(normal[2, pixel])
        length = math.sqrt(x * x + y * y + z * z)
        faces_eye[i] = x * nx + y * ny + z * nz > 0.0
        scale = 1.0 / length if length > 0.0 else 0.0
        mx, my, mz = mirrored(x * scale, y * scale, z * scale, nx, ny, nz)
        points.mirrored[0, i], points.mirrored[1, i], points.mirrored[2, i] = mx, my, mz


@stage("rsm.direct_lobes")
def direct_lobes(points: GlossyPoints, light: Light, visible: Array) -> Array:
    """Return the radiance towards the eye that receivers' lobes make of a light: f_s I(w) cos / d^2.

    visible (h, w) bool: Where the light arrives.
    -> (3, n): W/m^2/sr. Computed in float64 from the receivers as they are stored, and rounded once.
    """
    radiance = np.zeros_like(points.position)
    _add_direct(light_table((light,)), points, np.ascontiguousarray(visible).reshape(-1), radiance)
    return radiance


@kernel(parallel=True)
def _add_direct(lights: LightTable, points: GlossyPoints, visible: Array, radiance: Array) -> None:
    for i in prange(len(points.pixel)):
        if visible[points.pixel[i]]:
            position, normal, mirror = points.position, points.normal, points.mirrored
            wx, wy, wz, _, red, green, blue = incident_light(lights, 0, position[0, i], position[1, i], position[2, i])
            cosine = wx * normal[0, i] + wy * normal[1, i] + wz * normal[2, i]
            if cosine > 0.0:
                # f_s E
                reflected = cosine * receiver_lobe(np.float64(mirror[0, i]), np.float64(mirror[1, i]),
                                                   np.float64(mirror[2, i]), wx, wy, wz, np.float64(points.exponent[i]))
                radiance[0, i] = points.specular[0, i] * (reflected * red)
                radiance[1, i] = points.specular[1, i] * (reflected * green)
                radiance[2, i] = points.specular[2, i] * (reflected * blue)


@stage("rsm.spread_over_picture", kept=False)
def spread_over_picture(points: GlossyPoints, radiance: Array, shape: tuple[int, int]) -> Array:
    """Return radiance of glossy receivers as a picture.

    radiance (3, n): W/m^2/sr.
    shape: Height and width of the picture.
    -> (3, h, w): 0 elsewhere.
    """
    picture = zeros((3, *shape), points.position.dtype)
    for channel, values in zip(picture.reshape(3, -1), radiance, strict=True):
        channel[points.pixel] = values
    return picture

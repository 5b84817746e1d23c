"""A picture that will not fit in memory is refused before it is begun."""

from collections.abc import Mapping
from typing import Any

from refgi.errors import InputError
from refgi.memory import available_bytes
from refgi.method import Extent
from refgi.methods import find_method
from refgi.scene import PointLight, Scene
from refgi.scene.mesh import BYTES_OF_ALPHA, BYTES_OF_COLOUR

# From peaks measured at 1024^2 and 2048^2, rounded up by a third; the truth keeps moments in float64.
PIXEL_FLOATS = 32  # G-buffer, visibility, direct and indirect light, radiance, and their temporaries
TRUTH_PIXEL_BYTES = 280  # receivers, moments, tails, results
COMPARED_PIXEL_BYTES = 90  # a method's or reference's pictures, maps and figures
TEXEL_FLOATS = 36
FACE_BYTES = 460  # vertices, faces, clusters, Embree's tree


def needed_bytes(scene: Scene, width: int, height: int, *, float_bytes: int = 4, rsm_resolution: int = 512,
                 traced: bool = False, compared: int = 0) -> int:
    """Estimate the memory that a picture takes, bytes, rather too many than too few.

    `float_bytes`: 4 or 8; `rsm_resolution`: texels along a side; `traced`: whether the truth is among the methods;
    `compared`: how many methods are compared.
    """
    pixel = PIXEL_FLOATS * float_bytes + traced * TRUTH_PIXEL_BYTES + compared * COMPARED_PIXEL_BYTES
    texels = map_count(scene) * rsm_resolution**2 * TEXEL_FLOATS * float_bytes
    images = {texture.image for one in scene.materials for texture in one.textures}
    painted = sum(image.width * image.height for image in images) * BYTES_OF_COLOUR
    cut = {texture.image for one in scene.materials if one.cutoff is not None for texture in one.textures}
    painted += sum(image.width * image.height for image in cut) * BYTES_OF_ALPHA
    return width * height * pixel + texels + scene.face_count * FACE_BYTES + painted


def map_count(scene: Scene) -> int:
    """Return how many shadow maps the lamps of a scene have: a point light has one for each face of a cube."""
    return sum(6 if isinstance(light, PointLight) else 1 for light in scene.lights)


def require_memory(scene: Scene, dtype: str, rsm_resolution: int, *, traced: bool = False, compared: int = 0,
                   settings: Mapping[str, Any] | None = None) -> None:
    """Refuse a picture of the camera's size that will not fit; an InputError names what is needed and available.

    Arguments as of `needed_bytes`; `settings` are those of each method, which run one after the other.
    """
    width, height = scene.camera.width, scene.camera.height
    float_bytes = 8 if dtype == "float64" else 4
    needed = needed_bytes(scene, width, height, float_bytes=float_bytes, rsm_resolution=rsm_resolution, traced=traced,
                          compared=compared)
    extent = Extent((width, height), float_bytes, map_count(scene), rsm_resolution**2)
    extra = {name: find_method(name).extra_bytes(own, extent) for name, own in (settings or {}).items()}
    most = max(extra, key=extra.__getitem__, default="")
    added, available = extra.get(most, 0), available_bytes()
    if available is not None and needed + added > available:
        of = f", {added:,} of them for the settings of {most}" if added else ""
        raise InputError(f"size: {width}x{height} needs about {needed + added:,} bytes of memory{of}, {available:,} "
                         "are available")

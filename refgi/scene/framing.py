"""A camera and a spot for a mesh that comes without: from above, front right, and from above, front left."""

import math

import numpy as np

from refgi.scene.model import Array, Camera, Geometry, SpotLight, Vector

VIEW = np.array([0.55, 0.4, 1.0])  # from the middle of the mesh towards the eye
SHINE = np.array([-0.8, 1.1, 0.7])  # ... towards the light
VFOV = math.radians(35.0)
LIGHT_DISTANCE = 4.0  # radii of the bounding sphere
SMALLEST_RADIUS = 1e-9  # m; eye and target of a camera must differ
FULL_IRRADIANCE = math.pi  # W/m^2 at the middle of the mesh: an albedo's radiance is then the albedo itself


def framed(geometry: Geometry) -> Camera:
    """Return a camera that sees the whole bounding box.

    Parameters
    ----------
    geometry : Geometry
        What to see, not empty.

    Returns
    -------
    Camera
        512 x 512 pixels.
    """
    middle, radius = _sphere(geometry)
    eye = middle + VIEW / np.linalg.norm(VIEW) * (radius / math.sin(VFOV / 2))
    return Camera(_vector(eye), _vector(middle), vfov=VFOV)


def lit(geometry: Geometry) -> SpotLight:
    """Return a spot that lights the whole bounding box.

    Parameters
    ----------
    geometry : Geometry
        What to light, not empty.

    Returns
    -------
    SpotLight
        White, with an irradiance of pi W/m^2 at the middle.
    """
    middle, radius = _sphere(geometry)
    distance = LIGHT_DISTANCE * radius
    position = middle + SHINE / np.linalg.norm(SHINE) * distance
    outer = 1.2 * math.asin(1 / LIGHT_DISTANCE)
    power = FULL_IRRADIANCE * distance**2
    return SpotLight(_vector(position), _vector(middle - position), outer / 1.2, outer, (power, power, power))


def _sphere(geometry: Geometry) -> tuple[Array, float]:
    low, high = geometry.bounds
    return (low + high) / 2, max(float(np.linalg.norm(high - low)) / 2, SMALLEST_RADIUS)


def _vector(values: Array) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z

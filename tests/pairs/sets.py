"""Lights and receivers with known sums."""

import numpy as np

from refgi.lights import PixelLights
from refgi.splat import Receivers


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=0)


def random_directions(rng, count):
    return unit(rng.normal(size=(3, count)))


def receivers(position, normal, real=np.float64):
    """Take (3, n) points as a picture of one row."""
    return Receivers(np.ascontiguousarray(position[:, None], real), np.ascontiguousarray(normal[:, None], real),
                     np.ones((1, position.shape[1]), bool))


def lights(position, normal, flux, real=np.float64, **lobes):
    count = position.shape[1]
    flux = np.broadcast_to(np.asarray(flux, real), (3, count))
    return PixelLights(position.astype(real), normal.astype(real), np.ascontiguousarray(flux),
                       lobes.get("lobe_flux"), lobes.get("lobe_axis"), lobes.get("lobe_exponent"), count)


def glossy(position, normal, axis, exponent, flux=1.0, real=np.float64):
    count = position.shape[1]
    return lights(position, normal, np.zeros((3, 1)), real,
                  lobe_flux=np.full((3, count), flux, real), lobe_axis=axis.astype(real),
                  lobe_exponent=np.full(count, exponent, real))


def in_sphere(directions, radius=1.0):
    """Return points on the inside of a sphere and their normals."""
    return radius * directions, -directions


def room(rng, count, real=np.float64):
    """Return lights and receivers scattered in a box, facing anywhere."""
    places = rng.uniform(-1, 1, (3, 2 * count))
    facing = random_directions(rng, 2 * count)
    flux = rng.random((3, count))
    return (receivers(places[:, :count], facing[:, :count], real),
            lights(places[:, count:], facing[:, count:], flux, real))

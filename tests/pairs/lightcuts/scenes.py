"""Scenes of pixel lights and receivers, random and hostile, for the tests of lightcuts."""

import numpy as np
import pytest

from refgi.pairs.irradiance import Receivers
from refgi.pairs.pixel_lights import PixelLights
from refgi.pairs.settings import DiscClamp, DistanceClamp, GeometryClamp
from tests.pairs.sets import unit

CLAMPS = {"none": None, "disc": DiscClamp(), "distance": DistanceClamp(0.15), "geometry": GeometryClamp(8.0)}
NAMES = ("cube", "floor", "corner", "ball", "coincident", "tiny", "far", "wide", "colours", "uneven", "dim")
# each scene with two clamps, each clamp with half of the scenes; the others are slow
GRID = [pytest.param(name, clamp, marks=[] if (i - j) % 4 < 2 else [pytest.mark.slow])
        for i, name in enumerate(NAMES) for j, clamp in enumerate(CLAMPS)]


def scene(name, lights, receivers, seed=0, dtype=np.float32):
    """Return pixel lights, their areas and receivers of a kind."""
    rng = np.random.default_rng(seed)
    position, normal = rng.random((3, lights)), unit(rng.normal(size=(3, lights)))
    place, facing = rng.random((3, receivers)), unit(rng.normal(size=(3, receivers)))
    flux = rng.random((3, 1)) * rng.random(lights)
    if name in ("floor", "corner", "colours", "uneven"):  # lights of the ground, which half of the receivers share
        position[1], normal = 0.0, np.tile([[0.0], [1.0], [0.0]], lights)
        place[1, : receivers // 2] = 0.0
    if name == "corner":  # receivers of a wall that stands on the lights
        place[0], facing = 0.0, np.tile([[1.0], [0.0], [0.0]], receivers)
        place[1] *= 0.02
    if name == "ball":  # inside a sphere, lights and receivers on it
        position, place = 2.0 * normal, 2.0 * facing
        normal, facing = -normal, -facing
    if name == "coincident":
        position[:, lights // 2 :] = position[:, : lights - lights // 2]
    if name == "tiny":
        position, place = 1e-4 * position, 1e-4 * place
    if name == "far":
        position, place = position + 300.0, place + 300.0
    if name == "wide":
        place *= np.exp(rng.normal(size=receivers) * 3.0)
    if name == "colours":  # of one channel each, on ground that is a little rough
        normal = unit(normal + 0.05 * rng.normal(size=(3, lights)))
        flux = np.eye(3)[:, rng.integers(3, size=lights)] * rng.random(lights)
    if name == "uneven":
        flux = flux * np.exp(6.0 * rng.normal(size=lights))
    if name == "dim":  # on one side, to 0 in float32
        flux = flux * np.where(position[0] < 0.5, 1e-47, 1.0)
    found = PixelLights(position, normal, flux, None, None, None, lights)
    points = Receivers(*(np.ascontiguousarray(part[:, None].astype(dtype)) for part in (place, facing)),
                       np.ones((1, receivers), np.bool_))
    return found, 1e-3 * rng.random(lights), points

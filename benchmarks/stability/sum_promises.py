"""Promises of sums over pixel lights: a million lights alike, float64 near lights, the brightest and sharpest lobes.

The reference is a literal sum of SII Eq. 2 and 3 in extended precision, of the numbers that the sum is given. With
U = 2^-24 (float64: 2^-53) a term is off by 14 U, and by 4 U of 1 for each cosine, a sum that may cancel; a group of 64
rounds 63 times, its total with compensation twice, the flux twice.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from benchmarks.stability.promise import Case, Promise
from refgi.pairs.irradiance import Receivers, irradiance
from refgi.pairs.pixel_lights import PixelLights
from refgi.pairs.settings import PairSettings
from refgi.settings import of

Array = npt.NDArray[Any]
POINTS = 8  # receivers
MOST_LIGHTS = 1 << 20
BRIGHTEST_FLUX, SHARPEST = 1e30, 1e20
TERM, GROUP = 14, 67  # roundings of a term, and of the sum


def _unit(vectors: Array) -> Array:
    return vectors / np.linalg.norm(vectors, axis=0)


def _receivers(position: Array, normal: Array, real: Any) -> Receivers:
    return Receivers(np.ascontiguousarray(position[:, None], real), np.ascontiguousarray(normal[:, None], real),
                     np.ones((1, position.shape[1]), np.bool_))


def _lights(position: Array, normal: Array, flux: Array, real: Any, lobes: Any = (None, None, None)) -> PixelLights:
    arrays = (np.ascontiguousarray(one, real) for one in (position, normal, flux))
    return PixelLights(*arrays, *(one if one is None else np.ascontiguousarray(one, real) for one in lobes),
                       position.shape[1])


def literal(receivers: Receivers, lights: PixelLights) -> tuple[Array, Array]:
    """Return E of the red channel at each receiver, and by how many U it may be off, in longdouble."""
    place, up = (np.asarray(one[:, 0], np.longdouble) for one in receivers[:2])
    at, out, flux = (np.asarray(one, np.longdouble) for one in lights[:3])
    total, bound = np.zeros((2, place.shape[1]), np.longdouble)
    for i in range(place.shape[1]):
        d = at - place[:, i : i + 1]
        square = (d * d).sum(axis=0)
        length = np.sqrt(square)
        cl, cx = -(d * out).sum(axis=0) / length, (d * up[:, i : i + 1]).sum(axis=0) / length
        peak = flux[0] / (np.longdouble(np.pi) * square)
        term = peak * np.maximum(cl, 0) * np.maximum(cx, 0)
        total[i] = term.sum()
        bound[i] = (TERM * term + 4 * peak * (np.maximum(cl, 0) + np.maximum(cx, 0))).sum() + GROUP * total[i]
    return total, bound


def many_lights(rng: np.random.Generator) -> Case:
    """Return a sum over lights of one strength above some receivers; one case in 8 has up to a million of them."""
    most = MOST_LIGHTS if rng.random() < 1 / 8 else MOST_LIGHTS >> 2
    return sum_of(rng, int(np.exp(rng.uniform(np.log(1 << 16), np.log(most)))))


def sum_of(rng: np.random.Generator, count: int) -> Case:
    across = np.float32(rng.choice([1e-3, 0.1]))  # of the cloud of lights, of the distance
    at = np.stack([*(across * rng.uniform(-1, 1, (2, count))), 1 + across * rng.uniform(-1, 1, count)])
    normal = np.broadcast_to([[0.0], [0.0], [-1.0]], at.shape)
    lights = _lights(at, normal, np.full(at.shape, rng.uniform(0.5, 1.5)), np.float32)
    place = np.concatenate([rng.uniform(-0.3, 0.3, (2, POINTS)), np.zeros((1, POINTS))])
    to = _receivers(place, np.broadcast_to([[0.0], [0.0], [1.0]], place.shape), np.float32)
    got = irradiance(to, lights, PairSettings(clamp=None))[0, 0]
    exact, _ = literal(to, lights)
    figure = float((np.abs(got - exact) / exact).max()) * 2.0**24
    return Case(figure, f"{count:,} lights over {across:g} of their distance: off by {figure:.3g} U of E")


def near_lights(rng: np.random.Generator) -> Case:
    """Return a float64 sum over a few lights near the receivers, in scenes up to 16 times their size off the origin."""
    size, count = 10 ** rng.uniform(-6, 6), int(rng.integers(1, 100))
    centre = size * rng.uniform(-16, 16, (3, 1))
    at = centre + size * rng.uniform(-1, 1, (3, count))
    nearest = rng.integers(0, count, POINTS)
    place = at[:, nearest] + size * 10 ** rng.uniform(-9, 0, POINTS) * _unit(rng.normal(size=(3, POINTS)))
    lights = _lights(at, _unit(rng.normal(size=(3, count))), np.broadcast_to(rng.random(count), (3, count)), np.float64)
    to = _receivers(place, _unit(rng.normal(size=(3, POINTS))), np.float64)
    got = irradiance(to, lights, PairSettings(clamp=None))[0, 0]
    exact, bound = literal(to, lights)
    off = np.where(bound > 0, np.abs(got - exact) / np.where(bound > 0, bound, 1) * 2.0**53, got != 0)
    return Case(float(off.max()), f"{count} lights, scene of {size:.3g} m: off by {float(off.max()):.3g} of the bound")


def bright_lobes(rng: np.random.Generator) -> Case:
    """Return how many numbers of a sum are no numbers: lobes that face the receivers, at least 1 mm away."""
    count = int(rng.integers(1, 65))
    axis = _unit(rng.normal(size=3))[:, None]
    strength = np.full(count, BRIGHTEST_FLUX) if rng.random() < 0.5 else 10 ** rng.uniform(-3, 30, count)
    exponent = np.full(count, SHARPEST) if rng.random() < 0.5 else 10 ** rng.uniform(-3, 20, count)
    flux, axes = np.broadcast_to(strength, (3, count)), np.broadcast_to(axis, (3, count))
    lights = _lights(np.zeros((3, count)), axes, np.zeros((3, count)), np.float32, (flux, axes, exponent))
    place = axis * 10 ** rng.uniform(-3, 2, POINTS)
    to = _receivers(place, np.broadcast_to(-axis, place.shape), np.float32)
    got = irradiance(to, lights, of(PairSettings, clamp=None))
    bad = int(np.count_nonzero(~np.isfinite(got) | (got < 0)))
    return Case(bad, f"{count} lobes, up to {strength.max():.3g} W and exponent {exponent.max():.3g}: {bad} of {got.size}")


PROMISES = (
    Promise("sum.many", "float32 sum over very many lights", "pairs.sum",
            "65,000 to 1,000,000 pixel lights alike, over 1e-3 and 0.1 of their distance", many_lights, "U of E",
            TERM + GROUP, "derived",
            "14 roundings of a term, 63 of a group of 64, 2 of the compensated total, 2 of the flux", 100, 4),
    Promise("sum.float64", "float64 sum against a literal one", "pairs.sum",
            "1 to 100 lights, 1e-9 of the scene's size off a receiver and more; 1e-6 .. 1e6 m, up to 16 sizes off the "
            "origin", near_lights, "of the bound", 1.0, "derived",
            "14 roundings of a term, 4 of each cosine, 67 of the sum", 20_000, 200),
    Promise("sum.bright", "infinite or NaN", "pairs.sum", "1 to 64 lobes of up to 1e30 W and exponents to 1e20, from "
            "1e-3 m on", bright_lobes, "numbers", 0, "exact", "what no float32 holds is cut", 5000, 60, adds=True),
)

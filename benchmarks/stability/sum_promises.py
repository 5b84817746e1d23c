"""Promises of sums over pixel lights: a million of them, lights very near, the brightest and sharpest lobes.

The reference is a literal sum of SII Eq. 2 and 3 in extended precision, of the numbers that the sum is given. With
U = 2^-24 (float64: 2^-53) a term is off by 14 U, and by 4 U of 1 for each cosine, a sum that may cancel; a group of 64
rounds 63 times, its total with compensation twice, the flux twice.
"""

from functools import partial
from typing import Any

import numpy as np

from benchmarks.stability.promise import Case, Promise
from refgi.pairs.irradiance import Receivers, irradiance
from refgi.pairs.pixel_lights import PixelLights
from refgi.pairs.settings import PairSettings
from refgi.types import Array

POINTS = 8  # receivers
MOST_GROUPS = 1 << 14  # of 64 lights: a million
PLAIN = PairSettings(clamp=None)
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
        square = np.where(square > 0, square, np.inf)  # coincident: no light
        length = np.sqrt(square)
        cl, cx = -(d * out).sum(axis=0) / length, (d * up[:, i : i + 1]).sum(axis=0) / length
        peak = flux[0] / (np.longdouble(np.pi) * square)
        term = peak * np.maximum(cl, 0) * np.maximum(cx, 0)
        total[i] = term.sum()
        bound[i] = (TERM * term + 4 * peak * (np.maximum(cl, 0) + np.maximum(cx, 0))).sum() + GROUP * total[i]
    return total, bound


def many_lights(rng: np.random.Generator) -> Case:
    """Return the error of a sum over m times the same 64 lights, of m times that over them; lobes as well."""
    times = int(np.exp(rng.uniform(np.log(1000), np.log(MOST_GROUPS))))
    centre = np.array([[0.0], [0.0], [1.0]])
    at, out = centre + 0.1 * rng.uniform(-1, 1, (3, 64)), _unit(-centre + 0.3 * rng.normal(size=(3, 64)))
    flux, dark = rng.uniform(0.5, 1.5, (3, 64)), np.zeros((3, 64))
    lobes = bool(rng.integers(2))
    place = np.concatenate([rng.uniform(-0.3, 0.3, (2, POINTS)), np.zeros((1, POINTS))])
    to = _receivers(place, np.broadcast_to(centre, place.shape), np.float32)

    def total(m: int) -> Array:
        numbers = [np.tile(one, m) for one in ((dark, out, flux) if lobes else (flux,))]
        glossy = (numbers[2], numbers[1], np.full(64 * m, 3.0)) if lobes else (None, None, None)
        return irradiance(to, _lights(np.tile(at, m), np.tile(out, m), numbers[0], np.float32, glossy), PLAIN)

    one, all_of_them = total(1).astype(np.float64), total(times).astype(np.float64)
    figure = float((np.abs(all_of_them / (times * one) - 1)).max()) * 2.0**24
    return Case(figure, f"{times} times 64 {'lobes' if lobes else 'lights'}: off by {figure:.3g} U")


def near_lights(real: Any, rng: np.random.Generator) -> Case:
    """Return a sum over a few lights near the receivers, in scenes up to 16 times their size off the origin."""
    size, count = 10 ** rng.uniform(-6, 6), int(rng.integers(1, 100))
    centre = size * rng.uniform(-16, 16, (3, 1))
    at = centre + size * rng.uniform(-1, 1, (3, count))
    nearest = rng.integers(0, count, POINTS)
    place = at[:, nearest] + size * 10 ** rng.uniform(-9, 0, POINTS) * _unit(rng.normal(size=(3, POINTS)))
    lights = _lights(at, _unit(rng.normal(size=(3, count))), np.broadcast_to(rng.random(count), (3, count)), real)
    to = _receivers(place, _unit(rng.normal(size=(3, POINTS))), real)
    got = irradiance(to, lights, PLAIN)[0, 0]
    exact, bound = literal(to, lights)
    allowed = bound * np.finfo(real).eps / 2 + 4 * float(np.finfo(real).smallest_subnormal)
    off = np.abs(got - exact) / allowed
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
    got = irradiance(to, lights, PLAIN)
    bad = int(np.count_nonzero(~np.isfinite(got) | (got < 0)))
    return Case(bad, f"{count} lobes, up to {strength.max():.3g} W and P {exponent.max():.3g}: {bad} of {got.size}")


PROMISES = (
    Promise("sum.many", "float32 sum over m times the same lights", "pairs.sum",
            "64,000 to 1,000,000 pixel lights or lobes in one order", many_lights, "U of E", 4, "derived",
            "the compensated total rounds by 2 U, once more where it ends, the reference once", 60, 4),
    *(Promise(f"sum.{name}", f"{name} sum against a literal one", "pairs.sum",
              "1 to 100 lights, 1e-9 of the scene's size off a receiver and more; 1e-6 .. 1e6 m, up to 16 sizes off "
              "the origin", partial(near_lights, real), "of the bound", 1.0, "derived",
              "14 roundings of a term, 4 of each cosine, 67 of the sum", 6000, 100)
      for name, real in (("float32", np.float32), ("float64", np.float64))),
    Promise("sum.bright", "infinite or NaN", "pairs.sum", "1 to 64 lobes of up to 1e30 W and exponents to 1e20, from "
            "1e-3 m on", bright_lobes, "numbers", 0, "exact", "what no float32 holds is cut", 5000, 60, adds=True),
)

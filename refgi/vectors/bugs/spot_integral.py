"""A spot's falloff integrated over rectangles of the image plane, piece by piece between its circles.

The integrand is smoothstep(t), or t t, times the density of solid angle cos^3 a, t = (cos a - cos o) / (cos i - cos o),
where i and o are the inner and outer half-angle. Both directions are cut where the circles of the cones cross, so that
each piece is smooth, and each piece has a Gauss rule.
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from refgi.scene.model import Light, SpotLight
from refgi.vectors.spec import Array

NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)
Falloff = Callable[[Array, Array, float, float], Array]  # t, cosine off the axis, inner and outer half-angle -> share


def clamped(t: Array) -> Array:
    """Return t moved into [0, 1]."""
    return np.clip(t, 0.0, 1.0)


def smoothstep(t: Array) -> Array:
    """Return t t (3 - 2 t)."""
    return np.asarray(t * t * (3.0 - 2.0 * t))


def share_at(cosine: Array, inner: float, outer: float, falloff: Falloff) -> Array:
    """Return a spot's share in directions at some cosines off its axis."""
    t = (cosine - np.cos(outer)) / (2 * np.sin((outer + inner) / 2) * np.sin((outer - inner) / 2))
    return falloff(t, cosine, inner, outer)


def smooth(t: Array, cosine: Array, inner: float, outer: float) -> Array:  # noqa: ARG001 a falloff among others
    """Return the usual falloff as it should be."""
    return smoothstep(clamped(t))


def squared(t: Array, cosine: Array, inner: float, outer: float) -> Array:  # noqa: ARG001
    """Return the falloff of glTF as it should be."""
    return np.asarray(clamped(t) ** 2)


def ramp(t: Array, cosine: Array, inner: float, outer: float) -> Array:  # noqa: ARG001
    """Return the falloff of a cosine lobe as it should be."""
    return clamped(t)


OWN: Mapping[str, Falloff] = MappingProxyType({"smoothstep": smooth, "squared_ramp": squared, "ramp": ramp})


def own_falloff(light: Light) -> Falloff:
    """Return a spot's falloff as it should be."""
    return OWN[light.falloff if isinstance(light, SpotLight) else SpotLight.falloff]


def spot_integrals(
    x: tuple[Array, Array], y: tuple[Array, Array], angles: tuple[float, float], *, falloff: Falloff = smooth,
    power: float = 3.0, columns: slice = slice(None), rows: slice = slice(None),
) -> Array:
    """Return the integral over each rectangle (n,): `x`, `y` its bounds, `angles` inner and outer half-angle.

    `power`: of the cosine in the density of solid angle. `columns`, `rows`: which pieces along x and y count.
    """
    inner, outer = angles
    radii = np.tan(inner), np.tan(outer)
    cuts = [x[0], x[1]]
    for radius in radii:
        for edge in (np.zeros_like(y[0]), *y):
            cuts += _crossings(radius, edge, x)
    of_piece, across, weight = _nodes(cuts, columns)
    low, high = (np.repeat(one[of_piece], len(NODES)) for one in y)
    place, weight = across.reshape(-1), weight.reshape(-1)
    cuts = [low, high]
    for radius in radii:
        cuts += _crossings(radius, place, (low, high))
    of_line, along, height = _nodes(cuts, rows)
    square = 1.0 + place[of_line][:, None] ** 2 + along**2
    values = share_at(square**-0.5, inner, outer, falloff) * square ** (-power / 2) * height
    lines = np.bincount(of_line, values.sum(axis=1), len(place)) * weight
    return np.bincount(np.repeat(of_piece, len(NODES)), lines, len(x[0]))


def _crossings(radius: float, across: Array, bounds: tuple[Array, Array]) -> list[Array]:
    reach = np.sqrt(np.maximum(radius**2 - across**2, 0.0))
    found = [np.where(across**2 < radius**2, sign * reach, bounds[0]) for sign in (-1, 1)]
    return [np.clip(one, *bounds) for one in found]


def _nodes(cuts: list[Array], kept: slice) -> tuple[Array, Array, Array]:
    """Return of which rectangle each piece between cuts is, and its nodes and weights: (p,), (p, 16), (p, 16)."""
    at = np.sort(np.stack(cuts, axis=1), axis=1)
    some = at[:, 1:] > at[:, :-1]
    order = np.cumsum(some, axis=1) * some
    count = order.max(axis=1, keepdims=True)
    chosen = some if kept == slice(None) else some & (order == (1 if kept.stop == 1 else count))
    which, piece = np.nonzero(chosen)
    low, high = at[which, piece], at[which, piece + 1]
    middle, half = 0.5 * (low + high)[:, None], 0.5 * (high - low)[:, None]
    return which, middle + half * NODES, half * WEIGHTS

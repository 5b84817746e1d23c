"""Likely bugs of a receiver's look-up in the imperfect shadow map of a light, all pairs at once."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from refgi.truth.imperfect import GRAZING
from refgi.vectors.spec import Array, Bug, Run

BIAS = "bias max(r sqrt(c), texel) max(1, tan(a))"
LOOKUP = "the texel that holds (s, t)"
Pairs = Callable[[Any, Any], tuple[Array, Array]]


def literal_hidden(
    frame: Array, depth: Array, radius: float, bias: float, points: Array, facing: Array, position: Array, *,
    slope: bool = True, least: float = GRAZING, texels: bool = True, discs: bool = True, axial: bool = False,
    turned: bool = False, signs: tuple[int, int] = (1, 1), moved: float = 0.0, map_of: Callable[[Array], Array] = (
        lambda k: k), onto: str = "paraboloid",
) -> Array:
    """Return which receivers, (3, n), the maps of lights hide, (n, light), with a bug; those behind are."""
    d = points.T[:, None] - position.T[None]
    x, y, z = np.moveaxis(np.einsum("lij,nlj->nli", frame, d), 2, 0)
    far, side = np.linalg.norm(d, axis=2), depth.shape[1]
    with np.errstate(all="ignore"):
        below = {"paraboloid": far + z, "orthographic": far, "perspective": z}[onto]
        s, t = (np.nan_to_num(sign * one / below) for sign, one in zip(signs, (x, y), strict=True))
        texel = 4 * far / (side * (1 + s * s + t * t)) if texels else 0
        cosine = np.maximum(least, -np.einsum("nli,in->nl", d, facing) / far)
        tangent = np.maximum(1, np.sqrt(np.maximum(0, 1 - cosine**2)) / cosine) if slope else 1
        column, row = (np.clip((0.5 * side * (one + 1) + moved).astype(int), 0, side - 1) for one in (s, t))
        row, column = (column, row) if turned else (row, column)
        found = depth[map_of(np.arange(len(frame)))[None], row, column]
        slack = bias * np.maximum(radius * np.sqrt(cosine) if discs else 0, texel) * tangent
        return np.asarray((found < (z if axial else far) - slack) | (z <= 0))


def hidden_bugs(by: Callable[[dict[str, Any]], Run], bias: float) -> tuple[Bug, ...]:
    """Return likely bugs of the look-up; `by` returns the stage with knobs of `literal_hidden`."""
    ways: Mapping[str, dict[str, Any]] = {
        "there is no bias": {"bias": 0.0},
        "the bias is twice as large": {"bias": 2 * bias},
        "the bias does not grow where the light grazes: the slope is missing": {"slope": False},
        "the bias leaves out the texel's size": {"texels": False},
        "the bias leaves out the size of the points": {"discs": False},
        "the distance along the light's normal is compared": {"axial": True},
        "rows and columns of the maps are exchanged": {"turned": True},
        "rows of the maps run the other way": {"signs": (1, -1)},
        "columns of the maps run the other way": {"signs": (-1, 1)},
        "the texel is rounded: half a texel too far": {"moved": 0.5},
        "the texel is half a texel too near": {"moved": -0.5},
        "each light has the next one's map": {"map_of": lambda k: (k + 1) % len(k)},
        "the first light's map for all": {"map_of": lambda k: 0 * k},
        "maps are looked up without the paraboloid's 1 + z: orthographic": {"onto": "orthographic"},
        "maps are looked up as perspective ones": {"onto": "perspective"},
    }
    return tuple(Bug(cause, by(how), BIAS if "bias" in cause else LOOKUP) for cause, how in ways.items())

"""Imperfect shadow maps as a port writes them and gets them wrong (Ritschel et al. 2008): vectors over points."""

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from refgi.sampling import FIRST_STEP, SECOND_STEP
from refgi.truth.imperfect import HORIZON, NEAR
from refgi.vectors.spec import Array, Arrays, Bug, Run

PAPER = "Ritschel et al. 2008, Sec. 3"
PLACE, BOX = "n equal shares of the area", "a box as wide as the disc looks"
GOLDEN = 0.6180339887498949
PLANES = ("vpl.point", "vpl.point_face", "vpl.point_radius")
Change = Callable[[Array], Array]


def corners_of(arrays: Arrays) -> Array:
    """Return the corners of faces, (F, 3, 3)."""
    return np.asarray(np.asarray(arrays["scene.vertices"], np.float64)[np.asarray(arrays["scene.faces"])])


def literal_points(
    arrays: Arrays, count: int, *, steps: tuple[float, float] = (FIRST_STEP, SECOND_STEP), root: Change = np.sqrt,
    by_area: bool = True, shift: Change = lambda x: x, begin: int = 0, exchanged: bool = False, folded: bool = False,
    radius: Callable[[float], float] = lambda area: math.sqrt(area / math.pi),
) -> dict[str, Array]:
    """Return points, faces and radius of maps of so many points, with a bug."""
    corners, k = corners_of(arrays), begin + np.arange(count)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    upto = np.cumsum(0.5 * np.linalg.norm(across, axis=1))
    total, upto = float(upto[-1]), upto if by_area else np.arange(1.0, len(upto) + 1)
    x = shift(np.asarray(arrays["vpl.shift"], np.float64))[:, :, None]
    face = np.minimum(np.searchsorted(upto, (k + x[:, 0]) / count * upto[-1], side="right"), len(upto) - 1)
    a, b = root((x[:, 1] + k * steps[0]) % 1), (x[:, 2] + k * steps[1]) % 1
    a, b = (np.sqrt((x[:, 2] + k * steps[1]) % 1), (x[:, 1] + k * steps[0]) % 1) if exchanged else (a, b)
    shares = [1 - a, a * (1 - b), a * b]
    if folded:  # (u, v) of the square, folded over its diagonal
        u, v = (x[:, 1] + k * steps[0]) % 1, (x[:, 2] + k * steps[1]) % 1
        u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
        shares = [1 - u - v, u, v]
    place = sum(share[..., None] * corners[face, j] for j, share in enumerate(shares))
    return dict(zip(PLANES, (np.asarray(place), face.astype(np.int32), np.full(1, radius(total / count))), strict=True))


def point_bugs(count: int) -> tuple[Bug, ...]:
    """Return likely bugs of points and of their radius."""
    ways: Mapping[str, dict[str, Any]] = {
        "the root is missing in a: points crowd at a face's first corner": {"root": lambda x: x},
        "each face has as many points, whatever its area": {"by_area": False},
        "random shifts are left out: every light has the same points": {"shift": np.zeros_like},
        "the first light's shifts for all lights": {"shift": lambda x: np.repeat(x[:1], len(x), axis=0)},
        "the first random number of a light for all three of its shifts": {"shift": lambda x: x[:, [0, 0, 0]]},
        "the shifts of a and b are exchanged": {"shift": lambda x: x[:, [0, 2, 1]]},
        "points are counted from 1": {"begin": 1},
        "steps of the golden ratio": {"steps": (GOLDEN, GOLDEN**2)},
        "the steps of a and b are exchanged": {"steps": (SECOND_STEP, FIRST_STEP)},
        "a and b are exchanged: the second number under the root": {"exchanged": True},
        "squares are folded at their diagonal: no root, other points of the same faces": {"folded": True},
        "pi is missing in the radius: that of a square": {"radius": math.sqrt},
        "the radius is not divided by the root of the number of points": {
            "radius": lambda area: math.sqrt(area * count / math.pi)},
        "the radius is its square, A / (pi n)": {"radius": lambda area: area / math.pi},
        "the diameter in place of the radius": {"radius": lambda area: 2 * math.sqrt(area / math.pi)},
    }
    return tuple(Bug(cause, _points_by(count, how), PLACE) for cause, how in ways.items())


def _points_by(count: int, how: dict[str, Any]) -> Run:
    return lambda arrays, real: literal_points(arrays, count, **how)  # noqa: ARG005


def literal_maps(
    arrays: Arrays, side: int, splat: float, *, half: float = 0.5, bulge: Callable[[Array], Array] = lambda q: 1 + q,
    cosine: Change = np.sqrt, fall: bool = True, horizon: float = HORIZON, own: float = 1.0, axial: bool = False,
    onto: str = "paraboloid", turned: tuple[int, int] = (0, 1), signs: tuple[int, int] = (1, 1), centre: float = 0.5,
    kept: str = "least", small: bool = True, first_face: bool = False,
) -> dict[str, Array]:
    """Return the maps of all lights with a bug; `arrays` holds their frames."""
    corners = corners_of(arrays)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    up = (across / np.linalg.norm(across, axis=1, keepdims=True))[np.asarray(arrays[PLANES[1]])]
    up = np.repeat(up[:, :1], up.shape[1], axis=1) if first_face else up
    d = np.asarray(arrays[PLANES[0]], np.float64) - np.asarray(arrays["lights.position"], np.float64).T[:, None]
    x, y, z = np.moveaxis(np.einsum("lij,lpj->lpi", np.asarray(arrays["vpl.frame"], np.float64), d), 2, 0)
    far, radius = np.linalg.norm(d, axis=2), float(arrays[PLANES[2]][0])
    counts = (z > horizon * far) & (far > own * radius)
    with np.errstate(all="ignore"):
        below = {"paraboloid": far + z, "orthographic": far, "perspective": z}[onto]
        place = signs[0] * x / below, signs[1] * y / below
        s, t = (np.nan_to_num(place[k]) for k in turned)
        wide = splat * radius * cosine(np.abs((d * up).sum(axis=2)) / far) * bulge(s * s + t * t)
        reach = half * wide / (far if fall else 1) * side / 2
    value, made = z if axial else far, np.full((len(d), side, side), np.inf)
    for k in range(len(d)):
        here = counts[k]
        boxes = [_within(0.5 * side * (one[k, here] + 1), reach[k, here], side, centre, small) for one in (s, t)]
        box, depth = boxes[1][:, :, None] & boxes[0][:, None], value[k, here][:, None, None]
        if kept == "least":
            made[k] = np.where(box, depth, np.inf).min(axis=0, initial=np.inf)
        elif kept == "largest":
            made[k] = np.where(box, depth, -1).max(axis=0, initial=-1)
            made[k][made[k] < 0] = np.inf
        else:
            for one, far_one in zip(box, value[k, here], strict=True):
                made[k][one] = far_one
    return {"vpl.depth": made}


def _within(at: Array, reach: Array, side: int, centre: float, small: bool) -> Array:
    """Return which texels of a side boxes cover, (point, texel); where none, the one that holds the point."""
    texel = np.arange(side)
    covered = np.abs(texel + centre - at[:, None]) <= reach[:, None]
    low, high = np.ceil(at - reach - centre), np.floor(at + reach - centre)
    held = np.clip(np.floor(at), 0, side - 1)[:, None] == texel
    return np.asarray(np.where((low > high)[:, None] & small, held, covered))


def map_bugs(side: int, splat: float) -> tuple[Bug, ...]:
    """Return likely bugs of the maps of all lights."""
    ways: Mapping[str, dict[str, Any]] = {
        "the distance along the light's normal in place of the distance": {"axial": True},
        "directions are orthographic: z is left out of 1 + z": {"onto": "orthographic"},
        "directions are those of a perspective map: divided by z, not by 1 + z": {"onto": "perspective"},
        "rows and columns of the maps are exchanged": {"turned": (1, 0)},
        "rows run the other way": {"signs": (1, -1)},
        "columns run the other way": {"signs": (-1, 1)},
        "boxes are twice as wide: their width is taken for half of it": {"half": 1.0},
        "boxes are half as wide": {"half": 0.25},
        "boxes do not look smaller where their point is slanted: the cosine is missing": {"cosine": np.ones_like},
        "boxes shrink by the cosine, not by its root": {"cosine": lambda c: c},
        "boxes do not look smaller farther away: not divided by the distance": {"fall": False},
        "boxes are as wide at the rim as in the middle: 1 + s^2 + t^2 is missing": {"bulge": np.ones_like},
        "boxes are narrower at the rim: divided by 1 + s^2 + t^2": {"bulge": lambda q: 1 / (1 + q)},
        "points behind the light's plane count": {"horizon": -1.0},
        "points nearer than their own radius count: they darken the whole map": {"own": 0.0},
        "points nearer than twice their radius are left out": {"own": 2.0},
        "the farthest point of a texel is kept, not the nearest": {"kept": "largest"},
        "the last point of a texel is kept, not the nearest: no depth test": {"kept": "last"},
        "boxes cover texels by their corners, not by their centres": {"centre": 0.0},
        "boxes that no texel's centre lies in are left out": {"small": False},
        "the first point's normal for all": {"first_face": True},
    }
    return (*(Bug(cause, _maps_by(side, splat, how), BOX) for cause, how in ways.items()),
            Bug("one texel for each point, whatever its size", _maps_by(side, 0.0, {}), BOX))


def _maps_by(side: int, splat: float, how: dict[str, Any]) -> Run:
    return lambda arrays, real: literal_maps(arrays, side, splat, **how)  # noqa: ARG005


def literal_filled(
    depth: Array, levels: int, *, near: float = NEAR, pulled: str = "mean", weights: tuple[int, int, int] = (9, 3, 1),
    over: bool = False, push: bool = True, outwards: bool = True,
) -> Array:
    """Return one map whose holes are pulled and pushed, with a bug."""
    if levels == 0:
        return depth
    fine = depth if len(depth) > 1 else np.repeat(np.repeat(depth, 2, 0), 2, 1)
    side = len(fine) // 2
    four = fine.reshape(side, 2, side, 2).transpose(0, 2, 1, 3).reshape(side, side, 4)
    coarse = {"mean": _mean_near(four, np.ones(4), near), "least": four.min(axis=2), "corner": four[..., 0]}[pulled]
    coarse = literal_filled(coarse, levels - 1, near=near, pulled=pulled, weights=weights, over=over, push=push,
                            outwards=outwards)
    i = np.arange(2 * side)
    beside = np.clip(i // 2 + (2 * (i % 2) - 1) * (1 if outwards else -1), 0, side - 1)
    own = i // 2
    taps = np.stack([coarse[np.ix_(own, own)], coarse[np.ix_(own, beside)], coarse[np.ix_(beside, own)],
                     coarse[np.ix_(beside, beside)]], axis=2)
    pushed = _mean_near(taps, np.array([weights[0], weights[1], weights[1], weights[2]], float), near)
    return np.where(np.isinf(fine) | over, pushed if push else fine, fine)


def _mean_near(values: Array, weights: Array, near: float) -> Array:
    least = values.min(axis=2, keepdims=True)
    with np.errstate(invalid="ignore"):
        share = np.where(np.isfinite(values) & (values <= (1 + near) * least), weights, 0)
    total = (share * np.where(np.isfinite(values), values, 0)).sum(axis=2)
    mean = np.divide(total, share.sum(axis=2), out=np.full(total.shape, np.inf), where=share.sum(axis=2) > 0)
    return np.asarray(mean)


def filled_bugs(levels: int) -> tuple[Bug, ...]:
    """Return likely bugs of pull and push."""
    ways: Mapping[str, dict[str, Any]] = {
        "all of four texels that hold something are averaged, however far apart": {"near": np.inf},
        "pull takes the nearest of four, not the mean": {"pulled": "least"},
        "pull takes the first of four": {"pulled": "corner"},
        "push takes the texel above alone, not bilinearly": {"weights": (1, 0, 0)},
        "push weighs four texels alike": {"weights": (1, 1, 1)},
        "push takes the neighbours on the far side": {"outwards": False},
        "push overwrites what was there": {"over": True},
        "holes are not filled": {"push": False},
        "one level too few": {"levels": levels - 1},
        "one level too many": {"levels": levels + 1},
    }
    return tuple(Bug(cause, _filled_by({"levels": levels} | how), PAPER) for cause, how in ways.items())


def _filled_by(how: dict[str, Any]) -> Run:
    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
        return {"vpl.filled": np.array([literal_filled(np.asarray(one, np.float64), **how)
                                        for one in arrays["vpl.depth"]])}

    return run

"""Likely bugs of samples that all receivers share: a mirror-symmetric set, and every texel within reach."""

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from refgi.sampling import FIRST_STEP, SECOND_STEP
from refgi.vectors.bugs.crown_sample import CROWN, ROUNDINGS
from refgi.vectors.spec import Array, Arrays, Bug

MIRROR = "half of the points at pi (v - 1/2), and their mirror images"


def mirrored_set(
    shift: Array, counts: tuple[int, int], radius: float, density: str, *, steps: tuple[float, float] = (
        FIRST_STEP, SECOND_STEP), begin: float = 0.5, angle: tuple[float, float] = (math.pi, 0.5),
    image: tuple[int, int] = (-1, 1), odd: bool = True, rounding: str = "nearest", moved: tuple[int, int] = (0, 1),
    weigh: Callable[[Array, int, float], Array] | None = None, order: int = 1, shifted: bool = True,
) -> tuple[Array, Array]:
    """Return offsets and weights of a mirror-symmetric set, with a bug; `weigh` by distance, number, 0 or 1 (crown)."""
    shift = np.asarray(shift, np.float64)[list(moved)] * shifted
    pairs, last, uniform = [], [], density == "uniform"
    for count, near in zip(counts, (0.0, 1.0), strict=True):
        j = np.arange((count + 1) // 2)
        u, v = ((begin + j * step + one) % 1 for step, one in zip(steps, shift, strict=True))
        far = radius * (np.sqrt(near + (1 + 2 * near) * u) if uniform else near + u)
        weight = (1 + 2 * near) * math.pi * radius**2 / max(count, 1) + 0 * far if uniform else (
            2 * math.pi * radius * far / max(count, 1))
        weight = weight if weigh is None else weigh(far, count, near)
        turn = angle[0] * (v - angle[1])
        x, y = far * np.cos(turn), far * np.sin(turn)
        right = ROUNDINGS[rounding](np.stack([x, y], axis=1))
        both = np.stack([right, right * image], axis=1)[: count // 2].reshape(-1, 2)[:, ::order]
        pairs.append((both, np.repeat(weight[: count // 2], 2)))
        if count % 2 and odd:
            end = np.stack([np.zeros(1), ROUNDINGS[rounding](np.copysign(far, y)[-1:])], axis=1)
            last.append((end[:, ::order], weight[-1:]))
    offsets, weights = zip(*pairs, *last, strict=True)
    return np.concatenate(offsets).astype(np.int32), np.concatenate(weights)


def mirrored_bugs(name: str, counts: tuple[int, int], radius: float, density: str) -> list[Bug]:
    """Return likely bugs of a fixed set."""
    def alike(far: Array, count: int, near: float) -> Array:
        return np.full_like(far, (1 + 2 * near) * math.pi * radius**2 / max(count, 1))

    ways: Mapping[str, dict[str, Any]] = {
        "mirror images lie below, not to the left: the sign of the row": {"image": (1, -1)},
        "mirror images lie on the opposite side: both signs": {"image": (-1, -1)},
        "each point is there twice: no mirror image": {"image": (1, 1)},
        "points lie all around the receiver, at 2 pi v": {"angle": (2 * math.pi, 0.0)},
        "points lie below the receiver, at pi v": {"angle": (math.pi, 0.0)},
        "angles are halves: pi / 2 (v - 1/2)": {"angle": (math.pi / 2, 0.5)},
        "the random shift is left out": {"shifted": False},
        "the shifts of u and v are exchanged": {"moved": (1, 0)},
        "the first shift for both coordinates": {"moved": (0, 0)},
        "the sequence starts at 0 instead of 1/2": {"begin": 0.0},
        "the steps of u and v are exchanged": {"steps": (SECOND_STEP, FIRST_STEP)},
        "columns and rows are exchanged": {"order": -1},
        "offsets are cut off towards 0, not rounded": {"rounding": "cut"},
        "offsets are cut off downwards, not rounded": {"rounding": "floor"},
        "each sample stands for one texel: the weight is 1": {"weigh": lambda far, count, near: 1 + 0 * far},  # noqa: ARG005
        "weights lack a factor 2: only half of the points were drawn": {
            "weigh": lambda far, count, near: alike(far, count, near) / 2 if density == "uniform" else (
                math.pi * radius * far / max(count, 1))},
    }
    ways = dict(ways) if density == "uniform" else {
        **ways, "weights do not follow the density: those of uniform samples": {"weigh": alike}}

    def by(how: dict[str, Any]) -> Any:
        def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
            offsets, weight = mirrored_set(arrays[f"{name}.shift"], counts, radius, density, **how)
            return {f"{name}.offsets": offsets[None, None], f"{name}.weight": weight[None, None]}

        return run

    return [Bug(cause, by(how), MIRROR) for cause, how in ways.items()]


def every(low: float, high: float, *, square: bool = False, closed: bool = False, low_too: bool = True) -> Array:
    """Return every texel of a disc or ring, with a bug, in the kit's order."""
    reach = math.ceil(high) + 1
    row, column = np.mgrid[-reach : reach + 1, : reach + 1]
    far = np.maximum(np.abs(row), column) if square else np.hypot(row, column)
    inside = ((far <= high) if closed else (far < high)) & ((far >= low) if low_too else (far > low)) & (far > 0)
    half = np.stack([column, row], axis=2)[inside & (column > 0)]
    both = np.stack([half, half * (-1, 1)], axis=1).reshape(-1, 2)
    middle = np.stack([column, row], axis=2)[inside & (column == 0)]
    return np.concatenate([both, middle]).astype(np.int32)


def every_bugs(name: str, low: float, high: float) -> list[Bug]:
    """Return likely bugs of every texel within reach."""
    sets = {
        "texels at the outer radius count: <= in place of <": lambda: every(low, high, closed=True),
        "a square in place of a disc": lambda: every(low, high, square=True),
        "texels reach half as far": lambda: every(low / 2, high / 2),
        "texels reach twice as far": lambda: every(2 * low, 2 * high),
        "texels to the left are missing: the right half twice": lambda: np.abs(every(low, high)) * (1, 1),
        "columns and rows are exchanged": lambda: every(low, high)[:, ::-1],
        "rows run upwards": lambda: every(low, high) * (1, -1),
    }
    if low:
        sets |= {"the inner disc counts as well": lambda: every(0.0, high),
                 "texels at the inner radius are left out: > in place of >=": lambda: every(low, high, low_too=False)}

    def by(make: Callable[[], Array]) -> Any:
        def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
            offsets = make().astype(np.int32)
            return {f"{name}.offsets": offsets[None, None], f"{name}.weight": np.ones((1, 1, len(offsets)))}

        return run

    return [Bug(cause, by(make), CROWN) for cause, make in sets.items()] + [
        Bug("samples weigh their share: 1 over their number", lambda arrays, real: {  # noqa: ARG005
            f"{name}.offsets": every(low, high)[None, None],
            f"{name}.weight": np.full((1, 1, len(every(low, high))), 1 / len(every(low, high)))}, CROWN)]

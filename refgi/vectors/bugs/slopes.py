"""What ports get wrong in slopes and curvatures of cells (Nichols and Wyman 2009, Sec. 3.2), in NumPy."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from refgi.vectors.spec import Array, Arrays, Bug, Run

IDS = "gbuffer.triangle_id"


def slopes_bugs(names: tuple[str, ...], relative: bool) -> Iterator[Bug]:
    """Yield likely bugs of the steepest change of depth within cells."""
    larger = "sqrt(dx^2 + dy^2), the larger of both differences along each axis"
    for cause, knobs in (
            ("the square root is missing: dx^2 + dy^2", {"join": lambda x, y: x * x + y * y}),
            ("dx + dy in place of sqrt(dx^2 + dy^2)", {"join": lambda x, y: x + y}),
            ("the larger of dx and dy in place of sqrt(dx^2 + dy^2)", {"join": np.maximum}),
            ("differences along rows alone: dy is left out", {"join": lambda x, _y: x}),
            ("differences along columns alone: dx is left out", {"join": lambda _x, y: y}),
            ("the smaller of both differences along each axis", {"pick": np.minimum}),
            ("the mean of both differences along each axis", {"pick": lambda a, b: (a + b) / 2}),
            ("the sum of both differences along each axis", {"pick": lambda a, b: a + b}),
            ("only the difference to the pixel before counts", {"pick": lambda a, _b: a}),
            ("only the difference to the next pixel counts, not that to the one before", {"pick": lambda _a, b: b}),
            ("cells hold the mean of their pixels' slopes, not the largest", {"mip": "mean"}),
            ("cells hold the slope of their first pixel, not the largest", {"mip": "first"}),
            ("cells hold the smallest slope, not the largest", {"mip": "min"})):
        yield Bug(cause, _differing(names, depth_steps, relative=relative, **knobs), larger)
    if relative:
        yield Bug("slopes are divided by the depth squared", _differing(
            names, depth_steps, relative=True, squared=True), "over the depth")


def curvatures_bugs(names: tuple[str, ...], rate: bool) -> Iterator[Bug]:
    """Yield likely bugs of the largest chord between neighbouring normals within cells."""
    chord = "E-AMS-01: |N1 - N2|"
    largest: dict[str, Any] = {"join": np.maximum, "relative": False}
    for cause, knobs in (
            ("the square root is missing: |N1 - N2|^2", {"chord": lambda s: s}),
            ("1 - <N1, N2> in place of the chord", {"chord": lambda s: s / 2}),
            ("half the chord: sin(angle / 2), without the 2", {"chord": lambda s: np.sqrt(s) / 2}),
            ("the sine of the angle in place of the chord", {"chord": lambda s: np.sqrt(
                np.maximum(1 - (1 - s / 2) ** 2, 0))}),
            ("the angle in degrees in place of the chord", {"chord": lambda s: np.degrees(
                2 * np.arcsin(np.minimum(np.sqrt(s) / 2, 1)))}),
            ("only neighbours to the left and right count", {"join": lambda x, _y: x}),
            ("only neighbours above and below count", {"join": lambda _x, y: y}),
            ("chords to neighbours are added, not the largest", {"join": lambda x, y: x + y, "pick": np.add}),
            ("only the next pixels count, not those before", {"pick": lambda _a, b: b}),
            ("only the pixels before count, not the next", {"pick": lambda a, _b: a}),
            ("the smaller chord along each axis", {"pick": np.minimum}),
            ("cells hold the mean of their pixels' curvatures, not the largest", {"mip": "mean"}),
            ("cells hold the curvature of their first pixel, not the largest", {"mip": "first"}),
            ("cells hold the smallest curvature, not the largest", {"mip": "min"})):
        if not rate:
            yield Bug(cause, _differing(names, normal_chords, **{**largest, **knobs}), chord)


def _differing(names: tuple[str, ...], steps: Callable[..., Any], **knobs: Any) -> Run:
    """Return a stage of differences between neighbours, with bugs."""
    def altered(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
        return dict(zip(names, literal_differences(arrays, steps, len(names), **knobs), strict=True))

    return altered


def literal_differences(
    arrays: Arrays, steps: Callable[..., Any], top: int, *, join: Any = np.hypot, pick: Any = np.maximum,
    mip: str = "max", relative: bool = False, squared: bool = False, chord: Any = np.sqrt,
) -> list[Array]:
    """Return levels 1 to `top` of what a pixel differs from its neighbours by, with bugs."""
    here = np.asarray(arrays[IDS]) >= 0
    both = []
    for axis in (1, 0):
        beside = np.zeros((2, *here.shape))
        ends, starts = [slice(None)] * 2, [slice(None)] * 2
        ends[axis], starts[axis] = slice(0, -1), slice(1, None)
        step = np.where(here[tuple(ends)] & here[tuple(starts)], steps(arrays, axis, chord), 0)
        beside[1][tuple(ends)], beside[0][tuple(starts)] = step, step
        both.append(pick(beside[0], beside[1]))
    found = np.where(here, join(*both), 0)
    if relative:
        depth = np.where(here, arrays["gbuffer.depth"], 1)
        found = found / (depth**2 if squared else depth)
    return [_mip(found, level, mip) for level in range(1, top + 1)]


def _mip(plane: Array, level: int, how: str) -> Array:
    side = 1 << level
    shape = tuple(-(-size >> level) for size in plane.shape)
    join: Any = {"max": np.max, "mean": np.mean, "min": np.min, "first": lambda cell: cell[0, 0]}[how]
    return np.array([[join(plane[i * side : (i + 1) * side, j * side : (j + 1) * side]) for j in range(shape[1])]
                     for i in range(shape[0])])


def depth_steps(arrays: Arrays, axis: int, _: Any) -> Array:
    """Return |z1 - z2| of pixels and the next ones along an axis."""
    z = np.where(np.asarray(arrays[IDS]) >= 0, arrays["gbuffer.depth"], 0)
    return np.abs(np.diff(z, axis=axis))


def normal_chords(arrays: Arrays, axis: int, chord: Any) -> Array:
    """Return |N1 - N2|, or what `chord` makes of its square, of pixels and the next ones along an axis."""
    return np.asarray(chord((np.diff(np.asarray(arrays["gbuffer.normal"]), axis=1 + axis) ** 2).sum(axis=0)))

"""Likely bugs of the offsets and weights of samples: the stage written out, with a keyword for each bug."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from refgi.vectors.spec import Array, Arrays, Bug

TURN = 2.0 * math.pi
CROWN = "HSS Sec. 3.2: from r to 2 r around the receiver, at the first level the disc as well"
WEIGHT = "area of disc or crown over its own number of samples (E-HSS-06)"
CENTRES = "texel centres (E-HSS-10)"
ANGLE = "angle 2 pi (v + shift)"
PLACE = "(right, down), row 0 is the top row"
WRAP = "u is shifted modulo 1"
ROUNDINGS: dict[str, Callable[[Array], Array]] = {
    "nearest": lambda x: np.floor(x + 0.5), "floor": np.floor, "cut": np.trunc, "cut half": lambda x: np.trunc(x + 0.5),
    "up": np.ceil}
WRAPS: dict[str, Callable[[Array], Array]] = {
    "modulo": lambda u: u % 1, "none": lambda u: u, "clamp": lambda u: np.minimum(u, 1.0)}


class Sample(NamedTuple):
    """What weights are made of, for all samples."""

    near: Array  # 0 in the disc, 1 in the crown
    far: Array  # distance from the receiver, texels
    number: Array  # samples of its disc or crown
    weight: Array  # as it should be


def crown_samples(
    points: Array, shifts: Array, inner: int, radius: float, density: str, *, turn: float = TURN, sine: float = 1.0,
    wrap: str = "modulo", moved: tuple[bool, bool] = (True, True), order: tuple[int, int] = (0, 1),
    rounding: tuple[str, str] = ("nearest", "nearest"), reach: Callable[[Array, Array], Array] | None = None,
    weigh: Callable[[Sample], Array] | None = None, change: Callable[[Array], Array] | None = None,
    exchanged: bool = False,
) -> tuple[Array, Array]:
    """Return offsets and weights of samples, in float64, with a bug.

    `reach`: distance in radii by near (0 disc, 1 crown) and u; `change`: of offsets.
    """
    points, shifts = np.asarray(points, np.float64), np.asarray(shifts, np.float64)[..., list(order)]
    near = np.where(np.arange(len(points)) < inner, 0.0, 1.0)
    u, angle, (x, y) = points[:, 0] + moved[0] * shifts[..., :1], turn * moved[1] * shifts[..., 1:], points[:, 1:].T
    if exchanged:
        u, angle = np.arctan2(y, x) / TURN + shifts[..., 1:], TURN * (points[:, 0] + shifts[..., :1])
        x, y = np.ones_like(x), np.zeros_like(y)
    u, uniform = WRAPS[wrap](u), density == "uniform"
    right = np.sqrt(near + (1 + 2 * near) * u) if uniform else near + u
    d = radius * (reach(near, u) if reach else right)
    cosine, turned = np.cos(angle), sine * np.sin(angle)
    place = d * (x * cosine - y * turned), d * (x * turned + y * cosine)
    offsets = np.stack([ROUNDINGS[how](one) for how, one in zip(rounding, place, strict=True)], axis=-1)
    counts = np.where(near > 0, len(points) - inner, inner)
    weight = (1 + 2 * near) * math.pi * radius**2 / counts if uniform else TURN * radius * d / counts
    weight = weigh(Sample(near, d, counts, weight)) if weigh else weight
    weight = np.broadcast_to(weight, (1, 1, len(points)) if uniform else d.shape)
    return (change(offsets) if change else offsets).astype(np.int32), weight


def sample_bugs(name: str, inner: int, radius: float, density: str) -> list[Bug]:
    """Return the bugs of offsets and weights of a level's samples, of which the first `inner` lie in the disc."""
    def bug(cause: str, paper: str, **knobs: Any) -> Bug:
        def wrong(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
            offsets, weight = crown_samples(arrays[f"{name}.points"], arrays[f"{name}.shifts"], inner, radius, density,
                                            **knobs)
            return {f"{name}.offsets": offsets, f"{name}.weight": weight}

        return Bug(cause, wrong, paper)

    def signed(right: int, down: int) -> Any:
        return lambda offsets: offsets * np.array([right, down])

    bugs = [
        bug("columns and rows are exchanged", PLACE, change=lambda a: a[..., ::-1]),
        bug("rows run upwards: samples are upside down, flipped by the sign of the row", PLACE, change=signed(1, -1)),
        bug("columns run leftwards: samples are mirrored by the sign of the column", PLACE, change=signed(-1, 1)),
        bug("samples lie on the opposite side of the receiver: both signs are wrong", PLACE, change=signed(-1, -1)),
        bug("the shift of the angle is left out", ANGLE, moved=(True, False)),
        bug("the shift of u is left out", WRAP, moved=(False, True)),
        bug("the shifts of u and v are exchanged", ANGLE, order=(1, 0)),
        bug("the shift of u serves for the angle as well: the first coordinate twice", ANGLE, order=(0, 0)),
        bug("the shift of the angle serves for u as well: the second coordinate twice", ANGLE, order=(1, 1)),
        bug("distance and direction are exchanged", "u is how far, v which way", exchanged=True),
        bug("the shift of the angle is not multiplied by 2 pi: a share of a turn for radians", ANGLE, turn=1.0),
        bug("the shift of the angle is multiplied by pi, not 2 pi: half a turn", ANGLE, turn=math.pi),
        bug("the shift of the angle is in degrees, not radians", ANGLE, turn=360.0),
        bug("the shift turns the other way round: the sign of the sine", ANGLE, sine=-1.0),
        bug("u and its shift are not taken modulo 1: no wrap", WRAP, wrap="none"),
        bug("u and its shift are clamped to 1, not taken modulo 1", WRAP, wrap="clamp"),
    ]
    for what, kind in (("floor, truncated downwards: cut off, no 1/2 is added", "floor"),
                       ("truncated toward 0, cut off by a cast: no 1/2 is added", "cut"),
                       ("truncated toward 0 after 1/2 is added: wrong for negative ones", "cut half"),
                       ("rounded upwards (ceil)", "up")):
        bugs += [bug(f"offsets are cut off instead of rounded to the nearest: {what}", CENTRES, rounding=(kind, kind)),
                 bug(f"columns alone are cut off instead of rounded: {what}", CENTRES, rounding=(kind, "nearest")),
                 bug(f"rows alone are cut off instead of rounded: {what}", CENTRES, rounding=("nearest", kind))]
    return [*bugs, *_reach_bugs(bug, density == "uniform", inner), *_weight_bugs(bug, radius, density, inner)]


def _reach_bugs(bug: Callable[..., Bug], uniform: bool, inner: int) -> list[Bug]:
    def right(near: Array, u: Array) -> Array:
        return np.sqrt(near + (1 + 2 * near) * u) if uniform else near + u

    ways: list[tuple[str, Callable[[Array, Array], Array]]] = [
        ("the crown reaches from 2 r to 4 r: twice the radius", lambda near, u: 2 * right(near, u)),
        ("the crown reaches from r/2 to r: half the radius", lambda near, u: right(near, u) / 2),
        ("the density of samples is inverse distance, not uniform: u and not its square root" if uniform else
         "the density of samples is uniform, not inverse distance: the square root of u", lambda near, u: (
             near + u if uniform else np.sqrt(near + (1 + 2 * near) * u))),
        ("the crown is sampled by the disc's formula: from 0 to r", lambda near, u: right(0 * near, u)),
        ("the crown reaches from r to 3 r: too wide a ring", lambda near, u: (
            np.sqrt(near + (1 + 7 * near) * u) if uniform else near + (1 + near) * u)),
        ("u runs from the outer rim inwards: 1 - u in place of u", lambda near, u: right(near, 1 - u)),
    ]
    if uniform:
        ways += [
            ("uniform samples lie at u, not at its square root: the root (sqrt) of the radius is missing",
             lambda near, u: near + (1 + 2 * near) * u),
            ("uniform samples of the crown lie at 1 + 3u, not at its root (sqrt)",
             lambda near, u: np.where(near > 0, 1 + 3 * u, np.sqrt(u))),
            ("the factor 3 of the crown is missing in the radius: sqrt(1 + u), from r to 1.41 r",
             lambda near, u: np.sqrt(near + u)),
            ("the radius of the crown is sqrt(1 + 2u)", lambda near, u: np.sqrt(near + (1 + near) * u)),
            ("the 1 of the crown is missing in the radius: sqrt(3u)", lambda near, u: np.sqrt((1 + 2 * near) * u)),
        ]
    if inner:
        ways += [
            ("the disc is sampled by the crown's formula: from r to 2 r", lambda near, u: right(0 * near + 1, u)),
            ("the disc reaches to 2 r, not to r", lambda near, u: right(near, u) * (2 - near)),
            ("formulas of disc and crown are exchanged", lambda near, u: right(1 - near, u)),
        ]
        ways += [("uniform samples of the disc lie at u, not at its square root (sqrt): the radius",
                  lambda near, u: np.where(near > 0, right(near, u), u))] if uniform else []
    return [bug(cause, CROWN, reach=reach) for cause, reach in ways]


def _weight_bugs(bug: Callable[..., Bug], radius: float, density: str, inner: int) -> list[Bug]:
    uniform = density == "uniform"
    ways: list[tuple[str, Callable[[Sample], Array]]] = [
        ("each sample stands for one texel: the weight is 1", lambda s: np.ones_like(s.weight)),
        ("weights are not divided by the number of samples", lambda s: s.weight * s.number),
        ("weights lack the factor 2, or pi in place of 2 pi: half the texels",
         lambda s: s.weight / 2),
        ("weights lack pi", lambda s: s.weight / math.pi),
        ("weights are twice too large: a factor 2 too many", lambda s: s.weight * 2),
        ("weights are divided by the radius: r is missing", lambda s: s.weight / radius),
        ("weights are shares: the number of samples over the area, 1/w", lambda s: 1 / s.weight),
        ("the crown has a third of its weight, that of the disc: the factor 3 is missing",
         lambda s: s.weight / (1 + 2 * s.near)),
        ("the crown has the area of the disc of 2 r: 4 in place of 3",
         lambda s: s.weight * (1 + s.near / 3)),
    ]
    if not uniform:
        ways += [
            ("weights do not follow the density: those of uniform samples, pi r^2 (3 in the crown) over N",
             lambda s: np.broadcast_to((1 + 2 * s.near) * math.pi * radius**2 / s.number, s.far.shape)),
            ("weights do not follow the density: the mean of all samples for each",
             lambda s: np.broadcast_to(s.weight.mean(axis=-1, keepdims=True), s.far.shape)),
            ("weights lack the distance d: 2 pi r / N", lambda s: s.weight / s.far),
            ("weights have the square of the distance: 2 pi d^2 / N",
             lambda s: s.weight * s.far / radius),
            ("weights have the square of the radius in place of r d: 2 pi r^2 / N",
             lambda s: s.weight * radius / s.far),
            ("weights fall with the distance: divided by d, not multiplied",
             lambda s: s.weight / s.far**2),
        ]
    if inner:
        ways += [
            ("texels are shared out among all samples, disc and crown together: divided by the number of both",
             lambda s: s.weight * s.number / len(s.near)),
            ("the numbers of samples of disc and crown are exchanged in the weights",
             lambda s: s.weight * s.number / (len(s.near) - s.number)),
            ("the number of samples of the disc for those of the crown as well",
             lambda s: s.weight * s.number / inner),
            ("the number of samples of the crown for those of the disc as well",
             lambda s: s.weight * s.number / (len(s.near) - inner)),
        ]
    return [bug(cause, WEIGHT, weigh=weigh) for cause, weigh in ways]

"""Likely bugs of joint bilateral upsampling and of the sum of levels (HSS Sec. 3.2, 5)."""

from collections.abc import Callable
from typing import Any

import numpy as np

from refgi.sssil.settings import Bilateral
from refgi.vectors.bugs.bilateral import bilateral, tent
from refgi.vectors.recipe import Recipe, reading, writing
from refgi.vectors.spec import Array, Arrays, Bug, Run

BILATERAL = "HSS Sec. 3.2, 5: joint bilateral, 3 x 3; weights in docs/methods/hssil (E-HSS-12)"
HALF, PLANE = "half-pixel (E-HSS-10)", "docs/methods/hssil: the pixel's plane, 1/z is linear in the picture"
TENT = "docs/methods/hssil: (1 - 2|t|)/6, (2 - |t|)/3, (1 + 4|t|)/6"
GAUSS, LIKE = "(1 - delta^2 / (32 sigma^2))^16, 0 beyond", "max(0, n . n')^p"
LEVELS = "HSS Sec. 3.2: sums of disjoint crowns"


def upsampling_bugs(
    name: str, coarse: str, below: tuple[str, ...], here: tuple[str, ...], weights: Bilateral, added: str | None,
    centred: bool = False,
) -> list[Bug]:
    """Return the bugs of upsampling `coarse` to `name`, to which `added` is added if there is any.

    `centred`: depths of texels are means, which lie at their centres.
    """
    base: dict[str, Any] = {"corner": (0.0, 0.0)} if centred else {}

    def bug(cause: str, paper: str, **knobs: Any) -> Bug:
        def wrong(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
            made = bilateral(arrays, coarse, below, here, weights, **base | knobs)
            return {name: made + arrays[added] if added else made}

        return Bug(cause, wrong, paper)

    at_corner = [bug("a texel's depth is taken for that of its nearest pixel, at a corner, not for the mean", BILATERAL,
                     corner=(1.0, 1.0))] if centred else []
    return [*_place_bugs(bug), *_axis_bugs(bug), *_weight_bugs(bug), *(_exponent_bugs(bug) if added else []),
            *at_corner]


def _place_bugs(bug: Callable[..., Bug]) -> list[Bug]:
    """Return bugs of slopes, planes and places."""
    return [
        bug("depths are compared without the slope of the surface: its plane is left out", PLANE, sloped=(0.0, 0.0),
            corner=(0.0, 0.0)),
        bug("slopes are left out of the plane alone, not of the texel's corner", PLANE, sloped=(0.0, 0.0)),
        bug("the plane falls where it should rise: the sign of the slope", PLANE, sloped=(-1.0, -1.0)),
        bug("the larger of the two slopes (differences), not the smaller", PLANE, kinds=("larger", "larger")),
        bug("the mean of the two slopes: the central difference, not the smaller one", PLANE, kinds=("mean", "mean")),
        bug("the slope is the sum of both differences: a factor 1/2 is missing", PLANE, kinds=("both", "both")),
        bug("the slope is the difference to the pixel before, not the smaller", PLANE, kinds=("before", "before")),
        bug("the slope is the difference to the pixel after, not the smaller", PLANE, kinds=("after", "after")),
        bug("slopes of opposite signs are not left out: the smaller difference at silhouettes as well", PLANE,
            kinds=("unsigned", "unsigned")),
        bug("at the rim of the picture the slope is 0, not the difference to the inside", PLANE, kinds=("rim", "rim")),
        bug("the slope is per pixel, not per texel: the factor of pixels along a texel is missing", PLANE,
            per_texel=False),
        bug("steps along rows and columns are exchanged in the plane", PLANE, crossed=True),
        bug("a texel's depth is taken for that at its centre, not at its nearest pixel: no corner", BILATERAL,
            corner=(0.0, 0.0)),
        bug("a texel's point lies at its far corner, not at the nearest one: the sign of the slope", BILATERAL,
            corner=(-1.0, -1.0)),
        bug("a texel's point lies twice as far from its centre: a factor 1/2 is missing in the corner", BILATERAL,
            corner=(2.0, 2.0)),
        bug("pixels lie at their left edges within a texel, not at their centres: no half pixel, 0.5 is missing", HALF,
            begin=(0.0, 0.0)),
        bug("pixels lie at their right edges within a texel, not at their centres: a half pixel too many", HALF,
            begin=(1.0, 1.0)),
        bug("the tent is centred on the texel of the pixel", HALF, whole=(0.0, 0.0)),
        bug("the tent is shifted to the wrong side", HALF, whole=(-1.0, -1.0)),
        bug("the texel of a pixel is found by rounding, not by whole division", HALF, rounded=True),
        bug("places along rows and columns are exchanged in the tent: x and y are swapped", TENT, swapped=True),
        bug("the tent of bilinear weights: 1 - |t - step|", TENT,
            tents=lambda k, t: np.clip(1 - np.abs(t - k), 0, None)),
        bug("the middle texel has the bilinear weight 1 - |t| in the tent", TENT, tents=lambda k, t: np.where(
            k == 0, 1 - np.abs(t), tent(k, t))),
        bug("the near and the far texel are exchanged in the tent: the sign of t", TENT,
            tents=lambda k, t: tent(-k, t)),
        bug("the far texel has no weight in the tent", TENT, tents=lambda k, t: np.where(
            (k != 0) & (k * t < 0), 0.0, tent(k, t))),
        bug("no tent: all nine texels have the same spatial weight (box)", TENT,
            tents=lambda k, t: np.ones_like(t) + k * 0),
        bug("the tent is squared: its weights count twice", TENT, tents=lambda k, t: tent(k, t) ** 2),
    ]


def _axis_bugs(bug: Callable[..., Bug]) -> list[Bug]:
    """Return bugs of one of the two axes alone."""
    bugs = []
    for axis, what in ((0, "along y (down) alone"), (1, "along x (across) alone")):
        def one(wrong: Any, right: Any, axis: int = axis) -> tuple[Any, Any]:
            return (wrong, right) if axis == 0 else (right, wrong)

        bugs += [
            bug(f"pixels lie at their left or upper edges within a texel: no half pixel, 0.5 is missing, {what}", HALF,
                begin=one(0.0, 0.5)),
            bug(f"the tent is centred on the texel of the pixel, {what}", HALF, whole=one(0.0, 1.0)),
            bug(f"the tent is shifted to the wrong side, {what}", HALF, whole=one(-1.0, 1.0)),
            bug(f"the slope of the surface is left out of its plane, {what}", PLANE, sloped=one(0.0, 1.0)),
            bug(f"the sign of the slope is wrong, {what}", PLANE, sloped=one(-1.0, 1.0)),
            bug(f"the larger of the two slopes (differences), not the smaller, {what}", PLANE,
                kinds=one("larger", "smaller")),
            bug(f"a texel's depth is taken for that at its centre, no corner, {what}", BILATERAL, corner=one(0.0, 1.0)),
            bug(f"a texel's point lies at its far corner: the sign of the slope, {what}", BILATERAL,
                corner=one(-1.0, 1.0)),
        ]
    return bugs


def _exponent_bugs(bug: Callable[..., Bug]) -> list[Bug]:
    """Return bugs of the exponent of the cosine, which show between coarse levels alone."""
    return [
        bug("the exponent of the cosine between normals is half as large", LIKE,
            like=lambda cosine, p: np.clip(cosine, 0, None) ** (p / 2)),
        bug("the exponent of the cosine between normals is p + 1", LIKE,
            like=lambda cosine, p: np.clip(cosine, 0, None) ** (p + 1)),
    ]


def _weight_bugs(bug: Callable[..., Bug]) -> list[Bug]:
    """Return bugs of weights and of their mean."""
    return [
        bug("bilinear upsampling: the tent alone, neither depths nor normals are compared", BILATERAL,
            close=lambda delta, _: np.ones_like(delta), like=lambda cosine, _: np.ones_like(cosine)),
        bug("the nearest texel", BILATERAL, steps=(0,)),
        bug("depths are not compared", BILATERAL, close=lambda delta, _: np.ones_like(delta)),
        bug("normals are not compared", BILATERAL, like=lambda cosine, _: np.ones_like(cosine)),
        bug("the difference of depth (delta) is not relative: the factor z is missing", BILATERAL,
            delta_of=lambda z, far, plane: (1 / far - plane) + 0 * z),
        bug("the difference of depth (delta) is in metres, not relative to depth: z' - z", BILATERAL,
            delta_of=lambda z, far, plane: far - 1 / np.where(plane > 0, plane, 1 / z)),
        bug("the difference of depth (delta) is multiplied by the texel's depth, not by the pixel's", BILATERAL,
            delta_of=lambda z, far, plane: far * (1 / far - plane) + 0 * z),
        bug("the difference of depth (delta) is multiplied by z twice", BILATERAL,
            delta_of=lambda z, far, plane: z**2 * (1 / far - plane)),
        bug("exp(-delta^2 / sigma^2) without the 2", GAUSS, close=lambda delta, s: np.clip(
            1 - delta**2 / (16 * s**2), 0, None) ** 16),
        bug("the gaussian of depth is taken to the power of 1: the exponent 16 is missing", GAUSS,
            close=lambda delta, s: np.clip(1 - delta**2 / (32 * s**2), 0, None)),
        bug("the gaussian of depth is taken to the power of 8: half the exponent", GAUSS,
            close=lambda delta, s: np.clip(1 - delta**2 / (32 * s**2), 0, None) ** 8),
        bug("the gaussian of depth is the exact exponential (exp), not the power of 16", GAUSS,
            close=lambda delta, s: np.exp(-(delta**2) / (2 * s**2))),
        bug("the gaussian of depth is an exponential of the difference, not of its square", GAUSS,
            close=lambda delta, s: np.exp(-np.abs(delta) / s)),
        bug("the gaussian of depth is not divided by 16 before the power: (1 - u)^16", GAUSS,
            close=lambda delta, s: np.clip(1 - delta**2 / (2 * s**2), 0, None) ** 16),
        bug("the gaussian of depth is not clamped: its weight grows again far from the plane", GAUSS,
            close=lambda delta, s: (1 - delta**2 / (32 * s**2)) ** 16),
        bug("sigma of the depths is not squared", GAUSS, close=lambda delta, s: np.clip(
            1 - delta**2 / (32 * s), 0, None) ** 16),
        bug("sigma of the depths is twice as large", GAUSS, close=lambda delta, s: np.clip(
            1 - delta**2 / (128 * s**2), 0, None) ** 16),
        bug("sigma of the depths is half as large", GAUSS, close=lambda delta, s: np.clip(
            1 - delta**2 / (8 * s**2), 0, None) ** 16),
        bug("normals are compared to the power of 1: the exponent of the cosine is missing", LIKE,
            like=lambda cosine, _: np.clip(cosine, 0, None)),
        bug("the exponent of the cosine between normals is twice as large: squared", LIKE,
            like=lambda cosine, p: np.clip(cosine, 0, None) ** (2 * p)),
        bug("the own texel's normal for all nine texels", LIKE, of_own="normal"),
        bug("the own texel's depth for all nine texels", BILATERAL, of_own="depth"),
        bug("the texel's normal in place of the pixel's (the receiver's)", LIKE, pixel="normal"),
        bug("weights are not divided by their sum: not normalised", BILATERAL, divided=""),
        bug("weights are divided by the sum of the tents, not of all weights: not normalised, darker", BILATERAL,
            divided="tents"),
        bug("weights are divided by the number of texels, not by their sum: not normalised, darker", BILATERAL,
            divided="count"),
        bug("pixels without any weight get no light: the nearest texel's is missing", BILATERAL, fallback="none"),
        bug("pixels without any weight get the light of their own texel, not of the nearest in depth", BILATERAL,
            fallback="own"),
        bug("the last row and column of the 3 x 3 texels are left out: < in place of <=", BILATERAL, steps=(-1, 0)),
        bug("the first row and column of the 3 x 3 texels are left out", BILATERAL, steps=(0, 1)),
        bug("the diagonal texels of the 3 x 3 are left out: the four beside alone", BILATERAL, corners=False),
        bug("texels beyond the edge are clamped: those at the border count twice", BILATERAL, edge=True),
    ]


def sum_bugs(recipe: Recipe, run: Run, index: int, name: str, coarse: str, added: str) -> list[Bug]:
    """Return the bugs of adding a level's own light, `added`, to that of the coarser ones, `coarse`."""
    def taking(**others: str) -> Run:
        """Return the stage with other arrays of the case in place of its inputs."""
        def wrong(arrays: Arrays, real: Any) -> Arrays:
            known = recipe.expected()
            return run({**arrays, **{{"coarse": coarse, "added": added}[key]: known[other].astype(real)
                                     for key, other in others.items()}}, real)

        return wrong

    def only_own(arrays: Arrays, real: Any) -> Arrays:
        return {name: np.asarray(arrays[added], real)}

    def twice(arrays: Arrays, real: Any) -> Arrays:
        return {name: 2 * np.asarray(run(arrays, real)[name]) - arrays[added]}

    keys = {"out": name.replace(".", "__"), "own": added.replace(".", "__"), "below": coarse.replace(".", "__")}
    black: Callable[[Array], Array] = np.zeros_like
    bugs = [
        Bug("coarser levels are left out", only_own, LEVELS),
        Bug("the level's own light is left out", reading(run, **{keys["own"]: black}), LEVELS),
        Bug("the level's own light is added twice", writing_sum(run, name, added, 1.0), LEVELS),
        Bug("the level's own light is subtracted: a wrong sign", writing_sum(run, name, added, -2.0), LEVELS),
        Bug("the light of the coarser levels is added twice", twice, LEVELS),
        Bug("levels are averaged, not added", writing(run, **{keys["out"]: lambda a: a / 2}), LEVELS),
        Bug("the light of the coarser levels is divided by 4: the number of texels", reading(run, **{
            keys["below"]: lambda a: a / 4}), LEVELS),
        Bug("the red channel of the coarser levels for green and blue as well", reading(run, **{
            keys["below"]: lambda a: a[[0, 0, 0]]}), LEVELS),
    ]
    if added.startswith("blur"):
        raw, below = added.replace("blur", "gather"), f"gather{index + 1}.irradiance"
        bugs.append(Bug("unblurred light of the level is added: that of the gather, before the blur",
                        taking(added=raw), LEVELS))
        if coarse.startswith("blur"):
            bugs += [Bug("unblurred light of the coarser level: that of the gather, before the blur",
                         taking(coarse=below), LEVELS),
                     Bug("unblurred light of both levels: that of the gather, before the blur",
                         taking(coarse=below, added=raw), LEVELS)]
    if coarse.startswith("light"):
        own = coarse.replace("light", added.split(".")[0].rstrip("0123456789"))
        bugs.append(Bug("only the next coarser level's own light is added, not the sum of all coarser ones",
                        taking(coarse=own), LEVELS))
    return bugs


def writing_sum(run: Run, name: str, added: str, share: float) -> Run:
    """Return a stage that writes its sum with a further share of what it adds."""
    return lambda arrays, real: {name: run(arrays, real)[name] + share * np.asarray(arrays[added], real)}

"""What ports get wrong in the light of subsplats (Eq. 2) and in Eq. 3 (Nichols and Wyman 2009, Sec. 3.4, 4.3)."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from refgi.vectors.recipe import reading
from refgi.vectors.spec import Array, Arrays, Bug, Run

IDS = "gbuffer.triangle_id"
Factor = Callable[[Array, float], Array]
EQ3 = "AMS Eq. 3: E (a <V, N> + 1 - a)"


def light_bugs(run: Run, name: str) -> Iterator[Bug]:
    """Yield likely bugs of the sum over lights that are factors; `run` is the stage, which writes array `name`."""
    def times(factor: Callable[[int], float]) -> Run:
        def altered(arrays: Arrays, real: Any) -> Arrays:
            lights = np.asarray(arrays["lights.position"]).shape[1]
            return {name: run(arrays, real)[name] * factor(max(lights, 1))}

        return altered

    for cause, factor in (
            ("the mean over all lights, not their sum: divided by the number of lights", lambda n: 1 / n),
            ("the sum over lights is multiplied by the number of lights", float),
            ("flux is spread over the sphere: 1/(4 pi) in place of 1/pi", lambda _: 0.25),
            ("flux is spread over the hemisphere: 1/(2 pi) in place of 1/pi", lambda _: 0.5),
            ("1/pi is counted twice: light is divided by pi once more", lambda _: 1 / np.pi)):
        yield Bug(cause, times(factor), "AMS Eq. 2: a sum over lights of Phi / pi")
    yield Bug("the first subsplat's normal for all", reading(run, multires__normal=_first), "normal of each subsplat")
    yield Bug("the first subsplat's point for all", reading(run, multires__point=_first), "point of each subsplat")


def _first(array: Array) -> Array:
    return np.broadcast_to(array[:, :1], array.shape).copy()


def detail_bugs(a: float) -> Iterator[Bug]:
    """Yield likely bugs of Eq. 3, which darkens what turns away from the camera."""
    def made(factor: Factor, **knobs: Any) -> Run:
        return lambda arrays, _: {"multires.detailed": literal_detail(arrays, a, factor, **knobs)}

    for cause, run in (
            ("1 - a is left out: a <V, N> alone, without the ambient part", made(lambda c, a: a * c)),
            ("a is left out of the cosine's part: <V, N> + 1 - a", made(lambda c, a: c + 1 - a)),
            ("1 in place of 1 - a: a <V, N> + 1", made(lambda c, a: a * c + 1)),
            ("a in place of 1 - a: a <V, N> + a", made(lambda c, a: a * c + a)),
            ("1 - a for both parts: (1 - a) <V, N> + 1 - a", made(lambda c, a: (1 - a) * (c + 1))),
            ("1 + a in place of 1 - a", made(lambda c, a: a * c + 1 + a)),
            ("a and 1 - a are exchanged", made(lambda c, a: (1 - a) * c + a)),
            ("a = 1: light is multiplied by the cosine", made(lambda c, _a: c)),
            ("1 - <V, N> in place of <V, N>: what faces the camera is darkened", made(
                lambda c, a: a * (1 - c) + 1 - a)),
            ("the cosine's part is subtracted: 1 - a - a <V, N>", made(lambda c, a: 1 - a - a * c)),
            ("the cosine is squared", made(lambda c, a: a * c * c + 1 - a)),
            ("the root of the cosine", made(lambda c, a: a * np.sqrt(np.abs(c)) + 1 - a)),
            ("light is multiplied by the factor twice", made(lambda c, a: (a * c + 1 - a) ** 2)),
            ("light is divided by the factor", made(lambda c, a: 1 / (a * c + 1 - a))),
            ("the larger of <V, N> and 1 - a", made(lambda c, a: np.maximum(c, 1 - a))),
            ("a is 0.5 whatever the setting", made(lambda c, _a: 0.5 * c + 0.5)),
            ("V is not made a unit vector (not normalised): the cosine is multiplied by the distance",
             made(eq3, unit=False)),
            ("V points from the camera to the surface: the sign of V is turned round",
             made(eq3, sign=-1)),
            ("the camera lies at the origin: V is minus the position", made(eq3, eye=0)),
            ("V is the position: the camera's place is left out", made(eq3, eye=0, sign=-1)),
            ("V is the same for all pixels: that of the middle one", made(eq3, same="v")),
            ("the normal is the same for all pixels: that of the middle one", made(eq3, same="n")),
            ("rows of normals run upwards", made(eq3, same="upwards"))):
        yield Bug(cause, run, EQ3)
    yield Bug("1 - a is added to the light, not multiplied with it", made(lambda c, a: a * c, added=True), EQ3)


def eq3(cosine: Array, a: float) -> Array:
    """Return the factor of Eq. 3."""
    return a * cosine + 1 - a


def literal_detail(
    arrays: Arrays, a: float, factor: Factor = eq3, *, unit: bool = True, sign: int = 1, eye: int = 1, same: str = "",
    added: bool = False,
) -> Array:
    """Return Eq. 3 at every pixel that shows a surface, with bugs."""
    light, x, n = (np.asarray(arrays[name], np.float64) for name in (
        "multires.upsampled.0", "gbuffer.position", "gbuffer.normal"))
    v = sign * (eye * np.asarray(arrays["camera.origin"], np.float64)[0][:, None, None] - x)
    middle = np.s_[:, x.shape[1] // 2, x.shape[2] // 2, None, None]
    v, n = np.broadcast_to(v[middle], v.shape) if same == "v" else v, n[middle] if same == "n" else n
    n = n[:, ::-1] if same == "upwards" else n
    length = np.sqrt((v * v).sum(axis=0))
    cosine = (v * n).sum(axis=0) / (np.where(length > 0, length, 1) if unit else 1)
    cosine = np.maximum(cosine, 0)
    with np.errstate(all="ignore"):
        made = light * factor(cosine, a) + (1 - a if added else 0)
    return np.where(np.asarray(arrays[IDS]) >= 0, made, 0)

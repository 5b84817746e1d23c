"""Eq. 2 and 3 as a port writes them from the paper, and as it gets them wrong (SII; docs/radiometry)."""

from functools import partial
from typing import Any

import numpy as np

from refgi.lobes import lobe_norm
from refgi.pairs.pixel_lights import PixelLights
from refgi.vectors.recipe import reading
from refgi.vectors.spec import Array, Arrays, Bug, Run
from refgi.vectors.stages.lights import pixel_lights_of

RECEIVERS = ("gbuffer.position", "gbuffer.normal", "gbuffer.triangle_id")
EQ2 = "SII Eq. 2 and 3; unit directions and r^2 (E-SII-02)"
SHARES = {"rest": "K, the share of a lobe above the surface, holds a part of its integral over the rest, not over the "
                  "whole: the remainder divides",
          "whole": "K, the share of a lobe above the surface, lacks a half: 1 - I in place of 1 - I/2",
          "below": "lobes are normalised over their share below the surface: 1 - K in place of K",
          "times": "lobes are multiplied by K, their share above the surface, not divided by it"}
CLAMPED, DISC = "<a.b> = max(0, a.b)", "r^2 + A/pi"


def as_printed(own: bool, **bugs: Any) -> Run:
    """Return Eq. 2 and 3 as a port would write them from the paper, or with bugs that `literal_pairs` knows.

    With footprints they have the disc's r^2 + A/pi for r^2.
    """
    def run(arrays: Arrays, real: Any) -> Arrays:
        return {("pairs" if own else "sum") + ".irradiance": literal_pairs(arrays, own, **bugs).astype(real)}

    return run


def pair_bugs(run: Run, clamped: bool, glossy: bool, own: bool = False) -> tuple[Bug, ...]:
    """Return likely bugs of Eq. 2 and 3; `own`: light k meets receiver k alone."""
    literal = partial(as_printed, own)
    found = [
        Bug("the receiver's cosine is missing", literal(arrives="none"), EQ2),
        Bug("the light's cosine is missing", literal(leaves="none"), EQ2),
        Bug("cosines are not clamped at 0", literal(arrives="any", leaves="any"), CLAMPED),
        Bug("the receiver's cosine is not clamped at 0: light from behind counts", literal(arrives="any"), CLAMPED),
        Bug("the light's cosine is not clamped at 0: lights shine backwards", literal(leaves="any"), CLAMPED),
        Bug("cosines are taken as absolute values", literal(arrives="abs", leaves="abs"), CLAMPED),
        Bug("the receiver's cosine is taken as absolute value", literal(arrives="abs"), CLAMPED),
        Bug("the light's cosine is taken as absolute value", literal(leaves="abs"), CLAMPED),
        Bug("1/r^4 with unit directions", literal(power=4), "E-SII-02"),
        Bug("1/r in place of 1/r^2", literal(power=1), "E-SII-02"),
        Bug("directions are not normalised and 1/r^2 is missing", literal(power=0), "E-SII-02"),
        Bug("directions are not normalised though the sum divides by r^2", literal(raw=True), "E-SII-02"),
        Bug("no falloff with distance: 1/r^2 is missing", literal(power=-1), "E-SII-02"),
        Bug("distances count as at least 0.1 m", literal(least=0.1), "no clamp unless asked for"),
        Bug("places of light and receiver are exchanged", literal(exchanged=True), EQ2),
        Bug("the light's normal points inwards", reading(run, lights__normal=lambda a: -a), EQ2),
        Bug("the receiver's normal points inwards", reading(run, gbuffer__normal=lambda a: -a), EQ2),
        Bug("only the first half of the lights", reading(run, lights__flux=_first_half, **(
            {"lights__lobe_flux": _first_half} if glossy else {})), "all lights"),
        *((Bug("distances count as at least 1 cm", literal(least=0.01), "no clamp unless asked for"),) if own else (
            Bug("the last light is left out", reading(run, lights__flux=_without_last, **(
                {"lights__lobe_flux": _without_last} if glossy else {})), "all lights"),
            Bug("the largest light in place of the sum", literal(joined="max"), "all lights"))),
    ] if not clamped else [
        Bug("the footprint is divided by 2 pi instead of pi", reading(run, lights__area=lambda a: a / 2), DISC),
        Bug("the footprint is not divided by pi", reading(run, lights__area=lambda a: a * np.pi), DISC),
    ]
    if glossy:
        found += [
            *((Bug("the first light's exponent for all lobes",
                   reading(run, lights__lobe_exponent=lambda a: np.full_like(a, a.flat[0])), "SII Eq. 3"),)
              if own else ()),
            Bug("lobes are normalised by P + 2 in place of P + 1", _scaled_lobes(run), "E-SII-03: (P + 1) / 2 pi K"),
            Bug("lobes are missing", reading(run, lights__lobe_flux=np.zeros_like), "SII Eq. 3"),
            Bug("the diffuse part is missing", reading(run, lights__flux=np.zeros_like), "SII Eq. 3"),
            Bug("lobes are around the normal", _lobes_at_normal(run), "SII Eq. 3"),
            Bug("the lobe's exponent is one too high", reading(run, lights__lobe_exponent=lambda a: a + 1),
                "SII Eq. 3"),
        ]
        found += [] if clamped else [
            Bug("lobes are not normalised", literal(norm="none"), "E-SII-03: (P + 1) / 2 pi K"),
            Bug("lobes are normalised over the whole lobe, not over what lies above the surface",
                literal(norm="full"), "E-SII-03: (P + 1) / 2 pi K"),
            Bug("a half is missing in 1 - |r - w|^2 / 2: lobes are too narrow", literal(lobe_narrow=True), "SII Eq. 3"),
            Bug("lobes reach below the light's horizon", literal(horizon=False), "SII Eq. 3"),
            Bug("lobes are normalised by (P + 2) / 2 pi", literal(norm="cosine"), "E-SII-03: (P + 1) / 2 pi K"),
            *(Bug(cause, literal(norm=how), "E-SII-03: (P + 1) / 2 pi K") for how, cause in SHARES.items()),
            Bug("the direction is turned round in lobes", literal(lobe_turned=True), "SII Eq. 3: towards receivers"),
            Bug("the light's cosine counts for lobes too", literal(lobe_cosine=True), "SII Eq. 3"),
        ]
    return tuple(found)


def _lobes_at_normal(run: Run) -> Run:
    return lambda arrays, real: run({**arrays, "lights.lobe_axis": arrays["lights.normal"]}, real)


def _scaled_lobes(run: Run) -> Run:
    """Return the sum with lobes of P + 2 in place of P + 1."""
    def scaled(arrays: Arrays, real: Any) -> Arrays:
        exponent = arrays["lights.lobe_exponent"]
        return run({**arrays, "lights.lobe_flux": arrays["lights.lobe_flux"] * ((exponent + 2) / (exponent + 1)).astype(
            real)}, real)

    return scaled


def _first_half(array: Array) -> Array:
    kept = array.copy()
    kept[..., (array.shape[-1] + 1) // 2 :] = 0
    return kept


def _without_last(array: Array) -> Array:
    kept = array.copy()
    kept[..., -1:] = 0
    return kept


def literal_pairs(
    arrays: Arrays, own: bool, *, arrives: str = "positive", leaves: str = "positive", power: int = 2,
    least: float = 0.0, softened: float = 0.0, most: float = np.inf, norm: str = "exact", horizon: bool = True,
    lobe_cosine: bool = False, lobe_arrives: bool = True, lobe_turned: bool = False, lobe_abs: bool = False,
    lobe_power: tuple[float, float] = (1.0, 0.0), lobe_unit: bool = True, exchanged: bool = False,
    joined: str = "sum", disc: str = "added", shortened: bool = False, raw: bool = False, lobe_narrow: bool = False,
) -> Array:
    """Return Eq. 2 and 3 as printed, or with a bug: (3, h, w), in the type of the arrays."""
    x, n = (np.asarray(arrays[name]) for name in RECEIVERS[:2])
    real = x.dtype.type
    shape, covered = x.shape[1:], np.asarray(arrays["gbuffer.triangle_id"]).reshape(-1) >= 0
    lights = pixel_lights_of(arrays, real)
    d = x.reshape(3, 1, -1) - lights.position[:, :, None]
    if own:  # (3, 1, n): light k with receiver k
        d = x.reshape(3, 1, -1) - lights.position[:, None]
    unit, r = _directions(-d if exchanged else d)
    unit = unit * np.where(r > 0, r / np.sqrt(np.maximum(np.maximum(r, real(least)) ** 2 + real(softened), real(
        1e-30))), 0) if shortened else unit
    facing, leaving = n.reshape(3, 1, -1), (lights.normal[:, None] if own else lights.normal[:, :, None])
    arriving, sent = -(facing * unit).sum(axis=0), (leaving * unit).sum(axis=0)
    area = np.asarray(arrays["lights.area"], real)[:, None] if "lights.area" in arrays else real(0)
    with np.errstate(divide="ignore"):
        square = _square(np.maximum(r, real(least)), power, area / real(np.pi), disc) + real(softened)
        fall = {-1: np.ones_like(r), 0: np.ones_like(r), 1: 1 / r}.get(power, 1 / square)
    if power == 0 or raw:
        arriving, sent = arriving * r, sent * r
    fall = np.where(r > 0, fall, 0)
    received = _cosine(arriving, arrives) * fall
    flux = lights.flux[:, None] if own else lights.flux[:, :, None]
    total = flux / real(np.pi) * np.minimum(_cosine(sent, leaves) * received, real(most))
    if lights.lobe_flux is not None and lights.lobe_axis is not None and lights.lobe_exponent is not None:
        axis = lights.lobe_axis[:, None] if own else lights.lobe_axis[:, :, None]
        exponent = lights.lobe_exponent[None] if own else lights.lobe_exponent[:, None]
        lobe = lights.lobe_flux[:, None] if own else lights.lobe_flux[:, :, None]
        peak = _norms(lights, norm).astype(real)
        cosine = (axis * unit).sum(axis=0) * (-1 if lobe_turned else 1) * (1 if lobe_unit else r)
        cosine = 2 * cosine - 1 if lobe_narrow else cosine
        cosine = np.abs(cosine) if lobe_abs else np.maximum(0, cosine)
        with np.errstate(all="ignore"):  # 0 to the power of -1
            shape_of = cosine ** (lobe_power[0] * exponent + lobe_power[1]) * (peak[None] if own else peak[:, None])
        shape_of = np.where(np.isfinite(shape_of) & ((sent > 0) | (not horizon)), shape_of, 0)
        shape_of = shape_of * (np.maximum(0, sent) if lobe_cosine else 1)
        with np.errstate(all="ignore"):  # shares of a wrong sign
            total = total + lobe * (shape_of * (received if lobe_arrives else fall))
    total = {"max": lambda: total.max(axis=1, initial=0), "last": lambda: total[:, -1:].sum(axis=1),
             "sum": lambda: total.sum(axis=1)}[joined]()
    return np.asarray(np.where(covered, total, 0).reshape(3, *shape))


def _square(r: Array, power: int, disc: Array, how: str) -> Array:
    """Return what the pair is divided by: r^2, with the disc's A/pi where there is one."""
    if how == "largest":
        return np.asarray(np.maximum(r**power, disc))
    return np.asarray((r + np.sqrt(disc)) ** power if how == "radius" else r**power + disc)


def _directions(d: Array) -> tuple[Array, Array]:
    r = np.sqrt((d**2).sum(axis=0))
    return np.divide(d, r, out=np.zeros_like(d), where=r > 0), r


def _cosine(cosine: Array, how: str) -> Array:
    if how == "none":
        return (cosine > 0).astype(cosine.dtype)
    positive = np.maximum(0, cosine)
    return {"positive": positive, "any": cosine, "abs": np.abs(cosine), "one": np.ones_like(cosine),
            "squared": positive**2, "sine": np.where(cosine > 0, np.sqrt(np.maximum(0, 1 - cosine**2)), 0)}[how]


def _norms(lights: PixelLights, norm: str) -> Array:
    assert lights.lobe_axis is not None
    assert lights.lobe_exponent is not None
    if norm == "none":
        return np.ones(lights.position.shape[1], lights.position.dtype)
    whole = (lights.lobe_exponent + {"cosine": 2, "short": 0}.get(norm, 1)) / (2 * np.pi)
    if norm in ("full", "cosine", "short"):
        return whole
    cosine = np.clip((lights.normal * lights.lobe_axis).sum(axis=0), -1, 1)
    exact = np.array([lobe_norm(c, p) for c, p in zip(cosine, lights.lobe_exponent, strict=True)], np.float64)
    with np.errstate(all="ignore"):
        share = whole / exact
        return exact if norm == "exact" else np.asarray(np.nan_to_num(whole / _wrong_share(share, norm)))


def _wrong_share(share: Array, how: str) -> Array:
    """Return K with a bug: the part of the half below the surface, I/2, is 1 - K, or K of axes below."""
    half = np.minimum(share, 1 - share)
    part = {"rest": half / (1 - 2 * half), "whole": 2 * half}.get(how)
    if part is None:
        return np.asarray({"times": 1 / share, "below": 1 - share}[how])
    return np.asarray(np.where(share < 0.5, part, 1 - part))



"""Likely bugs of the visibility of area lights: regions, means of the map, mean depth of blockers, V."""

from collections.abc import Callable
from typing import Any

import numpy as np

from refgi.cluster.settings import Csm, ValSettings
from refgi.settings import replaced
from refgi.vectors.recipe import reading, writing
from refgi.vectors.spec import Array, Arrays, Bug, Run

DISC = "E-VAL-08: centre sin th / (cos th + cos a), radius sin a / (cos th + cos a)"
WIDE = "the cone's tangent is twice as large (factor 2): the light's whole size Delta, not half; diameter for radius"
FINAL = "VAL Sec. 4.2, E-VAL-07: tan a = Delta (d - z_avg) / (2 d z_avg)"


def _printed(run: Any, settings: ValSettings, *forms: str) -> Run:
    return lambda arrays, real: run(arrays, real, replaced(settings, {"as_published": frozenset(forms)}))


def _without_cosine(local: Array, d: Array) -> Array:
    """Return the place that a pixel itself falls on, (2, ...): the middle of no cone but the narrowest."""
    return np.asarray(local[:2] / (d + local[2]))


def local_of(arrays: Arrays) -> tuple[Array, Array]:
    """Return pixels in each map's frame, (3, area light, h, w), and their distances."""
    position = np.asarray(arrays["gbuffer.position"], np.float64)
    away = position[:, None] - np.asarray(arrays["maps.center"], np.float64).T[:, :, None, None]
    local = np.einsum("kac,ckij->akij", np.asarray(arrays["areas.frame"], np.float64), away)
    return local, np.sqrt((local**2).sum(axis=0))


def _placed(run: Any, name: str, flag: str, middle: Callable[[Array, Array], Array]) -> Run:
    """Return a stage whose discs lie elsewhere."""
    def altered(arrays: Arrays, real: Any) -> Arrays:
        made = dict(run(arrays, real))
        with np.errstate(divide="ignore", invalid="ignore"):
            place = np.nan_to_num(middle(*local_of(arrays)))
        region = made[name].copy()
        region[:, :2] = np.where(made[flag][:, None], np.moveaxis(place, 0, 1), 0)
        return made | {name: region}

    return altered


def scaled(factor: float) -> Callable[[Array], Array]:
    """Return what scales the radii of regions."""
    return lambda region: region * np.array([1, 1, factor])[:, None, None]


def search_bugs(run: Any, settings: ValSettings) -> tuple[Bug, ...]:
    """Return likely bugs of the search region."""
    region = "search.region"
    return (
        Bug("the search takes blockers half-way: the light's solid angle",
            _printed(run, settings, "val_search_solid_angle"), "E-VAL-09"),
        Bug("squares of side alpha / pi", _printed(run, settings, "val_alpha_over_pi"), DISC),
        Bug("the disc lies around the pixel's own place",
            _placed(run, region, "search.pending", _without_cosine), DISC),
        Bug("the map is orthographic: x / d", _placed(run, region, "search.pending", lambda p, d: p[:2] / d),
            "(x, y) / (d + z)"),
        Bug(WIDE, reading(run, areas__delta=lambda a: 2 * a), "E-VAL-09"),
        Bug("rows run upwards", writing(run, search__region=lambda a: a * np.array([1, -1, 1])[:, None, None]),
            "right, down, forward"),
        Bug("pixels behind the light's plane are searched", _all_pending(run), "E-VAL-12: V = 1"),
        Bug("the nearest distance of all maps", reading(run, maps__near=lambda a: np.where(
            np.isfinite(a), a.min(), a)), "E-VAL-09: of each map"),
        Bug("the distance is the depth along the axis", _axial(run), "E-VAL-06"))


def _all_pending(run: Any) -> Run:
    def altered(arrays: Arrays, real: Any) -> Arrays:
        made = dict(run(arrays, real))
        seen = np.asarray(arrays["gbuffer.triangle_id"]) >= 0
        return made | {"search.pending": seen & (np.isfinite(arrays["maps.near"]) & (arrays["areas.delta"] > 0))[
            :, None, None]}

    return altered


def _axial(run: Any) -> Run:
    def altered(arrays: Arrays, real: Any) -> Arrays:
        made = dict(run(arrays, real))
        return made | {"search.distance": np.where(made["search.pending"], local_of(arrays)[0][2], 0)}

    return altered


def means_bugs(run: Any, name: str, csm: Csm) -> tuple[Bug, ...]:
    """Return likely bugs of reading the filtered map."""
    region, means = f"{name}__region", f"{name}__means"

    def moved(change: Callable[[Array], Array]) -> Run:
        return reading(run, **{region: change})

    finer, coarser = ("a level too fine", "a level too coarse") if csm.prefilter == "mip" else (
        "half of the disc's radius", "twice the disc's radius")
    return (
        Bug(coarser, moved(scaled(2.0)), "docs/methods/val_visibility"),
        Bug(finer, moved(scaled(0.5)), "docs/methods/val_visibility"),
        Bug("level 0 alone: no mip levels, as where the side n is missing under the logarithm"
            if csm.prefilter == "mip" else "the nearest texel of the map alone", moved(scaled(0.0)), "VAL Sec. 6"),
        Bug("rows run upwards", moved(lambda a: a * np.array([1, -1, 1])[:, None, None]), "right, down, forward"),
        Bug("s and t are exchanged", moved(lambda a: a[:, [1, 0, 2]]), "s along columns"),
        Bug("a texel too far right and down", moved(lambda a: a + np.array([0.125, 0.125, 0])[:, None, None]),
            "texel centres at + 1/2"),
        Bug("places are of [0, 1], not of [-1, 1]", moved(lambda a: (a + np.array([1, 1, 0])[:, None, None]) / 2),
            "[-1, 1] units"),
        Bug("sines and cosines are exchanged", writing(run, **{means: _swapped(csm.terms)}), "order of channels"))


def _swapped(m: int) -> Callable[[Array], Array]:
    return lambda a: np.concatenate([a[:, m : 2 * m], a[:, :m], a[:, 2 * m :]], axis=1)


def size_bugs(run: Any, settings: ValSettings) -> tuple[Bug, ...]:
    """Return likely bugs of the size of the penumbra."""
    return (
        Bug("alpha starts at the axis", _printed(run, settings, "val_alpha"), "E-VAL-07"),
        Bug("squares of side alpha / pi", _printed(run, settings, "val_alpha_over_pi"), DISC),
        Bug("the penumbra is twice as wide", writing(run, penumbra__region=scaled(2.0)), FINAL),
        Bug("the disc lies around the pixel's own place",
            _placed(run, "penumbra.region", "penumbra.shaded", _without_cosine), DISC),
        Bug(WIDE, reading(run, areas__delta=lambda a: 2 * a), FINAL))


def compared_bugs(run: Any) -> tuple[Bug, ...]:
    """Return likely bugs of V that hold for any comparison."""
    return (
        Bug("V is 1 - f everywhere: the hidden share", writing(run, visibility__share=lambda a: 1 - a),
            "E-VAL-02: f = 1 for d <= z"),
        Bug("pixels without blockers are dark", writing(run, visibility__share=dark_where_1), "1"))


def dark_where_1(share: Array) -> Array:
    """Return V with 0 in place of 1."""
    return np.where(share == 1, 0, share)

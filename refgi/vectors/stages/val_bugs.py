"""Likely bugs of the visibility of area lights: regions, means of the map, mean depth of blockers, V."""

from collections.abc import Callable
from typing import Any

import numpy as np

from refgi.cluster.settings import Csm, ValSettings
from refgi.settings import replaced
from refgi.vectors.recipe import reading, writing
from refgi.vectors.spec import Array, Arrays, Bug, Run

DISC = "E-VAL-08: centre sin th / (cos th + cos a), radius sin a / (cos th + cos a)"
FINAL = "VAL Sec. 4.2, E-VAL-07: tan a = Delta (d - z_avg) / (2 d z_avg)"
Z_AVG = "E-VAL-02, E-VAL-04"


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
        Bug("Delta counts from the centre, not half of it", reading(run, areas__delta=lambda a: 2 * a), "E-VAL-09"),
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
        Bug("the nearest texel of the map alone", moved(scaled(0.0)), "VAL Sec. 6"),
        Bug("rows run upwards", moved(lambda a: a * np.array([1, -1, 1])[:, None, None]), "right, down, forward"),
        Bug("s and t are exchanged", moved(lambda a: a[:, [1, 0, 2]]), "s along columns"),
        Bug("a texel too far right and down", moved(lambda a: a + np.array([0.125, 0.125, 0])[:, None, None]),
            "texel centres at + 1/2"),
        Bug("places are of [0, 1], not of [-1, 1]", moved(lambda a: (a + np.array([1, 1, 0])[:, None, None]) / 2),
            "[-1, 1] units"),
        Bug("sines and cosines are exchanged", writing(run, **{means: _swapped(csm.terms)}), "order of channels"))


def _swapped(m: int) -> Callable[[Array], Array]:
    return lambda a: np.concatenate([a[:, m : 2 * m], a[:, :m], a[:, 2 * m :]], axis=1)


def series_bugs(run: Any, settings: ValSettings, csm: Csm) -> tuple[Bug, ...]:
    """Return likely bugs of the mean depth of blockers and of the penumbra's disc, by series."""
    def literal(**bugs: Any) -> Run:
        return lambda arrays, real: _literal_penumbra(run(arrays, real), arrays, csm, **bugs)

    return (
        Bug("the sum is divided by V, not by 1 - V", literal(lit=True), Z_AVG),
        Bug("z_avg of the scale is taken for metres", literal(metres=True), Z_AVG),
        Bug("the mean depth Z counts whole, not by half", literal(half=1.0), "E-VAL-02: Z/2 - ..."),
        Bug("means of all depths, blockers or not", literal(all_depths=True), Z_AVG),
        Bug("the sine's term is added", reading(run, search__means=_negated(csm.terms)), "E-VAL-02"),
        Bug("no bias in the search", reading(run, series__bias=np.zeros_like), "E-VAL-04"),
        *size_bugs(run, settings))


def _negated(m: int) -> Callable[[Array], Array]:
    def change(means: Array) -> Array:
        sign = np.ones(4 * m + 1)
        sign[m : 2 * m] = sign[3 * m : 4 * m] = -1
        return means * sign[:, None, None]

    return change


def _literal_penumbra(
    made: Arrays, arrays: Arrays, csm: Csm, *, lit: bool = False, metres: bool = False, half: float = 0.5,
    all_depths: bool = False,
) -> Arrays:
    """Return the stage's arrays with z_avg and its disc by a formula with a bug."""
    local, d = local_of(arrays)
    m, shaded, means = csm.terms, made["penumbra.shaded"], np.moveaxis(np.asarray(arrays["search.means"]), 1, 0)
    angle = np.multiply.outer((2 * np.arange(1, m + 1) - 1) * np.pi, made["penumbra.t"] - arrays["series.bias"][0])
    weight = np.asarray(arrays["series.weight"])[:, None, None, None]
    cosine, sine = weight * np.cos(angle), weight * np.sin(angle)
    blocked = 0.5 - (cosine * means[:m] - sine * means[m : 2 * m]).sum(axis=0)
    total = half * means[4 * m] - (cosine * means[2 * m : 3 * m] - sine * means[3 * m : 4 * m]).sum(axis=0)
    origin, slope, near = (np.asarray(arrays[name])[:, None, None] for name in (
        "scale.origin", "scale.slope", "maps.near"))
    with np.errstate(all="ignore"):
        t = means[4 * m] if all_depths else total / ((1 - blocked) if lit else blocked)
        along = t / slope
        z = t if metres else origin * 2**along if csm.depth_scale == "log_map" else origin + along
        z = np.clip(np.nan_to_num(z), near, d)
        tangent = np.asarray(arrays["areas.delta"])[:, None, None] * (d - z) / (2 * d * z)
        cosine = 1 / np.sqrt(1 + tangent**2)
        disc = np.stack([local[0], local[1], d * tangent * cosine], axis=1) / (local[2] + d * cosine)[:, None]
    return {**made, "penumbra.z_avg": np.where(shaded, z, 0), "penumbra.region": np.where(shaded[:, None], disc, 0)}


def size_bugs(run: Any, settings: ValSettings) -> tuple[Bug, ...]:
    """Return likely bugs of the size of the penumbra."""
    return (
        Bug("alpha starts at the axis", _printed(run, settings, "val_alpha"), "E-VAL-07"),
        Bug("squares of side alpha / pi", _printed(run, settings, "val_alpha_over_pi"), DISC),
        Bug("the penumbra is twice as wide", writing(run, penumbra__region=scaled(2.0)), FINAL),
        Bug("the disc lies around the pixel's own place",
            _placed(run, "penumbra.region", "penumbra.shaded", _without_cosine), DISC),
        Bug("the light's whole size in place of half", reading(run, areas__delta=lambda a: 2 * a), FINAL))


def compared_bugs(run: Any) -> tuple[Bug, ...]:
    """Return likely bugs of V by the series."""
    return (
        Bug("no bias in the comparison", reading(run, series__bias=np.zeros_like), "E-VAL-03"),
        Bug("the bias is added to the depth", reading(run, series__bias=lambda a: -a), "E-VAL-02: d' = d - b"),
        Bug("V is 1 - f", writing(run, visibility__share=lambda a: 1 - a), "E-VAL-02: f = 1 for d <= z"),
        Bug("w_k = 1 / c_k", reading(run, series__weight=lambda a: a / 2), "E-VAL-02"),
        Bug("sines and cosines are exchanged", reading(run, penumbra__means=_halves_swapped), "E-VAL-02"),
        Bug("the cosine's term is missing", reading(run, penumbra__means=_without_sines), "E-VAL-02"),
        Bug("V is doubled and cut", writing(run, visibility__share=lambda a: np.minimum(2 * a, 1)), "E-VAL-03"),
        Bug("pixels without blockers are dark", writing(run, visibility__share=dark_where_1), "1"))


def dark_where_1(share: Array) -> Array:
    """Return V with 0 in place of 1."""
    return np.where(share == 1, 0, share)


def _halves_swapped(means: Array) -> Array:
    m = means.shape[1] // 2
    return np.concatenate([means[:, m:], means[:, :m]], axis=1)


def _without_sines(means: Array) -> Array:
    m = means.shape[1] // 2
    return np.concatenate([0 * means[:, :m], means[:, m:]], axis=1)

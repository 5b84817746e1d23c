"""K-means of pixel lights as a port writes them, and as it gets them wrong (VAL Sec. 5.1, E-VAL-11)."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from refgi.vectors.recipe import writing
from refgi.vectors.spec import Array, Arrays, Bug, Run

METRIC = "VAL Sec. 5.1, E-VAL-11: d = w_x dx / diagonal + w_a angle / pi"
Reduce = Callable[[Array], Any]


class Metric(NamedTuple):
    """How lights and clusters are compared; by default as the stage does."""

    apart: Callable[[Any], Any] = lambda away: np.sqrt((away**2).sum(axis=0))
    turned: Callable[[Any, Any], Any] = lambda along, across: np.arctan2(across, along)
    per_turn: float = np.pi
    size: Reduce = lambda side: np.sqrt((side**2).sum())
    box: Array | None = None  # another box, (2, 3)
    corner: Callable[[Any], Any] = lambda box: box[1] - box[0]
    weights: Callable[[float, float], tuple[float, float]] = lambda wx, wa: (wx, wa)
    pick: Callable[[Any], Any] = lambda d: d.argmin(axis=1)
    joined: Callable[[Any, Any], Any] = lambda a, b: a + b
    last: int = 0  # clusters that are not compared, from the end
    skipped: int = 0  # from the begin
    stored: Callable[[Any], Any] = lambda d: d


def assigned_by(number: int, weights: tuple[float, float], how: Metric) -> Run:
    """Return one assignment of normalised distances as a port writes it."""
    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
        place, normal, center, axis = (np.asarray(arrays[name], np.float64) for name in (
            "lights.position", "lights.normal", f"kmeans.center{number}", f"kmeans.normal{number}"))
        box = np.asarray(arrays["extents.illuminated"] if how.box is None else how.box, np.float64)
        a, b = normal[:, :, None], axis[:, None]
        across = np.linalg.norm(np.cross(a, b, axis=0), axis=0)
        with np.errstate(all="ignore"):
            angle = how.turned((a * b).sum(axis=0), across) / how.per_turn
        wx, wa = how.weights(*weights)
        d = how.joined(wx * how.apart(place[:, :, None] - center[:, None]) / how.size(how.corner(box)), wa * angle)
        d[:, : how.skipped] = np.inf
        d[:, d.shape[1] - how.last :] = np.inf
        of = how.pick(d)
        return {f"kmeans.of{number}": of, f"kmeans.distance{number}": how.stored(d[np.arange(len(of)), of])}

    return run


METRICS: Mapping[str, Metric] = {
    "distances are not divided by the box's diagonal": Metric(size=lambda side: 1.0),  # noqa: ARG005
    "the diagonal is squared: its root is missing": Metric(size=lambda side: (side**2).sum()),
    "half of the diagonal": Metric(size=lambda side: np.sqrt((side**2).sum()) / 2),
    "the longest side of the box in place of its diagonal": Metric(size=np.max),
    "the sum of the box's sides in place of its diagonal": Metric(size=np.sum),
    "the box's width, x, in place of its diagonal": Metric(size=lambda side: side[0]),
    "the diagonal is the length of the box's upper corner: least is not subtracted": Metric(corner=lambda box: box[1]),
    "the diagonal is that of the sum of the box's corners: plus for minus": Metric(corner=lambda box: box[0] + box[1]),
    "the angle is not divided by pi": Metric(per_turn=1.0),
    "the angle is divided by 2 pi, not pi": Metric(per_turn=2 * np.pi),
    "the angle is divided by pi / 2, not pi": Metric(per_turn=np.pi / 2),
    "the angle is in degrees: not radians over pi": Metric(per_turn=np.pi / 180),
    "the angle is squared": Metric(turned=lambda along, across: np.arctan2(across, along) ** 2 / np.pi),
    "the sine of the angle (cross product) in place of the angle": Metric(
        turned=lambda along, across: across + 0 * along),
    "the cosine in place of the angle": Metric(turned=lambda along, across: along + 0 * across),
    "the angle's complement: asin for acos": Metric(turned=lambda along, across: np.arctan2(along, across)),
    "half of 1 - cosine in place of the angle over pi": Metric(
        turned=lambda along, across: np.pi * (1 - along) / 2 + 0 * across),
    "1 - cosine in place of the angle": Metric(turned=lambda along, across: 1 - along + 0 * across),
    "places do not count: normals alone": Metric(weights=lambda wx, wa: (0.0, wa)),  # noqa: ARG005
    "the weight of places w_x is missing: it counts as 1": Metric(weights=lambda wx, wa: (1.0, wa)),  # noqa: ARG005
    "the weight of angles w_a is missing: it counts as 1": Metric(weights=lambda wx, wa: (wx, 1.0)),  # noqa: ARG005
    "both weights are 1": Metric(weights=lambda wx, wa: (1.0, 1.0)),  # noqa: ARG005
    "both weights are that of places, w_x": Metric(weights=lambda wx, wa: (wx, wx)),  # noqa: ARG005
    "both weights are that of angles, w_a": Metric(weights=lambda wx, wa: (wa, wa)),  # noqa: ARG005
    "weights of place and angle are exchanged: w_x and w_a": Metric(weights=lambda wx, wa: (wa, wx)),
    "squared distances of places: no root": Metric(apart=lambda away: (away**2).sum(axis=0)),
    "distances of places add up by axes (Manhattan), not by Pythagoras": Metric(
        apart=lambda away: np.abs(away).sum(axis=0)),
    "distances of places are the largest along an axis": Metric(apart=lambda away: np.abs(away).max(axis=0)),
    "distances of places leave out z": Metric(apart=lambda away: np.sqrt((away[:2] ** 2).sum(axis=0))),
    "distances of places leave out y, the height": Metric(apart=lambda away: np.sqrt((away[::2] ** 2).sum(axis=0))),
    "place and angle are multiplied, not added": Metric(joined=lambda a, b: a * b),
    "the angle is subtracted from the distance: wrong sign": Metric(joined=lambda a, b: a - b),
    "place and angle by Pythagoras, root of the sum of squares": Metric(joined=np.hypot),
    "the larger of place and angle in place of their sum": Metric(joined=np.maximum),
    "the farthest cluster, not the nearest: the comparison is turned round": Metric(pick=lambda d: d.argmax(axis=1)),
    "the last cluster is never compared: one too few": Metric(last=1),
    "the first cluster is never compared: k from 1 on": Metric(skipped=1),
    "all lights belong to the first cluster": Metric(pick=lambda d: np.zeros(len(d), int)),
    "the last cluster that is nearer than the one before counts, not the nearest of all": Metric(
        pick=lambda d: np.where(d[:, 1:] < d[:, :-1], np.arange(1, d.shape[1]), 0).max(axis=1)),
    "the first cluster that is nearer than the one before counts: the loop ends too soon": Metric(
        pick=lambda d: _first_local(d)),
    "the distance is squared where it is stored": Metric(stored=lambda d: d * d),
}


def _first_local(d: Array) -> Array:
    rises = np.concatenate([d[:, 1:] >= d[:, :-1], np.ones((len(d), 1), bool)], axis=1)
    return np.asarray(rises.argmax(axis=1))


def metric_bugs(number: int, weights: tuple[float, float], visible: Array, illuminated: Array) -> tuple[Bug, ...]:
    """Return likely bugs of normalised distances; `visible`, `illuminated`: boxes (2, 3), m."""
    both = np.stack([np.minimum(visible[0], illuminated[0]), np.maximum(visible[1], illuminated[1])])
    boxes = {"the diagonal of the visible box (extent of the camera's pixels), not of the illuminated one":
             Metric(box=visible),
             "the diagonal of both boxes together, not of the illuminated one": Metric(box=both)}
    return tuple(Bug(cause, assigned_by(number, weights, how), METRIC) for cause, how in {**METRICS, **boxes}.items())


def means_by(number: int, of: str, how: Callable[[Array, Array, Array], Array],
             axis: Callable[[Array], Array]) -> Run:
    """Return means of clusters as a port writes them: `how` of lights (3, n), of centres before and their number."""
    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
        made, chosen = {}, np.asarray(arrays[of])
        for key, source, finish in (("center", "position", None), ("normal", "normal", axis)):
            before, lights = (np.array(arrays[name], np.float64) for name in (
                f"kmeans.{key}{number - 1}", f"lights.{source}"))
            for k in np.unique(chosen):
                if finish is None:
                    before[:, k] = how(lights[:, chosen == k], before[:, k], chosen)
                elif lights[:, chosen == k].sum(axis=1).any():
                    before[:, k] = finish(lights[:, chosen == k])
            made[f"kmeans.{key}{number}"] = before
        return made

    return run


def unit_sum(lights: Array) -> Array:
    """Return the mean direction of normals (3, n)."""
    total = lights.sum(axis=1)
    return np.asarray(total / max(float(np.linalg.norm(total)), 1e-30))


CENTERS: Mapping[str, Callable[[Array, Array, Array], Array]] = {
    "centres are sums, not divided by the number of members": lambda lights, before, of: lights.sum(axis=1),  # noqa: ARG005
    "centres are divided by the number of all lights": lambda lights, before, of: lights.sum(axis=1) / len(of),  # noqa: ARG005
    "centres are divided by the number of members and one more: the count is off by one":
        lambda lights, before, of: lights.sum(axis=1) / (lights.shape[1] + 1),  # noqa: ARG005
    "the old centre counts as a member": lambda lights, before, of:  # noqa: ARG005
        (lights.sum(axis=1) + before) / (lights.shape[1] + 1),
    "centres stay as they were: places are not moved": lambda lights, before, of: before,  # noqa: ARG005
    "centres are halfway between the old and the mean": lambda lights, before, of:  # noqa: ARG005
        (lights.mean(axis=1) + before) / 2,
    "centres are the last member, overwritten and not accumulated": lambda lights, before, of: lights[:, -1],  # noqa: ARG005
    "centres are the last member over their number: sums are overwritten":
        lambda lights, before, of: lights[:, -1] / lights.shape[1],  # noqa: ARG005
    "centres are the first member": lambda lights, before, of: lights[:, 0],  # noqa: ARG005
    "centres are the middle of the members' box": lambda lights, before, of:  # noqa: ARG005
        (lights.min(axis=1) + lights.max(axis=1)) / 2,
    "centres are medians": lambda lights, before, of: np.median(lights, axis=1),  # noqa: ARG005
    "the first member is left out": lambda lights, before, of: lights[:, 1:].sum(axis=1) / lights.shape[1],  # noqa: ARG005
    "the last member is left out": lambda lights, before, of: lights[:, :-1].sum(axis=1) / lights.shape[1],  # noqa: ARG005
}
AXES: Mapping[str, Callable[[Array], Array]] = {
    "mean normals are sums of normals: not normalised, not of unit length": lambda lights: lights.sum(axis=1),
    "mean normals are divided by their squared length: the root is missing": lambda lights:
        unit_sum(lights) / np.linalg.norm(lights.sum(axis=1)),
    "mean normals are the first member's": lambda lights: lights[:, 0],
    "mean normals are the last member's, overwritten": lambda lights: lights[:, -1],
    "mean normals point the other way: wrong sign": lambda lights: -unit_sum(lights),
}


def mean_bugs(run: Run, number: int) -> tuple[Bug, ...]:
    """Return likely bugs of centres and normals of clusters."""
    of = f"kmeans.of{number - 1}"
    center, normal = f"kmeans__center{number}", f"kmeans__normal{number}"
    return (
        *(Bug(cause, means_by(number, of, how, unit_sum), "VAL Sec. 5.1") for cause, how in CENTERS.items()),
        *(Bug(cause, means_by(number, of, mean_of, how), "E-VAL-11") for cause, how in AXES.items()),
        *(Bug(f"the {what} of all is left out of the means", _without_light(run, of, light), "all lights")
          for what, light in (("first light", 0), ("last light", -1))),
        Bug("lights of the clusters before count as members as well: <= for ==", _with_lower(of, number), "C(i) = k"),
        Bug("the last cluster does not move", _one_stays(run, number), "all clusters"),
        Bug("clusters are shifted by one: means stand at the cluster before", writing(
            run, **{name: lambda a: np.roll(a, -1, axis=1) for name in (center, normal)}), "C(i)"))


def mean_of(lights: Array, before: Array, of: Array) -> Array:  # noqa: ARG001
    """Return the mean place of lights (3, n)."""
    return np.asarray(lights.mean(axis=1))


def _without_light(run: Run, of: str, light: int) -> Run:
    def altered(arrays: Arrays, real: Any) -> Arrays:
        names = ("lights.position", "lights.normal")
        rest = {name: np.delete(arrays[name], light, axis=1) for name in names} | {of: np.delete(arrays[of], light)}
        return run({**arrays, **rest}, real)

    return altered


def _with_lower(of: str, number: int) -> Run:
    def altered(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
        made, chosen = {}, np.asarray(arrays[of])
        for key, source in (("center", "position"), ("normal", "normal")):
            new = np.array(arrays[f"kmeans.{key}{number - 1}"], np.float64)
            for k in range(new.shape[1]):
                some = np.asarray(arrays[f"lights.{source}"], np.float64)[:, chosen <= k]
                if some.any():
                    new[:, k] = some.mean(axis=1) if key == "center" else unit_sum(some)
            made[f"kmeans.{key}{number}"] = new
        return made

    return altered


def _one_stays(run: Run, number: int) -> Run:
    def altered(arrays: Arrays, real: Any) -> Arrays:
        made = {name: np.array(array) for name, array in run(arrays, real).items()}
        for key in ("center", "normal"):
            made[f"kmeans.{key}{number}"][:, -1] = arrays[f"kmeans.{key}{number - 1}"][:, -1]
        return made

    return altered

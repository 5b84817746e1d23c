"""Stages of clusters of pixel lights: extents, k-means round by round (VAL Sec. 5.1)."""

from collections.abc import Callable
from typing import Any

import numpy as np

from refgi.cluster.clustering.kmeans import Clustering, assigned, cluster, first_lights, moved
from refgi.cluster.settings import Clusters, ValSettings
from refgi.rsm.buffers.extent import Extent, bounds_of
from refgi.settings import replaced
from refgi.vectors.bugs.val_box import box_bugs
from refgi.vectors.bugs.val_kmeans import mean_bugs, metric_bugs
from refgi.vectors.recipe import Recipe, writing
from refgi.vectors.spec import Array, Arrays, Bug, Run, Spec
from refgi.vectors.stages.buffers import VECTOR

ROUNDS = 2  # of k-means that a case shows one by one
LIGHTS = ("lights.position", "lights.normal")
METRIC = "VAL Sec. 5.1, E-VAL-11: d = w_x dx / diagonal + w_a angle / pi"


def add_extents(recipe: Recipe, maps: int) -> None:
    """Add the boxes of what is visible and of what reflects direct light, to which relative settings refer."""
    rsms = [f"rsm{k}" for k in range(maps)]
    lobes = [f"{name}.lobe_flux" for name in rsms if f"{name}.lobe_flux" in recipe.specs]

    def run(arrays: Arrays, real: Any, dark: bool = False, empty: bool = False, first: bool = False) -> Arrays:  # noqa: ARG001
        covered = np.asarray(arrays["gbuffer.triangle_id"]) >= 0
        visible = bounds_of(arrays["gbuffer.position"], np.ones_like(covered) if empty else covered)
        boxes = []
        for name in rsms[:1] if first else rsms:
            flux = np.asarray(arrays[f"{name}.flux"].any(axis=0))
            flux = flux | arrays[f"{name}.lobe_flux"].any(axis=0) if lobes else flux
            boxes.append(bounds_of(arrays[f"{name}.position"], np.ones_like(flux) if dark else flux))
        low, high = np.min([box.low for box in boxes], axis=0), np.max([box.high for box in boxes], axis=0)
        return {"extents.visible": np.stack(visible), "extents.illuminated": np.stack([low, high])}

    box = "least and greatest, xyz"
    recipe.add("extents", "boxes of what the camera sees and of what reflects direct light", run,
               ("gbuffer.position", "gbuffer.triangle_id", *(f"{name}.{key}" for name in rsms for key in
                                                             ("position", "flux")), *lobes),
               {"extents.visible": Spec(box, "m", "box of the pixels' surface points", "world"),
                "extents.illuminated": Spec(box, "m", "box of the texels with flux, of all lamps", "world")},
               paper="docs/methods/val", bugs=(
                   Bug("texels without flux count", lambda a, r: run(a, r, dark=True), "what reflects direct light"),
                   Bug("pixels without surface count, at the origin", lambda a, r: run(a, r, empty=True), ""),
                   Bug("the first light's map alone (rsm0), not all lights'", lambda a, r: run(a, r, first=True),
                       "all lamps"),
                   *box_bugs(run)))


def extent_of(arrays: Arrays, *names: str) -> Extent:
    """Return the box around some of the extents among arrays."""
    boxes = [np.asarray(arrays[f"extents.{name}"], np.float64) for name in names]
    return Extent(np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0))


def add_kmeans(recipe: Recipe, settings: Clusters, total: int) -> None:
    """Add k-means over `total` lights: start, `ROUNDS` rounds one by one, the rest as one stage."""
    count = min(settings.count, total)
    recipe.facts["kmeans"] = {
        "clusters": count, "asked for": settings.count, "distance": settings.distance, "w_x": settings.position_weight,
        "w_a": settings.normal_weight, "most rounds": settings.rounds}
    if count == total:
        _add_each(recipe)
        return
    _add_start(recipe, count, total)
    for number in range(ROUNDS):
        _add_assignment(recipe, settings, number)
        _add_means(recipe, number)
    last = f"kmeans.center{ROUNDS}", f"kmeans.normal{ROUNDS}"

    def run(arrays: Arrays, real: Any, rounds: int = settings.rounds - ROUNDS, **how: Any) -> Arrays:  # noqa: ARG001
        center, normal = (np.asarray(arrays[name], np.float64) for name in last)
        start = Clustering(center, normal, np.zeros(count, np.int64), np.zeros(total, np.int32), 0, np.zeros(1))
        kind = replaced(settings, how)
        made = cluster(arrays[LIGHTS[0]], arrays[LIGHTS[1]], count, distance=kind.distance, weights=_weights(kind),
                       diagonal=extent_of(arrays, "illuminated").diagonal, rounds=rounds, start=start)
        return {"clusters.center": made.center, "clusters.normal": made.normal, "clusters.of": made.of}

    def stopped(arrays: Arrays, real: Any) -> Arrays:
        center, normal = (np.asarray(arrays[name], np.float64) for name in last)
        return {"clusters.center": center, "clusters.normal": normal, "clusters.of": run(arrays, real)["clusters.of"]}

    recipe.add("kmeans", "further rounds until no light changes its cluster", run,
               (*LIGHTS, "extents.illuminated", *last), _clusters(), paper="VAL Sec. 5.1; A.6 P5",
               exact=(*LIGHTS, *last), bugs=(
                   Bug("no rounds beyond those shown: centres stay as they were", stopped, "until assignments repeat"),
                   Bug("the last cluster gets no lights: one too few", writing(
                       run, clusters__of=lambda a: np.where(a == count - 1, 0, a)), "all clusters"),
                   Bug("clusters count from 1", writing(run, clusters__of=lambda a: a + 1), "from 0"),
                   Bug("mean normals point the other way", writing(run, clusters__normal=lambda a: -a), ""),
                   Bug("normals do not count", lambda a, r: run(a, r, normal_weight=0.0), METRIC)))


def _add_each(recipe: Recipe) -> None:
    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
        total = arrays[LIGHTS[0]].shape[1]
        made = cluster(arrays[LIGHTS[0]], arrays[LIGHTS[1]], total, diagonal=1.0)
        return {"clusters.center": made.center, "clusters.normal": made.normal, "clusters.of": made.of}

    recipe.add("kmeans", "as many clusters as lights: each light is one, coincident lights too", run, LIGHTS,
               _clusters(), paper="VAL Sec. 5.1", bugs=(
                   Bug("coincident lights join the first of their clusters", writing(run, clusters__of=_all_first),
                       "M = N: hard shadows of each light"),
                   Bug("the clusters are in reverse order",
                       writing(run, clusters__of=lambda a: a[::-1]), "cluster k begins at light floor(k N / M)")))


def _all_first(of: Array) -> Array:
    return np.where(of == of[-1], 0, of)


def _clusters() -> dict[str, Spec]:
    return {"clusters.center": Spec("xyz, cluster", "m", "mean of each cluster's lights", "world"),
            "clusters.normal": Spec("xyz, cluster", VECTOR, "mean direction of their normals", "world"),
            "clusters.of": Spec("light", "1", "C(i): cluster of each light", tier="T0")}


def _weights(kind: Clusters) -> tuple[float, float]:
    return kind.position_weight, kind.normal_weight


def _add_start(recipe: Recipe, count: int, total: int) -> None:
    def run(arrays: Arrays, real: Any, at: Any = first_lights) -> Arrays:  # noqa: ARG001
        return {f"kmeans.{key}0": arrays[name][:, at(total, count)] for key, name in
                zip(("center", "normal"), LIGHTS, strict=True)}

    def begun(at: Any) -> Run:
        return lambda arrays, real: run(arrays, real, at)

    recipe.add("kmeans.start", "cluster k begins at light floor(k N / M)", run, LIGHTS, _centers(0),
               paper="VAL Sec. 5.1; A.6 P5", exact=LIGHTS, bugs=(
                   Bug("clusters begin at the first M lights", lambda a, r: run(a, r, lambda _, m: np.arange(m)),
                       "floor(k N / M)"),
                   Bug("k N / M is rounded instead of cut", lambda a, r: run(
                       a, r, lambda n, m: (np.arange(m) * n + m // 2) // m), "floor(k N / M)"),
                   Bug("clusters begin in the middle of their run", lambda a, r: run(
                       a, r, lambda n, m: (2 * np.arange(m) + 1) * n // (2 * m)), "floor(k N / M)"),
                   *(Bug(cause, begun(at), "floor(k N / M)") for cause, at in STARTS.items()),
                   Bug("all clusters face as the first light does: one normal", writing(
                       run, kmeans__normal0=lambda a: np.repeat(a[:, :1], a.shape[1], axis=1)), "each its own light")))


STARTS: dict[str, Callable[[int, int], Array]] = {
    "clusters begin at every floor(N / M)-th light: k (N / M) in whole numbers": lambda n, m: np.arange(m) * (n // m),
    "clusters begin at k (N - 1) / (M - 1): the last at the last light": lambda n, m: (
        np.arange(m) * (n - 1) // max(m - 1, 1)),
    "clusters begin at k (N - 1) / M: one light too few": lambda n, m: np.arange(m) * (n - 1) // m,
    "clusters begin at the ends of their runs, (k + 1) N / M - 1": lambda n, m: (np.arange(m) + 1) * n // m - 1,
    "clusters begin one light too late: floor(k N / M) + 1": lambda n, m: np.minimum(np.arange(m) * n // m + 1, n - 1),
    "clusters begin at the next run's light: k + 1 in place of k": lambda n, m: (np.arange(m) + 1) * n // m % n,
    "clusters begin at the last M lights": lambda n, m: np.arange(n - m, n),
    "all clusters begin at the first light": lambda n, m: np.zeros(m, int),  # noqa: ARG005
    "k N / M is rounded up": lambda n, m: -(-np.arange(m) * n // m),
}


def _centers(number: int) -> dict[str, Spec]:
    return {f"kmeans.center{number}": Spec("xyz, cluster", "m", f"centres after round {number}", "world"),
            f"kmeans.normal{number}": Spec("xyz, cluster", VECTOR, "their normals", "world")}


def _add_assignment(recipe: Recipe, settings: Clusters, number: int) -> None:
    center, normal = _centers(number)
    known = recipe.expected()
    boxes = known["extents.visible"], known["extents.illuminated"]

    def run(arrays: Arrays, real: Any, last: bool = False, cosine: bool = False, **how: Any) -> Arrays:  # noqa: ARG001
        kind = replaced(settings, how)
        lights = [arrays[name] for name in LIGHTS]
        areas = np.asarray(arrays[center], np.float64), np.asarray(arrays[normal], np.float64)
        if cosine:
            return _by_cosine(lights, areas, kind, extent_of(arrays, "illuminated").diagonal)
        order = slice(None, None, -1) if last else slice(None)
        of, own = assigned(lights[0], lights[1], areas[0][:, order], areas[1][:, order], kind.distance, _weights(kind),
                           extent_of(arrays, "illuminated").diagonal)
        return {f"kmeans.of{number}": areas[0].shape[1] - 1 - of if last else of, f"kmeans.distance{number}": own}

    def _by_cosine(lights: Any, areas: Any, kind: Clusters, diagonal: float) -> Arrays:
        apart = np.linalg.norm(lights[0][:, :, None] - areas[0][:, None], axis=0) / diagonal
        turned = 1 - (lights[1][:, :, None] * areas[1][:, None]).sum(axis=0)
        d = kind.position_weight * apart + kind.normal_weight * turned
        return {f"kmeans.of{number}": d.argmin(axis=1), f"kmeans.distance{number}": d.min(axis=1)}

    recipe.add(f"kmeans.assign{number}", "nearest cluster of each light, the lowest index of equally near ones", run,
               (*LIGHTS, "extents.illuminated", center, normal),
               {f"kmeans.of{number}": Spec("light", "1", "nearest cluster", tier="T0"),
                f"kmeans.distance{number}": Spec("light", "1", "its distance", paper=METRIC)},
               paper=METRIC, exact=(*LIGHTS, center, normal), bugs=(
                   Bug("the highest index of equally near ones", lambda a, r: run(a, r, last=True), "A.6 P5"),
                   Bug("1 - cosine in place of the angle over pi", lambda a, r: run(a, r, cosine=True), METRIC),
                   *_metric_bugs(run, settings),
                   *(metric_bugs(number, _weights(settings), *boxes) if settings.distance == "normalised" else ())))


def _metric_bugs(run: Any, settings: Clusters) -> tuple[Bug, ...]:
    forms = {"raw": "metres and radians are weighed, not shares of the diagonal and of pi", "squared": "squares",
             "normalised": "shares of the diagonal and of pi"}

    def other(**how: Any) -> Run:
        return lambda arrays, real: run(arrays, real, **how)

    return (*(Bug(f"distances are others: {what}", other(distance=kind), METRIC) for kind, what in forms.items()
              if kind != settings.distance),
            Bug("normals do not count", other(normal_weight=0.0), METRIC),
            *(() if settings.distance == "normalised" else (
                Bug("the weights are exchanged", other(position_weight=0.3, normal_weight=0.7), METRIC),)))


def _add_means(recipe: Recipe, number: int) -> None:
    before, after = tuple(_centers(number)), tuple(_centers(number + 1))
    of = f"kmeans.of{number}"

    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
        made = moved(arrays[LIGHTS[0]], arrays[LIGHTS[1]], np.asarray(arrays[of]), arrays[before[0]], arrays[before[1]])
        return dict(zip(after, made, strict=True))

    def empty_at_origin(arrays: Arrays, real: Any) -> Arrays:
        made = run(arrays, real)
        used = np.isin(np.arange(made[after[0]].shape[1]), arrays[of])
        return {name: np.where(used, made[name], 0) for name in after}

    def not_unit(arrays: Arrays, real: Any) -> Arrays:
        made, chosen = dict(run(arrays, real)), np.asarray(arrays[of])
        for k in np.unique(chosen):
            made[after[1]][:, k] = arrays[LIGHTS[1]][:, chosen == k].mean(axis=1)
        return made

    recipe.add(f"kmeans.means{number + 1}", "means of each cluster's lights; without lights a cluster stays", run,
               (*LIGHTS, of, *before), _centers(number + 1), paper="VAL Sec. 5.1; A.6 P5", exact=before, bugs=(
                   Bug("clusters without lights go to the origin", empty_at_origin, "they keep their values"),
                   Bug("mean normals are not of unit length", not_unit, "E-VAL-11"),
                   Bug("normals stay as they were", lambda a, r: {**run(a, r), after[1]: a[before[1]]}, "E-VAL-11"),
                   *mean_bugs(run, number + 1)))


def clusters_of(settings: ValSettings) -> Clusters:
    """Return a fixed number of clusters, the only kind that a kit has."""
    assert isinstance(settings.clusters, Clusters)
    return settings.clusters

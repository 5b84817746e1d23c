"""Stages of clusters of pixel lights: extents, k-means round by round (VAL Sec. 5.1)."""

from typing import Any

import numpy as np

from refgi.cluster.clustering.kmeans import Clustering, assigned, cluster, first_lights, moved
from refgi.cluster.settings import Clusters, ValSettings
from refgi.literal import val_areas as literal
from refgi.rsm.buffers.extent import Extent, bounds_of
from refgi.vectors.recipe import Recipe, reading
from refgi.vectors.rows import Form
from refgi.vectors.spec import Arrays, Bug, Spec
from refgi.vectors.stages.buffers import VECTOR

ROUNDS = 2  # of k-means that a case shows one by one
LIGHTS = ("lights.position", "lights.normal")
READS = {"position": LIGHTS[0], "normal": LIGHTS[1]}
METRIC = "VAL Sec. 5.1, E-VAL-11: d = w_x dx / diagonal + w_a angle / pi"


def add_extents(recipe: Recipe, maps: int) -> None:
    """Add the boxes of what is visible and of what reflects direct light, to which relative settings refer."""
    rsms = [f"rsm{k}" for k in range(maps)]
    lobes = [f"{name}.lobe_flux" for name in rsms if f"{name}.lobe_flux" in recipe.specs]

    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
        visible = bounds_of(arrays["gbuffer.position"], np.asarray(arrays["gbuffer.triangle_id"]) >= 0)
        boxes = []
        for name in rsms:
            flux = np.asarray(arrays[f"{name}.flux"].any(axis=0))
            flux = flux | arrays[f"{name}.lobe_flux"].any(axis=0) if lobes else flux
            boxes.append(bounds_of(arrays[f"{name}.position"], flux))
        low, high = np.min([box.low for box in boxes], axis=0), np.max([box.high for box in boxes], axis=0)
        return {"extents.visible": np.stack(visible), "extents.illuminated": np.stack([low, high])}

    form = Form(literal.extents, {
        "position": "gbuffer.position", "triangle_id": "gbuffer.triangle_id",
        "map_positions": tuple(f"{name}.position" for name in rsms),
        "map_fluxes": tuple(f"{name}.flux" for name in rsms), **({"map_lobe_fluxes": tuple(lobes)} if lobes else {})},
        ("extents.visible", "extents.illuminated"))
    box = "least and greatest, xyz"
    recipe.add("extents", "boxes of what the camera sees and of what reflects direct light", run,
               ("gbuffer.position", "gbuffer.triangle_id", *(f"{name}.{key}" for name in rsms for key in
                                                             ("position", "flux")), *lobes),
               {"extents.visible": Spec(box, "m", "box of the pixels' surface points", "world"),
                "extents.illuminated": Spec(box, "m", "box of the texels with flux, of all lamps", "world")},
               paper="docs/methods/val", bugs=form.bugs("extents"), variants=(form,))


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

    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
        center, normal = (np.asarray(arrays[name], np.float64) for name in last)
        start = Clustering(center, normal, np.zeros(count, np.int64), np.zeros(total, np.int32), 0, np.zeros(1))
        made = cluster(arrays[LIGHTS[0]], arrays[LIGHTS[1]], count, distance=settings.distance,
                       weights=(settings.position_weight, settings.normal_weight),
                       diagonal=extent_of(arrays, "illuminated").diagonal, rounds=settings.rounds - ROUNDS, start=start)
        return {"clusters.center": made.center, "clusters.normal": made.normal, "clusters.of": made.of}

    form = Form(literal.kmeans, {**READS, "illuminated": "extents.illuminated", "center": last[0], "axis": last[1]},
                tuple(_clusters()), {**_metric(settings), "rounds": settings.rounds - ROUNDS})
    recipe.add("kmeans", "further rounds until no light changes its cluster", run,
               (*LIGHTS, "extents.illuminated", *last), _clusters(), paper="VAL Sec. 5.1; docs/methods/val",
               exact=(*LIGHTS, *last), bugs=form.bugs("kmeans"), variants=(form,))


def _add_each(recipe: Recipe) -> None:
    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
        total = arrays[LIGHTS[0]].shape[1]
        made = cluster(arrays[LIGHTS[0]], arrays[LIGHTS[1]], total, diagonal=1.0)
        return {"clusters.center": made.center, "clusters.normal": made.normal, "clusters.of": made.of}

    form = Form(literal.kmeans_each, READS, tuple(_clusters()))
    recipe.add("kmeans", "as many clusters as lights: each light is one, coincident lights too", run, LIGHTS,
               _clusters(), paper="VAL Sec. 5.1", bugs=form.bugs("kmeans_each"), variants=(form,))


def _clusters() -> dict[str, Spec]:
    return {"clusters.center": Spec("xyz, cluster", "m", "mean of each cluster's lights", "world"),
            "clusters.normal": Spec("xyz, cluster", VECTOR, "mean direction of their normals", "world"),
            "clusters.of": Spec("light", "1", "C(i): cluster of each light", tier="T0")}


def _metric(settings: Clusters) -> dict[str, Any]:
    return {"distance": settings.distance, "w_x": settings.position_weight, "w_a": settings.normal_weight}


def _add_start(recipe: Recipe, count: int, total: int) -> None:
    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
        return {f"kmeans.{key}0": arrays[name][:, first_lights(total, count)] for key, name in
                zip(("center", "normal"), LIGHTS, strict=True)}

    form = Form(literal.kmeans_start, READS, tuple(_centers(0)), {"count": count})
    recipe.add("kmeans.start", "cluster k begins at light floor(k N / M)", run, LIGHTS, _centers(0),
               paper="VAL Sec. 5.1; docs/methods/val", exact=LIGHTS, bugs=form.bugs("kmeans_start"), variants=(form,))


def _centers(number: int) -> dict[str, Spec]:
    return {f"kmeans.center{number}": Spec("xyz, cluster", "m", f"centres after round {number}", "world"),
            f"kmeans.normal{number}": Spec("xyz, cluster", VECTOR, "their normals", "world")}


def _add_assignment(recipe: Recipe, settings: Clusters, number: int) -> None:
    center, normal = _centers(number)

    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
        of, own = assigned(arrays[LIGHTS[0]], arrays[LIGHTS[1]], arrays[center], arrays[normal], settings.distance,
                           (settings.position_weight, settings.normal_weight),
                           extent_of(arrays, "illuminated").diagonal)
        return {f"kmeans.of{number}": of, f"kmeans.distance{number}": own}

    reads = {**READS, "illuminated": "extents.illuminated", "center": center, "axis": normal}
    form = Form(literal.kmeans_assign, reads, (f"kmeans.of{number}", f"kmeans.distance{number}"),
                _metric(settings))
    forms = {"raw", "normalised", "squared"} - {settings.distance}
    lists = ("kmeans_assign", f"kmeans_assign/{settings.distance}", *(f"kmeans_assign/not {name}" for name in forms))
    recipe.add(f"kmeans.assign{number}", "nearest cluster of each light, the lowest index of equally near ones", run,
               (*LIGHTS, "extents.illuminated", center, normal),
               {f"kmeans.of{number}": Spec("light", "1", "nearest cluster", tier="T0"),
                f"kmeans.distance{number}": Spec("light", "1", "its distance", paper=METRIC)},
               paper=METRIC, exact=(*LIGHTS, center, normal), variants=(form,), bugs=(
                   *form.bugs(*lists), *(_box_bugs(recipe, form) if settings.distance == "normalised" else ())))


def _box_bugs(recipe: Recipe, form: Form) -> tuple[Bug, ...]:
    """Return likely bugs of distances in shares of another box, which the stage does not read."""
    known = recipe.expected()
    visible, illuminated = known["extents.visible"], known["extents.illuminated"]
    both = np.stack([np.minimum(visible[0], illuminated[0]), np.maximum(visible[1], illuminated[1])])
    return (
        Bug("the diagonal of the visible box (extent of the camera's pixels), not of the illuminated one",
            reading(form, extents__illuminated=lambda _: visible), METRIC),
        Bug("the diagonal of both boxes together, not of the illuminated one",
            reading(form, extents__illuminated=lambda _: both), METRIC))


def _add_means(recipe: Recipe, number: int) -> None:
    before, after = tuple(_centers(number)), tuple(_centers(number + 1))
    of = f"kmeans.of{number}"

    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
        made = moved(arrays[LIGHTS[0]], arrays[LIGHTS[1]], np.asarray(arrays[of]), arrays[before[0]], arrays[before[1]])
        return dict(zip(after, made, strict=True))

    form = Form(literal.kmeans_means, {**READS, "of": of, "center": before[0], "axis": before[1]}, after)
    recipe.add(f"kmeans.means{number + 1}", "means of each cluster's lights; without lights a cluster stays", run,
               (*LIGHTS, of, *before), _centers(number + 1), paper="VAL Sec. 5.1; docs/methods/val", exact=before,
               bugs=form.bugs("kmeans_means"), variants=(form,))


def clusters_of(settings: ValSettings) -> Clusters:
    """Return a fixed number of clusters, the only kind that a kit has."""
    assert isinstance(settings.clusters, Clusters)
    return settings.clusters

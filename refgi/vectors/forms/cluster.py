"""Literal forms of stages of clustered visibility: area lights, their maps and light, visibility by the maps."""

from typing import Any

import numpy as np

from refgi.cluster.settings import GeometryBlur
from refgi.literal import val_areas, val_back_projection, val_filters, val_maps, val_series, val_visibility
from refgi.rsm.buffers.extent import SAMPLES
from refgi.vectors.forms.beside import Arguments, Described, Names, alone, form_of, ids, own, written
from refgi.vectors.forms.lights import RECEIVERS, clamp_of, unknown
from refgi.vectors.rows import Form
from refgi.vectors.spec import Arrays, Run

MESH = {"vertices": "geometry.vertices", "faces": "geometry.faces"}
BOXES = {name: (f"{name}.low", f"{name}.high") for name in ("visible", "illuminated")}
LIT = {"illuminated": BOXES["illuminated"]}
CLUSTERS, AXES = ("center", "normal", "of"), ("center", "axis")
AWAY = "st = along[k] @ away"  # lights and centre are projected, each for itself
APART = (((AWAY, "st = along[k] @ position[:, of == k] - along[k] @ center[:, k, None]"),),
         ((AWAY, "st = along[k] @ position[:, of == k] - along[k, :, ::-1] @ center[::-1, k, None]"),))


def _illuminated_extent(arguments: Arguments) -> Described:
    maps, lobes = arguments["map_positions"], arguments["map_lobe_fluxes"]
    if max(one.shape[2] for one in maps) > SAMPLES:
        return Described()
    names = ("map_positions", "map_fluxes", *(() if any(one is None for one in lobes) else ("map_lobe_fluxes",)))
    form = Form(val_areas.illuminated_extent, {name: tuple(f"{name}.{k}" for k in range(len(maps))) for name in names},
                ("low", "high"))
    return Described(form, own("illuminated_extent", "box"))


def _kmeans_assign(arguments: Arguments) -> Described:
    kind = arguments["distance"]
    others = (f"kmeans_assign/not {one}" for one in ("raw", "normalised", "squared") if one != kind)
    return Described(form_of(val_areas.kmeans_assign, arguments, ("of", "distance"), LIT),
                     own("kmeans_assign", f"kmeans_assign/{kind}", *others), ("position", "normal", "center", "axis"))


def _areas(arguments: Arguments) -> Described:
    form = form_of(val_areas.areas, arguments, ("frame", "axes", "side", "offset", "delta", "radius", "members"))
    lists = ("areas/root" if arguments["extent"] == "root" else "areas/not root",
             "areas/fixed" if arguments["axes"] == "fixed" else "areas/not fixed",
             "areas/unbiased" if arguments["unbiased"] else "areas/biased")
    return Described(form, own("areas", *lists), ("position", "center"), facts={
        "up": [0, 1, 0], "up where |y| of the normal >= 0.999": [0, 0, -1], "flat below, of the radius": 1e-5},
        variants=written(form, *APART))


def _occluders(arguments: Arguments) -> Described:
    if arguments["ends"] is None or arguments["ends"].lights.size == 0:
        return Described()
    ends = {name: tuple(f"ends.{leaf}" for leaf in leaves) for name, leaves in BOXES.items()}
    form = form_of(val_maps.occluders, arguments, others={
        **MESH, **ends, "seen": "ends.vertices", "light_position": "ends.lights"})
    return Described(form, own("occluders"), facts={"tolerance, of the diagonal of the boxes' common box": 1e-6})


def _depth_maps(arguments: Arguments) -> Described:
    exact = ("geometry.vertices", "center", "frame")
    usual = arguments["renderer"] == "raster" and arguments["near_geometry"] == "ball"
    if not usual or arguments["geometry"].cut is not None:
        return Described(exact=exact)
    work = arguments["blocks"].sum() * len(arguments["center"]) * arguments["texels"] ** 2
    return Described(form_of(val_maps.depth_maps, arguments, others=MESH), own("depth_maps", "depth_maps/ahead"), exact,
                     facts={"projection": "paraboloid (x, y) / (1 + z)"}, work=work)


def _interleaving(arguments: Arguments) -> Described:
    return Described(form_of(val_areas.interleaving, arguments),
                     own("interleaving", f"interleaving/{arguments['assignment']}"),
                     facts={"subset of a pixel": "(row mod n) n + column mod n"})


def _parts(arguments: Arguments) -> Described:
    exact, facts = ("receivers.position", "light_position"), {"clamp": clamp_of(arguments["pairs"])}
    if unknown(arguments["pairs"]):
        return Described(exact=exact, facts=facts)
    form = form_of(val_areas.parts, arguments, others=RECEIVERS, adapt={"triangle_id": ids})
    dealt = () if arguments["subset"] is None else ("parts/interleaved",)
    return Described(form, own("parts", *dealt), exact, facts=facts)


def _shadowed(arguments: Arguments) -> Described:
    seen = {} if arguments["share"] is not None else {"share": np.ones((1, 1, 1))}
    return Described(form_of(val_areas.shadowed, arguments, others=seen), own("shadowed"))


def _blur(arguments: Arguments) -> Described:
    settings, size = arguments["settings"], arguments["size"]
    by_surface = isinstance(settings, GeometryBlur)
    how: dict[str, Any] = {"extent": np.inf, "cosine": -np.inf, "every_subset": False}
    how = {name: getattr(settings, name) for name in how} if by_surface else how
    form = form_of(val_filters.blur, arguments, others={**RECEIVERS, "box": BOXES["visible"], **how},
                   adapt={"triangle_id": ids})
    lists = ("blur/geometry", f"blur/every subset {how['every_subset']}") if by_surface else ()
    facts = {"window": "x - n // 2 on, moved inwards at the rim", **({
        "extent, of the visible box's diagonal": how["extent"], "least cosine": how["cosine"],
        "every subset": how["every_subset"]} if by_surface else {})}
    return Described(form, own(*lists, "blur", *(("blur/even",) if size % 2 == 0 else ())),
                     ("receivers.position", "receivers.normal"), facts=facts)


PLACES = {"position": "places.position", "center": "places.center", "frame": "places.frame"}
SIZES = {"delta": "places.delta", "near": "places.near"}
COVERED: dict[str, Any] = {"triangle_id": "places.covered"}
EXACT = ("places.center",)
OF_SEARCH = tuple(("val_visibility", one) for one in ("penumbra", "region"))
SLACK = {"slack, of the distance": 1e-3}


def by_default(arguments: Arguments) -> bool:
    """Tell whether discs are found as errata say: by no printed form, nor by another size of the light."""
    return not any(arguments.get(name) for name in ("solid_angle", "alpha", "squares", "foreshortened", "axial"))


def _series(arguments: Arguments) -> Described:
    plain = arguments["attenuation"] == 0 and arguments["rescale"] == "none" and arguments["fixed"] is None
    return Described(form_of(val_series.series, arguments, ("weight", "bias", "end")),
                     own("series", "series/plain" if plain else "series/damped"))


def _depth_scale(arguments: Arguments) -> Described:
    kind = arguments["kind"]
    others = (f"depth_scale/not {one}" for one in ("log_map", "map", "scene") if one != kind)
    unit = "depths per octave" if kind == "log_map" else "1/m"
    return Described(form_of(val_maps.depth_scale, arguments, ("origin", "slope")),
                     own("depth_scale", f"depth_scale/{kind}", *others), specs={"slope": {"unit": unit}})


def _map_depths(arguments: Arguments) -> Described:
    kind = "map_depths/log_map" if arguments["logarithmic"] else "map_depths/linear"
    return Described(form_of(val_maps.map_depths, arguments), own(
        "map_depths", kind, *(("map_depths/mirrored",) if arguments["mirrored"] else ())), ("depth",))


BY_ADDITION = (("s, co = np.sin(c * z), np.cos(c * z)",
                "waves, s2, c2 = [(np.sin(np.pi * z), np.cos(np.pi * z))], np.sin(2 * np.pi * z), "
                "np.cos(2 * np.pi * z); "
                "[waves.append((a * c2 + b * s2, b * c2 - a * s2)) for _ in range(terms - 1) for a, b in waves[-1:]]; "
                "s, co = (np.concatenate(one, axis=1) for one in zip(*waves))"),)  # sines of sums: two for all terms


def _basis(arguments: Arguments) -> Described:
    kept = {"sines and cosines": "8 bits: floor((x + 1) 127.5 + 0.5001) / 127.5 - 1",
            "times the depth, and the depth": "half floats"} if arguments["in_bytes"] else {}
    form = form_of(val_maps.basis, arguments)
    return Described(form, own("basis", *(("basis/bytes",) if arguments["in_bytes"] else ())), ("t",), facts=kept,
                     variants=() if arguments["in_bytes"] else written(form, BY_ADDITION))


def _mip_levels(arguments: Arguments) -> Described:
    count = (arguments["basis"].shape[2] - 1).bit_length()
    form = form_of(val_filters.mip_levels, arguments, tuple(str(level) for level in range(1, count + 1)))
    return Described(form, own("mip_levels", *(("mip_levels/bytes",) if arguments["in_bytes"] else ())))


def _mip_means(arguments: Arguments) -> Described:
    levels = ("basis", *(f"levels.{level}" for level in arguments["levels"]))
    return Described(form_of(val_filters.mip_means, arguments, others={"levels": levels}), own("means", "mip_means"),
                     facts={"level": "max(0, log2(radius * texels a side) - 1)"}, variants=(by_shares,))


def by_shares(stage: Run, reads: Names, writes: Names) -> Run:  # noqa: ARG001 as every variant
    """Return means at coordinates of textures, which are rounded as numbers in [0, 1] are."""
    name = reads["region"]

    def run(arrays: Arrays, _: Any) -> Arrays:
        region = np.array(arrays[name], np.float64)
        region[:, :2] = 2.0 * np.float32(0.5 * region[:, :2] + 0.5) - 1.0
        return stage({**arrays, name: region}, np.float64)

    return run


def _csm_penumbra(arguments: Arguments) -> Described:
    form = form_of(val_series.csm_penumbra, arguments, ("shaded", "z_avg", "region", "t"), {**PLACES, **SIZES})
    exact = (("val_visibility", "cone"), *own("csm_penumbra", "shade")) if by_default(arguments) else ()
    return Described(form, (*OF_SEARCH, *exact), EXACT, facts={"least blocked share": 0.02})


def _csm(arguments: Arguments) -> Described:
    hard = ("csm/hard",) if arguments["hard"] is not None else ()
    return Described(form_of(val_series.csm, arguments), own("csm", "shade", *hard))


def _search(arguments: Arguments) -> Described:
    form = form_of(val_visibility.search, arguments, ("pending", "region", "distance"),
                   {**PLACES, **SIZES, **COVERED}, adapt={"triangle_id": ids})
    exact = ("search/exact", "cone") if by_default(arguments) else ()
    return Described(form, own("search", "region", *exact), EXACT, facts={"steepest, degrees": 80})


def _depth_tests(arguments: Arguments) -> Described:
    texels = arguments["texels"]
    form = form_of(val_visibility.depth_tests, arguments, others={**PLACES, **SIZES, **COVERED},
                   adapt={"triangle_id": ids})
    lists = ("kernel", f"kernel {texels}") if texels > 1 else ("texel",)
    return Described(form, own("depth_tests", *lists, *(("hard",) if arguments["points_only"] else ())),
                     facts={**SLACK, "of lights without extent, texels": 1})


def _pcss_penumbra(arguments: Arguments) -> Described:
    form = form_of(val_visibility.pcss_penumbra, arguments, ("shaded", "z_avg", "region"), {**PLACES, **SIZES})
    return Described(form, own("pcss_penumbra", "penumbra", "region", *(("cone",) if by_default(arguments) else ()),
                                     *(("cone test",) if arguments["cone"] else ())),
                     facts=SLACK)


def _back_projection(arguments: Arguments) -> Described:
    form = form_of(val_back_projection.back_projection, arguments, others={
        "position": "places.position", "triangle_id": "places.covered", "map_center": "places.center",
        "frame": "places.frame"}, adapt={"triangle_id": ids})
    return Described(form, own("back_projection"), EXACT, facts={
        **SLACK, "cells along a side of the rectangle": val_back_projection.CELLS,
        "least side, of the farthest place": val_back_projection.LEAST_SIDE})


FORMS = {
    "rsm.visible_extent": alone(val_areas.visible_extent, ("low", "high"), lists=("visible_extent", "box"),
                                others={"triangle_id": "covered"}, adapt={"triangle_id": ids}),
    "rsm.illuminated_extent": _illuminated_extent,
    **{f"cluster.{one.__name__[1:]}": one for one in (
        _kmeans_assign, _areas, _occluders, _depth_maps, _interleaving, _parts, _shadowed, _blur, _series, _depth_scale,
        _map_depths, _basis, _mip_levels, _mip_means, _csm_penumbra, _csm, _search, _depth_tests, _pcss_penumbra,
        _back_projection)},
    "cluster.kmeans_start": alone(val_areas.kmeans_start, AXES, ("position", "normal")),
    "cluster.kmeans_means": alone(val_areas.kmeans_means, AXES, AXES),
    "cluster.kmeans_rounds": alone(val_areas.kmeans_rounds, CLUSTERS, ("position", "normal", *AXES), others=LIT),
    "cluster.kmeans_each": alone(val_areas.kmeans_each, CLUSTERS),
    "cluster.seen_vertices": alone(val_maps.seen_vertices, others=MESH, lists=()),
    "cluster.map_views": alone(val_maps.map_views, ("center", "ball", "scene_far"), others=BOXES, facts={
        "lift, of the illuminated box's largest coordinate": 4e-6}),
    "cluster.frames_behind": alone(val_maps.frames_behind),
    "cluster.map_ranges": alone(val_maps.map_ranges, ("near", "far")),
    "cluster.disc_means": alone(val_filters.disc_means, lists=("means", "disc_means")),
    "cluster.box_means": alone(val_filters.box_means, lists=("means", "box_means")),
    "cluster.pcss": alone(val_visibility.pcss, others=PLACES, facts=SLACK),
    "cluster.of_both": alone(val_visibility.of_both)}

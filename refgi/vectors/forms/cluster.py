"""Literal forms of stages of clustered visibility: area lights, maps, light."""

from typing import Any

import numpy as np

from refgi.cluster.settings import GeometryBlur
from refgi.literal import val_areas, val_filters, val_maps
from refgi.rsm.buffers.extent import SAMPLES
from refgi.vectors.forms import visibility
from refgi.vectors.forms.beside import BY_INVERSE, Arguments, Described, alone, form_of, ids, own, written
from refgi.vectors.rows import Form

MESH = {"vertices": "geometry.vertices", "faces": "geometry.faces"}
BOXES = {name: (f"{name}.low", f"{name}.high") for name in ("visible", "illuminated")}
LIT = {"illuminated": BOXES["illuminated"]}
CLUSTERS, AXES = ("center", "normal", "of"), ("center", "axis")
AWAY = "st = along[k] @ away"  # lights and centre are projected, each for itself
APART = (((AWAY, "st = along[k] @ position[:, of == k] - along[k] @ center[:, k, None]"),),
         ((AWAY, "st = along[k] @ position[:, of == k] - along[k, :, ::-1] @ center[::-1, k, None]"),))


def visible_extent(arguments: Arguments) -> Described:  # noqa: ARG001
    """Return the box of what pixels see."""
    form = Form(val_areas.visible_extent, {"position": "position", "triangle_id": "covered"}, ("low", "high"),
                adapt={"triangle_id": ids})
    return Described(form, own("visible_extent", "box"))


def illuminated_extent(arguments: Arguments) -> Described:
    """Return the box of what reflects direct light, of maps that no grid leaves texels of."""
    maps, lobes = arguments["map_positions"], arguments["map_lobe_fluxes"]
    if max(one.shape[2] for one in maps) > SAMPLES:
        return Described()
    names = ("map_positions", "map_fluxes", *(() if any(one is None for one in lobes) else ("map_lobe_fluxes",)))
    form = Form(val_areas.illuminated_extent, {name: tuple(f"{name}.{k}" for k in range(len(maps))) for name in names},
                ("low", "high"))
    return Described(form, own("illuminated_extent", "box"))


def kmeans_assign(arguments: Arguments) -> Described:
    """Return the nearest clusters."""
    kind = arguments["distance"]
    others = (f"kmeans_assign/not {one}" for one in ("raw", "normalised", "squared") if one != kind)
    return Described(form_of(val_areas.kmeans_assign, arguments, ("of", "distance"), LIT),
                     own("kmeans_assign", f"kmeans_assign/{kind}", *others), ("position", "normal", "center", "axis"))


def areas(arguments: Arguments) -> Described:
    """Return the rectangles of clusters."""
    form = form_of(val_areas.areas, arguments, ("frame", "axes", "side", "offset", "delta", "radius", "members"))
    lists = ("areas/root" if arguments["extent"] == "root" else "areas/not root",
             "areas/fixed" if arguments["axes"] == "fixed" else "areas/not fixed",
             "areas/unbiased" if arguments["unbiased"] else "areas/biased")
    return Described(form, own("areas", *lists), ("position", "center"), facts={
        "up": [0, 1, 0], "up where |y| of the normal >= 0.999": [0, 0, -1], "flat below, of the radius": 1e-5},
        variants=written(form, *APART))


def occluders(arguments: Arguments) -> Described:
    """Return which triangles may block."""
    if arguments["ends"] is None or arguments["ends"].lights.size == 0:
        return Described()
    ends = {name: tuple(f"ends.{leaf}" for leaf in leaves) for name, leaves in BOXES.items()}
    form = form_of(val_maps.occluders, arguments, others={
        **MESH, **ends, "seen": "ends.vertices", "light_position": "ends.lights"})
    return Described(form, own("occluders"), facts={"tolerance, of the diagonal of the boxes' common box": 1e-6})


def depth_maps(arguments: Arguments) -> Described:
    """Return maps that are rasterized past a ball, of triangles without holes."""
    exact = ("geometry.vertices", "center", "frame")
    usual = arguments["renderer"] == "raster" and arguments["near_geometry"] == "ball"
    if not usual or arguments["geometry"].cut is not None:
        return Described(exact=exact)
    work = arguments["blocks"].sum() * len(arguments["center"]) * arguments["texels"] ** 2
    return Described(form_of(val_maps.depth_maps, arguments, others=MESH), own("depth_maps", "depth_maps/ahead"), exact,
                     facts={"projection": "paraboloid (x, y) / (1 + z)"}, work=work)


def interleaving(arguments: Arguments) -> Described:
    """Return subsets of lights."""
    return Described(form_of(val_areas.interleaving, arguments),
                     own("interleaving", f"interleaving/{arguments['assignment']}"),
                     facts={"subset of a pixel": "(row mod n) n + column mod n"})


def parts(arguments: Arguments) -> Described:
    """Return the light of clusters without clamp or with discs."""
    pairs = arguments["pairs"]
    clamp = "none" if pairs.clamp is None else pairs.clamp.name()
    plain = pairs.offset == 0 and not pairs.as_published and pairs.lobe.norm == "clamped" and not pairs.lobe.widening
    exact, facts = ("receivers.position", "light_position"), {"clamp": clamp}
    if clamp not in ("none", "disc") or not plain:
        return Described(exact=exact, facts=facts)
    form = form_of(val_areas.parts, arguments, others={
        "position": "receivers.position", "normal": "receivers.normal", "triangle_id": "receivers.covered"},
        adapt={"triangle_id": ids})
    dealt = () if arguments["subset"] is None else ("parts/interleaved",)
    return Described(form, own("parts", *dealt), exact, facts=facts, variants=written(form, BY_INVERSE))


def shadowed(arguments: Arguments) -> Described:
    """Return the sum over area lights."""
    seen = {} if arguments["share"] is not None else {"share": np.ones((1, 1, 1))}
    return Described(form_of(val_areas.shadowed, arguments, others=seen), own("shadowed"))


def blur(arguments: Arguments) -> Described:
    """Return means over pixels of a surface, or over all."""
    settings, size = arguments["settings"], arguments["size"]
    by_surface = isinstance(settings, GeometryBlur)
    how: dict[str, Any] = {"extent": np.inf, "cosine": -np.inf, "every_subset": False}
    how = {name: getattr(settings, name) for name in how} if by_surface else how
    form = form_of(val_filters.blur, arguments, others={
        "position": "receivers.position", "normal": "receivers.normal", "triangle_id": "receivers.covered",
        "box": BOXES["visible"], **how}, adapt={"triangle_id": ids})
    lists = ("blur/geometry", f"blur/every subset {how['every_subset']}") if by_surface else ()
    facts = {"window": "x - n // 2 on, moved inwards at the rim", **({
        "extent, of the visible box's diagonal": how["extent"], "least cosine": how["cosine"],
        "every subset": how["every_subset"]} if by_surface else {})}
    return Described(form, own(*lists, "blur", *(("blur/even",) if size % 2 == 0 else ())),
                     ("receivers.position", "receivers.normal"), facts=facts)


FORMS = {
    "rsm.visible_extent": visible_extent, "rsm.illuminated_extent": illuminated_extent,
    **{f"cluster.{one.__name__}": one for one in (
        kmeans_assign, areas, occluders, depth_maps, interleaving, parts, shadowed, blur)},
    "cluster.kmeans_start": alone(val_areas.kmeans_start, AXES, ("position", "normal")),
    "cluster.kmeans_means": alone(val_areas.kmeans_means, AXES, AXES),
    "cluster.kmeans_rounds": alone(val_areas.kmeans_rounds, CLUSTERS, ("position", "normal", *AXES), others=LIT),
    "cluster.kmeans_each": alone(val_areas.kmeans_each, CLUSTERS),
    "cluster.seen_vertices": alone(val_maps.seen_vertices, others=MESH, lists=()),
    "cluster.map_views": alone(val_maps.map_views, ("center", "ball", "scene_far"), others=BOXES, facts={
        "lift, of the illuminated box's largest coordinate": 4e-6}),
    "cluster.frames_behind": alone(val_maps.frames_behind),
    "cluster.map_ranges": alone(val_maps.map_ranges, ("near", "far")),
    "cluster.sampled_pixels": alone(val_areas.sampled_pixels, ("position", "normal", "triangle_id"), ("shifts",)),
    **visibility.FORMS}

"""Literal forms of stages of gathering from reflective shadow maps."""

from typing import Any

import numpy as np

from refgi.literal import gather
from refgi.rsm.raster.projection import ORTHOGRAPHIC, PARABOLOID, PERSPECTIVE, Projection, project
from refgi.splat.gather.gather_sum import LEAST_SIMILAR, coarse_pixels
from refgi.types import Array
from refgi.vectors.forms.beside import Arguments, Described, form_of, own

KINDS = {PERSPECTIVE: "perspective", ORTHOGRAPHIC: "orthographic", PARABOLOID: "paraboloid"}
SHOWN = {"triangle_id": "covered"}
ROUNDING = 1e-6  # texels: of a place in float32


def shown(covered: Array) -> Array:
    """Return triangle ids of receivers of which only whether there is one may be known."""
    return np.where(covered, 0, -1) if covered.dtype == np.bool_ else covered


def formed(function: Any, arguments: Arguments, writes: tuple[str, ...] = ("",), **others: Any) -> Any:
    """Return the form of a function of receivers."""
    return form_of(function, arguments, writes, {**SHOWN, **others}, adapt={"triangle_id": shown})


def pattern(arguments: Arguments) -> Described:
    """Return a disc's samples."""
    kind = "squared" if arguments["weight_squared"] else "plain"
    return Described(form_of(gather.pattern, arguments, ("offset", "weight")), own("pattern", f"pattern/{kind}"),
                     factors={"samples": float(len(arguments["xi"]))})


def centers(arguments: Arguments) -> Described:
    """Return where on a map receivers lie; what lies on its border is exact and decides."""
    maps = arguments["projection"]
    kind, size = KINDS[maps.kind], {"rows": maps.height, "columns": maps.width}
    view = {key: f"projection.{key}" for key in ("origin", "frame", "half")}
    form = formed(gather.centers, {**arguments, **size, "kind": kind}, ("center", "depth"), **view)
    lists = ("centers", *(("centers/stacked",) if maps.maps > 1 else ()),
             *(("centers/perspective",) if kind == "perspective" else ()))
    return Described(form, own(*lists), ("position", *view.values()) if on_border(maps, arguments["position"]) else (),
                     facts={"kind": kind, **size}, factors={"texels of a map": float(maps.height * maps.width)})


def on_border(maps: Projection, position: Array) -> bool:
    """Return whether several points lie on the border of their map, as far as float32 says, more than chance makes."""
    row, column, _ = project(maps, position.reshape(3, -1).astype(np.float64))
    away = np.minimum(np.minimum(row % maps.height, -row % maps.height), np.minimum(column, maps.width - column))
    return bool((away < ROUNDING).sum() > 1)


def disc_texels(arguments: Arguments) -> Described:
    """Return the texels of discs; a sample in the middle has the place's own, which then decides."""
    middle = (arguments["offset"] == 0).all(axis=1).any()
    size = arguments["maps"] * arguments["rows"], arguments["columns"]
    return Described(formed(gather.disc_texels, arguments), own("texels"), ("center", "offset") if middle else (),
                     {"": {"index_of": size}})


def disc_sum(arguments: Arguments) -> Described:
    """Return the light of a map's discs."""
    lists = ("sum", *(("sum/offset",) if arguments["offset"] else ()))
    return Described(formed(gather.disc_sum, arguments), own(*lists), ("position", "surface"))


def all_maps(arguments: Arguments) -> Described:
    """Return the light of all maps."""
    return Described(form_of(gather.all_maps, arguments), own("maps") if len(arguments["irradiance"]) > 1 else ())


def interpolate(arguments: Arguments) -> Described:
    """Return what is interpolated between coarse pixels, and the light."""
    rows, columns = coarse_pixels(arguments["covered"].shape[0], arguments["covered"].shape[1], arguments["grid"])
    form = formed(gather.interpolate, arguments, ("interpolated", "irradiance"), visible=("extent.low", "extent.high"))
    return Described(form, own("interpolate"), ("position",), facts={
        "rows": rows.tolist(), "columns": columns.tolist(), "least_similar": LEAST_SIMILAR})


FORMS = {"gather.pattern": pattern, "gather.centers": centers, "gather.disc_texels": disc_texels,
         "gather.disc_sum": disc_sum, "gather.all_maps": all_maps, "gather.interpolate": interpolate}

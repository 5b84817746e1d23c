"""Literal forms of the range of pixel lights, and of gathering from reflective shadow maps."""

from typing import Any

import numpy as np

from refgi.literal import gather, sii
from refgi.rsm.raster.projection import ORTHOGRAPHIC, PARABOLOID, PERSPECTIVE, Projection, project
from refgi.splat.gather.gather_sum import LEAST_SIMILAR, coarse_pixels
from refgi.types import Array
from refgi.vectors.forms.beside import Arguments, Described, alone, form_of, ids, own
from refgi.vectors.forms.lights import POINTS, pair_reads, unknown
from refgi.vectors.rows import Form


def parts(arguments: Arguments, name: str, *of: str) -> tuple[tuple[str, ...], tuple[tuple[str, str], ...]]:
    """Return the fields of a value of both parts of lights, where there are lobes, and the lists of rows `of` it."""
    lights = arguments.get("lights")
    glossy = lights.lobe_flux is not None if lights is not None else any(
        value is not None for key, value in arguments.items() if key.startswith("glossy_"))
    kinds = ("diffuse", "glossy") if glossy else ("diffuse",)
    return tuple(f"{kind}_{name}" for kind in kinds), own(*of, *(f"{one}/glossy" for one in of if glossy))


def _peaks(arguments: Arguments) -> Described:
    if unknown(arguments["pairs"]):
        return Described()
    writes, lists = parts(arguments, "peak", "peaks")
    reads = pair_reads(len(writes) > 1)
    return Described(Form(sii.peaks, {"normal": reads["light_normal"], **{
        key: reads[key] for key in ("flux", "lobe_flux", "lobe_axis", "lobe_exponent") if key in reads}}, writes),
        lists)


def _strengths(arguments: Arguments) -> Described:
    if unknown(arguments["pairs"]):
        return Described()
    writes, _ = parts(arguments, "strength")
    form = Form(sii.strengths, pair_reads(len(writes) > 1), writes, adapt={"triangle_id": ids})
    return Described(form, own("strengths"), POINTS)


def _reference_length(arguments: Arguments) -> Described:
    lights = arguments["lights"]
    facts = {"lights_drawn": lights.drawn, "share_of_pairs": sii.PAPER_SHARE}
    if unknown(arguments["pairs"]):
        return Described(facts=facts)
    form = Form(sii.reference_length, pair_reads(lights.lobe_flux is not None), ("",), {"drawn": lights.drawn},
                adapt={"triangle_id": ids})
    return Described(form, own("length"), POINTS, facts=facts, factors={"N": lights.drawn})


def _low_irradiance(arguments: Arguments) -> Described:
    _, lists = parts(arguments, "", "low")
    return Described(form_of(sii.low_irradiance, arguments), lists)


def _squares(arguments: Arguments) -> Described:
    writes, _ = parts(arguments, "square")
    return Described(form_of(sii.squares, arguments, writes), own("squares"))


def _kept(arguments: Arguments) -> Described:
    writes, _ = parts(arguments, "kept")
    return Described(form_of(sii.kept, arguments, writes), own("kept"))


def _range_sum(arguments: Arguments) -> Described:
    if unknown(arguments["pairs"]):
        return Described()
    fields, lists = parts(arguments, "kept", "sum")
    reads = {**pair_reads(len(fields) > 1), **{name: name for name in fields}, "low": "low",
             **({"area": "footprint"} if arguments["footprint"] is not None else {})}
    form = Form(sii.range_sum, reads, ("",), {} if len(fields) > 1 else {"glossy_kept": None},
                adapt={"triangle_id": ids})
    return Described(form, (*lists, *(own("sum/disc") if "area" in reads else ())), POINTS)


def _stored_lights(arguments: Arguments) -> Described:
    lights = arguments["lights"]
    lobes = ("lobe_flux", "lobe_axis") if lights.lobe_flux is not None else ()
    names = "position", "normal", "flux", *lobes
    reads = {("light_" if one in ("position", "normal") else "") + one: f"lights.{one}" for one in names}
    kept = {"lobe_exponent": "lights.lobe_exponent"} if lobes else {}
    return Described(Form(sii.stored_lights, reads, names, kept=kept), own("stored", "stored/lights"))


KINDS = {PERSPECTIVE: "perspective", ORTHOGRAPHIC: "orthographic", PARABOLOID: "paraboloid"}
SHOWN = {"triangle_id": "covered"}
ROUNDING = 1e-6  # texels: of a place in float32


def formed(function: Any, arguments: Arguments, writes: tuple[str, ...] = ("",), **others: Any) -> Any:
    """Return the form of a function of receivers."""
    return form_of(function, arguments, writes, {**SHOWN, **others}, adapt={"triangle_id": ids})


def _pattern(arguments: Arguments) -> Described:
    kind = "squared" if arguments["weight_squared"] else "plain"
    return Described(form_of(gather.pattern, arguments, ("offset", "weight")), own("pattern", f"pattern/{kind}"),
                     factors={"samples": float(len(arguments["xi"]))})


def _centers(arguments: Arguments) -> Described:
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


def _disc_texels(arguments: Arguments) -> Described:
    middle = (arguments["offset"] == 0).all(axis=1).any()
    size = arguments["maps"] * arguments["rows"], arguments["columns"]
    return Described(formed(gather.disc_texels, arguments), own("texels"), ("center", "offset") if middle else (),
                     {"": {"index_of": size}})


def _disc_sum(arguments: Arguments) -> Described:
    lists = ("sum", *(("sum/offset",) if arguments["offset"] else ()))
    return Described(formed(gather.disc_sum, arguments), own(*lists), ("position", "surface"))


def _all_maps(arguments: Arguments) -> Described:
    return Described(form_of(gather.all_maps, arguments), own("maps") if len(arguments["irradiance"]) > 1 else ())


def _interpolate(arguments: Arguments) -> Described:
    rows, columns = coarse_pixels(arguments["covered"].shape[0], arguments["covered"].shape[1], arguments["grid"])
    form = formed(gather.interpolate, arguments, ("interpolated", "irradiance"), visible=("extent.low", "extent.high"))
    return Described(form, own("interpolate"), ("position",), facts={
        "rows": rows.tolist(), "columns": columns.tolist(), "least_similar": LEAST_SIMILAR})


FORMS = {"sii.stored_surface": alone(sii.stored_surface, ("position", "normal"), lists=("stored",)),
         "sii.stored_lights": _stored_lights, "sii.peaks": _peaks, "sii.strengths": _strengths,
         "sii.reference_length": _reference_length,
         "sii.low_irradiance": _low_irradiance, "sii.squares": _squares, "sii.kept": _kept, "sii.range_sum": _range_sum,
         "sii.ellipsoids": alone(sii.ellipsoids, tuple(
             f"{kind}_{key}" for kind in ("appendix", "tangent") for key in ("center", "half_width", "height"))),
         "gather.pattern": _pattern, "gather.centers": _centers, "gather.disc_texels": _disc_texels,
         "gather.disc_sum": _disc_sum, "gather.all_maps": _all_maps, "gather.interpolate": _interpolate}

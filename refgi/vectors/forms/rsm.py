"""Literal forms of stages of buffers and of direct light."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from refgi.literal import buffers, direct, light_flux, val_areas
from refgi.rsm.raster.projection import ORTHOGRAPHIC, PARABOLOID, Projection
from refgi.scene.light import Lamp
from refgi.scene.model import Light
from refgi.vectors.bounds import ROUNDING
from refgi.vectors.forms.beside import Arguments, Described, Names, alone, form_of, ids, own, written
from refgi.vectors.rows import Form
from refgi.vectors.spec import Arrays, Run, writing

KINDS = "perspective", "parallel", "paraboloid"  # of maps, in names of lists
QUADRATURE = 8.0  # roundings that a float32 sum over a texel's nodes gathers; the bound is SAFETY times as wide
VIEWS = "view/centre", "view/resolution", "view/frame", "view/origin", "view/extent"
VIEW = {key: f"projection.{key}" for key in ("origin", "frame", "half")}
MESH = {"vertices": "geometry.vertices", "faces": "geometry.faces"}


IN_FLOAT32 = ("o, d = rays(origin, frame, half, rows, columns, parallel)",
              "o, d = (one.astype(np.float32) for one in rays(origin, frame, half, rows, columns, parallel))")
MOELLER = ("depth = (flat * (corner[0] - o)).sum(axis=0) / approach",  # and Trumbore 1997
           "a, b = corner[1] - corner[0], corner[2] - corner[0]; across = np.cross(d, b, axis=0); "
           "whole = (a * across).sum(axis=0); turned = np.cross(o - corner[0], a, axis=0); "
           "depth = (b * turned).sum(axis=0) / whole")
BY_SHARES = ("position = o + depth * d",
             "u, v = ((o - corner[0]) * across).sum(axis=0) / whole, (d * turned).sum(axis=0) / whole; "
             "position = (1 - u - v) * corner[0] + u * corner[1] + v * corner[2]")
RAYS = (IN_FLOAT32,), (IN_FLOAT32, MOELLER), (IN_FLOAT32, MOELLER, BY_SHARES)  # a surface found otherwise


SIDES_IN_FLOAT32 = ("x0, x1 = ((2 * (column + end) / columns - 1)",
                    "row, column = row.astype(np.float32), column.astype(np.float32); "
                    "x0, x1 = ((2 * (column + end) / columns - 1)")
SNAP = 1 / 32  # of a texel: by what OpenGL may move a corner at its coarsest (SUBPIXEL_BITS of 4), float32's edges less


def snapped(columns: int, rows: int, parallel: bool) -> tuple[Callable[[Run, Names, Names], Run], ...]:
    """Return other ways to cover texels: all corners off by `SNAP` of a texel, towards each of four sides."""
    def variant(side: tuple[int, int], stage: Run, reads: Names, writes: Names) -> Run:  # noqa: ARG001
        def run(arrays: Arrays, real: Any) -> Arrays:
            frame, half = (arrays[reads[f"projection.{leaf}"]] for leaf in ("frame", "half"))
            x, y = 2 * SNAP * half * side / np.array((columns, rows))
            if parallel:
                leaf, moved = "origin", arrays[reads["projection.origin"]] + x * frame[:, 0] + y * frame[:, 1]
            else:  # a point's place on the image is right / forward, down / forward
                leaf, moved = "frame", np.stack([frame[:, 0] - x * frame[:, 2], frame[:, 1] - y * frame[:, 2],
                                                 frame[:, 2]], axis=1)
            return stage({**arrays, reads[f"projection.{leaf}"]: moved}, real)

        return run

    return tuple(partial(variant, side) for side in ((1, 1), (1, -1), (-1, 1), (-1, -1)))


def _visible_triangles(arguments: Arguments) -> Described:
    maps = arguments["projection"]
    facts = {"projection": KINDS[maps.kind], "maps": maps.maps, "rows": maps.height, "columns": maps.width}
    if maps.kind == PARABOLOID or arguments["geometry"].cut_outs is not None:
        return Described(facts=facts)
    form = form_of(buffers.visible_triangles, sizes(maps), others={**MESH, **VIEW}, double=True)
    return Described(form, own("triangles", f"triangles/{KINDS[maps.kind]}", "view/upwards", *VIEWS,
                               *(("triangles/cube", "view/cube", "view/cube down") if maps.maps > 1 else ())),
                     facts=facts, work=len(arguments["geometry"].faces) * maps.maps * maps.height * maps.width,
                     variants=snapped(maps.width, maps.height, maps.kind == ORTHOGRAPHIC))


def _surface(arguments: Arguments) -> Described:
    maps, geometry = arguments["projection"], arguments["geometry"]
    if unknown(arguments):
        return Described()
    form = form_of(buffers.surface, {**arguments, **sizes(maps)}, ("depth", "position", "normal", "albedo"), {
        **MESH, **VIEW, **attributes(arguments), "diffuse": "materials.diffuse"}, double=True)
    if geometry.colours is not None:
        return Described(form, (("buffers", "tint"), ("", "surface/colours")), variants=written(form, *RAYS))
    return Described(form, own("surface/side", "surface", f"surface/{KINDS[maps.kind]}", *VIEWS, "surface/albedo",
                               *(("surface/smooth",) if geometry.vertex_normals is not None else ()),
                               *(("view/cube", "view/cube down", "view/cube rows") if maps.maps > 1 else ())),
                     variants=written(form, *RAYS))


def _reflected_flux(arguments: Arguments) -> Described:
    maps, geometry, lamp, materials = (arguments[one] for one in ("projection", "geometry", "lamp", "materials"))
    facts = {"lamp": lamp.kind, **({"falloff": lamp.falloff} if lamp.kind == "spot" else {})}
    glossy, cube, spot = bool(materials.specular.any()), maps.maps > 1, lamp.kind == "spot"
    if unknown(arguments) or materials.ior.any() or (spot and cube):
        return Described(facts=facts)
    writes = ("solid_angle", "flux", "lobe_flux", "lobe_axis", "lobe_exponent")
    numbers = {**arguments, **sizes(maps), "falloff": lamp.falloff}
    form = form_of(light_flux.reflected_flux, numbers, writes, {
        **MESH, **VIEW, **attributes(arguments), "strength": "lamp.strength",
        **({"half_angles": "lamp.half_angles"} if spot else {}),
        **{key: f"materials.{key}" for key in ("diffuse", "specular", "exponent")}}, double=True)
    if geometry.colours is not None:
        lists = (("buffers", "tint"), ("", "flux/colours"), *own(*(("flux/glossy colours",) if glossy else ())))
    else:
        lists = (*own("flux", f"flux/{KINDS[maps.kind]}", *(("flux/spot",) if spot else ()), *falloff_lists([lamp]),
                      *(("flux/cube",) if cube else ()), *(("flux/glossy",) if glossy else ()),
                      *(("flux/glossy cube",) if glossy and cube else ())),
                 *(("buffers", one) for one in (*(("view/frame",) if glossy else ()),
                                                *(("view/cube rows",) if cube else ()),
                                                *(("view/cube",) if glossy and cube else ()))))
    single = written(form, (SIDES_IN_FLOAT32,))
    return Described(form, lists, facts=facts, variants=(summed_in_float32, *single) if spot else single)


def summed_in_float32(stage: Run, reads: Names, writes: Names) -> Run:  # noqa: ARG001
    """Return flux of a spot as a float32 sum over a texel's nodes may be off; refgi takes it in float64 in any run."""
    return writing(stage, **{writes["flux"]: lambda a: (a * (1.0 + QUADRATURE * ROUNDING)).astype(a.dtype)})


def unknown(arguments: Arguments) -> bool:
    """Return whether a view is one that the literal text does not know: a paraboloid, or of textures."""
    textured = arguments["materials"].textures is not None and arguments["geometry"].uv is not None
    return textured or arguments["projection"].kind == PARABOLOID


def attributes(arguments: Arguments) -> dict[str, str]:
    """Return what the literal text reads of triangles beside their corners."""
    return {"material_of_face": "geometry.material_of_face", **{
        key: f"geometry.{key}" for key in ("vertex_normals", "colours")
        if getattr(arguments["geometry"], key) is not None}}


def sizes(maps: Projection) -> dict[str, object]:
    """Return sizes and kind of maps, as the literal text names them."""
    return {"rows": maps.height, "columns": maps.width, "parallel": maps.kind == ORTHOGRAPHIC}


def _facing(arguments: Arguments) -> Described:
    smooth = arguments["geometry"].vertex_normals is not None
    form = form_of(val_areas.facing, arguments, others=MESH if smooth else {})
    return Described(form, own("facing/smooth" if smooth else "facing/flat"),
                     paper="E-VAL-14; docs/conventions: which normal serves what")


def _shadow_map(arguments: Arguments) -> Described:
    maps, lamp, smooth = (arguments[one] for one in ("projection", "lamp", "interpolated"))
    if maps.kind == PARABOLOID or arguments["bias"] is not None:
        return Described()
    form = form_of(direct.shadow_map, {**arguments, **sizes(maps)}, others={
        **VIEW, "triangle_id": "covered", **({place_of(lamp): f"lamp.{place_of(lamp)}"} if smooth else {})},
        double=True, adapt={"triangle_id": ids})
    return Described(form, own("shadow_map", *(("shadow_map/cube",) if maps.maps > 1 else ())),
                     ("position", "normal", "depth", "map_position"))


def _shadow_rays(arguments: Arguments) -> Described:
    key = place_of(arguments["lamp"])
    if arguments["geometry"].cut_outs is not None:
        return Described()
    form = form_of(direct.shadow_rays, arguments, others={**MESH, "triangle_id": "covered", key: f"lamp.{key}"},
                   double=True, adapt={"triangle_id": ids})
    return Described(form, own("shadow_rays", f"shadow_rays/{key}"), ("geometry.vertices", "position", "normal"))


def place_of(lamp: Lamp) -> str:
    """Return which field says where a lamp's light comes from."""
    return "direction" if lamp.place is None else "place"


def _direct_light(arguments: Arguments) -> Described:
    lamps = arguments["lamps"]
    reads = {"position": "position", "normal": "normal", "triangle_id": "covered",
             "visible": tuple(f"visible.{k}" for k in range(len(lamps))),
             **{key: tuple(None if getattr(lamp, key) is None else f"lamps.{k}.{key}" for k, lamp in enumerate(lamps))
                for key in ("strength", "place", "direction", "half_angles")}}
    form = Form(direct.direct_irradiance, reads, ("",), {"falloff": tuple(lamp.falloff for lamp in lamps)},
                adapt={"triangle_id": ids}, double=True)
    kinds = {lamp.kind for lamp in lamps}
    lists = ("direct", *(("direct/place",) if kinds - {"directional"} else ()), *(
        ("direct/spot",) if "spot" in kinds else ()), *(("direct/several",) if len(lamps) > 1 else ()))
    return Described(form, (*own(*lists), *(("light_flux", one) for one in falloff_lists(lamps))),
                     ("position", *(one for one in reads["place"] if one)),
                     facts={"lamps": [lamp.kind for lamp in lamps], "falloff": [lamp.falloff for lamp in lamps]})


def _leaving_radiance(arguments: Arguments) -> Described:
    lists = (one for one in ("extra", "emission") if arguments[one] is not None)
    return Described(form_of(direct.leaving_radiance, arguments), own("leaving", *(f"leaving/{one}" for one in lists)))


def falloff_lists(lamps: Sequence[Light | Lamp]) -> tuple[str, ...]:
    """Return the lists of wrong falloffs of some lamps' spots: what is right for all of them is none."""
    kinds = {getattr(lamp, "falloff", None) for lamp in lamps} - {None}
    return (*(("falloff",) if kinds else ()), *(("falloff/smooth",) if kinds - {"squared_ramp"} else ()),
            *(("falloff/squared",) if "squared_ramp" in kinds else ()))


FORMS = {"rsm.visible_triangles": _visible_triangles, "rsm.surface": _surface, "rsm.map_triangles": _visible_triangles,
         "rsm.map_surface": _surface, "rsm.reflected_flux": _reflected_flux,
         "rsm.facing": _facing, "rsm.shadow_map": _shadow_map, "rays.shadow_rays": _shadow_rays,
         "rsm.direct_irradiance": _direct_light, "rsm.leaving_radiance": _leaving_radiance,
         "rsm.emission": alone(direct.emission, lists=())}

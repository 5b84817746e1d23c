"""Literal forms of stages of pixel lights."""

import numpy as np

from refgi.literal import lights
from refgi.literal.warp import warp as literal_warp
from refgi.types import Array
from refgi.vectors.forms.beside import Arguments, Described, Names, form_of, own
from refgi.vectors.recipe import reading
from refgi.vectors.spec import Run


def importance(arguments: Arguments) -> Described:
    """Return the importance of texels, not spread evenly, nor as printed."""
    if arguments["defensive"] or arguments["as_printed"]:
        return Described()
    form = form_of(lights.importance, {**arguments, "peaked": arguments["kind"] != "flux"})
    plain, cube = arguments["kind"] == "flux", len(arguments["flux"][0]) > len(arguments["flux"][0, 0])
    return Described(form, own("importance", *(["importance/glossy"] if arguments["lobe_flux"] is not None else []),
                               *(["importance/cube"] if cube else [])) if plain else ())


def halton_points(arguments: Arguments) -> Described:
    """Return Halton points."""
    shifted, later = bool(arguments["shifts"][arguments["number"]].any()), arguments["number"] > 0
    return Described(form_of(lights.halton_points, arguments), own(
        "halton", *(["halton/shifted"] if shifted else []), *(["halton/later"] if later else []),
        *(["halton/shifted later"] if shifted and later else [])))


def grid_points(arguments: Arguments) -> Described:
    """Return the centres of cells of one map."""
    return Described() if arguments["maps"] > 1 else Described(form_of(lights.grid_points, arguments), own("grid"))


def warp(arguments: Arguments) -> Described:
    """Return warped points and their weights."""
    maps, how = arguments["maps"], arguments["warp"]
    form = form_of(literal_warp, {**arguments, "levels": how.levels, "method": how.method},
                   ("warped", "density_weight"))
    return Described(form, own("warp", f"warp/{how.method}", *(["warp/cube"] if maps > 1 else [])),
                     facts={"method": how.method, "levels": how.levels}, variants=(summed_row_by_row,))


def summed_row_by_row(stage: Run, reads: Names, _: Names) -> Run:
    """Return a warp whose sums over halves are off as those of n texels one after the other in float32 are."""
    def tilted(importance: Array) -> Array:
        tilt = importance.size * 2.0**-24 / 8
        rows, columns = (np.linspace(-tilt, tilt, size) for size in importance.shape)
        return np.asarray(importance * (1.0 + rows[:, None] + columns), importance.dtype)

    return reading(stage, **{reads["importance"]: tilted})


def texels(arguments: Arguments) -> Described:
    """Return texels and T/N w, where neither lamps are drawn nor weights scaled."""
    maps, rows, columns, number, counts = (arguments[one] for one in ("maps", "rows", "columns", "number", "counts"))
    total, count = maps * rows * columns, counts[number]
    specs = {"texel": {"index_of": (maps * rows, columns)}}
    if arguments["gain"] != 1 or arguments["renormalise"]:
        return Described(specs=specs)
    warped = arguments["density_weight"] is not None
    lists = "texels", *(["texels/warped"] if warped else []), *(["texels/maps"] if arguments["maps"] > 1 else [])
    return Described(form_of(lights.texels, arguments, ("texel", "weight")), own(*lists), ("points",), specs,
                     facts={"T": total, "N": count},
                     factors={"T/N": total / count, "number of lights N": count, "number of texels T": total})


def pixel_lights(arguments: Arguments) -> Described:
    """Return lights of single texels."""
    maps, glossy = range(len(arguments["texel"])), arguments["lobe_flux"] is not None
    if arguments["cell"] or (glossy and any(one is None for one in arguments["lobe_flux"])):
        return Described()
    read = ("texel", "weight", "position", "normal", "flux", *(("lobe_flux", "lobe_axis", "lobe_exponent") if glossy
                                                              else ()))
    form = form_of(lights.pixel_lights, {}, (*read[2:], "texel", "map_index"),
                   {name: tuple(f"{name}.{k}" for k in maps) for name in read})
    warped = any(len(np.unique(one)) > 1 for one in arguments["weight"])
    cube = any(len(one[0]) > len(one[0, 0]) for one in arguments["flux"])
    return Described(form, own("lights", *(["lights/glossy"] if glossy else []), *(["lights/maps"] if len(
        maps) > 1 else []), *(["lights/warped"] if warped else []), *(["lights/cube"] if cube else [])))


def footprints(arguments: Arguments) -> Described:
    """Return the surface that each light stands for."""
    maps = range(len(arguments["lamp"]))
    form = form_of(lights.footprints, arguments, others={
        name: tuple(f"{name}.{k}" for k in maps) for name in ("solid_angle", "drawn", "weight", "lamp")})
    return Described(form, own("footprints"))


FORMS = {"lights.importance": importance, "lights.halton_points": halton_points, "lights.grid_points": grid_points,
         "lights.warp": warp, "lights.texels": texels, "lights.pixel_lights": pixel_lights,
         "lights.footprints": footprints}

"""Literal forms of stages of pixel lights, and of sums over them."""

import numpy as np

from refgi.literal import lights, pairs
from refgi.literal.warp import warp as literal_warp
from refgi.pairs.settings import PairSettings
from refgi.types import Array
from refgi.vectors.forms.beside import Arguments, Described, Names, alone, form_of, ids, own
from refgi.vectors.rows import Form
from refgi.vectors.spec import Run, reading

EQ2 = "SII Eq. 2 and 3; unit directions and r^2 (E-SII-02)"
NORM = "(P + 1) / (2 pi K), K the share of the lobe's integral above the surface; 0 where K is below 1e-12"
POINTS = ("receivers.position", "lights.position")
RECEIVERS = {"position": "receivers.position", "normal": "receivers.normal", "triangle_id": "receivers.covered"}


def _importance(arguments: Arguments) -> Described:
    if arguments["defensive"] or arguments["as_printed"]:
        return Described()
    form = form_of(lights.importance, {**arguments, "peaked": arguments["kind"] != "flux"})
    plain, cube = arguments["kind"] == "flux", len(arguments["flux"][0]) > len(arguments["flux"][0, 0])
    glossy, opened = arguments["lobe_flux"] is not None, arguments["openness"] is not None
    return Described(form, own("importance", *(["importance/glossy"] if glossy else []), *(
        ["importance/cube"] if cube else [])) if plain else own(*(["importance/peaked"] if glossy else []), *(
            ["importance/openness"] if opened else [])))


def _halton_points(arguments: Arguments) -> Described:
    shifted, later = bool(arguments["shifts"][arguments["number"]].any()), arguments["number"] > 0
    return Described(form_of(lights.halton_points, arguments), own(
        "halton", *(["halton/shifted"] if shifted else []), *(["halton/later"] if later else []),
        *(["halton/shifted later"] if shifted and later else [])))


def _grid_points(arguments: Arguments) -> Described:
    return Described() if arguments["maps"] > 1 else Described(form_of(lights.grid_points, arguments), own("grid"))


def _warp(arguments: Arguments) -> Described:
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


def _texels(arguments: Arguments) -> Described:
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


def _pixel_lights(arguments: Arguments) -> Described:
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


def _footprints(arguments: Arguments) -> Described:
    maps = range(len(arguments["lamp"]))
    form = form_of(lights.footprints, arguments, others={
        name: tuple(f"{name}.{k}" for k in maps) for name in ("solid_angle", "drawn", "weight", "lamp")})
    return Described(form, own("footprints"))


def _pair_sum(arguments: Arguments) -> Described:
    lights, settings, count = arguments["lights"], arguments["settings"], arguments["lights"].flux.shape[1]
    facts = {"clamp": clamp_of(settings), "lobe_norm": NORM, "lights_drawn": lights.drawn}
    if unknown(settings) or arguments["lightcuts"] is not None:
        return Described(facts=facts)
    glossy, disc = lights.lobe_flux is not None, settings.needs_footprints
    form = Form(pairs.irradiance, {**pair_reads(glossy), **({"area": "footprint"} if disc else {})}, ("",),
                adapt={"triangle_id": ids})
    return Described(form, own(*pair_lists("irradiance", glossy, disc, count)), POINTS, paper=EQ2, facts=facts,
                     factors={"number of lights": count})


def clamp_of(settings: PairSettings) -> str:
    """Return the word for what bounds near pairs."""
    return "none" if settings.clamp is None else settings.clamp.name()


def unknown(settings: PairSettings) -> bool:
    """Return whether the literal text does not know how one light lights one receiver."""
    return (clamp_of(settings) not in ("none", "disc") or settings.offset != 0 or bool(settings.as_published)
            or settings.lobe.norm != "clamped" or bool(settings.lobe.widening))


def pair_reads(glossy: bool) -> dict[str, str]:
    """Return what forms read of receivers and lights."""
    return {**RECEIVERS, "light_position": "lights.position", "light_normal": "lights.normal", "flux": "lights.flux",
            **({name: f"lights.{name}" for name in ("lobe_flux", "lobe_axis", "lobe_exponent")} if glossy else {})}


def _single_pairs(arguments: Arguments) -> Described:
    glossy = arguments["lobe_flux"] is not None
    lists = own(*pair_lists("pairs", glossy, False, arguments["flux"].shape[1]))
    form = form_of(pairs.pairs, arguments)
    return Described(form, lists, ("position", "light_position"), {"": {"alone": True}}, paper=EQ2,
                     facts={"clamp": "none", "lobe_norm": NORM})


def pair_lists(entry: str, glossy: bool, disc: bool, count: int) -> tuple[str, ...]:
    """Return the lists of rows that hold for sums over lights with or without lobes and discs."""
    kind = "glossy" if glossy else "diffuse"
    return ("pair", *((entry,) if entry == "irradiance" else ()),
            *(("pair/disc",) if disc else ("pair/free", f"{entry}/free", f"pair/{kind} free")), f"pair/{kind}",
            f"{entry}/{kind}", *(("pair/several",) if count > 1 else ()))


FORMS = {"lights.importance": _importance, "lights.halton_points": _halton_points, "lights.grid_points": _grid_points,
         "lights.warp": _warp, "lights.texels": _texels, "lights.pixel_lights": _pixel_lights,
         "lights.footprints": _footprints,
         "pairs.sum": _pair_sum, "pairs.pairs": _single_pairs, "lights.occlude": alone(pairs.occluded)}

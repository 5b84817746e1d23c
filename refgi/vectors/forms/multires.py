"""Literal forms of stages of adaptive refinement: mipmaps, tests, lists of subsplats, light there, upsampling."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, get_args

from refgi.literal import multires, multires_lights, multires_upsample
from refgi.splat.multires.settings import Diagonal, Measure, Upsampling
from refgi.vectors.forms.beside import Arguments, Described, alone, form_of, own
from refgi.vectors.forms.lights import clamp_of, unknown
from refgi.vectors.forms.truth import LIFT, MESH, SHADOWED, lifted

SHOWN = {"triangle_id": "covered"}


def levels(top: int, *sides: str) -> tuple[str, ...]:
    """Return the leaves of levels 1 to top: `low.1`, or their numbers alone."""
    return tuple(f"{side}.{level}" if side else str(level) for side in sides for level in range(1, top + 1))


def _ranges(function: Any, arguments: Arguments) -> Described:
    form = form_of(function, arguments, levels(arguments["top"], "low", "high"), SHOWN)
    return Described(form, own("ranges", f"ranges/{'' if arguments['rim'] else 'no '}rim", function.__name__,
                               *(("ranges/three levels",) if arguments["top"] > 2 else ())),
                     exact=(function.__name__.removesuffix("_ranges"),))


def _slopes(arguments: Arguments) -> Described:
    relative, names = arguments["relative"], levels(arguments["top"], "high")
    return Described(form_of(multires.slopes, arguments, names, SHOWN),
                     own("slopes", f"slopes/{'relative' if relative else 'absolute'}"), exact=("depth",),
                     specs={name: {"unit": "1/pixel" if relative else "m/pixel"} for name in names})


def _curvatures(arguments: Arguments) -> Described:
    rate, names = arguments["rate"], levels(arguments["top"], "high")
    return Described(form_of(multires.curvatures, arguments, names, SHOWN),
                     own("curvatures", f"curvatures/{'rate' if rate else 'chord'}"), exact=("normal", "position"),
                     specs={name: {"unit": "1/m" if rate else "1"} for name in names})


def _discontinuities(arguments: Arguments) -> Described:
    depth, slope, normal, curvature = (arguments[key] is not None for key in (
        "depth_least", "slope", "normal_least", "curvature"))
    tests = {"depth": depth, "slope": slope, "normal": normal, "curvature": curvature,
             "depth and normal": depth and normal, "slope and curvature": slope and curvature}
    lists = [name for name, there in tests.items() if there]
    if depth:
        measure = arguments["depth_measure"]
        lists += [measure, *(f"not {one}" for one in get_args(Measure) if one != measure)]
    lists += ["xyz"] * (normal and len(arguments["normal_least"][0]) == 3) + ["finest"] * (arguments["finest"] > 0)
    return Described(form_of(multires.discontinuities, arguments, levels(arguments["top"], "")),
                     own("discontinuities", *(f"discontinuities/{one}" for one in lists)))


def _states(arguments: Arguments) -> Described:
    diagonal = arguments["diagonal"]
    lists = [f"states/not {rule}" for rule in get_args(Diagonal) if rule != diagonal]
    lists += ["states/neighbours"] * (diagonal != "off") + [f"states/{diagonal}"]
    return Described(form_of(multires.states, arguments, levels(len(arguments["discontinuous"]), ""), SHOWN),
                     own("states", *lists))


def _subsplats(arguments: Arguments) -> Described:
    writes = ("level", "row", "column", "pixel")
    return Described(form_of(multires.subsplats, {**arguments, "finest": 0}, writes, SHOWN), own("subsplats"))


def _points(arguments: Arguments) -> Described:
    kind = arguments["representative"]
    return Described(form_of(multires_lights.points, arguments, ("point", "normal"), {**SHOWN, "mean": kind == "mean"}),
                     own("points", f"points/{kind}"), exact=("position", "normal") if kind == "pixel" else ())


def _upsample_level(arguments: Arguments) -> Described:
    mode, below = arguments["mode"], arguments["coarse"] is not None
    lists = ["filter all" if arguments["filter_all"] else "copy"]
    if mode == "tent":
        lists += ["tent", *(("corner rule", "tent corner rule") if arguments["corner_rule"] else ("all corners",))]
    lists += [f"{mode} below"] if below else []
    return Described(form_of(multires_upsample.upsample_level, arguments, ("light", "known"), SHOWN),
                     own("upsample_level", *(f"upsample_level/{one}" for one in lists)))


def _upsample_at_once(arguments: Arguments) -> Described:
    mode = arguments["mode"]
    return Described(form_of(multires_upsample.upsample, arguments, others=SHOWN), own(
        "upsample", f"upsample/{mode}", *(f"upsample/not {one}" for one in get_args(Upsampling) if one != mode)))


def _halved(arguments: Arguments) -> Described:
    form = form_of(multires_lights.halved, arguments, others={"light": "irradiance", "triangle_id": "fine"},
                   adapt={"covered": lambda shown: shown >= 0 if shown.dtype.kind == "i" else shown})
    return Described(form, own("halved"))


SINGLE = ("half of the lights", "last light", "largest light", "0.1 m", "lights shine backwards",
          "the light's cosine is taken")  # what one light cannot show, or the samples do not

Lists = tuple[tuple[str, str] | tuple[str, str, int], ...]


def pair_lists(arguments: Arguments) -> Lists:
    """Return lists of likely bugs of Eq. 2 in a sum over lights; of long ones the first rows, the plainest."""
    free, glossy = arguments["area"] is None, arguments["lobe_flux"] is not None
    diffuse: Lists = (("pairs", "pair/free", 16), ("pairs", "irradiance/free")) if free else (
        ("pairs", "pair/disc", 2),)
    lobes: Lists = (("pairs", "pair/glossy", 5), *((("pairs", "pair/glossy free"),) if free else ()))
    return (*diffuse, *(lobes if glossy else ()))


def _subsplat_irradiance(arguments: Arguments) -> Described:
    facts = {"clamp": clamp_of(arguments["pairs"])}
    if unknown(arguments["pairs"]):
        return Described(facts=facts)
    disc = arguments["area"] is not None
    return Described(form_of(multires_lights.subsplat_irradiance, arguments),
                     (*pair_lists(arguments), *own("subsplat_irradiance",
                                                   *(("subsplat_irradiance/disc",) if disc else ()))),
                     exact=("point", "light_position"), facts=facts)


def _subsplat_facing(arguments: Arguments) -> Described:
    return Described(form_of(multires_lights.subsplat_facing, arguments), (("vpl", "facing"),), ("vertices",),
                     without=("interpolated normals",))


def _lights_seen(arguments: Arguments) -> Described:
    facts = {"largest_lift_of_ray_ends": LIFT}
    if arguments["geometry"].cut_outs is not None:
        return Described(facts=facts)
    flat = arguments["geometry"].vertex_normals is None
    return Described(form_of(multires_lights.lights_seen, arguments, others=MESH), (("vpl", "visible"),), facts=facts,
                     variants=(partial(lifted, "point"),), without=("interpolated normal",) if flat else ())


def _seen_irradiance(arguments: Arguments) -> Described:
    lists = ("pair/free", *(("pair/glossy", "pair/glossy free") if arguments["lobe_flux"] is not None else ()))
    return Described(form_of(multires_lights.seen_irradiance, arguments), (
        *(("pairs", one) for one in lists), ("vpl", "sum")), ("point", "light_position"), without=SHADOWED)


def _representatives(arguments: Arguments) -> Described:
    levels = tuple(map(str, range(arguments["top"] + 1)))
    form = form_of(multires.representatives, arguments, levels, {"triangle_id": "covered"})
    size = arguments["covered"].shape
    return Described(form, own("representatives"), specs={level: {"index_of": size} for level in levels})


def _samples(arguments: Arguments) -> Described:
    if arguments["representative"] != "pixel" or unknown(arguments["pairs"]):
        return Described()
    form = form_of(multires_lights.samples, arguments, tuple(map(str, range(len(arguments["pixels"])))))
    return Described(form, (*pair_lists(arguments), *own("samples")), ("position", "light_position"), without=SINGLE)


def _splits(arguments: Arguments) -> Described:
    kind, own_share = arguments["form"], ("largest irradiance",)
    form = form_of(multires_lights.splits, arguments, tuple(map(str, range(1, len(arguments["pixels"])))))
    lists = (f"splits/{kind}", *(("splits/start",) if arguments["start"] is not None else ()))
    return Described(form, own("splits", *lists), without=own_share if kind != "relative" else ())


def _sum_of_pictures(arguments: Arguments) -> Described:
    form = form_of(multires_upsample.sum_of_pictures, arguments, others={"triangle_id": "covered"})
    return Described(form, own("sum_of_pictures",
                               f"sum_of_pictures/{'filter all' if arguments['filter_all'] else 'copy'}"))


FORMS: Mapping[str, Callable[[Arguments], Described]] = {
    "multires.depth_ranges": partial(_ranges, multires.depth_ranges),
    "multires.normal_ranges": partial(_ranges, multires.normal_ranges), "multires.depth_slopes": _slopes,
    "multires.curvatures": _curvatures, "multires.discontinuities": _discontinuities, "multires.states": _states,
    "multires.subsplats": _subsplats, "multires.points": _points, "multires.upsample_level": _upsample_level,
    "multires.upsample_at_once": _upsample_at_once, "multires.detail": alone(
        multires_lights.detail, exact=("position", "eye"), others={**SHOWN, "light": "irradiance", "camera": "eye"}),
    "multires.halved": _halved,
    "multires.subsplat_facing": _subsplat_facing, "multires.lights_seen": _lights_seen,
    "multires.seen_irradiance": _seen_irradiance, "multires.one_row": alone(
        multires_lights.one_row, ("position", "normal", "triangle_id"), ("position", "normal"),
        lists=("points", "points/pixel"), without=("cell",)),
    "multires.of_row": alone(multires_lights.of_row, lists=()),
    "multires.subsplat_irradiance": _subsplat_irradiance, "multires.representatives": _representatives,
    "multires.samples": _samples, "multires.splits": _splits, "multires.lists": alone(
        multires_lights.lists, ("first", "level", "row", "column", "irradiance")),
    "multires.sum_of_pictures": _sum_of_pictures}

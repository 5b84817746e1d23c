"""Literal forms of stages of adaptive refinement: mipmaps, tests, the list of subsplats, upsampling."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, get_args

from refgi.literal import multires, multires_lights, multires_upsample
from refgi.splat.multires.settings import Diagonal, Measure, Upsampling
from refgi.vectors.forms.beside import Arguments, Described, form_of, own

SHOWN = {"triangle_id": "covered"}


def levels(top: int, *sides: str) -> tuple[str, ...]:
    """Return the leaves of levels 1 to top: `low.1`, or their numbers alone."""
    return tuple(f"{side}.{level}" if side else str(level) for side in sides for level in range(1, top + 1))


def ranges(function: Any, arguments: Arguments) -> Described:
    """Return least and largest depths or normals."""
    form = form_of(function, arguments, levels(arguments["top"], "low", "high"), SHOWN)
    return Described(form, own("ranges", f"ranges/{'' if arguments['rim'] else 'no '}rim", function.__name__,
                               *(("ranges/three levels",) if arguments["top"] > 2 else ())),
                     exact=(function.__name__.removesuffix("_ranges"),))


def slopes(arguments: Arguments) -> Described:
    """Return the steepest changes of depth."""
    relative, names = arguments["relative"], levels(arguments["top"], "high")
    return Described(form_of(multires.slopes, arguments, names, SHOWN),
                     own("slopes", f"slopes/{'relative' if relative else 'absolute'}"), exact=("depth",),
                     specs={name: {"unit": "1/pixel" if relative else "m/pixel"} for name in names})


def curvatures(arguments: Arguments) -> Described:
    """Return the largest changes of normals."""
    rate, names = arguments["rate"], levels(arguments["top"], "high")
    return Described(form_of(multires.curvatures, arguments, names, SHOWN),
                     own("curvatures", f"curvatures/{'rate' if rate else 'chord'}"), exact=("normal", "position"),
                     specs={name: {"unit": "1/m" if rate else "1"} for name in names})


def discontinuities(arguments: Arguments) -> Described:
    """Return the cells that tests mark."""
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


def states(arguments: Arguments) -> Described:
    """Return the states of cells."""
    diagonal = arguments["diagonal"]
    lists = [f"states/not {rule}" for rule in get_args(Diagonal) if rule != diagonal]
    lists += ["states/neighbours"] * (diagonal != "off") + [f"states/{diagonal}"]
    return Described(form_of(multires.states, arguments, levels(len(arguments["discontinuous"]), ""), SHOWN),
                     own("states", *lists))


def subsplats(arguments: Arguments) -> Described:
    """Return the list of subsplats."""
    writes = ("level", "row", "column", "pixel")
    return Described(form_of(multires.subsplats, {**arguments, "finest": 0}, writes, SHOWN), own("subsplats"))


def points(arguments: Arguments) -> Described:
    """Return where subsplats are evaluated."""
    kind = arguments["representative"]
    return Described(form_of(multires_lights.points, arguments, ("point", "normal"), {**SHOWN, "mean": kind == "mean"}),
                     own("points", f"points/{kind}"), exact=("position", "normal") if kind == "pixel" else ())


def upsample_level(arguments: Arguments) -> Described:
    """Return the light of a level."""
    mode, below = arguments["mode"], arguments["coarse"] is not None
    lists = ["filter all" if arguments["filter_all"] else "copy"]
    if mode == "tent":
        lists += ["tent", *(("corner rule", "tent corner rule") if arguments["corner_rule"] else ("all corners",))]
    lists += [f"{mode} below"] if below else []
    return Described(form_of(multires_upsample.upsample_level, arguments, ("light", "known"), SHOWN),
                     own("upsample_level", *(f"upsample_level/{one}" for one in lists)))


def upsample_at_once(arguments: Arguments) -> Described:
    """Return the picture of subsplats without levels."""
    mode = arguments["mode"]
    return Described(form_of(multires_upsample.upsample, arguments, others=SHOWN), own(
        "upsample", f"upsample/{mode}", *(f"upsample/not {one}" for one in get_args(Upsampling) if one != mode)))


def detail(arguments: Arguments) -> Described:
    """Return Eq. 3 of the paper."""
    others = {**SHOWN, "light": "irradiance", "camera": "eye"}
    return Described(form_of(multires_lights.detail, arguments, others=others), own("detail"), ("position", "eye"))


def halved(arguments: Arguments) -> Described:
    """Return a picture of half the size."""
    form = form_of(multires_lights.halved, arguments, others={"light": "irradiance", "triangle_id": "fine"},
                   adapt={"covered": lambda shown: shown >= 0 if shown.dtype.kind == "i" else shown})
    return Described(form, own("halved"))


FORMS: Mapping[str, Callable[[Arguments], Described]] = {
    "multires.depth_ranges": partial(ranges, multires.depth_ranges),
    "multires.normal_ranges": partial(ranges, multires.normal_ranges), "multires.depth_slopes": slopes,
    "multires.curvatures": curvatures, "multires.discontinuities": discontinuities, "multires.states": states,
    "multires.subsplats": subsplats, "multires.points": points, "multires.upsample_level": upsample_level,
    "multires.upsample_at_once": upsample_at_once, "multires.detail": detail, "multires.halved": halved}

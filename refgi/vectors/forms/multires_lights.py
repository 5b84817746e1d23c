"""Literal forms of stages of light at subsplats: Eq. 2, lists of each light's own."""

from typing import Any

from refgi.literal import multires, multires_lights, multires_upsample
from refgi.pairs.settings import PairSettings
from refgi.vectors.forms.beside import Arguments, Described, Names, alone, form_of, own
from refgi.vectors.spec import Arrays, Run

SINGLE = ("half of the lights", "last light", "largest light", "0.1 m", "lights shine backwards",
          "the light's cosine is taken")  # what one light cannot show, or the samples do not
# what shows only where surfaces block the light, or never in these cases
SHADOWED = ("clamped", "absolute", "at least", "largest light", "first half", "horizon")
LIFT = 1e-3  # m: ports lift the ends of their rays off the surfaces by up to that; what it decides is masked
LISTED = ("level", "row", "column")

Lists = tuple[tuple[str, str] | tuple[str, str, int], ...]


def covers(pairs: PairSettings) -> bool:
    """Return whether the literal text has these pairs: no clamp or discs, nothing as printed."""
    clamp = "none" if pairs.clamp is None else pairs.clamp.name()
    return (clamp in ("none", "disc") and pairs.offset == 0 and not pairs.as_published
            and pairs.lobe.norm == "clamped" and not pairs.lobe.widening)


def pair_lists(arguments: Arguments) -> Lists:
    """Return lists of likely bugs of Eq. 2 in a sum over lights; of long ones the first rows, the plainest."""
    free, glossy = arguments["area"] is None, arguments["lobe_flux"] is not None
    diffuse: Lists = (("pairs", "pair/free", 16), ("pairs", "irradiance/free")) if free else (
        ("pairs", "pair/disc", 2),)
    lobes: Lists = (("pairs", "pair/glossy", 5), *((("pairs", "pair/glossy free"),) if free else ()))
    return (*diffuse, *(lobes if glossy else ()))


def subsplat_irradiance(arguments: Arguments) -> Described:
    """Return Eq. 2 at every subsplat."""
    clamp = arguments["pairs"].clamp
    facts = {"clamp": "none" if clamp is None else clamp.name()}
    if not covers(arguments["pairs"]):
        return Described(facts=facts)
    disc = arguments["area"] is not None
    return Described(form_of(multires_lights.subsplat_irradiance, arguments),
                     (*pair_lists(arguments), *own("subsplat_irradiance",
                                                   *(("subsplat_irradiance/disc",) if disc else ()))),
                     exact=("point", "light_position"), facts=facts)


def subsplat_facing(arguments: Arguments) -> Described:
    """Return the faces of subsplats."""
    return Described(form_of(multires_lights.subsplat_facing, arguments), (("vpl", "facing"),), ("vertices",),
                     without=("interpolated normals",))


def lights_seen(arguments: Arguments) -> Described:
    """Return which lights reach which subsplats, where surfaces have no holes."""
    facts = {"largest_lift_of_ray_ends": LIFT}
    if arguments["geometry"].cut_outs is not None:
        return Described(facts=facts)
    mesh = {"vertices": "geometry.vertices", "faces": "geometry.faces"}
    return Described(form_of(multires_lights.lights_seen, arguments, others=mesh), (("vpl", "visible"),), facts=facts,
                     variants=(lifted,))


def lifted(stage: Run, reads: Names, writes: Names) -> Run:
    """Return shadow rays whose ends are lifted off surfaces by as much as those of ports."""
    del writes
    ends = (("point", "face_normal"), ("light_position", "light_normal"))

    def run(arrays: Arrays, real: Any) -> Arrays:
        return stage({**arrays, **{reads[end]: arrays[reads[end]] + real(LIFT) * arrays[reads[normal]]
                                   for end, normal in ends}}, real)

    return run


def seen_irradiance(arguments: Arguments) -> Described:
    """Return the sum of what subsplats see."""
    lists = ("pair/free", *(("pair/glossy", "pair/glossy free") if arguments["lobe_flux"] is not None else ()))
    return Described(form_of(multires_lights.seen_irradiance, arguments), (
        *(("pairs", one) for one in lists), ("vpl", "sum")), ("point", "light_position"), without=SHADOWED)


def one_row(arguments: Arguments) -> Described:
    """Return subsplats as a picture."""
    form = form_of(multires_lights.one_row, arguments, ("position", "normal", "triangle_id"))
    return Described(form, own("points", "points/pixel"), ("position", "normal"))


def representatives(arguments: Arguments) -> Described:
    """Return the pixels that stand for cells."""
    levels = tuple(map(str, range(arguments["top"] + 1)))
    form = form_of(multires.representatives, arguments, levels, {"triangle_id": "covered"})
    size = arguments["covered"].shape
    return Described(form, own("representatives"), specs={level: {"index_of": size} for level in levels})


def samples(arguments: Arguments) -> Described:
    """Return the light of each light alone at every cell's pixel."""
    if arguments["representative"] != "pixel" or not covers(arguments["pairs"]):
        return Described()
    form = form_of(multires_lights.samples, arguments, tuple(map(str, range(len(arguments["pixels"])))))
    return Described(form, (*pair_lists(arguments), *own("samples")), ("position", "light_position"), without=SINGLE)


def splits(arguments: Arguments) -> Described:
    """Return the cells that lights split."""
    kind, own_share = arguments["form"], ("largest irradiance",)
    form = form_of(multires_lights.splits, arguments, tuple(map(str, range(1, len(arguments["pixels"])))))
    lists = (f"splits/{kind}", *(("splits/start",) if arguments["start"] is not None else ()))
    return Described(form, own("splits", *lists), without=own_share if kind != "relative" else ())


def lists(arguments: Arguments) -> Described:
    """Return the subsplats of each light."""
    form = form_of(multires_lights.lists, arguments, ("first", *LISTED, "irradiance"))
    return Described(form, own("lists"))


def sum_of_pictures(arguments: Arguments) -> Described:
    """Return the sum of all lights' pictures."""
    form = form_of(multires_upsample.sum_of_pictures, arguments, others={"triangle_id": "covered"})
    return Described(form, own("sum_of_pictures",
                               f"sum_of_pictures/{'filter all' if arguments['filter_all'] else 'copy'}"))


FORMS = {
    "multires.subsplat_facing": subsplat_facing, "multires.lights_seen": lights_seen,
    "multires.seen_irradiance": seen_irradiance, "multires.one_row": one_row,
    "multires.of_row": alone(multires_lights.of_row, lists=()),
    "multires.subsplat_irradiance": subsplat_irradiance, "multires.representatives": representatives,
    "multires.samples": samples, "multires.splits": splits, "multires.lists": lists,
    "multires.sum_of_pictures": sum_of_pictures}

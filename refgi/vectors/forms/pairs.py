"""Literal forms of sums over pixel lights."""

from refgi.literal import pairs
from refgi.pairs.settings import PairSettings
from refgi.vectors.forms.beside import BY_INVERSE, Arguments, Described, alone, form_of, ids, own, written
from refgi.vectors.rows import Form

EQ2 = "SII Eq. 2 and 3; unit directions and r^2 (E-SII-02)"
NORM = "(P + 1) / (2 pi K), K the share of the lobe's integral above the surface; 0 where K is below 1e-12"
POINTS = ("receivers.position", "lights.position")


def pair_sum(arguments: Arguments) -> Described:
    """Return Eq. 2 and 3 without clamp or with discs."""
    lights, settings, count = arguments["lights"], arguments["settings"], arguments["lights"].flux.shape[1]
    facts = {"clamp": clamp_of(settings), "lobe_norm": NORM, "lights_drawn": lights.drawn}
    if unknown(settings) or arguments["lightcuts"] is not None:
        return Described(facts=facts)
    glossy, disc = lights.lobe_flux is not None, settings.needs_footprints
    form = Form(pairs.irradiance, {**pair_reads(glossy), **({"area": "footprint"} if disc else {})}, ("",),
                adapt={"triangle_id": ids})
    return Described(form, own(*pair_lists("irradiance", glossy, disc, count)), POINTS, paper=EQ2, facts=facts,
                     factors={"number of lights": count}, variants=written(form, BY_INVERSE))


def clamp_of(settings: PairSettings) -> str:
    """Return the word for what bounds near pairs."""
    return "none" if settings.clamp is None else settings.clamp.name()


def unknown(settings: PairSettings) -> bool:
    """Return whether the literal text does not know how one light lights one receiver."""
    return (clamp_of(settings) not in ("none", "disc") or settings.offset != 0 or bool(settings.as_published)
            or settings.lobe.norm != "clamped" or bool(settings.lobe.widening))


def pair_reads(glossy: bool) -> dict[str, str]:
    """Return what forms read of receivers and lights."""
    return {"position": "receivers.position", "normal": "receivers.normal", "triangle_id": "receivers.covered",
            "light_position": "lights.position", "light_normal": "lights.normal", "flux": "lights.flux",
            **({name: f"lights.{name}" for name in ("lobe_flux", "lobe_axis", "lobe_exponent")} if glossy else {})}


def single_pairs(arguments: Arguments) -> Described:
    """Return pairs of one light and one receiver each."""
    glossy = arguments["lobe_flux"] is not None
    lists = own(*pair_lists("pairs", glossy, False, arguments["flux"].shape[1]))
    form = form_of(pairs.pairs, arguments)
    return Described(form, lists, ("position", "light_position"), {"": {"alone": True}}, paper=EQ2,
                     facts={"clamp": "none", "lobe_norm": NORM}, variants=written(form, BY_INVERSE))


def pair_lists(entry: str, glossy: bool, disc: bool, count: int) -> tuple[str, ...]:
    """Return the lists of rows that hold for sums over lights with or without lobes and discs."""
    kind = "glossy" if glossy else "diffuse"
    return ("pair", *((entry,) if entry == "irradiance" else ()),
            *(("pair/disc",) if disc else ("pair/free", f"{entry}/free", f"pair/{kind} free")), f"pair/{kind}",
            f"{entry}/{kind}", *(("pair/several",) if count > 1 else ()))


FORMS = {"pairs.sum": pair_sum, "pairs.pairs": single_pairs, "lights.occlude": alone(pairs.occluded)}

"""Literal forms of the range of pixel lights."""

from refgi.literal import sii
from refgi.vectors.forms.beside import Arguments, Described, alone, form_of, ids, own
from refgi.vectors.forms.pairs import POINTS, pair_reads, unknown
from refgi.vectors.rows import Form


def parts(arguments: Arguments, name: str, *of: str) -> tuple[tuple[str, ...], tuple[tuple[str, str], ...]]:
    """Return the fields of a value of both parts of lights, where there are lobes, and the lists of rows `of` it."""
    lights = arguments.get("lights")
    glossy = lights.lobe_flux is not None if lights is not None else any(
        value is not None for key, value in arguments.items() if key.startswith("glossy_"))
    kinds = ("diffuse", "glossy") if glossy else ("diffuse",)
    return tuple(f"{kind}_{name}" for kind in kinds), own(*of, *(f"{one}/glossy" for one in of if glossy))


def peaks(arguments: Arguments) -> Described:
    """Return I_0 of the parts of lights."""
    if unknown(arguments["pairs"]):
        return Described()
    writes, lists = parts(arguments, "peak", "peaks")
    reads = pair_reads(len(writes) > 1)
    return Described(Form(sii.peaks, {"normal": reads["light_normal"], **{
        key: reads[key] for key in ("flux", "lobe_flux", "lobe_axis", "lobe_exponent") if key in reads}}, writes),
        lists)


def strengths(arguments: Arguments) -> Described:
    """Return B of the parts of lights."""
    if unknown(arguments["pairs"]):
        return Described()
    writes, _ = parts(arguments, "strength")
    form = Form(sii.strengths, pair_reads(len(writes) > 1), writes, adapt={"triangle_id": ids})
    return Described(form, own("strengths"), POINTS)


def reference_length(arguments: Arguments) -> Described:
    """Return the length of a picture."""
    lights = arguments["lights"]
    facts = {"lights_drawn": lights.drawn, "share_of_pairs": sii.PAPER_SHARE}
    if unknown(arguments["pairs"]):
        return Described(facts=facts)
    form = Form(sii.reference_length, pair_reads(lights.lobe_flux is not None), ("",), {"drawn": lights.drawn},
                adapt={"triangle_id": ids})
    return Described(form, own("length"), POINTS, facts=facts, factors={"N": lights.drawn})


def low_irradiance(arguments: Arguments) -> Described:
    """Return I_low."""
    _, lists = parts(arguments, "", "low")
    return Described(form_of(sii.low_irradiance, arguments), lists)


def squares(arguments: Arguments) -> Described:
    """Return R_0^2 of the parts of lights."""
    writes, _ = parts(arguments, "square")
    return Described(form_of(sii.squares, arguments, writes), own("squares"))


def kept(arguments: Arguments) -> Described:
    """Return which pairs count."""
    writes, _ = parts(arguments, "kept")
    return Described(form_of(sii.kept, arguments, writes), own("kept"))


def range_sum(arguments: Arguments) -> Described:
    """Return the sum of the pairs that count."""
    if unknown(arguments["pairs"]):
        return Described()
    fields, lists = parts(arguments, "kept", "sum")
    reads = {**pair_reads(len(fields) > 1), **{name: name for name in fields}, "low": "low",
             **({"area": "footprint"} if arguments["footprint"] is not None else {})}
    form = Form(sii.range_sum, reads, ("",), {} if len(fields) > 1 else {"glossy_kept": None},
                adapt={"triangle_id": ids})
    return Described(form, lists, POINTS)


def ellipsoids(arguments: Arguments) -> Described:
    """Return both bounds."""
    fields = tuple(f"{kind}_{key}" for kind in ("appendix", "tangent") for key in ("center", "half_width", "height"))
    return Described(form_of(sii.ellipsoids, arguments, fields), own("ellipsoids"))


def stored_lights(arguments: Arguments) -> Described:
    """Return lights as textures keep them."""
    lights = arguments["lights"]
    lobes = ("lobe_flux", "lobe_axis") if lights.lobe_flux is not None else ()
    names = "position", "normal", "flux", *lobes
    reads = {("light_" if one in ("position", "normal") else "") + one: f"lights.{one}" for one in names}
    kept = {"lobe_exponent": "lights.lobe_exponent"} if lobes else {}
    return Described(Form(sii.stored_lights, reads, names, kept=kept), own("stored", "stored/lights"))


FORMS = {"sii.stored_surface": alone(sii.stored_surface, ("position", "normal"), lists=("stored",)),
         "sii.stored_lights": stored_lights, "sii.peaks": peaks, "sii.strengths": strengths,
         "sii.reference_length": reference_length,
         "sii.low_irradiance": low_irradiance, "sii.squares": squares, "sii.kept": kept, "sii.range_sum": range_sum,
         "sii.ellipsoids": ellipsoids}

"""Literal forms of stages of temporal coherence."""

from refgi.literal import temporal
from refgi.vectors.forms.beside import Arguments, Described, alone, form_of, own

VIEW = {key: f"projection.{key}" for key in ("origin", "frame", "half")}


def reprojection(arguments: Arguments) -> Described:
    """Return the look-up in the frame before."""
    counted = ("count",) if arguments["frames"] is not None else ()
    form = form_of(temporal.reprojection, arguments, ("light", "weight", *counted), VIEW)
    return Described(form, own("reprojection", f"reprojection/{arguments['fetch']}"),
                     ("position", "projection.origin", "depth"))


def blend(arguments: Arguments) -> Described:
    """Return the blend with earlier light."""
    counted = arguments["frames"] is not None
    form = form_of(temporal.blend, arguments, ("irradiance", "share", *(("count",) if counted else ())))
    kinds = (("counted", "frames"), ("entering", "entering_share"), ("moving", "speed"))
    return Described(form, own("blend", *(f"blend/{kind}" for kind, name in kinds if arguments[name] is not None)))


FORMS = {
    "sssil.motion": alone(temporal.motion, ("position", "normal", "speed"), ("vertices", "before", "position"),
                          others=VIEW, specs={"speed": {"unit": "pixels"}}),
    "sssil.reprojection": reprojection,
    "sssil.entering": alone(temporal.entering, ("made", "share"), ("position", "projection.origin"), others=VIEW),
    "sssil.clamp": alone(temporal.clamp), "sssil.blend": blend}

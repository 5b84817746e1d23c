"""Literal forms of stages of temporal coherence."""

from refgi.literal import temporal
from refgi.vectors.forms.beside import Arguments, Described, form_of, own

VIEW = {key: f"projection.{key}" for key in ("origin", "frame", "half")}


def motion(arguments: Arguments) -> Described:
    """Return where points were a frame earlier."""
    form = form_of(temporal.motion, arguments, ("position", "normal", "speed"), VIEW)
    return Described(form, own("motion"), ("vertices", "before", "position"), {"speed": {"unit": "pixels"}})


def reprojection(arguments: Arguments) -> Described:
    """Return the look-up in the frame before."""
    counted = ("count",) if arguments["frames"] is not None else ()
    form = form_of(temporal.reprojection, arguments, ("light", "weight", *counted), VIEW)
    return Described(form, own("reprojection", f"reprojection/{arguments['fetch']}"),
                     ("position", "projection.origin", "depth"))


def entering(arguments: Arguments) -> Described:
    """Return points that entered the picture."""
    return Described(form_of(temporal.entering, arguments, ("made", "share"), VIEW), own("entering"),
                     ("position", "projection.origin"))


def clamp(arguments: Arguments) -> Described:
    """Return the clamp of earlier light."""
    return Described(form_of(temporal.clamp, arguments), own("clamp"))


def blend(arguments: Arguments) -> Described:
    """Return the blend with earlier light."""
    counted = arguments["frames"] is not None
    form = form_of(temporal.blend, arguments, ("irradiance", "share", *(("count",) if counted else ())))
    kinds = (("counted", "frames"), ("entering", "entering_share"), ("moving", "speed"))
    return Described(form, own("blend", *(f"blend/{kind}" for kind, name in kinds if arguments[name] is not None)))


FORMS = {"sssil.motion": motion, "sssil.reprojection": reprojection, "sssil.entering": entering, "sssil.clamp": clamp,
         "sssil.blend": blend}

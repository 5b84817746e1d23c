"""Literal forms of stages of pixel lights with visibility, and likely bugs of the ground truth.

That is an estimate without a literal form: it is traced again with each of them.
"""

import functools
from typing import Any

import numpy as np

from refgi.literal import imperfect, vpl
from refgi.settings import flat, replaced
from refgi.types import Array
from refgi.vectors.forms.beside import Arguments, Described, Names, alone, form_of, own
from refgi.vectors.leaves import run_of
from refgi.vectors.spec import Arrays, Bug, Change, Run, reading, writing

RADIOMETRY = "docs/radiometry: E = integral of L cos over the hemisphere, L = albedo/pi of the direct irradiance there"
ESTIMATE = {"tier": "T3", "paper": RADIOMETRY}


def _path_traced(arguments: Arguments) -> Described:
    facts = {key: value for key, value in flat(arguments["settings"]).items()
             if isinstance(value, bool | int | float | str)}
    return Described(exact=("scene.geometry.vertices", "position"), paper=RADIOMETRY, facts=facts,
                     specs={"mean": ESTIMATE, "variance_of_mean": {**ESTIMATE, "unit": "(W/m^2)^2", "axes": (
                         "rgb, row, column"), "space": "linear RGB"}, "samples": {"tier": "T3"}},
                     bugs=(functools.partial(of_light, arguments), functools.partial(of_settings, arguments)))


def of_light(arguments: Arguments, stage: Run, reads: Names, writes: Names) -> tuple[Bug, ...]:
    """Return bugs of what surfaces send and receive."""
    mean, stage = writes["mean"], _once(stage)

    def by(**changes: Change) -> Run:
        return reading(stage, **{reads[leaf.replace("__", ".")].replace(".", "__"): change
                                 for leaf, change in changes.items()})

    def scaled(factor: float) -> Run:
        return writing(stage, **{mean.replace(".", "__"): lambda a: a * factor,
                                 writes["variance_of_mean"].replace(".", "__"): lambda a: a * factor**2})

    def with_direct(arrays: Arrays, real: Any) -> Arrays:
        made = dict(stage(arrays, real))
        return {**made, mean: made[mean] + _direct(arguments)}

    bugs = [
        Bug("the emitter's radiance lacks 1/pi", scaled(np.pi), RADIOMETRY),
        Bug("irradiance is divided by pi", scaled(1 / np.pi), "E excludes the receiver's albedo/pi"),
        Bug("lights are twice as bright", scaled(2.0), RADIOMETRY),
        Bug("the emitter's albedo is left out", by(materials__diffuse=np.ones_like, materials__specular=np.zeros_like),
            RADIOMETRY),
        Bug("direct light is added", with_direct, "one bounce alone"),
        Bug("the receiver's normal points inwards", by(normal=lambda a: -a), RADIOMETRY)]
    if np.any(arguments["materials"].specular > 0):
        bugs.append(Bug("lobes are missing", by(materials__specular=np.zeros_like), "SII Eq. 3"))
    count = len(arguments["lights"].intensity)
    if count > 1:
        bugs.append(Bug("the last light is left out", by(
            lights__intensity=lambda a: a * (np.arange(count) < count - 1)[:, None]), "all lights"))
    return tuple(bugs)


def _once(stage: Run) -> Run:
    """Return a stage that runs once on the same arrays, the very objects."""
    last: list[tuple[Arrays, Arrays]] = []

    def run(arrays: Arrays, real: Any) -> Arrays:
        if not last or any(last[0][0].get(name) is not array for name, array in arrays.items()):
            last[:] = [(arrays, stage(arrays, real))]
        return last[0][1]

    return run


def of_settings(arguments: Arguments, _: Run, reads: Names, writes: Names) -> tuple[Bug, ...]:
    """Return bugs of how many bounces there are, and of what emits and blocks."""
    from refgi.truth.steps import path_traced as traced

    settings = arguments["settings"]

    def changed(**values: Any) -> Run:
        other = {**arguments, "settings": replaced(settings, values)}
        return run_of(traced.__wrapped__, other, reads, writes)  # type: ignore[attr-defined]

    if settings.bounces > 1:
        bugs = [Bug("one bounce less", changed(bounces=settings.bounces - 1), "number of bounces: a fact")]
    elif settings.visibility and settings.emitters == "all":
        bugs = [Bug("one bounce more", changed(bounces=2), "number of bounces: a fact of the case")]
    else:
        bugs = [Bug("all surfaces emit and block", changed(visibility=True, emitters="all"), "facts of the case")]
    if settings.visibility and settings.bounces == 1:
        bugs.append(Bug("nothing blocks between emitter and receiver", changed(visibility=False), RADIOMETRY))
    return tuple(bugs)


def _direct(arguments: Arguments) -> Array:
    from refgi.frame import Frame

    rows, columns = arguments["triangle_id"].shape
    return Frame(arguments["scene"], width=columns, height=rows, dtype=np.float64, shadows="exact").direct


LIFT = 1e-3  # m: ports lift the ends of their rays off the surfaces by up to that; what it decides is masked
MAPS = "Ritschel et al. 2008, Sec. 3"
MESH = {"vertices": "geometry.vertices", "faces": "geometry.faces"}
LIMITS = {"least cosine at the light": 1e-3, "farther by, and still of one surface": 0.1,
          "least cosine of the bias's slope": 0.05}
# what shows only where surfaces block the light, or never in these cases
SHADOWED = ("clamped", "absolute", "at least", "largest light", "first half", "horizon")


def _visible(arguments: Arguments) -> Described:
    form = form_of(vpl.visible, arguments, others=MESH)
    return Described(form, own("visible"), paper="SII Eq. 2 with V", facts={"largest_lift_of_ray_ends": LIFT},
                     variants=(functools.partial(lifted, "position"),))


def lifted(receiver: str, stage: Run, reads: Names, _: Names) -> Run:
    """Return the stage with rays whose ends, at receivers and lights, are lifted as ports do."""
    ends = ((receiver, "face_normal"), ("light_position", "light_normal"))

    def run(arrays: Arrays, real: Any) -> Arrays:
        return stage({**arrays, **{reads[end]: arrays[reads[end]] + real(LIFT) * arrays[reads[normal]]
                                   for end, normal in ends}}, real)

    return run


def _shadowed_sum(arguments: Arguments) -> Described:
    if arguments["seen"] is None:
        return Described()
    glossy, form = arguments["lobe_flux"] is not None, form_of(vpl.shadowed_sum, arguments)
    pairs = ("pair/free", *(("pair/glossy", "pair/glossy free") if glossy else ()))
    return Described(form, (*(("pairs", one) for one in pairs), *own("sum")), ("position", "light_position"),
                     factors={"number of lights": float(arguments["flux"].shape[1])}, without=SHADOWED)


FORMS = {
    "truth.path_traced": _path_traced,
    "vpl.facing": alone(vpl.facing, exact=("vertices",)), "vpl.visible": _visible, "vpl.shadowed_sum": _shadowed_sum,
    "vpl.scattered_points": alone(imperfect.scattered_points, ("point", "point_face", "radius"), ("shift",),
                                  lists=("points",), paper=MAPS),
    "vpl.map_frames": alone(imperfect.map_frames, exact=("normal",), lists=("frames",), paper="Duff et al. 2017",
                            specs={"": {"axes": "light, (right, down, forward), xyz"}}),
    "vpl.depth_maps": alone(imperfect.depth_maps, exact=("vertices",), lists=("depth",), paper=MAPS, facts=LIMITS),
    "vpl.filled": alone(imperfect.filled, paper=MAPS, facts=LIMITS),
    "vpl.looked_up": alone(imperfect.looked_up, exact=("depth",), lists=("looked up",), paper=MAPS, facts=LIMITS)}

"""Literal forms of stages of pixel lights with visibility, and of the ground truth, with random numbers of its own."""

import functools
from collections.abc import Iterator
from typing import Any

import numpy as np

from refgi.literal import imperfect, truth, vpl
from refgi.rsm.raster.projection import camera_projection
from refgi.scene import PointLight, SpotLight
from refgi.settings import flat
from refgi.vectors.forms.beside import Arguments, Described, Names, alone, form_of, own
from refgi.vectors.rows import Form
from refgi.vectors.spec import Arrays, Run

RADIOMETRY = "docs/radiometry: E = integral of L cos over the hemisphere, L = albedo/pi of the direct irradiance there"
ESTIMATE = {"tier": "T3", "paper": RADIOMETRY}


CELLS = 20  # along a side of the unit square, of random numbers in pairs


def _path_traced(arguments: Arguments) -> Described:
    facts = {key: value for key, value in flat(arguments["settings"]).items()
             if isinstance(value, bool | int | float | str)}
    form = _paths(arguments)
    lists = () if form is None else ("light", *_rows_of(form, arguments))
    return Described(form, own(*lists), exact=("scene.geometry.vertices", "position"), paper=RADIOMETRY, facts=facts,
                     specs={"mean": ESTIMATE, "variance_of_mean": {**ESTIMATE, "unit": "(W/m^2)^2", "axes": (
                         "rgb, row, column"), "space": "linear RGB"}, "samples": {"tier": "T3"}})


def _rows_of(form: Form, arguments: Arguments) -> Iterator[str]:
    """Yield the lists of rows of what a scene has and settings ask for."""
    kinds, bounces = form.numbers["kinds"], len(form.numbers["xi"])
    yield "bounces" if bounces > 1 else "once" if form.numbers["blocked"] else "open"
    for name, has in {"near": set(kinds) != {"directional"}, "spot": set(kinds) - {"directional", "point"},
                      "lamps": len(kinds) > 1, "glossy": np.any(arguments["materials"].specular > 0),
                      "blocked": form.numbers["blocked"] and bounces == 1,
                      "seen": form.numbers["camera"] is not None}.items():
        if has:
            yield name


def _paths(arguments: Arguments) -> Form | None:
    """Return the literal form with random numbers of its own; None of what it does not say."""
    scene, settings, shape = arguments["scene"], arguments["settings"], arguments["triangle_id"].shape
    geometry, materials = scene.geometry, arguments["materials"]
    if (geometry.colours is not None or geometry.cut_outs is not None or settings.caustics or materials.textures
            or np.any(materials.ior)):
        return None
    random = np.random.default_rng(settings.seed)
    xi = random.random((settings.bounces, 2, 2 * CELLS**2, *shape))
    cell = np.mgrid[:CELLS, :CELLS].reshape(2, -1).repeat(2, axis=1)
    xi[0] = (cell[..., None, None] + xi[0]) / CELLS
    view = camera_projection(scene.camera, *shape[::-1]) if settings.emitters == "visible" else None
    kinds = tuple(one.falloff if isinstance(one, SpotLight) else "point" if isinstance(
        one, PointLight) else "directional" for one in scene.lights)
    mesh = *(f"scene.geometry.{one}" for one in ("vertices", "faces", "material_of_face")), (
        None if geometry.vertex_normals is None else "scene.geometry.vertex_normals")
    return Form(truth.path_traced, {
        "position": "position", "normal": "normal", "triangle_id": "triangle_id", "mesh": mesh,
        "materials": tuple(f"materials.{one}" for one in ("diffuse", "specular", "exponent")),
        "lamps": tuple(f"lights.{one}" for one in ("position", "direction", "intensity", "half_angles"))},
        ("mean", "variance_of_mean", "samples"), {"xi": xi, "kinds": kinds, "blocked": settings.visibility, "camera": (
            None if view is None else (view.origin, view.frame, view.half))}, double=True)


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

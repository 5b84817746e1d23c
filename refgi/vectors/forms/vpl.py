"""Literal forms of stages of pixel lights with visibility, by rays and by imperfect shadow maps."""

from refgi.literal import imperfect, vpl
from refgi.vectors.forms.beside import Arguments, Described, Names, form_of, own
from refgi.vectors.spec import Array, Arrays, Run

LIFT = 1e-3  # m: ports lift the ends of their rays off the surfaces by up to that; what it decides is masked
MAPS = "Ritschel et al. 2008, Sec. 3"
MESH = {"vertices": "geometry.vertices", "faces": "geometry.faces"}
LIMITS = {"least cosine at the light": 1e-3, "farther by, and still of one surface": 0.1,
          "least cosine of the bias's slope": 0.05}
# what shows only where surfaces block the light, or never in these cases
SHADOWED = ("clamped", "absolute", "at least", "largest light", "first half", "horizon")


def facing(arguments: Arguments) -> Described:
    """Return the normals of faces."""
    return Described(form_of(vpl.facing, arguments), own("facing"), ("vertices",))


def visible(arguments: Arguments) -> Described:
    """Return visibility by rays."""
    form = form_of(vpl.visible, arguments, others=MESH)
    return Described(form, own("visible"), paper="SII Eq. 2 with V", facts={"largest_lift_of_ray_ends": LIFT},
                     variants=(lifted,))


def lifted(stage: Run, reads: Names, _: Names) -> Run:
    """Return the stage with rays whose ends are lifted as ports do."""
    def run(arrays: Arrays, real: object) -> Arrays:
        def off(places: Array, normals: Array) -> Array:
            return places + LIFT * normals

        point, light = reads["position"], reads["light_position"]
        return stage({**arrays, point: off(arrays[point], arrays[reads["face_normal"]]),
                      light: off(arrays[light], arrays[reads["light_normal"]])}, real)

    return run


def shadowed_sum(arguments: Arguments) -> Described:
    """Return the sum of the visible lights."""
    if arguments["seen"] is None:
        return Described()
    glossy, form = arguments["lobe_flux"] is not None, form_of(vpl.shadowed_sum, arguments)
    pairs = ("pair/free", *(("pair/glossy", "pair/glossy free") if glossy else ()))
    return Described(form, (*(("pairs", one) for one in pairs), *own("sum")), ("position", "light_position"),
                     factors={"number of lights": float(arguments["flux"].shape[1])}, without=SHADOWED)


def scattered_points(arguments: Arguments) -> Described:
    """Return the points of maps."""
    form = form_of(imperfect.scattered_points, arguments, ("point", "point_face", "radius"))
    return Described(form, own("points"), ("shift",), paper=MAPS)


def map_frames(arguments: Arguments) -> Described:
    """Return the axes of maps."""
    return Described(form_of(imperfect.map_frames, arguments), own("frames"), ("normal",), {
        "": {"axes": "light, (right, down, forward), xyz"}}, "Duff et al. 2017")


def depth_maps(arguments: Arguments) -> Described:
    """Return the maps."""
    return Described(form_of(imperfect.depth_maps, arguments), own("depth"), ("vertices",), paper=MAPS, facts=LIMITS)


def filled(arguments: Arguments) -> Described:
    """Return maps whose holes are filled."""
    return Described(form_of(imperfect.filled, arguments), own("filled"), paper=MAPS, facts=LIMITS)


def looked_up(arguments: Arguments) -> Described:
    """Return visibility by maps."""
    return Described(form_of(imperfect.looked_up, arguments), own("looked up"), ("depth",), paper=MAPS, facts=LIMITS)


FORMS = {"vpl.facing": facing, "vpl.visible": visible, "vpl.shadowed_sum": shadowed_sum,
         "vpl.scattered_points": scattered_points, "vpl.map_frames": map_frames, "vpl.depth_maps": depth_maps,
         "vpl.filled": filled, "vpl.looked_up": looked_up}

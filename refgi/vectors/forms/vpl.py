"""Literal forms of stages of pixel lights with visibility, by rays and by imperfect shadow maps."""

from refgi.literal import imperfect, vpl
from refgi.types import Array
from refgi.vectors.forms.beside import Arguments, Described, Names, alone, form_of, own
from refgi.vectors.spec import Arrays, Run

LIFT = 1e-3  # m: ports lift the ends of their rays off the surfaces by up to that; what it decides is masked
MAPS = "Ritschel et al. 2008, Sec. 3"
MESH = {"vertices": "geometry.vertices", "faces": "geometry.faces"}
LIMITS = {"least cosine at the light": 1e-3, "farther by, and still of one surface": 0.1,
          "least cosine of the bias's slope": 0.05}
# what shows only where surfaces block the light, or never in these cases
SHADOWED = ("clamped", "absolute", "at least", "largest light", "first half", "horizon")


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


FORMS = {
    "vpl.facing": alone(vpl.facing, exact=("vertices",)), "vpl.visible": visible, "vpl.shadowed_sum": shadowed_sum,
    "vpl.scattered_points": alone(imperfect.scattered_points, ("point", "point_face", "radius"), ("shift",),
                                  lists=("points",), paper=MAPS),
    "vpl.map_frames": alone(imperfect.map_frames, exact=("normal",), lists=("frames",), paper="Duff et al. 2017",
                            specs={"": {"axes": "light, (right, down, forward), xyz"}}),
    "vpl.depth_maps": alone(imperfect.depth_maps, exact=("vertices",), lists=("depth",), paper=MAPS, facts=LIMITS),
    "vpl.filled": alone(imperfect.filled, paper=MAPS, facts=LIMITS),
    "vpl.looked_up": alone(imperfect.looked_up, exact=("depth",), lists=("looked up",), paper=MAPS, facts=LIMITS)}

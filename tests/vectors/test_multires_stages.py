"""Stages of `multires` in the kit: the production method at their end, the literal twin as a port, bugs.

No twin covers the order of the list, which means nothing to the paper: the twin's list is sorted here.
"""

import itertools
from functools import cache

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.pairs.settings import PairSettings
from refgi.splat import multires
from refgi.vectors.cases.multires import FULL_PLANS, QUICK_PLANS, settings_of
from refgi.vectors.rows import Form
from refgi.vectors.spec import outputs_of
from refgi.vectors.stages.lights import pixel_lights_of
from tests.naive import multires as twin
from tests.naive import per_light, refinement, upsample
from tests.naive.crossings import LIFT, corners_of, face_normals, free
from tests.naive.pair_term import contributions
from tests.vectors.splat_ports import LARGEST_MASK, expect_within, made, masked_shares, stages_of

PLANS = QUICK_PLANS | FULL_PLANS
STORED = 2e-6  # of the picture's largest value: each of a dozen stages rounds its outputs to float32
ROUNDING = 1e-6  # of float64 results that are stored as float32
SUBSPLATS = "multires.level", "multires.row", "multires.column"

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")


class View:
    """The arrays of a case under the names that the twin reads."""

    def __init__(self, known):
        for name in ("position", "normal", "depth", "albedo", "triangle_id"):
            array = known[f"gbuffer.{name}"]
            setattr(self, name, array.astype(np.float64) if array.dtype.kind == "f" else array)
        self.covered = self.triangle_id >= 0


def of(id):
    """Return settings, arrays, view and coarsest level of a case."""
    settings, known = settings_of(PLANS[id]()), made(id)[1]
    view = View(known)
    return settings, known, view, twin.coarsest_level(view.covered.shape, settings.subsplats.coarsest)


def leaves(known, start=0):
    """Return {cell: place in the list} of the subsplats of levels from `start` on, which is called level 0."""
    cells = zip(*(known[name].tolist() for name in SUBSPLATS), strict=True)
    return {(level - start, i, j): k for k, (level, i, j) in enumerate(cells) if level >= start}


def levels(function, shape, top):
    """Return arrays of levels 1 to top of a function of a cell; channels come first."""
    return [np.moveaxis(np.array([[function(level, i, j) for j in range(columns)] for i in range(rows)]), (0, 1),
                        (-2, -1))
            for level in range(1, top + 1) for rows, columns in [refinement.grid(shape, level)]]


def named(keys, arrays):
    return {f"multires.{key}.{level}": array for key, one in zip(keys, arrays, strict=True)
            for level, array in enumerate(one, start=1)}


@pytest.mark.parametrize("id", PLANS)
def test_the_last_array_is_the_picture_of_the_method(id):
    plan = PLANS[id]()
    frame = Frame(plan.scene, width=plan.size[0], height=plan.size[1], dtype=np.float64, rsm_resolution=plan.maps)
    expected = multires(frame, settings_of(plan))
    case, known = made(id)
    got = known[case.stages[-1].writes[0]]
    np.testing.assert_allclose(got, expected, rtol=0, atol=STORED * expected.max())
    assert (got.max() > 0) != (id == "multires-no-flux")


def ranges(id, what):
    settings, _, view, top = of(id)
    criteria, channel = settings.subsplats.criteria, getattr(view, what)
    planes = [channel] if what == "depth" else list(channel[:len(criteria.normal.components)])

    def span(*cell):
        return np.array([refinement.span(plane, view.covered, *cell, criteria.rim) for plane in planes]).T

    both = levels(span, view.covered.shape, top)  # (2, channels, rows, columns) each
    sides = [[one[k, 0] if what == "depth" else one[k] for one in both] for k in (0, 1)]
    return named((f"{what}_least", f"{what}_largest"), sides)


def largest(id, key, of_pixel):
    _, _, view, top = of(id)
    plane = twin.everywhere(view, of_pixel)
    return named((key,), [levels(lambda *cell: plane[refinement.pixels_of(plane.shape, *cell)].max(), plane.shape,
                                 top)])


def slopes(id):
    settings, _, view, _ = of(id)
    relative = settings.subsplats.criteria.derivative.measure != "absolute"
    return largest(id, "slope", lambda i, j: refinement.slope(view.depth, view.covered, i, j, relative))


def curvatures(id):
    settings, _, view, _ = of(id)
    rate = settings.subsplats.criteria.curvature.name() == "rate"
    return largest(id, "curvature", lambda i, j: refinement.curvature(view.normal, view.position, view.covered, i, j,
                                                                      rate=rate))


def marks(id):
    settings, _, view, top = of(id)
    criteria, finest = settings.subsplats.criteria, settings.subsplats.finest
    tests = [test for test in (twin.depth_range(view, criteria), twin.depth_slope(view, criteria),
                               twin.normal_range(view, criteria), twin.curvature(view, criteria)) if test is not None]
    need = refinement.discontinuities(view.covered.shape, top, finest, lambda *cell: any(test(*cell) for test in tests))
    return named(("discontinuous",), [need[1:]])


def states(id):
    settings, known, view, top = of(id)
    need = [np.zeros_like(view.covered), *(known[f"multires.discontinuous.{level}"] for level in range(1, top + 1))]

    def state(*cell):
        if not view.covered[refinement.pixels_of(view.covered.shape, *cell)].any():
            return 0
        return 2 if refinement.is_refined(need, view.covered, *cell, settings.subsplats.criteria.diagonal) else 1

    return named(("state",), [levels(state, view.covered.shape, top)])


def listed(id):
    _, known, view, top = of(id)
    need = [np.zeros_like(view.covered), *(known[f"multires.state.{level}"] == 2 for level in range(1, top + 1))]
    cells = refinement.in_order(refinement.refine(need, view.covered, "off"), top, need[top].shape[1])
    pixels = [per_light.representative(view.covered, *cell) for cell in cells]
    columns = [*np.array(cells).T, np.array([y * view.covered.shape[1] + x for y, x in pixels])]
    return dict(zip((*SUBSPLATS, "multires.pixel"), columns, strict=True))


def points(id):
    settings, known, view, _ = of(id)
    places = [twin.surface(view, settings.subsplats.representative, view.covered, *cell) for cell in leaves(known)]
    return dict(zip(("multires.point", "multires.normal"), np.array(places).transpose(1, 2, 0), strict=True))


def facing(id):
    """Faces of the triangles that representative pixels see."""
    known = made(id)[1]
    triangle = known["gbuffer.triangle_id"].reshape(-1)[known["multires.pixel"]]
    return {"multires.facing": face_normals(PLANS[id]().scene.geometry, triangle, known["multires.normal"].T).T}


def visible(id):
    """Lights lie on triangles as well: what leaves below one is blocked by it."""
    known, geometry = made(id)[1], PLANS[id]().scene.geometry
    place, normal, up = (known[f"multires.{key}"].T.astype(float) for key in ("point", "normal", "facing"))
    lights = pixel_lights_of(known, np.float64)
    seen = np.zeros((lights.flux.shape[1], len(place)), bool)
    for k in range(len(seen)):
        triangle = known[f"rsm{known['lights.map'][k]}.triangle_id"].reshape(-1)[known["lights.texel"][k]]
        leaving = lights.normal[:, k]
        side = face_normals(geometry, np.array([triangle]), leaving[None])[0]
        toward = lights.position[:, k] - place
        counts = ((toward * up).sum(axis=1) > 0) & ((toward * normal).sum(axis=1) > 0)
        counts &= (toward @ leaving < 0) & (toward @ side < 0)
        counts[counts] = free(corners_of(geometry), place[counts] + LIFT * up[counts],
                              lights.position[:, k] + LIFT * side)
        seen[k] = counts
    return {"multires.visible": seen}


def seen_irradiance(id):
    known = made(id)[1]
    place, normal = (known[f"multires.{key}"].T.astype(float) for key in ("point", "normal"))
    each = contributions(place, normal, pixel_lights_of(known, np.float64), PairSettings(clamp=None))
    return {"multires.irradiance": (each * known["multires.visible"][..., None]).sum(axis=0).T}


def halved(id):
    case, known = made(id)
    light, fine, shown = known[case.stages[-1].reads[0]], known["gbuffer.triangle_id"] >= 0, known["picture.covered"]
    return {"multires.halved": twin.halved(light.astype(float), fine, shown)}


def irradiance(id):
    settings, known, _, _ = of(id)
    if settings.shadow_rays is not None:
        return seen_irradiance(id)
    sources = twin.lights_of(pixel_lights_of(known, np.float64), known.get("lights.area"), settings.effective_pairs)
    places = zip(*(known[name].astype(np.float64).T for name in ("multires.point", "multires.normal")), strict=True)
    return {"multires.irradiance": np.array([sum((light(place) for light in sources), np.zeros(3))
                                             for place in places]).T}


def upsampled(id, level):
    """The levels above are the twin's own: it knows no other."""
    settings, known, view, top = of(id)
    how, values = settings.subsplats.upsampling, known["multires.irradiance"].astype(np.float64).T
    shown = np.array([[view.covered[refinement.pixels_of(view.covered.shape, level, i, j)].any()
                       for j in range(columns)] for rows, columns in [refinement.grid(view.covered.shape, level)]
                      for i in range(rows)]).reshape(refinement.grid(view.covered.shape, level))
    cells = {cell: values[k] for cell, k in leaves(known, level).items()}
    options = {"filter_all": "ams_filter_all" in settings.as_published}
    if how == "tent":
        texels = upsample.tent(cells, shown, top - level, **options,
                               corner_rule="ams_all_corners" not in settings.as_published)
    else:
        texels = {"demo": lambda: upsample.demo(cells, shown, top - level, **options),
                  "nearest": lambda: upsample.nearest(cells, shown),
                  "naive_bilinear": lambda: upsample.naive_bilinear(cells, shown, top)}[how]()
    light, mask = np.zeros((3, *shown.shape)), np.zeros(shown.shape, bool)
    for (i, j), value in texels.items():
        light[:, i, j], mask[i, j] = value, True
    return {f"multires.upsampled.{level}": light, f"multires.known.{level}": mask}


def detail(id):
    settings, known, view, _ = of(id)
    factor = twin.surface_detail(view, known["camera.origin"][0].astype(np.float64), settings.detail)
    return {"multires.detailed": np.where(view.covered, known["multires.upsampled.0"] * factor, 0)}


def every_cell(shape, top):
    return [[(i, j) for i in range(rows) for j in range(columns)]
            for rows, columns in (refinement.grid(shape, level) for level in range(top + 1))]


def places(id):
    _, _, view, top = of(id)
    made_here, width = {}, view.covered.shape[1]
    for level, cells in enumerate(every_cell(view.covered.shape, top)):
        found = [per_light.representative(view.covered, level, *cell) for cell in cells]
        made_here[f"multires.representative.{level}"] = np.array(
            [-1 if at is None else at[0] * width + at[1] for at in found]).reshape(
                refinement.grid(view.covered.shape, level))
    return made_here


def samples(id):
    settings, known, view, top = of(id)
    sources = twin.lights_of(pixel_lights_of(known, np.float64), known.get("lights.area"), settings.effective_pairs)
    made_here, width = {}, view.covered.shape[1]
    for level in range(top + 1):
        places_ = known[f"multires.representative.{level}"]
        out = np.zeros((len(sources), 3, *places_.shape))
        for (i, j), pixel in np.ndenumerate(places_):
            if pixel >= 0:
                at = divmod(int(pixel), width)
                out[:, :, i, j] = [light((view.position[:, *at], view.normal[:, *at])) for light in sources]
        made_here[f"multires.sample.{level}"] = out
    return made_here


@cache
def lists_of(id):
    """Return the twin's lists, {cell: irradiance} of each light, from its light at pixels."""
    settings, known, view, top = of(id)
    chosen, light = settings.subsplats, known["multires.sample.0"].astype(float)
    return [per_light.subsplats(view.covered, lambda at, k=k: light[k][:, *at], top, chosen.finest,
                                lambda largest: chosen.threshold * largest) for k in range(len(light))]


def splits(id):
    _, _, view, top = of(id)
    made_here = {}
    for level in range(1, top + 1):
        rows, columns = refinement.grid(view.covered.shape, level)
        out = np.zeros((len(lists_of(id)), rows, columns), bool)
        for k, cells in enumerate(lists_of(id)):
            for below, i, j in cells:
                if below < level:
                    out[k, i >> (level - below), j >> (level - below)] = True
        made_here[f"multires.split.{level}"] = out
    return made_here


def lists(id):
    cells = [sorted(one.items(), key=lambda item: (-item[0][0], *item[0][1:])) for one in lists_of(id)]
    flat = [item for one in cells for item in one]
    columns = np.array([cell for cell, _ in flat]).T
    return {"multires.first": np.cumsum([0, *map(len, cells)]), **dict(zip(SUBSPLATS, columns, strict=True)),
            "multires.irradiance": np.array([value for _, value in flat]).T}


def summed(id):
    _, known, view, top = of(id)
    total, first = np.zeros((3, *view.covered.shape)), known["multires.first"]
    for begin, end in itertools.pairwise(first):
        cells = zip(*(known[name][begin:end].tolist() for name in SUBSPLATS), strict=True)
        values = known["multires.irradiance"][:, begin:end].astype(float).T
        for (i, j), value in upsample.tent(dict(zip(cells, values, strict=True)), view.covered, top).items():
            total[:, i, j] += value
    return {"multires.upsampled.0": total}


PORT = {"representatives": places, "samples": samples, "splits": splits, "lists": lists, "sum": summed,
        "depth_ranges": lambda id: ranges(id, "depth"), "normal_ranges": lambda id: ranges(id, "normal"),
        "slopes": slopes, "curvatures": curvatures, "discontinuities": marks, "states": states, "subsplats": listed,
        "points": points, "facing": facing, "visible": visible, "irradiance": irradiance, "detail": detail,
        "halved": halved}


@pytest.mark.parametrize("id", PLANS)
def test_the_literal_twin_as_a_port_is_within_bounds(id):
    for name in stages_of(id, "multires"):
        _, key, *level = name.split(".")
        got = upsampled(id, int(*level or "0")) if key == "upsample" else PORT[key](id)
        expect_within(id, name, got)


@pytest.mark.parametrize("id", PLANS)
def test_rounding_decides_few_elements(id):
    assert max(masked_shares(id, "multires").values()) < LARGEST_MASK


@pytest.mark.parametrize("id", PLANS)
def test_the_literal_text_is_the_stage(id):
    case, known = made(id)
    for step in case.stages:
        for form in (one for one in step.variants if isinstance(one, Form) and step.name.startswith("multires")):
            for name, got in outputs_of(step, known, np.float64, form).items():
                scale = np.abs(known[name][np.isfinite(known[name])]).max(initial=0)
                np.testing.assert_allclose(got, known[name], rtol=ROUNDING, atol=ROUNDING * scale, err_msg=name)

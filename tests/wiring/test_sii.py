"""Wiring of `sii`: every setting reaches the picture, the counts and the ledger as the literal text has it."""

import sys

import numpy as np
import pytest

from benchmarks.papers.sii.subjects import counted
from refgi.errors import InputError
from refgi.frame import Frame
from refgi.lights.selection import choose_lights, footprints
from refgi.lights.settings import LightSettings
from refgi.methods import METHODS
from refgi.settings import replaced
from refgi.splat import Receivers, SiiSettings, cut_irradiance, sii
from refgi.splat.sii.approximations import sii_ledger
from refgi.splat.sii.fragments import fragments
from refgi.stages import Memory, reusing
from tests.literal.whole import sii as literal
from tests.literal.whole.pairs import occluded_of, with_clamp
from tests.naive import ledger
from tests.wiring.cases import SCENES, Case, assert_each_key_counts, needed, uncovered, under
from tests.wiring.features import SII, featured
from tests.wiring.fold import fold
from tests.wiring.part_cases import OCCLUSION_CASES, PAIR_CASES

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # that is told: tests/pairs/test_loss

ROUNDING = 1e-9  # of the brightest pixel
SLICES = 1e-5  # of the brightest pixel: the Gauss rule of cut cones is off by up to 1e-4 of a light on its axis
ORDER = {"clusters": 1e-14, "clusters at half the resolution": 1e-14}  # of the lights: clusters sort them

BASE = {"lights.count": 40}
CUT = {"reach.cut": "relative", "reach.cut.reference_length": 0.5}
MESH = CUT | {"reach.bound": "mesh"}
OCTAHEDRA = MESH | {"reach.bound.faces": 8, "lights.count": 12}
# ranges that end beyond the distance within which exponents fall
FAR = OCTAHEDRA | {"reach.cut.reference_length": 1.5}
RIM = MESH | {"reach.bound.inflate": False, "lights.count": 6}
FINE = {"width": 28, "height": 21}
CANDIDATES = "a bound finds the pixels that the threshold is tested at"

FEW = "few lights are summed in full in any case"
STRICT = "so small an error leaves no cluster of a few lights: what larger ones do is told in tests/pairs/lightcuts"

REACH_CASES = {
    "a share of the brightest": Case({"reach.cut": "relative", "reach.cut.share": 0.1,
                                      "reach.cut.reference_length": 0.6}),
    "the paper's share of pairs": Case({"reach.cut": "relative", "reach.cut.share": 0.1}),
    "a share of each light's own": Case({"reach.cut.as_published": {"per_light_ilow"}}, over=CUT),
    "an irradiance": Case({"reach.cut": "absolute", "reach.cut.irradiance": 0.02}),
    "a random share": Case({"reach.stochastic": True, "reach.seed": 5}, over=CUT),
    "a random share of widened lobes": Case({"reach.stochastic": True}, over=CUT | {"pairs.lobe.widening": 0.9}),
    "a random share of each light's own": Case(
        {"reach.stochastic": True, "reach.cut.as_published": {"per_light_ilow"}}, over=CUT),
    "a share of what is printed": Case({"reach.cut": "relative", "reach.cut.reference_length": 0.9},
                                       over={"pairs.as_published": {"sii_no_pi"}, "pairs.lobe.norm": "none"}),
    "a share, clamped": Case({"reach.cut": "relative", "reach.cut.reference_length": 0.6},
                             over={"pairs.clamp": "distance", "pairs.clamp.value": 0.7, "pairs.offset": 0.1}),
    "a share, not clamped": Case({"reach.cut": "relative", "reach.cut.reference_length": 0.6},
                                 over={"pairs.clamp": None}),
    "a share of spheres": Case({"reach.cut": "relative", "reach.cut.reference_length": 0.6},
                               over={"pairs.clamp": "sphere", "lights.count": 12}, scene="matte",
                               frame={"width": 6, "height": 5}),
    "half the resolution": Case({"half_resolution": True}),
    "half the resolution, cut": Case({"half_resolution": True}, over=CUT),
    "compensated by pixels": Case({"compensation": "screen"}, over={"pairs.clamp": "geometry",
                                                                   "pairs.clamp.value": 0.4}),
    "half floats and bytes": Case({"quantisation": "published"}),
    "half floats and bytes, cut": Case({"quantisation": "published"}, over=CUT),
}
CUT_CASES = {
    "clusters": Case({"lightcuts": "bounded", "lightcuts.error": 1e-6}, same=STRICT),
    "no clusters": Case({"lightcuts": None}, same=FEW),
    "clusters where they pay": Case({"lightcuts.error": 0.3}, same=FEW),
    "clusters at half the resolution": Case({"lightcuts": "bounded", "lightcuts.error": 1e-6},
                                            over={"half_resolution": True}, same=STRICT),
}
BOUND_CASES = {
    f"{bound}{how}": Case({"reach.bound": bound}, over=CUT | over, frame=FINE, same=CANDIDATES)
    for bound in ("full", "quad", "ellipsoid", "mesh")
    for how, over in (("", {}), (", widened", {"pairs.lobe.widening": 0.9}),
                      (", widened as printed", {"reach.cut.reference_length": 1.5, "pairs.lobe.widening": 1.5,
                                                "pairs.as_published": {"sii_widening"}}))}
MESH_CASES = {
    "a mesh within its ellipsoid": Case({"reach.bound.inflate": False}, over=OCTAHEDRA),
    "a mesh within the union of two": Case({"reach.bound.inflate": False},
                                           over=FAR | {"pairs.lobe.widening": 0.4}),
    "a mesh within the union of two as printed": Case(
        {"reach.bound.inflate": False},
        over=FAR | {"pairs.lobe.widening": 1.5, "pairs.as_published": {"sii_widening"}}),
    "a mesh of a random range": Case({"reach.bound.inflate": False},
                                     over=OCTAHEDRA | {"reach.stochastic": True}),
    **{f"a mesh of {faces}": Case({"reach.bound.faces": faces}, over=RIM, frame=FINE)
       for faces in (8, 20, 320, 1280)},
}
CASES = under("pairs", PAIR_CASES) | OCCLUSION_CASES | REACH_CASES | CUT_CASES | BOUND_CASES | MESH_CASES


def known(settings):
    """Tell whether the literal text has a strength for the reference length: not of lobes whose exponents fall."""
    cut = settings.reach.cut
    return not settings.pairs.lobe.widening or cut is None or cut.name() != "relative" or cut.reference_length


FOLDED = fold(SiiSettings, CASES, BASE, fits=known)
COUNTED = {name: case for name, case in FOLDED.items() if "reach.cut" in {**case.over, **case.values}}
ACCOUNTS = ("a share, clamped", "a random share", "half the resolution, cut", "a mesh within its ellipsoid",
            "ambient occlusion by long rays", "half floats and bytes, cut", "compensated by pixels")


def pixel_lights(frame, settings):
    """Return the pixel lights of a frame, and the area that each stands for where a clamp needs it."""
    return choose_lights(frame, settings.lights), footprints(frame, settings.lights, with_clamp(settings).pairs)


def as_stored(frame, settings):
    """Return the frame, the lights and the areas that sums read."""
    lights, areas = pixel_lights(frame, settings)
    return (*((frame, lights) if settings.quantisation == "none" else literal.stored(frame, lights)), areas)


def by_literal_text(frame, settings):
    seen, *lights = as_stored(frame, settings)
    light = literal.sii(seen, replaced(settings, {"ambient_occlusion": "none"}), *lights)
    if settings.compensation != "none":
        light = light + literal.compensation(frame, settings.pairs.clamp.value)
    return occluded_of(frame, settings, light)


def tolerance(settings):
    return SLICES if settings.pairs.clamp is not None and settings.pairs.clamp.name() == "sphere" else ROUNDING


def receivers_of(frame):
    return Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))


def test_every_field_has_a_case():
    assert not uncovered(SiiSettings, CASES, BASE) - set(needed(LightSettings))


def test_the_lights_are_of_every_kind():
    """Diffuse, glossy and both, from all three lamps, fewer than texels and of unequal strength."""
    settings = Case({}).settings(SiiSettings, BASE)
    frame = Case({}).seen()
    lights, _ = pixel_lights(frame, settings)
    diffuse, glossy = lights.flux.any(axis=0), lights.lobe_flux.any(axis=0)
    assert (diffuse & glossy).any()
    assert (diffuse & ~glossy).any()
    assert (glossy & ~diffuse).any()
    assert set(lights.map_index) == {0, 1, 2}
    assert lights.flux.shape[1] < lights.drawn
    assert lights.flux.max() > 4 * lights.flux[:, diffuse].max(axis=0).min()


@pytest.mark.parametrize("name", featured(FOLDED, SII))
def test_the_literal_text(name):
    case = FOLDED[name]
    settings, frame = case.settings(SiiSettings, BASE), case.seen()
    expected = by_literal_text(frame, with_clamp(settings))
    np.testing.assert_allclose(sii(frame, settings), expected, rtol=0, atol=tolerance(settings) * expected.max())


@pytest.mark.parametrize("name", CASES)
def test_each_key_counts(name):
    assert_each_key_counts(CASES[name], SiiSettings, sii, BASE, same=ORDER.get(name, 0.0))


@pytest.mark.parametrize("half", [False, True])
def test_lightcuts_reach_the_sum(half):
    """Clusters change the picture, by less than their error, and less for a smaller one."""
    frame = Case({}, frame={"rsm_resolution": 64}).seen()
    base = {"lights.count": 3000, "half_resolution": half}
    full, changes = sii(frame, Case({}).settings(SiiSettings, base)), []
    for error in (0.5, 0.02):
        got = sii(frame, Case({"lightcuts": "bounded", "lightcuts.error": error}).settings(SiiSettings, base))
        changes.append((np.abs(got - full).sum(axis=0) / np.maximum(full.sum(axis=0), 1e-300)).max())
        assert changes[-1] < error
    assert changes[0] > 2 * changes[1] > 1e-6


@pytest.mark.parametrize("share", [0.5, 2.0])
def test_lightcuts_are_chosen_where_they_pay(monkeypatch, share):
    """By an estimate alone, to the bit; the picture says so, and a cut leaves them out."""
    choice = sys.modules["refgi.pairs.lightcuts.cuts"]
    monkeypatch.setattr(choice, "LEAST_LIGHTS", 1000)
    monkeypatch.setattr(choice, "LEAST_PAIRS", 0)
    monkeypatch.setattr(choice, "estimated_share", lambda *_: share)
    case, keys = Case({}, frame={"rsm_resolution": 64, **FINE}), {"lights.count": 3000, "lightcuts.error": 0.3}
    made = METHODS["sii"].light(case.seen(), case.settings(SiiSettings, keys))
    named = {**keys, "lightcuts": "bounded"} if share < 1 else {"lights.count": 3000, "lightcuts": None}
    np.testing.assert_array_equal(made.irradiance, sii(case.seen(), case.settings(SiiSettings, named)))
    stated = made.lightcuts and (made.lightcuts.error, made.lightcuts.share)
    assert stated == ((0.3, share) if share < 1 else None)
    cut = METHODS["sii"].light(case.seen(), case.settings(SiiSettings, {**CUT, **keys}))
    assert cut.lightcuts is None
    few = METHODS["sii"].light(case.seen(), case.settings(SiiSettings, {**keys, "lights.count": 999}))
    assert few.lightcuts is None


def test_a_tree_is_kept_while_lights_rest():
    base = Case({}).settings(SiiSettings, {"lights.count": 300, "lightcuts": "bounded"})
    scene, memory = SCENES["lamps"](), Memory()
    status = []
    for moved in (scene, scene.with_camera(eye=(0.1, *scene.camera.eye[1:])), scene.with_lights(scene.lights[0])):
        with reusing(memory) as runs:
            sii(Frame(moved, width=17, height=13, rsm_resolution=16, dtype=np.float64), base)
        status += [run.status for run in runs if run.name == "pairs.light_tree"]
    assert status == ["ran", "reused", "ran"]


def test_lightcuts_refuse_what_they_do_not_know():
    for keys in ({"reach.cut": "relative"}, {"pairs.clamp": "sphere"}):
        with pytest.raises(InputError, match="lightcuts"):
            Case({"lightcuts": "bounded"}).settings(SiiSettings, keys)


def test_the_ledger_is_that_of_the_full_sum():
    frame = Case({}).seen()
    full, clustered = (sii_ledger(frame, Case({"lightcuts": cuts}).settings(SiiSettings, BASE))
                       for cuts in (None, "bounded"))
    np.testing.assert_array_equal(clustered.arrived, full.arrived)


@pytest.mark.feature("SII-23", "SII-24")
@pytest.mark.parametrize("name", COUNTED)
def test_fragments_are_those_of_the_literal_text(name):
    case = FOLDED[name]
    settings = with_clamp(case.settings(SiiSettings, BASE))
    frame, lights, footprint = as_stored(case.seen(), settings)
    found = fragments(receivers_of(frame), lights, settings, footprint, frame.gbuffer.projection)
    overdraw, of_light = literal.fragments(frame, settings, lights)
    np.testing.assert_array_equal(found.overdraw, overdraw)
    np.testing.assert_array_equal(found.of_light, of_light)
    assert found.total == overdraw.sum()
    tested = fragments(receivers_of(frame), lights, replaced(settings, {"reach.bound": "full"}), footprint)
    parts = sum(np.count_nonzero(flux.any(axis=0)) for flux in (lights.flux, lights.lobe_flux) if flux is not None)
    assert tested.evaluated == frame.gbuffer.covered.sum() * parts


@pytest.mark.feature("SII-23")
def test_the_paper_counts_the_same_fragments():
    """The overdraw of Figure 8 and the counts of Section 6, of a random range."""
    case = CASES["a random share"]
    settings, frame = with_clamp(case.settings(SiiSettings, BASE)), case.seen()
    overdraw, of_light = literal.fragments(frame, settings, pixel_lights(frame, settings)[0])
    np.testing.assert_array_equal(counted(frame, settings).overdraw, overdraw)
    np.testing.assert_array_equal(counted(frame, settings).of_light, of_light)


@pytest.mark.parametrize("name", [name for name in COUNTED if set(COUNTED[name].parts) & set(REACH_CASES)])
def test_what_is_cut_is_that_of_the_literal_text(name):
    case = FOLDED[name]
    settings = with_clamp(case.settings(SiiSettings, BASE))
    frame, lights, footprint = as_stored(case.seen(), settings)
    expected = literal.cut_irradiance(frame, settings, lights, footprint)
    np.testing.assert_allclose(cut_irradiance(receivers_of(frame), lights, settings, footprint), expected, rtol=0,
                               atol=tolerance(settings) * expected.max())


@pytest.mark.parametrize("name", ACCOUNTS)
def test_the_ledger_is_that_of_the_literal_text(name):
    """What settings keep from the visible surface, as sums over pixels of the area that they see."""
    case = CASES[name]
    settings, frame = with_clamp(case.settings(SiiSettings, BASE)), case.seen()
    areas = areas_of(frame)

    def flux(changes):
        return (by_literal_text(frame, replaced(settings, changes)) * areas).sum(axis=(1, 2))

    bare = {"ambient_occlusion": "none"}
    sharp = bare | {"half_resolution": False, "quantisation": "none", "compensation": "none"}
    arrived, seen, at_each_pixel, uncut, full = map(flux, (
        {}, bare, sharp, sharp | {"reach.cut": "none"}, sharp | {"reach.cut": "none", "pairs.clamp": "none"}))
    account = sii_ledger(frame, settings)
    for line, expected in (("arrived", arrived), ("interpolated", at_each_pixel - seen),
                           ("cut", uncut - at_each_pixel), ("clamped", full - uncut)):
        np.testing.assert_allclose(getattr(account, line), expected, rtol=0, atol=ROUNDING * full.max(), err_msg=line)
    shadowed = np.zeros(3) if account.shadowed is None else account.shadowed
    np.testing.assert_allclose(shadowed, seen - arrived, rtol=0, atol=ROUNDING * full.max())


def areas_of(frame):
    """Return the area (h, w) of surface that each pixel sees, m^2."""
    scene, buffer, areas = frame.scene, frame.gbuffer, np.zeros((frame.height, frame.width))
    for i, j in np.argwhere(buffer.covered):
        triangle = scene.geometry.vertices[scene.geometry.faces[buffer.triangle_id[i, j]]]
        areas[i, j] = ledger.area(scene.camera, frame.width, frame.height, i, j, buffer.position[:, i, j], triangle)
    return areas

"""Every setting of `multires` reaches the picture: against the literal text, and against its default."""

import dataclasses
import sys
from functools import cache

import numpy as np
import pytest

from refgi.cluster import val
from refgi.cluster.settings import ValSettings
from refgi.errors import InputError
from refgi.lights.selection import choose_lights, footprints
from refgi.lights.settings import LightSettings
from refgi.literal.multires_lights import detail, halved
from refgi.pairs.settings import DistanceClamp
from refgi.splat import MultiresSettings, multires
from refgi.splat.multires import ByGeometry
from refgi.stages import observe
from tests.literal.whole import multires as literal
from tests.literal.whole import val as clustered
from tests.literal.whole.pairs import occluded_of, with_clamp
from tests.naive.shares import nearest_grid, shares_of
from tests.wiring.cases import Case, assert_each_key_counts, needed, uncovered, under
from tests.wiring.features import MULTIRES, featured
from tests.wiring.fold import fold
from tests.wiring.part_cases import OCCLUSION_CASES, PAIR_CASES, shadow_cases

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # reported: tests/pairs/test_loss

ROUNDING = 1e-9  # of the brightest pixel
SHADOWS_OF_RAYS = 2e-6  # the same, where depths come from rays in float32
RAYS = 1e-5  # receivers of shadow rays are float32
SPHERES = 1e-4  # of a light on its axis: slices of a cone by a Gauss rule (docs/methods/sii_sum)

BASE = {"lights.count": 30, "subsplats.coarsest": 3}
BARE = {"subsplats.criteria.depth": None, "subsplats.criteria.normal": None}
DEPTH = {"subsplats.criteria.normal": None, "subsplats.criteria.depth.threshold": 0.4}  # cells of 1 to 4 pixels
NORMAL = {"subsplats.criteria.depth": None, "subsplats.criteria.normal.threshold": 1.2}
SLOPE = BARE | {"subsplats.criteria.derivative": "slope", "subsplats.criteria.derivative.threshold": 0.3}
SINGLE = {"subsplats": "irradiance"}
SHADOWS = {"subsplats.visibility": "val", "subsplats.visibility.maps": 16, "lights.count": 48,
           "lights.source.pattern": "halton"}
FEW_SHADOWS = SHADOWS | {"subsplats.visibility.clusters.count": 4}
UNCLAMPED = SHADOWS | {"pairs.clamp": None}  # as in val, whose cases these are
FEW = "few lights are summed in full in any case"
STRICT = "so small an error leaves no cluster of a few lights: what larger ones do is told in tests/pairs/lightcuts"
SAME_LIST = "both ways find the same subsplats"

UNDER_SHADOWS = under("subsplats.visibility", shadow_cases("shadow"), UNCLAMPED)
CASES = {
    "geometry": Case({"subsplats.coarsest": 7}, {"subsplats.criteria.depth": None}, frame={"width": 13, "height": 22}),
    "finest": Case({"subsplats.finest": 2}),
    "depth": Case(DEPTH, scene="smooth"),
    "normal": Case(NORMAL, scene="ball"),
    "components": Case({"subsplats.criteria.normal.components": "xy"}, NORMAL, scene="ball"),
    "derivative": Case({"subsplats.criteria.derivative": "slope", "subsplats.criteria.derivative.threshold": 0.3},
                       BARE),
    "chord": Case({"subsplats.criteria.curvature": "chord", "subsplats.criteria.curvature.threshold": 1.45}, BARE,
                  scene="ball"),
    "rate": Case({"subsplats.criteria.curvature": "rate", "subsplats.criteria.curvature.threshold": 8.0}, BARE,
                 scene="ball"),
    "all criteria": Case({"subsplats.criteria.derivative": "slope", "subsplats.criteria.derivative.threshold": 0.4,
                          "subsplats.criteria.curvature": "rate", "subsplats.criteria.curvature.threshold": 10.0},
                         {"subsplats.criteria.depth.threshold": 0.8, "subsplats.criteria.normal.threshold": 1.4},
                         scene="ball"),
    "depth in metres": Case({"subsplats.criteria.depth.measure": "absolute"}, DEPTH),
    "depth of the demo": Case({"subsplats.criteria.depth.measure": "demo"}, DEPTH),
    "derivative in metres": Case({"subsplats.criteria.derivative.measure": "absolute"}, SLOPE),
    "derivative of the demo": Case({"subsplats.criteria.derivative.measure": "demo"}, SLOPE),
    "rim": Case({"subsplats.criteria.rim": 1}, DEPTH),
    "rim of normals": Case({"subsplats.criteria.rim": 1}, NORMAL, scene="ball"),
    "diagonal off": Case({"subsplats.criteria.diagonal": "off"}, DEPTH, scene="smooth"),
    "diagonal literal": Case({"subsplats.criteria.diagonal": "literal"}, DEPTH, scene="smooth"),
    "diagonal full8": Case({"subsplats.criteria.diagonal": "full8"}, DEPTH, scene="smooth"),
    "list": Case({"subsplats.criteria.traversal": "list"}, DEPTH, scene="smooth", same=SAME_LIST),
    "mean": Case({"subsplats.representative": "mean"}, DEPTH),
    "rays": Case({"subsplats.visibility": "rays"}),
    "shadows of clusters": Case({"subsplats.visibility": "val"}),
    "shadows of clusters of unclamped light": Case({"pairs.clamp": None}, FEW_SHADOWS),
    "shadows of clusters of discs as printed": Case({"as_published": {"ams_disc"}}, SHADOWS, scene="bulbs"),
    "shadows of clusters, albedo as printed": Case({"as_published": {"ams_rho_in_splat"}}, DEPTH | SHADOWS),
    "shadows of clusters on smooth surfaces": Case({"subsplats.visibility.shadow": "pcss"}, FEW_SHADOWS,
                                                   scene="smooth"),
    **UNDER_SHADOWS,
    "demo": Case({"subsplats.upsampling": "demo"}, DEPTH),
    "nearest": Case({"subsplats.upsampling": "nearest"}, DEPTH),
    "naive bilinear": Case({"subsplats.upsampling": "naive_bilinear"}, DEPTH),
    "irradiance": Case({"subsplats": "irradiance", "subsplats.threshold": 0.4}),
    "irradiance coarsest": Case({"subsplats.coarsest": 6}, SINGLE | {"subsplats.threshold": 0.4}),
    "irradiance finest": Case({"subsplats.finest": 1}, SINGLE),
    "absolute": Case({"subsplats.form": "absolute"}, SINGLE),
    "brightest": Case({"subsplats.form": "brightest"}, SINGLE | {"subsplats.threshold": 0.5}),
    "shared list first": Case({"subsplats.criteria": "geometry"}, SINGLE | {"subsplats.threshold": 0.5}),
    "shared list of depth": Case({"subsplats.criteria.normal": None, "subsplats.criteria.depth.threshold": 0.3,
                                  "subsplats.criteria.diagonal": "full8"},
                                 SINGLE | {"subsplats.criteria": "geometry", "subsplats.threshold": 0.5}),
    "shared list finest": Case({"subsplats.finest": 1}, SINGLE | {"subsplats.criteria": "geometry"}),
    "irradiance mean": Case({"subsplats.representative": "mean"}, SINGLE),
    "irradiance demo": Case({"subsplats.upsampling": "demo"}, SINGLE),
    "irradiance nearest": Case({"subsplats.upsampling": "nearest"}, SINGLE),
    "irradiance naive bilinear": Case({"subsplats.upsampling": "naive_bilinear"}, SINGLE),
    "detail": Case({"detail": 0.5}),
    "supersampled": Case({"supersampled": True}, {"detail": 0.5}),
    "ams_disc": Case({"as_published": {"ams_disc"}}, {"lights.source.pattern": "halton", "lights.count": 31},
                     scene="bulbs"),
    "ams_disc on a grid": Case({"as_published": {"ams_disc"}}, scene="bulbs"),
    "ams_rho_in_splat": Case({"as_published": {"ams_rho_in_splat"}}, DEPTH),
    "ams_filter_all": Case({"as_published": {"ams_filter_all"}}, DEPTH),
    "irradiance ams_filter_all": Case({"as_published": {"ams_filter_all"}}, SINGLE),
    "demo ams_filter_all": Case({"as_published": {"ams_filter_all"}}, DEPTH | {"subsplats.upsampling": "demo"}),
    "ams_all_corners": Case({"as_published": {"ams_all_corners"}}, SLOPE),
    "as printed": Case({"as_published": {"ams_filter_all", "ams_all_corners"}}, SLOPE),
    "irradiance ams_all_corners": Case({"as_published": {"ams_all_corners"}}, SINGLE),
    "sii_openness": Case({"lights.openness.as_published": {"sii_openness"}}, {"lights.openness.flux": "scale"}),
    "count": Case({"lights.count": 50}),
    "seed": Case({"lights.seed": 7, "lights.source.pattern": "random"}),
    "auto of paths": Case({"lights.source": "walk"}),
    "auto of roulette": Case({"lights.openness.flux": "roulette", "lights.openness.radius": 2.0}),
    "clusters": Case({"lightcuts": "bounded", "lightcuts.error": 1e-6}, same=STRICT),
    "no clusters": Case({"lightcuts": None}, same=FEW),
    "clusters where they pay": Case({"lightcuts.error": 0.3}, same=FEW),
    **under("pairs", PAIR_CASES), **OCCLUSION_CASES,
}
# pictures of so many pixels that not all are samples of the error
WIDE = {"width": 112, "height": 84}
BY_ERROR = {"subsplats": "error", "subsplats.target": 0.02, "lights.count": 12}
PROMISES = {
    "error": Case({"subsplats": "error", "subsplats.target": 0.02}, {"lights.count": 12}, frame=WIDE),
    "error coarsest": Case({"subsplats.coarsest": 25}, BY_ERROR, frame=WIDE),
    "error seed": Case({"lights.seed": 2}, BY_ERROR, frame=WIDE),
    "error distance": Case({"pairs.clamp": DistanceClamp(0.5)}, BY_ERROR, frame=WIDE),
    "error detail": Case({"detail": 0.5}, BY_ERROR, frame=WIDE),
    "error by rays": Case({"subsplats.visibility": "rays"}, BY_ERROR, frame=WIDE),
    "error under shadows of clusters": Case({"subsplats.visibility": "val"}, BY_ERROR | {"lights.count": 40},
                                            frame=WIDE),
}
ALL = CASES | PROMISES


def visibility_of(settings):
    """Return the name of what finds which lights a subsplat sees."""
    found = None if settings.subsplats.name() == "irradiance" else settings.subsplats.visibility
    return "none" if found is None else found.name()


def known(settings):
    """Tell whether the expected picture is: shadows of clusters are those at pixels of the picture's own size."""
    return not (settings.supersampled and visibility_of(settings) == "val")


OWN = {name: case for name, case in CASES.items() if case is not UNDER_SHADOWS.get(name)}
# any two keys of shadows stand together in cases of val
FOLDED = fold(MultiresSettings, OWN, BASE, elsewhere=("pairs.",), fits=known) | {
    f"shadows {name}": case for name, case in fold(MultiresSettings, UNDER_SHADOWS, BASE, elsewhere=("",)).items()}
TOLERANCE = {"clusters": ROUNDING, "rays": RAYS, "error by rays": RAYS, "spheres": SPHERES,
             "maps by rays": SHADOWS_OF_RAYS}


def frame_of(case, scale=1):
    """Return the frame of a case, also at a multiple of its size."""
    options = {"width": 17, "height": 13} | case.frame
    return seen(case.scene, **options | {side: scale * options[side] for side in ("width", "height")})


@cache
def seen(scene, **options):
    """Return a frame that cases share."""
    return Case({}, scene=scene, frame=options).seen()


def pairs_of(settings):
    """Return the pairs with the clamp in use: none with shadow rays where nothing is said."""
    return with_clamp(settings, bare=visibility_of(settings) == "rays").pairs


def lights_of(frame, settings):
    """Return the pixel lights of a frame, and the surface that each stands for, or None."""
    lights = choose_lights(frame, settings.lights)
    areas = footprints(frame, settings.lights, pairs_of(settings))
    if "ams_disc" in settings.as_published:
        areas = demo_areas(frame, settings, lights)
    return lights, areas


def reflected(rsm):
    """Return the flux that a map's surfaces reflect, W, all channels."""
    return float(rsm.flux.sum() + (0 if rsm.lobe_flux is None else rsm.lobe_flux.sum()))


def demo_areas(frame, settings, lights):
    """Return the demo's area of each light; N counts what was drawn from the light's own map, dark texels too."""
    areas, lamps = np.zeros(lights.flux.shape[1]), frame.scene.lights
    shares = shares_of(settings.lights.count, [reflected(rsm) for rsm in frame.rsms])
    for index, (lamp, share) in enumerate(zip(lamps, shares, strict=True)):
        maps = frame.rsms[index].projection.maps
        drawn = nearest_grid(share, maps) if settings.lights.source.pattern == "grid" else share
        mine = lights.map_index == index
        areas[mine] = literal.demo_areas(lights.position[:, mine], lamp.position, drawn)
        assert mine.sum() < drawn  # some draws are dark, else the case would not tell
    return areas


def by_literal_text(case, settings):
    """Return the irradiance that the literal text gives."""
    frame, large = frame_of(case), frame_of(case, 2 if settings.supersampled else 1)
    light_at = under_shadows(frame, settings) if visibility_of(settings) == "val" else light_of(frame, settings)
    light = literal.picture(large.gbuffer, frame.scene.camera.eye, light_at, settings)
    light = halved(light, large.gbuffer.triangle_id, frame.gbuffer.covered) if settings.supersampled else light
    return occluded_of(frame, settings, light)


def light_of(frame, settings):
    """Return the function of places of the pixel lights, with a ray for each pair where the settings ask for it."""
    rays = visibility_of(settings) == "rays"
    return literal.light_of(*lights_of(frame, settings), pairs_of(settings), frame.scene.geometry if rays else None)


def parts_of_val(settings):
    """Return the settings of `val` whose shadows subsplats take."""
    shadows = settings.subsplats.visibility
    return ValSettings(settings.lights, pairs_of(settings), shadows.clusters, shadows.area, shadows.maps,
                       shadows.shadow, as_published=shadows.as_published)


def under_shadows(frame, settings):
    """Return a function of a place: the light of all pixel lights there, under the shadows of their clusters."""
    view = clustered.view_of(frame, parts_of_val(settings), lights_of(frame, settings)[1])
    light = {tuple(place): sums for place, sums in zip(view.position, clustered.every_light(view), strict=True)}
    return lambda x, _: np.array([light[tuple(place)] for place in x.T]).T[None]


def test_every_field_has_a_case():
    """Property: no setting of the method's own is without a case."""
    assert not uncovered(MultiresSettings, ALL, BASE) - set(needed(LightSettings))  # those: test_lights


@pytest.mark.parametrize("name", featured(FOLDED, MULTIRES))
def test_the_literal_text(name, evidence):
    """Oracle: the picture is that of the literal text."""
    case = FOLDED[name]
    settings = case.settings(MultiresSettings, BASE)
    expected = by_literal_text(case, settings)
    off = np.abs(multires(frame_of(case), settings) - expected).max() / expected.max()
    evidence(f"{case.parts}: the picture is {off:.0e} of the brightest pixel off that of the literal text")
    assert off <= max(TOLERANCE.get(part, ROUNDING) for part in case.parts)


@pytest.mark.parametrize("name", PROMISES)
def test_the_promise(name):
    """Oracle: the RMSE to the sum of all lights is within the target, and pixels evaluated one by one are that sum."""
    frame, settings = frame_of(PROMISES[name]), PROMISES[name].settings(MultiresSettings, BASE)
    full, covered = full_sum(frame, settings), frame.gbuffer.covered
    with observe(record=True) as log:
        light = multires(frame, settings)
    split = next(run.output for run in log.runs if run.name == "error_target.error_driven").split
    off = light - full
    assert np.sqrt((off[:, covered] ** 2).mean()) <= settings.subsplats.target * full[:, covered].mean()
    assert len(split) - 1 == literal.coarsest_level(covered.shape, settings.subsplats.coarsest)
    finest = np.kron(split[1], np.ones((2, 2), bool))[:covered.shape[0], :covered.shape[1]] & covered
    assert 0 < finest.sum() < covered.sum()
    assert np.abs(off[:, finest]).max() <= TOLERANCE.get(name, ROUNDING) * full.max()


def full_sum(frame, settings):
    """Return the sum of all lights at every pixel that shows a surface, times the surface detail."""
    unseeded = dataclasses.replace(settings.lights, seed=0)  # a grid needs none
    subsplats = ByGeometry(visibility=settings.subsplats.visibility)
    plain = dataclasses.replace(settings, lights=unseeded, subsplats=subsplats, detail=0.0)
    buffer, eye = frame.gbuffer, np.asarray(frame.scene.camera.eye)[None]
    return detail(sums(frame, plain), buffer.position, buffer.normal, buffer.triangle_id, eye, settings.detail)


@cache
def sums(frame, settings):
    """Return the sum of all lights at every pixel that shows a surface; under shadows of clusters that of `val`."""
    if visibility_of(settings) == "val":
        return val(frame, parts_of_val(settings))
    buffer, full = frame.gbuffer, np.zeros((3, *frame.gbuffer.covered.shape))
    shown = buffer.covered
    full[:, shown] = light_of(frame, settings)(buffer.position[:, shown], buffer.normal[:, shown]).sum(axis=0)
    return full


@pytest.mark.parametrize("name", ALL)
def test_each_key_counts(name):
    """Property: a key put back to its default makes another picture, unless the case says why not."""
    assert_each_key_counts(ALL[name], MultiresSettings, multires, BASE, frame_of(ALL[name]), TOLERANCE.get(name, 0.0))


def cut(error=None, **keys):
    """Return settings with lightcuts of an error, or without."""
    how = {"lightcuts": None} if error is None else {"lightcuts": "bounded", "lightcuts.error": error}
    return Case(how).settings(MultiresSettings, {"lights.count": 3000, "subsplats.coarsest": 3, **keys})


def test_lightcuts_reach_the_subsplats():
    """Clusters change the picture, by less than their error, and less for a smaller one."""
    frame = Case({}, frame={"rsm_resolution": 64}).seen()
    full, changes = multires(frame, cut()), []
    for error in (0.5, 0.02):
        got = multires(frame, cut(error))
        changes.append((np.abs(got - full).sum(axis=0) / np.maximum(full.sum(axis=0), 1e-300)).max())
        assert changes[-1] < error
    assert changes[0] > 2 * changes[1] > 1e-6


def test_lightcuts_are_part_of_an_error(monkeypatch):
    """Pixels are summed by clusters where lights are many; the promise holds, and what clusters may take is in it."""
    frame = Case({}, frame={"rsm_resolution": 64, **WIDE}).seen()
    keys = {"subsplats": "error", "subsplats.target": 0.05, "subsplats.coarsest": 16}
    covered = frame.gbuffer.covered
    full = multires(frame, cut(**{"subsplats.coarsest": 65536}))[:, covered]
    choice = sys.modules["refgi.pairs.lightcuts.cuts"]
    monkeypatch.setattr(choice, "LEAST_LIGHTS", 1000)
    monkeypatch.setattr(choice, "LEAST_PAIRS", 0)
    monkeypatch.setattr(choice, "estimated_share", lambda *_: 0.5)
    auto = Case({}).settings(MultiresSettings, {"lights.count": 3000, **keys})
    with observe() as log:
        picture = multires(frame, auto)[:, covered]
    assert "pairs.lightcuts" in {run.name for run in log.runs}
    assert np.sqrt(((picture - full) ** 2).mean()) < 0.05 * full.mean()
    with observe() as log:
        multires(frame, cut(**keys))
    assert "pairs.lightcuts" not in {run.name for run in log.runs}


def test_lightcuts_are_chosen_where_they_pay(monkeypatch):
    """By an estimate alone: at subsplats the bits of those asked for by name, with an error target a share of it."""
    choice = sys.modules["refgi.pairs.lightcuts.cuts"]
    monkeypatch.setattr(choice, "LEAST_LIGHTS", 1000)
    monkeypatch.setattr(choice, "LEAST_PAIRS", 0)
    monkeypatch.setattr(choice, "TILES", 1)
    monkeypatch.setattr(choice, "estimated_share", lambda *_: 0.5)
    case = Case({}, frame={"rsm_resolution": 64, **WIDE})
    for subsplats, named in (("geometry", 0.3), ("error", 0.005), ("error", 0.001)):
        keys = {"lights.count": 3000, "subsplats": subsplats} | (
            {"subsplats.target": 0.05} if subsplats == "error" else {"subsplats.coarsest": 64})
        own = {"lightcuts.error": named if named != 0.005 else 0.3}
        got = multires(case.seen(), case.settings(MultiresSettings, keys | own))
        asked = case.settings(MultiresSettings, keys | {"lightcuts": "bounded", "lightcuts.error": named})
        np.testing.assert_array_equal(got, multires(case.seen(), asked))


def test_lightcuts_refuse_what_they_do_not_know():
    for keys in ({"subsplats": "irradiance"}, {"subsplats.visibility": "rays"}, {"subsplats.visibility": "val"},
                 {"pairs.clamp": "sphere"}):
        with pytest.raises(InputError, match="lightcuts"):
            cut(0.02, **keys)

"""Stages of clustered visibility: as the method, as their literal forms, and blind to no bug."""

from dataclasses import replace

import numpy as np
import pytest

from refgi.cluster import val
from refgi.frame import Frame
from refgi.stages import observe
from refgi.vectors.bounds import distance, isolated_bounds
from refgi.vectors.cases.visibility import VAL, VAL_FULL, val_settings
from refgi.vectors.leaves import leaves
from refgi.vectors.rows import Form
from refgi.vectors.spec import kind_of, outputs_of
from tests.vectors import made as shared
from tests.vectors.made import named_as_given

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # that is told: tests/pairs/test_loss

ALL = VAL | VAL_FULL
STORED = 1e-5  # of the brightest: float32 between some thirty stages, where one over 1 - V >= 0.02 magnifies it
RANDOM = {"lights.halton_points0.shifts"}
MASKED = 0.01  # of an array's elements, at most
STEPS = 1e-9  # of the largest: float64, in another order of sums; the same magnified
OWN = ("cluster.", "rsm.facing", "rsm.visible_extent", "rsm.illuminated_extent")
WITHOUT_FORM = {"cluster.traced_share"}  # what Embree answers


def made(name):
    """Return a case, its arrays, and the stages of `val` itself."""
    case, known = shared.made(name)
    return case, known, [step for step in case.stages if step.name.startswith(OWN)]


def frame_of(plan):
    width, height = plan.size
    return Frame(plan.scene, width=width, height=height, dtype=np.float64, rsm_resolution=plan.maps)


def bounds(name):
    """Return the bounds of a case's arrays."""
    case, known, steps = made(name)
    return {step.name: isolated_bounds(case, step, known, 1) for step in steps}


def is_off(got, expected, bound):
    """Tell which elements lie beyond their bounds."""
    return (distance(got, expected) > bound.limit) & ~bound.masked


@pytest.mark.feature("VAL-09")
@pytest.mark.parametrize("name", ALL)
def test_the_last_stage_is_the_method(name):
    """Oracle: `val` on a frame of the same scene, in float64."""
    plan = ALL[name]()
    settings = val_settings(plan)
    case, known, steps = made(name)
    picture = val(frame_of(plan), settings)
    last = steps[-1].writes[0]
    assert last == case.stages[-1].writes[0]
    assert kind_of(last) == ("cluster.blur" if settings.interleaving.block > 1 else "cluster.shadowed")
    off = np.abs(picture - known[last]).max() / picture.max()
    assert off <= STORED, off
    assert (case.specs[last].unit, case.specs[last].axes) == ("W/m^2", "rgb, row, column")


@pytest.mark.parametrize("name", ALL)
def test_steps_make_what_their_stage_makes(name):
    """Oracle: the method's own fused stages. Maps on which there is nothing are dropped there."""
    plan, compared = ALL[name](), set()
    with observe(record=True, steps=True) as log:
        val(frame_of(plan), val_settings(plan))
    for run in log.runs:
        steps, whole = dict(leaves(run.steps)), dict(leaves(run.output))
        for leaf in steps.keys() & whole.keys():
            got, expected = steps[leaf], whole[leaf]
            if run.name == "cluster.shadow_maps":
                got = got[whole["map_of"] >= 0]
            compared.add(run.name)
            large = np.abs(expected[np.isfinite(expected)]).max(initial=0.0)
            np.testing.assert_allclose(got, expected, rtol=0, atol=STEPS * large, err_msg=f"{run.name} {leaf}")
    assert compared >= {"frame.visible_extent", "frame.illuminated_extent", "cluster.kmeans", "cluster.area_lights",
                        "cluster.irradiance"} | (
        set() if val_settings(plan).visibility is None or name == "val-rays" else {"cluster.shadow_maps"})


@pytest.mark.parametrize("name", ALL)
def test_the_literal_forms_pass_as_a_port(name):
    """Oracle: the literal forms, stage by stage from stored inputs. They cover every stage of `val`."""
    case, known, steps = made(name)
    assert {kind_of(step.name) for step in steps if not step.variants} <= WITHOUT_FORM
    for step in steps:
        limits = isolated_bounds(case, replace(step, variants=()), known, 1)  # of the method, not of its literal form
        for form in (one for one in step.variants if isinstance(one, Form)):  # others are what else is right
            literal = outputs_of(step, known, np.float64, form)
            for one in step.writes:
                got, expected = literal[one], known[one]
                assert np.shape(got) == expected.shape, one
                off = is_off(got, expected, limits[one])
                assert not off.any(), (step.name, one, int(off.sum()), np.argwhere(off)[:3].tolist())


@pytest.mark.parametrize("name", ALL)
def test_scene_and_views_alone_are_given(name):
    given = made(name)[0].given
    assert [one for one in given if not named_as_given(one) and one not in RANDOM] == []


@pytest.mark.parametrize("name", ALL)
def test_no_cause_is_named_twice_in_a_stage(name):
    for step in made(name)[2]:
        causes = [bug.cause for bug in step.bugs]
        assert len(set(causes)) == len(causes), step.name


def test_arrays_are_told_axes_and_units():
    for name in ALL:
        case, known, steps = made(name)
        for one in (one for step in steps for one in step.writes):
            spec = case.specs[one]
            assert spec.axes.count(",") + 1 == max(1, known[one].ndim), one
            assert "axis " not in spec.axes, one
            assert len(spec.what) > 5, one
    specs = made("val-csm")[0].specs
    assert (specs["cluster.depth_maps"].axes, specs["cluster.depth_maps"].unit) == ("area light, row, column", "m")
    assert specs["cluster.search.region"].axes == "area light, s t radius, row, column"
    assert (specs["cluster.parts"].axes, specs["cluster.parts"].unit) == ("area light, rgb, row, column", "W/m^2")
    assert (specs["cluster.depth_scale.slope"].unit, specs["cluster.csm"].unit) == ("depths per octave", "1")
    assert specs["cluster.mip_levels.1"].axes == "area light, channel, row, column"


def test_few_elements_are_masked():
    for name in ALL:
        for step, found in bounds(name).items():
            if kind_of(step) in WITHOUT_FORM:
                continue
            for one, bound in found.items():
                few = max(1, MASKED * bound.masked.size)  # some have 22 elements
                assert bound.masked.sum() <= few, (name, step, one)


def test_the_cases_hold_what_they_say():
    """Property: clusters of one light, without lights, area lights that nothing occludes, odd sizes, unequal lamps."""
    for name, members, open_, half in (("val-single", 1, True, False), ("val-empty", 0, True, True)):
        known = made(name)[1]
        used = known["cluster.areas.members"] > 0
        assert (known["cluster.areas.members"] == members).any()
        assert np.isinf(known["cluster.map_ranges.near"]).any() == open_
        assert (known["cluster.areas.delta"][used] > 0).any() == half
    known = made("val-empty")[1]
    place = known["lights.pixel_lights.position"]
    assert len(np.unique(place, axis=1).T) < place.shape[1]
    for name in ("val-csm", "val-interleaved"):
        known = made(name)[1]
        flux, lamp = known["lights.pixel_lights.flux"], known["lights.pixel_lights.map_index"]
        power = [flux[:, lamp == k].sum() for k in range(2)]
        assert max(power) > 1.5 * min(power) > 0
    height, width = made("val-interleaved")[1]["rsm.visible_triangles"].shape
    assert height % 3
    assert width % 3
    for name, share in (("val-csm", "csm"), ("val-pcss", "pcss"), ("val-interleaved", "depth_tests")):
        known = made(name)[1]
        behind, share = behind_a_map(known), known[f"cluster.{share}"]
        assert behind.any()
        assert (share[behind] == 1).all()
        assert ((share > 0.02) & (share < 0.98)).mean() > 0.05


@pytest.mark.parametrize(("name", "share"), [("val-dual", "depth_tests"), ("val-csm-dual", "csm"),
                                             ("val-pcss-dual", "pcss")])
def test_either_map_of_both_hemispheres_shadows_pixels(name, share):
    known = made(name)[1]
    ahead, behind = known[f"cluster.{share}0"], known[f"cluster.{share}1"]
    assert min((one < 0.9).sum() for one in (ahead, behind)) > 5
    if name == "val-csm-dual":  # the picture shows it
        assert ((behind < 0.9) & known["cluster.parts"].any(axis=1)).any()
    assert (ahead[behind_a_map(known)] == 1).all()
    assert (behind[~behind_a_map(known)] == 1).all()


def behind_a_map(known):
    away = known["rsm.surface.position"] - known["cluster.map_views.center"][:, :, None, None]
    covered = known["rsm.visible_triangles"] >= 0
    return (np.einsum("kc,kcij->kij", known["cluster.areas.frame"][:, 2], away) < -1e-3) & covered

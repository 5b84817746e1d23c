"""Stages of clustered visibility: as the method, as their literal forms, and blind to no bug."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from refgi.cluster import val
from refgi.frame import Frame
from refgi.vectors.bounds import distance, isolated_bounds
from refgi.vectors.cases.val import FULL_SETUPS, SETUPS
from refgi.vectors.spec import expected_of, outputs_of

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # that is told: tests/pairs/test_loss

ALL = SETUPS | FULL_SETUPS
STORED = 1e-5  # of the brightest: float32 between some thirty stages, where one over 1 - V >= 0.02 magnifies it
MASKED = 0.01  # of an array's elements, at most


@cache
def made(name):
    """Return a case, its arrays, and the stages of `val` itself, which follow those of buffers and lights."""
    case = ALL[name].case()
    first = [step.name for step in case.stages].index("extents")
    return case, expected_of(case), case.stages[first:]


def bounds(name):
    """Return the bounds of a case's arrays."""
    case, known, steps = made(name)
    return {step.name: isolated_bounds(case, step, known, 1) for step in steps}


def is_off(got, expected, bound):
    """Tell which elements lie beyond their bounds."""
    return (distance(got, expected) > bound.limit) & ~bound.masked


@pytest.mark.parametrize("name", ALL)
def test_the_last_stage_is_the_method(name):
    """Oracle: `val` on a frame of the same scene, in float64."""
    setup = ALL[name]
    case, known, steps = made(name)
    width, height = setup.size
    frame = Frame(setup.scene, width=width, height=height, dtype=np.float64, rsm_resolution=setup.maps)
    picture = val(frame, setup.settings)
    last = steps[-1].writes[0]
    assert last == ("blur.irradiance" if setup.settings.interleaving.block > 1 else "sum.irradiance")
    off = np.abs(picture - known[last]).max() / picture.max()
    assert off <= STORED, off
    assert case.specs[last].unit == "W/m^2"


@pytest.mark.parametrize("name", ALL)
def test_the_literal_forms_pass_as_a_port(name):
    """Oracle: the literal forms, stage by stage from stored inputs. They cover every stage of `val`."""
    case, known, steps = made(name)
    for step in steps:
        limits = isolated_bounds(case, replace(step, variants=()), known, 1)  # of the method, not of its literal form
        literal = outputs_of(step, known, np.float64, step.variants[-1])
        for one in step.writes:
            got, expected = literal[one], known[one]
            assert np.shape(got) == expected.shape, one
            off = is_off(got, expected, limits[one])
            assert not off.any(), (step.name, one, int(off.sum()), np.argwhere(off)[:3].tolist())


@pytest.mark.parametrize("name", ALL)
def test_no_cause_is_named_twice_in_a_stage(name):
    for step in made(name)[2]:
        causes = [bug.cause for bug in step.bugs]
        assert len(set(causes)) == len(causes), step.name


def test_few_elements_are_masked():
    for name in ALL:
        for step, found in bounds(name).items():
            for one, bound in found.items():
                assert bound.masked.sum() <= MASKED * bound.masked.size, (name, step, one)


def test_the_cases_hold_what_they_say():
    """Property: clusters of one light, without lights, area lights that nothing occludes, odd sizes, unequal lamps."""
    for name, members, open_, half in (("val-single", 1, True, False), ("val-empty", 0, True, True)):
        known = made(name)[1]
        used = known["areas.members"] > 0
        assert (known["areas.members"] == members).any()
        assert np.isinf(known["maps.near"]).any() == open_
        assert (known["areas.delta"][used] > 0).any() == half
    known = made("val-empty")[1]
    assert len(np.unique(known["lights.position"], axis=1).T) < known["lights.position"].shape[1]
    for name in ("val-csm", "val-interleaved"):
        known = made(name)[1]
        power = [known["lights.flux"][:, known["lights.map"] == k].sum() for k in range(2)]
        assert max(power) > 1.5 * min(power) > 0
    height, width = made("val-interleaved")[1]["gbuffer.triangle_id"].shape
    assert height % 3
    assert width % 3
    for name in ("val-csm", "val-pcss", "val-interleaved"):
        known = made(name)[1]
        behind = behind_a_map(known)
        assert behind.any()
        assert (known["visibility.share"][behind] == 1).all()
        share = known["visibility.share"]
        assert ((share > 0.02) & (share < 0.98)).mean() > 0.05


def behind_a_map(known):
    away = known["gbuffer.position"] - known["maps.center"][:, :, None, None]
    covered = known["gbuffer.triangle_id"] >= 0
    return (np.einsum("kc,kcij->kij", known["areas.frame"][:, 2], away) < -1e-3) & covered

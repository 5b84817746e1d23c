"""The literal text passes the kit as a port that reads its own outputs, stage by stage."""

import numpy as np
import pytest

from refgi.pairs.pixel_lights import PixelLights
from refgi.pairs.settings import PairSettings
from refgi.settings import of, replaced
from refgi.vectors.cases import kit_cases
from refgi.vectors.check import ALL_WITHIN, Asked, check_output
from refgi.vectors.forms import described
from refgi.vectors.spec import kind_of, stored
from tests.vectors.literal_port import form_of, written

QUICK = tuple(kit_cases("quick"))
WITHOUT_FORM = {"cluster.traced_share": "what Embree answers of rays to points of a rectangle",
                "sssil.senders": "drawn by numbers that are hashes of pixels, made inside"}


@pytest.mark.parametrize("name", QUICK)
def test_the_literal_text_passes_on_its_own_outputs(kit, tmp_path, evidence, name):
    """Chained; on the kit's inputs it is held to narrower limits in the tests of each method's stages."""
    case = next(one for one in kit.cases(Asked(cases=(name,))) if one.id == name)
    own, bare, covered = {}, set(), 0
    (tmp_path / name).mkdir()
    for step in kit_cases("quick")[name]().stages:
        made = written(step, {one: own[one] if one in own else kit.array(case, one) for one in step.reads})
        if made is None:
            bare.add(kind_of(step.name))
            continue
        covered += 1
        for one, array in made.items():
            own[one] = stored(array)
            np.save(tmp_path / name / f"{one}.npy", own[one])
    result = check_output(kit, tmp_path, Asked(chained=True, cases=(name,)))
    wrong = [(one.stage, [array for array in one.arrays if array.verdict != "within"], one.causes)
             for one in result.stages if one.verdict in ("out", "invalid")]
    assert not wrong
    assert bare <= WITHOUT_FORM.keys()
    if covered:
        assert result.exit_code == ALL_WITHIN
    worst = max((array.worst or 0.0 for one in result.stages for array in one.arrays), default=0.0)
    evidence(f"{name}, chained: {covered} stages within, worst {worst:.2g} bounds")


@pytest.mark.slow
def test_every_stage_of_the_full_kit_has_a_form_but_those_named():
    steps = [step for make in kit_cases("full").values() for step in make().stages]
    assert {kind_of(step.name) for step in steps if form_of(step) is None} == WITHOUT_FORM.keys()


@pytest.mark.parametrize(("changes", "covered"), [
    ({}, True), ({"clamp": "disc"}, True), ({"clamp": "distance", "clamp.value": 0.1}, False),
    ({"clamp": "geometry", "clamp.value": 10.0}, False), ({"clamp": "sphere"}, False), ({"offset": 0.01}, False),
    ({"lobe.widening": 0.1}, False), ({"lobe.norm": "none"}, False),
    ({"as_published": frozenset({"sii_no_pi"})}, False)])
def test_sums_that_the_literal_text_does_not_know_have_no_form(changes, covered):
    one = np.ones((3, 2))
    arguments = {"lights": PixelLights(one, one, one, None, None, None, 2), "lightcuts": None,
                 "settings": replaced(of(PairSettings, clamp="none"), changes)}
    assert (described("pairs.sum", arguments).form is not None) is covered


def test_stages_without_a_literal_form_have_none():
    assert described("scene.load", {}).form is None

"""Stages of pixel lights in the kit: the literal text is what they do."""

import pytest

from refgi.vectors.cases.sii import QUICK
from tests.vectors.splat_ports import expect_literal, made

OWN = ("points", "importance", "warp", "texels")


@pytest.mark.parametrize("id", [*QUICK, "sii-smooth", "sii-large", "multires-no-flux", "vpl-sun"])
def test_the_literal_text_is_the_stage(id):
    names = [step.name for step in made(id)[0].stages if step.name in ("lights", "footprints") or (
        step.name.startswith("rsm") and step.name.split(".")[1] in OWN)]
    assert len(names) > 1
    for name in names:
        expect_literal(id, name)

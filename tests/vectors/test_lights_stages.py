"""Stages of pixel lights in the kit: the literal text is what they do."""

import pytest

from refgi.vectors.cases.sii import FULL, QUICK
from tests.vectors.splat_ports import expect_literal, stages_of


@pytest.mark.parametrize("id", [*QUICK, *FULL])
def test_the_literal_text_is_the_stage(id):
    names = stages_of(id, "lights.")
    assert len(names) > 1
    for name in names:
        expect_literal(id, name)

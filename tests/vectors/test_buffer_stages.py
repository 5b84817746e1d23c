"""Oracle tests of the kit's buffers and direct light: the literal text that bugs are put into gives what stages do."""

from functools import cache

import numpy as np
import pytest

from refgi.vectors.bounds import large_value
from refgi.vectors.cases import hssil, sii
from refgi.vectors.spec import expected_of, kind_of, outputs_of

CASES = {**sii.QUICK, "sii-smooth": sii.FULL["sii-smooth"], "sii-ramp": {**sii.QUICK, **sii.FULL}.get("sii-ramp"),
         **{name: {**hssil.QUICK, **hssil.FULL}[name] for name in hssil.VIEWS}}
SINGLE = 2.0**-22  # of an array's largest value: what storage in float32 leaves
FEW = 4.0  # times as much for integrals: refgi's rules of 4 and 8 nodes
EDGES = 0.004  # share of texels whose centre lies on an edge to rounding, of points at a shadow's edge
LIMIT = {"gbuffer.ids": 0.0, "rsm.ids": 0.0, "before.ids": 0.0, "shadow": 0.0, "gbuffer.surface": SINGLE,
         "rsm.surface": SINGLE, "before.surface": SINGLE, "rsm.flux": FEW * SINGLE, "direct": SINGLE}


@cache
def made(name):
    """Return a case and all its arrays."""
    case = CASES[name]()
    return case, expected_of(case)


@pytest.mark.parametrize("name", CASES)
def test_literal_text_without_a_bug_gives_what_the_stage_does(name):
    case, known = made(name)
    for step in case.stages:
        if kind_of(step.name) in LIMIT:
            limit = LIMIT[kind_of(step.name)]
            for key, found in outputs_of(step, known, np.float64, step.variants[0]).items():
                expected = known[key]
                if not limit:
                    assert (found != expected).mean() <= EDGES, key
                    continue
                finite = np.isfinite(expected)
                np.testing.assert_array_equal(np.isfinite(found), finite)
                off = np.abs(found[finite].astype(np.float64) - expected[finite]).max(initial=0.0)
                assert off <= limit * large_value(expected), key

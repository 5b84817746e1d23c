"""What the tests of the kit's stages share: cases, bounds, and a port's arrays judged by them."""

from functools import cache

import numpy as np

from refgi.vectors.bounds import distance, isolated_bounds
from refgi.vectors.cases import kit_cases
from refgi.vectors.rows import Form
from refgi.vectors.spec import expected_of, outputs_of, stored

CASES = kit_cases("full")
SAME = 2e-6  # of an element and of its array's largest: places in float32, whose rounding near lights magnify
DECIDED = 2e-3  # share of an array's elements that the rounding of float64 decides: rays along edges
LARGEST_MASK = 0.05  # share of an array's elements that rounding may decide


@cache
def made(id):
    """Return a case of the full kit and its arrays."""
    case = CASES[id]()
    return case, expected_of(case)


@cache
def bounds_of(id, name):
    """Return the bounds of one stage's arrays."""
    return isolated_bounds(made(id)[0], stage_of(id, name), made(id)[1], seed=1)


def stage_of(id, name):
    return next(stage for stage in made(id)[0].stages if stage.name == name)


def stages_of(id, start):
    """Return the names of the stages that start with a word."""
    return [stage.name for stage in made(id)[0].stages if stage.name.startswith(start)]


def named_as_given(name):
    """Return whether an array is the scene's, a lamp's or a view's."""
    return name.startswith(("scene.", "materials.")) or ".projection." in name or ".lamp." in name


def expect_within(id, name, got):
    known = made(id)[1]
    for array, bound in bounds_of(id, name).items():
        assert got[array].shape == known[array].shape
        out = (distance(stored(got[array]), known[array]) > bound.limit)[~bound.masked]
        assert not out.any(), f"{id}, {name}: {array}"


def masked_shares(id, start):
    """Return the share of masked elements of each array of the stages that start with a word."""
    return {array: float(bound.masked.mean()) for name in stages_of(id, start)
            for array, bound in bounds_of(id, name).items() if bound.masked.size}


def expect_literal(id, name, same=SAME, decided=DECIDED):
    """Expect that the literal text of a stage makes what the stage does, but for a share of elements."""
    known, step = made(id)[1], stage_of(id, name)
    form = next((one for one in step.variants if isinstance(one, Form)), None)
    assert form is not None, (id, name)
    for array, got in outputs_of(step, known, np.float64, form).items():
        expected = known[array]
        assert got.shape == expected.shape, (id, array)
        finite = np.isfinite(expected)
        large = np.abs(expected[finite].astype(float)).max(initial=0)
        near = np.isclose(got.astype(float), expected.astype(float), rtol=same, atol=same * large)
        assert np.count_nonzero(~near) <= decided * near.size, (id, array, np.mean(~near))

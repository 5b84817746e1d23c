"""Oracle tests of the kit's buffers: the literal forms that bugs are put into have none of their own."""

from functools import cache

import numpy as np
import pytest

from refgi.rsm.buffers.light_projection import light_projection
from refgi.rsm.raster.projection import camera_projection
from refgi.vectors.bounds import large_value
from refgi.vectors.bugs.direct import literal_direct
from refgi.vectors.bugs.flux_form import literal_flux
from refgi.vectors.bugs.ids import literal_ids
from refgi.vectors.bugs.surface import literal_surface
from refgi.vectors.bugs.views import view_of
from refgi.vectors.cases import hssil, sii
from refgi.vectors.spec import expected_of

CASES = {**sii.QUICK, "sii-smooth": sii.FULL["sii-smooth"], **{name: hssil.QUICK[name] for name in ("hssil-default",)}}
SINGLE = 2.0**-22  # of an array's largest value: what storage in float32 leaves
FEW = 4.0  # times as much for integrals: refgi's rules of 4 and 8 nodes
EDGES = 0.004  # share of texels whose centre lies on an edge to rounding


@cache
def made(name):
    """Return a case and all its arrays."""
    case = CASES[name]()
    return case, expected_of(case)


def views(name):
    """Yield each view's prefix of arrays, the name of what it sees and its maps."""
    case, _ = made(name)
    camera = case.facts["camera"]
    yield "camera", "gbuffer", camera_projection(case.scene.camera, camera["columns"], camera["rows"])
    for index, light in enumerate(case.scene.lights):
        rsm = f"rsm{index}"
        if rsm in case.facts:
            yield rsm, rsm, light_projection(light, case.scene.geometry, case.facts[rsm]["columns"])


@pytest.mark.parametrize("name", CASES)
def test_literal_ids_without_a_bug_are_the_rasterizers(name):
    _, known = made(name)
    for view, seen, maps in views(name):
        ids = literal_ids(known, view_of(known, view, maps))
        assert (ids != known[f"{seen}.triangle_id"]).mean() <= EDGES


@pytest.mark.parametrize("name", CASES)
def test_literal_surfaces_without_a_bug_are_those_of_the_gbuffer(name):
    _, known = made(name)
    for view, seen, maps in views(name):
        surface = literal_surface(known, known[f"{seen}.triangle_id"], view_of(known, view, maps))
        for key, found in surface.items():
            if f"{seen}.{key}" in known:
                expected = known[f"{seen}.{key}"]
                np.testing.assert_array_equal(np.isfinite(found), np.isfinite(expected))
                finite = np.isfinite(expected)
                assert np.abs(found[finite] - expected[finite]).max(initial=0.0) <= SINGLE * large_value(expected)


@pytest.mark.parametrize("name", [name for name in CASES if name.startswith("sii")])
def test_literal_flux_without_a_bug_is_that_of_the_map(name):
    case, known = made(name)
    for view, seen, maps in views(name):
        if view != "camera":
            light = case.scene.lights[int(view[-1])]
            flux = literal_flux(known, seen, (f"light{view[-1]}", light), view_of(known, view, maps))
            for key, found in flux.items():
                if f"{seen}.{key}" in known:
                    expected = known[f"{seen}.{key}"]
                    assert np.abs(found - expected).max() <= FEW * SINGLE * large_value(expected), key


@pytest.mark.parametrize("name", hssil.VIEWS)
def test_literal_direct_light_without_a_bug_is_the_stages(name):
    case = {**hssil.QUICK, **hssil.FULL}[name]()
    known = expected_of(case)
    found = literal_direct(known, [(f"light{k}", light) for k, light in enumerate(case.scene.lights)])
    expected = known["direct.irradiance"]
    assert np.abs(found - expected).max() <= SINGLE * large_value(expected)

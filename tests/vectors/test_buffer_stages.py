"""Oracle tests of the kit's buffers: the literal forms that bugs are put into have none of their own."""

from functools import cache

import numpy as np
import pytest

from refgi.literal.colours import tint
from refgi.rsm.buffers.light_projection import light_projection
from refgi.rsm.raster.projection import camera_projection
from refgi.scene import load_scene
from refgi.vectors.bounds import distance, isolated_bounds, large_value
from refgi.vectors.bugs.direct import literal_direct
from refgi.vectors.bugs.flux_form import literal_flux
from refgi.vectors.bugs.ids import literal_ids
from refgi.vectors.bugs.surface import literal_surface
from refgi.vectors.bugs.views import view_of
from refgi.vectors.cases import hssil, sii
from refgi.vectors.scenefile import write_scene
from refgi.vectors.spec import expected_of, outputs_of

CASES = {**sii.QUICK, "sii-smooth": sii.FULL["sii-smooth"], **{name: hssil.QUICK[name] for name in ("hssil-default",)}}
SINGLE = 2.0**-22  # of an array's largest value: what storage in float32 leaves
FEW = 4.0  # times as much for integrals: refgi's rules of 4 and 8 nodes
EDGES = 0.004  # share of texels whose centre lies on an edge to rounding


@cache
def made(name):
    """Return a case and all its arrays."""
    case = {**CASES, **sii.FULL, **hssil.FULL}[name]()
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


def test_colours_are_linear_between_the_corners_of_a_triangle():
    vertices, faces = np.array([[0.0, 0, 0], [2, 0, 1], [0, 2, 3]]), np.array([[0, 1, 2]])
    colours = np.array([[[1.0, 0, 0], [0, 1, 0], [0, 0, 1]]])  # a corner's share is its channel
    shares = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0.5, 0], [0.2, 0.3, 0.5]])
    ids = np.array([[0, 0, 0, 0, 0], [-1] * 5])
    points = np.stack([(shares @ vertices).T] * 2, axis=1)
    found = tint(ids, points, vertices, faces, colours)
    np.testing.assert_allclose(found[:, 0], shares.T, atol=1e-15)
    assert not found[:, 1].any()


@pytest.mark.parametrize(("name", "stages"), [("sii-colours", ["gbuffer.surface", "rsm0.flux", "rsm1.flux"]),
                                              ("hssil-colours", ["gbuffer.surface"])])
def test_literal_vertex_colours_without_a_bug_are_the_stages(name, stages):
    case, known = made(name)
    steps = [step for step in case.stages if "scene.colours" in step.reads]
    assert [step.name for step in steps] == stages
    for step in steps:
        for array, found in outputs_of(step, known, np.float64, step.variants[-1]).items():
            finite = np.isfinite(known[array])
            off = np.abs(found[finite] - known[array][finite]).max()
            assert off <= SINGLE * large_value(known[array]), array


def test_every_likely_bug_of_vertex_colours_is_told():
    case, known = made("sii-colours")
    told = {}
    for step in case.stages:
        bounds = isolated_bounds(case, step, known, 1) if "scene.colours" in step.reads else {}
        for bug in step.bugs if bounds else ():
            bad = outputs_of(step, known, np.float64, bug.run)
            told[step.name, bug.cause] = any((distance(bad[name], known[name]) > bound.limit).any()
                                             for name, bound in bounds.items())
    assert [bug for bug, is_told in told.items() if not is_told] == []
    assert len(told) == 17 + 2 * 18


def test_a_coloured_scene_is_written_for_other_programs(tmp_path):
    case, known = made("sii-colours")
    write_scene(case.scene, (8, 6), tmp_path)
    loaded = load_scene(tmp_path / "scene.json")
    np.testing.assert_array_equal(loaded.geometry.colours.astype(np.float32), known["scene.colours"])
    np.testing.assert_array_equal(loaded.geometry.vertices[loaded.geometry.faces].astype(np.float32),
                                  known["scene.vertices"][known["scene.faces"]])

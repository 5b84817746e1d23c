"""Oracle tests of the kit's buffers and direct light: the literal text that bugs are put into gives what stages do."""

import numpy as np
import pytest

from refgi.literal.buffers import tint
from refgi.scene import load_scene
from refgi.vectors.bounds import distance, isolated_bounds, large_value
from refgi.vectors.cases.hssil import FULL_PLANS, QUICK_PLANS
from refgi.vectors.cases.splat import SII
from refgi.vectors.spec import kind_of, outputs_of
from refgi.vectors.standalone import write_scene
from tests.vectors.made import made

CASES = (*SII, "sii-smooth", *QUICK_PLANS, *FULL_PLANS)
SINGLE = 2.0**-22  # of an array's largest value: what storage in float32 leaves
FEW = 4.0  # times as much for integrals: refgi's rules of 4 and 8 nodes
EDGES = 0.004  # share of texels whose centre lies on an edge to rounding, of points at a shadow's edge
LIMIT = {"gbuffer.ids": 0.0, "rsm.ids": 0.0, "before.ids": 0.0, "shadow": 0.0, "gbuffer.surface": SINGLE,
         "rsm.surface": SINGLE, "before.surface": SINGLE, "rsm.flux": FEW * SINGLE, "direct": SINGLE,
         "rsm.visible_triangles": 0.0, "rsm.reflected_flux": FEW * SINGLE}


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


def test_colours_are_linear_between_the_corners_of_a_triangle():
    vertices, faces = np.array([[0.0, 0, 0], [2, 0, 1], [0, 2, 3]]), np.array([[0, 1, 2]])
    colours = np.array([[[1.0, 0, 0], [0, 1, 0], [0, 0, 1]]])  # a corner's share is its channel
    shares = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0.5, 0], [0.2, 0.3, 0.5]])
    ids = np.array([[0, 0, 0, 0, 0], [-1] * 5])
    points = np.stack([(shares @ vertices).T] * 2, axis=1)
    found = tint(ids, points, vertices, faces, colours)
    np.testing.assert_allclose(found[:, 0], shares.T, atol=1e-15)
    assert not found[:, 1].any()


@pytest.mark.parametrize(("name", "stages"), [
    ("sii-colours",
     ["rsm.map_surface0", "rsm.reflected_flux0", "rsm.map_surface1", "rsm.reflected_flux1", "rsm.surface"]),
    ("hssil-colours", ["rsm.surface"])])
def test_literal_vertex_colours_without_a_bug_are_the_stages(name, stages):
    case, known = made(name)
    steps = [step for step in case.stages if any("vertex colours" in bug.cause for bug in step.bugs)]
    assert [step.name for step in steps] == stages
    for step in steps:
        for array, found in outputs_of(step, known, np.float64, step.variants[0]).items():
            finite = np.isfinite(known[array])
            off = np.abs(found[finite] - known[array][finite]).max()
            assert off <= SINGLE * large_value(known[array]), array


def test_every_likely_bug_of_vertex_colours_is_told():
    case, known = made("sii-colours")
    told = {}
    for step in case.stages:
        bugs = [bug for bug in step.bugs if "colour" in bug.cause or "barycentric" in bug.cause]
        bounds = isolated_bounds(case, step, known, 1) if bugs else {}
        for bug in bugs:
            bad = outputs_of(step, known, np.float64, bug.run)
            told[step.name, bug.cause] = any((distance(bad[name], known[name]) > bound.limit).any()
                                             for name, bound in bounds.items())
    assert [bug for bug, is_told in told.items() if not is_told] == []
    assert len(told) == 3 * 17 + 2 * 18


def test_a_coloured_scene_is_written_for_other_programs(tmp_path):
    case, known = made("sii-colours")
    write_scene(case.scene, (8, 6), tmp_path)
    loaded = load_scene(tmp_path / "scene.json")
    np.testing.assert_array_equal(loaded.geometry.colours.astype(np.float32), known["scene.colours"])
    np.testing.assert_array_equal(loaded.geometry.vertices[loaded.geometry.faces].astype(np.float32),
                                  known["scene.vertices"][known["scene.faces"]])

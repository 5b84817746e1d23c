"""Clusters that move with their lights, and what each step of a frame took: without the whole paper."""

import itertools
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

import refgi.stages
from benchmarks.papers.val import frames as whole_frames
from benchmarks.papers.val.clusters import moved
from benchmarks.papers.val.moving import mean_motion, motion
from benchmarks.papers.val.subjects import HORSE, clustered_along, drawing, frame_of, published, scene_of, settings_of
from refgi.stages import observe
from tests.benchmarks.papers.conftest import PAPER_STEPS, table

STAGES_OF_STEPS = {
    "deferred rendering": {"rsm.gbuffer", "rsm.rasterize", "rsm.resolve", "rsm.facing", "rsm.shadow_map_visibility",
                           "rsm.direct_irradiance", "rsm.lamp_irradiance", "frame.visible_extent",
                           "frame.illuminated_extent", "frame.compose"},
    "VPL generation": {"rsm.reflective_shadow_map", "rsm.solid_angles", "lights.draw", "lights.shares",
                       "lights.choose"},
    "VAL clustering": {"cluster.kmeans", "cluster.area_lights"},
    "CSSM": {"cluster.shadow_maps", "cluster.blockers", "cluster.occluders", "cluster.distances",
             "cluster.seen_vertices"},
    "indirect illumination": {"cluster.irradiance", "pairs.clamp_loss"},
    "geometry-aware blur": {"cluster.blur"}}
HALF_THE_STEP = 0.08  # how far from one half the motion under half the step may be: lights of single texels pass edges


@pytest.mark.feature("VAL-25")
def test_centres_move_with_their_lights_and_jump_where_these_are_exchanged(bench, evidence):
    """Under half the step between frames the largest step of a centre halves as well, of a cluster that keeps its
    lights; k-means that gives lights to another cluster moves both by as much as ever, if less often.
    """
    diagonal = frame_of(bench, HORSE).scene.geometry.diagonal
    along = {}
    for count in (17, 33):
        upper = moved(bench, scene_of(bench, HORSE), count)[count // 2 : count]  # on the ceiling alone at its end
        along[count] = clustered_along(upper, settings_of(bench), warm=False)
    means = [mean_motion([motion(*pair, diagonal) for pair in pairwise(found)]) for found in along.values()]
    (kept, exchanged), (kept_half, exchanged_half) = (centre_steps(found, diagonal) for found in along.values())
    share = [len(one) / (len(one) + len(other)) for one, other in ((exchanged, kept), (exchanged_half, kept_half))]
    evidence(f"largest step of a centre that keeps its lights {kept.max():.1f} % of the diagonal a frame, under half "
             f"the step {kept_half.max():.1f} %; of one that exchanges some {exchanged.max():.1f} and "
             f"{exchanged_half.max():.1f} %, {share[0]:.0%} and {share[1]:.0%} of all; in the mean of all centres "
             f"{means[0].typical:.2f} and {means[1].typical:.2f} %, of lights {means[0].lights:.2f} and "
             f"{means[1].lights:.2f} %")
    assert abs(kept_half.max() / kept.max() - 0.5) < HALF_THE_STEP
    assert abs(means[1].typical / means[0].typical - 0.5) < HALF_THE_STEP
    assert means[1].typical < 2 * means[1].lights
    assert exchanged_half.max() > 0.6 * exchanged.max()  # jumps: they do not shrink
    assert exchanged_half.max() > 1.5 * kept_half.max()
    assert share[1] < 0.9 * share[0]


def centre_steps(found, diagonal):
    """Return how far centres move from frame to frame, % of the diagonal: with the same lights, and with others."""
    kept, exchanged = [], []
    for before, after in pairwise(found):
        for k in range(len(before.clusters.members)):
            mine, theirs = before.clusters.of == k, after.clusters.of == k
            if not (mine.any() and theirs.any()):
                continue
            step = np.linalg.norm(after.clusters.center[:, k] - before.clusters.center[:, k])
            same = np.array_equal(before.lights.texel[mine], after.lights.texel[theirs])
            (kept if same else exchanged).append(100 * step / diagonal)
            if same:  # a mean of points moves no farther than the one that moves farthest
                lights = after.lights.position[:, theirs] - before.lights.position[:, mine]
                assert step <= np.linalg.norm(lights, axis=0).max() + 1e-6 * diagonal
    return np.array(kept), np.array(exchanged)


@pytest.mark.feature("VAL-26")
@pytest.mark.filterwarnings("ignore:.* of the indirect light")
def test_table_2_holds_what_each_step_took(bench, monkeypatch, evidence):
    """With a clock that counts how often it is asked, a stage takes 1 and another 1 for each stage right inside it."""
    rows = table(whole_frames.steps(bench))
    draw = drawing(bench, scene_of(bench, HORSE), published(bench, scene_of(bench, HORSE)))
    draw()
    with observe() as log:
        draw()
    runs = [run for run in log.runs if run.status == "ran"]
    assert {run.name for run in runs} == set().union(*STAGES_OF_STEPS.values())
    expected = {step: sum(1 + insides(runs, k) for k, run in enumerate(runs) if run.name in names)
                for step, names in STAGES_OF_STEPS.items()}
    clock = SimpleNamespace(perf_counter=map(float, itertools.count()).__next__)
    for module in (whole_frames, refgi.stages):
        monkeypatch.setattr(module, "time", clock)
    counted = {name: row["Cornell Horse, interleaved, ms"] for name, row in table(whole_frames.steps(bench)).items()}
    assert {step: counted[step] for step in PAPER_STEPS} == {step: 1e3 * ticks for step, ticks in expected.items()}
    assert counted["frame"] == 1e3 * (1 + 2 * len(runs))
    assert counted["all else"] == 1e3 * (1 + sum(run.depth == 0 for run in runs))
    assert rows["geometry-aware blur"]["Cornell Horse, all lights, ms"] == 0
    evidence("Table 2 at 32 x 32, here and in the paper: " + ", ".join(
        f"{name} {rows[name]['Cornell Horse, interleaved, %']:.0f} and {rows[name]['%, paper']:.0f} %"
        for name in PAPER_STEPS))


def insides(runs, k):
    """Count the stages right inside one: those a level deeper, up to the next that is not inside."""
    after = itertools.takewhile(lambda run: run.depth > runs[k].depth, runs[k + 1 :])
    return sum(run.depth == runs[k].depth + 1 for run in after)

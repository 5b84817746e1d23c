"""Every figure of the screen-space paper, made tiny: what it holds, and that printed numbers are its own."""

import dataclasses
import math

import numpy as np
import pytest

from benchmarks.papers.hssil.error import STEPS
from benchmarks.papers.hssil.judged import settings_of_figure_5
from benchmarks.papers.hssil.levels import SHOWN, covered, parts_of, profile, scan_line
from benchmarks.papers.hssil.setups import SETUPS
from benchmarks.papers.hssil.subjects import (
    BASKET,
    BOX,
    LARGE,
    SPOT,
    every_texel,
    frame_of,
    reach_of,
    scene_of,
    settings_of,
    side_views,
    smaller,
    wide_frame,
)
from benchmarks.papers.hssil.temporal import left
from benchmarks.papers.workbench import FULL, Workbench, seen_by
from refgi.frame import Frame
from refgi.scene import load_scene
from refgi.settings import of, replaced
from refgi.sssil import HssilSettings
from refgi.sssil.settings import PRESETS, TemporalSettings
from tests.benchmarks.papers.conftest import table
from tests.sssil.counting import COUNTED, reads_of_levels

pytestmark = pytest.mark.slow  # the whole paper is made

PRINTED = {  # Figure 6: sampling, upsampling, compositing, total, on the 8800 GTS and the GTX 260, ms
    "quarter, 4 levels, 64 samples": (7.1, 2.3, 5.7, 1.7, 1.1, 0.6, 13.9, 4.6),
    "quarter, 4 levels, 256 samples": (26.8, 8.9, 5.7, 1.7, 1.1, 0.6, 33.6, 11.2),
    "half, 4 levels, 256 samples": (102.4, 29.9, 7.1, 2.1, 1.1, 0.6, 110.6, 32.6),
    "half, 4 levels, 64 samples": (26.6, 7.8, 7.1, 2.1, 1.1, 0.6, 34.8, 10.5),
    "half, 5 levels, 64 samples": (26.8, 7.85, 7.2, 2.1, 1.1, 0.6, 35.1, 10.55)}
ADDED_UP = 0.05 + 1e-9  # ms: sums of numbers that were rounded to 0.1
ROUNDING = 1e-5  # float32: upsampling six levels, one by one and together
SHAPE = 0.02  # how far the coverage of a whole crown may be from one: circles cut its texels


@pytest.fixture
def figures(reproduced):
    return reproduced("hssil")[1]


def test_the_papers_numbers_are_the_printed_ones(figures):
    figure = figures["fig6"]
    paper = figure.tables[0].paper
    assert {row[0]: tuple(row[k] for k in paper) for row in figure.tables[0].rows} == PRINTED
    for setup in SETUPS:
        for card in (0, 1):
            parts = setup.gather[card] + setup.upsampling[card] + setup.compositing[card]
            assert abs(parts - setup.total[card]) < ADDED_UP
    ratios = {bar.label: bar.paper for bar in figure.ratios[0].bars}
    assert ratios["quarter, 4 levels, 256 samples"] == pytest.approx(8.9 / 2.3)


def test_a_full_run_has_the_papers_sizes():
    full = Workbench(FULL)
    timed, judged = wide_frame(full, BASKET), frame_of(full, BASKET, LARGE)
    assert (timed.width, timed.height) == (1280, 720)
    assert (judged.width, judged.height) == (720, 720)
    assert settings_of(timed) == PRESETS["paper"]
    assert settings_of_figure_5(judged) == replaced(PRESETS["paper"], {"radius": 40.0, "start": "full",
                                                                       "pattern": "pixel"})


def test_smaller_pictures_reach_as_much_by_fewer_levels():
    full = Workbench(FULL)
    published = reach_of(wide_frame(full, BASKET), settings_of(wide_frame(full, BASKET)))
    assert published == pytest.approx(640 / math.hypot(1280, 720))
    for factor, levels in ((1 / 2, 2), (1, 3), (2, 4)):
        frame = frame_of(full, BASKET, factor)
        settings = smaller(frame)
        assert reach_of(frame, settings) == pytest.approx(published)
        assert settings.sampling.levels == levels
        assert 20 / math.sqrt(2) <= settings.sampling.radius <= 20 * math.sqrt(2)


def test_stand_ins_are_kept_and_frames_fit_the_run(bench):
    assert frame_of(bench, BOX, 0.5) is frame_of(bench, BOX, 0.5)
    assert scene_of(bench, BOX) is scene_of(bench, BOX)
    frame = seen_by(bench, scene_of(bench, BOX), 0.5, wide=2, shadows="exact")
    assert (frame.width, frame.height, frame.rsm_resolution, frame.shadows) == (32, 16, 32, "exact")


@pytest.mark.feature("HSS-05")
def test_levels_cover_each_distance_once(evidence):
    """Closed form: 1 everywhere within the last circle, but where circles cut texels."""
    settings = of(HssilSettings, radius=8.0, levels=3, samples=64)
    every = profile(covered(every_texel(settings), 1))
    drawn = profile(covered(settings, 2048))
    assert every[0] == 0.0  # the receiver itself
    for low, high in ((2, 14), (18, 28), (36, 56)):
        np.testing.assert_allclose(every[low:high], 1.0, atol=1e-12)
        assert np.mean(drawn[low:high]) == pytest.approx(1.0, abs=SHAPE)
    assert max(every) < 1.5
    evidence(f"coverage by distance: 1 within crowns, {min(every[1:-9]):.2f} to {max(every):.2f} where circles cut "
             f"texels; 64 samples in the mean of 2048 rows {np.mean(drawn[1:60]):.3f}")


@pytest.mark.feature("HSS-07")
def test_levels_add_up_to_the_picture(bench, evidence):
    frame = wide_frame(bench, SPOT)
    parts = parts_of(frame, settings_of(frame, levels=6))
    assert len(parts.single) == 6
    assert all(light.any() for light in parts.single[:SHOWN])
    assert parts.apart < ROUNDING
    evidence(f"Fig. 4: four levels one by one add up to their picture to {parts.apart:.1g} of its largest value")


@pytest.mark.feature("HSS-18")
def test_a_line_runs_through_both_form_factors_and_path_tracing(figures, evidence):
    figure = figures["fig5"]
    rows = table(figure)
    assert rows["path tracing, v = 1"]["RMSE"] == 0
    assert rows["Eq. 4, every texel"]["RMSE"] < rows["Eq. 4, 64 samples"]["RMSE"] < rows["Eq. 3, 64 samples"]["RMSE"]
    assert rows["Eq. 4, every texel"]["darker by"] > rows["Eq. 3, every texel"]["darker by"]
    assert rows["Eq. 4, 64 samples"]["noise"] < rows["Eq. 3, 64 samples"]["noise"]
    for equation in ("Eq. 3", "Eq. 4"):
        assert rows[f"{equation}, 1024 samples"]["noise"] < rows[f"{equation}, 64 samples"]["noise"] / 2
    assert figure.plots[0].svg.count("<path") > 6
    evidence("Fig. 5 at 45 x 45, RMSE against path tracing of what is seen, v = 1: " + ", ".join(
        f"{name} {row['RMSE']:.0f} %" for name, row in rows.items() if name.startswith("Eq")))


def test_a_scan_line_is_a_row():
    light = np.zeros((3, 4, 5))
    light[:, 2] = np.arange(5)
    curve = scan_line("row", light, 2)
    assert list(curve.x) == [0, 1, 2, 3, 4]
    assert curve.y == pytest.approx([0, 1, 2, 3, 4])


@pytest.mark.feature("HSS-19")
def test_the_first_level_has_most_samples(figures, evidence):
    """The figure's shares are those of the pairs that the method adds up at half resolution."""
    shape = Frame(load_scene("cornell_box"), width=640, height=360, rsm_resolution=64)
    reads = np.array(reads_of_levels(shape, replaced(PRESETS["paper"], {"levels": 5})))
    share = 100 * reads / reads.sum()
    told = [row["% of the samples"] for row in table(figures["fig7"]).values()]
    evidence(f"Fig. 7: of all samples the five levels have {', '.join(f'{one:.2f}' for one in share)} %, the figure "
             f"says {', '.join(f'{one:.2f}' for one in told)} %")
    assert told == pytest.approx(list(share), rel=0.1)  # levels of 40 x 23 and 20 x 12 are rounded up
    assert told[0] == pytest.approx(share[0], rel=COUNTED)
    assert share[0] > 70  # as the paper says of the time
    assert share[4] < 1


def test_the_camera_does_not_see_the_baskets_lit_side(bench):
    scene = scene_of(bench, BASKET)
    lamp = scene.with_lights(scene.lights[0])
    front = frame_of(bench, BASKET, wide=2)
    lit = [seen_by(bench, dataclasses.replace(lamp, camera=camera), wide=2).direct.sum()
           for camera in (front.scene.camera, *side_views())]
    assert lit[0] < 0.05 * min(lit[1:])


@pytest.mark.feature("HSS-15")
def test_more_cameras_bring_light_back(figures, evidence):
    rows = table(figures["fig9"])
    one = rows["one camera"]["light"]
    others = {name: row["light"] for name, row in rows.items() if "besides" in name}
    assert all(light >= one for light in others.values())
    assert others["two side views besides"] > 2 * one
    evidence(f"Fig. 9, light in % of path tracing in which nothing blocks: one camera {one:.0f}, " + ", ".join(
        f"{name} {light:.0f}" for name, light in others.items()))


@pytest.mark.feature("HSS-13")
def test_the_filter_takes_noise_away(figures, evidence):
    a = TemporalSettings().weight
    assert left(a, 2)[1] == pytest.approx(a**2 + (1 - a) ** 2)  # two frames
    assert left(0.9, 3) == pytest.approx([1.0, 0.82, 0.674], abs=5e-4)
    assert left(a, 500)[-1] == pytest.approx((1 - a) / (1 + a))
    rows = table(figures["temporal"])
    kept = {name: row["variance left, %"] for name, row in rows.items()}
    assert kept["resting camera, recursive"] < kept["resting camera, as printed"]
    assert rows["resting camera, recursive"]["found again, %"] == 100
    assert rows["resting camera, recursive"]["flicker"] < rows["resting camera, each frame alone"]["flicker"]
    evidence("variance left after 4 frames of 12 x 21 pixels: " + ", ".join(
        f"{name} {share:.0f} %" for name, share in kept.items()))


@pytest.mark.feature("HSS-17")
def test_rays_take_light_away(figures, evidence):
    rows = table(figures["visibility"])
    for scene in ("Cornell Horse", "hall"):
        free, rays = (rows[f"{scene}, {way}"]["mean, W/m²"] for way in ("v = 1, as published", "a ray to each sample"))
        assert rays < free
    extra = [picture for picture in figures["visibility"].pictures if picture.name.endswith("_extra")]
    assert len(extra) == 2
    evidence(f"over-brightness maps of {len(extra)} scenes; v = 1 against rays, mean: " + ", ".join(
        f"{name} {row['mean, W/m²']:.3g} W/m²" for name, row in rows.items() if "path" not in name))


def test_the_split_leads_to_the_published_picture(figures):
    rows = table(figures["error"])
    assert len(rows) == len(STEPS)  # a step between each two, and all together
    for scene in ("Cornell Box", "Cornell Horse", "hall"):
        steps = [row[f"{scene}, mean"] for name, row in rows.items() if name != "all together"]
        assert sum(steps) == pytest.approx(rows["all together"][f"{scene}, mean"])

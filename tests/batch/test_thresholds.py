"""Thresholds on results made by hand: which hold, and how the others are told."""

import pytest

from refgi.batch.plan import broken, figure_of, read_threshold
from tests.batch.made import path_of, result_of, run_of, scene_of

RESULT = result_of(
    scene_of("box", [run_of("sii", ("lights=16",), rmse=0.4, relmse=0.3, picture="a.exr"),
                     run_of("sii", ("lights=64",), rmse=0.2, unoccluded=0.1, ssim=0.9, picture="b.exr")],
             [run_of("truth", ("samples=48",), rmse=0.05)]),
    scene_of("hall@0", [run_of("val", rmse=0.1)]), scene_of("hall@1", [run_of("val", rmse=0.3)]),
    scene_of("hallway", [run_of("val", rmse=0.9)]),
    paths=(path_of("hall", "val", flicker=0.2, lag=1.5), path_of("hallway", "val", flicker=9.0)))


def places(key, text):
    threshold = read_threshold(key, text, ("box", "hall", "hallway"), {"sii", "val", "truth"}, "plan.toml")
    return [finding.place for finding in broken([threshold], RESULT)]


SMALL, LARGE = "box.sii (lights=16)", "box.sii (lights=64)"


@pytest.mark.parametrize(("key", "text", "expected"), [
    ("box.sii.rmse", "<= 0.4", []),
    ("box.sii.rmse", "< 0.4", [SMALL]),
    ("box.sii.rmse", ">= 0.4", [LARGE]),
    ("box.sii.rmse", "> 0.4", [SMALL, LARGE]),
    ("box.sii.lights=16.rmse", "< 0.3", [SMALL]),
    ("box.sii.lights=8.rmse", "< 0.3", ["box.sii.lights=8.rmse"]),
    ("box.sii.lights=64.ssim", "> 0.8", []),
    ("box.sii.lights=16.ssim", "> 0.8", [SMALL]),
    ("box.sii.lights=64.rmse_unoccluded", "<= 0.1", []),
    ("box.truth.rmse", "< 0.01", ["box.truth (samples=48)"]),
    ("hall.val.rmse", "< 0.2", ["hall@1.val (default)"]),
    ("hall.val.lag", "< 1", ["hall.val (default)"]),
    ("hall.val.default.flicker", "< 1", []),
    ("box.sii.lag", "< 1", ["box.sii.lag"]),
])
def test_which_thresholds_are_broken(key, text, expected):
    assert places(key, text) == expected


def test_what_is_said_of_a_broken_threshold():
    threshold = read_threshold("box.sii.rmse", "<= 0.31", ("box",), {"sii"}, "plan.toml")
    finding, = broken([threshold], RESULT)
    assert str(finding) == "box.sii (lights=16): rmse is 0.4, expected <= 0.31; a.exr"


def test_a_part_of_a_batch_need_not_hold_all_figures():
    missing, present = (read_threshold(f"box.sii.{label}rmse", "< 0.3", ("box",), {"sii"}, "plan.toml")
                        for label in ("lights=8.", ""))
    assert [finding.place for finding in broken([missing, present], RESULT, whole=False)] == [SMALL]


def test_figures_of_a_run():
    run = run_of("sii", rmse=0.4, unoccluded=0.2, seconds=(3.0, 1.0, 1.5), flip=0.25)
    expected = {"rmse": 0.4, "bias": 0.1, "spread": 0.05, "noise": 0.01, "rmse_unoccluded": 0.2, "seconds": 1.5,
                "flip": 0.25, "relmse": None}
    assert {figure: figure_of(run, figure) for figure in expected} == expected
    assert figure_of(run_of("sii"), "rmse_unoccluded") is None

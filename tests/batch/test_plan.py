"""Plans: what they say, and one error for each thing that cannot be used."""

import pytest

from refgi.batch.plan import Threshold, broken, figure_of, read_plan, read_threshold
from refgi.errors import InputError
from refgi.sssil.settings import TemporalSettings
from refgi.truth import TruthSettings
from tests.batch.made import path_of, result_of, run_of, scene_of

WHOLE = """
[batch]
scenes = ["atrium:faces=2000", "parts/room.json"]
size = [64, 48]
rounds = 4
rsm_resolution = 128
path = "way.toml"
frames = 7
truth = {samples = 48, visibility = false}
temporal = {weight = 0.8}

[truth]
passes = [2]

[sii]
lights = [16, 64]

[expect]
"atrium.sii.relmse" = "<= 0.31"
"room.sii.lights.count=16, a.seconds" = ">2e-1"
"""


def plan_of(tmp_path, text):
    (tmp_path / "plan.toml").write_text(text)
    return read_plan(tmp_path / "plan.toml")


def test_everything_that_a_plan_says(tmp_path):
    plan = plan_of(tmp_path, WHOLE)
    assert plan.scenes == {"atrium": "atrium:faces=2000", "room": str(tmp_path / "parts/room.json")}
    assert (plan.size, plan.rounds, plan.rsm_resolution, plan.frames) == ((64, 48), 4, 128, 7)
    assert plan.path == str(tmp_path / "way.toml")
    assert plan.truth == TruthSettings(samples=48, visibility=False)
    assert plan.temporal == TemporalSettings(weight=0.8)
    assert [choice.label for choice in plan.grid.choices] == ["lights=16", "lights=64"]
    assert plan.grid.passes == (2,)
    assert plan.thresholds == (
        Threshold("atrium.sii.relmse", "atrium", "sii", None, "relmse", "<=", 0.31),
        Threshold("room.sii.lights.count=16, a.seconds", "room", "sii", "lights.count=16, a", "seconds", ">", 0.2))


def test_what_a_plan_need_not_say(tmp_path):
    plan = plan_of(tmp_path, '[batch]\nscenes = {big = "cornell_box"}\nsize = 32\n[gather]\n')
    assert plan.scenes == {"big": "cornell_box"}
    assert (plan.size, plan.rounds, plan.path, plan.temporal, plan.thresholds) == ((32, 32), 3, None, None, ())
    assert plan.truth == TruthSettings()
    assert plan_of(tmp_path, '[batch]\nscenes = ["cornell_box"]\n[gather]\n').size is None


def test_a_plan_runs_something(tmp_path):
    with pytest.raises(InputError, match="a table of some method"):
        plan_of(tmp_path, '[batch]\nscenes = ["cornell_box"]\n')
    assert plan_of(tmp_path, '[batch]\nscenes = ["cornell_box"]\n[truth]\npasses = [2]\n').grid.passes == (2,)


@pytest.mark.parametrize(("change", "said"), [
    (("[batch]", "[batches]"), r"\[batch\]"),
    (("rounds = 4", "rounds = 0"), "batch.rounds"),
    (("rounds = 4", "round = 4"), "batch.round"),
    (("[64, 48]", "[64, 48, 3]"), r"\[width, height\]"),
    (('"parts/room.json"', '"atrium"'), "different names"),
    (('scenes = ["atrium:faces=2000", "parts/room.json"]', "scenes = []"), "one or more"),
    (('["atrium:faces=2000", "parts/room.json"]', '{"a/b" = "atrium", room = "x.json"}'), "slashes"),
    (('path = "way.toml"', ""), "expected a path"),
    (("samples = 48", "samlpes = 48"), "samlpes"),
    (("weight = 0.8", "weight = 8"), "weight"),
    (("lights = [16, 64]", "ligths = 16"), "ligths"),
    (('"atrium.sii', '"atrum.sii'), "a scene of the plan"),
    (('"atrium.sii', '"atrium.val'), "a method of the plan"),
    (("sii.relmse", "sii.relmes"), "a figure at the end"),
    (("<= 0.31", "<= 0.3.1"), "a comparison"),
])
def test_what_cannot_be_used_is_one_error_that_names_file_and_key(tmp_path, change, said):
    assert change[0] in WHOLE
    with pytest.raises(InputError, match=said) as error:
        plan_of(tmp_path, WHOLE.replace(*change))
    assert "plan.toml" in str(error.value)


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

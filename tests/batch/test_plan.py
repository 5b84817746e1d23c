"""Plans: what they say, and one error for each thing that cannot be used."""

import pytest

from refgi.batch.plan import Threshold, read_plan
from refgi.errors import InputError
from refgi.sssil.settings import TemporalSettings
from refgi.truth import TruthSettings

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

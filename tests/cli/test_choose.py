"""`refgi choose`: what is chosen, said and written; wishes that cannot be."""

import json
import shlex
from pathlib import Path

import pytest
from click.testing import CliRunner

from refgi.batch.plan import read_plan
from refgi.bench import choose
from refgi.bench import grid as tracks
from refgi.bench.choose import Probe
from refgi.bench.grid import Choice, Track
from refgi.cli.group import VerbGroup
from refgi.truth import TruthSettings
from tests.cli.command import runner

SMALL = ("cornell_box", "--size", "24x18", "--methods", "sii,truth", "--rounds", "1", "--threads", "2")
TRUTH = ("--set", "samples=96")
run = runner("choose")


def test_an_error_is_met_and_the_line_renders(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = run(*SMALL, *TRUTH, "--error", "60%", "--methods", "sii", "--json", "--emit", "plan.toml")
    assert done.exit_code == 0, done.output
    found = json.loads(done.stdout)
    assert found["wish"] == {"error": 0.6, "seconds": None}
    assert found["best"] in found["judged"]
    assert found["best"]["error"] <= 0.6
    assert all(one["seconds"] >= found["best"]["seconds"] for one in found["judged"] if one["error"] <= 0.6 * 0.97)
    assert {one["method"] for one in found["small"]} == {"sii"}
    assert {"stage": "pairs.lobes", "reason": "no pixel light is glossy"} in found["skips"]
    rendered = CliRunner().invoke(VerbGroup.refgi(), shlex.split(found["line"])[1:])
    assert rendered.exit_code == 0, rendered.output
    plan = read_plan(tmp_path / "plan.toml")
    assert (plan.scenes, plan.size) == ({"cornell_box": "cornell_box"}, (24, 18))
    (choice,) = plan.grid.choices
    assert choice.method == found["best"]["method"] == "sii"
    assert sorted(choice.changes) == sorted(found["best"]["changes"])


def test_a_path_tracer_that_is_chosen_is_planned_by_its_passes(tmp_path, monkeypatch):
    (tmp_path / "plans").mkdir()
    room = Path(__file__).parents[2] / "docs" / "examples" / "room.json"
    best = Probe(Choice("truth", ("samples=96",), TruthSettings(samples=96)), 1.0, 0.1)
    monkeypatch.setattr(choose, "choose", lambda *_, **__: choose.Chosen(choose.Found(best, (best,), ()), (), "none"))
    done = run(room, "--time", "2s", "--emit", tmp_path / "plans" / "plan.toml")
    assert done.exit_code == 0, done.output
    plan = read_plan(tmp_path / "plans" / "plan.toml")
    assert (plan.grid.passes, plan.grid.choices) == ((4,), ())
    assert Path(plan.scenes["room"]).resolve() == room.resolve()


def test_a_time_is_kept(monkeypatch):
    (track,) = tracks.built_in_tracks(["truth"])
    monkeypatch.setattr(tracks, "built_in_tracks", lambda _: (Track(track.rungs[:3], track.values[:3]),))
    done = run(*SMALL, *TRUTH, "--time", "60s", "--json")
    assert done.exit_code == 0, done.output
    found = json.loads(done.stdout)
    assert found["best"]["changes"] == [f"samples={track.values[2]}"]  # nearest of what is fast enough
    assert found["best"] in found["judged"]
    assert found["best"]["seconds"] <= 60


def test_what_nothing_meets_is_said():
    done = run(*SMALL, *TRUTH, "--methods", "gather", "--error", "1%")
    assert done.exit_code == 1
    assert "nothing meets an error of 1 %" in done.stdout
    assert "nearest on the small picture" in done.stdout


def test_the_path_tracer_has_the_truths_bounces(monkeypatch):
    asked = []
    monkeypatch.setattr(choose, "for_error", lambda tracks, *_: asked.extend(tracks) or choose.Found(None, (), ()))
    assert run(*SMALL, *TRUTH, "--set", "bounces=2", "--set", "seconds=9", "--methods", "truth", "--error", "9%"
               ).exit_code == 1
    (track,) = asked
    assert {rung.settings.bounces for rung in track.rungs} == {2}
    assert [rung.settings.samples for rung in track.rungs] == list(track.values)
    assert {(rung.settings.seconds, rung.settings.target_error) for rung in track.rungs} == {(None, None)}


@pytest.mark.parametrize(("arguments", "said"), [
    ([], "one of the two"),
    (["--error", "3%", "--time", "50ms"], "one of the two"),
    (["--error", "-3%"], "a share such as"),
    (["--error", "3 cm"], "a share such as"),
    (["--time", "0"], "a time such as"),
    (["--time", "5 min"], "a time such as"),
    (["--error", "3%", "--methods", "siii"], "siii"),
    (["--error", "3%", "--set", "samplse=3"], "samplse"),
])
def test_wrong_wishes_are_one_clear_error_before_anything_runs(monkeypatch, arguments, said):
    monkeypatch.setattr(choose, "choose", lambda *_, **__: pytest.fail("ran"))
    done = run("cornell_box", *arguments)
    assert done.exit_code == 2
    assert said in done.stderr


def test_a_plan_that_is_there_stays(tmp_path, monkeypatch):
    monkeypatch.setattr(choose, "choose", lambda *_, **__: pytest.fail("ran"))
    (tmp_path / "plan.toml").write_text("mine")
    done = run("cornell_box", "--error", "3%", "--emit", tmp_path / "plan.toml")
    assert done.exit_code == 2
    assert (tmp_path / "plan.toml").read_text() == "mine"


@pytest.mark.parametrize(("text", "seconds"), [("50ms", 0.05), ("0.05 s", 0.05), ("2", 2.0), ("1e3us", 1e-3)])
def test_times_have_units(monkeypatch, text, seconds):
    asked = []

    def stopped(_scene, _tracks, wish, **_):
        asked.append(wish)
        return choose.Chosen(choose.Found(None, (), ()), (), "none")

    monkeypatch.setattr(choose, "choose", stopped)
    run("cornell_box", "--time", text)
    assert asked[0].seconds == pytest.approx(seconds)

"""`refgi batch`: files, resuming, parts, thresholds, baselines, exit codes, wrong plans."""

import json
import subprocess

import pytest

from refgi.batch import code, schedule, work
from refgi.bench import measure
from refgi.bench.results import Result
from refgi.compare.metrics import Flip
from refgi.errors import InputError
from refgi.image import is_from_refgi
from tests.cli.command import runner

PLAN = """
[batch]
scenes = ["cornell_box"]
size = [24, 18]
rounds = 1
rsm_resolution = 32
truth = {samples = 48}
[sii]
lights = [16, 64]
[gather]
samples = 20
"""
run = runner("batch")


@pytest.fixture(autouse=True)
def no_flip(monkeypatch):
    """FLIP starts a process for each picture."""
    monkeypatch.setattr(measure, "flip", lambda *_: Flip(0.25))


@pytest.fixture
def plan(tmp_path):
    (tmp_path / "plan.toml").write_text(PLAN)
    return tmp_path / "plan.toml"


@pytest.fixture
def did(monkeypatch):
    """Jobs in the order in which they are done."""
    outcome_of, jobs = work.outcome_of, []

    def call(job, *rest):
        jobs.append(job.label.removeprefix("cornell_box "))
        return outcome_of(job, *rest)

    monkeypatch.setattr(work, "outcome_of", call)
    return jobs


ALL = ["sii (lights=16)", "sii (lights=64)", "gather (samples=20)"]


def results(out):
    return Result.model_validate_json((out / "results.json").read_text())


def test_a_batch_and_what_goes_on_where_it_was(tmp_path, plan, did):
    out = tmp_path / "out"
    done = run(plan, "--out", out)
    assert done.exit_code == 0, done.output
    assert f"3 jobs: 3 done now, 0 were there, 0 without a picture -> {out}" in done.stdout
    assert did == ALL
    files = [file for file in out.rglob("*") if file.is_file()]
    assert len(files) == 3 + 3 + 3 + 2 + 2 + 1  # tables, results, pictures, truths as pictures and in the store, ids
    assert all(map(is_from_refgi, files))
    before = results(out)
    assert [one.label for one in before.scenes[0].runs] == ["lights=16", "lights=64", "samples=20"]
    assert all((out / one.picture).exists() for one in before.scenes[0].runs)
    again = run(plan, "--out", out)
    assert "0 done now, 3 were there" in again.stdout
    assert results(out).scenes == before.scenes
    next(iter((out / "jobs").iterdir())).write_text("{")
    assert "1 done now, 2 were there" in run(plan, "--out", out).stdout
    assert len(did) == 4


def test_shards_do_all_between_them(tmp_path, plan, did):
    for part in (1, 2):
        assert run(plan, "--out", tmp_path / "out", "--shard", f"{part}/2").exit_code == 0
    assert did == [ALL[0], ALL[2], ALL[1]]
    assert len(results(tmp_path / "out").scenes[0].runs) == 3
    assert "0 done now" in run(plan, "--out", tmp_path / "out").stdout


def test_a_dry_run_does_nothing(tmp_path, plan, did, monkeypatch):
    monkeypatch.setattr(schedule, "SIZES", (16, 24))
    done = run(plan, "--out", tmp_path / "out", "--dry-run", "--json")
    assert done.exit_code == 0
    said = json.loads(done.stdout)
    assert (said["jobs"], [one["label"] for one in said["open"]]) == (3, [f"cornell_box {one}" for one in ALL])
    assert said["seconds"] > 0
    assert said["truth_seconds"] > 0
    assert said["bytes"] > 24 * 18 * 100
    assert not (tmp_path / "out").exists()
    assert did == []
    run(plan, "--out", tmp_path / "out", "--shard", "1/3")
    text = run(plan, "--out", tmp_path / "out", "--dry-run").stdout
    assert text.startswith("3 jobs on 1 frames; 2 have no result\nabout ")


def test_errors_are_results_until_they_are_retried(tmp_path, plan, did, monkeypatch):
    timed = work._timed

    def refusing(job, *rest):
        if job.choice.method == "gather":
            raise InputError("refused here")
        return timed(job, *rest)

    with monkeypatch.context() as patch:
        patch.setattr(work, "_timed", refusing)
        done = run(plan, "--out", tmp_path / "out", "--format", "github")
    assert done.exit_code == 1
    assert "cornell_box gather: samples=20 gave no picture: refused here" in done.stderr
    assert "::error title=refgi%3A no picture::cornell_box gather: samples=20 gave" in done.stdout
    still = run(plan, "--out", tmp_path / "out")
    assert still.exit_code == 1
    assert "0 done now, 3 were there, 1 without" in still.stdout
    fixed = run(plan, "--out", tmp_path / "out", "--retry-failed")
    assert fixed.exit_code == 0
    assert "1 done now, 2 were there, 0 without" in fixed.stdout
    assert did == [*ALL, ALL[2]]


def test_thresholds_and_a_baseline_fail_the_batch(tmp_path, plan, did):
    out = tmp_path / "out"
    run(plan, "--out", out)
    plan.write_text(PLAN + '[expect]\n"cornell_box.sii.rmse" = "<= 0.01"\n"cornell_box.gather.flip" = "< 0.3"\n')
    done = run(plan, "--out", out, "--format", "github")
    assert done.exit_code == 1
    found = results(out).scenes[0].runs[0]
    assert f"refgi: cornell_box.sii (lights=16): rmse is {found.rmse:.4g}, expected <= 0.01; {found.picture}" in (
        done.stderr)
    assert done.stdout.count("::error title=refgi%3A cornell_box.sii") == 2
    assert len(did) == 3
    plan.write_text(PLAN)
    earlier = tmp_path / "earlier"
    earlier.mkdir()
    content = json.loads((out / "results.json").read_text())
    first = content["scenes"][0]["runs"][0]
    first["errors"]["truth"]["rmse"] *= 0.9
    first["hashes"][2][1] = "another"
    (earlier / "results.json").write_text(json.dumps(content))
    assert run(plan, "--out", out, "--baseline", earlier / "results.json", "--tolerance", "12%").exit_code == 0
    done = run(plan, "--out", out, "--baseline", earlier / "results.json", "--tolerance", "0.1", "--json")
    assert done.exit_code == 1
    finding, = json.loads(done.stdout)["findings"]
    assert (finding["place"], finding["figure"]) == ("cornell_box.sii (lights=16)", "rmse")
    assert finding["stage"] == first["hashes"][2][0]
    assert finding["pictures"] == [first["picture"], f"before: {earlier / first['picture']}"]


def test_since_a_commit_only_what_reaches_changed_code(tmp_path, plan, did, monkeypatch):
    repository = tmp_path / "repository"
    changed = code.changed_methods

    def changed_there(*arguments):
        with monkeypatch.context() as patch:
            patch.setattr(code, "PACKAGE", repository)
            patch.setattr(code, "file_of", lambda name: repository / f"{name}.py")
            patch.setattr(code, "reached", lambda place: {"shared", place.partition(":")[0].rpartition(".")[2]})
            return changed(*arguments)

    monkeypatch.setattr(code, "changed_methods", changed_there)
    repository.mkdir()
    for name in ("sii", "gather", "shared"):
        (repository / f"{name}.py").write_text("x = 1\n")
    for words in (["init", "-q"], ["add", "."], ["-c", "user.name=a", "-c", "user.email=a@b", "commit", "-qm", "a"]):
        subprocess.run(["git", *words], cwd=repository, check=True)
    (repository / "gather.py").write_text("x = 2\n")
    (repository / "sii.py").write_text('"""A docstring."""\nx = 1  # and a comment\n')
    done = run(plan, "--out", tmp_path / "out", "--since", "HEAD")
    assert done.exit_code == 0, done.output
    assert did == ALL[2:]
    assert "sii: unchanged since HEAD" in done.stderr
    assert "gather: changed since HEAD (gather)" in done.stderr
    (repository / "shared.py").unlink()
    assert run(plan, "--out", tmp_path / "out", "--since", "HEAD").exit_code == 0
    assert did == [ALL[2], ALL[0], ALL[1]]
    wrong = run(plan, "--out", tmp_path / "out", "--since", "none")
    assert wrong.exit_code == 2
    assert "--since" in wrong.stderr


@pytest.mark.parametrize(("arguments", "said"), [
    (["--shard", "3/2"], "2/8"),
    (["--shard", "0/2"], "2/8"),
    (["--tolerance", "-1"], "0.02 or 2%"),
    (["--workers", "0"], "workers"),
    (["--baseline", "none.json"], "none.json: cannot be read"),
    (["--since", "none"], "--since"),
])
def test_wrong_use_is_one_clear_error_before_anything_runs(tmp_path, plan, did, arguments, said):
    done = run(plan, *arguments, "--out", tmp_path / "out")
    assert done.exit_code == 2
    assert said in done.stderr
    assert not (tmp_path / "out").exists()
    assert did == []


def test_a_plan_that_is_none(tmp_path):
    assert "no such file" in run(tmp_path / "none.toml", "--out", tmp_path / "out").stderr
    (tmp_path / "plan.toml").write_text(PLAN.replace("cornell_box", "cornel_box"))
    wrong = run(tmp_path / "plan.toml", "--out", tmp_path / "out")
    assert wrong.exit_code == 2
    assert "cornel_box" in wrong.stderr


def test_files_of_others_are_spared(tmp_path, plan, did):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "results.md").write_text("mine")
    done = run(plan, "--out", tmp_path / "out")
    assert done.exit_code == 2
    assert "--force" in done.stderr
    assert did == []


def test_more_processes_than_there_is_memory_for(tmp_path, plan, monkeypatch):
    monkeypatch.setattr("refgi.memory.available_bytes", lambda: 1000)
    done = run(plan, "--out", tmp_path / "out", "--workers", "3")
    assert done.exit_code == 2
    assert "--workers" in done.stderr

"""`refgi bench`: files, what is said, exit codes, wrong grids."""

import json
import math

import pytest

from refgi.bench import measure
from refgi.bench.results import Result
from refgi.cli.judge import _smaller
from refgi.errors import InputError
from refgi.scene import load_scene
from tests.cli.command import runner

SMALL = ("--size", "24x18", "--rounds", "2", "--set", "samples=48", "--threads", "2")
run = runner("bench")


@pytest.fixture(autouse=True)
def new_processes(monkeypatch):
    """What asks for first frames of new processes, seconds each: (source, methods, size)."""
    asked = []

    def first_frames(source, methods, options, _):
        asked.append((source, methods, (options["width"], options["height"])))
        return dict.fromkeys(methods, 1.5)

    monkeypatch.setattr(measure, "first_frames", first_frames)
    return asked


@pytest.fixture
def grid(tmp_path):
    (tmp_path / "grid.toml").write_text("[truth]\npasses = [2]\n[sii]\nlights = [16, 64]\n[gather]\nsamples = 20\n")
    return tmp_path / "grid.toml"


def test_scenes_of_a_grid(tmp_path, grid, new_processes):
    done = run("cornell_box", "cornell_sphere:faces=80", "--grid", grid, *SMALL, "--json", "--out", tmp_path / "out")
    assert done.exit_code == 0, done.output
    assert sorted(file.name for file in (tmp_path / "out").iterdir()) == [
        "index.html", "pictures", "results.csv", "results.json", "results.md"]
    result = Result.model_validate_json((tmp_path / "out" / "results.json").read_text())
    assert [len(scene.runs) for scene in result.scenes] == [3, 3]
    assert [run.label for run in result.scenes[1].runs] == ["lights=16", "lights=64", "samples=20"]
    assert all((tmp_path / "out" / run.picture).is_file() for scene in result.scenes for run in scene.runs)
    assert json.loads(done.stdout)["scenes"] == result.model_dump(mode="json")["scenes"]
    assert new_processes == [(name, ["sii", "gather"], (24, 18)) for name in ("cornell_box", "cornell_sphere:faces=80")]
    assert [scene.cold for scene in result.scenes] == [{"sii": 1.5, "gather": 1.5}] * 2
    again = run("--grid", grid, *SMALL, "--methods", "gather", "--out", tmp_path / "out")
    assert again.exit_code == 0, again.output  # over its own files
    assert "gather comes to" in again.stdout


def test_what_a_budget_leaves_out_is_said_in_every_file(tmp_path, grid, new_processes):
    done = run("--grid", grid, *SMALL, "--budget", "0.001s", "--out", tmp_path / "out")
    assert done.exit_code == 0, done.output
    assert "cornell_box: left out for time: 4 settings: no time to load it" in done.stderr
    for name in ("results.md", "index.html"):
        assert "Left out for time: 4 settings: no time to load it" in (tmp_path / "out" / name).read_text()
    scene, = Result.model_validate_json((tmp_path / "out" / "results.json").read_text()).scenes
    assert list(scene.left_out) == ["sii: lights=16", "sii: lights=64", "gather: samples=20", "truth: samples=48"]
    assert new_processes == []


def test_a_quick_bench_is_small_and_scenes_share_the_time(tmp_path, monkeypatch):
    asked = []

    def refusing(scene, *_, budget, **__):
        asked.append((scene.camera.width, scene.camera.height, budget))
        raise InputError("enough")

    monkeypatch.setattr(measure, "bench_scene", refusing)
    for more in (["--budget", "2m"], ["--size", "600x300"], []):
        run("cornell_box", "ring", "--quick", *more, "--out", tmp_path / "out")
    assert [size for *size, _ in asked] == [[256, 256], [600, 300], [256, 256]]
    assert [budget for *_, budget in asked] == [pytest.approx(60, abs=5), math.inf, math.inf]
    wide = load_scene("cornell_box").with_camera(width=1000, height=10)
    assert (_smaller(wide).camera.width, _smaller(wide).camera.height) == (256, 3)
    small = wide.with_camera(width=24, height=18)
    assert (_smaller(small).camera.width, _smaller(small).camera.height) == (24, 18)


def test_errors_are_split_where_asked_for(tmp_path):
    """Of the default and of the knee, which is another, on a view of its own size; in every file."""
    (tmp_path / "grid.toml").write_text("[gather]\nsamples = [20, 40]\n")
    done = run("--grid", tmp_path / "grid.toml", *SMALL, "--split", "--split-size", "16x12", "--out", tmp_path / "out")
    assert done.exit_code == 0, done.output
    scene, = Result.model_validate_json((tmp_path / "out" / "results.json").read_text()).scenes
    assert scene.failures == {}
    default, knee = scene.splits
    assert (default.method, default.changes, default.knee) == ("gather", (), False)
    assert (knee.changes[0] in ("samples=20", "samples=40"), knee.knee) == (True, True)
    assert (default.width, default.height, scene.width, scene.height) == (16, 12, 24, 18)
    assert [part.name for part in knee.parts] == ["visibility", "rest", "RSM resolution", "cut", "few samples",
                                                  "upsampling"]
    assert sum(part.mean for part in knee.parts) == pytest.approx(knee.mean)
    for text in (done.stdout, (tmp_path / "out" / "results.md").read_text()):
        assert f"Error split of gather, {knee.changes[0]} (knee), 16 x 12:" in text
    html = (tmp_path / "out" / "index.html").read_text()
    assert "<h3>Error split</h3>" in html
    assert html.count("<details><summary>gather") == 2


@pytest.mark.slow
def test_a_split_of_blended_frames_has_a_temporal_part(tmp_path):
    (tmp_path / "grid.toml").write_text("[hssil]\nlevels = [2]\n[gather]\nsamples = [20]\n")
    done = run("--grid", tmp_path / "grid.toml", *SMALL, "--split", "--split-frames", "3", "--out", tmp_path / "out")
    assert done.exit_code == 0, done.output
    scene, = Result.model_validate_json((tmp_path / "out" / "results.json").read_text()).scenes
    last = {split.method: split.parts[-1].name for split in scene.splits}
    assert last == {"hssil": "temporal", "gather": "upsampling"}


def test_a_split_that_fails_is_told(tmp_path, grid, monkeypatch):
    def refusing(*_arguments, **_options):
        raise InputError("refused here")

    monkeypatch.setattr("refgi.bench.split.chain_of", refusing)
    done = run("--grid", grid, *SMALL, "--methods", "gather", "--split", "--out", tmp_path / "out")
    assert done.exit_code == 1
    assert "split of gather: samples=20 gave no picture: refused here" in done.stderr
    assert "gather comes to" in done.stdout


@pytest.mark.slow
def test_a_choice_that_gives_no_picture_is_told(tmp_path, grid, monkeypatch):
    timed = measure.timed

    def refusing(frame, method, settings):
        if method == "gather":
            raise InputError("refused here")
        return timed(frame, method, settings)

    monkeypatch.setattr(measure, "timed", refusing)
    done = run("--grid", grid, *SMALL, "--out", tmp_path / "out")
    assert done.exit_code == 1
    assert "gather: samples=20 gave no picture: refused here" in done.stderr
    assert "sii comes to" in done.stdout


def test_pictures_of_others_are_spared(tmp_path, grid, monkeypatch):
    monkeypatch.setattr(measure, "bench_scene", lambda *_, **__: pytest.fail("ran"))
    mine = tmp_path / "out" / "pictures" / "cornell_box" / "sii-01.exr"
    mine.parent.mkdir(parents=True)
    mine.write_bytes(b"mine")
    done = run("--grid", grid, *SMALL, "--out", tmp_path / "out")
    assert done.exit_code == 2
    assert "sii-01.exr is there and not from refgi" in done.stderr
    assert mine.read_bytes() == b"mine"


@pytest.mark.parametrize(("arguments", "said"), [
    (["--grid", "GRID", "--quick"], "not both"),
    (["--grid", "none.toml"], "no such file"),
    (["--quick", "--methods", "siii"], "siii"),
    (["--quick", "--set", "samplse=3"], "samplse"),
    (["cornel_box", "--quick"], "cornel_box"),
    (["--quick", "--rounds", "0"], "rounds"),
    (["--quick", "--split-size", "8x6"], "--split-size: expected --split"),
    (["--quick", "--split", "--budget", "2m"], "--budget: expected no --split"),
    (["--quick", "--budget", "2 weeks"], "a time such as 90s or 2m"),
])
def test_wrong_use_is_one_clear_error_before_anything_runs(tmp_path, grid, monkeypatch, arguments, said):
    monkeypatch.setattr(measure, "bench_scene", lambda *_, **__: pytest.fail("ran"))
    done = run(*(grid if one == "GRID" else one for one in arguments), "--out", tmp_path / "out")
    assert done.exit_code == 2
    assert said in done.stderr
    assert not (tmp_path / "out").exists()

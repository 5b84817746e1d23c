"""The runner: tasks that are finished are not run again; its short form keeps every promise, and the page shows it."""

from pathlib import Path

import pytest

from benchmarks.stability import pictures, runner, sameness
from benchmarks.stability.pictures import Hostile, hostile, shrunk
from benchmarks.stability.promise import Task
from refgi.stress.promises import Row, over_scenes

pytestmark = pytest.mark.slow  # tests/benchmarks/test_smoke.py runs a task of each part

PAGE = Path(runner.ROOT) / "docs" / "precision.md"


def row(name, figure=0.0):
    return Row(part="pictures", property=name, subject="sii", domain="", figure=figure, unit="", limit=1.0,
               kind="exact", source="", cases=1, reproduce="")


def on_page():
    """Property, subject and limit of each row that the page shows."""
    table = PAGE.read_text().partition(runner.BEGIN)[2].partition(runner.END)[0]
    cells = [[cell.strip() for cell in line.strip("|").split(" | ")] for line in table.splitlines()[3:]]
    return {(one[0], one[1]): one[5] for one in cells if len(one) == 8}


def test_a_finished_task_is_not_run_again(tmp_path, monkeypatch):
    ran = []

    def tasks(_):
        return [Task(name, lambda _, name=name: (ran.append(name), [row(name)])[1]) for name in ("one", "two")]

    monkeypatch.setattr(pictures, "tasks", tasks)
    for _ in range(2):
        assert [one.property for one in runner.run_parts(["pictures"], tmp_path, short=True)] == ["one", "two"]
    assert ran == ["one", "two"]
    list(runner.run_parts(["pictures"], tmp_path, short=False))  # the full form has other cases
    assert ran == ["one", "two"] * 2


def test_parts_in_processes_of_their_own_leave_their_tasks(tmp_path, capfd):
    runner.run_apart(["kernels"], tmp_path, ["ray.offset"], 2, short=True)
    assert "ray.offset" in capfd.readouterr().err
    assert len(list(runner.run_parts(["kernels"], tmp_path, ["ray.offset"], short=True))) == 3
    assert "ray.offset" not in capfd.readouterr().err


def test_broken_promises_are_an_exit_code(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(pictures, "tasks", lambda _: [Task("one", lambda _: [row("a"), row("b", 2.0)])])
    page = tmp_path / "page.md"
    page.write_text(f"head\n{runner.BEGIN}\nprevious\n{runner.END}\ntail\n")
    assert runner.main(["--part", "pictures", "--out", str(tmp_path / "out"), "--page", str(page)]) == 1
    assert "FAIL pictures: b, sii : 2  > 1" in capsys.readouterr().out
    assert page.read_text().startswith(f"head\n{runner.BEGIN}\n")
    assert "previous" not in page.read_text()
    assert page.read_text().endswith(f"{runner.END}\ntail\n")
    with pytest.raises(ValueError, match="expected"):
        runner.with_table("no marks", "table")


def test_pictures_keep_their_promises_and_stand_on_the_page(tmp_path):
    rows = list(over_scenes(runner.run_parts(["pictures"], tmp_path, short=True)))
    assert [(one.property, one.subject, one.figure, one.limit) for one in rows if not one.passed] == []
    assert {one.subject for one in rows} >= set(pictures.SHORT_METHODS)
    shown = on_page()
    assert {(one.property, one.subject): f"{one.limit:.3g}" for one in rows}.items() <= shown.items()


def test_threads_of_processes():
    found = sameness.hashes_in({"NUMBA_NUM_THREADS": "1"}, "hssil")["hssil"]
    assert len(found) > 20
    assert sameness.apart({"hssil": found}, {"hssil": dict(found)}) == []
    last = list(found)[-1]
    assert sameness.apart({"hssil": found}, {"hssil": {**found, last: "other"}}) == [f"hssil {last}"]


def test_hostile_scenes_are_the_same_for_the_same_seed_and_differ():
    assert hostile(7).written() == hostile(7).written()
    assert len({hostile(seed).written() for seed in range(50)}) == 50


def test_a_failing_scene_is_shrunk_to_what_fails():
    big = next(scene for scene in map(hostile, range(100)) if len(scene.meshes) == 3 and len(scene.lights) > 1)
    guilty = big.meshes[1]

    def fails(scene: Hostile) -> bool:
        return any(mesh.faces.size and (mesh.vertices[mesh.faces[0, 0]] == guilty.vertices[guilty.faces[0, 0]]).all()
                   for mesh in scene.meshes)

    small = shrunk(big, fails)
    assert fails(small)
    assert len(small.meshes) == len(small.lights) == 1
    assert len(small.meshes[0].faces) == 1
    assert small.size == (1, 1)


def test_what_breaks_is_told(monkeypatch):
    def broken(*_, **__):
        raise ZeroDivisionError("no light")

    assert pictures.fault_of(hostile(0), "hssil") == ""
    monkeypatch.setattr(pictures, "render", broken)
    found = pictures.hostile_row("hssil", range(2), lambda _: None)
    assert (found.figure, found.seed, found.cases) == (2, 0, 2)
    assert found.detail.startswith("ZeroDivisionError: no light")
    assert "Hostile((Mesh(" in found.detail

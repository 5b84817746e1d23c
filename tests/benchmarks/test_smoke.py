"""A task of each part of `python -m benchmarks stability`; whether its faults and bugs of ports fit today's sources."""

import tomllib
from pathlib import Path

import pytest

from benchmarks.kit_score import BUGS, SOURCES
from benchmarks.stability.runner import run_parts
from benchmarks.stability.seeded import faults
from refgi.vectors.rows import replaced

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(("part", "task", "properties"), [
    ("kernels", "ray.offset", 3), ("kernels", "map.borders", 1), ("rays", "rays.no_reach", 1), ("files", "ply", 1),
    ("files", "replaced", 1), ("faults", "starts", 1)])
def test_a_task_keeps_its_promises_and_is_kept(part, task, properties, tmp_path, capfd):
    rows = list(run_parts([part], tmp_path, [task], short=True))
    assert [(row.property, row.figure) for row in rows if not row.passed] == []
    assert len({row.property for row in rows}) == properties
    assert task in capfd.readouterr().err
    assert list(run_parts([part], tmp_path, [task], short=True)) == rows
    assert capfd.readouterr().err == ""


def test_a_fault_of_precision_stands_once_in_its_file():
    for fault in faults():
        text = (ROOT / fault.file).read_text("utf-8")
        assert text.count(fault.old) == 1, fault.name
        assert fault.put_into(text) != text, fault.name


@pytest.mark.parametrize("port", SOURCES)
def test_a_bug_of_a_port_stands_once_in_its_file(port):
    for bug in tomllib.loads((BUGS / f"{port}.toml").read_text("utf-8"))["bug"]:
        text = (SOURCES[port] / bug["file"]).read_text("utf-8")
        assert replaced(text, bug["old"], bug["new"], bug["what"]) != text

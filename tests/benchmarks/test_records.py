"""Records that were measured: stale where the code they rest on is another, made again, stamped, told in tables."""

import ast

import pytest

from benchmarks import frames_page
from benchmarks.__main__ import _write
from benchmarks.frames import MOTIONS, SUBJECTS
from benchmarks.harness import Row
from benchmarks.house import imports
from benchmarks.modes import MODES, SCENES
from benchmarks.records import AROUND, RECORDS, ROOT, Record, digest, make, stamps, table

SCRIPT = "import pathlib; p = pathlib.Path('made'); p.write_text((p.read_text() if p.exists() else '') + '.')"


@pytest.fixture
def root(tmp_path):
    (tmp_path / "refgi").mkdir()
    (tmp_path / "benchmarks/results").mkdir(parents=True)
    (tmp_path / "refgi/sums.py").write_text('"""Sums."""\n\n\ndef twice(x):\n    """Double."""\n    return 2 * x\n')
    return tmp_path


def states(root, records):
    return list(table(root, records).columns[3].cells)


def test_a_record_is_made_again_where_its_code_changed(root):
    records = {"sums": Record((("-c", SCRIPT), ("-c", SCRIPT)), "docs/sums.md")}
    assert states(root, records) == ["stale"]
    assert make(root, records) == make(root, records) == []
    assert (root / "made").read_text() == ".."
    assert states(root, records) == ["fresh"]
    path = root / "refgi/sums.py"
    path.write_text(path.read_text().replace("Double", "Twice as much").replace("2 * x", "2 * x  # exact"))
    assert states(root, records) == ["fresh"]
    path.write_text(path.read_text().replace("2 * x", "3 * x"))
    assert states(root, records) == ["stale"]
    make(root, records)
    assert (root / "made").read_text() == "...."


def test_what_fails_keeps_no_stamp_and_the_rest_goes_on(root):
    records = {"broken": Record((("-c", "raise SystemExit(3)"), ("-c", SCRIPT)), "-"),
               "sums": Record((("-c", SCRIPT),), "-")}
    assert make(root, records) == ["broken"]
    assert list(stamps(root)) == ["sums"]
    assert (root / "made").read_text() == "."
    assert states(root, records) == ["stale", "fresh"]


def test_records_rest_on_files_that_are_there():
    assert all(any(ROOT.glob(pattern)) for record in RECORDS.values() for pattern in record.sources)
    assert len({digest(ROOT, record) for record in RECORDS.values()}) == len(RECORDS)
    assert all((ROOT / record.read_by).exists() for record in RECORDS.values())


def test_papers_are_made_in_a_clone_that_has_no_folder_for_them():
    assert all("--parents" in command for command in RECORDS["papers"].commands[:-1])


def test_what_pictures_rest_on_imports_nothing_of_what_lies_around_them(root):
    sources = {path: ast.parse(path.read_text()) for path in (ROOT / "refgi").rglob("*.py")}
    around = tuple(f"refgi.{name.removesuffix('.py')}" for name in AROUND)
    arrows = {(name, to) for name, found in imports(sources, True).items() for to in found}
    assert not [arrow for arrow in arrows if f"{arrow[1]}.".startswith(tuple(f"{one}." for one in around))
                and not f"{arrow[0]}.".startswith(tuple(f"{one}." for one in around))]
    record = Record((), "-")
    before = digest(root, record)
    (root / "refgi/cli").mkdir()
    (root / "refgi/cli/render.py").write_text("x = 1\n")
    assert digest(root, record) == before != digest(root, record._replace(around=()))


def test_pages_of_frames_show_each_figure_in_its_place(tmp_path):
    rates = {f"{name}: {motion}": 1 + 0.25 * number for name in SUBJECTS for number, motion in enumerate(MOTIONS)}
    rows = [Row(name, value, "frames/s", note="1 to 2; paper 9; ms: sii.splat 3.0") for name, value in rates.items()]
    rows += [Row(f"{name}: RMSE / mean to all", 0.125, "") for name in SUBJECTS]
    modes = [Row(f"{scene}: {mode}", 0.5, "RMSE / mean", note="1.50 times as fast (1 to 2)")
             for scene in SCENES for mode in MODES]
    sizes = [Row("lights: sii, 256", 0.1, "s"), Row("pixels: sii, 64", 0.1, "s"), Row("pixels: val, 64", 0.2, "s")]
    _write(tmp_path, {"frames": rows, "modes": modes, "scaling": sizes})
    frames_page.main(tmp_path, tmp_path, tmp_path / "scaling.svg")
    frames = (tmp_path / "frames.md").read_text().splitlines()
    assert len(frames) == 2 + len(SUBJECTS)
    assert all(row.split(" | ")[1:4] == ["1 (1 to 2)", "1.25", "1.5"] for row in frames[2:])
    assert all(row.endswith("| 12 % |") for row in frames[2:])
    stages = (tmp_path / "stages.md").read_text().splitlines()
    assert stages[2:] == [f"| {name} | sii.splat 3.0 |" for name in SUBJECTS]
    told = (tmp_path / "modes.md").read_text().splitlines()
    assert told[2:] == [f"| {mode} |" + " 50 %, 1.50 |" * len(SCENES) for mode in MODES]
    assert "val" in (tmp_path / "scaling.svg").read_text()


def test_held_tables_of_frames_have_a_row_for_each_subject_and_mode():
    for name, known in (("frames", SUBJECTS), ("stages", SUBJECTS), ("modes", MODES)):
        rows = (ROOT / f"benchmarks/results/{name}.md").read_text().splitlines()[2:]
        assert [row.split(" | ")[0].removeprefix("| ") for row in rows] == list(known)

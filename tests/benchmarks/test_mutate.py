"""`python -m benchmarks mutate`: which faults there are, what becomes of them, and that no source is ever touched."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from benchmarks.mutate import runner, trial
from benchmarks.mutate.faults import OPERATORS, all_faults, drawn, is_fault
from benchmarks.mutate.project import REFGI, Project
from benchmarks.mutate.results import hash_of
from benchmarks.mutate.runner import Campaign
from benchmarks.mutate.selection import tests_of as selected
from benchmarks.mutate.trial import CAUGHT, INVALID, SAME, SURVIVED, TIMEOUT
from refgi.errors import InputError

ROOT = Path(__file__).parents[2]
LAMP = '''"""Light of a lamp."""

import dataclasses

from toy.jit import Settings, expect, kernel


@dataclasses.dataclass(frozen=True)
class LampSettings(Settings):
    """A lamp."""

    power: float = 3.0
    far: float = 10.0


@kernel
def falloff(distance: float) -> float:
    """Return 1 / d^2."""
    return 1.0 / (distance * distance)


def light(distance: float, settings: LampSettings) -> float:
    """Return the light at a distance; 0 far away."""
    expect(distance > 0.0, f"{distance + 1}")
    if distance > settings.far:
        return 0.0
    return settings.power * falloff(distance)
'''
LOOP = "    steps = 3\n    while steps > 0:\n        steps -= 1\n"
IF_FAR = "    if distance > settings.far:\n"
FILES = {
    "toy/__init__.py": "",
    "toy/jit.py": "class Settings:\n    pass\n\n\ndef kernel(function):\n    return function\n\n\n"
                  "def expect(holds, what):\n    assert holds, what\n",
    "toy/lamps/__init__.py": "",
    "toy/lamps/lamp.py": LAMP,
    "tests/lamps/test_lamp.py": "from toy.lamps.lamp import LampSettings, light\n\n\ndef test_light():\n"
                                "    assert light(2.0, LampSettings()) == 0.75\n",
    # one picture, of a lamp with another power
    "pictures.py": "import json, pathlib, sys\nfrom toy.lamps.lamp import LampSettings, light\n\n"
                   "made = {'lamp': str(light(2.0, LampSettings(power=5.0)))}\n"
                   "known = json.loads(pathlib.Path(sys.argv[3]).read_text()) if '--against' in sys.argv else made\n"
                   "pathlib.Path(sys.argv[1]).write_text(json.dumps(made) if made == known else 'lamp')\n"
                   "sys.exit(0 if made == known else 3)\n",
}


@pytest.fixture
def toy(tmp_path, monkeypatch):
    """Return a project of one module, whose tests check the default's power alone."""
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
    return project_at(tmp_path / "project")


def project_at(root):
    for name, text in FILES.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    return Project(root, "toy", "tests", ("toy/lamps",), "tests/wiring", {"toy/lamps": "lamp"}, "pictures", ("tests",))


def content_of(project):
    return hash_of(project.root, sorted(path for path in project.root.rglob("*") if path.is_file()))


def faults_to(project, *lines):
    """Return the faults that give some lines."""
    found = {fault.after.strip(): fault for fault in all_faults(project)}
    return [found[line] for line in lines]


def outcomes(project, folder, faults, jobs=1):
    """Return what becomes of faults, by their line."""
    run = Campaign(project, folder, faults, len(faults), lambda *_: None)
    run.run(jobs)
    return {result.fault.after.strip(): (result.outcome, result.by) for result in run.results}


EXAMPLES = {
    "factor": ("y = a * (b + c)", {"y = a", "y = (b + c)"}),
    "sign": ("y = a + b", {"y = a - b"}),
    "quotient": ("y = a / b", {"y = a * b"}),
    "logic": ("y = a and b", {"y = a or b"}),
    "comparison": ("y = a < b", {"y = a <= b", "y = a > b"}),
    "extreme": ("y = np.maximum(a, b)", {"y = np.minimum(a, b)"}),
    "constant": ("y = 0.5 * f(True, 2, range(3))", {
        "y = 1.0 * f(True, 2, range(3))", "y = 0.5 * f(False, 2, range(3))", "y = 0.5 * f(True, 3, range(3))",
        "y = 0.5 * f(True, 2, range(2))"}),
    "index": ("y = a[1, :n, -1]", {"y = a[0, :n, -1]", "y = a[1, :n - 1, -1]", "y = a[1, :n, -2]"}),
    "negation": ("y = a if b or c else d", {"y = a if not (b or c) else d"}),
    "keyword": ("y = f(a, b=1, c=(2))", {"y = f(a, c=(2))", "y = f(a, b=1)"}),
    "swap": ("y = f(a, b + 1)", {"y = f(b + 1, a)"}),
    "statement": ("y += f(a)", {"pass"}),
    "setting": ("y = settings.far", {"y = 10.0"}),
}


def test_every_operator_has_an_example():
    assert EXAMPLES.keys() == {*OPERATORS, "swap", "setting"}


@pytest.mark.slow
@pytest.mark.parametrize("operator", EXAMPLES)
def test_an_operator_changes_one_line_of_a_program(toy, operator):
    line, expected = EXAMPLES[operator]
    lamp = toy.root / "toy/lamps/lamp.py"
    lamp.write_text(LAMP.replace(IF_FAR, f"    {line}\n{IF_FAR}"))
    text, number = lamp.read_text(), LAMP.splitlines(keepends=True).index(IF_FAR) + 1
    found = [fault for fault in all_faults(toy) if (fault.operator, fault.line) == (operator, number)]
    assert {fault.after.strip() for fault in found} == expected
    for fault in found:
        assert is_fault(text, fault)
        changed = [pair for pair in zip(text.splitlines(), fault.put_into(text).splitlines(), strict=True)
                   if pair[0] != pair[1]]
        assert changed == [(fault.before.rstrip("\n"), fault.after.rstrip("\n"))]


@pytest.mark.slow
def test_checks_texts_and_types_are_left_out(toy):
    lines = LAMP.splitlines()
    assert not {fault.line for fault in all_faults(toy)} & {
        number for number, line in enumerate(lines, 1) if "expect(" in line or '"""' in line or line.startswith("def ")}


@pytest.mark.slow
def test_kernels_are_told_from_wiring(toy):
    kinds = {fault.function: fault.kind for fault in all_faults(toy)}
    assert kinds == {"": "wiring", "falloff": "kernels", "light": "wiring"}


@pytest.mark.slow
def test_a_seed_is_an_order(toy):
    faults = all_faults(toy)
    assert drawn(faults, 3) == drawn(faults[::1], 3)
    assert drawn(faults, 3) != drawn(faults, 4)
    assert sorted(drawn(faults, 3)) == faults


def test_kinds_and_operators_take_turns(toy):
    order = drawn(all_faults(toy), 0)
    assert [fault.kind for fault in order[:4]] == ["kernels", "wiring"] * 2
    wiring = [fault.operator for fault in order if fault.kind == "wiring"]
    assert len(set(wiring[:5])) == 5


@pytest.mark.slow
def test_faults_of_the_sources_are_programs():
    faults = drawn(all_faults(REFGI, ["refgi/lights"]), 0)
    assert {fault.operator for fault in faults} == EXAMPLES.keys()
    assert all(is_fault((ROOT / fault.file).read_text(), fault) for fault in faults[:200])


def test_the_tests_of_a_file():
    found = selected(REFGI, "refgi/splat/sii/threshold.py")
    assert {"tests/splat/sii/test_reference_length.py", "tests/splat/sii/test_sii.py"} <= {*found}
    assert "tests/splat/gather/test_gather.py" not in found
    assert "tests/splat/multires/test_multires.py" in selected(REFGI, "refgi/lights/selection.py")  # imports it


@pytest.mark.slow
def test_what_becomes_of_faults(toy, tmp_path, monkeypatch):
    monkeypatch.setattr(trial, "COMPILING", 4.0)  # s
    (toy.root / "toy/lamps/lamp.py").write_text(LAMP.replace(IF_FAR, LOOP + IF_FAR))
    before = content_of(toy)
    faults = faults_to(toy, "return settings.power", "return 3.0 * falloff(distance)", "if distance >= settings.far:",
                       "pass")
    assert outcomes(toy, tmp_path / "out", faults, jobs=2) == {
        "return settings.power": (CAUGHT, "tests/lamps/test_lamp.py::test_light"),
        "return 3.0 * falloff(distance)": (SURVIVED, "lamp"),
        "if distance >= settings.far:": (SAME, ""),
        "pass": (TIMEOUT, "tests/lamps/test_lamp.py::test_light"),
    }
    assert content_of(toy) == before


@pytest.mark.slow
def test_what_is_no_program_is_drawn_again(toy, tmp_path):
    refused = faults_to(toy, "return settings.power")[0]._replace(after="    return nothing\n")
    taken = Campaign(toy, tmp_path, [refused, *faults_to(toy, "return falloff(distance)")], 1, lambda *_: None)
    taken.run()
    assert [result.outcome for result in taken.results] == [INVALID, CAUGHT]


@pytest.mark.slow
def test_a_test_that_fails_without_a_fault_is_an_error(toy, tmp_path):
    (toy.root / "tests/lamps/test_lamp.py").write_text("def test_light():\n    assert False\n")
    with pytest.raises(InputError, match=r"fail without a fault.*test_light"):
        outcomes(toy, tmp_path / "out", faults_to(toy, "return settings.power"))


@pytest.mark.slow
def test_results_hold_while_what_they_rest_on_is_the_same(toy, tmp_path, monkeypatch):
    caught, survivor = "return settings.power", "return 3.0 * falloff(distance)"
    faults, ran = faults_to(toy, caught, survivor), []
    outcomes(toy, tmp_path / "out", faults)
    run_tests = runner.run_tests
    monkeypatch.setattr(runner, "run_tests", lambda *arguments: ran.append(arguments) or run_tests(*arguments))
    assert outcomes(toy, tmp_path / "out", faults)[survivor] == (SURVIVED, "lamp")
    assert not ran
    (toy.root / "tests/lamps/test_lamp_power.py").write_text(
        "from toy.lamps.lamp import LampSettings, light\n\n\ndef test_power():\n"
        "    assert light(1.0, LampSettings(power=2.0)) == 2.0\n")
    found = outcomes(toy, tmp_path / "out", faults)
    assert found[survivor] == (CAUGHT, "tests/lamps/test_lamp_power.py::test_power")
    assert found[caught] == (CAUGHT, "tests/lamps/test_lamp.py::test_light")
    assert len(ran) == 1


@pytest.mark.slow
def test_a_killed_run_goes_on(toy, tmp_path):
    before, out = content_of(toy), tmp_path / "out"
    script = (f"import sys; sys.path.insert(0, {str(ROOT)!r})\n"
              "from pathlib import Path\nfrom benchmarks.mutate import runner\n"
              "from benchmarks.mutate.project import Project\n"
              f"sys.exit(runner.main(['--count', '8', '--out', {str(out)!r}], Project(Path({str(toy.root)!r}), "
              f"*{tuple(toy)[1:]!r})))")
    results = out / "results.jsonl"
    running = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while running.poll() is None and not (results.is_file() and results.read_text().count("\n") > 1):
        time.sleep(0.02)
    os.kill(running.pid, signal.SIGKILL)
    running.wait()
    assert content_of(toy) == before
    done = results.read_text().splitlines(keepends=True)[:2]
    results.write_text("".join(done) + '{"cut short')
    runner.main(["--count", "8", "--out", str(out)], toy)
    lines = results.read_text().splitlines(keepends=True)
    assert lines[:2] == done
    assert sum(json.loads(line)["outcome"] != INVALID for line in lines) == 8
    assert len({json.loads(line)["id"] for line in lines}) == len(lines)
    assert content_of(toy) == before


@pytest.mark.slow
def test_the_report_has_score_and_survivors(toy, tmp_path, capsys):
    options = ["--count", "20", "--kind", "wiring", "--path", "toy/lamps/lamp.py", "--out", str(tmp_path)]
    assert runner.main(options, toy) == 1
    report = capsys.readouterr().out
    assert "Survivors:" in report
    assert "- return settings.power * falloff(distance)\n+ return 3.0 * falloff(distance)" in report
    assert "shows in lamp" in report
    with pytest.raises(SystemExit):
        runner.main(["--path", "tests"], toy)
    assert "a folder or file of toy/" in capsys.readouterr().err

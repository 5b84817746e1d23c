"""The search for a cause among single changes of the literal text: ports with bugs that no likely bug is."""

import ast
import inspect
import math

import numpy as np
import pytest
from click.testing import CliRunner

from refgi.cli.group import VerbGroup
from refgi.literal import pairs as literal
from refgi.vectors.causes import EXPLAINED
from refgi.vectors.changes import changes_of
from refgi.vectors.check import Asked, check_output
from refgi.vectors.manifest import CommonCause, Result
from refgi.vectors.search import TooSlowError, Trial, limited, searched
from refgi.vectors.spec import stored
from tests.vectors.port import Port

FUNCTION = '''
def area(values, i, scale, *, offset=1):
    """Say nothing."""
    total = math.floor(i) + max(0, offset)
    place = i / scale
    for k in range(1, i):
        total += math.sin(values[k, 0]) * scale - offset
        if total > 2.5 and scale < 1.0:
            continue
    return max(total, -values.low) if offset else box["row"] + box["column"] ** 2
'''


def changed():
    """Return the texts of a function with each change, and whether it is one of names."""
    tree = ast.parse(FUNCTION)
    before = ast.dump(tree)
    found = {}
    for edit in changes_of(tree.body[0]):
        edit.put()
        compile(tree, "area.py", "exec")
        found[ast.unparse(tree.body[0])] = edit.is_name
        edit.take_back()
        assert ast.dump(tree) == before
    return found


@pytest.mark.parametrize(("old", "new", "is_name"), [
    ("* scale - offset", "* scale + offset", False), ("* scale - offset", "/ scale - offset", False),
    ("math.sin(values[k, 0]) * scale", "math.sin(values[k, 0])", False), ("math.sin", "math.cos", False),
    ("values[k, 0]", "values[0, k]", False), ("values[k, 0]", "values[k + 1, 0]", False),
    ("values[k, 0]", "values[k, 1]", False), ("range(1, i)", "range(0, i)", False),
    ("range(1, i)", "range(1, i - 1)", False),
    ("total > 2.5", "total < 2.5", False), ("total > 2.5", "total > 5.0", False), (" and ", " or ", False),
    ("total += ", "total = ", False), ("continue", "pass", False), ("max(", "min(", False),
    ("max(total, -values.low)", "max(total, values.low)", False), ("max(total, -values.low)", "total", False),
    ("['row'] + box", "['row'] - box", False), ("['column'] ** 2", "['column']", False),
    ("total > 2.5 and scale", "total > 2.5 and k", True), ("* scale -", "* i -", True),
    ("['row']", "['column']", True), ("max(0, offset)", "abs(offset)", False),
    ("floor(i)", "floor(i + 0.5)", False), ("floor(i)", "rint(i)", False), ("i / scale", "i / scale - 0.5", False),
    ("i / scale", "i / scale + 0.5", False)])
def test_changes_are_those_that_people_make(old, new, is_name):
    plain = ast.unparse(ast.parse(FUNCTION).body[0])
    assert old in plain
    assert changed().get(plain.replace(old, new, 1)) is is_name


def test_docstrings_annotations_and_names_of_functions_stay():
    assert all('"""Say nothing."""' in text and "def area(values, i, scale, *, offset=1)" in text for text in changed())


def test_what_is_told_is_short_and_says_both():
    said = [edit.said for edit in changes_of(ast.parse(FUNCTION).body[0])]
    assert "`range(1, i - 1)` for `range(1, i)`" in " ".join(said)
    assert max(map(len, said)) < 320


def pairs(kit, wrong):
    """Return diffuse irradiance of pairs in NumPy, from a kit's inputs (SII Eq. 2); wrong: the light's cosine twice."""
    case = next(one for one in kit.cases(Asked(cases=("pairs-diffuse",))) if one.id == "pairs-diffuse")
    x, n, p, m, flux = (kit.array(case, f"pairs.pairs.{name}").astype(float).reshape(3, -1) for name in (
        "position", "normal", "light_position", "light_normal", "flux"))
    d = x - p
    square = np.maximum((d * d).sum(axis=0), 1e-100)
    arriving, leaving = (np.maximum(0, (sign * normal * d).sum(axis=0)) for sign, normal in ((-1, n), (1, m)))
    cosines = leaving * (leaving if wrong else arriving)
    return {"pairs.pairs": (flux * cosines / (math.pi * square**2))[:, None]}


def written(folder, arrays):
    (folder / "pairs-diffuse").mkdir(parents=True)
    for name, array in arrays.items():
        np.save(folder / "pairs-diffuse" / f"{name}.npy", stored(array))
    return folder


@pytest.fixture(scope="module")
def wrong(kit, tmp_path_factory):
    """The folder of a port with a wrong name, and what a check finds."""
    output = written(tmp_path_factory.mktemp("wrong"), pairs(kit, wrong=True))
    return output, check_output(kit, output, Asked())


@pytest.fixture
def few(monkeypatch):
    """Try one change of twenty, and the one that explains the wrong name."""
    plain = Trial.changes
    monkeypatch.setattr(Trial, "changes", lambda trial: [pair for number, pair in enumerate(plain(trial)) if
                        number % 20 == 0 or "`term = sent * sent * fall`" in pair[1].said])


def test_a_wrong_name_that_is_no_likely_bug_is_named(kit, wrong, evidence):
    """And the line told is that of the file."""
    output, result = wrong
    assert result.first == ("pairs-diffuse", "pairs.pairs")
    assert not any(cause.explained for cause in result.findings[0].causes)
    told = []
    found = searched(kit, output, Asked(), result, tell=lambda what, done: told.append((what, done)))
    first, *_ = found.findings[0].causes
    evidence(f"found: {first.cause}")
    assert "`term = sent * sent * fall`" in first.cause
    number = int(first.cause.partition("literal/pairs.py:")[2].split()[0])
    assert "term = sent * received * fall" in inspect.getsource(literal).splitlines()[number - 1]
    assert first.explained == 1
    assert told[0][0].startswith("pairs.pairs: ")
    assert 0 <= told[-1][1] <= 1
    own = {one.causes[0].cause for one in found.stages if (one.case, one.stage) == result.first}
    assert own == {first.cause}  # the page and the table tell it too
    others = [one for one in found.stages if (one.case, one.stage) != result.first]
    assert others == [one for one in result.stages if (one.case, one.stage) != result.first]


@pytest.mark.usefixtures("few")
def test_it_is_asked_for_on_the_command_line(kit, wrong, tmp_path):
    arguments = ["vectors", "check", str(kit.folder), str(wrong[0]), "--case", "pairs-diffuse"]
    without = CliRunner().invoke(VerbGroup.refgi(), arguments)
    assert without.exit_code == 1
    assert "pairs.py" not in without.stdout
    done = CliRunner().invoke(VerbGroup.refgi(), [*arguments, "--search", "60", "--json", str(tmp_path / "found.json")])
    assert done.exit_code == 1, done.output
    assert "as if refgi's literal/pairs.py" in " ".join(done.stdout.split())
    found = Result.model_validate_json((tmp_path / "found.json").read_text())
    assert "pairs.py" in found.findings[0].causes[0].cause


@pytest.mark.usefixtures("few")
def test_known_causes_come_first_and_time_ends_a_search(kit, wrong):
    output, result = wrong
    known = CommonCause(cause="known", explained=1, tried=1)

    def having(count):
        finding = result.findings[0].model_copy(update={"causes": count * (known,)})
        return result.model_copy(update={"findings": (finding,)})

    first, second, *_ = searched(kit, output, Asked(), having(1)).findings[0].causes
    assert first == known
    assert "pairs.py" in second.cause
    assert searched(kit, output, Asked(), having(3)) == having(3)
    assert searched(kit, output, Asked(), result, seconds=1e-9) == result


@pytest.mark.usefixtures("few")
def test_wirings_that_fit_keep_no_search_from_running(kit, wrong):
    """Three of the stage's; a change that explains as many cases stands behind the first of them."""
    output, result = wrong
    case, = kit.cases(Asked(cases=("pairs-diffuse",)))
    wired = [bug.cause for bug in kit.bugs(case).of("pairs.pairs") if bug.wired][:3]
    causes = tuple(CommonCause(cause=one, explained=1, tried=1) for one in wired)
    finding = result.findings[0].model_copy(update={"causes": causes})
    told = searched(kit, output, Asked(), result.model_copy(update={"findings": (finding,)})).findings[0].causes
    assert told[0].cause == wired[0]
    assert "pairs.py" in told[1].cause


def test_a_case_without_lobes_is_searched(kit, tmp_path):
    """The literal form makes fluxes of lobes too, which the stage of such a case does not write."""
    port = Port(kit, "hssil-paper", tmp_path)
    name = "rsm.reflected_flux0.flux"
    assert "rsm.reflected_flux0.lobe_flux" not in port.arrays
    port.write(name, port.arrays[name] ** 1.5)
    trial = Trial(kit, Asked(), port.folder, "hssil-paper", "rsm.reflected_flux0")
    assert trial.usable
    function, change = trial.changes()[0]
    assert trial.tried(function, change).share < EXPLAINED


def test_nothing_is_searched_where_nothing_is_wrong(kit, tmp_path):
    output = written(tmp_path / "right", pairs(kit, wrong=False))
    result = check_output(kit, output, Asked(cases=("pairs-diffuse",)))
    assert result.first is None
    assert searched(kit, output, Asked(), result) is result


@pytest.mark.usefixtures("few")
def test_what_nothing_explains_stays_without_a_cause(kit, tmp_path):
    made = pairs(kit, wrong=False)
    made["pairs.pairs"] = made["pairs.pairs"] * np.random.default_rng(0).uniform(0.5, 2, made[
        "pairs.pairs"].shape)
    output = written(tmp_path / "noise", made)
    result = check_output(kit, output, Asked(cases=("pairs-diffuse",)))
    assert searched(kit, output, Asked(), result, seconds=5.0) == result


def test_a_change_that_never_ends_is_left():
    def endless():
        with limited(0.05):
            while True:
                pass

    with pytest.raises(TooSlowError):
        endless()
    with limited(0.05):
        assert sum(range(10)) == 45

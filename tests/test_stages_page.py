"""Property tests of pages that programs make: docs/stages.md, literal.md and equations.md are what they make of it."""

import importlib.util
import re
import tomllib
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"


def loaded(name):
    spec = importlib.util.spec_from_file_location(name, DOCS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def literal():
    return loaded("literal_page")


@pytest.fixture(scope="module")
def papers():
    return loaded("papers_page")


def test_the_page_is_that_of_the_code():
    page = loaded("stages_page").page()
    assert (DOCS / "stages.md").read_text(encoding="utf-8") == page, "run python docs/stages_page.py"


def test_pages_of_the_literal_text_are_those_of_the_code(literal):
    for name, page in (("literal", literal.page()), ("equations", literal.equations_page())):
        assert (DOCS / f"{name}.md").read_text(encoding="utf-8") == page, "run python docs/literal_page.py"


def test_every_numbered_equation_has_lines_a_kernel_and_a_test_that_knows_it(literal, evidence):
    rows = {row["name"]: row for row in tomllib.loads((DOCS / "equations.toml").read_text("utf-8"))["equation"]}
    numbered = [re.fullmatch(r"(\w+) Eq\. (\d)(?: (?:to|and) (\d))?", name) for name in rows]
    numbers = [(one[1], number) for one in numbered if one for number in range(int(one[2]), int(one[3] or one[2]) + 1)]
    assert sorted(numbers) == sorted([*(("SII", k) for k in range(1, 9)), *(("AMS", k) for k in range(1, 4)),
                                      *(("HSS", k) for k in range(1, 5))])
    kernels = {one for row in rows.values() for one in row["kernel"]}
    assert [one for one in sorted(kernels) if not is_there(f"refgi.{one}")] == []
    assert [name for name, row in rows.items() if not any(map(literal.tests_of_function, row["literal"]))] == []
    evidence(f"{len(rows)} printed equations, {len(kernels)} kernels")


def test_few_literal_functions_lack_a_test_that_knows_them_from_elsewhere(literal, evidence):
    tests = {f"{module}.{one.__name__}": found for module in literal.order()
             for one, found in literal.functions(module)}
    bare = sorted(name for name, found in tests.items() if not found)
    evidence(f"{len(tests) - len(bare)} of {len(tests)} literal functions are reached by tests in tests/literal")
    assert len(bare) <= len(tests) // 20, bare


def test_literal_functions_that_methods_pages_name_are_there():
    named = {one for page in (DOCS / "methods").glob("*.md") for one in re.findall(r"`literal\.(\w+\.\w+)`",
                                                                                 page.read_text(encoding="utf-8"))}
    missing = [one for one in sorted(named) if not hasattr(
        importlib.import_module(f"refgi.literal.{one.partition('.')[0]}"), one.partition(".")[2])]
    assert missing == []
    assert len(named) > 40


@pytest.mark.parametrize(("page", "packages"), {
    "sii": ("",), "multires": ("", "splat.multires."), "val": ("", "cluster.", "cluster.filters."),
    "hssil": ("", "sssil.", "sssil.crown.")}.items())
def test_functions_that_methods_pages_name_beside_the_paper_are_there(page, packages):
    rows = re.findall(r"^\| .*? \| (.*?) \| .* \|$", (DOCS / "methods" / f"{page}.md").read_text("utf-8"), re.MULTILINE)
    named = {one for cell in rows for one in re.findall(r"`([a-z]\w*(?:\.\w+)+)[`(]", cell)}
    assert [one for one in sorted(named) if not any(is_there(f"refgi.{package}{one}") for package in packages)] == []


def is_there(name):
    """Whether a dotted name is a module or something in one."""
    module, _, last = name.rpartition(".")
    for one, rest in ((name, ()), (module, (last,))):
        try:
            found = importlib.import_module(one)
        except ModuleNotFoundError:
            continue
        return all(hasattr(found, attribute) for attribute in rest)
    return False


def test_the_page_of_claims_is_that_of_the_records(papers):
    made = papers.page(tomllib.loads(papers.CLAIMS.read_text(encoding="utf-8")), papers.read(papers.RECORD))
    assert papers.PAGE.read_text(encoding="utf-8") == made, "run python docs/papers_page.py"
    rows = [line for line in made.splitlines() if line.startswith("| ") and not line.startswith("| where")]
    assert all(line.endswith(" |  |") == ("| yes |" in line) for line in rows)  # what is not met says why


@pytest.mark.parametrize(("printed", "ours", "met"), [
    ("4", 5.0, "yes"), ("4", 5.01, "no"), ("4", 3.2, "yes"), ("4", 3.19, "no"), (">70", 70.0, "no"),
    (">70", 71.0, "yes"), ("<10", 9.0, "yes"), ("<10", 10.0, "no"), ("4", None, "not measured")])
def test_a_claim_is_met_within_a_quarter_or_on_its_side(papers, printed, ours, met):
    assert papers.verdict(printed, ours, "slow") == met
    assert papers.verdict(printed, ours, "fitted: so") == ("fitted" if ours else met)


@pytest.mark.parametrize(("why", "ours", "met"), [
    ("GPU", 3.2, "yes"), ("GPU", 3.1, "no"), ("GPU", 9.0, "yes"),
    ("GPU ms", 5.0, "yes"), ("GPU ms", 5.1, "no"), ("GPU ms", 1.0, "yes")])
def test_what_is_faster_than_a_printed_rate_meets_it(papers, why, ours, met):
    assert papers.verdict("4", ours, why) == met


def test_a_claim_reads_the_cell_that_it_names(papers):
    tables = [{"columns": ["", "ms"], "rows": [["a", 2.0], ["b", 8.0]]}, {"columns": ["", "fps"], "rows": [["a", 3.0]]}]
    found = {"fig1": {"tables": tables}}
    assert papers.cells(found, "fig1 :: b :: ms") == 8
    assert papers.cells(found, "fig1#1 :: a :: fps // fig1 :: b :: ms") == 3 / 8
    assert papers.cells(found, "fig1 :: a :: ms // fig2 :: a :: ms") is None
    assert papers.cells(found, "") is None
    assert papers.cells(found, "fig1 :: c :: ms") is None
    with pytest.raises(KeyError, match="fig1 :: a :: s"):
        papers.cells(found, "fig1 :: a :: s")


def test_results_of_a_run_replace_figures_in_the_record(papers):
    old = {"sii": {"fig1": {"tables": []}, "fig2": {"tables": []}}}
    table = {"title": "t", "columns": ["", "ms"], "rows": [["a", 2.0]], "columns_of_the_paper": []}
    papers.taken_over(old, {"paper": {"name": "sii"}, "scale": {"name": "quick", "size": 256},
                            "environment": {"cpu": "x", "threads": 2},
                            "figures": {"fig1": {"tables": [table]}, "fig3": {"failure": "no"}}})
    assert list(old["sii"]) == ["fig1", "fig2"]
    assert papers.cells(old["sii"], "fig1 :: a :: ms") == 2
    assert papers.runs({"fig1": old["sii"]["fig1"]}) == " Runs: 256² pixels (quick scale) on 2 threads of x."

"""Property tests of pages that programs make: docs/stages.md and docs/literal.md are what they make of the code."""

import importlib.util
import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"


def loaded(name):
    spec = importlib.util.spec_from_file_location(name, DOCS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def program():
    return loaded("stages_page")


def test_the_page_is_that_of_the_code(program):
    assert (DOCS / "stages.md").read_text(encoding="utf-8") == program.page(), "run python docs/stages_page.py"


def test_the_page_of_the_literal_text_is_that_of_the_code():
    literal = loaded("literal_page")
    assert (DOCS / "literal.md").read_text(encoding="utf-8") == literal.page(), "run python docs/literal_page.py"


def test_few_literal_functions_lack_a_test_that_knows_them_from_elsewhere(evidence):
    literal = loaded("literal_page")
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

"""Property test of docs/stages.md: it is what its program makes of the stages there are."""

import importlib.util
import inspect
from pathlib import Path

import pytest

from refgi import stages

DOCS = Path(__file__).parents[1] / "docs"


@pytest.fixture(scope="module")
def program():
    spec = importlib.util.spec_from_file_location("stages_page", DOCS / "stages_page.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_page_is_that_of_the_code(program):
    assert (DOCS / "stages.md").read_text(encoding="utf-8") == program.page(), "run python docs/stages_page.py"


def test_every_stage_says_what_it_takes_and_gives(program):
    program._import_all()
    for name, stage in stages.STAGES.items():
        if stage.__module__.startswith("refgi."):
            assert program._fields(inspect.cleandoc(stage.__doc__), "Returns"), name

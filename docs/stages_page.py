"""Write docs/stages.md: every stage of every method, with its arrays, their shapes, units and space.

`python docs/stages_page.py` writes the page from the stages' docstrings and from a run of each method at its defaults.
"""

import importlib
import inspect
import pkgutil
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import refgi
from refgi import stages
from refgi.methods import METHODS, render
from refgi.vectors.docstrings import documented

PAGE = Path(__file__).with_name("stages.md")
HEAD = """# Stages

Every step that a method can be judged by is a stage: a pure function with a name that no other has. Inside
`refgi.stages.observe(record=True)` each call leaves its inputs by parameter and its output in the log; what computes
its arrays on first use, such as the G-buffer, is recorded whole. Arrays are in world space, in metres and linear RGB,
unless something else stands beside them.

```python
from refgi import stages
from refgi.methods import render

with stages.observe(record=True) as log:
    render("cornell_box", "sii")
lights = next(run for run in log.runs if run.name == "lights.choose")
print(list(lights.inputs), lights.output.position.shape)
```

This page is made by `python docs/stages_page.py`.
"""


def page() -> str:
    _import_all()
    return "\n".join([HEAD, *_runs(), *_tables()]) + "\n"


def _import_all() -> None:
    for module in pkgutil.walk_packages(refgi.__path__, "refgi."):
        if not module.name.startswith(("refgi.cli", "refgi.__main__")):
            importlib.import_module(module.name)


def _runs() -> list[str]:
    """Return the stages that each method runs at its defaults, in their order."""
    lines = ["## What each method runs", "", "At its defaults, on `cornell_box`; stages inside others are not listed.",
             ""]
    for name in METHODS:
        with stages.observe() as log, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            render("cornell_box", name, width=24, height=18, rsm_resolution=24)
        outer = dict.fromkeys(run.name for run in log.runs if run.depth == 0 and run.status == "ran")
        lines.append(f"- `{name}`: {', '.join(f'`{stage}`' for stage in outer)}")
    return [*lines, ""]


def _tables() -> list[str]:
    """Return a table of stages for each package."""
    lines = []
    known = {name: stage for name, stage in stages.STAGES.items() if stage.__module__.startswith("refgi.")}
    for package in sorted({name.partition(".")[0] for name in known}):
        lines += [f"## {package}", ""]
        for name in sorted(name for name in known if name.partition(".")[0] == package):
            lines += _stage(name, known[name])
    return lines


def _stage(name: str, stage: Callable[..., Any]) -> list[str]:
    what = (inspect.getdoc(stage) or "").splitlines()[0]
    lines = [f"### `{name}`", "", f"{what} `{stage.__module__}.{stage.__name__}`", "", "| | type | what |",
             "|---|---|---|"]
    for way, told in zip(("in", "out"), documented(stage), strict=True):
        rows = ((f"`{field}`" if field else "", *one) for field, one in told.items())
        lines += [f"| {way}: {' | '.join(cell.replace('|', 'or') for cell in row)} |" for row in rows]
    return [*lines, ""]


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")

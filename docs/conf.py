"""Sphinx configuration."""

import inspect
import re
import sys
from pathlib import Path
from typing import Any

from refgi import __version__
from refgi.vectors.docstrings import documented

sys.path.insert(0, str(Path(__file__).parent))  # mathml.py

project = "refgi"
author = "the refgi authors"
release = __version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.viewcode", "numpydoc", "sphinx_copybutton", "mathml"]
myst_enable_extensions = ["dollarmath", "amsmath", "colon_fence"]
myst_heading_anchors = 3
numpydoc_show_class_members = False
autodoc_default_options = {"members": True, "member-order": "bysource"}
autodoc_typehints = "none"
html_theme = "furo"
html_title = f"refgi {release}"
html_static_path = ["_static"]
html_extra_path = [name for name in ("extra",) if (Path(__file__).parent / name).is_dir()]  # pages of the gallery
html_css_files = ["book.css"]
html_copy_source = False
html_show_copyright = False
html_math_renderer = "mathml"
toc_object_entries = False  # the thousand names of api.md would be copied into every page
exclude_patterns = ["_build"]
suppress_warnings = ["myst.header"]


def sections(app: Any, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:  # noqa: ARG001
    """Make numpydoc's sections of the lines of arrays in a stage's docstring."""
    if not hasattr(thing, "stage_name"):
        return
    first, *others = (inspect.getdoc(thing) or "").split("\n\n")
    made = []
    for title, told in zip(("Parameters", "Returns"), documented(thing), strict=True):
        entries = (f"{f'{field} : ' if field else ''}{kind}\n    {text}" for field, (kind, text) in told.items())
        made.append("\n".join([title, "-" * len(title), *entries]))
    rest = [part for part in others if not re.match(r"(\w+, )*\w+( [^\n]+)?: |-> ", part)]
    heading = next((k for k, part in enumerate(rest) if re.match(r"\w+\n--", part)), len(rest))
    lines[:] = "\n\n".join([first, *rest[:heading], *made, *rest[heading:], ""]).split("\n")


def without_twins(app: Any, what: str, name: str, thing: Any, skip: bool, options: Any) -> bool:  # noqa: ARG001
    """Leave out functions by another name, such as a stage's without observation."""
    return skip or (inspect.isfunction(thing) and thing.__name__ != name)


def setup(app: Any) -> None:
    """Let stages' docstrings be read before numpydoc reads them."""
    app.connect("autodoc-process-docstring", sections, priority=400)
    app.connect("autodoc-skip-member", without_twins)

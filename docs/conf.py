"""Sphinx configuration."""

from refgi import __version__

project = "refgi"
author = "the refgi authors"
release = __version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.viewcode", "numpydoc"]
myst_enable_extensions = ["dollarmath", "amsmath", "colon_fence"]
myst_heading_anchors = 3
numpydoc_show_class_members = False
autodoc_default_options = {"members": True, "member-order": "bysource"}
autodoc_typehints = "none"
html_theme = "alabaster"
html_theme_options = {"description": release, "page_width": "1100px"}
exclude_patterns = ["_build"]
suppress_warnings = ["myst.header"]

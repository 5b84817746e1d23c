"""Benchmarks of refgi; REFGI_PACKAGE names another checkout whose package they measure in place of this one's."""

import importlib.util
import os
import sys
from pathlib import Path

if folder := os.environ.get("REFGI_PACKAGE"):
    place = Path(folder).resolve() / "refgi"
    spec = importlib.util.spec_from_file_location("refgi", place / "__init__.py",
                                                  submodule_search_locations=[str(place)])
    assert spec is not None
    assert spec.loader is not None
    sys.modules["refgi"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(sys.modules["refgi"])

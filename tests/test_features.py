"""Every feature that the documentation lists is measured by a test that carries its id, and the other way round."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]


def test_listed_features_are_the_marked_ones():
    listed = set(re.findall(r"^\| ([A-Z]{3}-\d\d) ", (ROOT / "docs" / "features.md").read_text(), re.MULTILINE))
    marked = set()
    for path in (ROOT / "tests").rglob("test_*.py"):
        for call in re.findall(r"mark\.feature\(([^)]*)\)", path.read_text()):
            marked |= set(re.findall(r"[A-Z]{3}-\d\d", call))
    assert listed == marked

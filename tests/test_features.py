"""Every feature of the papers is listed, and is measured by a test that carries its id or says why it is not built."""

import re
from pathlib import Path

from tests.conftest import COLLECTED, features_built

ROOT = Path(__file__).parents[1]
NUMBERS = {paper: range(1, count + 1) for paper, count in (("SII", 32), ("VAL", 27), ("AMS", 22), ("HSS", 21))}
NUMBERS["REF"] = [*range(1, 29), 31, 32, 33]  # beyond the papers
NOT_BUILT = "not built: "


def listed():
    """Return the evidence of each id, in the order of the page."""
    page = (ROOT / "docs" / "features.md").read_text()
    return re.findall(r"^\| ([A-Z]{3}-\d\d) \|[^|]+\| (.*) \|$", page, re.MULTILINE)


def marked():
    """Return the files of the tests that carry an id, by id."""
    found = {}
    for path in (ROOT / "tests").rglob("test_*.py"):
        for call in re.findall(r"mark\.feature\(([^)]*)\)", path.read_text()):
            for feature in re.findall(r"[A-Z]{3}-\d\d", call):
                found.setdefault(feature, set()).add(path)
    return found


def test_every_feature_is_listed_once_and_in_order():
    assert [feature for feature, _ in listed()] == [
        f"{paper}-{number:02}" for paper, numbers in NUMBERS.items() for number in numbers]


def test_listed_features_are_the_marked_ones():
    assert {feature for feature, evidence in listed() if not evidence.startswith(NOT_BUILT)} == marked().keys()


def test_pages_count_what_is_built_in_part():
    for page in ("docs/features.md", "README.md"):
        text = " ".join((ROOT / page).read_text().split())
        assert features_built() in text, page


def test_the_short_list_has_a_test_of_every_feature(request):
    """Of ids all of whose files were collected; which in `make test` are all."""
    items, left_out = request.config.stash.get(COLLECTED, ([], set()))
    files = {item.path for item in items}
    kept = {feature for item in items if id(item) not in left_out for mark in item.iter_markers("feature")
            for feature in mark.args}
    assert {feature for feature, carrying in marked().items() if carrying <= files} <= kept

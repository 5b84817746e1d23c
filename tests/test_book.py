"""Property tests of the built documentation: it asks nothing of a network, fits the window, and draws its formulas."""

import inspect
import json
import os
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from runpy import run_path

import pytest

from refgi.splat.multires.upsample import surface_detail
from tests.compare.browser import clicked

pytest.importorskip("sphinx", reason="the docs extra is not installed")

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
WIDTHS = (1300, 400)
COLUMNS = 88
TEN = ("index", "port", "compare_methods", "equations", "vectors", "cli", "methods/sii", "methods/val_visibility",
       "stages", "api")
STAGE = "refgi.splat.multires.upsample.surface_detail"
FETCHED = {"script": "src", "img": "src", "source": "src", "iframe": "src", "link": "href", "image": "href"}
OUTSIDE = re.compile(r"(?:https?:)?//")
FROM_OUTSIDE = re.compile(rf"(?:url\(|@import)\s*[\"']?{OUTSIDE.pattern}")
# in a frame, which may be narrower than a window
LAID_OUT = """
const frame = document.body.appendChild(document.createElement("iframe"));
frame.style = "width: WIDTHpx; height: 1000px; border: 0";
let loaded = false;
frame.onload = () => { loaded = true; };
frame.srcdoc = PAGE;
await until(() => loaded);
await settle();
const page = frame.contentDocument;
found.asked = frame.contentWindow.performance.getEntriesByType("resource").map((one) => one.name);
found.width = frame.contentWindow.innerWidth;
found.beyond = page.documentElement.scrollWidth - page.documentElement.clientWidth;
found.content = page.querySelector(".content").scrollWidth - page.querySelector(".content").clientWidth;
found.code = $$("pre", page).filter((one) => one.scrollWidth > one.clientWidth).map((one) => one.textContent);
found.formulas = $$("math", page).filter((one) => one.getBoundingClientRect().width > 0).length;
frame.remove();
"""


def sphinx(*arguments):
    done = subprocess.run([sys.executable, "-m", "sphinx", "-q", "-b", "html", *map(str, arguments)], check=False,
                          capture_output=True, text=True, env=os.environ | {"PYTHONPATH": str(ROOT)})
    assert done.returncode == 0, done.stderr
    assert "no MathML" not in done.stderr, done.stderr


@pytest.fixture(scope="module")
def few(tmp_path_factory):
    """The first page, a method's page and a page of one stage's docstring, built."""
    pages, out = tmp_path_factory.mktemp("pages"), tmp_path_factory.mktemp("few")
    (pages / "methods").mkdir()
    for name in ("index.md", "methods/sii.md"):
        shutil.copy(DOCS / name, pages / name)
    shutil.copytree(DOCS / "images", pages / "images")
    (pages / "stage.rst").write_text(f"stage\n=====\n\n.. autofunction:: {STAGE}\n")
    sphinx("-c", DOCS, pages, out)
    return out


@pytest.fixture(scope="module")
def book(tmp_path_factory):
    """All pages, built as `make check` builds them."""
    out = tmp_path_factory.mktemp("book")
    sphinx("-W", "--keep-going", DOCS, out)
    return out


class Fetched(HTMLParser):
    """What a page has a browser fetch: sources of scripts, styles, icons and pictures."""

    def __init__(self, page):
        super().__init__()
        self.found = []
        self.feed(page)

    def handle_starttag(self, tag, attributes):
        self.found += [value for name, value in attributes if value and name == FETCHED.get(tag)]


def outside(folder):
    """What pages and style sheets of a folder fetch from elsewhere, by file."""
    asked = {file: [one for one in Fetched(file.read_text("utf-8")).found if OUTSIDE.match(one)]
             for file in folder.rglob("*.html")}
    asked |= {file: FROM_OUTSIDE.findall(file.read_text("utf-8"))
              for kind in ("html", "css") for file in folder.rglob(f"*.{kind}") if not asked.get(file)}
    return {file.name: found for file, found in asked.items() if found}


def laid_out(folder, page, width):
    """What is wrong with a page as a browser lays it out at a width."""
    file = folder / f"{page}.html"
    text = file.read_text("utf-8")
    quoted = json.dumps(text).replace("</", "<\\/")
    found = clicked("<html><head></head><body></body></html>",
                    LAID_OUT.replace("WIDTH", str(width)).replace("PAGE", quoted), file.parent, 1400)
    assert found["width"] == width, found["faults"]
    wrong = {"asked": [one for one in found["asked"] if not one.startswith("file:")], "faults": found["faults"],
             "beyond": found["beyond"], "content": found["content"],
             "code": found["code"] if width == max(WIDTHS) else [],
             "formulas": text.count("<math") - found["formulas"]}
    return {name: one for name, one in wrong.items() if one}


def test_every_tile_of_the_gallery_opens_a_comparison():
    text = (DOCS / "gallery.md").read_text("utf-8")
    tiles = re.findall(r":::\{figure\} (\S+)\n:alt: .*\n:target: (\S+)\n(.+)", text)
    assert len(tiles) == text.count(":::{figure}") >= 20
    scenes = run_path(str(DOCS / "gallery_page.py"))["SCENES"]
    assert {page for _, page, _ in tiles} == {f"gallery/{scene}.html" for scene in scenes}  # that `make docs` makes
    for picture, _, said in tiles:
        assert (DOCS / picture).is_file()
        assert re.search(r"[\d.]+ m?s$", said)


def test_code_is_at_most_88_columns_wide():
    wide = {f"{file.relative_to(DOCS)}: {line}" for file in DOCS.rglob("*.md") if "_build" not in file.parts
            for block in re.findall(r"^```[^\n]*\n(.*?)^```", file.read_text("utf-8"), re.MULTILINE | re.DOTALL)
            for line in block.splitlines() if len(line) > COLUMNS}
    assert wide == set()


def test_pages_ask_nothing_of_a_network(few):
    assert outside(few) == {}


def test_what_a_page_fetches_from_elsewhere_is_found(tmp_path):
    (tmp_path / "a.html").write_text('<a href="https://a.org">x</a><script src="https://b.org/c.js"></script>')
    (tmp_path / "b.css").write_text("a { background: url('//c.org/d.png') }")
    assert outside(tmp_path) == {"a.html": ["https://b.org/c.js"], "b.css": ["url('//"]}


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("page", ["index", "methods/sii"])
def test_pages_fit_the_window(few, page, width):
    assert laid_out(few, page, width) == {}


def test_a_stages_arrays_are_parameters_and_returns(few):
    page = (few / "stage.html").read_text("utf-8")
    shown = re.findall(r"<dt><strong>(\w+)</strong><span class=\"classifier\">", page)
    assert shown == list(inspect.signature(surface_detail).parameters)
    assert re.search(r"Returns<span[^>]*>:</span></dt>\s*<dd[^>]*><dl[^>]*>\s*<dt>\(3, h, w\)", page), page


@pytest.mark.slow
def test_no_page_of_the_book_asks_anything_of_a_network(book, evidence):
    assert outside(book) == {}
    pages = list(book.rglob("*.html"))
    evidence(f"{len(pages)} pages, {sum(file.read_text('utf-8').count('<math') for file in pages)} formulas")


@pytest.mark.slow
def test_ten_pages_of_the_book_fit_windows_wide_and_narrow(book):
    wrong = {(page, width): found for page in TEN for width in WIDTHS if (found := laid_out(book, page, width))}
    assert wrong == {}

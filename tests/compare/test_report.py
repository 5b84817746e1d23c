"""The page: one file without references to anything outside, with every picture, figure and stage."""

import dataclasses
import json
import math
import re
import types
from html.parser import HTMLParser

import numpy as np
import pytest

from refgi.compare.pages import PAGE, SCRIPTS, Axes, Curve, Point, curves_plot, number, sort_key, time_against_error
from refgi.compare.report import ledger_cells, page, write_report
from refgi.image import is_from_refgi
from refgi.scene.files import Source
from tests.compare.conftest import make_comparison, make_scene

VOID = {"meta", "img", "input", "br", "link", "hr"}


class Outline(HTMLParser):
    """Checks nesting and gathers tags, attributes and text."""

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.text, self.closed_right = [], [], [], True
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))

    def handle_endtag(self, tag):
        self.closed_right &= bool(self.open) and self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)

    def all(self, tag):
        return [attributes for name, attributes in self.tags if name == tag]


@pytest.fixture(scope="module")
def html():
    return page(make_comparison(make_scene()))


def test_the_page_refers_to_nothing_outside_itself(html):
    assert not re.search(r"https?:|[\"'(]//|@import|url\((?!#)", html)
    outline = Outline(html)
    assert not outline.all("link")
    assert not outline.all("img")
    assert not any("src" in script for script in outline.all("script"))


def test_the_page_is_well_formed(html):
    outline = Outline(html)
    assert outline.closed_right
    assert not outline.open
    identifiers = [a["id"] for _, a in outline.tags if "id" in a]
    assert len(identifiers) == len(set(identifiers))


def test_every_control_has_a_name(html):
    outline = Outline(html)
    assert all("aria-label" in b or b.get("data-zoom") == "0" for b in outline.all("button"))
    assert outline.all("html")[0]["lang"] == "en"
    assert html.count("<label") == len([i for i in outline.all("input")]) + len(outline.all("select"))


def test_the_pictures_are_numbers_that_a_script_paints(html, comparison):
    content = re.search(r'<script type="application/json" id="album">(.*?)</script>', html, re.DOTALL)[1]
    data = json.loads(content)
    view, = data["views"]
    assert [one["label"] for one in view["pictures"]] == list(comparison.results)
    assert len(re.findall(r'<script type="text/plain" id="planes\d+">', html)) == len(data["planes"])
    assert view["exposure"] == comparison.scene.exposure
    assert "<noscript>" in html


def test_names_from_outside_are_escaped(comparison):
    scene = dataclasses.replace(comparison.scene, name="<script>alert(1)</script>")
    html = page(dataclasses.replace(comparison, scene=scene, failures={"multires": "a < b & c"}))
    assert "<script>alert" not in html
    assert "a &lt; b &amp; c" in html


def test_noise_is_marked_and_errors_are_not(html):
    rows = re.findall(r"<tr.*?</tr>", html, re.DOTALL)
    vpl = next(row for row in rows if '<th scope="row">vpl' in row)
    sii = next(row for row in rows if '<th scope="row">sii' in row)
    assert vpl.count('class="noise"') == 7
    assert 'class="noise"' not in sii


def test_stages_settings_and_reasons_are_told(html):
    text = " ".join(Outline(html).text)
    for said in ("pairs.sum", "no glossy material", "pattern", "grid", "truth without visibility"):
        assert said in text


def test_the_page_says_what_its_pictures_were_made_of(html, comparison):
    """By hand: triangle, spot and camera of the comparison made by hand."""
    section = re.search(r'<details id="provenance">.*?</details>', html, re.DOTALL)[0]
    rows = dict(re.findall(r"<dt>(.*?)</dt><dd>(.*?)</dd>", section))
    assert rows["scene"] == "made in Python"
    assert rows["geometry"] == f"1 faces, SHA-256 {comparison.record['scene']['geometry_sha256']}"
    assert rows["camera"] == "eye 0, 0, 5; target 0, 0, 0; up 0, 1, 0; vfov 40°; width 48; height 36"
    assert rows["light 0"] == ("spot; position 0, 2, 0; direction 0, -1, 0; inner half angle 17.1887°; "
                               "outer half angle 28.6479°; intensity 9, 9, 9")
    assert rows["rsm resolution"] == "512"
    assert rows["refgi"].startswith("0.1.0, commit ")
    assert "refgi render --again sii.exr" in section


def test_files_of_a_scene_are_on_the_page(comparison):
    scene = dataclasses.replace(comparison.scene, source=Source("room<1>.json", (("room<1>.json", "ab" * 32),)))
    assert f"<dt>file room&lt;1&gt;.json</dt><dd>SHA-256 {'ab' * 32}</dd>" in page(
        dataclasses.replace(comparison, scene=scene))


def test_ledgers_are_shown_of_methods_that_have_one(html):
    ledger = re.search(r'<table class="ledger">.*?</table>', html, re.DOTALL)[0]
    assert html.count("<table class=\"ledger\">") == 1
    rows = [re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row) for row in ledger.split("<tr")[1:]]
    assert rows[0] == ["sii", "R, W", "G, W", "B, W", "of emitted", ""]
    assert rows[2] == ["off screen", "1", "3", "2", "75.00 %", "met &lt;nothing&gt;"]
    assert rows[5][:5] == ["difference", "0", "\N{MINUS SIGN}0.5", "0", "\N{MINUS SIGN}6.25 %"]
    assert [' class="part"' in row for row in ledger.split("<tr")[2:]] == [False, True, False, True, False]


def test_a_page_without_ledgers_has_no_section_for_them(comparison):
    results = {name: dataclasses.replace(result, ledger=None) for name, result in comparison.results.items()}
    assert "power of the lights" not in page(dataclasses.replace(comparison, results=results))


def test_a_ledger_of_nothing_has_no_percent():
    nothing = types.SimpleNamespace(watts=np.zeros(3), name="emitted", meaning="", is_part=False)
    cells = ledger_cells(types.SimpleNamespace(rows=[nothing], difference=np.zeros(3)))
    assert [row[4] for row in cells] == ["\N{EN DASH}"] * 2


def test_non_finite_pixels_are_told(comparison):
    bad = comparison.results["sii"].irradiance.copy()
    bad[:, 18, 30] = np.nan
    sii = comparison.results["sii"]
    measured = {judge: dataclasses.replace(m, non_finite=1) for judge, m in sii.against.items()}
    results = {"sii": dataclasses.replace(sii, irradiance=bad, against=measured)}
    html = page(dataclasses.replace(comparison, results=results))
    assert "sii: 1 pixels are NaN or infinite" in html


def test_without_methods_that_worked_there_is_still_a_page(comparison):
    html = page(dataclasses.replace(comparison, results={}, failures={"sii": "no light"}))
    assert "No method gave a figure" in html


def test_equal_comparisons_give_equal_pages(html, comparison, tmp_path):
    write_report(comparison, tmp_path)
    assert (tmp_path / "index.html").read_text("utf-8") == html
    assert is_from_refgi(tmp_path / "index.html")


def test_the_scripts_stay_small():
    scripts = [(PAGE / f"{name}.js").read_text() for name in SCRIPTS]
    assert all(len(text.splitlines()) <= 250 for text in scripts)
    assert sum(map(len, scripts)) < 50_000


@pytest.mark.parametrize(("value", "key"), [
    (0.25, "0.25"), (-1e-7, "-1e-07"), (math.inf, "Infinity"), (math.nan, ""), (None, "")])
def test_tables_sort_by_whole_numbers_that_a_script_reads(value, key):
    assert sort_key(value) == key


def test_marks_lead_to_their_pictures_and_bars_are_drawn():
    curve = Curve("a", (1, 2, 4), (1.0, float("nan"), 3.0), bars=((0.5, 2.0), (1.0, 1.0), (2.0, 3.5)),
                  links=(("a-1", "first <1>"), ("a-2", "nan"), ("a-3", "third")))
    axes = Axes("lights", "error", log_x=True, log_y=True)
    svg = curves_plot([curve], axes)
    assert re.findall(r'<a href="#([^"]*)" data-picture="([^"]*)" aria-label="([^"]*)"', svg) == [
        ("row-a-1", "a-1", "first &lt;1&gt;"), ("row-a-3", "a-3", "third")]
    assert "mark:" not in svg
    assert svg.count("LineCollection") == 1 + curves_plot([curve._replace(bars=())], axes).count("LineCollection")


def test_points_that_are_not_joined_have_no_line():
    points, axes = Curve("a", (1, 2, 4), (1.0, 2.0, 3.0)), Axes("x", "y")
    joined, alone = (curves_plot([one], axes) for one in (points, points._replace(joined=False)))
    lines = [len(re.findall(r'<path d="M [^"]*L [^"]*" clip-path', svg.replace("\n", " "))) for svg in (joined, alone)]
    assert lines[0] == lines[1] + 1
    assert joined.count("<use") == alone.count("<use")


@pytest.mark.parametrize(("value", "text"), [
    (0.0, "0"), (1.0, "1"), (0.01234, "0.0123"), (123456.0, "123000"), (-0.5, "\N{MINUS SIGN}0.5"),
    (3.21e-7, "3.21e\N{MINUS SIGN}7"), (float("nan"), "\N{EN DASH}"), (float("inf"), "\N{INFINITY}"), (2.5e7, "2.5e7"),
])
def test_numbers_have_three_digits(value, text):
    assert number(value) == text


def test_the_plot_is_the_same_each_time_and_leaves_out_what_has_no_place():
    points = [Point("sii", 0.2, 1e-2, True), Point("perfect", 0.2, 0.0, True), Point("lost", 1.0, float("nan"), True)]
    svg = time_against_error(points, 1e-4)
    assert svg == time_against_error(points, 1e-4)
    assert svg.startswith("<svg")
    assert "sii" in svg
    assert "perfect" not in svg
    assert "lost" not in svg
    assert "#0102" not in svg


@pytest.mark.parametrize("points", [[], [Point("sii", 0.2, 1e-2, True)]])
def test_a_plot_of_few_points_is_drawn(points):
    assert "</svg>" in time_against_error(points, 0.0)


def test_curves_leave_out_what_cannot_be_drawn():
    points = Curve("a", (1, 2, 4), (1.0, float("nan"), 3.0)), Curve("b", (0, 2, 4), (1.0, 0.0, 3.0), dashed=True)
    svg = curves_plot(points, Axes("lights", "error", log_x=True, log_y=True))
    assert svg == curves_plot(points, Axes("lights", "error", log_x=True, log_y=True))
    assert 'aria-label="error over lights"' in svg
    assert "nan" not in svg
    assert "#0102" not in svg

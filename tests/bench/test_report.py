"""The page of a bench, by itself and clicked through in a browser, against the files that it was made of."""

import re

import pytest

from refgi.bench import report
from refgi.bench.report import Place, overview, page, plot_of
from refgi.compare.album import album
from refgi.compare.pictures import luminance
from tests.bench.folders import HEIGHT, WIDTH, light, make_folder, make_scene, radiance
from tests.compare.browser import clicked
from tests.compare.test_report import Outline
from tests.compare.test_viewer import DIGITS, HALF, RADIANCE, shown

X, Y = 9, 5  # of the pixel that is read
SCRIPT = f"""
    const viewers = () => $$(".viewer select.left").map((select) => select.value);
    const read = async (root) => {{
      point($(".pair .view", root), "pointermove", {X + 0.5} / {WIDTH}, {Y + 0.5} / {HEIGHT});
      await settle();
      return $$(".readout tbody tr", root).map((row) => [...row.cells].map((cell) => cell.textContent));
    }};
    const [first, second] = $$(".viewer");
    await wait(1500);
    found.left = viewers();
    found.numbers = await read(second);
    found.where = $(".pixel", second).textContent;
    found.coarse = $$(".readout .coarse th", second).map((cell) => cell.textContent);
    found.said = $("aside .said", second).textContent;
"""
CLICKS = """
    const mark = $('svg a[data-picture="scene2-vpl-3"]');
    found.title = $("title", mark).textContent;
    mark.dispatchEvent(new MouseEvent("click", { bubbles: true, cancelable: true }));
    await settle();
    found.opened = viewers();
    found.address = location.hash;
    found.active = Viewer.active.root === second;
    $('td a, th a[data-picture="scene1-truth-6"]').click();
    await settle();
    found.row = viewers();
    $('th a[data-picture="scene1-vpl-4"]').click();
    await settle();
    found.none = viewers();
    const table = $$("table.sortable")[1];
    [...table.tHead.rows[0].cells][3].querySelector("button").click();
    found.sorted = [...table.tBodies[0].rows].map((row) => row.id);
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("bench") / "out"


@pytest.fixture(scope="module")
def result(folder):
    return make_folder(folder)


@pytest.fixture(scope="module")
def html(result, folder):
    return page(result, folder)


@pytest.fixture(scope="module")
def found(html, tmp_path_factory):
    return clicked(html, SCRIPT + CLICKS, tmp_path_factory.mktemp("clicked"))


def numbers(rows):
    return [[shown(text) for text in row[1:]] for row in rows]


def test_the_page_is_one_whole_file(html):
    outline = Outline(html)
    assert outline.closed_right
    assert not outline.open
    assert not re.search(r"https?:|[\"'(]//|@import|url\((?!#)", html)
    identifiers = [attributes["id"] for _, attributes in outline.tags if "id" in attributes]
    assert len(identifiers) == len(set(identifiers))
    assert "box &lt;1&gt;" in html
    assert "&lt;grid&gt;" in html
    assert "no &amp; way" in html
    assert "data-refresh" not in html
    assert html.count('class="front"') == 4  # two of each scene


def test_settings_stages_and_files_are_told(html):
    text = " ".join(Outline(html).text)
    for said in ("lights=64", "pictures/1/vpl-01.exr", "rsm", "95 % intervals", "hall"):
        assert said in text


def test_equal_results_give_equal_pages(html, result, folder):
    assert page(result, folder) == html


def test_a_page_that_is_kept_up_to_date_says_so(result, folder):
    empty = result.model_copy(update={"scenes": ()})
    assert '<body data-refresh="7">' in page(empty, folder, 7)


def test_without_pictures_there_are_still_tables_and_plots(result, tmp_path):
    html = page(result, tmp_path)
    assert 'class="viewer"' not in html
    assert html.count("<table") == 3
    assert html.count("<svg") == 3


def test_marks_lead_to_the_rows_of_their_runs():
    svg = plot_of(make_scene("box", "p"), 3)
    links = re.findall(r'<a href="#row-([^"]*)" data-picture="[^"]*" aria-label="([^"]*)"', svg)
    assert links == [("scene3-sii-1", "sii, lights=16: 50 % in 10 ms"),
                     ("scene3-sii-2", "sii, lights=64: 30 % in 40 ms"),
                     ("scene3-vpl-3", "vpl, lights=64: 35 % in 200 ms"),
                     ("scene3-vpl-4", "vpl, lights=128: 40 % in 300 ms"),
                     ("scene3-truth-5", "path tracer, lights=1: 40 % in 50 ms"),
                     ("scene3-truth-6", "path tracer, lights=2: 20 % in 200 ms")]
    assert svg.count("LineCollection") == 3  # bars of three curves


def test_nothing_fails(found):
    assert found["faults"] == []


def test_the_numbers_at_a_pixel_are_those_of_the_files(found):
    truth, other = luminance(light(0))[Y, X], luminance(light(1))[Y, X]
    assert found["where"] == f"Pixel {X}, {Y} · face {Y * WIDTH + X + 100_000} · material {(Y * WIDTH + X) % 7}"
    assert len(found["numbers"]) == 7
    for row, seed in zip(numbers(found["numbers"]), (2, 3, 4, 5, 6, 0, 1), strict=True):
        assert row[:3] == pytest.approx(light(seed)[:, Y, X], rel=HALF + DIGITS)
        assert row[3:6] == pytest.approx(radiance(light(seed))[:, Y, X], rel=RADIANCE)
        over = other if seed == 1 else truth
        error = 0.05 if seed < 2 else luminance(light(seed))[Y, X] - truth
        assert row[6] == pytest.approx(error, abs=4 * HALF, rel=DIGITS)
        assert row[7] == pytest.approx(100 * error / over, abs=400 * HALF / over, rel=DIGITS)
    assert found["coarse"] == []


def test_marks_and_rows_open_their_pictures(found):
    assert found["left"] == ["scene1-sii-1", "scene2-sii-1"]
    assert found["title"] == "vpl, lights=64: 35 % in 400 ms"
    assert found["opened"] == ["scene1-sii-1", "scene2-vpl-3"]
    assert found["address"] == "#scene2-vpl-3"
    assert found["active"]
    assert found["row"] == ["scene1-truth-6", "scene2-vpl-3"]
    assert found["none"] == found["row"]  # a run without a picture


def test_tables_sort_by_error(found):
    right = ("truth-6", "sii-2", "vpl-3", "truth-5", "vpl-4", "sii-1")
    assert found["sorted"] == [f"row-scene1-{name}" for name in right]


def test_coarse_pictures_are_said_to_be_and_judged_by_the_same_means(result, folder, tmp_path, monkeypatch):
    monkeypatch.setattr(report, "album", lambda views: album(views, 29_000))
    html = page(result, folder)
    found = clicked(html, SCRIPT, tmp_path)
    assert found["faults"] == []
    assert found["coarse"] == [f"{name}: lights={n}" for name, n in (
        ("sii", 16), ("sii", 64), ("vpl", 64), ("truth", 1), ("truth", 2))]
    assert "means over 2 \N{MULTIPLICATION SIGN} 2 pixels" in found["said"]
    block = (slice(None), slice(Y - Y % 2, Y - Y % 2 + 2), slice(X - X % 2, X - X % 2 + 2))
    truth = luminance(light(0))[block[1:]].mean()
    for row, seed in zip(numbers(found["numbers"])[:3], (2, 3, 4), strict=True):
        assert row[:3] == pytest.approx(light(seed)[block].mean((1, 2)), rel=HALF + DIGITS)
        assert row[6] == pytest.approx(luminance(light(seed))[block[1:]].mean() - truth, abs=4 * HALF, rel=DIGITS)
    assert numbers(found["numbers"])[5][:3] == pytest.approx(light(0)[:, Y, X], rel=HALF + DIGITS)


def test_each_cell_is_the_best_of_its_method():
    made = overview([Place(make_scene("box", "p"), "#scene1"), Place(make_scene("hall", "p", 2.0), "hall/#scene1")])
    assert made["methods"] == ["sii", "vpl"]
    assert [(row["scene"], row["link"], row["size"]) for row in made["rows"]] == [
        ("box", "#scene1", "24 x 18"), ("hall", "hall/#scene1", "24 x 18")]
    sii, vpl = made["rows"][0]["cells"]
    assert sii == {"ratio": "0.8", "sort": "0.8", "at": "lights=64, 40 ms", "nearest": "30 % in 40 ms", "beaten": ""}
    assert vpl == {"ratio": "1.75", "sort": "1.75", "at": "lights=64, 200 ms", "nearest": "35 % in 200 ms",
                   "beaten": "yes"}
    assert made["rows"][1]["cells"][0]["at"] == "lights=64, 80 ms"


def test_a_method_without_pictures_or_ratio_has_an_empty_cell():
    scene = make_scene("box", "p")
    fast = scene.model_copy(update={"runs": scene.runs[:1], "line": ()})
    made = overview([Place(scene, "a"), Place(fast, "b")])
    assert made["rows"][1]["cells"] == [
        {"ratio": "", "sort": "", "at": "", "nearest": "50 % in 10 ms", "beaten": ""},
        {"ratio": "", "sort": "", "at": "", "nearest": "", "beaten": ""}]


def test_the_plot_has_all_ratios_and_the_path_tracer_at_one():
    svg = overview([Place(make_scene("box", "p"), "")])["plot"]
    assert [name for name in ("sii", "vpl", "path tracer") if f">{name}<" in svg.replace("\n", "")] == [
        "sii", "vpl", "path tracer"]
    assert 'aria-label="RMSE over' in svg
    assert re.search(r"stroke-dasharray", svg)
    none = make_scene("box", "p").model_copy(update={"runs": ()})
    assert overview([Place(none, "")])["plot"] == ""

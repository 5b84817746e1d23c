"""The frame of a paper: figures apart from each other, whole files, page and record; and of each paper all figures."""

import json
import math
import re

import imageio.v3
import numpy as np
import pytest

from benchmarks.harness import interleaved
from benchmarks.papers.records import PAPERS, Entry, choose, find_paper
from benchmarks.papers.runner import as_json, page, reproduce
from benchmarks.papers.workbench import FULL, QUICK, Workbench
from refgi.errors import InputError
from refgi.image import read_exr
from tests.benchmarks.papers.conftest import ENTRIES, TINY, gradient
from tests.compare.test_report import Outline

KEYS = {"sii": ["fig4", "fig6", "fig7", "fig8", "fig9", "fig10", "fig11", "fig12", "fig13", "table1", "table2",
                "table3"],
        "multires": ["fig1", "fig5", "fig6", "fig7", "fig8", "fig9", "fig10", "fig11", "fig12", "fig13", "fig14",
                     "fig15", "table1", "table2"],
        "val": ["fig1", "fig4", "fig5", "fig6", "fig7", "fig8", "fig9", "fig10", "fig11", "fig12", "fig13", "table1",
                "table2"],
        "hssil": ["fig2", "fig4", "fig5", "fig6", "fig7", "fig8", "fig9", "temporal", "visibility", "error"]}


@pytest.fixture
def made(paper):
    return reproduce(paper, scale=TINY)


@pytest.mark.slow
def test_one_figure_that_fails_leaves_the_others(made):
    assert [outcome.figure is not None for outcome in made.outcomes] == [True, False, True]
    assert made.failures == {"fig2": "ZeroDivisionError: by hand"}
    assert not made.is_sound


@pytest.mark.slow
def test_without_a_failure_it_is_sound(paper):
    assert reproduce(paper, scale=TINY, only=["fig1", "table1"]).is_sound


@pytest.mark.slow
def test_figures_come_in_the_papers_order(paper):
    assert [entry.key for entry in choose(paper, ["table1", "fig1"])] == ["fig1", "table1"]
    with pytest.raises(InputError, match=r"expected some of fig1, fig2, table1, got 'fig9'"):
        choose(paper, ["fig1", "fig9"])
    with pytest.raises(InputError, match="got none"):
        choose(paper, [])


@pytest.mark.slow
def test_papers_are_found_by_name():
    assert find_paper("sii") is PAPERS["sii"]
    with pytest.raises(InputError, match="got 'rsm'"):
        find_paper("rsm")


def test_pictures_and_record_are_written(paper, tmp_path):
    reproduce(paper, scale=TINY, out=tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "fig1_left.exr", "fig1_left.png", "fig1_right.png", "index.html", "results.json"]
    figure = gradient(None)
    planes, attributes = read_exr(tmp_path / "fig1_left.exr")
    assert np.array_equal(planes["Y"], figure.pictures[0].planes["Y"])
    assert attributes["settings"] == {"lights": 7}
    assert np.array_equal(imageio.v3.imread(tmp_path / "fig1_right.png"), figure.pictures[1].pixels)
    record = json.loads((tmp_path / "results.json").read_text())
    assert record["failures"] == {"fig2": "ZeroDivisionError: by hand"}
    assert record["sound"] is False
    assert record["figures"]["table1"]["tables"][0]["rows"] == [["slow", 12.345, 10.4], ["fast", None, "n/a"]]
    assert record["figures"]["table1"]["ratios"][0]["bars"][1] == {"label": "fast", "here": 4.0, "paper": None}
    assert record["figures"]["fig1"]["pictures"][0]["files"] == ["fig1_left.png", "fig1_left.exr"]
    assert record["scale"]["size"] == 16


@pytest.mark.slow
def test_an_interrupted_run_leaves_whole_files(paper, tmp_path, monkeypatch):
    def interrupt(_bench):
        raise KeyboardInterrupt

    entries = (*ENTRIES[:2], Entry("fig3", "Figure 3", "Never", "Nothing.", interrupt), ENTRIES[2])
    monkeypatch.setattr(type(paper), "load", lambda _: entries)
    with pytest.raises(KeyboardInterrupt):
        reproduce(paper, scale=TINY, out=tmp_path)
    record = json.loads((tmp_path / "results.json").read_text())
    assert sorted(record["figures"]) == ["fig1", "fig2"]
    assert record["sound"] is False
    html = (tmp_path / "index.html").read_text()
    assert "the run ended before the other 2" in html
    assert html.endswith("</html>\n") or html.endswith("</html>")
    assert not list(tmp_path.glob(".*"))


@pytest.mark.slow
def test_the_page_refers_to_nothing_outside_itself_and_is_well_formed(made):
    html = page(made)
    assert not re.search(r"https?:|[\"'(]//|@import|url\((?!#)", html)
    outline = Outline(html)
    assert outline.closed_right
    assert not outline.open
    assert all(i["src"].startswith("data:image/png;base64,") and i["alt"] for i in outline.all("img") if "src" in i)
    identifiers = [a["id"] for _, a in outline.tags if "id" in a]
    assert len(identifiers) == len(set(identifiers))
    targets = [a["href"] for a in outline.all("a")]
    assert targets == ["#fig1", "#table1"]


@pytest.mark.slow
def test_the_page_holds_every_figure(made):
    html = page(made)
    text = " ".join(Outline(html).text)
    for said in ("Left <picture>", "RMSE 3 %", "12.3", "ms, paper", "Here & there alike.", "A plot.", "lights",
                 "2 of 3 figures and tables made.", "could not be made: ZeroDivisionError: by hand"):
        assert said in text
    assert "<picture>" not in html
    assert html.count("<svg") == 1
    assert 'class="here"><i style="width:25.00%"' in html
    assert 'class="here"><i style="width:100.00%"' in html


@pytest.mark.slow
def test_a_paper_of_which_nothing_works_has_a_page(paper):
    assert "0 of 1 figures and tables made." in page(reproduce(paper, scale=TINY, only=["fig2"]))


@pytest.mark.slow
def test_progress_names_each_figure(paper):
    told = []
    reproduce(paper, scale=TINY, progress=lambda what, done: told.append((what, round(done, 2))))
    assert told == [("Figure 1 (1 of 3)", 0.0), ("Figure 2 (2 of 3)", 0.33), ("Table 1 (3 of 3)", 0.67),
                    ("handmade", 1.0)]


@pytest.mark.slow
def test_work_is_timed_in_turn_after_a_warm_up():
    order = []
    seconds = interleaved({"a": lambda: order.append("a"), "b": lambda: order.append("b")}, 2)
    assert list(seconds) == ["a", "b"]
    assert order == ["a", "b", "a", "b", "a", "b"]


@pytest.mark.slow
def test_a_workbench_makes_things_once():
    bench = Workbench(TINY)
    assert bench.frame("cornell_box") is bench.frame("cornell_box")
    assert bench.frame("cornell_box") is not bench.frame("cornell_box", width=8)
    assert bench.frame("cornell_box").width == TINY.size
    assert QUICK.size < FULL.size


@pytest.mark.slow
def test_a_folder_that_cannot_be_written_is_refused(paper, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        reproduce(paper, scale=TINY, out=tmp_path / "file")


@pytest.fixture(params=PAPERS)
def name(request):
    return request.param


@pytest.mark.slow
def test_every_figure_is_made_and_has_a_place_on_the_page(name, reproduced):
    made, figures = reproduced(name)
    assert [entry.key for entry in find_paper(name).load()] == KEYS[name] == list(figures)
    assert made.is_sound
    html = page(made)
    identifiers = [attributes["id"] for _, attributes in Outline(html).tags if "id" in attributes]
    assert len(identifiers) == len(set(identifiers))  # those inside of several plots too
    for outcome in made.outcomes:
        assert f'<section id="{outcome.entry.key}"' in html
        assert outcome.figure.notes, f"{outcome.entry.key} does not say how its shape compares"
    assert html.count("<img width") == sum(len(figure.pictures) for figure in figures.values())
    assert as_json(made)["sound"] is True


@pytest.mark.slow
def test_pictures_are_whole_and_finite(name, reproduced):
    for key, figure in reproduced(name)[1].items():
        for picture in figure.pictures:
            assert picture.pixels.dtype == np.uint8
            for channel, plane in picture.planes.items():
                assert np.isfinite(plane).all(), (key, picture.name, channel)
                assert plane.shape == picture.pixels.shape[:2]
        assert len({picture.name for picture in figure.pictures}) == len(figure.pictures)


@pytest.mark.slow
def test_every_number_is_finite(name, reproduced):
    for key, figure in reproduced(name)[1].items():
        values = [value for one in figure.ratios for bar in one.bars for value in bar[1:]]
        values += [cell for table in figure.tables for row in table.rows for cell in row]
        assert all(math.isfinite(value) for value in values if isinstance(value, float)), key
        assert all(len(row) == len(table.columns) for table in figure.tables for row in table.rows)
        assert not any("nan" in note or "inf " in note for note in figure.notes), key

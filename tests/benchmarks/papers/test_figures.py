"""What holds for every paper: all figures are made, stand on the page, and hold finite pictures and numbers."""

import math

import numpy as np
import pytest

from benchmarks.papers.records import PAPERS, find_paper
from benchmarks.papers.runner import as_json, page
from tests.compare.test_report import Outline

KEYS = {"sii": ["fig4", "fig6", "fig7", "fig8", "fig9", "fig10", "fig11", "fig12", "fig13", "table1", "table2",
                "table3"],
        "multires": ["fig1", "fig5", "fig6", "fig7", "fig8", "fig9", "fig10", "fig11", "fig12", "fig13", "fig14",
                     "fig15", "table1", "table2"],
        "val": ["fig1", "fig4", "fig5", "fig6", "fig7", "fig8", "fig9", "fig10", "fig11", "fig12", "fig13", "table1",
                "table2"],
        "hssil": ["fig2", "fig4", "fig5", "fig6", "fig7", "fig8", "fig9", "temporal", "visibility", "error"]}


pytestmark = pytest.mark.slow  # whole papers are made


@pytest.fixture(params=PAPERS)
def name(request):
    return request.param


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


def test_pictures_are_whole_and_finite(name, reproduced):
    for key, figure in reproduced(name)[1].items():
        for picture in figure.pictures:
            assert picture.pixels.dtype == np.uint8
            for channel, plane in picture.planes.items():
                assert np.isfinite(plane).all(), (key, picture.name, channel)
                assert plane.shape == picture.pixels.shape[:2]
        assert len({picture.name for picture in figure.pictures}) == len(figure.pictures)


def test_every_number_is_finite(name, reproduced):
    for key, figure in reproduced(name)[1].items():
        values = [value for one in figure.ratios for bar in one.bars for value in bar[1:]]
        values += [cell for table in figure.tables for row in table.rows for cell in row]
        assert all(math.isfinite(value) for value in values if isinstance(value, float)), key
        assert all(len(row) == len(table.columns) for table in figure.tables for row in table.rows)
        assert not any("nan" in note or "inf " in note for note in figure.notes), key

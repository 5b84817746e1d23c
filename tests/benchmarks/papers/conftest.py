"""Papers made tiny, once for all tests, and one made by hand: pictures, ratios, tables and notes without rendering."""

from functools import cache

import numpy as np
import pytest

from benchmarks.papers.records import Bar, Entry, Figure, Paper, Picture, Plot, Ratios, Table
from benchmarks.papers.runner import reproduce
from benchmarks.papers.workbench import Scale, Workbench

TINY = Scale("tiny", 16, 16, 1, 2, 64)
SMALL = Scale("small", 32, 32, 1, 2, 256)
PAPER_STEPS = {"deferred rendering": 0.4, "VPL generation": 0.1, "VAL clustering": 0.5, "CSSM": 4.2,
               "indirect illumination": 35.0, "geometry-aware blur": 10.7}  # ms, Table 2


def gradient(_bench):
    grey = np.linspace(0, 1, 24, dtype=np.float32).reshape(4, 6)
    pixels = np.repeat((255 * grey[..., None]).astype(np.uint8), 3, axis=2)
    return Figure(("made by hand",), (
        Picture("left", "Left <picture>", "RMSE 3 %", pixels, {"Y": grey}, {"lights": 7}),
        Picture("right", "Right", "no planes", pixels[:, ::-1])))


def numbers(bench):
    return Figure((f"{bench.scale.size} pixels",),
                  ratios=(Ratios("speed", (Bar("slow", 1.0, 1.0), Bar("fast", 4.0, None))),),
                  tables=(Table("times", ("", "ms", "ms, paper"), (("slow", 12.345, 10.4), ("fast", None, "n/a"))),),
                  plots=(Plot("<svg viewBox='0 0 1 1'></svg>", "A plot."),), notes=("Here & there alike.",))


def broken(_bench):
    raise ZeroDivisionError("by hand")


ENTRIES = (Entry("fig1", "Figure 1", "A gradient", "A gradient.", gradient),
           Entry("fig2", "Figure 2", "What breaks", "Nothing.", broken),
           Entry("table1", "Table 1", "Numbers", "Numbers.", numbers))


@pytest.fixture
def paper(monkeypatch):
    made = Paper("handmade", "A <paper>", "Nobody & others, 1906")
    monkeypatch.setattr(Paper, "load", lambda _: ENTRIES)
    return made


@pytest.fixture(scope="module")
def bench():
    return Workbench(SMALL)


def table(figure, number=0):
    """Return the rows of a table by their first cell."""
    return {row[0]: dict(zip(figure.tables[number].columns, row, strict=True)) for row in figure.tables[number].rows}


@pytest.fixture(scope="session")
def reproduced():
    """Return a function that makes a paper again and gives the outcome and its figures by key."""

    @cache
    def once(name):
        made = reproduce(name, scale=SMALL)
        assert made.failures == {}
        return made, {outcome.entry.key: outcome.figure for outcome in made.outcomes}

    return once

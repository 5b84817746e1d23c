"""Splits of errors: synthetic chains by closed forms, the choices that are split, and their words and bars."""

import numpy as np
import pytest

from refgi.bench.grid import Choice, Grid
from refgi.bench.report import bars, splits_of
from refgi.bench.results import Figures, Part, Run, Split, percent, rows_of_split, said_of_split, tables_of
from refgi.bench.split import Chain, Link, Without, chosen_for_split, small_size, split_of
from refgi.cluster.settings import ValSettings
from refgi.settings import of
from refgi.splat.sii import SiiSettings

SHAPE = (3, 48, 64)
COVERED = np.ones(SHAPE[1:], bool)
COVERED[:, 60:] = False
MEAN = 2.0
CHOICE = Choice("sii", ("lights=64",), of(SiiSettings, lights=64))


def ramp(axis):
    """Return a field of mean 0 and mean square 1 over covered pixels, one that no other axis resembles."""
    field = np.zeros(SHAPE)
    sign = np.where(np.indices(SHAPE)[axis] % 2, 1.0, -1.0)
    field[:] = sign if axis else np.where(np.indices(SHAPE)[1] % 4 < 2, 1.0, -1.0)
    return field


def chain(*steps, truth_noise=0.0, alone=None):
    """Return a chain from a flat truth; a step is a name and what it adds for each seed."""
    truth = np.full(SHAPE, MEAN)
    pictures = tuple(truth for _ in steps[0][1])
    links = [Link("truth", "", pictures, np.full(SHAPE, truth_noise**2))]
    for name, added in steps:
        pictures = tuple(old + new for old, new in zip(pictures, added, strict=True))
        for picture in pictures:
            picture[:, ~COVERED] = np.nan
        links.append(Link(name, f"about {name}", pictures, np.zeros(SHAPE)))
    return Chain(tuple(links), alone or {}, COVERED)


def test_means_add_up_and_squares_with_their_cross_terms():
    """d1 = 0.4 + 0.3 u and d2 = -0.1 - 0.3 u + 0.2 v, u and v orthogonal: all by hand."""
    u, v = ramp(1), ramp(2)
    found = split_of(chain(("a", [0.4 + 0.3 * u] * 2), ("b", [-0.1 - 0.3 * u + 0.2 * v] * 2)), CHOICE, True, "+-1 %")
    a, b = found.parts
    assert (a.name, a.about, found.method, found.knee, found.truth) == ("a", "about a", "sii", True, "+-1 %")
    assert (found.width, found.height, found.label) == (64, 48, "sii, lights=64 (knee)")
    assert [a.mean, b.mean, found.mean] == pytest.approx([0.4 / MEAN, -0.1 / MEAN, 0.3 / MEAN])
    assert [a.error.rmse**2, b.error.rmse**2] == pytest.approx([0.25 / 4, 0.14 / 4])
    whole = 0.3**2 + 0.2**2  # of 0.3 + 0.2 v
    assert found.error.rmse**2 == pytest.approx(whole / 4)
    assert found.squares == pytest.approx(0.39 / 4)
    assert found.cross == pytest.approx(2 * (-0.04 - 0.09) / 4)
    assert found.squares + found.cross == pytest.approx(whole / 4)
    assert [a.share, b.share] == pytest.approx([0.4 * 0.3 / whole, (-0.1 * 0.3 + 0.2**2) / whole])
    assert a.alone is None
    assert found.cross_alone is None


def test_random_chains_telescope():
    random = np.random.default_rng(3)
    steps = [(str(k), [random.normal(k - 2, 0.5 + k, SHAPE) for _ in range(3)]) for k in range(5)]
    found = split_of(chain(*steps), CHOICE)
    assert sum(part.mean for part in found.parts) == pytest.approx(found.mean, rel=1e-12)
    assert sum(part.share for part in found.parts) == pytest.approx(1, rel=1e-12)
    assert sum(part.error.rmse**2 for part in found.parts) == pytest.approx(found.squares, rel=1e-9)
    assert found.squares + found.cross == pytest.approx(found.error.rmse**2, rel=1e-9)


def test_bias_and_spread_of_a_step_are_apart_and_the_truth_s_noise_is_in_the_first():
    random = np.random.default_rng(4)
    noisy = [0.3 * ramp(1) + 0.5 * random.standard_normal(SHAPE) for _ in range(6)]
    found = split_of(chain(("a", [0.2 * ramp(2)] * 6), ("b", noisy), truth_noise=0.1), CHOICE)
    a, b = found.parts
    assert (a.error.spread, a.error.noise) == (0, pytest.approx(0.1 / MEAN))
    assert a.error.bias == pytest.approx(np.sqrt(0.2**2 - 0.1**2) / MEAN)
    assert (b.error.spread, b.error.bias) == (pytest.approx(0.5 / MEAN, rel=0.02), pytest.approx(0.3 / MEAN, rel=0.02))
    assert b.error.noise == 0


def test_what_each_costs_alone():
    """Without a the error is 0.5 u, judged by another truth without b 0.2: noise of 0.3 is in both truths."""
    u, truth, noise = ramp(1), np.full(SHAPE, MEAN), np.full(SHAPE, 0.09)
    alone = {"a": Without((truth + 0.5 * u,), truth, noise), "b": Without((truth + 1.2,), truth + 1, 0 * noise)}
    found = split_of(chain(("a", [0.4 + 0 * u]), ("b", [0.6 * u]), truth_noise=0.3, alone=alone), CHOICE)
    whole = (0.4**2 + 0.6**2 - 0.09) / 4
    a, b = (part.alone for part in found.parts)
    assert [a.rmse**2, b.rmse**2] == pytest.approx([(0.25 - 0.09) / 4, 0.04 / 4])
    assert [a.square, b.square] == pytest.approx([whole - 0.04, whole - 0.01])
    assert [a.mean, b.mean] == pytest.approx([0.4 / 2, (0.4 - 0.2) / 2])
    assert found.cross_alone == pytest.approx(whole - a.square - b.square)


def test_black_truths_and_broken_pictures_are_not_known():
    nothing = np.zeros(SHAPE)
    black = Chain((Link("truth", "", (nothing,), nothing), Link("a", "", (nothing + 1,), nothing)),
                  {"a": Without((nothing,), nothing, nothing)}, COVERED)
    for made in (black, chain(("a", [np.full(SHAPE, np.inf)]))):
        found = split_of(made, CHOICE)
        assert found.squares is found.parts[0].mean is found.cross_alone is None
        assert said_of_split(found).endswith("not known.")
        assert "nan" not in "".join(map("".join, rows_of_split(found)))
        assert Split.model_validate_json(found.model_dump_json()) == found
        assert bars([found]).startswith("<svg")


def run(method, lights, seconds, rmse):
    errors = {"truth": Figures(rmse=rmse, low=None, high=None, bias=None, spread=None, noise=None)}
    return Run(method=method, changes=(f"lights={lights}",), settings={}, times=(seconds,), stages={}, errors=errors)


def test_the_default_and_the_knee_are_split():
    """Of sii the knee is in the middle; that of val is its default, once; of vpl no error is known."""
    settings = {"sii": [(16, 1.0, 0.5), (64, 2.0, 0.2), (256, 8.0, 0.19)], "val": [(1024, 1.0, 0.1)],
                "vpl": [(64, 1.0, None)]}
    runs = [run(method, *row) for method, rows in settings.items() for row in rows]
    kinds = {"sii": SiiSettings, "val": ValSettings}
    grid = Grid(tuple(Choice(one.method, one.changes, of(kinds.get(one.method, SiiSettings), lights=int(
        one.changes[0][7:]))) for one in runs), ())
    found = chosen_for_split(runs, grid)
    assert [(one.method, one.label, knee) for one, knee in found] == [
        ("sii", "default", False), ("sii", "lights=64", True), ("val", "lights=1024", True), ("vpl", "default", False)]
    assert found[1][0].settings.lights.count == 64


@pytest.mark.parametrize(("size", "small"), [((1024, 768), (128, 96)), ((768, 1024), (96, 128)), ((64, 100), (64, 100)),
                                             ((4000, 3), (128, 1))])
def test_views_that_are_split_are_small(size, small):
    assert small_size(*size) == small


def split(**changes):
    u, v = ramp(1), ramp(2)
    truth = np.full(SHAPE, MEAN)
    alone = {"visibility": Without((truth + 0.1 * u,), truth, np.zeros(SHAPE))}
    made = chain(("visibility", [0.4 + 0.3 * u]), ("cut", [-0.1 - 0.3 * u + 0.2 * v]), alone=alone)
    return split_of(made, CHOICE).model_copy(update=changes)


def test_words_and_tables_have_the_figures():
    rows = rows_of_split(split())
    assert [row[0] for row in rows] == ["visibility", "cut", "all together"]
    assert rows[0] == ("visibility", "20", "25", "", "92.3", "5", "0")
    assert rows[-1][:3] == ("all together", "15", percent(np.sqrt(0.13) / 2))
    said = said_of_split(split())
    assert said.startswith("sii, lights=64: RMSE 18 %, of whose square 92.3 % is visibility.")
    assert "sum to 9.75 % of the truth's mean squared" in said
    assert "cross terms to \N{MINUS SIGN}6.5 %, both together to 3.25 %" in said
    assert said.endswith("With visibility alone switched off RMSE would be 5 %.")
    parts = tuple(part.model_copy(update={"share": 1.5 - 2 * k}) for k, part in enumerate(split().parts))
    assert "of whose square 150 % is visibility, of which cut takes back 50 %." in said_of_split(split(parts=parts))
    lines = list(tables_of([split(), split(knee=True)]))
    assert sum(line.startswith("| visibility |") for line in lines) == 2
    assert list(tables_of([])) == []


def test_bars_have_a_row_each_and_a_legend():
    svg = bars([split(), split(method="val", knee=True)])
    assert svg.count(">lights=64") == 2
    for text in ("sii", "val", "lights=64", "lights=64 (knee)", "visibility", "cut", "sum"):
        assert f">{text}</text>" in svg
    assert "href=\"http" not in svg
    assert bars([split()]) == bars([split()])
    shown = splits_of([split()])
    assert len(shown["tables"]) == 1
    assert splits_of([]) is None


def test_parts_that_change_nothing_show_no_bar():
    """Without its bars a part leaves its patch in the legend alone."""
    none = Part(name="cut", about="", error=split().parts[1].error, mean=0.0, share=0.0)
    shown, hidden = (bars([split(parts=(split().parts[0], part))]) for part in (split().parts[1], none))
    patches = [svg.count('id="p') - svg.count("tick") for svg in (shown, hidden)]
    assert patches[0] > 0
    count = [svg.count("patch_") for svg in (shown, hidden)]
    assert count[0] - count[1] == 2

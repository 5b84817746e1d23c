"""Signed stacked bars of split errors, a bar for each method and setting, for a page.

Two panels: the change of the mean that each approximation makes, and its share of the whole's mean square error. In
both the parts add up exactly; what lies below 0 takes back what others did. A mark shows the sum.
"""

from collections.abc import Sequence
from typing import Any

from refgi.bench.results import Part, Split
from refgi.bench.split_text import COLUMNS, rows_of_split, said_of_split
from refgi.compare.plot import CARD, INK, LINE, METHOD_COLOURS, figure_svg, style_plot

HATCHES = ("", "////", "\\\\\\\\")  # of approximations that share a colour; dots would be a quarter of a MB each
LEAST = 1e-4  # a part of less than that shows in no bar
WIDTH, HEIGHT, ROW = 9.2, 1.5, 0.45  # inches: of the plot, of what stands around the bars, and of a bar
LEGEND_ROW = 0.18  # inches, of a name
HOW = ("From the truth to the method as it is used, one approximation more at a time, in the order of its pipeline. "
       "Left: what each changes of the mean. Right: its share of the mean square error, its own square and half of its "
       "cross terms with others. Both add up to the mark; what lies on the other side takes back what others did. "
       "The tables also have what the error would be with one approximation alone switched off.")


def splits_of(splits: Sequence[Split]) -> dict[str, Any] | None:
    """Return what the page's template shows of a scene's splits; None without splits."""
    from markupsafe import Markup

    if not splits:
        return None
    return {"how": HOW, "plot": Markup(bars(splits)), "columns": COLUMNS,
            "tables": [{"said": said_of_split(split), "rows": rows_of_split(split)} for split in splits]}


def bars(splits: Sequence[Split]) -> str:
    """Draw a bar for each split, top to bottom: an ``<svg>`` element that refers to nothing outside itself."""
    names = list(dict.fromkeys(part.name for split in splits for part in split.parts))

    def draw(figure: Any) -> None:
        left, right = figure.subplots(1, 2, sharey=True)
        _panel(left, [[part.mean for part in split.parts] for split in splits], splits, names)
        _panel(right, [[part.share for part in split.parts] for split in splits], splits, names)
        left.set(xlabel="change of the mean, %", yticks=range(len(splits)),
                 yticklabels=[split.label.replace(", ", "\n") for split in splits])
        right.set(xlabel="share of the square, %")
        left.invert_yaxis()
        handles, labels = _legend(names)
        legend = figure.legend(handles, labels, loc="outside right upper", frameon=False, fontsize=9)
        for text in (*left.get_yticklabels(), *legend.get_texts()):
            text.set_parse_math(False)  # a name is no formula

    return figure_svg(draw, (WIDTH, HEIGHT + max(len(splits) * ROW, len(names) * LEGEND_ROW)), "Error split")


def stacked(values: Sequence[float]) -> list[tuple[float, float]]:
    """Return where the parts of a signed bar begin, and their lengths.

    Those above 0 follow each other to the right of 0, those below to the left.

    >>> stacked([3, -1, 2, -4])
    [(0.0, 3), (0.0, -1), (3.0, 2), (-1.0, -4)]
    """
    ends, found = {True: 0.0, False: 0.0}, []
    for value in values:
        found.append((ends[value >= 0], value))
        ends[value >= 0] += value
    return found


def _panel(
    plot: Any, rows: Sequence[Sequence[float | None]], splits: Sequence[Split], names: Sequence[str]
) -> None:
    style_plot(plot)
    plot.grid(True, axis="x", color=LINE, linewidth=0.8)
    plot.use_sticky_edges = False
    plot.margins(x=0.06)
    plot.axvline(0, color=INK, linewidth=0.8)
    plot.tick_params(axis="y", length=0, labelsize=8)
    for row, (values, split) in enumerate(zip(rows, splits, strict=True)):
        known = [100 * (value or 0.0) for value in values]
        for part, (begin, length) in zip(split.parts, stacked(known), strict=True):
            if abs(length) > 100 * LEAST:
                plot.barh(row, length, left=begin, height=0.66, **_look(part, names))
        plot.plot([sum(known)], [row], "D", markersize=5, color=INK, markerfacecolor=CARD)


def _look(part: Part, names: Sequence[str]) -> dict[str, Any]:
    number = names.index(part.name)
    return {"facecolor": METHOD_COLOURS[number % len(METHOD_COLOURS)], "edgecolor": CARD, "linewidth": 0.8,
            "hatch": HATCHES[number // len(METHOD_COLOURS) % len(HATCHES)]}


def _legend(names: Sequence[str]) -> tuple[list[Any], list[str]]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    looks = [_look(Part.model_construct(name=name), names) for name in names]
    total = Line2D([], [], color=INK, marker="D", markerfacecolor=CARD, linestyle="")
    return [*(Patch(**look) for look in looks), total], [*names, "sum"]

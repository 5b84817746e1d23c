"""Lines over an axis as an SVG that lives inside a paper's page and takes its colours."""

import hashlib
import io
import math
import re
from collections.abc import Sequence
from typing import Any, NamedTuple

from refgi.compare.plot import CARD, INK, LINE, METHOD_COLOURS

MARKERS = "os^Dvp"
MOST_MARKED = 64  # points of a line that are marked; more would hide it


class Curve(NamedTuple):
    """One line: its name and where it goes."""

    name: str
    x: Sequence[float]
    y: Sequence[float]
    dashed: bool = False


class Axes(NamedTuple):
    """What the axes say and whether their steps are factors."""

    x: str
    y: str
    log_x: bool = False
    log_y: bool = False


def drawn(curves: Sequence[Curve], axes: Axes) -> str:
    """Draw curves with a legend beside them.

    Parameters
    ----------
    curves : sequence of Curve
        Points that are not finite, or not positive on a logarithmic axis, are left out.
    axes : Axes
        Labels and scales.

    Returns
    -------
    str
        An ``<svg>`` element without references to anything outside; the same for equal input.
    """
    import matplotlib
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    style: Any = {"svg.hashsalt": "refgi", "svg.fonttype": "none", "font.family": "sans-serif", "text.color": INK,
                  "axes.labelcolor": INK, "axes.edgecolor": LINE, "xtick.color": INK, "ytick.color": INK,
                  "xtick.minor.size": 0, "ytick.minor.size": 0}
    with matplotlib.rc_context(style):
        figure = Figure(figsize=(9.2, 4.3), layout="constrained")
        figure.patch.set_alpha(0)
        _draw(figure.add_subplot(), curves, axes)
        stream = io.StringIO()
        canvas: Any = FigureCanvasSVG(figure)
        canvas.print_svg(stream, metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    return _inlined(stream.getvalue(), f"{axes.y} over {axes.x}")


def _draw(plot: Any, curves: Sequence[Curve], axes: Axes) -> None:
    from matplotlib.ticker import LogLocator

    plot.patch.set_alpha(0)
    plot.set(xlabel=axes.x, ylabel=axes.y)
    plot.spines[["top", "right"]].set_visible(False)
    plot.grid(True, which="major", color=LINE, linewidth=0.8)
    plot.set_axisbelow(True)
    for number, curve in enumerate(curves):
        colour = METHOD_COLOURS[number % len(METHOD_COLOURS)]
        points = [(x, y) for x, y in zip(curve.x, curve.y, strict=True) if _drawable(x, y, axes)]
        marked = {"marker": MARKERS[number % len(MARKERS)], "markersize": 5, "markerfacecolor": colour,
                  "linewidth": 1.6}
        plot.plot([x for x, _ in points], [y for _, y in points], color=colour, label=curve.name,
                  **(marked if len(points) <= MOST_MARKED else {"linewidth": 1.1}),
                  linestyle=(0, (4, 3)) if curve.dashed else "-")
    plot.set(xscale="log" if axes.log_x else "linear", yscale="log" if axes.log_y else "linear")
    for axis in (plot.xaxis, plot.yaxis):
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter("")
    if axes.log_x:
        plot.set_xticks(_steps(curves))
    if axes.log_y:
        plot.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    else:
        plot.set_ylim(bottom=0)
    plot.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False, fontsize=9, facecolor=CARD)


def _steps(curves: Sequence[Curve]) -> list[float]:
    """Return the places along a logarithmic axis that are named: those of the points, or powers of two."""
    places = sorted({x for curve in curves for x in curve.x if x > 0})
    if len(places) <= 10:
        return places
    low, high = (math.log2(x) for x in (places[0], places[-1]))
    return [2.0**n for n in range(math.ceil(low), math.floor(high) + 1)]


def _drawable(x: float, y: float, axes: Axes) -> bool:
    finite = math.isfinite(x) and math.isfinite(y)
    return finite and (x > 0 or not axes.log_x) and (y > 0 or not axes.log_y)


def _inlined(svg: str, label: str) -> str:
    svg = svg[svg.index("<svg"):]
    svg = re.sub(r"<metadata>.*?</metadata>|<style.*?</style>", "", svg, flags=re.DOTALL)
    own = hashlib.sha256(svg.encode()).hexdigest()[:8]  # names are unique on a page of several plots
    svg = re.sub(r'( id="|url\(#|href="#)', rf"\g<1>p{own}_", svg)
    svg = re.sub(r' xmlns(:\w+)?="[^"]*"', "", svg)
    svg = re.sub(r'<svg [^>]*viewBox="([^"]*)"[^>]*>', rf'<svg viewBox="\1" role="img" aria-label="{label}">', svg,
                 count=1)
    colours = {INK: "currentColor", LINE: "var(--line)", CARD: "var(--card)"}
    colours |= {colour: f"var(--c{i})" for i, colour in enumerate(METHOD_COLOURS)}
    return re.sub("|".join(colours), lambda match: colours[match[0]], svg)

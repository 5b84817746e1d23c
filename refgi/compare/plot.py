"""Run time against error as an SVG that lives inside the page and takes its colours."""

import io
import math
import re
from typing import Any, NamedTuple

INK, LINE, CARD = "#010203", "#010204", "#010205"  # stand-ins, replaced by the page's own colours
METHOD_COLOURS = [f"#0102{16 + i:02x}" for i in range(6)]


class Point(NamedTuple):
    """One method's run time (s) and error against one reference."""

    name: str
    seconds: float
    error: float
    filled: bool  # against the truth itself


def time_against_error(points: list[Point], noise: float, error_name: str = "relMSE") -> str:
    """Draw methods by run time and error, both logarithmic.

    Parameters
    ----------
    points : list of Point
        Those whose time or error is not a positive finite number are left out.
    noise : float
        What the truth's noise alone gives, drawn as a dashed line where it is positive.
    error_name : str
        The axis label.

    Returns
    -------
    str
        An ``<svg>`` element without references to anything outside; the same for equal input.
    """
    import matplotlib
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    style: Any = {"svg.hashsalt": "refgi", "svg.fonttype": "none", "font.family": "sans-serif",
                             "text.color": INK, "axes.labelcolor": INK, "axes.edgecolor": LINE, "xtick.color": INK,
                             "ytick.color": INK, "xtick.minor.size": 0, "ytick.minor.size": 0}
    with matplotlib.rc_context(style):
        figure = Figure(figsize=(7.6, 4.3), layout="constrained")
        figure.patch.set_alpha(0)
        _draw(figure.add_subplot(), [p for p in points if _drawable(p)], noise, error_name)
        stream = io.StringIO()
        canvas: Any = FigureCanvasSVG(figure)
        canvas.print_svg(stream, metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    return _inlined(stream.getvalue())


def _draw(axes: Any, points: list[Point], noise: float, error_name: str) -> None:
    names = list(dict.fromkeys(point.name for point in points))
    axes.patch.set_alpha(0)
    axes.set(xscale="log", yscale="log", xlabel="run time, s", ylabel=f"{error_name} of indirect irradiance")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(True, which="major", color=LINE, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.margins(x=0.18, y=0.15)
    for point in points:
        colour = METHOD_COLOURS[names.index(point.name) % len(METHOD_COLOURS)]
        axes.plot([point.seconds], [point.error], "o", markersize=9, color=colour, markeredgewidth=1.8,
                  markerfacecolor=colour if point.filled else CARD)
        axes.annotate(point.name, (point.seconds, point.error), (9, 0), textcoords="offset points", va="center",
                      fontsize=10)
    if noise > 0:
        axes.axhline(noise, color=INK, linewidth=1, linestyle=(0, (4, 4)), alpha=0.6)
    if len(points) < 2 or len({point.seconds for point in points}) < 2:
        axes.set_xlim(*_decade_around([point.seconds for point in points] or [1.0]))


def _decade_around(values: list[float]) -> tuple[float, float]:
    return min(values) / 10**0.5, max(values) * 10**0.5


def _drawable(point: Point) -> bool:
    return all(math.isfinite(value) and value > 0 for value in (point.seconds, point.error))


def _inlined(svg: str) -> str:
    svg = svg[svg.index("<svg"):]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r' xmlns(:\w+)?="[^"]*"', "", svg)
    svg = re.sub(r'<svg [^>]*viewBox="([^"]*)"[^>]*>',
                 r'<svg viewBox="\1" role="img" aria-label="Run time against error">', svg, count=1)
    colours = {INK: "currentColor", LINE: "var(--line)", CARD: "var(--card)"}
    colours |= {colour: f"var(--c{i})" for i, colour in enumerate(METHOD_COLOURS)}
    return re.sub("|".join(colours), lambda match: colours[match[0]], svg)

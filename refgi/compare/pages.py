"""What all pages share: template, style and script, numbers in print, plots that take the page's colours.

A page is one file that works from disk and refers to nothing outside itself; a plot is an ``<svg>`` element inside it.
"""

import hashlib
import html
import io
import math
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from refgi.errors import shortened

PAGE = Path(__file__).with_name("page")
SCRIPTS = ("floats", "scene", "paint", "panels", "input", "viewer", "page")  # each after what it builds on
MINUS, DASH, TIMES = "\N{MINUS SIGN}", "\N{EN DASH}", "\N{MULTIPLICATION SIGN}"
INK, LINE, CARD = "#010203", "#010204", "#010205"  # stand-ins, replaced by the page's own colours
METHOD_COLOURS = [f"#0102{16 + i:02x}" for i in range(7)]
MARKERS = "os^DvpX"
LONGEST_NAME = 60  # characters in a legend
MARK = "mark:"  # what stands before a name that a mark leads to, until the plot is whole
MOST_MARKED = 64  # points of a curve that are marked; more would hide it


def page_of(template: str, environment: Mapping[str, Any], *folders: Path, **parts: Any) -> str:
    """Return a page by a template of this package or of `folders`: all escaped, nothing left out in silence.

    `environment`: what its results were made on. Parts that a page lacks are empty; style and script may be others.
    """
    import jinja2

    loader = jinja2.FileSystemLoader([*folders, PAGE])
    made = jinja2.Environment(loader=loader, autoescape=True, trim_blocks=True, lstrip_blocks=True,
                              undefined=jinja2.StrictUndefined)
    script = "\n".join((PAGE / f"{name}.js").read_text("utf-8") for name in SCRIPTS)
    common = {"style": markup((PAGE / "style.css").read_text("utf-8")), "script": markup(script), "lead": "",
              "facts": [], "verdict": "", "failures": [], "versions": environment["versions"],
              "machine": machine(environment)}
    return made.get_template(template).render(common | parts)


def markup(text: str) -> Any:
    """Return text that is HTML already, which a template takes as it is."""
    from markupsafe import Markup

    return Markup(text)


def number(value: float) -> str:
    r"""Write a figure with three significant digits, a dash for nan.

    >>> [ascii(number(value)) for value in (0.0123456, -1234.5, 2.5e-7)]
    ["'0.0123'", "'\\u22121230'", "'2.5e\\u22127'"]
    """
    if math.isnan(value):
        return DASH
    if math.isinf(value):
        return "∞" if value > 0 else f"{MINUS}∞"
    if value == 0:
        return "0"
    if not 1e-4 <= abs(value) < 1e6:
        mantissa, _, exponent = f"{value:.2e}".partition("e")
        return f"{float(mantissa):g}e{int(exponent)}".replace("-", MINUS)
    rounded = float(f"{value:.3g}")
    return f"{rounded:.10f}".rstrip("0").rstrip(".").replace("-", MINUS)


def sort_key(value: float | None) -> str:
    """Return what a table sorts a number by, all its digits; nothing where it is not known, which stands last."""
    return "" if value is None or math.isnan(value) else repr(float(value)).replace("inf", "Infinity")


def machine(environment: Mapping[str, Any]) -> str:
    """Return what a result was made on, in a line: platform, processor, threads."""
    return f"{environment['platform']}, {environment['cpu']}, {environment['threads']} threads"


def require_environment(environment: Mapping[str, Any]) -> None:
    """Refuse (ValueError) what a result was made on where it is not all that a page needs."""
    missing = [key for key in ("platform", "cpu", "threads", "versions") if key not in environment]
    if missing or not isinstance(environment["versions"], dict) or "refgi" not in environment["versions"]:
        raise ValueError(f"environment: expected {', '.join(missing) or 'versions, that of refgi among them'}")


class Point(NamedTuple):
    """One method's run time (s) and error against one reference."""

    name: str
    seconds: float
    error: float
    filled: bool  # against the truth itself


class Curve(NamedTuple):
    """One curve: its name and its points."""

    name: str
    x: Sequence[float]
    y: Sequence[float]
    dashed: bool = False
    bars: Sequence[tuple[float, float]] = ()  # an interval of y at each point
    links: Sequence[tuple[str, str]] = ()  # of each point: the name on the page that its mark leads to, and a text
    joined: bool = True  # by lines


class Axes(NamedTuple):
    """Labels of both axes and whether they are logarithmic."""

    x: str
    y: str
    log_x: bool = False
    log_y: bool = False
    decimal_x: bool = False  # places along a logarithmic axis are named by 1, 2 and 5, not by the points or powers of 2


def time_against_error(points: list[Point], noise: float, error_name: str = "relMSE") -> str:
    """Draw methods by run time and error, both logarithmic, and the truth's noise as a dashed line where positive."""
    axes = Axes("run time, s", f"{error_name} of indirect irradiance", log_x=True, log_y=True)
    shown = [p for p in points if _drawable(p.seconds, p.error, axes)]
    return _svg(lambda plot: _draw_points(plot, shown, noise), axes, 7.6, "Run time against error")


def curves_plot(curves: Sequence[Curve], axes: Axes) -> str:
    """Draw curves with a legend beside them, without points that an axis cannot show."""
    svg = _svg(lambda plot: _draw_curves(plot, curves, axes), axes, 9.2, f"{axes.y} over {axes.x}")
    return _linked(svg, dict(link for curve in curves for link in curve.links))


def _svg(draw: Callable[[Any], None], axes: Axes, width: float, label: str) -> str:
    def drawn(figure: Any) -> None:
        plot = figure.add_subplot()
        plot.set(xlabel=axes.x, ylabel=axes.y)
        plot.grid(True, which="major", color=LINE, linewidth=0.8)
        style_plot(plot)
        draw(plot)

    return figure_svg(drawn, (width, 4.3), label)


def style_plot(plot: Any) -> None:
    """Give the axes of a plot the look of all plots: no ground of their own, no frame above and on the right."""
    plot.patch.set_alpha(0)
    plot.spines[["top", "right"]].set_visible(False)
    plot.set_axisbelow(True)


def figure_svg(draw: Callable[[Any], None], size: tuple[float, float], label: str) -> str:
    """Draw a figure in the page's colours: an ``<svg>`` without references to anything outside, equal for equal input.

    `draw` is called with an empty figure of Matplotlib; `size` in inches; a screen reader says `label`.
    """
    import matplotlib
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    style: Any = {"svg.hashsalt": "refgi", "svg.fonttype": "none", "font.family": "sans-serif", "text.color": INK,
                  "axes.labelcolor": INK, "axes.edgecolor": LINE, "xtick.color": INK, "ytick.color": INK,
                  "xtick.minor.size": 0, "ytick.minor.size": 0}
    with matplotlib.rc_context(style):
        figure = Figure(figsize=size, layout="constrained")
        figure.patch.set_alpha(0)
        draw(figure)
        stream = io.StringIO()
        canvas: Any = FigureCanvasSVG(figure)
        canvas.print_svg(stream, metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    return _inlined(stream.getvalue(), label)


def _draw_points(plot: Any, points: list[Point], noise: float) -> None:
    names = list(dict.fromkeys(point.name for point in points))
    plot.set(xscale="log", yscale="log")
    plot.xaxis.set_major_formatter("{x:g}")
    plot.margins(x=0.18, y=0.15)
    for point in points:
        colour = METHOD_COLOURS[names.index(point.name) % len(METHOD_COLOURS)]
        plot.plot([point.seconds], [point.error], "o", markersize=9, color=colour, markeredgewidth=1.8,
                  markerfacecolor=colour if point.filled else CARD)
        plot.annotate(point.name, (point.seconds, point.error), (9, 0), textcoords="offset points", va="center",
                      fontsize=10)
    if noise > 0:
        plot.axhline(noise, color=INK, linewidth=1, linestyle=(0, (4, 4)), alpha=0.6)
    if len(points) < 2 or len({point.seconds for point in points}) < 2:
        plot.set_xlim(*_decade_around([point.seconds for point in points] or [1.0]))


def _decade_around(values: list[float]) -> tuple[float, float]:
    return min(values) / 10**0.5, max(values) * 10**0.5


def _draw_curves(plot: Any, curves: Sequence[Curve], axes: Axes) -> None:
    from matplotlib.ticker import LogLocator

    for number, curve in enumerate(curves):
        colour = METHOD_COLOURS[number % len(METHOD_COLOURS)]
        points = [(x, y) for x, y in zip(curve.x, curve.y, strict=True) if _drawable(x, y, axes)]
        marked = {"marker": MARKERS[number % len(MARKERS)], "markersize": 5, "markerfacecolor": colour,
                  "linewidth": 1.6}
        plot.plot([x for x, _ in points], [y for _, y in points], color=colour, label=_shown(curve.name),
                  **(marked if len(points) <= MOST_MARKED or not curve.joined else {"linewidth": 1.1}),
                  linestyle=((0, (4, 3)) if curve.dashed else "-") if curve.joined else "none")
        _draw_bars(plot, curve, colour, axes)
        _draw_links(plot, curve, axes)
    plot.set(xscale="log" if axes.log_x else "linear", yscale="log" if axes.log_y else "linear")
    for axis in (plot.xaxis, plot.yaxis):
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter("")
    if axes.log_x and axes.decimal_x:
        plot.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    elif axes.log_x:
        plot.set_xticks(_steps(curves))
    if axes.log_y:
        plot.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    else:
        plot.set_ylim(bottom=0)
    legend = plot.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False, fontsize=9, facecolor=CARD)
    for text in legend.get_texts():
        text.set_parse_math(False)  # a name is no formula


def _shown(name: str) -> str:
    """Return a name as legends take it: short, in print, and not with the underscore by which one is hidden."""
    short = shortened(name, LONGEST_NAME)
    return f"\u200b{short}" if short[:1] in ("", "_") else short


def _draw_bars(plot: Any, curve: Curve, colour: str, axes: Axes) -> None:
    bars = [(x, *bar) for x, bar in zip(curve.x, curve.bars, strict=False) if all(_drawable(x, y, axes) for y in bar)]
    if bars:
        plot.vlines(*zip(*bars, strict=True), color=colour, linewidth=2.2, alpha=0.4)


def _draw_links(plot: Any, curve: Curve, axes: Axes) -> None:
    """Lay a nearly invisible mark that can be clicked over each point, larger than the one that is seen."""
    points = [(x, y, name) for x, y, (name, _) in zip(curve.x, curve.y, curve.links, strict=False)
              if _drawable(x, y, axes)]
    if points:
        marks = plot.scatter([x for x, _, _ in points], [y for _, y, _ in points], s=170, color=CARD, alpha=0.01)
        marks.set_zorder(5)
        marks.set_urls([MARK + name for _, _, name in points])


def _linked(svg: str, texts: Mapping[str, str]) -> str:
    """Return a plot whose marks lead to rows of the page's table, and by its script to pictures, each with its text."""
    def link(match: re.Match[str]) -> str:
        name, text = match[1], html.escape(texts[html.unescape(match[1])])
        return f'<a href="#row-{name}" data-picture="{name}" aria-label="{text}"><title>{text}</title>'

    return re.sub(rf'<a xlink:href="{MARK}([^"]*)"[^>]*>', link, svg)


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

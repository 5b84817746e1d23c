"""`refgi choose`: the cheapest method and settings that meet a wish on a scene."""

import os
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from refgi.cli.options import Size, on_threads, speech
from refgi.cli.session import DONE, FAILED, Session, progress, table

if TYPE_CHECKING:
    from refgi.bench.choose import Chosen, Probe, Wish

UNITS = {"us": 1e-6, "ms": 1e-3, "s": 1.0, "": 1.0}


class Share(click.ParamType[float]):
    """A share as 3% or 0.03."""

    name = "share"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return a number above 0."""
        if isinstance(value, float):
            return value
        return _number(self, value, {"%": 0.01, "": 1.0}, "a share such as 3% or 0.03", param, ctx)


class Duration(click.ParamType[float]):
    """A time as 50ms, 0.05s or 0.05."""

    name = "duration"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return seconds above 0."""
        if isinstance(value, float):
            return value
        return _number(self, value, UNITS, "a time such as 50ms or 0.05s", param, ctx)


@click.command("choose")
@click.argument("scene")
@click.option("--error", type=Share(), help="Largest RMSE over the truth's mean, such as 3%.")
@click.option("--time", "seconds", type=Duration(), help="Longest time of a frame with its buffers, such as 50ms.")
@click.option("--methods", metavar="A,B", help="Methods to look at, truth among them; all where absent.")
@click.option("--size", type=Size(), help="Picture size in pixels; the scene's own where absent.")
@click.option("--rounds", type=click.IntRange(1, 1000), default=3, show_default=True,
              help="How often each choice runs at full size, with a seed each.")
@click.option("--set", "pairs", multiple=True, metavar="KEY=VALUE",
              help="A setting of the truth, such as target_error=0.005 or checkpoint=DIR; repeatable.")
@click.option("--emit", metavar="FILE", help="Write the choice as a plan for `refgi batch` (TOML).")
@click.option("--force", is_flag=True, help="Overwrite the file of --emit.")
@click.option("--threads", type=click.IntRange(1), help="Threads of compiled kernels; all where absent.")
@speech
@click.pass_obj
def _choose(
    session: Session, /, scene: str, error: float | None, seconds: float | None, methods: str | None,
    size: tuple[int, int] | None, rounds: int, pairs: tuple[str, ...], emit: str | None, force: bool,
    threads: int | None,
) -> int:
    """Find the cheapest method and settings that meet a wish on SCENE.

    A search on a small picture finds candidates; they are verified at full size. Errors are plain RMSE against path
    tracing over its mean, without the path tracer's own noise. The path tracer is among the candidates.
    """
    from refgi.bench.choose import Wish, choose
    from refgi.bench.grid import built_in_tracks
    from refgi.cli.view import View
    from refgi.errors import expect
    from refgi.settings import from_text

    expect((error is None) != (seconds is None), "--error, --time", "one of the two", "both" if error else "neither")
    wish = Wish(error, seconds)
    tracks = built_in_tracks(None if methods is None else [name.strip() for name in methods.split(",")])
    truth = from_text(wish.truth, pairs)
    expect(emit is None or force or not Path(emit).exists(), "--emit", "a new file, or --force", emit)
    loaded = View(scene, size, None, None, None, None, ()).load()
    with on_threads(threads), progress() as tell:
        chosen = choose(loaded, tracks, wish, rounds=rounds, truth=truth, tell=tell, shadows="exact")
    best = chosen.found.best
    shown = f" --size {size[0]}x{size[1]}" if size else ""
    line = None if best is None else f"refgi render {scene}{shown}{_options(best)} --out {best.choice.method}.exr"
    if best is not None and emit is not None:
        from refgi.image import write_text

        write_text(Path(emit), _plan(scene, size, best, Path(emit).parent))
    session.result(_text(chosen, wish, line), _content(chosen, wish, line))
    return DONE if best is not None else FAILED


command = _choose


def _number(kind: click.ParamType[float], value: Any, units: dict[str, float], expected: str,
            param: click.Parameter | None, ctx: click.Context | None) -> float:
    found = re.fullmatch(r"\s*([0-9.]+(?:[eE][-+]?[0-9]+)?)\s*(\D*?)\s*", str(value))
    try:
        number = float(found[1]) * units[found[2]] if found else 0.0
    except (ValueError, KeyError):
        number = 0.0
    if not 0 < number < float("inf"):
        kind.fail(f"expected {expected}, got {value!r}", param, ctx)
    return number


def _options(best: "Probe") -> str:
    return f" --method {best.choice.method}" + "".join(f" --set {change}" for change in best.choice.changes)


def _plan(scene: str, size: tuple[int, int] | None, best: "Probe", folder: Path) -> str:
    """Return the choice as a plan in a folder, with the scene it was found on; files are named from that folder."""
    from refgi.bench.grid import TRUTH, toml_line
    from refgi.scene import builtin_scenes

    choice = best.choice
    named = scene if scene.partition(":")[0] in builtin_scenes() else os.path.relpath(scene, folder)
    lines = ["[batch]", toml_line("scenes", [named]), *([toml_line("size", list(size))] if size else []), "",
             f"[{choice.method}]"]
    if choice.method == TRUTH:
        passes: int = choice.settings.passes  # type: ignore[attr-defined]
        return "\n".join([*lines, toml_line("passes", [passes])]) + "\n"
    return "\n".join([*lines, *(toml_line(*change.split("=", 1)) for change in choice.changes)]) + "\n"


def _content(chosen: "Chosen", wish: "Wish", line: str | None) -> dict[str, Any]:
    def plain(one: "Probe") -> dict[str, Any]:
        return {"method": one.choice.method, "changes": list(one.choice.changes), "seconds": _finite(one.seconds),
                "error": _finite(one.error)}

    found = chosen.found
    return {"wish": wish._asdict(), "best": None if found.best is None else plain(found.best), "line": line,
            "skips": [{"stage": name, "reason": reason} for name, reason in chosen.skips], "truth": chosen.truth,
            "trusted": not chosen.doubt,
            "judged": [plain(one) for one in found.judged], "small": [plain(one) for one in found.small]}


def _finite(value: float) -> float | None:
    return value if abs(value) < float("inf") else None


def _text(chosen: "Chosen", wish: "Wish", line: str | None) -> str:
    from refgi.compare.report import number

    found = chosen.found
    asked = f"an error of {100 * wish.error:.3g} %" if wish.error else f"{number(1e3 * (wish.seconds or 0))} ms"
    parts = [f"nothing is known to meet {asked}: {chosen.doubt}" if chosen.doubt else f"nothing meets {asked}"]
    if found.best is not None:
        parts = [f"{found.best.choice.method}, {found.best.choice.label}: {100 * found.best.error:.3g} % in "
                 f"{number(1e3 * found.best.seconds)} ms, wished for {asked}"]
    parts += [_table("judged at full size", found.judged)] if found.judged else []
    parts += [_table("nearest on the small picture", sorted(found.small, key=lambda one: one.error)[:5])]
    parts += ["left out on this scene\n" + table([(name, reason) for name, reason in chosen.skips])] if chosen.skips \
        else []
    return "\n\n".join([*parts, f"truth: {chosen.truth}", *([line] if line else [])])


def _table(title: str, probes: Any) -> str:
    from refgi.compare.report import number

    rows = [("method", "settings", "ms", "error, %")]
    rows += [(one.choice.method, one.choice.label, number(1e3 * one.seconds), f"{100 * one.error:.3g}")
             for one in probes]
    return f"{title}\n{table(rows, right=frozenset((2, 3)))}"

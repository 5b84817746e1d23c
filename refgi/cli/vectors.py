"""`refgi vectors`: stage-by-stage test vectors for ports, and the check of a port's arrays against them."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from refgi.cli.options import seen, shadows, speech
from refgi.cli.session import Session, progress, say, table
from refgi.cli.settings import preset
from refgi.vectors.report import OPTIONS

if TYPE_CHECKING:
    from refgi.vectors.manifest import KitManifest

SMALL, MAP = (64, 48), 64  # size of a picture and side of a light's map, where nothing is said


@click.group("vectors")
def command() -> None:
    """Test vectors of every stage, and a port's check against them."""


@command.command("export")
@click.argument("scene", required=False)
@click.option("--kit", type=click.Choice(["quick", "full"]), help="Ready cases, where no SCENE is named.  [quick]")
@click.option("--case", help="Of a kit: only cases whose id begins so.")
@click.option("--method", default="sii", show_default=True, help="Of SCENE: short name of a method.")
@preset
@click.option("--set", "pairs", multiple=True, metavar="KEY=VALUE", help="A setting of the method; repeatable.")
@seen
@shadows("auto")
@click.option("--rsm-resolution", type=click.IntRange(1, 16384), default=MAP, show_default=True,
              help="Texels along a side of a light's map.")
@click.option("--seed", type=click.IntRange(0, 2**32 - 1), help="Which random numbers, where a method has any.")
@click.option("--stage", default="", metavar="NAME", help="Of SCENE: only stages whose name begins so.")
@click.option("--most", type=click.FloatRange(min=0, min_open=True), default=50.0, show_default=True, metavar="MB",
              help="Of SCENE: refuse what would take more.")
@click.option("--out", required=True, help="Folder of the kit; a kit there is replaced.")
@speech
@click.pass_context
def _export(ctx: click.Context, /, **options: Any) -> None:
    """Write arrays of every stage, bounds, likely bugs, scene, schemas, and how to read them.

    Of SCENE by a method with its settings, at 64x48 pixels unless --size says otherwise; without SCENE a kit of ready
    cases of all methods.
    """
    session, out = ctx.ensure_object(Session), Path(options["out"])
    with progress() as tell:
        made = _of_kit(ctx, options, out, tell) if options["scene"] is None else _of_scene(options, out, tell)
    size = sum(file.stat().st_size for file in out.rglob("*") if file.is_file())
    rows = [("case", "what it holds"), *((entry.id, entry.what) for entry in made.cases)]
    session.result(f"{table(rows)}\n{out}: {len(made.cases)} cases, {size / 1e6:.1f} MB, vectors {made.vectors}",
                   {"kit": made.kit, "vectors": made.vectors, "cases": [entry.id for entry in made.cases],
                    "bytes": size})


def _of_kit(ctx: click.Context, options: dict[str, Any], out: Path, tell: Any) -> "KitManifest":
    from refgi.vectors.export import export_kit

    for parameter in ctx.command.params:
        asked = ctx.get_parameter_source(parameter.name or "") is ParameterSource.COMMANDLINE
        if asked and parameter.name not in ("kit", "case", "out", "debug", "as_json", "json"):
            raise click.UsageError(f"{parameter.opts[0]}: expected a SCENE, which it is said of, got none", ctx)
    return export_kit(options["kit"] or "quick", out, tell, options["case"])


def _of_scene(options: dict[str, Any], out: Path, tell: Any) -> "KitManifest":
    import dataclasses

    from refgi.cli.job import stem
    from refgi.cli.settings import settings_for
    from refgi.cli.view import View
    from refgi.vectors.export import export_case
    from refgi.vectors.recorded import recorded_case

    if options["kit"] is not None or options["case"] is not None:
        raise click.UsageError("--kit and --case say which ready cases; they take no SCENE")
    method = options["method"]
    settings = settings_for(method, options["pairs"], options["seed"], options["preset"])
    options["size"] = options["size"] or SMALL
    scene = View(**{field.name: options[field.name] for field in dataclasses.fields(View)}).load()
    tell(f"{method} of {scene.name}", 0.0)
    case = recorded_case(f"{method}-{stem(options['scene'])}", scene, method, settings, only=options["stage"],
                         what=f"{method} of {scene.name}", rsm_resolution=options["rsm_resolution"],
                         shadows=options["shadows"])
    return export_case(case, out, tell, options["most"] * 1e6)


def _shared(function: Callable[..., int]) -> Callable[..., int]:
    """Add the options that a kit's check.py has too."""
    for one in reversed(OPTIONS):
        if not one.metavar:
            add = click.option(one.flag, one.key, is_flag=True, help=one.help)
        elif "|" in one.metavar:
            choices = one.metavar.split("|")
            add = click.option(one.flag, one.key, type=click.Choice(choices), default=choices[0], show_default=True,
                               help=one.help)
        else:
            add = click.option(one.flag, one.key, multiple=one.many, metavar=one.metavar, help=one.help)
        function = add(function)
    return function


@command.command("check")
@click.argument("kit")
@click.argument("output")
@_shared
@click.option("--search", "seconds", type=click.FloatRange(min=0, min_open=True), metavar="SECONDS",
              help="Try single changes of the first wrong stage's literal text, for so long.")
@click.option("--html", "html_file", metavar="FILE", help="Write a page with the arrays side by side.")
def _check(kit: str, output: str, **options: Any) -> int:
    """Judge the arrays in OUTPUT by KIT: the first wrong stage, its worst element, likely causes.

    OUTPUT holds <case>/<array>.npy. Stages without arrays are not run and do not count, unless --stage or --require
    asks for them.

    Exit codes: 0 all within their bounds, 1 a stage is out, 2 a wrong option or no such OUTPUT, 4 not comparable (a
    missing array, a wrong shape or type, an empty OUTPUT), 5 kit or output damaged.
    """
    from refgi.vectors.check import DAMAGED, DamagedError, Kit, asked_from, check_output
    from refgi.vectors.report import github, report, write_junit

    asked = asked_from(options)
    try:
        opened = Kit(Path(kit))
        result = check_output(opened, Path(output), asked)
        if options["seconds"] is not None:
            from refgi.vectors.search import searched

            with progress() as tell:
                result = searched(opened, Path(output), asked, result, seconds=options["seconds"], tell=tell)
        if options["json_file"] is not None:
            from refgi.image.whole import write_text
            from refgi.vectors.manifest import text_of

            write_text(options["json_file"], text_of(result))
        if options["junit_file"] is not None:
            write_junit(options["junit_file"], result)
        if options["html_file"] is not None:
            from refgi.vectors.page import write_page

            write_page(options["html_file"], opened, Path(output), result, asked)
    except DamagedError as error:
        say(str(error))
        return DAMAGED
    click.echo(github(result) if options["form"] == "github" else report(result))
    return result.exit_code

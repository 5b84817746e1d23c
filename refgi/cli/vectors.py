"""`refgi vectors`: stage-by-stage test vectors for ports, and the check of a port's arrays against them."""

from collections.abc import Callable
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from refgi.cli.options import SEEN, Asked, verb
from refgi.cli.session import Session, progress, say, table
from refgi.vectors.options import OPTIONS

if TYPE_CHECKING:
    from refgi.scene import Scene
    from refgi.sssil.temporal import TemporalSettings
    from refgi.vectors.manifest import KitManifest

SMALL, MAP = (64, 48), 64  # size of a picture and side of a light's map, where nothing is said


@click.group("vectors")
def _vectors() -> None:
    """Test vectors of every stage, and a port's check against them."""


@verb("export", "SCENE", "kit", "case", "method", "preset", "set", *SEEN, "shadows", "rsm-resolution", "seed", "stage",
      "frames", "frame", "temporal", "no-temporal", "most", "out", SCENE={"required": False},
      method="Of SCENE: short name of a method.",
      frames={"to": "path", "type": str, "metavar": "PATH", "help": "Of SCENE: a frame along a path of camera, lights "
              "and objects, a TOML file as `refgi sequence` reads it, with the light of the frames before."},
      rsm_resolution={"default": MAP, "help": "Texels along a side of a light's map."},
      out={"required": True, "help": "Folder of the kit; a kit there is replaced."})
def _export(session: Session, asked: Asked) -> None:
    """Write arrays of every stage, bounds, likely bugs, scene, schemas, and how to read them.

    Of SCENE by a method with its settings, at 64x48 pixels unless --size says otherwise; without SCENE a kit of ready
    cases of all methods. With --frames those of one frame of a sequence, its temporal filter among them.
    """
    out = Path(asked.out)
    with progress() as tell:
        made = _of_kit(asked, out, tell) if asked.scene is None else _of_scene(asked, out, tell)
    size = sum(file.stat().st_size for file in out.rglob("*") if file.is_file())
    rows = [("case", "what it holds"), *((entry.id, entry.what) for entry in made.cases)]
    session.result(f"{table(rows)}\n{out}: {len(made.cases)} cases, {size / 1e6:.1f} MB, vectors {made.vectors}",
                   {"kit": made.kit, "vectors": made.vectors, "cases": [entry.id for entry in made.cases],
                    "bytes": size})


def _of_kit(asked: Asked, out: Path, tell: Any) -> "KitManifest":
    from refgi.jit.ahead import cores
    from refgi.vectors.export import export_kit

    ctx = click.get_current_context()
    for parameter in ctx.command.params:
        given = ctx.get_parameter_source(parameter.name or "") is ParameterSource.COMMANDLINE
        if given and parameter.name not in ("kit", "case", "out", "debug", "as_json", "json"):
            raise click.UsageError(f"{parameter.opts[0]}: expected a SCENE, which it is said of, got none", ctx)
    return export_kit(asked.kit or "quick", out, tell, asked.case, cores())


def _of_scene(asked: Asked, out: Path, tell: Any) -> "KitManifest":
    from refgi.cli.view import scene_of, settings_for, stem
    from refgi.errors import expect
    from refgi.vectors.export import export_case
    from refgi.vectors.frames import frame_case

    if asked.kit is not None or asked.case is not None:
        raise click.UsageError("--kit and --case say which ready cases; they take no SCENE")
    method = asked.method
    settings = settings_for(method, asked.pairs, asked.seed, asked.preset)
    asked.size = asked.size or SMALL
    if not asked.path and (asked.frame is not None or asked.filtering or asked.unfiltered):
        raise click.UsageError("--frame, --temporal and --no-temporal say what of --frames PATH, which is absent")
    scenes, filtering, what = _frames(asked) if asked.path else ([scene_of(asked)], None, "")
    what = f"{method} of {scenes[-1].name}{what}"
    tell(what, 0.0)
    case = frame_case(f"{method}-{stem(asked.scene)}", scenes, method, settings, filtering, only=asked.stage, what=what,
                      rsm_resolution=asked.rsm_resolution, shadows=asked.shadows)
    expect(len(case.stages) > 0, "--stage", f"the start of a stage's name (docs/stages.md) that {method} has here",
           asked.stage)
    return export_case(case, out, tell, asked.most * 1e6)


def _frames(asked: Asked) -> "tuple[list[Scene], TemporalSettings | None, str]":
    """Return the scenes of a path up to the frame that is asked for, the filter that blends them, and a remark."""
    from refgi.cli.sequence import scene_and_way, temporal_of
    from refgi.errors import expect
    from refgi.scene.path import scenes_along

    scene, way, count = scene_and_way(asked, None)
    filtering, number = temporal_of(asked), count - 1 if asked.frame is None else asked.frame
    expect(count > 1, "--frames", f"2 frames or more, of which {asked.path} says how many", count)
    expect((filtering is not None) <= number < count, "--frame",
           f"1 to {count - 1}, a frame that follows on others" if filtering else f"0 to {count - 1}", number)
    alone = "" if filtering else " by itself: the frames before leave nothing to it; --temporal blends their light"
    said = f", frame {number} of 0 to {count - 1}{alone}"
    return [*islice(scenes_along(scene, way, count), number + 1)], filtering, said


_vectors.add_command(_export)


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


@_vectors.command("check")
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
    from refgi.errors import expect
    from refgi.vectors.check import DAMAGED, DamagedError, Kit, asked_from, check_output
    from refgi.vectors.report import github, report, write_junit

    asked = asked_from(options)
    try:
        opened = Kit(Path(kit))
        expect(options["seconds"] is None or opened.manifest.kit != "scene", "--search",
               "a kit of ready cases: one of a scene does not keep its stages' literal forms", kit)
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

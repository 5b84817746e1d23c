"""`refgi stress`: what breaks on a scene, against what is promised."""

import math
import shlex
from typing import Any

import click

from refgi.cli.options import on_threads, speech, view, writing
from refgi.cli.session import DONE, FAILED, Session, progress, say

FILES = ("index.html", "stability.json")
QUICK, USUAL = 96, 192  # pixels along the longer side, at most


@click.command("stress")
@view
@click.option("--methods", metavar="A,B", help="Methods to attack; all where absent.")
@click.option("--change", "changes", multiple=True, metavar="NAME", help="A change to try alone; repeatable.")
@click.option("--quick", is_flag=True, help=f"At most {QUICK} pixels along the longer side, in place of {USUAL}.")
@click.option("--threads", type=click.IntRange(1), help="Threads of compiled kernels; all where absent.")
@click.option("--out", required=True, help="Folder for index.html and stability.json.")
@writing
@speech
@click.pass_obj
def _stress(session: Session, /, methods: str | None, changes: tuple[str, ...], quick: bool, threads: int | None,
            out: str, parents: bool, force: bool, **options: Any) -> int:
    """Attack SCENE: tell whether it is safe to compare against.

    Every method renders the scene as it is and after changes of which the outcome is known: brighter lamps, other
    units, another place, other triangles. Each row of the table is a promise with the worst that was found beside its
    limit; the exit code is 1 where one is broken.
    """
    from refgi.cli.destination import Permission, folder
    from refgi.cli.view import View, require_memory
    from refgi.cli.warm import warm_up
    from refgi.compare.report import environment
    from refgi.methods import METHODS, find_method
    from refgi.stress.page import markdown_summary, write_page
    from refgi.stress.promises import Stability, markdown, write_rows
    from refgi.stress.run import Found, Silence, stress

    names = [find_method(name.strip()).name for name in methods.split(",")] if methods is not None else list(METHODS)
    scene = View(**options).load()
    camera = scene.camera
    shrink = max(1.0, max(camera.width, camera.height) / (QUICK if quick else USUAL))
    width, height = (camera.width, camera.height) if options["size"] else (
        max(1, math.floor(n / shrink)) for n in (camera.width, camera.height))
    largest = scene.with_camera(width=2 * width, height=2 * height)  # of "resolution x 2"
    require_memory(largest, "float64", 512, traced=True,
                   settings={name: find_method(name).settings() for name in names})
    path = folder(out, Permission(parents, force), FILES)
    found: list[Found] = []
    silent: list[Silence] = []
    with on_threads(threads), progress() as tell:
        warm_up(names, "float32", tell)
        found += stress(scene, names, width=width, height=height, changes=changes or None, source=_typed(options),
                        tell=tell, silent=silent.append)
    result = Stability(environment=environment(), rows=tuple(one.row for one in found))
    path.mkdir(parents=True, exist_ok=True)
    write_rows(result, path / "stability.json")
    write_page(result, found, silent, path, scene.name)
    for row in result.failed:
        say(f"broken: {row.subject}, {row.property}: {row.figure:.3g} {row.unit}, limit {row.limit:.3g}")
    session.result("\n".join([markdown(result.rows), markdown_summary(result),
                              f"open {out.rstrip('/')}/index.html"]),
                   result.model_dump(mode="json") | {"silent": [one._asdict() for one in silent]})
    return FAILED if result.failed else DONE


command = _stress


def _typed(options: dict[str, Any]) -> str:
    """Return the scene and what is seen of it as one types it, without the size."""
    words = [options["scene"]]
    for key in ("eye", "target", "up", "vfov_deg"):
        if (value := options[key]) is not None:
            text = ",".join(f"{c:.17g}" for c in value) if isinstance(value, tuple) else f"{value:.17g}"
            words.append(f"--{key.replace('_', '-')}={text}")
    return shlex.join([*words, *(f"--light={light}" for light in options["lights"])])

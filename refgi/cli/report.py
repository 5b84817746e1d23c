"""`refgi report`: the page of a folder with results, made again; an index over a folder of such folders."""

from pathlib import Path

import click

from refgi.cli.options import speech
from refgi.cli.session import DONE, Session, say


@click.command("report")
@click.argument("directory", metavar="DIR")
@click.option("--watch", is_flag=True, help="Make the pages again whenever results change, until interrupted.")
@click.option("--force", is_flag=True, help="Overwrite an index.html that is not from refgi.")
@speech
@click.pass_obj
def _report(session: Session, /, directory: str, watch: bool, force: bool) -> int:
    """Make the page of DIR again from its results.json and pictures.

    DIR is what `refgi bench` or `refgi batch` wrote, or a folder of such folders: each then gets its page, and DIR an
    index over all scenes.
    """
    from refgi.bench.folder import INDEX, folders_of, remake
    from refgi.bench.folder import watch as keep_up_to_date
    from refgi.cli.destination import Permission, folder
    from refgi.errors import expect

    path = Path(directory)
    expect(path.is_dir(), "DIR", "a folder", directory)
    folders = folders_of(path)
    for one in {path, *folders}:
        folder(str(one), Permission(force=force), [INDEX])
    if watch:
        say(f"open {path / INDEX}; an interrupt ends this")
        keep_up_to_date(path, say)
        return DONE
    held = remake(path, folders)
    scenes = [scene for one in held for scene in one.result.scenes]
    lines = [f"{one.folder}: {', '.join(scene.scene for scene in one.result.scenes)}" for one in held]
    session.result("\n".join([*lines, "", f"open {path / INDEX}"]), {
        "pages": [str(one / INDEX) for one in dict.fromkeys([path, *folders])], "scenes": len(scenes),
        "runs": sum(len(scene.runs) for scene in scenes)})
    return DONE


command = _report

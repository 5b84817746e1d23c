"""`refgi scenes`: the built-in scenes."""

import click

from refgi.cli.options import speech
from refgi.cli.session import Session, table


@click.command("scenes")
@speech
@click.pass_obj
def _scenes(session: Session, /) -> None:
    """List the built-in scenes, with faces and a line each.

    A scene's parameters follow its name: refgi render atrium:faces=1000000,seed=3 ...
    """
    from refgi.scene import builtin_scenes

    scenes = builtin_scenes()
    rows = [("scene", "faces", "what it is", "parameters")]
    rows += [(name, f"{scene.faces:,}", scene.summary, ",".join(f"{k}={v}" for k, v in scene.parameters.items()))
             for name, scene in scenes.items()]
    session.result(table(rows, right=frozenset({1})), {"scenes": {
        name: {"faces": scene.faces, "summary": scene.summary, "parameters": scene.parameters}
        for name, scene in scenes.items()
    }})


command = _scenes

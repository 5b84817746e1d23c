"""What `refgi render` is asked to render: by its options, or by the record of a picture that is to be made again."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from refgi.errors import InputError

if TYPE_CHECKING:
    from refgi.provenance import Job

BESIDE = frozenset({"again", "scene_path", "exposure", "out", "threads", "parents", "force", "allow_empty",
                    "json", "debug"})


def asked(options: dict[str, Any]) -> "Job":
    """Return what the verb's options, by parameter, say to render, with the scene loaded.

    InputError if a setting, the scene, the camera or a light is not usable.
    """
    import dataclasses

    from refgi.cli.settings import settings_for, still_frames
    from refgi.cli.view import View
    from refgi.provenance import Job

    method = options["method"]
    settings = settings_for(method, options["pairs"], options["seed"], options["preset"])
    still = still_frames([method], options["frames"], options["filtering"])
    scene = View(**{field.name: options[field.name] for field in dataclasses.fields(View)}).load()
    frame = {key: options[key] for key in ("dtype", "rsm_resolution", "shadows")}
    return Job(scene, method, settings, frame, scene.exposure, still=still)


def recorded(file: str, scene: str | None) -> "Job":
    """Return what the record of an EXR that refgi wrote says, with the scene loaded and found to be the same.

    `scene`: where it is now. InputError if the file has no record or the scene is not the same any more.
    """
    from refgi.provenance import job_of, read_record

    path = Path(file)
    return job_of(read_record(path), path, scene)


def require_either(ctx: click.Context) -> None:
    """Refuse (UsageError) a run without a scene, and one that is to make a picture again but otherwise."""
    given = {parameter.name: parameter for parameter in ctx.command.params
             if parameter.name and ctx.get_parameter_source(parameter.name) is ParameterSource.COMMANDLINE}
    by_name = {parameter.name: parameter for parameter in ctx.command.params}
    if "again" in given:
        more = [name for name in given if name not in BESIDE]
        if more:
            names = ", ".join(given[name].opts[-1] if name != "scene" else "SCENE" for name in more)
            raise click.UsageError(f"--again makes a picture as it was; it takes no {names}", ctx)
        return
    if "scene_path" in given:
        raise click.UsageError("--scene says where the scene of --again is now; without it name the SCENE alone", ctx)
    for name in ("scene", "out"):
        if name not in given:
            raise click.MissingParameter(ctx=ctx, param=by_name[name])


def differences(file: Path, planes: dict[str, Any]) -> list[str]:
    """Return in what a picture made again differs from the one in an EXR that refgi wrote.

    `planes`: (h, w) by channel, as they would be written. One text a channel that is not the same to the bit.
    """
    import numpy as np

    from refgi.image import read_exr

    found = []
    for name, plane in read_exr(file)[0].items():
        made = planes.get(name)
        if made is None or made.shape != plane.shape:
            found.append(f"{name} is missing or of another size")
        elif count := int((made.view(np.uint32) != plane.view(np.uint32)).sum()):
            found.append(f"{name} in {count} of {plane.size} pixels")
    return found


def stem(scene: str) -> str:
    """Return how files are named after a scene: its name without folder, suffix and parameters."""
    from refgi.scene import builtin_scenes
    from refgi.scene.files import text_of

    base = scene.partition(":")[0]
    return base if base in builtin_scenes() else text_of(Path(scene).stem)


def require_view(covered: bool, scene: str, allowed: bool) -> None:
    """Refuse (InputError), unless allowed, a picture on which there is nothing, which nobody wants by intention."""
    if not (covered or allowed):
        raise InputError(f"scene {scene!r}: camera: expected a view of some surface, got one past all of it; "
                         "--allow-empty writes the black picture", key="camera")

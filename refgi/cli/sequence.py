"""`refgi sequence`: the frames of a path through one scene."""

import time
import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from refgi.cli.options import machine, shadows, speech, view, writing
from refgi.cli.session import DONE, FAILED, Session, say
from refgi.cli.settings import preset

if TYPE_CHECKING:
    from refgi.cli.frame_files import FrameFiles
    from refgi.methods import KeepingEstimate
    from refgi.scene import Scene
    from refgi.scene.path import Path as Way
    from refgi.sssil.temporal import Sequence, TemporalSettings
    from refgi.types import Tell

FRAME = ("dtype", "rsm_resolution", "shadows")
KINDS = {"both": (".exr", ".png"), "exr": (".exr",), "png": (".png",)}


@click.command("sequence")
@view
@click.argument("path")
@click.option("--frames", type=click.IntRange(1, 100_000), help="How many; as PATH says where absent.")
@click.option("--method", default="hssil", show_default=True, help="Short name of a method.")
@preset
@click.option("--set", "pairs", multiple=True, metavar="KEY=VALUE", help="A setting of the method; repeatable.")
@click.option("--temporal", "filtering", multiple=True, metavar="KEY=VALUE",
              help="A setting of the temporal filter, such as weight=0.8; repeatable.")
@click.option("--no-temporal", "unfiltered", is_flag=True, help="Each frame by itself.")
@machine
@shadows("auto")
@click.option("--exposure", type=float, help="Factor before the sRGB curve of a PNG; the scene's where absent.")
@click.option("--format", "kind", type=click.Choice(list(KINDS)), default="both", show_default=True,
              help="EXR (linear), PNG (tone-mapped), or both.")
@click.option("--resume", is_flag=True, help="Go on after the frames that are there as EXR.")
@click.option("--allow-empty", is_flag=True, help="Write black frames where the camera sees no surface in any of them.")
@click.option("--out", required=True, help="Folder for the frames.")
@writing
@speech
@click.pass_obj
def _sequence(session: Session, /, **options: Any) -> int:
    """Render SCENE along a path of camera, lights and objects.

    PATH is a TOML file with keys of camera, lights and objects at shares of the sequence.

    `hssil` blends each frame's light with that of the frame before; another method does where --temporal is given.
    Each frame is written whole as soon as it is done, as PATH's name and a number.
    """
    from refgi.cli.destination import Permission, folder
    from refgi.cli.frame_files import FrameFiles
    from refgi.cli.job import require_view
    from refgi.cli.options import on_threads
    from refgi.cli.session import progress
    from refgi.cli.settings import settings_for
    from refgi.cli.view import require_memory
    from refgi.cli.warm import warm_up
    from refgi.methods import KeepingEstimate, find_method, usual_shadows
    from refgi.provenance import method_record, scene_record
    from refgi.provenance.frames import frame_record, path_record, require_repeatable
    from refgi.scene.files import text_of
    from refgi.scene.path import scenes_along
    from refgi.sssil.temporal import Sequence
    from refgi.stages import Memory

    kind, resume, exposure, out, threads = _taken(options, "kind", "resume", "exposure", "out", "threads")
    permission = Permission(*_taken(options, "parents", "force"))
    (allow_empty,) = _taken(options, "allow_empty")
    _expect_usable(exposure, kind, resume)
    method, preset, pairs, seed = _taken(options, "method", "preset", "pairs", "seed")
    light = KeepingEstimate(find_method(method))
    settings = settings_for(method, pairs, seed, preset)
    require_repeatable(settings)
    temporal = _temporal(method, *_taken(options, "filtering", "unfiltered"))
    frame_options = dict(zip(FRAME, _taken(options, *FRAME), strict=True))
    frame_options["shadows"] = frame_options["shadows"] or usual_shadows(settings)
    path, frames = _taken(options, "path", "frames")
    scene, way, frames = _scene_and_way(path, frames, options)
    require_memory(scene, frame_options["dtype"], frame_options["rsm_resolution"], traced=method == "truth",
                   settings={method: settings})
    record = {**scene_record(scene, frame_options, exposure=exposure), **method_record(method, settings),
              **path_record(path, frames, temporal)}
    files = FrameFiles(Path(out), text_of(Path(path).stem), KINDS[kind], record,
                       lambda number: frame_record(scene, way, number, frames))
    folder(out, permission, files.kept(frames, resume=resume))
    memory = Memory() if way.leaves_at_rest(len(scene.lights)) else None
    sequence = Sequence(scenes_along(scene, way, frames), settings, temporal, method=light, lobes=light.lobes,
                        memory=memory, **frame_options)
    with on_threads(threads), progress() as tell:
        warm_up([method], frame_options["dtype"], tell)
        done = files.done(frames) if resume else 0
        if not allow_empty:
            require_view(_sees_surface(scenes_along(scene, way, frames), frame_options), scene.name, allowed=False)
        rendered = _render(sequence, light, files, (done, frames), tell)
    _warn_of_empty([frame["frame"] for frame in rendered if not frame["covered_pixels"]], frames)
    content = {"scene": scene.name, "method": method, "settings": settings, "temporal": temporal, **frame_options,
               "out": out, "first": done, "frames": rendered, "provenance": record}
    session.result(f"{scene.name} by {method}: {len(rendered)} of {frames} frames rendered -> {out}", content)
    return FAILED if any(frame["non_finite_pixels"] for frame in rendered) else DONE


command = _sequence


def _taken(options: dict[str, Any], *names: str) -> Any:
    return [options.pop(name) for name in names]


def _expect_usable(exposure: float | None, kind: str, resume: bool) -> None:
    from refgi.errors import expect

    expect(exposure is None or 0 < exposure < float("inf"), "--exposure", "a finite number > 0", exposure)
    expect(not resume or kind != "png", "--resume", "--format both or exr: no PNG holds what to go on from", kind)


def _temporal(method: str, pairs: tuple[str, ...], unfiltered: bool) -> "TemporalSettings | None":
    from refgi.errors import expect
    from refgi.settings import from_text
    from refgi.sssil.temporal import TemporalSettings

    expect(not (pairs and unfiltered), "--temporal", "nothing beside --no-temporal", " ".join(pairs))
    if unfiltered or not (pairs or method == "hssil"):
        return None
    return from_text(TemporalSettings(), pairs)


def _scene_and_way(path: str, frames: int | None, options: dict[str, Any]) -> "tuple[Scene, Way, int]":
    """Return the scene as it is without the path, the path, and how many frames; all of them are usable."""
    from refgi.cli.view import View
    from refgi.errors import blame, expect
    from refgi.scene.path import camera_and_lights
    from refgi.scene.pathfile import read_path

    scene = View(**options).load()
    with blame(file=path):
        way, own = read_path(path, scene)
    count = own if frames is None else frames
    expect(count is not None, "--frames", f"how many, as {path} does not say", "nothing")
    assert count is not None
    for frame in range(count):
        camera_and_lights(scene, way, frame, count)
    return scene, way, count


def _sees_surface(scenes: Iterable["Scene"], frame_options: dict[str, Any]) -> bool:
    """Return whether any frame sees a surface; the frames after the first that does are not looked at."""
    from refgi.frame import Frame

    return any(Frame(scene, **frame_options).gbuffer.covered.any() for scene in scenes)


def _warn_of_empty(empty: list[int], frames: int) -> None:
    """Warn of frames, by number in ascending order, that see no surface."""
    from refgi.errors import RefgiWarning

    if not empty:
        return
    numbers = set(empty)
    starts = [number for number in empty if number - 1 not in numbers]
    ends = [number for number in empty if number + 1 not in numbers]
    spans = ", ".join(f"{a}" if a == b else f"{a}-{b}" for a, b in zip(starts, ends, strict=True))
    warnings.warn(RefgiWarning(f"frames {spans} of {frames} see no surface"), stacklevel=2)


def _render(
    sequence: "Sequence", light: "KeepingEstimate", files: "FrameFiles", span: tuple[int, int], tell: "Tell"
) -> list[dict[str, Any]]:
    """Render and write the frames from one number up to another; return what is to be said of each."""
    from refgi.cli.frame_files import resumed
    from refgi.compare.metrics import count_non_finite

    rendered: list[dict[str, Any]] = []
    done, frames = span
    if done == frames:
        return rendered
    started = time.perf_counter()
    for number, step in enumerate(resumed(sequence, sequence.scenes, files, done), done):
        seconds = time.perf_counter() - started
        files.write(step, number, None if sequence.temporal else light.estimate, light.lobe_estimate)
        bad = count_non_finite(step.radiance)
        if bad:
            say(f"frame {number}: {bad} pixels are NaN or infinite")
        rendered.append({"frame": number, "seconds": seconds, "reused": step.reused, "non_finite_pixels": bad,
                         "covered_pixels": int(step.frame.gbuffer.covered.sum()),
                         "mean_indirect_irradiance": float(step.irradiance.mean(dtype="float64"))})
        tell(f"frame {number + 1} of {frames}", 1.0)
        del step  # its buffers serve the next
        started = time.perf_counter()
    return rendered

"""`refgi sequence`: the frames of a path through one scene, as files from which an interrupted sequence goes on."""

import time
import warnings
from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from refgi.cli.options import MACHINE, SEEN, WRITING, Asked, verb
from refgi.cli.session import DONE, FAILED, Session, progress, say

if TYPE_CHECKING:
    from refgi.methods import KeepingEstimate
    from refgi.provenance import Record
    from refgi.scene import Scene
    from refgi.scene.path import Path as Way
    from refgi.sssil.temporal import Sequence, SequenceFrame, TemporalSettings
    from refgi.sssil.temporal_filter import History
    from refgi.types import Array, Tell

EXR, PNG = ".exr", ".png"
KINDS = {"both": (EXR, PNG), "exr": (EXR,), "png": (PNG,)}


@verb("sequence", "SCENE", *SEEN, "PATH", "frames", "method", "preset", "set", "temporal", "no-temporal", *MACHINE,
      "shadows", "exposure", "format", "resume", "allow-empty", "out", *WRITING,
      frames="How many; as PATH says where absent.", method={"default": "hssil", "help": "Short name of a method."},
      temporal="A setting of the temporal filter, such as weight=0.8; repeatable.",
      exposure={"type": float, "help": "Factor before the sRGB curve of a PNG; the scene's where absent."},
      format={"type": list(KINDS), "default": "both", "help": "EXR (linear), PNG (tone-mapped), or both."},
      allow_empty="Write black frames where the camera sees no surface in any of them.",
      out={"required": True, "help": "Folder for the frames."})
def _sequence(session: Session, asked: Asked) -> int:
    """Render SCENE along a path of camera, lights and objects.

    PATH is a TOML file with keys of camera, lights and objects at shares of the sequence.

    `hssil` blends each frame's light with that of the frame before; another method does where --temporal is given.
    Each frame is written whole as soon as it is done, as PATH's name and a number.
    """
    from refgi.cli.destination import Permission, folder
    from refgi.cli.view import on_threads, require_memory, require_view, settings_for, warm_up
    from refgi.errors import expect
    from refgi.methods import KeepingEstimate, find_method, usual_shadows
    from refgi.provenance import method_record, scene_record
    from refgi.provenance.frames import frame_record, path_record, require_repeatable
    from refgi.scene.files import text_of
    from refgi.scene.path import scenes_along
    from refgi.sssil.temporal import Sequence
    from refgi.stages import Memory

    method, exposure = asked.method, asked.exposure
    expect(exposure is None or 0 < exposure < float("inf"), "--exposure", "a finite number > 0", exposure)
    expect(not asked.resume or asked.form != "png", "--resume",
           "--format both or exr: no PNG holds what to go on from", asked.form)
    light = KeepingEstimate(find_method(method))
    settings = settings_for(method, asked.pairs, asked.seed, asked.preset)
    require_repeatable(settings)
    temporal = temporal_of(asked)
    frame_options = {"dtype": asked.dtype, "rsm_resolution": asked.rsm_resolution,
                     "shadows": asked.shadows or usual_shadows(settings)}
    scene, way, frames = scene_and_way(asked, asked.frames)
    require_memory(scene, asked.dtype, asked.rsm_resolution, traced=method == "truth", settings={method: settings})
    record = {**scene_record(scene, frame_options, exposure=exposure), **method_record(method, settings),
              **path_record(asked.path, frames, temporal)}
    files = FrameFiles(Path(asked.out), text_of(Path(asked.path).stem), KINDS[asked.form], record,
                       lambda number: frame_record(scene, way, number, frames))
    folder(asked.out, Permission(asked.parents, asked.force), files.kept(frames, resume=asked.resume))
    memory = Memory() if way.leaves_at_rest(len(scene.lights)) else None
    made = Sequence(scenes_along(scene, way, frames), settings, temporal, method=light, lobes=light.lobes,
                    memory=memory, **frame_options)
    with on_threads(asked.threads), progress() as tell:
        warm_up([method], asked.dtype, tell)
        done = files.done(frames) if asked.resume else 0
        if not asked.allow_empty:
            require_view(_sees_surface(scenes_along(scene, way, frames), frame_options), scene.name, allowed=False)
        rendered = _render(made, light, files, (done, frames), tell)
    _warn_of_empty([frame["frame"] for frame in rendered if not frame["covered_pixels"]], frames)
    content = {"scene": scene.name, "method": method, "settings": settings, "temporal": temporal, **frame_options,
               "out": asked.out, "first": done, "frames": rendered, "provenance": record}
    session.result(f"{scene.name} by {method}: {len(rendered)} of {frames} frames rendered -> {asked.out}", content)
    return FAILED if any(frame["non_finite_pixels"] for frame in rendered) else DONE


class FrameFiles(NamedTuple):
    """Where frames go, and what makes a frame found there one of these."""

    folder: Path
    stem: str
    suffixes: tuple[str, ...]
    record: "Record"  # what all frames share
    moving: "Callable[[int], Record]"  # what a frame adds, by number

    def of(self, number: int) -> list[Path]:
        """Return the files of a frame."""
        return [self.folder / f"{self.stem}_{number:05d}{suffix}" for suffix in self.suffixes]

    def kept(self, frames: int, *, resume: bool) -> Iterator[str]:
        """Return the files that must be refgi's own: all but EXRs that a resumed sequence finds damaged."""
        return (file.name for number in range(frames) for file in self.of(number) if not (resume and _is_damaged(file)))

    def record_of(self, number: int) -> "Record":
        """Return the record of a frame."""
        return {**self.record, **self.moving(number)}

    def write(self, step: "SequenceFrame", number: int, estimate: Any = None, lobe_estimate: Any = None) -> None:
        """Write a frame, each file whole or not at all, the EXR last: where it is, so are the others."""
        from refgi.cli.destination import make
        from refgi.compare.pictures import linear_planes, write_preview
        from refgi.image import write_exr
        from refgi.provenance import estimate_record

        record = self.record_of(number)
        spread: tuple[Any, Any] = (None, None)
        if estimate is not None:
            record |= estimate_record(estimate, lobe_estimate)
            spread = estimate.variance_of_mean, estimate.samples
        lobe_variance = None if lobe_estimate is None or step.lobes is None else lobe_estimate.variance_of_mean
        make(self.folder)
        for file in sorted(self.of(number), reverse=True):
            if file.suffix == PNG:
                write_preview(file, step.radiance, record)
            else:
                write_exr(file, linear_planes(step.radiance, step.irradiance, *spread, step.frames, step.lobes,
                                              lobe_variance), record)

    def done(self, frames: int) -> int:
        """Return how many frames from the first on are whole; InputError if one is of another sequence."""
        from refgi.errors import InputError
        from refgi.image import read_exr
        from refgi.provenance.frames import same_sequence

        for number in range(frames):
            file = self._exr(number)
            try:
                said = read_exr(file)[1]
            except InputError:
                return number
            other = same_sequence(said, self.record_of(number))
            if other:
                raise InputError(f"{file}: expected a frame of this sequence, to go on after it; got one of other "
                                 f"settings ({', '.join(other)})", file=str(file), key=", ".join(other))
            if not all(other.exists() for other in self.of(number)):
                return number
        return frames

    def light(self, number: int) -> "tuple[Array, Array | None]":
        """Return the indirect irradiance of a frame that is there, (3, h, w), W/m^2, and of how many frames."""
        from refgi.compare.pictures import rgb_of
        from refgi.image import read_exr

        channels = read_exr(self._exr(number))[0]
        return rgb_of(channels, "irradiance."), channels.get("frames")

    def _exr(self, number: int) -> Path:
        return self.folder / f"{self.stem}_{number:05d}{EXR}"


def _is_damaged(file: Path) -> bool:
    from refgi.errors import InputError
    from refgi.image import is_from_refgi, read_exr

    if file.suffix != EXR or not file.is_file() or is_from_refgi(file):
        return False
    try:
        read_exr(file)
    except InputError:
        return True
    return False  # another program's


def _resumed(sequence: "Sequence", files: FrameFiles, done: int) -> "Iterator[SequenceFrame]":
    """Render the frames after the first `done`, to the bit as if there had been no interruption."""
    rest = iter(sequence.scenes)
    history = _history_after(sequence, next(islice(rest, done - 1, None)), files, done - 1) if done else None
    yield from sequence.over(rest, done, history)


def _history_after(sequence: "Sequence", scene: "Scene", files: FrameFiles, number: int) -> "History | None":
    import numpy as np

    from refgi.errors import expect
    from refgi.frame import Frame
    from refgi.sssil.temporal import seeded
    from refgi.sssil.temporal_filter import history_of, with_frames

    if sequence.temporal is None:
        return None
    frame = Frame(scene, **sequence.frame_options)
    if sequence.temporal.form == "printed":  # needs the light before it was filtered
        return history_of(frame, scene.geometry, sequence.method(frame, seeded(sequence.settings, number)))
    expect(frame.dtype == np.float32, "dtype", "float32 to go on from, which an EXR holds whole", frame.dtype.name)
    return history_of(frame, scene.geometry, with_frames(*files.light(number)))


def temporal_of(asked: Asked) -> "TemporalSettings | None":
    """Return the filter that the options ask for; none where they do not and the method has none of its own."""
    from refgi.cli.view import filter_for
    from refgi.errors import expect

    pairs = asked.filtering
    expect(not (pairs and asked.unfiltered), "--temporal", "nothing beside --no-temporal", " ".join(pairs))
    return None if asked.unfiltered or not (pairs or asked.method == "hssil") else filter_for(
        [asked.method], asked.preset, pairs)


def scene_and_way(asked: Asked, frames: int | None) -> "tuple[Scene, Way, int]":
    """Return the scene as it is without the path, the path, and how many frames; all of them are usable.

    `frames`: how many where it is not as the path says.
    """
    from refgi.cli.view import scene_of
    from refgi.errors import blame, expect
    from refgi.scene.path import camera_and_lights
    from refgi.scene.pathfile import read_path

    scene = scene_of(asked)
    with blame(file=asked.path):
        way, own = read_path(asked.path, scene)
    count = own if frames is None else frames
    expect(count is not None, "--frames", f"how many, as {asked.path} has no line such as frames = 24", "nothing")
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
    from refgi.compare.metrics import count_non_finite

    rendered: list[dict[str, Any]] = []
    done, frames = span
    if done == frames:
        return rendered
    started = time.perf_counter()
    for number, step in enumerate(_resumed(sequence, files, done), done):
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

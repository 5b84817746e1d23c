"""One comparison: every method on one scene, judged against path tracing.

A method that knows nothing of what blocks indirect light converges to the truth without visibility, and is measured
against both. Figures are of the indirect irradiance, FLIP is of the radiance. Each method runs on a few pixels, so that
compiling is not timed, then on a frame of its own, whose buffers (G-buffer, RSM) are part of its time.
"""

import contextlib
import dataclasses
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from refgi import stages
from refgi.compare.metrics import flip
from refgi.compare.outcome import TRUTH, UNOCCLUDED, Comparison, MethodResult, Reference, measure
from refgi.errors import InputError, RefgiError, RefgiWarning, expect
from refgi.frame import Frame
from refgi.methods import METHODS, find_method, require_filter
from refgi.provenance import estimate_record
from refgi.provenance.record import environment
from refgi.scene import Scene, load_scene
from refgi.types import Tell

if TYPE_CHECKING:
    from refgi.methods import Picture
    from refgi.provenance.frames import StillFrames


WITHOUT_VISIBILITY: Mapping[str, Any] = MappingProxyType({"visibility": False})  # nothing blocks indirect light
WARM_UP_SIZE = 96  # pixels along a side: more than the coarse grid of `gather`, whose interpolation then runs as well


def compare(
    scene: Scene | str | Path,
    methods: Sequence[str] | None = None,
    *,
    width: int | None = None,
    height: int | None = None,
    truth_settings: Any = None,
    method_settings: Mapping[str, Any] | None = None,
    out: str | Path | None = None,
    progress: Tell | None = None,
    still: "StillFrames | None" = None,
    **frame_options: Any,
) -> Comparison:
    """Run methods on a scene and judge them against path tracing.

    Parameters
    ----------
    scene : Scene, str or Path
        A scene, or what `load_scene` takes.
    methods : sequence of str, optional
        Names of `METHODS`; all but the truth where absent.
    width, height : int, optional
        Picture size in pixels; the camera's own where absent.
    truth_settings : TruthSettings, optional
        How the truth is traced.
    method_settings : mapping of str to settings, optional
        Settings by method; the paper's where absent.
    out : str or Path, optional
        Folder for pictures, results.json and index.html; nothing is written where absent.
    progress : callable, optional
        Called with (what runs, fraction done).
    still : StillFrames, optional
        Frames that methods with a temporal filter blend, and by which settings; their time is that of one frame.
    **frame_options : object
        Passed to `Frame`: dtype, rsm_resolution, shadows ("exact" where absent: rays are traced anyway).

    Returns
    -------
    Comparison
        Pictures, figures and times.

    Raises
    ------
    InputError
        If scene, methods or settings are not usable, or `out` cannot be written. An error of one method while it
        runs does not stop the others; it is in `failures`.
    """
    scene = scene if isinstance(scene, Scene) else load_scene(scene)
    names = _names(methods)
    settings = _settings(names, truth_settings, method_settings or {})
    blended = [] if still is None else require_filter(names)
    runner = _Runner(scene, {"width": width, "height": height, "shadows": "exact", **frame_options}, progress)
    if out is not None:
        require_folder(Path(out))
    references = {TRUTH: runner.reference(TRUTH, settings[TRUTH])}
    if not all(METHODS[name].knows_visibility(settings[name]) for name in names):
        references[UNOCCLUDED] = runner.reference(UNOCCLUDED, limited(settings[TRUTH], UNOCCLUDED, WITHOUT_VISIBILITY))
    results, failures = {}, {}
    for name in names:
        try:
            results[name] = runner.method(name, settings[name], references, accounts=out is not None,
                                          still=still if name in blended else None)
        except RefgiError as error:
            failures[name] = str(error)
    frame = runner.frame
    comparison = Comparison(scene, frame.width, frame.height, runner.options, frame.gbuffer.covered, references,
                            results, failures, environment())
    if out is not None:
        _write(comparison, Path(out), progress)
    return comparison


class _Runner:
    """Runs methods on frames of one scene and view."""

    def __init__(self, scene: Scene, options: Mapping[str, Any], progress: Tell | None) -> None:
        self.frame = Frame(scene, **options)  # shows every method's irradiance; never timed
        expect(bool(self.frame.gbuffer.covered.any()), f"scene {scene.name!r}: camera", "a view of some surface",
               "a view past all of it")
        self.scene, self.progress = scene, progress
        self.options: dict[str, Any] = {"dtype": self.frame.dtype.name, "rsm_resolution": self.frame.rsm_resolution,
                        "shadows": self.frame.shadows}

    def reference(self, name: str, settings: Any) -> Reference:
        from refgi.truth import trace_truth

        self._warm_up(trace_truth, dataclasses.replace(settings, samples=1, seconds=None, target_error=None,
                                                       checkpoint=None))
        self._tell(name, 0.0)
        made = trace_reference(self._fresh_frame(self.frame.width, self.frame.height), name, settings,
                               self._inner_progress(name), self.frame)
        self._tell(name, 1.0)
        return made

    def method(
        self, name: str, settings: Any, references: Mapping[str, Reference], *, accounts: bool,
        still: "StillFrames | None" = None,
    ) -> MethodResult:
        method = METHODS[name]
        self._warm_up(method.made, settings)
        frames = None
        if still is None:
            light, seconds, runs = self._timed(name, lambda frame: method.made(frame, settings))
        else:
            light, seconds, runs = self._timed(name, lambda _: self._blended(name, settings, still))
            frames, seconds = light.frames, seconds / still.frames
        irradiance, lobes = light.irradiance, light.lobes
        radiance, covered = self.frame.radiance(irradiance, lobes), self.frame.gbuffer.covered
        judges = [TRUTH] if method.knows_visibility(settings) else [TRUTH, UNOCCLUDED]
        against = {j: measure(irradiance, references[j].irradiance, references[j].variance, covered,
                              references[j].mean_variance, trusted=not references[j].doubt) for j in judges}
        shown = {j: references[j].lobes for j in judges if references[j].lobes is not None}
        lobes_against = {} if lobes is None else {
            j: measure(lobes, one.mean, one.variance_of_mean, covered, _over_all(one, covered), trusted=not one.doubt)
            for j, one in shown.items()}
        seen = flip(radiance, references[TRUTH].radiance, covered)
        account = method.ledger if accounts else None
        ledger = account(self.frame, settings) if account else None
        return MethodResult(name, method.summary, settings, irradiance, radiance, seconds, runs, against, seen, ledger,
                            still, frames, lobes, lobes_against)

    def _blended(self, name: str, settings: Any, still: "StillFrames") -> "Picture":
        from refgi.provenance.frames import render_still

        size = {"width": self.frame.width, "height": self.frame.height}
        return render_still(self.scene, name, settings, still, {**self.options, **size})

    def _warm_up(self, function: Callable[[Frame, Any], Any], settings: Any) -> None:
        with (stages.standing_for(self.frame.width * self.frame.height), warnings.catch_warnings(),
              contextlib.suppress(RefgiError)):  # the real run will say it
            warnings.simplefilter("ignore", RefgiWarning)
            function(self._fresh_frame(WARM_UP_SIZE, WARM_UP_SIZE), settings)

    def _timed(self, name: str, run: Callable[[Frame], Any]) -> tuple[Any, float, tuple[stages.Run, ...]]:
        frame = self._fresh_frame(self.frame.width, self.frame.height)
        self._tell(name, 0.0)
        with stages.observe(progress=self._inner_progress(name)) as log:
            started = time.perf_counter()
            made = run(frame)
            seconds = time.perf_counter() - started
        self._tell(name, 1.0)
        return made, seconds, tuple(log.runs)

    def _fresh_frame(self, width: int, height: int) -> Frame:
        return Frame(self.scene, width=width, height=height, **self.options)

    def _inner_progress(self, name: str) -> Tell | None:
        return (lambda stage, done: self._tell(f"{name}: {stage}", done)) if self.progress else None

    def _tell(self, what: str, done: float) -> None:
        if self.progress is not None:
            self.progress(what, done)


def trace_reference(frame: Frame, name: str, settings: Any, progress: Tell | None = None,
                    shown: Frame | None = None) -> Reference:
    """Trace what pictures are judged by: the truth, or what else its settings say; its radiance by a frame `shown`."""
    from refgi.truth import trace_truth

    with stages.observe(progress=progress) as log:
        started = time.perf_counter()
        found = trace_truth(frame, settings)
        light, lobes = METHODS[TRUTH].compute_lobes(frame, settings)
        seconds = time.perf_counter() - started
    radiance = (shown or frame).radiance(np.asarray(found.mean, frame.dtype), light)
    return Reference(name, settings, found.mean, found.variance_of_mean, found.picture_variance, found.samples,
                     radiance, seconds, tuple(log.runs), estimate_record(found, lobes), lobes, found.doubt)


def _over_all(lobes: Any, covered: Any) -> Any:
    """Return the variance of the mean of lobes over all pixels that see a surface; theirs is over glossy ones."""
    return lobes.picture_variance * (lobes.block_pixels.sum() / covered.sum()) ** 2


def _names(methods: Sequence[str] | None) -> list[str]:
    names = list(METHODS) if methods is None else [find_method(name).name for name in methods]
    names = [name for name in dict.fromkeys(names) if name != TRUTH]
    expect(bool(names), "methods", f"one or more of {', '.join(n for n in METHODS if n != TRUTH)}", "none")
    return names


def _settings(names: Sequence[str], truth: Any, given: Mapping[str, Any]) -> dict[str, Any]:
    for name in given:
        expect(name in names, "method_settings", f"methods of this comparison ({', '.join(names)})", name)
    settings = {}
    for name in (*names, TRUTH):
        wanted = METHODS[name].settings
        value = truth if name == TRUTH else given.get(name)
        value = wanted() if value is None else value
        expect(isinstance(value, wanted), f"settings of {name}", wanted.__name__, type(value).__name__)
        settings[name] = value
    return settings


def limited(settings: Any, name: str, limits: Mapping[str, Any]) -> Any:
    """Return how a truth is traced that shares limits of a method, with a checkpoint file of its own by `name`."""
    checkpoint = settings.checkpoint
    if checkpoint and not Path(checkpoint).is_dir():  # a folder has a file for each
        checkpoint = f"{checkpoint}.{name}"
    return dataclasses.replace(settings, **limits, checkpoint=checkpoint)


def require_folder(folder: Path) -> None:
    """Make a folder where it is missing; InputError if it cannot be made."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"out: {folder} cannot be written: {error.strerror or error}") from error


def _write(comparison: Comparison, folder: Path, progress: Tell | None) -> None:
    from refgi.compare.report import write_report, write_results

    for what, write in (("pictures and results.json", write_results), ("index.html", write_report)):
        if progress is not None:
            progress(what, 0.0)
        write(comparison, folder)
        if progress is not None:
            progress(what, 1.0)

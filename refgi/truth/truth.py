"""The ground truth: path-traced one-bounce irradiance at the G-buffer's points, with its standard error."""

import dataclasses
import hashlib
import math
import sys
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from refgi.errors import RefgiWarning
from refgi.method import Approximation, Method
from refgi.pairs.shadow_rays import receivers
from refgi.rsm.raster.projection import camera_projection
from refgi.scene import Scene
from refgi.skips import left_out
from refgi.stages import report_progress, stage
from refgi.truth.caustics import MIRROR_EXPONENT, SHARP_LOBE, Film, film
from refgi.truth.cell_pass import with_cells
from refgi.truth.checkpoint import FIRST_LINE, Checkpoint
from refgi.truth.light_pass import pilot
from refgi.truth.lobe_cells import glossy_triangles, lobes_of, meets_photons
from refgi.truth.lobe_pass import lobe_pass
from refgi.truth.passes import directions_shared_out, one_pass
from refgi.truth.result import (
    Moments,
    TruthResult,
    add_pass,
    blocks_of,
    is_doubted,
    no_passes,
    result_of,
    with_means,
)
from refgi.truth.settings import TruthSettings
from refgi.truth.surfaces import lights_of, surfaces
from refgi.truth.task import Task, sets_of
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.frame import Frame
Prepare = Callable[[Scene, Any, Array, Array, Array, TruthSettings], Task]

STOPPING = {"samples", "seconds", "target_error", "checkpoint", "batch"}  # settings that change no pass
MORE, MOST_SAMPLES = 4, 2**31  # samples for each one where few are switched off; as many as there may be


def truth(frame: "Frame", settings: TruthSettings | None = None) -> Array:
    """Compute the one-bounce irradiance by path tracing.

    Parameters
    ----------
    frame : Frame
        The view of the scene.
    settings : TruthSettings, optional
        How; the defaults where absent.

    Returns
    -------
    (3, h, w) ndarray
        Irradiance in the frame's dtype, W/m^2, linear RGB. Excludes the receiver's albedo/pi.
    """
    return trace_truth(frame, settings).mean.astype(frame.dtype)


def trace_truth(frame: "Frame", settings: TruthSettings | None = None) -> TruthResult:
    """Compute the one-bounce irradiance by path tracing, with its standard error.

    Parameters
    ----------
    frame : Frame
        The view of the scene.
    settings : TruthSettings, optional
        How; the defaults where absent.

    Returns
    -------
    TruthResult
        Mean, variance of the mean and sample count of every pixel.

    Raises
    ------
    InputError
        If the checkpoint file is damaged or of another computation.
    """
    settings = settings or TruthSettings()
    if not settings.caustics and any(material.is_dielectric for material in frame.scene.materials):
        warnings.warn(RefgiWarning(f"scene {frame.scene.name!r}: its glass is opaque and black in the truth; "
                                   "caustics=True lets light through"), stacklevel=3)
    buffer = frame.gbuffer
    return accumulate(frame.scene, frame.tracer, buffer.position, buffer.normal, buffer.triangle_id, settings)


def trace_lobes(frame: "Frame", settings: TruthSettings | None = None) -> TruthResult:
    """Compute by path tracing what lobes of receivers make of one-bounce light, with its standard error.

    Radiance towards the eye, W/m^2/sr, 0 where no lobe reflects there; means over blocks and picture are over pixels
    with a lobe. Raises InputError if the checkpoint file is damaged or of another computation.
    """
    buffer = frame.gbuffer
    return accumulate_lobes(frame.scene, frame.tracer, buffer.position, buffer.normal, buffer.triangle_id,
                            settings or TruthSettings())


@stage("truth.accumulate", steps="refgi.truth.steps.truth_steps")
def accumulate(scene: Scene, tracer: Any, position: Array, normal: Array, triangle_id: Array,
               settings: TruthSettings) -> TruthResult:
    """Average independent passes over a G-buffer until the settings say stop.

    tracer Tracer: Rays against the scene.
    -> TruthResult: Mean, variance of the mean and sample count of every pixel.

    Raises
    ------
    InputError
        If the checkpoint file is damaged or of another computation.
    """
    return averaged(without_pilot, scene, tracer, (position, normal, triangle_id), settings)


@stage("truth.accumulate_lobes")
def accumulate_lobes(scene: Scene, tracer: Any, position: Array, normal: Array, triangle_id: Array,
                     settings: TruthSettings) -> TruthResult:
    """Average independent passes of what lobes reflect towards the eye until the settings say stop.

    tracer Tracer: Rays against the scene.
    settings: How and how long; a checkpoint has a file of its own, with ".lobes" behind its name.
    -> TruthResult: Mean, variance of the mean and sample count of every pixel, W/m^2/sr.

    Raises
    ------
    InputError
        If the checkpoint file is damaged or of another computation.
    """
    glossy = glossy_triangles(scene, position, normal, triangle_id)
    if settings.checkpoint and not Path(settings.checkpoint).is_dir():
        place = Path(settings.checkpoint)
        settings = dataclasses.replace(settings, checkpoint=place.with_name(place.name + ".lobes"))
    return averaged(_with_lobes, scene, tracer, (position, normal, glossy), settings)


def averaged(prepare: Prepare, scene: Scene, tracer: Any, buffer: tuple[Array, Array, Array],
             settings: TruthSettings) -> TruthResult:
    """Return the mean of passes over a G-buffer (position, normal, triangle ids) of a task that `prepare` makes."""
    shape = buffer[2].shape
    if settings.seconds is not None:
        _warm_up(prepare, scene, tracer, buffer, settings)
    started = time.perf_counter()
    task = prepare(scene, tracer, *buffer, settings)
    block, grid = blocks_of(task.receivers.pixel, shape)
    blocks = grid[0] * grid[1]
    values = len(block) + blocks + 1
    file = (_checkpoint(Path(settings.checkpoint), _fingerprint(task, shape), values, blocks) if settings.checkpoint
            else None)
    moments = file.moments if file else no_passes(values, blocks)
    ready: Task | None = None
    while not _is_done(moments, len(block), settings, time.perf_counter() - started):
        ready = ready or _guided(task)
        add_pass(moments, with_means(_pass(ready, int(moments.passes)), block, blocks), block)
        if file:
            file.save_when_due()
        report_progress(min(1.0, int(moments.passes) / settings.passes))
    if file:
        file.save()
    result = result_of(moments, task.receivers.pixel, shape, (block, grid), task.picks + task.directions)
    if result.lost:
        warnings.warn(RefgiWarning(f"scene {scene.name!r}: {result.lost} of {int(moments.passes) * len(block)} values "
                                   "of a pixel in a pass are not finite numbers and left out"), stacklevel=4)
    return result


def _pass(task: Task, number: int) -> Array:
    return one_pass(task, number) if task.lobes is None else lobe_pass(task, number)


def _photons(scene: Scene, shape: tuple[int, ...], settings: TruthSettings) -> tuple[Film | None, float]:
    """Return the film of photons, and the exponent from which on lobes are left to them; warn if none can be.

    Photons follow lobes without `visibility` or for what the camera sees as little as beyond the first bounce.
    """
    picture = shape[0], shape[1]
    if settings.caustics:
        return film(scene, picture), MIRROR_EXPONENT
    sharp = [m.name for m in scene.materials if m.is_glossy and not m.is_dielectric and m.exponent >= SHARP_LOBE]
    alone = settings.visibility and settings.emitters == "all"
    if sharp and not (alone and settings.bounces == 1):
        what = ("left out beyond the first bounce" if alone else
                "sampled by chance, which may miss them: standard errors do not show what was never met")
        warnings.warn(RefgiWarning(f"scene {scene.name!r}: the lobes of {len(sharp)} material(s), {sharp[0]!r} first, "
                                   f"are sharp (exponent {SHARP_LOBE:g} or more) and {what}"), stacklevel=5)
    count = settings.photons * len(scene.lights)
    if not alone or (not sharp and left_out("truth.photons", lambda: (count, count))):
        return None, math.inf
    return film(scene, picture, SHARP_LOBE, longest=2, even_empty=not sharp), SHARP_LOBE


def _warm_up(prepare: Prepare, scene: Scene, tracer: Any, buffer: tuple[Array, Array, Array],
             settings: TruthSettings) -> None:
    """Run a pass of one pixel, so that kernels are compiled or loaded before the clock starts."""
    settings = dataclasses.replace(settings, photons=1)
    covered = np.flatnonzero(buffer[2].reshape(-1) >= 0)[:1]
    position, normal = (field.reshape(3, 1, -1)[..., covered] for field in buffer[:2])
    task = prepare(scene, tracer, position, normal, buffer[2].reshape(1, -1)[:, covered], settings)
    values = with_means(_pass(_guided(task), 0), np.zeros(len(covered), np.int64), 1)
    moments = no_passes(values.shape[1], 1)
    add_pass(moments, values, np.zeros(len(covered), np.int64))
    is_doubted(moments, len(covered))


def task_of(scene: Scene, tracer: Any, position: Array, normal: Array, triangle_id: Array,
            settings: TruthSettings) -> Task:
    """Prepare the inputs of every pass.

    `position`, `normal` (3, h, w): the G-buffer's, world space. `triangle_id` (h, w) int: which triangle each pixel
    sees; -1 for none. Result: with the densities that the pilot found.
    """
    return _guided(without_pilot(scene, tracer, position, normal, triangle_id, settings))


def _guided(task: Task) -> Task:
    """Return a task with densities of the lights' rays, cells of lobes and shares of directions."""
    return with_cells(task._replace(densities=pilot(task), groups=directions_shared_out(task)))


def without_pilot(scene: Scene, tracer: Any, position: Array, normal: Array, triangle_id: Array,
                  settings: TruthSettings) -> Task:
    """Return a task without the densities that a pilot finds."""
    points = receivers(scene.geometry, position, normal, triangle_id, tracer.grain)
    set_of = sets_of(points.pixel, triangle_id.shape[1], settings.interleave)
    caustics, left_to_photons = _photons(scene, triangle_id.shape, settings)
    reflecting = surfaces(scene, left_to_photons)
    view = camera_projection(scene.camera, *triangle_id.shape[::-1]) if settings.emitters == "visible" else None
    return Task(scene, settings, tracer, reflecting, lights_of(scene), points, set_of, triangle_id.shape, caustics,
                left_to_photons, view)


def _with_lobes(scene: Scene, tracer: Any, position: Array, normal: Array, triangle_id: Array,
                settings: TruthSettings) -> Task:
    """Return a task of lobes; `triangle_id`: as `glossy_triangles` has it."""
    task = without_pilot(scene, tracer, position, normal, triangle_id, settings)
    lobes = lobes_of(scene, task.receivers.pixel, position, normal, triangle_id, task.left_to_photons)
    count = settings.photons * len(scene.lights)
    if task.caustics is not None and not settings.caustics and not meets_photons(lobes) and left_out(
            "truth.photons", lambda: (count, count)):
        task = task._replace(caustics=None)
    return task._replace(lobes=lobes)


def _checkpoint(place: Path, computation: bytes, values: int, blocks: int) -> Checkpoint:
    """Return the checkpoint in a file, or in a folder's file that is named by what is computed."""
    return Checkpoint(place / f"{computation.hex()}.truth" if place.is_dir() else place, computation, values, blocks)


def _is_done(moments: Moments, receivers: int, settings: TruthSettings, seconds: float) -> bool:
    """Return whether to stop; an error is not met as long as the tails say that it is not to be trusted."""
    passes = int(moments.passes)
    if passes < 2:
        return False
    if passes >= settings.passes or (settings.seconds is not None and seconds >= settings.seconds):
        return True
    if settings.target_error is None:
        return False
    error = np.sqrt(moments.variance_of_mean[:, :receivers].mean()) if receivers else 0.0
    return bool(error <= settings.target_error * moments.mean[:, -1].mean()) and not is_doubted(moments, receivers)


def _fingerprint(task: Task, shape: tuple[int, ...]) -> bytes:
    """Return a digest of everything the passes depend on; not of when they stop."""
    chosen = {field.name: getattr(task.settings, field.name) for field in dataclasses.fields(task.settings)
              if field.name not in STOPPING}
    digest = hashlib.sha256(FIRST_LINE + repr((sys.modules["refgi"].__version__, shape, chosen)).encode())
    view_arrays = () if task.view is None else (task.view.origin, task.view.frame, task.view.half)
    film = () if task.caustics is None else (task.caustics.solid_angle, *task.caustics.mirrors, task.caustics.ior)
    lobes = () if task.lobes is None else (*task.lobes[:3], np.array(task.lobes.photon_exponent))
    for array in _arrays((task.surfaces, task.lights, task.receivers, view_arrays, film, lobes)):
        digest.update(repr((array.shape, array.dtype.str)).encode() + np.ascontiguousarray(array).data)
    return digest.digest()


def _arrays(parts: Iterable[Any]) -> Iterator[Array]:
    """Yield the arrays of tuples in tuples; one without values where there is none."""
    for part in parts:
        if isinstance(part, tuple):
            yield from _arrays(part)
        else:
            yield np.zeros(0) if part is None else part


def _more_samples(settings: TruthSettings, _: Mapping[str, Any]) -> TruthSettings:
    return dataclasses.replace(settings, samples=min(MOST_SAMPLES, MORE * settings.samples), seconds=None,
                               target_error=None)


def _limits(settings: TruthSettings, name: str) -> Mapping[str, Any]:
    """Return what the truth leaves out by one of its settings."""
    value = getattr(settings, name)
    return {} if value == getattr(TruthSettings(), name) else {name: value}


APPROXIMATIONS = (
    Approximation("unseen senders", "only what the camera sees sends light", limit=lambda s: _limits(s, "emitters")),
    Approximation("visibility", "nothing blocks indirect light", limit=lambda s: _limits(s, "visibility")),
    Approximation("few samples", f"S samples a pixel; off: {MORE} for each", _more_samples, from_truth=lambda _: True))

METHOD = Method("truth", "one-bounce path tracing with a standard error for every pixel", truth, TruthSettings,
                visibility=lambda settings: settings.visibility, estimate=trace_truth,
                approximations=APPROXIMATIONS, lobe_estimate=trace_lobes)

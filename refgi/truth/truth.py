"""The ground truth: one-bounce irradiance at the G-buffer's points, with its standard error."""

import hashlib
import math
import time
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.errors import RefgiWarning
from refgi.rsm.projection import camera_projection
from refgi.scene import Scene
from refgi.shadowed import Receivers, receivers
from refgi.stages import report_progress, stage
from refgi.truth.caustics import MIRROR_EXPONENT, film
from refgi.truth.moments import Moments, add_pass, load, no_passes, save
from refgi.truth.passes import one_pass
from refgi.truth.pilot import pilot
from refgi.truth.settings import TruthSettings
from refgi.truth.surfaces import lights_of, surfaces
from refgi.truth.task import Task, sets_of

if TYPE_CHECKING:
    from refgi.frame import Frame

Array = npt.NDArray[Any]


class TruthResult(NamedTuple):
    """Irradiance by path tracing, and how sure it is."""

    mean: Array  # (3, h, w) float64, W/m^2
    variance_of_mean: Array  # (3, h, w) float64, (W/m^2)^2, estimated from the spread of the passes
    samples: Array  # (h, w) int64 samples a pixel; 0 where nothing is seen
    picture_mean: Array  # (3,) float64: mean over all pixels that see a surface
    picture_variance: Array  # (3,) float64: variance of that mean, with the correlation between pixels
    passes: int

    @property
    def standard_error(self) -> Array:
        """Standard error of each pixel and channel, (3, h, w), W/m^2."""
        return np.sqrt(self.variance_of_mean)


def truth(frame: "Frame", settings: TruthSettings | None = None) -> Array:
    """Compute the one-bounce irradiance by path tracing.

    Parameters
    ----------
    frame : Frame
        What is seen and lit.
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
        What is seen and lit.
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


@stage("truth.accumulate")
def accumulate(scene: Scene, tracer: Any, position: Array, normal: Array, triangle_id: Array,
               settings: TruthSettings) -> TruthResult:
    """Average independent passes over a G-buffer until the settings say stop.

    Parameters
    ----------
    scene : Scene
        The scene.
    tracer : Tracer
        Its rays.
    position, normal : (3, h, w) ndarray
        The G-buffer's, world space.
    triangle_id : (h, w) int ndarray
        Which triangle each pixel sees; -1 for none.
    settings : TruthSettings
        How and how long.

    Returns
    -------
    TruthResult
        Mean, variance of the mean and sample count of every pixel.

    Raises
    ------
    InputError
        If the checkpoint file is damaged or of another computation.
    """
    started = time.perf_counter()
    task = task_of(scene, tracer, position, normal, triangle_id, settings)
    to = task.to
    file = Path(settings.checkpoint) if settings.checkpoint else None
    name = _fingerprint(task) if file else ""
    moments = load(file, name) if file and file.exists() else no_passes(len(to.pixel))
    while not _enough(moments, settings, time.perf_counter() - started):
        add_pass(moments, one_pass(task, int(moments.passes)))
        if file:
            save(file, moments, name)
        report_progress(min(1.0, int(moments.passes) / settings.passes))
    return _result(moments, to, settings, triangle_id.shape)


def task_of(scene: Scene, tracer: Any, position: Array, normal: Array, triangle_id: Array,
            settings: TruthSettings) -> Task:
    """Prepare what every pass works on.

    Parameters
    ----------
    scene : Scene
        The scene.
    tracer : Tracer
        Its rays.
    position, normal : (3, h, w) ndarray
        The G-buffer's, world space.
    triangle_id : (h, w) int ndarray
        Which triangle each pixel sees; -1 for none.
    settings : TruthSettings
        How.

    Returns
    -------
    Task
        With receivers sorted by the set of lit points that they pick from.
    """
    to = receivers(scene.geometry, position, normal, triangle_id, tracer.offset)
    set_of = sets_of(to.pixel, triangle_id.shape[1], settings.interleave)
    order = np.argsort(set_of, kind="stable")
    to = Receivers(*(np.ascontiguousarray(field[..., order]) for field in to))
    caustics = film(scene, triangle_id.shape) if settings.caustics else None
    found = surfaces(scene, MIRROR_EXPONENT if settings.caustics else math.inf)
    view = camera_projection(scene.camera, *triangle_id.shape[::-1]) if settings.emitters == "seen" else None
    task = Task(scene, settings, tracer, found, lights_of(scene), to, set_of[order], caustics, view)
    return task._replace(densities=pilot(task))


def _enough(moments: Moments, settings: TruthSettings, seconds: float) -> bool:
    passes = int(moments.passes)
    if passes < 2:
        return False
    if passes >= settings.passes or (settings.seconds is not None and seconds >= settings.seconds):
        return True
    if settings.target_error is None:
        return False
    error = np.sqrt(moments.variance_of_mean[:, :-1].mean()) if moments.mean.shape[1] > 1 else 0.0
    return bool(error <= settings.target_error * moments.mean[:, -1].mean())


def _result(moments: Moments, to: Receivers, settings: TruthSettings, shape: tuple[int, ...]) -> TruthResult:
    mean, variance = np.zeros((3, *shape)), np.zeros((3, *shape))
    samples = np.zeros(shape, np.int64)
    variance_of_mean = moments.variance_of_mean
    mean.reshape(3, -1)[:, to.pixel] = moments.mean[:, :-1]
    variance.reshape(3, -1)[:, to.pixel] = variance_of_mean[:, :-1]
    per_pass = settings.picks_per_pass + settings.directions_per_pass
    samples.reshape(-1)[to.pixel] = int(moments.passes) * per_pass
    return TruthResult(mean, variance, samples, moments.mean[:, -1].copy(), variance_of_mean[:, -1],
                       int(moments.passes))


def _fingerprint(task: Task) -> str:
    """Return a name for everything the passes depend on; not for when they stop."""
    settings = task.settings
    digest = hashlib.sha256(repr((
        settings.estimator, settings.visibility, settings.bounces, settings.caustics, settings.seed,
        settings.light_grid, settings.picks_per_pass, settings.directions_per_pass, settings.bound,
        settings.photons)).encode())
    seen_by = () if task.view is None else (task.view.origin, task.view.frame, task.view.half)
    for array in (*task.surfaces, *task.lights, *task.to, *seen_by):
        digest.update(repr(array.shape).encode() + np.ascontiguousarray(array).data)
    return digest.hexdigest()

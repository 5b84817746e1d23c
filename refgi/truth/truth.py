"""The ground truth: one-bounce irradiance at the G-buffer's points, with its standard error."""

import hashlib
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
from refgi.truth.caustics import MIRROR_EXPONENT, SHARP_LOBE, Film, film
from refgi.truth.moments import Moments, add_pass, load, no_passes, save
from refgi.truth.passes import Task, one_pass
from refgi.truth.settings import TruthSettings
from refgi.truth.surfaces import lights_of, surfaces

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
    lost: int = 0  # values of a pixel in a pass that were not finite numbers and are left out

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
    to = receivers(scene.geometry, position, normal, triangle_id, tracer.grain)
    caustics = film(scene, triangle_id.shape) if settings.caustics else _sharp_lobes(scene, triangle_id.shape, settings)
    found = surfaces(scene, MIRROR_EXPONENT if settings.caustics else SHARP_LOBE)
    view = camera_projection(scene.camera, *triangle_id.shape[::-1]) if settings.emitters == "seen" else None
    task = Task(scene, settings, tracer, found, lights_of(scene), to, caustics, view)
    file = Path(settings.checkpoint) if settings.checkpoint else None
    name = _fingerprint(task) if file else ""
    moments = load(file, name) if file and file.exists() else no_passes(len(to.pixel))
    while not _enough(moments, settings, time.perf_counter() - started):
        add_pass(moments, one_pass(task, int(moments.passes)))
        if file:
            save(file, moments, name)
        report_progress(min(1.0, int(moments.passes) / settings.passes))
    result = _result(moments, to, settings, triangle_id.shape)
    if result.lost:
        warnings.warn(RefgiWarning(f"scene {scene.name!r}: {result.lost} of {int(moments.passes) * len(to.pixel)} "
                                   "values of a pixel in a pass are not finite numbers and left out"), stacklevel=3)
    return result


def _sharp_lobes(scene: Scene, shape: tuple[int, ...], settings: TruthSettings) -> Film | None:
    """Return where photons off sharp lobes are counted; warn where the settings ask for more than photons know."""
    sharp = [m.name for m in scene.materials if m.is_glossy and not m.is_dielectric and m.exponent >= SHARP_LOBE]
    if sharp and (settings.bounces > 1 or not settings.visibility or settings.emitters == "seen"):
        kept = "beyond the first bounce" if settings.visibility and settings.emitters == "all" else "here"
        warnings.warn(RefgiWarning(f"scene {scene.name!r}: the lobes of {len(sharp)} material(s), {sharp[0]!r} first, "
                                   f"are too sharp to sample (exponent {SHARP_LOBE:g} or more) and left out {kept}"),
                      stacklevel=4)
        if kept == "here":
            return None
    return film(scene, (shape[0], shape[1]), SHARP_LOBE, longest=2) if sharp else None


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
    samples.reshape(-1)[to.pixel] = (int(moments.passes) - moments.lost[:-1]) * per_pass
    return TruthResult(mean, variance, samples, moments.mean[:, -1].copy(), variance_of_mean[:, -1],
                       int(moments.passes), int(moments.lost[:-1].sum()))


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

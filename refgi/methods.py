"""The table of methods: those of refgi, and those that other packages register by the entry point `refgi.methods`.

A method declares itself by a `Method` in its package; here stands only where it is. It is imported when it is used.
"""

import warnings
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from refgi.diagnostics import LightcutsChoice, SamplingError, diagnosing, is_due
from refgi.errors import InputError, RefgiWarning
from refgi.method import Method
from refgi.skips import left_out
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.frame import Frame, Shadows
    from refgi.scene import Scene

GROUP = "refgi.methods"  # of entry points
FEW_BACKS = 0.01  # of what a picture shows; silhouettes of closed meshes have some by rounding
BUILT_IN = {
    "sii": "refgi.splat.sii:METHOD",
    "multires": "refgi.splat.multires:METHOD",
    "val": "refgi.cluster:METHOD",
    "hssil": "refgi.sssil:METHOD",
    "gather": "refgi.splat.gather:METHOD",
    "vpl": "refgi.truth.vpl:METHOD",
    "truth": "refgi.truth.truth:METHOD",
}


class Methods(Mapping[str, Method]):
    """Every method there is, by name."""

    def __getitem__(self, name: str) -> Method:
        """Import a method."""
        return _load(_places()[name])

    def __iter__(self) -> Iterator[str]:
        """Yield the names: refgi's own, then those of other packages."""
        return iter(_places())

    def __len__(self) -> int:
        """Return how many there are."""
        return len(_places())


METHODS = Methods()


@cache
def _places() -> dict[str, EntryPoint]:
    own = {name: EntryPoint(name, value, GROUP) for name, value in BUILT_IN.items()}
    others = {entry.name: entry for entry in entry_points(group=GROUP)}
    return own | {name: entry for name, entry in others.items() if name not in own}


@cache
def _load(entry: EntryPoint) -> Method:
    try:
        module, _, name = entry.value.partition(":")
        method = getattr(import_module(module), name)
    except (ImportError, AttributeError) as error:
        raise InputError(f"method {entry.name}: {entry.value} cannot be imported: {error}", key="method") from error
    if not isinstance(method, Method) or method.name != entry.name:
        raise InputError(f"method {entry.name}: expected a refgi.method.Method of that name at {entry.value}, "
                         f"got {method!r}", key="method")
    return method


class Picture(NamedTuple):
    """What a method made of a scene."""

    frame: "Frame"
    irradiance: Array  # (3, h, w) indirect, W/m^2
    radiance: Array  # (3, h, w) what the camera receives, W/m^2/sr
    estimate: Any = None  # a `TruthResult`, of a method that states its own error
    frames: Any = None  # (h, w) frames that each pixel is blended of, of a temporal filter that counts them
    lobes: Array | None = None  # (3, h, w) radiance of receivers' lobes by indirect light, W/m^2/sr, if any
    lobe_estimate: Any = None  # as `estimate`, of the lobes, W/m^2/sr
    sampling_error: SamplingError | None = None  # of the irradiance, of methods that draw lights or samples
    lightcuts: LightcutsChoice | None = None  # of methods that chose to sum clusters of lights


class KeepingEstimate:
    """A method as a function of frame and settings, which keeps the estimate of its last frame."""

    def __init__(self, method: Method) -> None:
        self._method = method
        self.estimate: Any = None
        self.lobe_estimate: Any = None
        self.sampling_error: SamplingError | None = None

    def __call__(self, frame: "Frame", settings: Any) -> Array:
        """Return the indirect irradiance, (3, h, w), W/m^2."""
        with diagnosing() as found:
            light, self.estimate = self._method.compute(frame, settings)
        if found.due:
            self.sampling_error = found.sampling_error
        return light

    def lobes(self, frame: "Frame", settings: Any) -> Array | None:
        """Return the radiance of receivers' lobes by indirect light, (3, h, w), W/m^2/sr; None where there are none."""
        lobes, self.lobe_estimate = self._method.compute_lobes(frame, settings)
        return lobes


def find_method(name: str) -> Method:
    """Return a row of the table of methods by its short name; `InputError` if there is none."""
    if not isinstance(name, str) or name not in METHODS:
        raise InputError(f"method: expected one of {', '.join(METHODS)}, got {name!r}")
    return METHODS[name]


def require_filter(names: Iterable[str]) -> list[str]:
    """Return those of some methods, by short name, that blend frames over time; `InputError` if none does."""
    asked = list(names)
    having = [name for name in asked if find_method(name).temporal is not None]
    if not having:
        known = ", ".join(name for name in METHODS if METHODS[name].temporal is not None)
        raise InputError(f"frames: expected a method with a temporal filter ({known}), got {', '.join(asked)}",
                         key="frames")
    return having


def usual_shadows(settings: Any) -> "Shadows":
    """Return where direct light's shadows come from unless it is said.

    By rays where the settings' `traces_rays` says that some are traced anyway, else from the map, so that no rays need
    be set up.
    """
    return "exact" if getattr(settings, "traces_rays", False) else "map"


def render(scene: "Scene | str | Path", method: str = "sii", settings: Any = None, **frame_options: Any) -> Picture:
    """Render a scene by one method.

    Parameters
    ----------
    scene : Scene, str or Path
        A scene, or what `load_scene` takes.
    method : str
        A name of `METHODS`.
    settings : object, optional
        The method's settings; its defaults where absent.
    **frame_options : object
        Passed to `Frame`: width, height, dtype, rsm_resolution, shadows (where absent those of `usual_shadows`).

    Returns
    -------
    Picture
        The frame, the indirect irradiance and the radiance.

    Raises
    ------
    InputError
        If scene, method or settings are not usable.
    """
    from refgi.frame import BUFFERS, Frame
    from refgi.scene import load_scene

    known = find_method(method)
    if settings is not None and not isinstance(settings, known.settings):
        raise InputError(f"settings: expected {known.settings.__name__}, got {type(settings).__name__}")
    settings = known.settings() if settings is None else settings
    if frame_options.get("shadows") is None:
        frame_options["shadows"] = usual_shadows(settings)
    frame = Frame(load_scene(scene) if isinstance(scene, str | Path) else scene, **frame_options)
    light = known.light(frame, settings)
    _warn_of_backs(frame)
    picture = Picture(frame, light.irradiance, frame.radiance(light.irradiance, light.lobes), light.estimate,
                      lobes=light.lobes, lobe_estimate=light.lobe_estimate, sampling_error=light.sampling_error,
                      lightcuts=light.lightcuts)
    if not left_out("frame.buffers", lambda: (len(frame.unused), len(BUFFERS))):
        for name in frame.unused:
            getattr(frame, name)
    return picture


def _warn_of_backs(frame: "Frame") -> None:
    one_sided = [material.one_sided for material in frame.scene.materials]
    if not any(one_sided) or not is_due("rsm.backs"):
        return
    from refgi.rsm.buffers.gbuffer import share_of_backs

    scene = frame.scene
    share = share_of_backs(scene.geometry, np.array(one_sided), scene.camera.eye, frame.gbuffer.triangle_id)
    if share > FEW_BACKS:
        text = f"{100 * share:.0f} % of what the picture shows are backs that the file leaves out (glTF's doubleSided)"
        warnings.warn(RefgiWarning(f"{scene.name}: {text}: drawn and lit as fronts"), stacklevel=3)

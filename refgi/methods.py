"""The table of methods. A new method is one package and one line here."""

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy.typing as npt

from refgi.errors import InputError

if TYPE_CHECKING:
    from refgi.frame import Frame, Shadows
    from refgi.scene import Scene

Array = npt.NDArray[Any]


class Method(NamedTuple):
    """A method by name; its code is imported when it is loaded."""

    name: str
    home: str  # module and function
    settings: str  # name of the settings class in the same module
    visibility: bool  # whether it knows what blocks indirect light
    summary: str
    ledger: str = ""  # module and function that accounts for the power of the lights; empty: the method keeps none
    estimate: str = ""  # module and function that gives the picture with its own error; empty: the method knows none
    memory: str = ""  # module and function that says what settings add to a picture's memory; empty: next to nothing

    def load(self) -> tuple[Callable[["Frame", Any], Array], type]:
        """Return the method's function and its settings class."""
        module, _, function = self.home.partition(":")
        loaded = import_module(module)
        return getattr(loaded, function), getattr(loaded, self.settings)

    def compute(self, frame: "Frame", settings: Any) -> tuple[Array, Any]:
        """Return the indirect irradiance in the frame's dtype, and the estimate it is the mean of, if it is one."""
        if not self.estimate:
            return self.load()[0](frame, settings), None
        module, _, function = self.estimate.partition(":")
        estimate = getattr(import_module(module), function)(frame, settings)
        return estimate.mean.astype(frame.dtype), estimate

    def extra_bytes(self, settings: Any, size: tuple[int, int], float_bytes: int) -> int:
        """Return what settings add to the memory of a picture of some width and height and floats of 4 or 8 bytes."""
        module, _, function = self.memory.partition(":")
        added: int = getattr(import_module(module), function)(settings, size, float_bytes) if module else 0
        return added


METHODS = {
    method.name: method
    for method in (
        Method("sii", "refgi.splat.sii:sii", "SiiSettings", False,
               "Splatting Indirect Illumination (2006): pixel lights shine where they are significant",
               "refgi.splat.sii.ledger:energy_ledger"),
        Method("multires", "refgi.splat.multires:multires", "MultiresSettings", False,
               "Adaptive Multiresolution Splatting (2009): the same lights, evaluated where the picture changes"),
        Method("val", "refgi.cluster.val:val", "ValSettings", True,
               "Clustered Visibility (2009): pixel lights share the soft shadows of virtual area lights",
               memory="refgi.cluster.val:extra_bytes"),
        Method("hssil", "refgi.sssil.hssil:hssil", "HssilSettings", False,
               "Hierarchical Screen-Space Indirect Illumination (2009): what the camera sees lights what it sees",
               memory="refgi.sssil.memory:extra_bytes"),
        Method("gather", "refgi.splat.gather:gather", "GatherSettings", False,
               "Reflective Shadow Maps (2005): gathering around the projected point"),
        Method("vpl", "refgi.truth.vpl:vpl", "VplSettings", True,
               "the same pixel lights with ray-traced visibility"),
        Method("truth", "refgi.truth.truth:truth", "TruthSettings", True,
               "one-bounce path tracing with a standard error for every pixel",
               estimate="refgi.truth.truth:trace_truth"),
    )
}


class Picture(NamedTuple):
    """What a method made of a scene."""

    frame: "Frame"
    irradiance: Array  # (3, h, w) indirect, W/m^2
    radiance: Array  # (3, h, w) what the camera receives, W/m^2/sr
    estimate: Any = None  # a `TruthResult`, of a method that states its own error


class KeepingEstimate:
    """A method as a function of frame and settings, which keeps the estimate of its last frame.

    Parameters
    ----------
    method : Method
        A row of `METHODS`.
    """

    def __init__(self, method: Method) -> None:
        self._method = method
        self.estimate: Any = None

    def __call__(self, frame: "Frame", settings: Any) -> Array:
        """Return the indirect irradiance, (3, h, w), W/m^2."""
        light, self.estimate = self._method.compute(frame, settings)
        return light


def find_method(name: str) -> Method:
    """Return a method of the table.

    Parameters
    ----------
    name : str
        Its short name.

    Returns
    -------
    Method
        The table's row.

    Raises
    ------
    InputError
        If there is none of that name.
    """
    if not isinstance(name, str) or name not in METHODS:
        raise InputError(f"method: expected one of {', '.join(METHODS)}, got {name!r}")
    return METHODS[name]


def usual_shadows(settings: Any) -> "Shadows":
    """Return where direct light's shadows come from unless it is said.

    Parameters
    ----------
    settings : object
        Those of a method; their `traces_rays`, false where there is none, says whether it traces rays.

    Returns
    -------
    {"map", "exact"}
        By rays where some are traced anyway, else from the map, so that no rays need be set up.
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
    from refgi.frame import Frame
    from refgi.scene import load_scene

    settings_class = find_method(method).load()[1]
    if settings is not None and not isinstance(settings, settings_class):
        raise InputError(f"settings: expected {settings_class.__name__}, got {type(settings).__name__}")
    settings = settings_class() if settings is None else settings
    if frame_options.get("shadows") is None:
        frame_options["shadows"] = usual_shadows(settings)
    frame = Frame(load_scene(scene) if isinstance(scene, str | Path) else scene, **frame_options)
    irradiance, estimate = METHODS[method].compute(frame, settings)
    return Picture(frame, irradiance, frame.radiance(irradiance), estimate)

"""Stand-ins for the paper's scenes, settings, references and counters that the figures share.

The paper always clamps r^2 and never says at what; its pictures show no bright dots. Here the least distance is
`CLAMP` of the scene's diagonal where a figure needs that look, and each such figure gives the figure without it too.
Pictures are of the run's size; counts and times are of twice that, 1024 x 1024 in a full run as in the paper.
"""

import dataclasses
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from benchmarks.papers.multires.scenes import BUILDERS
from benchmarks.papers.subjects import Subjects, seen_by
from refgi.frame import Frame
from refgi.lights.selection import choose_lights, footprints
from refgi.pairs.irradiance import Receivers, irradiance
from refgi.splat.multires import MultiresSettings, multires, shared_subsplats
from refgi.splat.refinement.grid import Subsplats

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench
    from refgi.scene import Scene

Array = npt.NDArray[Any]

TEAPOT, BUDDHA, DRAGON, BUNNIES = "simple", "carved", "serpent", "flock"  # of the module scenes
CLAMP = 0.04  # least distance, share of the diagonal
LARGE = 2  # where counts and times are taken

_SUBJECTS = Subjects(BUILDERS)
scene_of, frame_of = _SUBJECTS.scene_of, _SUBJECTS.frame_of


def settings_of(bench: "Workbench", scene: str, **changes: Any) -> MultiresSettings:
    """Return settings with a distance clamp that suits a scene's size.

    Parameters
    ----------
    bench : Workbench
        Holds the scene.
    scene : str
        Its name.
    **changes : object
        What differs from the paper's values.

    Returns
    -------
    MultiresSettings
        The settings.
    """
    clamp: dict[str, Any] = {"clamp": "distance", "clamp_value": CLAMP * scene_of(bench, scene).geometry.diagonal}
    return MultiresSettings(**(clamp | changes))


def unclamped(settings: MultiresSettings) -> MultiresSettings:
    """Return settings without a clamp.

    Parameters
    ----------
    settings : MultiresSettings
        Any.

    Returns
    -------
    MultiresSettings
        All else the same.
    """
    return dataclasses.replace(settings, clamp="none", clamp_value=0.0)


def drawing(bench: "Workbench", scene: "Scene", settings: MultiresSettings) -> Callable[[], Array]:
    """Return what draws a whole frame of twice the run's size: shadow map, buffers, direct and indirect light.

    Parameters
    ----------
    bench : Workbench
        Sizes.
    scene : Scene
        What is drawn.
    settings : MultiresSettings
        How.

    Returns
    -------
    callable
        Gives radiance; nothing is kept from one call to the next.
    """
    def draw() -> Array:
        frame = seen_by(bench, scene, LARGE)
        return frame.radiance(multires(frame, settings))

    return draw


def without_indirect(bench: "Workbench", scene: "Scene") -> Callable[[], Array]:
    """Return what draws a frame of twice the run's size and all that indirect light needs, but not that light.

    Parameters
    ----------
    bench : Workbench
        Sizes.
    scene : Scene
        What is drawn.

    Returns
    -------
    callable
        Gives radiance of direct light.
    """
    def draw() -> Array:
        frame = seen_by(bench, scene, LARGE)
        frame.gbuffer.resolve("depth", "position", "normal", "albedo")
        return frame.radiance() if frame.rsms else np.zeros(0)

    return draw


def subsplats_of(frame: Frame, settings: MultiresSettings) -> Subsplats:
    """Return the subsplats that all lights share.

    Parameters
    ----------
    frame : Frame
        The scene, seen.
    settings : MultiresSettings
        Criteria, thresholds and levels.

    Returns
    -------
    Subsplats
        The leaves.
    """
    return shared_subsplats(frame.gbuffer, settings)


def full_sum(frame: Frame, settings: MultiresSettings) -> Array:
    """Return the same lights summed at every pixel.

    Parameters
    ----------
    frame : Frame
        The scene, seen and lit.
    settings : MultiresSettings
        Which lights, and how each lights a receiver.

    Returns
    -------
    (3, h, w) ndarray
        Irradiance, W/m^2: what subsplats converge to.
    """
    receivers = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))
    return irradiance(receivers, choose_lights(frame, settings), settings, footprints(frame, settings))


def every_texel(frame: Frame, settings: MultiresSettings) -> Array:
    """Return the sum over every texel of the shadow maps.

    Parameters
    ----------
    frame : Frame
        The scene, seen and lit.
    settings : MultiresSettings
        Clamp and switches.

    Returns
    -------
    (3, h, w) ndarray
        Irradiance, W/m^2: what lights converge to as their number grows.
    """
    return full_sum(frame, dataclasses.replace(settings, pattern="all"))


def levels_of(frame: Frame, resolutions: tuple[int, ...]) -> dict[int, int]:
    """Return which level has which indirect resolution.

    Parameters
    ----------
    frame : Frame
        Says the picture's size.
    resolutions : tuple of int
        Cells along a side, as the paper's; those finer than the picture are left out.

    Returns
    -------
    dict of int to int
        `finest` by resolution.
    """
    size = max(frame.width, frame.height)
    return {n: (size // n).bit_length() - 1 for n in resolutions if n <= size}


def share_lit(subsplats: Subsplats, covered: Array) -> float:
    """Return how many subsplats there are for each pixel with a surface.

    Parameters
    ----------
    subsplats : Subsplats
        The leaves.
    covered : (h, w) ndarray of bool
        Pixels with a surface.

    Returns
    -------
    float
        1 where nothing is saved.
    """
    return len(subsplats.pixel) / max(1, int(np.count_nonzero(covered)))

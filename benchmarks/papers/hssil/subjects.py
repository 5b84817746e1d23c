"""Scenes, frames and settings that the figures share.

A full run has the paper's sizes: 1280 x 720 pixels where times are taken, 720 x 720 where Figure 5 judges. In a smaller
run the radius of these figures shrinks with the picture, so that as many levels reach the same share of it. What is
traced many times is smaller than that in every run: there levels are left out instead, and the radius stays about what
it is, so that a texel is as small beside its distance as in the paper.
"""

import dataclasses
import math
import warnings
from typing import TYPE_CHECKING, Any

import numpy.typing as npt

from benchmarks.papers.hssil.scenes import BUILDERS
from benchmarks.papers.subjects import Subjects
from refgi.errors import RefgiWarning
from refgi.frame import Frame
from refgi.sssil import HssilSettings
from refgi.sssil.hssil import hssil

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench

Array = npt.NDArray[Any]

HALL, SPOT, BASKET, HORSE, BOX = "hall", "spot", "basket", "horse", "box"
TITLES = {BOX: "Cornell Box", HORSE: "Cornell Horse", HALL: "hall", SPOT: "hall with a spot", BASKET: "basket"}
PAPER_HEIGHT, WIDE = 720, 16 / 9  # the paper's pictures are 1280 x 720
LARGE = PAPER_HEIGHT / 512  # pixels a side in units of a full run's
JUDGED = 1 / 2  # where pictures are traced, or every pixel lights every pixel
RADIUS, RADIUS_FIGURE_5 = 20.0, 40.0  # texels of the first level

_SUBJECTS = Subjects(BUILDERS)
scene_of, frame_of = _SUBJECTS.scene_of, _SUBJECTS.frame_of


def wide_frame(bench: "Workbench", name: str, factor: float = LARGE, **options: Any) -> Frame:
    """Return a frame of the paper's shape.

    Parameters
    ----------
    bench : Workbench
        Keeps the frame.
    name : str
        The scene.
    factor : float
        Height in units of the run's size: 1280 x 720 pixels in a full run where absent.
    **options : object
        Passed to `Frame`.

    Returns
    -------
    Frame
        Its buffers stay once they are computed.
    """
    return frame_of(bench, name, factor, wide=WIDE, **options)


def settings_of(frame: Frame, **changes: Any) -> HssilSettings:
    """Return the paper's settings with a radius that reaches as much of this picture as the paper's does of 1280 x 720.

    Parameters
    ----------
    frame : Frame
        Says how large the picture is.
    **changes : object
        What differs.

    Returns
    -------
    HssilSettings
        Half resolution, 4 levels of 64 samples where nothing else is said.
    """
    return HssilSettings(**({"radius": scaled_radius(frame, RADIUS)} | changes))


def smaller(frame: Frame, further: int = 0, **changes: Any) -> HssilSettings:
    """Return the paper's settings for a small picture: so many levels that about 20 texels reach as much of it.

    Parameters
    ----------
    frame : Frame
        Says how large the picture is.
    further : int
        How many levels more, or fewer.
    **changes : object
        What differs.

    Returns
    -------
    HssilSettings
        From half resolution, 64 samples, and a radius for the same reach as 20 texels and 4 levels of 1280 x 720.
    """
    share = math.hypot(frame.width, frame.height) / math.hypot(WIDE * PAPER_HEIGHT, PAPER_HEIGHT)
    levels = max(1, round(4 + math.log2(share)))
    radius = max(1.0, RADIUS * share * 2.0 ** (4 - levels))
    return HssilSettings(**({"radius": radius, "levels": max(1, levels + further)} | changes))


def scaled_radius(frame: Frame, radius: float, height: int = PAPER_HEIGHT) -> float:
    """Return a radius of the paper in texels of another picture.

    Parameters
    ----------
    frame : Frame
        The picture.
    radius : float
        In a picture of the paper, texels.
    height : int
        Rows of that picture.

    Returns
    -------
    float
        1 or more.
    """
    return max(1.0, radius * frame.height / height)


def every_texel(settings: HssilSettings, **changes: Any) -> HssilSettings:
    """Return settings that take each texel of disc and crowns once: the limit of many samples.

    Parameters
    ----------
    settings : HssilSettings
        Any.
    **changes : object
        What differs besides.

    Returns
    -------
    HssilSettings
        Without noise.
    """
    return dataclasses.replace(settings, **({"pattern": "all"} | changes))


def every_pixel(settings: HssilSettings, **changes: Any) -> HssilSettings:
    """Return settings by which every pixel lights every pixel.

    Parameters
    ----------
    settings : HssilSettings
        Any.
    **changes : object
        What differs besides.

    Returns
    -------
    HssilSettings
        One level of full resolution, whatever its cost.
    """
    return every_texel(settings, **({"start": "full", "levels": 1, "radius": None} | changes))


def lit(frame: Frame, settings: HssilSettings) -> Array:
    """Light a frame; that the paper's settings do not reach across the picture is known.

    Parameters
    ----------
    frame : Frame
        The scene, seen and lit.
    settings : HssilSettings
        How.

    Returns
    -------
    (3, h, w) ndarray
        Irradiance, W/m^2.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RefgiWarning)
        return hssil(frame, settings)


def ready(frame: Frame) -> Frame:
    """Compute what deferred shading has before indirect light starts.

    Parameters
    ----------
    frame : Frame
        The scene.

    Returns
    -------
    Frame
        The same, its buffers and direct light known.
    """
    frame.gbuffer.resolve("position", "depth", "normal", "albedo")
    assert frame.direct.shape == (3, frame.height, frame.width)
    return frame


def reach_of(frame: Frame, settings: HssilSettings) -> float:
    """Return how far samples reach, in units of the picture's diagonal.

    Parameters
    ----------
    frame : Frame
        Says how large the picture is.
    settings : HssilSettings
        Radius, start and levels.

    Returns
    -------
    float
        1 or more where every pixel can light every other one.
    """
    if settings.radius is None:
        return 1.0
    pixels = settings.radius * 2.0 ** (settings.levels + settings.first_level)
    return pixels / math.hypot(frame.width, frame.height)

"""A still picture after some frames of its temporal filter (Sec. 3.3), as the stills of a game are."""

import collections
import itertools
from collections.abc import Callable
from typing import Any

from refgi.frame import Frame
from refgi.scene.model import Scene
from refgi.sssil.settings import TemporalSettings
from refgi.sssil.temporal.sequence import Sequence, SequenceFrame


def still_frame(
    scene: Scene, settings: Any, temporal: TemporalSettings, frames: int, *, method: Callable[[Frame, Any], Any],
    lobes: Callable[[Frame, Any], Any] | None = None, **frame_options: Any,
) -> SequenceFrame:
    """Render a scene again and again, each frame with other random numbers, and return the last.

    Parameters
    ----------
    scene : Scene
        Camera, lights and objects rest.
    settings : object
        Those of the method in the first frame; its seed advances by 1 a frame.
    temporal : TemporalSettings
        The temporal filter.
    frames : int
        How many, at least 1.
    method : callable
        Function of a frame and settings that gives its indirect irradiance.
    lobes : callable, optional
        As for `Sequence`.
    **frame_options : object
        Passed to `Frame`: width, height, dtype, rsm_resolution, shadows.

    Returns
    -------
    SequenceFrame
        The last frame, filtered.
    """
    sequence = Sequence(itertools.repeat(scene, frames), settings, temporal, method=method, lobes=lobes,
                        **frame_options)
    return collections.deque(sequence, maxlen=1).pop()

"""Sequence of frames with temporal coherence (Sec. 3.3), each blended with the one before; stills of it."""

import collections
import itertools
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

from refgi.diagnostics import FrameSession
from refgi.errors import expect
from refgi.frame import Frame
from refgi.scene.model import Scene
from refgi.settings import LAST_SEED, flat, replaced
from refgi.sssil.hssil import hssil, hssil_lobes
from refgi.sssil.settings import HssilSettings, TemporalSettings
from refgi.sssil.temporal_filter import Filtered, History, first_light, history_of, temporal_filter, with_frames
from refgi.stages import Memory, reusing, sharing
from refgi.types import Array

__all__ = ["Sequence", "SequenceFrame", "TemporalSettings", "still_frame"]

Method = Callable[[Frame, Any], Array]
Lobes = Callable[[Frame, Any], Array | None]

DEFAULT = TemporalSettings()


class SequenceFrame(NamedTuple):
    """One frame of a sequence."""

    frame: Frame
    irradiance: Array  # (3, h, w) indirect, filtered, W/m^2
    radiance: Array  # (3, h, w) what the camera receives, W/m^2/sr
    reused: float  # share of the pixels with a surface that the frame before shows as well
    frames: Array | None = None  # (h, w) frames in which each pixel's surface was found, where the filter counts them
    lobes: Array | None = None  # (3, h, w) radiance of receivers' lobes by indirect light, of this frame, W/m^2/sr


class Sequence:
    """Render scenes one after the other; iterating gives a `Step` each.

    Parameters
    ----------
    scenes : iterable of Scene
        The frames: one scene with moving camera, lights or vertices. Taken one by one, so that a generator will do.
    settings : object, optional
        Those of the method; its seed advances by 1 a frame, so that noise differs from frame to frame.
    temporal : TemporalSettings, optional
        The temporal filter; None renders each frame by itself.
    method : callable, optional
        Function of a frame and settings that gives its indirect irradiance; `hssil` where absent.
    lobes : callable, optional
        Function of a frame and settings that gives the radiance of its glossy receivers' lobes, or None; that of
        `hssil` where method and lobes are absent. Lobes are not blended: a highlight moves with the eye.
    memory : stages.Memory, optional
        Keeps what frames share, beside the buffers of two frames in place of one; nothing is kept where absent.
    **frame_options : object
        Passed to `Frame`: width, height, dtype, rsm_resolution, shadows.

    Raises
    ------
    InputError
        While iterating, if a scene is not a `Scene`, or has other triangles than the one before.

    Notes
    -----
    Of earlier frames only the last one's `History` stays, but for what `memory` keeps: the G-buffer while camera and
    geometry rest, an RSM while its light does, and what a method makes of them.
    """

    def __init__(
        self, scenes: Iterable[Scene], settings: Any = None, temporal: TemporalSettings | None = DEFAULT, *,
        method: Method | None = None, lobes: Lobes | None = None, memory: Memory | None = None, **frame_options: Any,
    ) -> None:
        expect(temporal is None or isinstance(temporal, TemporalSettings), "temporal", "TemporalSettings or None",
               temporal)
        self.scenes = scenes
        self.settings = HssilSettings() if settings is None else settings
        self.temporal = temporal
        self.method = method or hssil
        self.lobes = hssil_lobes if method is None and lobes is None else lobes
        self.memory = memory
        self.frame_options = frame_options

    def __iter__(self) -> Iterator[SequenceFrame]:
        return self.over(self.scenes)

    def over(self, scenes: Iterable[Scene], first: int = 0, history: History | None = None) -> Iterator[SequenceFrame]:
        """Render scenes that follow on others.

        `first` is the number of the first of them, which counts for the seed; `history` what the frame before left.
        """
        session = FrameSession()
        for number, scene in enumerate(scenes, first):
            expect(isinstance(scene, Scene), f"scene of frame {number}", "a Scene", type(scene).__name__)
            with reusing(self.memory), session.frame(scene):
                step, history = self._step(scene, number, history)
            yield step
            del step  # whoever took it may let go of it before the next is made

    def _step(self, scene: Scene, number: int, history: History | None) -> tuple[SequenceFrame, History | None]:
        frame, settings = Frame(scene, **self.frame_options), seeded(self.settings, number)
        if self.lobes is None or not frame.glossy_receivers:
            irradiance, lobes = self.method(frame, settings), None
        else:
            with sharing():
                irradiance, lobes = self.method(frame, settings), self.lobes(frame, settings)
        if self.temporal is None:
            return SequenceFrame(frame, irradiance, frame.radiance(irradiance, lobes), 0.0, lobes=lobes), None
        if history is None:
            made = Filtered(first_light(irradiance, self.temporal), 0.0)
        else:
            made = temporal_filter(irradiance, frame, scene.geometry, history, self.temporal)
        left = with_frames(irradiance, made.frames) if self.temporal.form == "printed" else made.light
        filtered = made.irradiance
        return (SequenceFrame(frame, filtered, frame.radiance(filtered, lobes), made.reused, made.frames, lobes),
                history_of(frame, scene.geometry, left))


def seeded(settings: Any, number: int) -> Any:
    """Return settings with the random numbers of a frame, 0: as they are; the same object where none are drawn."""
    seeds = {key: seed for key, seed in flat(settings).items() if key.rpartition(".")[2] == "seed"}
    if number == 0 or not seeds:
        return settings
    return replaced(settings, {key: (seed + number) % (LAST_SEED + 1) for key, seed in seeds.items()})


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

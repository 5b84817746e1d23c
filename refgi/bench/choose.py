"""`choose`: the cheapest method and settings that meet a wish on a scene."""

import dataclasses
import math
import statistics
import warnings
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from refgi.bench.error import error_of, without_noise
from refgi.bench.grid import TRUTH, Choice
from refgi.bench.measure import REFERENCE_SEED, load_kernels, small_frame, stopped, timed, traced, with_seed
from refgi.bench.search import Found, for_error, for_time
from refgi.bench.tracks import Track
from refgi.errors import RefgiError, RefgiWarning, expect
from refgi.frame import Frame
from refgi.scene import Scene
from refgi.truth import TruthSettings

Tell = Callable[[str, float], None]

SMALL = 128  # pixels along the longer side of the small picture
SMALL_ROUNDS = 2
NOISE_SHARE = 0.3  # of the error wished for: the truth's standard error, which is taken out of every figure
NOISE_FOR_TIME = 0.02
TRUTH_SECONDS = 60.0  # for each of the two truths, unless it is said how they are traced


class Wish(NamedTuple):
    """What is wished for: one of the two."""

    error: float | None = None  # RMSE over the truth's mean
    seconds: float | None = None  # of a frame with its buffers

    def check(self) -> None:
        """Raise `InputError` unless one of the two is a number above 0."""
        asked = [value for value in self if value is not None]
        expect(len(asked) == 1, "wish", "an error or a time", "both" if asked else "neither")
        expect(0 < asked[0] < math.inf, "wish", "a number above 0", asked[0])

    @property
    def truth(self) -> TruthSettings:
        """How well the truth must be known."""
        noise = NOISE_FOR_TIME if self.error is None else NOISE_SHARE * self.error
        return TruthSettings(samples=2**31, seconds=TRUTH_SECONDS, target_error=noise)


class Chosen(NamedTuple):
    """What was found on a scene."""

    found: Found
    skips: tuple[tuple[str, str], ...]  # stages that the best leaves out on this scene, and why
    truth: str  # how well it is known
    doubt: str = ""  # why its error is not to be trusted: then nothing is known to meet a wish


def choose(
    scene: Scene, tracks: Sequence[Track], wish: Wish, *, rounds: int = 3, truth: TruthSettings | None = None,
    tell: Tell = lambda *_: None, **frame_options: Any,
) -> Chosen:
    """Find the cheapest choice of settings that meets a wish; each runs `rounds` times at full size, with a seed each.

    The wish decides on the truth's bounces where `truth` is absent. No best where the truth's error is not to be
    trusted. InputError if not one thing is wished for, a wish is not above 0 or the camera sees no surface.
    """
    wish.check()
    truth = dataclasses.replace(truth or wish.truth, seed=REFERENCE_SEED)
    tracks = [_of_truth(track, truth) if track.method == TRUTH else track for track in tracks]
    full = Pictures(scene, truth, rounds, tell, frame_options)
    smallest = small_frame(scene, frame_options)
    for number, track in enumerate(tracks):
        tell(f"loading {track.method}", number / len(tracks))
        load_kernels(smallest, track.rungs[0])
    small = Pictures(scene, truth, SMALL_ROUNDS, tell, {**frame_options, **_small_size(full.frame)})
    if wish.error is not None:
        found = for_error(tracks, wish.error, small, full)
    else:
        found = for_time(tracks, wish.seconds or 0.0, small, full)
    found = found._replace(best=None) if full.doubt else found
    return Chosen(found, full.skips(found.best.choice) if found.best else (), full.truth, full.doubt)


class Pictures:
    """A scene at one size: runs choices and judges them by a truth that is traced once.

    Each choice runs `rounds` times, with the seeds from `first_seed` on.
    """

    def __init__(self, scene: Scene, truth: TruthSettings, rounds: int, tell: Tell, frame_options: dict[str, Any],
                 first_seed: int = 0) -> None:
        self._scene, self._tell, self._options = scene, tell, frame_options
        self._seeds = range(first_seed, first_seed + rounds)
        self.frame = Frame(scene, **frame_options)
        expect(bool(self.frame.gbuffer.covered.any()), f"scene {scene.name!r}: camera", "a view of some surface",
               "a view past all of it")
        self._size = f"{self.frame.width}x{self.frame.height}"
        self._reference = traced(self.frame, truth, lambda what, done: tell(f"{self._size}: {what}", done))
        self.truth, self.doubt = self._reference.statement, self._reference.doubt
        self._known: dict[Choice, _Run] = {}

    def seconds(self, choice: Choice) -> float:
        """Return the median time of a frame with its buffers; infinite where it gives no picture."""
        return self._run(choice).seconds

    def error(self, choice: Choice) -> float:
        """Return the RMSE of all rounds without the truth's noise, over the truth's mean; infinite for no picture."""
        return self._run(choice).error

    def skips(self, choice: Choice) -> tuple[tuple[str, str], ...]:
        """Return the stages that a choice left out, and why."""
        return self._run(choice).skips

    def _run(self, choice: Choice) -> "_Run":
        if choice not in self._known:
            self._tell(f"{self._size}: {choice.method}, {choice.label}", 0.0)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RefgiWarning)  # of settings that nobody asked for
                try:
                    self._known[choice] = self._judged(choice)
                except RefgiError:
                    self._known[choice] = _Run(math.inf, math.inf, ())
        return self._known[choice]

    def _judged(self, choice: Choice) -> "_Run":
        runs = [timed(Frame(self._scene, **self._options), choice.method, with_seed(choice.settings, seed))
                for seed in self._seeds]
        known = error_of([one.picture for one in runs], self._reference.mean, self._reference.variance,
                         self.frame.gbuffer.covered)
        return _Run(statistics.median(one.seconds for one in runs), without_noise(known.rmse, known.noise),
                    runs[0].skips)


class _Run(NamedTuple):
    seconds: float
    error: float
    skips: tuple[tuple[str, str], ...]


def _of_truth(track: Track, truth: TruthSettings) -> Track:
    """Return the path tracer's track with the reference's bounces and emitters, stopped by its samples alone."""
    rungs = tuple(one._replace(settings=stopped(truth, value))
                  for one, value in zip(track.rungs, track.values, strict=True))
    return track._replace(rungs=rungs)


def _small_size(frame: Frame) -> dict[str, int]:
    factor = min(1.0, SMALL / max(frame.width, frame.height))
    return {"width": max(1, round(frame.width * factor)), "height": max(1, round(frame.height * factor))}

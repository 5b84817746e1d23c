"""`choose`: the cheapest method and settings that meet a wish on a scene, found without running all (docs/choose.md).

For an error, the walk goes up all tracks at once on a small picture, always to the probe that promises to be fastest.
A track is left where it would miss the wish even if its error went on falling as it did last: it falls ever slower.
One that waits is taken up where another of its method has missed the wish at the value it begins with.
Each find is judged at full size, the fastest first. For a time, each track is followed at full size up to that time.
"""

import dataclasses
import heapq
import math
import statistics
import warnings
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple, Protocol

from refgi.bench.error import error_of, without_noise
from refgi.bench.grid import TRUTH, Choice, Track
from refgi.bench.measure import REFERENCE_SEED, load_kernels, small_frame, stopped, timed, traced, with_seed
from refgi.errors import RefgiError, RefgiWarning, expect
from refgi.frame import Frame
from refgi.scene import Scene
from refgi.truth import TruthSettings
from refgi.types import Tell

STRIDE = 4  # rungs from probe to probe: a factor of 4
SLACK = 3.0  # a probe may take as many times as long as what meets the wish: small pictures tell times roughly
DOUBT = 0.85  # share of the error ahead that a track is left for: slopes are measured with noise
MARGIN = 0.95  # share of the wish to come to at full size: the truth's noise and the seeds leave as much open
TIME_MARGIN = 0.9  # share of the time wished for to come to, where something does: other work takes the rest
FURTHEST = 6  # rungs that a judged choice moves up at once
JUDGED = 4  # tracks that are judged for a time


class Probe(NamedTuple):
    """What a choice costs and by how much it is off."""

    choice: Choice
    seconds: float
    error: float  # RMSE without the truth's noise, over the truth's mean; infinite where there is no picture


class JudgedPictures(Protocol):
    """A scene at one size; each choice is run once, however often it is asked for."""

    def seconds(self, choice: Choice) -> float:
        """Return the time of a frame; infinite where it gives no picture."""

    def error(self, choice: Choice) -> float:
        """Return the error over the truth's mean; infinite where there is no picture."""


class Found(NamedTuple):
    """What a search came to."""

    best: Probe | None  # None where nothing meets the wish
    judged: tuple[Probe, ...]  # at full size, the fastest first
    small: tuple[Probe, ...]  # on the small picture, in the order of the search


def for_error(tracks: Sequence[Track], wish: float, small: JudgedPictures, full: JudgedPictures) -> Found:
    """Find the fastest choice whose error is at most a wish: `small` is searched, the best judged at `full` size."""
    walk = _Walk(tracks, wish, small)
    queue = [(full.seconds(track.rungs[rung]), number, rung)
             for number, (track, rung) in enumerate(walk.starts) if math.isfinite(full.seconds(track.rungs[rung]))]
    heapq.heapify(queue)
    judged: dict[Choice, Probe] = {}
    best: Probe | None = None
    while queue and (best is None or queue[0][0] < best.seconds):
        seconds, number, rung = heapq.heappop(queue)
        track = walk.starts[number][0]
        one = Probe(track.rungs[rung], seconds, full.error(track.rungs[rung]))
        judged[one.choice] = one
        if one.error <= wish * MARGIN:  # faster than the best so far: the queue ends before
            best = one
        following = walk.after(track, rung, one.error)
        if following is not None and track.rungs[following] not in judged:
            heapq.heappush(queue, (full.seconds(track.rungs[following]), number, following))
    found = Found(best, _by_time(judged.values()), tuple(walk.probes.values()))
    left = [track for track in tracks if all(track is not tried for tried, _ in walk.starts)]
    if best is not None or not left or not walk.starts:
        return found
    others = for_error(left, wish, small, full)  # what the small picture promised was not kept
    return Found(others.best, _by_time((*found.judged, *others.judged)), (*found.small, *others.small))


def for_time(tracks: Sequence[Track], wish: float, small: JudgedPictures, full: JudgedPictures) -> Found:
    """Find the choice of least error whose frame takes at most a wish, s; `small` is ranked, `full` judges."""
    reached = _reached(tracks, TIME_MARGIN * wish, full) or _reached(tracks, wish, full)
    ranked = sorted((Probe(choice, small.seconds(choice), small.error(choice)) for choice in reached),
                    key=lambda one: one.error)
    judged = [Probe(one.choice, full.seconds(one.choice), full.error(one.choice)) for one in ranked[:JUDGED]]
    best = min((one for one in judged if math.isfinite(one.error)), key=lambda one: one.error, default=None)
    return Found(best, _by_time(judged), tuple(ranked))


class _Walk:
    """The walk for an error: `starts` are tracks with the first rung of each that meets the wish, fastest first."""

    def __init__(self, tracks: Sequence[Track], wish: float, small: JudgedPictures) -> None:
        self._wish, self._small = wish, small
        self.probes: dict[Choice, Probe] = {}
        self.starts: list[tuple[Track, int]] = []
        fastest = math.inf
        leading = {track.method for track in tracks if not track.waits}
        waiting = [number for number, track in enumerate(tracks) if track.waits and track.method in leading]
        queue = [(0.0, number, 0) for number in range(len(tracks)) if number not in waiting]
        while queue and queue[0][0] <= SLACK * fastest:
            _, number, rung = heapq.heappop(queue)
            track = tracks[number]
            if self._probe(track, rung).error <= wish:
                first = self._first_that_meets(track, max(-1, rung - STRIDE), rung)
                fastest = min(fastest, self._probe(track, first).seconds)
                self.starts.append((track, first))
                continue
            for other in [one for one in waiting if _comes_to(track, rung, tracks[one])]:
                waiting.remove(other)
                heapq.heappush(queue, (self._probe(track, rung).seconds, other, 0))
            if rung < len(track.rungs) - 1 and self._may_meet(track, rung):
                following = min(rung + STRIDE, len(track.rungs) - 1)
                heapq.heappush(queue, (self._seconds_at(track, rung, following), number, following))

    def after(self, track: Track, rung: int, error: float) -> int | None:
        """Return the rung to judge after one with an error at full size: down where it meets the wish, else up."""
        if error <= self._wish * MARGIN:
            return rung - 1 if rung else None
        if rung == len(track.rungs) - 1 or not math.isfinite(error):
            return None
        slope = min(-0.1, self._slope(track, rung))
        factor = (error / (self._wish * MARGIN)) ** (-1 / slope) if error < 1e3 * self._wish else math.inf
        up = next((more for more in range(1, FURTHEST) if track.values[min(rung + more, len(track.values) - 1)]
                   >= factor * track.values[rung]), FURTHEST)
        return min(rung + up, len(track.rungs) - 1)

    def _probe(self, track: Track, rung: int) -> Probe:
        choice = track.rungs[rung]
        if choice not in self.probes:
            self.probes[choice] = Probe(choice, self._small.seconds(choice), self._small.error(choice))
        return self.probes[choice]

    def _first_that_meets(self, track: Track, misses: int, meets: int) -> int:
        while meets - misses > 1:
            middle = (misses + meets) // 2
            if self._probe(track, middle).error <= self._wish:
                meets = middle
            else:
                misses = middle
        return meets

    def _may_meet(self, track: Track, rung: int) -> bool:
        """Return whether a track whose error goes on falling as it did last comes to the wish at its end.

        Its first two errors may be alike by chance.
        """
        if rung <= STRIDE:
            return True
        ahead = math.log(track.values[-1] / track.values[rung])
        return DOUBT * self._probe(track, rung).error * math.exp(self._slope(track, rung) * ahead) <= self._wish

    def _seconds_at(self, track: Track, rung: int, following: int) -> float:
        """Return the time of the next probe: what was added since the last one grows in proportion."""
        known = self._known(track, rung)
        seconds = known[-1][1].seconds
        added = seconds - known[-2][1].seconds if len(known) > 1 else 0.0
        return seconds + max(0.0, added) * track.values[following] / track.values[rung]

    def _slope(self, track: Track, rung: int) -> float:
        """Return d log error / d log value of the last two probes up to a rung, 0 at most."""
        known = [(value, one.error) for value, one in self._known(track, rung) if 0 < one.error < math.inf]
        if len(known) < 2:
            return 0.0
        (x, a), (y, b) = known[-2:]
        return min(0.0, math.log(b / a) / math.log(y / x))

    def _known(self, track: Track, rung: int) -> list[tuple[int, Probe]]:
        return [(track.values[at], self.probes[choice]) for at, choice in enumerate(track.rungs[:rung + 1])
                if choice in self.probes]


def _comes_to(track: Track, rung: int, other: Track) -> bool:
    """Return whether a track is at the first value of another of its method, or beyond."""
    return track.method == other.method and track.values[rung] >= other.values[0]


def _reached(tracks: Sequence[Track], wish: float, full: JudgedPictures) -> list[Choice]:
    """Return where tracks come to within a time."""
    ends = [(track, _slowest_within(track, wish, full)) for track in tracks if not track.waits]
    ends += [(other, _slowest_within(other, wish, full)) for other in tracks if other.waits
             and any(rung is not None and _comes_to(track, rung, other) for track, rung in ends)]
    return [track.rungs[rung] for track, rung in ends if rung is not None]


def _slowest_within(track: Track, wish: float, full: JudgedPictures) -> int | None:
    """Return the last rung of a track whose frame takes no longer than a wish; None where the first does."""
    within, beyond = -1, len(track.rungs)
    rung = 0
    while rung < beyond and full.seconds(track.rungs[rung]) <= wish:
        within = rung
        rung = rung + STRIDE if rung + STRIDE < beyond or rung == beyond - 1 else beyond - 1
    beyond = min(rung, beyond)
    while beyond - within > 1:
        middle = (within + beyond) // 2
        if full.seconds(track.rungs[middle]) <= wish:
            within = middle
        else:
            beyond = middle
    return None if within < 0 else within


def _by_time(probes: Iterable[Probe]) -> tuple[Probe, ...]:
    return tuple(sorted(probes, key=lambda one: one.seconds))


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
        load_kernels(smallest, track.rungs[0], full.frame.width * full.frame.height)
    small = Pictures(scene, truth, SMALL_ROUNDS, tell, {**frame_options, **_small_size(full.frame)})
    if wish.error is not None:
        found = for_error(tracks, wish.error, small, full)
    else:
        found = for_time(tracks, wish.seconds or 0.0, small, full)
    found = found._replace(best=None) if full.doubt else found
    return Chosen(found, full.skips(found.best.choice) if found.best else (), full.truth, full.doubt)


class Pictures:
    """A scene at one size: runs each choice with several seeds, and judges it by a truth that is traced once."""

    def __init__(self, scene: Scene, truth: TruthSettings, rounds: int, tell: Tell, frame_options: dict[str, Any],
                 first_seed: int = 0) -> None:
        self._scene, self._tell, self._options = scene, tell, frame_options
        self._seeds = range(first_seed, first_seed + rounds)
        self.frame = Frame(scene, **frame_options)
        expect(bool(self.frame.gbuffer.covered.any()), f"scene {scene.name!r}: camera", "a view of some surface",
               "a view past all of it")
        self._size = f"{self.frame.width}x{self.frame.height}"
        self._reference = traced(self.frame, truth, lambda what, done: tell(f"{self._size}: {what}", done))
        self.truth, self.doubt = self._reference.statement, self._reference.whole_doubt
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
        known = error_of([one.picture for one in runs], self._reference.irradiance, self._reference.variance,
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

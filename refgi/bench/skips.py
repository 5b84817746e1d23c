"""What each skip saves on a scene, measured, with the proof that it changes no bit of the picture.

A method renders the scene with all skips on, which counts what each has to leave out, and with each of these off, which
compares bits and loads kernels. Then come rounds: a picture with all on before each one without, so that a slow moment
of the machine falls on both. Beside that stand things that could be left out at the cost of a difference, with the
setting to type, and skips that have no switch, with the reason.
"""

import hashlib
import statistics
import time
import warnings
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import pydantic

from refgi import skips
from refgi.bench.trades import DimLights, Trade, changes_of, difference, dim_lights
from refgi.errors import RefgiWarning, expect
from refgi.methods import Picture, find_method, render
from refgi.scene import Scene
from refgi.settings import Settings

Tell = Callable[[str, float], None]
Clock = Callable[[], float]  # s
Times = tuple[tuple[float, ...], tuple[float, ...]]  # s, a round each: of the plain picture, and of one right after


class Kernel(NamedTuple):
    """A skip inside of a kernel, without a switch."""

    methods: frozenset[str]
    meaning: str
    reason: str


SPLATTING = frozenset({"sii", "multires", "val"})
UNMEASURED = (
    Kernel(SPLATTING, "lights without diffuse flux, or without lobe beside others that have one",
           "float32 sums close after every 64 lights: dark ones among them would move where"),
    Kernel(SPLATTING | {"gather", "vpl"}, "five of six faces of a spot light's map",
           "a cube's texels lie elsewhere: other pixel lights, other bits"),
    Kernel(frozenset({"val"}), "visibility at the receivers of a tile that get no light",
           "those with light move together inside of the kernel that also lights them"),
    Kernel(frozenset({"val"}), "triangles wholly behind a map's hemisphere", "inside of the rasterizer"),
    Kernel(frozenset({"val"}), "the basis of a map's texels where it is empty",
           "they are all alike, and copied inside of the kernel that filters the others"),
    Kernel(frozenset({"multires"}), "cells of subsplats without surface", "the list of leaves is made without them"),
    Kernel(frozenset({"hssil"}), "samples that are dark for a whole strip of a level",
           "the others are summed in twos: dark ones among them would move which"),
    Kernel(frozenset({"truth"}), "shadow rays of samples that give no light",
           "the kernel that draws samples sorts them out"),
    Kernel(frozenset({"truth", "vpl"}), "pixels without surface", "rays start on triangles, which these have not"),
)


class _Strict(pydantic.BaseModel):
    model_config = pydantic.ConfigDict(extra="forbid", frozen=True)


class MeasuredSkip(_Strict):
    """One skip that has something to leave out."""

    name: str
    meaning: str
    unit: str
    left_out: int
    of: int
    times: tuple[float, ...]  # s of a whole frame with all skips on, a round each
    times_without: tuple[float, ...]  # with this one off, right after
    same_bits: bool

    @property
    def saved(self) -> tuple[float, ...]:
        """What the skip saves in each round, s; below 0 where it costs more than it brings."""
        return tuple(off - on for on, off in zip(self.times, self.times_without, strict=True))

    @property
    def saves(self) -> float:
        """Median of what it saves, s."""
        return statistics.median(self.saved)


class Unmeasured(_Strict):
    """A skip without a switch."""

    meaning: str
    reason: str


class SkipReport(_Strict):
    """All skips of a method on a scene."""

    scene: str
    method: str
    width: int
    height: int
    times: tuple[float, ...]  # s of every whole frame with all skips on
    skips: tuple[MeasuredSkip, ...]
    trades: tuple[Trade, ...]
    dim_lights: DimLights | None  # None: the method sums no pixel lights, or none can be left out
    unmeasured: tuple[Unmeasured, ...]

    @property
    def same_bits(self) -> bool:
        """Whether no skip changes the picture."""
        return all(skip.same_bits for skip in self.skips)


def measure_skips(
    scene: Scene, method: str, settings: Settings | None = None, *, rounds: int = 3,
    clock: Clock = time.perf_counter, tell: Tell = lambda *_: None, **frame_options: Any,
) -> SkipReport:
    """Measure what each skip saves on a scene, and whether the picture has the same bits without it.

    The scene's camera has the size of the picture; the method's default settings where absent. `clock` in s:
    `time.process_time` is that of processors alone, for machines that do other work as well. Skips that have nothing to
    leave out are not in the report. InputError if scene, method or settings are not usable, or there is no round.
    """
    expect(rounds >= 1, "rounds", "1 or more", rounds)
    chosen = find_method(method).settings() if settings is None else settings
    plain = _Job(scene, method, chosen, frame_options)
    with skips.count_skips() as counts:
        first = plain.run()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RefgiWarning)  # said by the first picture
        lights = dim_lights(first.frame, chosen, rounds, clock=clock)
        names = [name for name in skips.SKIPS if name in counts and counts[name].left_out]
        changes = changes_of(method, chosen, lights)
        jobs = [*(plain._replace(off=(name,)) for name in names),
                *(plain._replace(settings=change.settings) for change in changes)]
        comparisons = _compared(jobs, first, tell)
        times = _in_turn(plain, jobs, rounds, clock, tell)
    results = list(zip(times, comparisons, strict=True))
    return SkipReport(
        scene=scene.name, method=method, width=first.frame.width, height=first.frame.height,
        times=tuple(seconds for on, _ in times for seconds in on),
        skips=tuple(_measured(name, counts[name], *result) for name, result in zip(names, results, strict=False)),
        trades=tuple(Trade(meaning=change.meaning, changes=change.changes, times=on, times_changed=changed,
                           difference=one.difference)
                     for change, ((on, changed), one) in zip(changes, results[len(names) :], strict=True)),
        dim_lights=lights,
        unmeasured=tuple(Unmeasured(meaning=one.meaning, reason=one.reason) for one in UNMEASURED
                         if method in one.methods))


class _Job(NamedTuple):
    """A picture to render."""

    scene: Scene
    method: str
    settings: Settings
    options: dict[str, Any]
    off: tuple[str, ...] = ()  # skips

    def run(self) -> Picture:
        with skips.without_skip(*self.off):
            return render(self.scene, self.method, self.settings, **self.options)


class _Comparison(NamedTuple):
    """A picture beside the plain one."""

    same_bits: bool
    difference: float | None


def _compared(jobs: Sequence[_Job], plain: Picture, tell: Tell) -> list[_Comparison]:
    bits, made = _hash(plain), []
    for number, job in enumerate(jobs):
        tell("comparing bits", number / len(jobs))
        picture = job.run()
        made.append(_Comparison(_hash(picture) == bits, difference(picture, plain)))
    return made


def _in_turn(plain: _Job, jobs: Sequence[_Job], rounds: int, clock: Clock, tell: Tell) -> list[Times]:
    """Return for each job the times of the plain picture right before it, and its own."""
    times: list[tuple[list[float], list[float]]] = [([], []) for _ in jobs]
    for turn in range(rounds):
        for number, job in enumerate(jobs):
            tell("timing", (turn + number / len(jobs)) / rounds)
            for one, took in zip((plain, job), times[number], strict=True):
                started = clock()
                one.run()
                took.append(clock() - started)
    return [(tuple(before), tuple(own)) for before, own in times]


def _measured(name: str, count: skips.Count, times: Times, one: _Comparison) -> MeasuredSkip:
    return MeasuredSkip(name=name, **skips.SKIPS[name]._asdict(), **count._asdict(), times=times[0],
                        times_without=times[1], same_bits=one.same_bits)


def _hash(picture: Picture) -> bytes:
    digest = hashlib.sha256()
    for plane in (picture.irradiance, picture.radiance):
        digest.update(np.ascontiguousarray(plane).tobytes())
    return digest.digest()

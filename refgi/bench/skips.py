"""What each skip saves on a scene, measured, with the proof that it changes no bit of the picture.

Rounds have a picture with all skips on before each one without, so that a slow moment of the machine falls on both.
Beside that stand things that could be left out at the cost of a difference, with the setting to type, lights too dim to
matter, which no setting leaves out, and skips that have no switch, with the reason.
"""

import statistics
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from refgi import skips
from refgi.bench.results import Strict
from refgi.errors import InputError, RefgiWarning, expect
from refgi.frame import Frame
from refgi.lights.selection import choose_lights, footprints
from refgi.lights.settings import LightSettings
from refgi.methods import Picture, find_method, render
from refgi.pairs.estimates import light_at, sample_for
from refgi.pairs.irradiance import Receivers, irradiance
from refgi.pairs.pixel_lights import PixelLights
from refgi.pairs.settings import PairSettings
from refgi.scene import Scene
from refgi.settings import Settings, from_text
from refgi.types import Array, Tell

Clock = Callable[[], float]  # s
Times = tuple[tuple[float, ...], tuple[float, ...]]  # s, a round each: of the plain picture, and of one right after

SHARE = 0.999  # of the light without visibility, that the lights carry that are kept
MOST = 8192  # lights that are summed one by one


class DimLights(Strict):
    """Lights that carry nearly all of a picture's light without visibility."""

    lights: int
    carrying: int  # the fewest that carry `share`
    count: int  # `lights.count` that draws about as many
    share: float
    times: tuple[float, ...]  # s of the sum over all lights at all pixels, a round each
    times_carrying: tuple[float, ...]  # over those alone
    error: float  # RMSE without the others, over the mean


def dim_lights(
    frame: Frame, settings: Settings, rounds: int, *, share: float = SHARE, clock: Clock = time.perf_counter
) -> DimLights | None:
    """Measure what leaving out the dimmest lights saves and costs, `share` of the light kept; None without any."""
    chosen = getattr(settings, "lights", None)
    pairs = getattr(settings, "effective_pairs", None)
    if not isinstance(chosen, LightSettings) or pairs is None:
        return None
    lights = choose_lights(frame, chosen)
    footprint = footprints(frame, chosen, pairs)
    receivers = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))
    if lights.flux.shape[1] > MOST:
        return None
    parts = parts_of_lights(receivers, lights, pairs, footprint)
    kept = brightest(parts, share)
    if not len(kept):
        return None
    some = (receivers, lights.selected(kept), pairs, None if footprint is None else footprint[kept])
    every = (receivers, lights, pairs, footprint)
    right, without = irradiance(*every), irradiance(*some)
    ((times, times_carrying),) = in_turn(lambda: irradiance(*every), [lambda: irradiance(*some)], rounds, clock)
    difference = (without - right)[:, receivers.covered].astype(np.float64)
    mean = float(right[:, receivers.covered].mean(dtype=np.float64))
    return DimLights(lights=len(parts), carrying=len(kept), count=max(1, round(chosen.count * len(kept) / len(parts))),
                     share=share, times=times, times_carrying=times_carrying,
                     error=float(np.sqrt((difference**2).mean())) / mean)


def parts_of_lights(
    receivers: Receivers, lights: PixelLights, pairs: PairSettings, footprint: Array | None = None
) -> Array:
    """Return the irradiance, W/m^2, that each of N lights adds to the mean over sampled pixels, unoccluded, (N,)."""
    sample = sample_for(receivers, lights)
    return np.array([light_at(sample, lights.selected([k]), pairs, None if footprint is None else footprint[[k]])
                     for k in range(lights.flux.shape[1])])


def brightest(parts: Array, share: float) -> Array:
    """Return the fewest lights (n,) that carry a share of the sum of all parts (N,), rising; none where that is 0."""
    order = np.argsort(-parts, kind="stable")
    sums = np.cumsum(parts[order])
    if not len(sums) or sums[-1] <= 0:
        return order[:0]
    return np.sort(order[: int(np.searchsorted(sums, share * sums[-1])) + 1])


# by method: what is left out, or put back, and how settings change
TRADES: dict[str, tuple[tuple[str, tuple[str, ...]], ...]] = {
    "sii": (("pairs below 1 % of the brightest light's irradiance", ("reach.cut=relative", "reach.cut.share=0.01")),
            ("three of four pixels where neighbours resemble each other", ("half_resolution=true",))),
    "multires": (("subsplats that a target of 1 % does not ask for", ("subsplats=error", "subsplats.target=0.01")),),
    "val": (("subsplats that a target of 10 % does not ask for", ("interleaving.block=none", "subsplats.target=0.1")),
            ("63 of 64 lights at each pixel", ("interleaving.block=8",)),
            ("nothing: walls that nothing lies behind are drawn into maps too", ("maps.occluders_alone=false",))),
}


class Trade(Strict):
    """A change of settings, measured."""

    meaning: str
    changes: tuple[str, ...]  # "key=value", as --set takes them
    times: tuple[float, ...]  # s of a whole frame as the settings are, a round each
    times_changed: tuple[float, ...]  # as changed, right after
    difference: float | None  # RMSE to the picture as the settings are, over its mean; None where that is black


class Change(NamedTuple):
    """A change of settings."""

    meaning: str
    changes: tuple[str, ...]
    settings: Settings


def changes_of(method: str, settings: Settings, lights: DimLights | None) -> list[Change]:
    """Return what a method could leave out and does not yet: fewer lights, and those of `TRADES` that go."""
    fewer = () if lights is None else (
        (f"lights: as many as carry {lights.share:.1%}, drawn anew", (f"lights.count={lights.count}",)),)
    made = []
    for meaning, changes in (*fewer, *TRADES.get(method, ())):
        try:
            changed = from_text(settings, changes)
        except InputError:  # does not go with the other settings
            continue
        if changed != settings:
            made.append(Change(meaning, changes, changed))
    return made


def difference(picture: Picture, plain: Picture) -> float | None:
    """Return the RMSE between two pictures' irradiance over the second's mean; None where that is black."""
    covered = plain.frame.gbuffer.covered
    made, right = (one.irradiance[:, covered].astype(np.float64) for one in (picture, plain))
    mean = float(right.mean()) if right.size else 0.0
    return float(np.sqrt(((made - right) ** 2).mean())) / mean if mean > 0 else None


class Unmeasured(Strict):
    """A skip without a switch."""

    meaning: str
    reason: str


SPLATTING = {"sii", "multires", "val"}
# skips inside of kernels: of which methods, what they leave out, and why there is no switch
UNMEASURED: tuple[tuple[frozenset[str], Unmeasured], ...] = tuple(
    (frozenset(methods), Unmeasured(meaning=meaning, reason=reason)) for methods, meaning, reason in (
        (SPLATTING, "lights without diffuse flux, or without lobe beside others that have one",
         "float32 sums close after every 64 lights: dark ones among them would move where"),
        (SPLATTING | {"gather", "vpl"}, "five of six faces of a spot light's map",
         "a cube's texels lie elsewhere: other pixel lights, other bits"),
        ({"val"}, "visibility at the receivers of a tile that get no light",
         "those with light move together inside of the kernel that also lights them"),
        ({"val"}, "triangles wholly behind a map's hemisphere", "inside of the rasterizer"),
        ({"val"}, "the basis of a map's texels where it is empty",
         "they are all alike, and copied inside of the kernel that filters the others"),
        ({"multires"}, "cells of subsplats without surface", "the list of leaves is made without them"),
        ({"hssil"}, "samples that are dark for a whole strip of a level",
         "the others are summed in twos: dark ones among them would move which"),
        ({"truth"}, "shadow rays of samples that give no light", "the kernel that draws samples sorts them out"),
        ({"truth", "vpl"}, "pixels without surface", "rays start on triangles, which these have not")))


class MeasuredSkip(Strict):
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


class SkipReport(Strict):
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
    """Measure what each skip saves on a scene at its camera's size, and whether the picture has the same bits without.

    `clock`: `time.process_time` is that of processors alone, for machines that do other work as well. Skips that have
    nothing to leave out are not in the report. InputError if something is not usable, or there is no round.
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
        comparisons = list(_compared(jobs, first, tell))
        times = in_turn(plain.run, [job.run for job in jobs], rounds, clock, tell)
    results = list(zip(times, comparisons, strict=True))
    return SkipReport(
        scene=scene.name, method=method, width=first.frame.width, height=first.frame.height,
        times=tuple(seconds for on, _ in times for seconds in on),
        skips=tuple(MeasuredSkip(name=name, **skips.SKIPS[name]._asdict(), **counts[name]._asdict(), times=on,
                                 times_without=off, same_bits=same)
                    for name, ((on, off), (same, _)) in zip(names, results, strict=False)),
        trades=tuple(Trade(meaning=change.meaning, changes=change.changes, times=on, times_changed=changed,
                           difference=off)
                     for change, ((on, changed), (_, off)) in zip(changes, results[len(names) :], strict=True)),
        dim_lights=lights,
        unmeasured=tuple(one for methods, one in UNMEASURED if method in methods))


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


def _compared(jobs: Sequence[_Job], plain: Picture, tell: Tell) -> Iterator[tuple[bool, float | None]]:
    """Yield for each job whether its picture has the bits of the plain one, and by how much it is off."""
    for number, job in enumerate(jobs):
        tell("comparing bits", number / len(jobs))
        picture = job.run()
        same = picture.irradiance.tobytes() == plain.irradiance.tobytes() and (
            picture.radiance.tobytes() == plain.radiance.tobytes())
        yield same, difference(picture, plain)


def in_turn(plain: Callable[[], object], others: Sequence[Callable[[], object]], rounds: int, clock: Clock,
            tell: Tell = lambda *_: None) -> list[Times]:
    """Return for each of some calls the times of the plain one right before it, and its own; a round each."""
    times: list[tuple[list[float], list[float]]] = [([], []) for _ in others]
    for turn in range(rounds):
        for number, other in enumerate(others):
            tell("timing", (turn + number / len(others)) / rounds)
            for one, took in zip((plain, other), times[number], strict=True):
                started = clock()
                one()
                took.append(clock() - started)
    return [(tuple(before), tuple(own)) for before, own in times]

"""What each skip saves on a scene, measured, with the proof that it changes no bit of the picture.

A method renders the scene with all skips on, which counts what each has to leave out; then, in rounds, with all on and
with each of these off in turn, so that a slow moment of the machine falls on all. Beside that stand things that could
be left out at the cost of an error, with the setting to type, and skips that have no switch, with the reason.
"""

import hashlib
import statistics
import time
import warnings
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pydantic

from refgi import skips
from refgi.bench.dim_lights import DimLights, dim_lights
from refgi.errors import InputError, RefgiWarning, expect
from refgi.methods import Picture, find_method, render
from refgi.scene import Scene
from refgi.settings import Settings, from_text

__all__ = ["MeasuredSkip", "SkipReport", "Trade", "Unmeasured", "measure_skips"]

Array = npt.NDArray[Any]
Tell = Callable[[str, float], None]


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
    Kernel(frozenset({"multires"}), "cells of subsplats without surface", "the list of leaves is made without them"),
    Kernel(frozenset({"hssil"}), "samples that are dark for a whole strip of a level",
           "the others are summed in twos: dark ones among them would move which"),
    Kernel(frozenset({"truth"}), "shadow rays of samples that give no light",
           "the kernel that draws samples sorts them out"),
    Kernel(frozenset({"truth", "vpl"}), "pixels without surface", "rays start on triangles, which these have not"),
)
# what may be left out at the cost of an error: meaning and changes to the settings
TRADES: dict[str, tuple[tuple[str, tuple[str, ...]], ...]] = {
    "sii": (("pairs below 1 % of the brightest light's irradiance", ("reach.cut=relative", "reach.cut.share=0.01")),
            ("three of four pixels where neighbours resemble each other", ("half_resolution=true",))),
    "multires": (("subsplats that a target of 1 % does not ask for", ("subsplats=error", "subsplats.target=0.01")),),
    "val": (("walls that nothing lies behind: drawn into maps after all", ("maps.occluders_alone=false",)),
            ("63 of 64 lights at each pixel", ("interleaving.block=8",))),
}


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
    times_without: tuple[float, ...]  # with this one off, in the same rounds
    same_bits: bool

    @property
    def saves(self) -> float:
        """Median over rounds of what the skip saves, s; below 0 where it costs more than it brings."""
        return statistics.median(off - on for on, off in zip(self.times, self.times_without, strict=True))


class Trade(_Strict):
    """What a change of settings leaves out, or puts back, at the cost of a difference."""

    meaning: str
    changes: tuple[str, ...]  # "key=value", as --set takes them
    times: tuple[float, ...]  # s of a whole frame as the settings are, a round each
    times_changed: tuple[float, ...]
    difference: float | None  # RMSE to the picture as the settings are, over its mean; None where that is black


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
    times: tuple[float, ...]  # s of a whole frame with all skips on, a round each
    skips: tuple[MeasuredSkip, ...]
    trades: tuple[Trade, ...]
    dim_lights: DimLights | None  # None: the method sums no pixel lights
    unmeasured: tuple[Unmeasured, ...]

    @property
    def same_bits(self) -> bool:
        """Whether no skip changes the picture."""
        return all(skip.same_bits for skip in self.skips)


def measure_skips(
    scene: Scene, method: str, settings: Settings | None = None, *, rounds: int = 3, tell: Tell = lambda *_: None,
    **frame_options: Any,
) -> SkipReport:
    """Measure what each skip saves on a scene, and whether the picture has the same bits without it.

    Parameters
    ----------
    scene : Scene
        The scene, its camera's size that of the picture.
    method : str
        Short name of the method.
    settings : Settings, optional
        The method's; its defaults where absent.
    rounds : int
        How often each is timed.
    tell : callable
        Called with (what runs, share done).
    **frame_options : object
        Passed to `render`: width, height, dtype, rsm_resolution, shadows.

    Returns
    -------
    SkipReport
        Skips that have nothing to leave out are not in it.

    Raises
    ------
    InputError
        If scene, method or settings are not usable, or there is no round.
    """
    expect(rounds >= 1, "rounds", "1 or more", rounds)
    chosen = find_method(method).settings() if settings is None else settings
    with skips.count_skips() as counts:
        first = render(scene, method, chosen, **frame_options)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RefgiWarning)  # said by the first picture
        found = {name: count for name, count in counts.items() if count.left_out > 0}
        jobs = [_Job(scene, method, chosen, frame_options, (name,)) for name in skips.SKIPS if name in found]
        lights = dim_lights(first.frame, chosen, rounds)
        trades = _trades(method, chosen, lights)
        jobs += [_Job(scene, method, changed, frame_options, ()) for _, _, changed in trades]
        pictures = [_shown(job, number / len(jobs), tell) for number, job in enumerate(jobs)]
        on, off = _in_turn(_Job(scene, method, chosen, frame_options, ()), jobs, rounds, tell)
    of = len(found)
    return SkipReport(
        scene=scene.name, method=method, width=first.frame.width, height=first.frame.height, times=on,
        skips=tuple(_measured(name, found[name], on, times, _hash(picture) == _hash(first))
                    for name, times, picture in zip((job.off[0] for job in jobs[:of]), off, pictures, strict=False)),
        trades=tuple(Trade(meaning=meaning, changes=changes, times=on, times_changed=times,
                           difference=_difference(picture, first))
                     for (meaning, changes, _), times, picture in zip(trades, off[of:], pictures[of:], strict=True)),
        dim_lights=lights,
        unmeasured=tuple(Unmeasured(meaning=one.meaning, reason=one.reason) for one in UNMEASURED
                         if method in one.methods))


class _Job(NamedTuple):
    """A picture to render."""

    scene: Scene
    method: str
    settings: Settings
    options: dict[str, Any]
    off: tuple[str, ...]  # skips

    def run(self) -> Picture:
        with skips.without_skip(*self.off):
            return render(self.scene, self.method, self.settings, **self.options)


def _trades(
    method: str, settings: Settings, lights: DimLights | None
) -> list[tuple[str, tuple[str, ...], Settings]]:
    """Return meaning, changes and changed settings of what the method could leave out and does not yet."""
    made = []
    fewer = () if lights is None else ((f"lights: as many as carry {lights.share:.1%}, drawn anew",
                                        (f"lights.count={lights.carrying}",)),)
    for meaning, changes in (*fewer, *TRADES.get(method, ())):
        try:
            changed = from_text(settings, changes)
        except InputError:  # does not go with the other settings
            continue
        if changed != settings:
            made.append((meaning, changes, changed))
    return made


def _shown(job: _Job, done: float, tell: Tell) -> Picture:
    tell(f"comparing bits{f' without {job.off[0]}' if job.off else ''}", done)
    return job.run()


def _in_turn(
    plain: _Job, jobs: list[_Job], rounds: int, tell: Tell
) -> tuple[tuple[float, ...], list[tuple[float, ...]]]:
    """Return the times of the plain picture, a round each, and those of every job."""
    times: list[list[float]] = [[] for _ in range(1 + len(jobs))]
    for turn in range(rounds):
        for number, job in enumerate((plain, *jobs)):
            tell("timing", (turn + number / len(times)) / rounds)
            started = time.perf_counter()
            job.run()
            times[number].append(time.perf_counter() - started)
    return tuple(times[0]), [tuple(one) for one in times[1:]]


def _measured(
    name: str, count: skips.Count, times: tuple[float, ...], times_without: tuple[float, ...], same_bits: bool
) -> MeasuredSkip:
    return MeasuredSkip(name=name, **skips.SKIPS[name]._asdict(), **count._asdict(), times=times,
                        times_without=times_without, same_bits=same_bits)


def _hash(picture: Picture) -> bytes:
    digest = hashlib.sha256()
    for plane in (picture.irradiance, picture.radiance):
        digest.update(np.ascontiguousarray(plane).tobytes())
    return digest.digest()


def _difference(picture: Picture, plain: Picture) -> float | None:
    covered = plain.frame.gbuffer.covered
    made, right = (one.irradiance[:, covered].astype(np.float64) for one in (picture, plain))
    mean = float(right.mean()) if right.size else 0.0
    return float(np.sqrt(((made - right) ** 2).mean())) / mean if mean > 0 else None

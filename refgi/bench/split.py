"""The error of a method, split into its approximations: pictures from the truth to the method, one more in each.

x_0 is the truth, x_n the picture of the method as it is used; d_k = x_k - x_k-1 is a step, e = d_1 + ... + d_n the
whole error. Changes of the mean add up, mean squares with their cross terms, shares mean d_k e / mean e^2 to 1; what is
missing where each is switched off alone is `cross_alone` (docs/error_split.md).
"""

import dataclasses
import math
import warnings
import zlib
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from refgi import stages
from refgi.bench.error import error_of, knee
from refgi.bench.grid import TRUTH, Choice, Grid
from refgi.bench.measure import REFERENCE_SEED, with_seed
from refgi.bench.results import Alone, Part, Run, SceneResult, Split, figures_of
from refgi.errors import RefgiError, RefgiWarning, expect
from refgi.frame import Frame
from refgi.method import NONE, Approximation, Method
from refgi.methods import METHODS
from refgi.provenance import estimate_record
from refgi.provenance.frames import StillFrames
from refgi.scene import Scene
from refgi.sssil.temporal import still_frame
from refgi.truth import TruthResult, TruthSettings, trace_truth
from refgi.types import Array, Tell

REST = "rest"
REST_ABOUT = "what is left with all of them switched off: texels of maps, pixels for surfaces"


class Link(NamedTuple):
    """Pictures with one approximation more than those before."""

    name: str
    about: str
    pictures: tuple[Array, ...]  # (3, h, w) W/m^2, a seed each
    variance: Array  # (3, h, w) of their mean: that of the truth; 0 of a method


class Without(NamedTuple):
    """Pictures with one approximation switched off, and the truth that they are judged by."""

    pictures: tuple[Array, ...]
    truth: Array
    variance: Array


class Chain(NamedTuple):
    """Pictures of one method and choice of settings."""

    links: tuple[Link, ...]  # the first is the truth, the last the method as it is used
    alone: Mapping[str, Without]  # by approximation
    covered: Array  # (h, w) bool: pixels that count


class Renderer:
    """Makes pictures of one view, each once; each truth has a seed of its own, so that their noise is not alike."""

    def __init__(
        self, scene: Scene, truth: TruthSettings | None = None, tell: Tell = lambda *_: None, *,
        still: StillFrames | None = None, **options: Any
    ) -> None:
        self.frame = Frame(scene, **options)
        self.options = {**options, "width": self.frame.width, "height": self.frame.height,
                        "rsm_resolution": self.frame.rsm_resolution}
        self.covered = self.frame.gbuffer.covered
        expect(bool(self.covered.any()), f"scene {scene.name!r}: camera", "a view of some surface",
               "a view past all of it")
        self._scene, self._tell, self._settings = scene, tell, truth or TruthSettings()
        self._frames = {_key(self.options): self.frame}
        if still is not None:
            self.options["still"] = still
        self._pictures: dict[Any, Array] = {}
        self._truths: dict[Any, TruthResult] = {}

    def picture(self, method: str, settings: Any, options: Mapping[str, Any]) -> Array:
        """Return the irradiance of a method, (3, h, w), W/m^2."""
        key = method, settings, _key(options)
        if key not in self._pictures:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RefgiWarning)  # of light that the settings lose: it is measured here
                self._pictures[key] = self._made(METHODS[method], settings, dict(options))
        return self._pictures[key]

    def _made(self, method: Method, settings: Any, options: dict[str, Any]) -> Array:
        still = options.pop("still", None)
        if still is not None and method.temporal is not None:
            with stages.observe(memory=stages.Memory()):  # its frames share their buffers
                return still_frame(self._scene, settings, still.temporal, still.frames, method=method.function,
                                   **options).irradiance
        if _key(options) not in self._frames:
            self._frames[_key(options)] = Frame(self._scene, **options)
        return method.function(self._frames[_key(options)], settings)

    def truth(self, limits: Mapping[str, Any] = NONE) -> TruthResult:
        """Return the truth that some settings of it limit."""
        key = _key(limits)
        if key not in self._truths:
            held = self._settings.checkpoint
            settings = dataclasses.replace(
                self._settings, **limits, seed=REFERENCE_SEED | zlib.crc32(repr(key).encode()) if limits else
                REFERENCE_SEED, checkpoint=held if held and Path(held).is_dir() else None)
            said = ", ".join((TRUTH, *(f"{name}={value}" for name, value in limits.items())))
            with stages.observe(progress=lambda _, done: self._tell(said, done)):
                self._truths[key] = trace_truth(self.frame, settings)
        return self._truths[key]


def chain_of(
    renderer: Renderer, choice: Choice, seeds: int, tell: Tell = lambda *_: None, *, alone: bool = True
) -> Chain:
    """Make the pictures of one method and choice, `seeds` of each kind; `alone`: each switched off by itself too."""
    kept = [one for one in METHODS[choice.method].approximations if _is_made(one, choice.settings, renderer.options)]
    limits = [one for one in kept if one.shared_by(choice.settings)]
    others = [one for one in kept if one not in limits]
    from_truth = [number for number, one in enumerate(others) if one.from_truth and one.from_truth(choice.settings)]
    stepped = others[from_truth[0] :] if from_truth else others
    links = [*_truths(renderer, limits, choice, seeds),
             *_steps(renderer, choice, stepped, seeds, from_truth=bool(from_truth), tell=tell)]
    without = {}
    judged = limits if from_truth and len(stepped) == 1 else [*limits, *stepped]  # without the last one it is the truth
    for number, one in enumerate(judged if alone else ()):
        tell(f"without {one.name}", 0.5 + number / (2 * len(kept)))
        judge = renderer.truth(one.shared_by(choice.settings))
        pictures = _pictures(renderer, choice, [] if one in limits else [one], seeds)
        without[one.name] = Without(pictures, judge.mean, judge.variance_of_mean)
    return Chain(tuple(links), without, renderer.covered)


def _truths(renderer: Renderer, limits: Sequence[Approximation], choice: Choice, seeds: int) -> Iterator[Link]:
    """Yield the truth, then truths with one limit of the method more in each."""
    limited: dict[str, Any] = {}
    for name, about, more in ((TRUTH, TRUTH, NONE), *((one.name, one.about, one.shared_by(choice.settings))
                                                      for one in limits)):
        limited |= more
        found = renderer.truth(limited)
        yield Link(name, about, (found.mean,) * seeds, found.variance_of_mean)


def _steps(
    renderer: Renderer, choice: Choice, stepped: Sequence[Approximation], seeds: int, *, from_truth: bool, tell: Tell
) -> Iterator[Link]:
    """Yield the method with all approximations switched off, unless that is the truth, then with one more in each."""
    names = [(REST, REST_ABOUT), *((one.name, one.about) for one in stepped)]
    nothing = np.zeros((3, renderer.frame.height, renderer.frame.width))
    for number in range(int(from_truth), len(names)):
        tell(names[number][0], number / (2 * len(names)))
        yield Link(*names[number], _pictures(renderer, choice, stepped[number:], seeds), nothing)


def _is_made(one: Approximation, settings: Any, options: Mapping[str, Any]) -> bool:
    return bool(one.shared_by(settings)) or one.without(settings, options) != (settings, options)


def _pictures(renderer: Renderer, choice: Choice, off: Sequence[Approximation], seeds: int) -> tuple[Array, ...]:
    """Return pictures without some approximations, a seed each; the first in the pipeline is switched off first."""
    made, still = [], renderer.options.get("still")
    for seed in range(seeds):
        first = seed * (1 if still is None else still.frames)  # each frame of a resting scene has the next seed
        settings: Any = with_seed(choice.settings, first)
        options: Mapping[str, Any] = renderer.options
        for one in off:
            settings, options = one.without(settings, options)
        made.append(renderer.picture(choice.method, settings, options))
    return tuple(made)


def _key(options: Mapping[str, Any]) -> tuple[Any, ...]:
    return tuple(sorted(options.items()))


SIDE = 128  # pixels along the longer side of the view that is split: pictures of it are slow


def with_splits(
    result: SceneResult, scene: Scene, grid: Grid, *, seeds: int, truth: TruthSettings | None = None,
    tell: Tell = lambda *_: None, defaults: bool = True, still: StillFrames | None = None, **frame_options: Any,
) -> SceneResult:
    """Split the error of each method at the knee of its curve and, with `defaults`, at its defaults; `seeds` each."""
    splits, failures = [], dict(result.failures)
    size = dict(zip(("width", "height"), small_size(result.width, result.height), strict=True))
    renderer = Renderer(scene, truth, tell, still=still, **{**size, **frame_options})
    for choice, at_knee in chosen_for_split(result.runs, grid, defaults=defaults):
        name = f"split of {choice.method}: {choice.label}"

        def told(what: str, done: float, name: str = name) -> None:
            tell(f"{name}: {what}", done)

        try:
            chain = chain_of(renderer, choice, seeds, told)
        except RefgiError as error:
            failures[name] = str(error)
            continue
        splits.append(split_of(chain, choice, at_knee, estimate_record(renderer.truth())["estimate"]["statement"]))
    return result.model_copy(update={"splits": tuple(splits), "failures": failures})


def small_size(width: int, height: int) -> tuple[int, int]:
    """Return the size of a view with `SIDE` pixels along the longer side, or its own where it is smaller.

    >>> small_size(1024, 768), small_size(64, 100)
    ((128, 96), (64, 100))
    """
    share = min(1.0, SIDE / max(width, height))
    return max(1, round(share * width)), max(1, round(share * height))


def chosen_for_split(runs: Sequence[Run], grid: Grid, *, defaults: bool = True) -> list[tuple[Choice, bool]]:
    """Return each method's knee and, with `defaults`, its default if that is another; and which of them is the knee."""
    chosen = []
    for method in dict.fromkeys(run.method for run in runs):
        curve = [run for run in runs if run.method == method]
        at = knee([(run.seconds, run.rmse) for run in curve])
        found = [one for one in grid.choices if at is not None and (one.method, one.changes) == (
            method, curve[at].changes)]
        default = METHODS[method].settings()
        is_other = not found or found[0].settings != default
        chosen += [(Choice(method, (), default), False)] if defaults and is_other else []
        chosen += [(one, True) for one in found[:1]]
    return chosen


def split_of(chain: Chain, choice: Choice, at_knee: bool = False, statement: str = "") -> Split:
    """Measure the pictures of a chain over the mean of the truth; None where that is 0 or a picture not finite."""
    first, last, covered = chain.links[0], chain.links[-1], chain.covered
    scale = float(first.pictures[0][:, covered].mean(dtype=np.float64))
    whole = _changes(first, last, covered)
    square = _mean_square(whole)
    parts = [_part(before, after, whole, chain, scale) for before, after in pairwise(chain.links)]
    squares = sum(_mean_square(_changes(*pair, covered)) for pair in pairwise(chain.links))
    costs = [part.alone.square for part in parts if part.alone]
    noiseless = square - float(first.variance[:, covered].mean())
    known = scale > 0 and bool(costs) and None not in costs
    cross_alone = noiseless / scale**2 - sum(cost or 0.0 for cost in costs) if known else None
    height, width = covered.shape
    return Split(method=choice.method, changes=choice.changes, knee=at_knee, width=width, height=height,
                 truth=statement, error=figures_of(error_of(last.pictures, first.pictures[0], first.variance, covered)),
                 mean=_over(whole.mean(), scale), squares=_over(squares, scale**2),
                 cross=_over(square - squares, scale**2), cross_alone=cross_alone, parts=tuple(parts))


def _part(before: Link, after: Link, whole: Array, chain: Chain, scale: float) -> Part:
    first, covered = chain.links[0], chain.covered
    truth = first.pictures[0]
    step = _changes(before, after, covered)
    pairs = zip(after.pictures, before.pictures, strict=True)
    error = error_of([truth + (new.astype(np.float64) - old) for new, old in pairs], truth,
                     before.variance + after.variance, covered)
    without = chain.alone.get(after.name)
    return Part(name=after.name, about=after.about, error=figures_of(error), mean=_over(step.mean(), scale),
                share=_over((step * whole).mean(), _mean_square(whole)),
                alone=None if without is None else _alone(without, chain, scale))


def _alone(without: Without, chain: Chain, scale: float) -> Alone:
    first, last, covered = chain.links[0], chain.links[-1], chain.covered
    left = _values(without.pictures, covered) - _values((without.truth,), covered)
    square = _mean_square(left) - float(without.variance[:, covered].mean())
    whole = _changes(first, last, covered)
    cost = _mean_square(whole) - float(first.variance[:, covered].mean()) - square
    return Alone(rmse=_over(math.sqrt(max(0.0, square)), scale) if math.isfinite(square) else None,
                 square=_over(cost, scale**2), mean=_over(whole.mean() - left.mean(), scale))


def _changes(before: Link, after: Link, covered: Array) -> Array:
    """Return the change from one link to another, (seeds, 3, pixels)."""
    return _values(after.pictures, covered) - _values(before.pictures, covered)


def _values(pictures: Sequence[Array], covered: Array) -> Array:
    return np.array([picture[:, covered] for picture in pictures], np.float64)


def _mean_square(values: Array) -> float:
    return float((values**2).mean())


def _over(value: float, scale: float) -> float | None:
    ratio = float(value) / scale if scale else math.nan
    return ratio if math.isfinite(ratio) else None

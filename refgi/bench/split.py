"""The error of a method, split into its approximations.

x_0 is the truth, x_n the picture of the method as it is used, x_k has one approximation more than x_k-1
(`refgi.bench.chain`). Its step is d_k = x_k - x_k-1, the whole error e = x_n - x_0 = d_1 + ... + d_n. How parts add up:

- changes of the mean add up exactly: mean e = sum of mean d_k;
- mean squares do so with their cross terms: mean e^2 = sum of mean d_k^2 + 2 sum over j < k of mean d_j d_k;
- shares, mean d_k e / mean e^2, add up to 1: each has its own square and half of its cross terms with others; a share
  below 0 takes back what others did.

Switched off alone, approximations do not add up: what is missing is `cross_alone`.
"""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.bench.chain import Alone as Without
from refgi.bench.chain import Chain, Link, Renderer, Tell, chain_of
from refgi.bench.curves import knee
from refgi.bench.error import error_of
from refgi.bench.grid import Choice, Grid
from refgi.bench.results import Alone, Part, Run, SceneResult, Split, figures_of
from refgi.errors import RefgiError
from refgi.methods import METHODS
from refgi.provenance import estimate_record
from refgi.provenance.frames import StillFrames
from refgi.scene import Scene
from refgi.truth import TruthSettings

Array = npt.NDArray[Any]

SIDE = 128  # pixels along the longer side of the view that is split: pictures of it are slow


def with_splits(
    result: SceneResult, scene: Scene, grid: Grid, *, seeds: int, truth: TruthSettings | None = None,
    tell: Tell = lambda *_: None, defaults: bool = True, still: StillFrames | None = None, **frame_options: Any,
) -> SceneResult:
    """Split the error of each method at the knee of its curve and, with `defaults`, at its defaults.

    `seeds` pictures of each kind: from two on bias and variance are told apart. Without width and height the longer
    side has `SIDE` pixels at most. Splits are by method in the order of the runs; what could not be split is among the
    failures. `still`: frames of the resting scene that methods with a temporal filter blend.
    """
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
    """Return what is split, each with whether it is the knee of its curve.

    The knee of each method and, with `defaults`, its default where that is another.
    """
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
    """Measure the pictures of a chain, from the truth to the method as it is used.

    Figures are over the mean of the truth; None where that is 0 or a picture is not finite. `statement` says how well
    the truth is known.
    """
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

"""Pictures from the truth to a method as it is used, one approximation more in each.

The chain starts at the truth. Then come truths that leave out what the method cannot do without, such as unseen
senders; then the method with all other approximations switched off; then one after the other is switched on, in the
order of the method's pipeline. Beside the chain stands the method with each switched off alone.

Every picture is made with each of several seeds. One that draws no random numbers is made once.
"""

import dataclasses
import warnings
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi import stages
from refgi.bench.grid import TRUTH, Choice
from refgi.bench.measure import REFERENCE_SEED, with_seed
from refgi.errors import RefgiWarning, expect
from refgi.frame import Frame
from refgi.method import NONE, Approximation, Method
from refgi.methods import METHODS
from refgi.provenance.frames import StillFrames
from refgi.scene import Scene
from refgi.sssil.temporal import still_frame
from refgi.truth import TruthResult, TruthSettings, trace_truth

Array = npt.NDArray[Any]
Tell = Callable[[str, float], None]

REST = "rest"
REST_ABOUT = "what is left with all of them switched off: texels of maps, pixels for surfaces"


class Link(NamedTuple):
    """Pictures with one approximation more than those before."""

    name: str
    about: str
    pictures: tuple[Array, ...]  # (3, h, w) W/m^2, a seed each
    variance: Array  # (3, h, w) of their mean: that of the truth; 0 of a method


class Alone(NamedTuple):
    """Pictures with one approximation switched off, and the truth that they are judged by."""

    pictures: tuple[Array, ...]
    truth: Array
    variance: Array


class Chain(NamedTuple):
    """Pictures of one method and choice of settings."""

    links: tuple[Link, ...]  # the first is the truth, the last the method as it is used
    alone: Mapping[str, Alone]  # by approximation
    covered: Array  # (h, w) bool: pixels that count


class Renderer:
    """Makes pictures of one view, each once.

    Each truth has a seed of its own, so that their noise is not alike. `still` gives the frames of the resting scene
    that a method with a temporal filter blends.
    """

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
    """Make the pictures of one method and choice of settings, `seeds` of each kind.

    Approximations that the settings do not make are left out, and those that `from_truth` takes in. With `alone` they
    are switched off one by one as well.
    """
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
        without[one.name] = Alone(pictures, judge.mean, judge.variance_of_mean)
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
    """Return pictures without some approximations, a seed each.

    The first in the pipeline is switched off first: what stands on it is gone with it.
    """
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

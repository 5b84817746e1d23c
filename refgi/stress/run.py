"""A scene rendered by each method as it is and after each change: the rows of what was promised and found."""

import math
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import t as student

from refgi.errors import InputError, RefgiWarning, expect
from refgi.frame import Frame
from refgi.jit import threads
from refgi.scene import DirectionalLight, Scene
from refgi.settings import Settings
from refgi.stress.changes import CHANGES, Change, Changed, NotPromisedError
from refgi.stress.promises import FEW, SURFACES, UNBOUNDED, UNLIKELY, Asked, Row, asked, settings_of, surfaces
from refgi.types import Array, Tell


def largest_bounce(frame: Frame) -> Array | None:
    """Return what irradiance of one bounce exceeds nowhere, (3,), W/m^2.

    Largest radiosity at texels of all lamps' maps, the lamps added; None where a lobe or glass sends light, as it may
    send all of it one way. A hemisphere filled with the radiance B / pi gives the irradiance B. A texel of solid angle
    w, seen at distance r and cosine c, has the area w r^2 / c, so B = flux c / (w r^2).
    """
    if frame.materials.specular.any() or frame.materials.ior.any():
        return None
    bound = np.zeros(3)
    for light, rsm in zip(frame.scene.lights, frame.rsms, strict=True):
        lit = rsm.covered & (rsm.solid_angle > 0)
        flux, angle = rsm.flux[:, lit].astype(np.float64), rsm.solid_angle[lit].astype(np.float64)
        normal = rsm.normal[:, lit].astype(np.float64)
        if isinstance(light, DirectionalLight):
            towards = -np.array(light.direction)[:, None] / np.linalg.norm(light.direction)
            square = np.ones_like(angle)
        else:
            towards = np.array(light.position)[:, None] - rsm.position[:, lit]
            square = (towards**2).sum(axis=0)
            towards /= np.sqrt(square)
        cosine = np.abs((normal * towards).sum(axis=0))
        bound += (flux * (cosine / (angle * square))).max(axis=1, initial=0.0)
    return bound


NEAR = 1e-4  # share of the depth within which two pixels show the same place
ALIKE = 1e-5  # difference of albedo


class Seen(NamedTuple):
    """A picture with what its judges need."""

    light: Array  # (3, h, w) indirect irradiance, W/m^2, of the frame's type
    depth: Array  # (h, w) m; inf without surface
    albedo: Array  # (3, h, w)
    estimate: Any  # of a method that states its own error
    warned: tuple[str, ...]  # warnings that are not refgi's own, as text


def see(scene: Scene, method: str, settings: Settings, options: dict[str, Any]) -> Seen:
    """Render a scene by a method and keep what comparisons need; warnings of refgi are left out."""
    from refgi.methods import render

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        picture = render(scene, method, settings, **options)
        buffer = picture.frame.gbuffer
        seen = Seen(picture.irradiance, buffer.depth, buffer.albedo, picture.estimate, ())
    other = tuple(f"{one.category.__name__}: {one.message}" for one in caught
                  if not issubclass(one.category, RefgiWarning))
    return seen._replace(warned=other)


def unsound(light: Array) -> int:
    """Return how many pixels of irradiance, (3, h, w), hold NaN, an infinity or a negative number."""
    return int(np.count_nonzero(~(np.isfinite(light) & (light >= 0)).all(axis=0)))


def same_surface(before: Seen, after: Seen, changed: Changed) -> Array:
    """Return which pixels of the part, (h, w), show the same place in both: depths within 1e-4, the same albedo."""
    depth, albedo = before.depth[changed.part], before.albedo[:, *changed.part]
    other = changed.back(after.depth, light=False) / changed.length
    colour = changed.back(after.albedo, light=False)
    with np.errstate(invalid="ignore"):
        near = (depth == other) | (np.abs(depth - other) <= NEAR * np.minimum(depth, other))
    return np.asarray(near & (np.abs(albedo - colour).max(axis=0) <= ALIKE))


def bits_apart(before: Seen, after: Seen, changed: Changed) -> int:
    """Return how many pixels of the part differ by a bit, of those whose light has all its digits in both pictures.

    Light below the smallest normal number of float32, 1.2e-38, keeps fewer bits and is not asked for any.
    """
    was, now = before.light[:, *changed.part], changed.back(after.light)
    too_dark = np.maximum(was, now) * min(1.0, changed.flux) < np.finfo(np.float32).tiny
    return int(np.count_nonzero(((was != now) & ~too_dark).any(axis=0)))


def rmse_apart(before: Seen, after: Seen, changed: Changed) -> float:
    """Return the RMSE over pixels that show the same place, over the mean before; infinity where none does."""
    first = before.light[:, *changed.part].astype(np.float64)
    apart = changed.back(after.light.astype(np.float64)) - first
    kept = same_surface(before, after, changed)
    mean = float(first.mean())
    if not kept.any():
        return math.inf
    if not apart[:, kept].any():
        return 0.0
    return math.sqrt(float((apart[:, kept] ** 2).mean())) / mean if mean > 0 else math.inf


def means_apart(before: Seen, after: Seen, changed: Changed) -> float:
    """Return how far the means over surfaces are apart, over that before; infinity where only one is black."""
    first, second = (seen.light[:, np.isfinite(seen.depth)].astype(np.float64) for seen in (before, after))
    if not first.any() and not second.any():
        return 0.0
    mean = float(first.mean()) if first.size else 0.0
    return abs(float(second.mean()) / changed.flux / mean - 1) if mean > 0 and second.size else math.inf


def estimates_apart(before: Seen, after: Seen, changed: Changed) -> tuple[float, float]:
    """Return the largest |t| of the picture means of two estimates over channels, and its degrees of freedom."""
    first, second = before.estimate, after.estimate
    apart = np.abs(first.picture_mean - second.picture_mean / changed.flux)
    variance = first.picture_variance + second.picture_variance / changed.flux**2
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.where(apart == 0, 0.0, apart / np.sqrt(variance))  # NaN stays
    return float(t.max()), float(first.degrees_of_freedom + second.degrees_of_freedom)


PART = "pictures"
SIGMAS = 4.0  # of an estimate, that it may lie above what light can bring


class Found(NamedTuple):
    """A row, and its pictures where it has some."""

    row: Row
    shown: tuple[Array, Array] | None = None  # (3, h, w) W/m^2: the same pixels before and after


class Silence(NamedTuple):
    """What a method was not asked, and why."""

    method: str
    change: str
    why: str


def stress(
    scene: Scene, methods: Sequence[str], *, width: int, height: int, changes: Sequence[str] | None = None,
    source: str = "", tell: Tell = lambda *_: None, silent: Callable[[Silence], None] = lambda _: None,
    unknown: bool = False,
) -> Iterator[Found]:
    """Attack a scene: render it by methods after changes of which the outcome is known; yield a row a promise.

    All `CHANGES` where none is named. `source` names the scene on the command line, for reproductions; `silent` is
    called with what a method is not asked; `unknown` yields rows whose limit is still to be observed as well.
    InputError if a name is unknown, or the scene cannot be rendered as it is.
    """
    known = {change.name: change for change in CHANGES}
    for name in changes or ():
        expect(name in known, "change", f"one of {', '.join(known)}", name)
    chosen = [known[name] for name in changes] if changes else list(CHANGES)
    size = {"width": width, "height": height}
    applied = {}
    for change in chosen:
        try:
            applied[change.name] = change.apply(scene, width, height)
        except NotPromisedError as why:
            silent(Silence("every method", change.name, str(why)))
    for number, method in enumerate(methods):
        one = _Method(scene, method, size, source or scene.name, silent, unknown)
        done: list[Change] = [change for change in chosen if change.name in applied]
        for count, change in enumerate(done):
            tell(f"{method}: {change.name}", (number + count / len(done)) / len(methods))
            yield from one.after(change, applied[change.name], whole=number == 0)
        if changes is None:
            yield from one.as_it_is()


class _Method:
    """One method on one scene; its pictures before are kept."""

    def __init__(self, scene: Scene, method: str, size: dict[str, int], source: str,
                 silent: Callable[[Silence], None], unknown: bool) -> None:
        self._scene, self._method, self._size, self._source, self._silent = scene, method, size, source, silent
        self._unknown = unknown
        self._before: dict[Any, Seen] = {}
        self._pictures = self._unsound = 0
        self._warned: list[str] = []
        self._begin = time.perf_counter()

    def after(self, change: Change, changed: Changed, *, whole: bool) -> Iterator[Found]:
        """Yield the row of one change, and that of the surfaces it shows with the first method."""
        try:
            size = self._size["width"], self._size["height"]
            how = asked(self._method, change, self._scene, size)
            if math.isinf(how.limit) and not self._unknown:
                raise NotPromisedError("no limit was observed yet")
        except NotPromisedError as why:
            self._silent(Silence(self._method, change.name, str(why)))
            return
        before = self._see(how)
        try:
            after = self._see(how, changed)
        except InputError as error:
            yield Found(self._row(change.name, how, math.nan, "", f"{change.about}: {error}"))
            return
        if whole and how.promise != "mean":
            yield Found(self._surfaces(change, before, after, changed))
        figure, unit = _figure(how, before, after, changed)
        if how.kind in ("statistics", "observed x 2") and before.estimate is not None:  # one sample may be any share
            doubt = before.estimate.doubt or after.estimate.doubt
            if doubt:
                self._silent(Silence(self._method, change.name, doubt))
                return
        if how.promise == "estimate":
            figure, degrees = estimates_apart(before, after, changed)
            how = how._replace(limit=float(student.isf(UNLIKELY / 6, degrees)))  # either side of three channels
        shown = None if how.promise == "mean" else (before.light[:, *changed.part], changed.back(after.light))
        yield Found(self._row(change.name, how, figure, unit, change.about), shown)

    def as_it_is(self) -> Iterator[Found]:
        """Yield rows of the scene as it is: the same bits again and on one thread, sound numbers, energy."""
        few = FEW.get(self._method, ())
        how = Asked("bits", few, source="each element is owned by one iteration and summed in a fixed order")
        before = self._see(how)
        for name in ("again", "one thread"):
            with threads(1 if name == "one thread" else None):
                after = self._render(self._scene, how, {})
            apart = bits_apart(before, after, Changed(self._scene))
            yield Found(self._row(name, how, apart, "pixels", "the same picture twice"))
        sound = how._replace(source="light is a finite number, 0 or more")
        yield Found(self._row("sound numbers", sound, self._unsound, "pixels", f"{self._pictures} pictures",
                              cases=self._pictures))
        quiet = how._replace(source="a fault of the program, not of the scene")
        yield Found(self._row("no warning of Python", quiet, len(self._warned), "warnings", "; ".join(self._warned[:2]),
                              cases=self._pictures))
        yield from self._energy(before)

    def _energy(self, before: Seen) -> Iterator[Found]:
        if self._method in UNBOUNDED:
            self._silent(Silence(self._method, "energy", UNBOUNDED[self._method]))
            return
        from refgi.frame import Frame

        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RefgiWarning)
            bound = largest_bounce(Frame(self._scene, width=self._size["width"], height=self._size["height"]))
        if bound is None:
            self._silent(Silence(self._method, "energy", "a lobe or glass may send all light one way"))
            return
        light = before.light.astype(float)
        if before.estimate is not None:
            light = light - SIGMAS * before.estimate.standard_error
        most = light.reshape(3, -1).max(axis=1)
        share = float(np.max(np.divide(most, bound, out=np.where(most > 0, np.inf, 0.0), where=bound > 0)))
        how = Asked("rounding", FEW.get(self._method, ()), limit=1.0, kind="derived",
                    source="a hemisphere filled with the brightest diffuse radiance")
        yield Found(self._row("energy", how, share, "of the bound", "largest radiosity of what is lit"))

    def _surfaces(self, change: Change, before: Seen, after: Seen, changed: Changed) -> Row:
        same = same_surface(before, after, changed)
        share = 1 - float(same.mean())
        row = self._row(change.name, surfaces(change), share, "of pixels", "pixels that show another place")
        return row.model_copy(update={"subject": SURFACES})

    def _see(self, how: Asked, changed: Changed | None = None) -> Seen:
        if changed is not None:
            return self._render(changed.scene, how, dict(changed.options))
        key = how.settings, tuple(how.options.items())
        if key not in self._before:
            self._before[key] = self._render(self._scene, how, {})
        return self._before[key]

    def _render(self, scene: Scene, how: Asked, options: dict[str, Any]) -> Seen:
        settings = settings_of(self._method, how.settings)
        seen = see(scene, self._method, settings, {**self._size, **how.options, **options})
        self._pictures += 1
        self._unsound += unsound(seen.light)
        self._warned += seen.warned
        return seen

    def _row(self, name: str, how: Asked, figure: float, unit: str, detail: str, cases: int = 1) -> Row:
        spent, self._begin = time.perf_counter() - self._begin, time.perf_counter()
        width, height = self._size["width"], self._size["height"]
        only = f" --change '{name}'" if any(change.name == name for change in CHANGES) else ""
        return Row(part=PART, property=name, subject=self._method, scene=self._scene.name,
                   domain=f"{width} x {height}{', ' if how.settings else ''}{' '.join(how.settings)}",
                   figure=figure, unit=unit, limit=how.limit, kind=how.kind, source=how.source, cases=cases,
                   reproduce=f"refgi stress {self._source} --methods {self._method}{only} --size {width}x{height} "
                             "--out out", detail=detail, seconds=round(spent, 3))


def _figure(how: Asked, before: Seen, after: Seen, changed: Changed) -> tuple[float, str]:
    if how.promise == "bits":
        return bits_apart(before, after, changed), "pixels"
    if how.promise == "rounding":
        return rmse_apart(before, after, changed), "of the mean"
    if how.promise == "mean":
        return means_apart(before, after, changed), "of the mean"
    return 0.0, "standard errors"

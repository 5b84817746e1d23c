"""The pictures of a page as data for its script: irradiance to radiance, worst places, planes.

All pictures of a view share L_0 (emission and reflected direct light) and k (albedo / pi), so a page holds them once
and each picture's irradiance alone. Both are found from the pictures by least squares, with 0 <= k <= 1 / pi.

A view is one scene from one camera: references, pictures judged by them, and what turns irradiance into radiance.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from refgi.compare import pictures as maps
from refgi.compare.outcome import TRUTH, UNOCCLUDED
from refgi.compare.page.detectors import Finding, findings
from refgi.compare.page.floats import FIRST, Store
from refgi.errors import expect
from refgi.types import Array

PLACES = 3
SHARE_OF_SIDE = 8  # a square is an eighth of the shorter side
LEAST_SIDE = 8  # pixels
NEGLIGIBLE = 1e-9  # of the whole: what rounding leaves in sums over windows without error


class Crop(NamedTuple):
    """A square of a picture, in pixels from the upper left corner."""

    x: int
    y: int
    side: int
    share: float  # of the squared error of the whole picture


def worst_crops(error: Array, covered: Array) -> tuple[Crop, ...]:
    """Return up to `PLACES` squares with the most squared error, (h, w), worst first, none over another.

    An error that is not finite counts as the largest that is; no square where there is no error on covered pixels.
    """
    squares = _squares(error, covered)
    side = min(*error.shape, max(LEAST_SIDE, min(error.shape) // SHARE_OF_SIDE))
    sums, whole = _window_sums(squares, side), float(squares.sum())
    found: list[Crop] = []
    while len(found) < PLACES and sums.max() > NEGLIGIBLE * whole:
        y, x = (int(i) for i in np.unravel_index(np.argmax(sums), sums.shape))
        found.append(Crop(x, y, side, float(sums[y, x]) / whole))
        sums[max(0, y - side + 1):y + side, max(0, x - side + 1):x + side] = 0  # windows over this one
    return tuple(found)


def _squares(error: Array, covered: Array) -> Array:
    finite = np.isfinite(error) & covered
    squares = np.where(finite, np.where(finite, error, 0.0).astype(np.float64) ** 2, 0.0)
    squares[covered & ~finite] = squares.max(initial=0.0) or 1.0
    return squares


def _window_sums(values: Array, side: int) -> Array:
    sums = np.pad(values, ((1, 0), (1, 0))).cumsum(0).cumsum(1)
    windows: Array = sums[side:, side:] - sums[:-side, side:] - sums[side:, :-side] + sums[:-side, :-side]
    return windows


TOLERANCE = 2.0**-10  # of the radiance: two roundings to half floats


class SurfaceFit:
    """Sums over the pictures of a view, (3, h, w), taken one after the other."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        self._count: Array = np.zeros(shape, np.int64)
        self._sums = np.zeros((4, *shape))  # of E, L, E^2, E L

    def add(self, irradiance: Array, radiance: Array) -> None:
        """Count a picture: indirect irradiance, W/m^2, and the radiance that the camera receives.

        Pixels that are not finite do not count.
        """
        expect(irradiance.shape == radiance.shape == self._sums.shape[1:], "picture", f"shape {self._sums.shape[1:]}",
               irradiance.shape)
        e, light = irradiance.astype(np.float64), radiance.astype(np.float64)
        finite = np.isfinite(e) & np.isfinite(light)
        e, light = np.where(finite, e, 0.0), np.where(finite, light, 0.0)
        self._count += finite
        self._sums += np.stack([e, light, e * e, e * light])

    def solve(self) -> tuple[Array, Array]:
        """Return L_0, W/m^2/sr, and k, 1/sr, each (3, h, w)."""
        count = np.maximum(self._count, 1)
        e, light, squares, products = self._sums / count
        spread = squares - e * e
        least = 1e-12 * squares  # below it pictures agree, and any k that leaves L_0 >= 0 serves
        slope = np.divide(products - e * light, spread, out=np.zeros_like(e), where=spread > least)
        steepest = np.divide(light, e, out=np.full_like(e, np.inf), where=e > 0)
        slope = np.clip(slope, 0.0, np.minimum(1 / math.pi, np.maximum(steepest, 0.0)))
        return light - slope * e, slope


def follows(irradiance: Array, radiance: Array, surface: tuple[Array, Array]) -> bool:
    """Return whether a picture's radiance is what the surface, L_0 and k, makes of its irradiance.

    True where every finite pixel differs by less than a rounding to half floats.
    """
    emitted, reflectance = surface
    finite = np.isfinite(irradiance) & np.isfinite(radiance)
    made = np.where(finite, emitted + reflectance * np.where(finite, irradiance, 0.0), 0.0)
    right = np.where(finite, radiance, 0.0)
    floor = np.abs(right).max(initial=0.0) * 2.0**-24
    return bool((np.abs(made - right) <= TOLERANCE * np.abs(right) + floor).all())


Surface = tuple[Array, Array]

LIMIT = 14_000_000  # characters of pictures; a page of 100 runs then stays under 15 MB
STOPS = 33  # colours of a map that the script knows; it blends between them
LABELS = {TRUTH: "Truth", UNOCCLUDED: "Truth without visibility"}


class Picture(NamedTuple):
    """One picture of a view."""

    name: str  # of its own on the page: letters, digits, hyphens
    label: str
    said: str  # figures in short
    judges: tuple[str, ...]  # names of references; the last is what the picture converges to
    load: Callable[[], tuple[Array, Array]]  # (3, h, w) irradiance, W/m^2, and radiance, W/m^2/sr
    importance: int = FIRST


class Judge(NamedTuple):
    """A reference of a view."""

    irradiance: Array  # (3, h, w), W/m^2
    variance: Array  # of its mean
    radiance: Array
    said: str = ""


class View(NamedTuple):
    """One scene from one camera."""

    name: str  # of its own on the page
    title: str
    exposure: float  # factor of the radiance before the sRGB curve
    covered: Array  # (h, w) pixels that show a surface
    judges: Mapping[str, Judge]  # by name: the truth and, where a picture needs it, the truth without visibility
    pictures: Sequence[Picture]
    ids: Mapping[str, Array]  # (h, w) uint32, by name: what each pixel shows


class Album(NamedTuple):
    """All views of a page."""

    data: dict[str, Any]  # JSON values for the script
    blobs: list[str]  # planes as base64, by the numbers that `data` holds


def album(views: Sequence[View], limit: int = LIMIT) -> Album:
    """Return the pictures of a page for its template and script, within `limit` characters."""
    store = Store()
    described = [_described(view, store) for view in views]
    store.fit(limit)
    colours = {name: maps.gradient(maps.Scale(0, 1, name, ""), STOPS) for name in (maps.DIVERGING, maps.SEQUENTIAL)}
    return Album({"views": described, "planes": store.facts(), "signed": colours[maps.DIVERGING],
                  "sequential": colours[maps.SEQUENTIAL]}, store.texts())


def _described(view: View, store: Store) -> dict[str, Any]:
    height, width = view.covered.shape
    mask, surface = store.add_mask(view.covered), _surface(view)
    truth = view.judges[TRUTH].irradiance
    references = [_reference(view, name, surface, store) for name in view.judges]
    shared = {"emitted": store.add(surface[0], view.covered), "reflectance": store.add(surface[1], view.covered),
              "ids": {name: store.add_ids(plane) for name, plane in sorted(view.ids.items())}}
    pictures, errors = [], []
    for picture in view.pictures:
        described, error = _picture(view, picture, surface, store)
        pictures.append(described)
        errors.append(error)
    brightness = maps.luminance_scale(truth, view.covered)
    return {"name": view.name, "title": view.title, "width": width, "height": height, "exposure": view.exposure,
            "indirectExposure": maps.indirect_exposure(truth, view.covered), "mask": mask, **shared,
            "references": references, "pictures": pictures, "brightest": brightness.high,
            "largestError": maps.error_scale(errors, view.covered).high}


def _surface(view: View) -> Surface:
    found = SurfaceFit(view.judges[TRUTH].irradiance.shape)
    for judge in view.judges.values():
        found.add(judge.irradiance, judge.radiance)
    for picture in view.pictures:
        found.add(*picture.load())
    return found.solve()


def _reference(view: View, name: str, surface: Surface, store: Store) -> dict[str, Any]:
    judge = view.judges[name]
    deviation = maps.luminance(np.sqrt(judge.variance))[None]
    return {"name": f"{view.name}-{name}", "key": name, "label": LABELS[name], "said": judge.said, "judges": [],
            "deviation": store.add(deviation, view.covered),
            **_light(view, (judge.irradiance, judge.radiance), surface, store, FIRST)}


def _picture(view: View, picture: Picture, surface: Surface, store: Store) -> tuple[dict[str, Any], Array]:
    """Return a picture's data and the luminance of its error."""
    light = picture.load()
    own = view.judges[picture.judges[-1]]
    error = maps.luminance(light[0]) - maps.luminance(view.judges[TRUTH].irradiance)
    seen = findings(light[0], own.irradiance, own.variance, view.covered)
    return {"name": picture.name, "label": picture.label, "said": picture.said, "judges": list(picture.judges),
            "findings": list(_said(seen, LABELS[picture.judges[-1]])),
            "crops": [crop._asdict() for crop in worst_crops(error, view.covered)],
            **_light(view, light, surface, store, picture.importance)}, error.astype(np.float32)


def _light(view: View, light: tuple[Array, Array], surface: Surface, store: Store, importance: int) -> dict[str, int]:
    """Store irradiance, and radiance where the surface does not make it of the irradiance."""
    stored = {"irradiance": store.add(light[0], view.covered, importance)}
    if not follows(*light, surface):
        stored["radiance"] = store.add(light[1], view.covered, importance)
    return stored


def _said(seen: Sequence[Finding], judge: str) -> Iterator[dict[str, str]]:
    for one in seen:
        yield {"name": one.name, "about": f"{one.said}, against the {judge.lower()}: {one.figure:.3g}, named from "
                                          f"{one.threshold:g} on"}

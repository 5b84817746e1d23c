"""The pictures of a page as data for its script.

A view is one scene from one camera: references, pictures judged by them, and what turns irradiance into radiance.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.compare import maps
from refgi.compare.outcome import TRUTH, UNOCCLUDED
from refgi.compare.page.budget import FIRST, Store
from refgi.compare.page.crops import worst_crops
from refgi.compare.page.detectors import Finding, findings
from refgi.compare.page.surface import SurfaceFit, follows

Array = npt.NDArray[Any]
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

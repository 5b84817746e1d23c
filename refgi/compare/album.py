"""The pictures of a page as data for its script: irradiance to radiance, worst places, planes as text.

All pictures of a view share L_0 (emission and reflected direct light) and k (albedo / pi), 0 <= k <= 1 / pi, fitted by
least squares: a page holds them once and each picture's irradiance alone. Planes are half floats of a power of two,
compared as integers: what is stored is the difference to the second channel, then to the pixel on the left. Over the
limit of a page, the least important become means over blocks of pixels first.
"""

import base64
import math
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.compare import pictures as maps
from refgi.compare.findings import Finding, findings, worst_crops
from refgi.compare.outcome import TRUTH, UNOCCLUDED
from refgi.errors import expect
from refgi.types import Array

Bits = npt.NDArray[np.uint16]
Surface = tuple[Array, Array]  # L_0, k

LARGEST_EXPONENT = 15  # numbers are scaled below 2^15; half floats end at 65504
LEVEL = 6  # of deflate: 9 takes three times as long for 1 % less
BASE = 1  # the channel that others are predicted from: green
COARSEST = 5  # means over 32 x 32 pixels
FIRST, SECOND, THIRD = 0, 1, 2  # importance: references and what all pictures need; the front; all others
GRACE = 1.5  # levels that each step of importance is spared
TOLERANCE = 2.0**-10  # of the radiance: two roundings to half floats
LIMIT = 14_000_000  # characters of pictures; a page of 100 runs then stays under 15 MB
STOPS = 33  # colours of a map that the script knows; it blends between them
LABELS = {TRUTH: "Truth", UNOCCLUDED: "Truth without visibility"}


def halves(planes: Array) -> tuple[Bits, int]:
    """Return numbers, (c, h, w), over 2^exponent as bits of half floats, and the exponent; NaN and infinity stay.

    >>> bits, exponent = halves(np.array([[[1.0, 0.5]]]))
    >>> (bits.view(np.float16) * 2.0**exponent).tolist()
    [[[1.0, 0.5]]]
    """
    finite = np.abs(planes[np.isfinite(planes)])
    largest = float(finite.max()) if finite.size else 0.0
    exponent = math.frexp(largest)[1] - LARGEST_EXPONENT if largest > 0 else 0
    scaled = np.ldexp(np.asarray(planes, np.float64), -exponent).astype(np.float16)
    return np.ascontiguousarray(scaled).view(np.uint16), exponent


def packed(bits: Bits) -> str:
    """Return planes of 16 bits, (c, h, w), as the text that the page's script unpacks: Base64 of a zlib stream."""
    if len(bits) > BASE:
        base = bits[BASE].copy()
        bits = bits - base  # modulo 2^16, as all sums here and in the script
        bits[BASE] = base
    steps = np.diff(bits, axis=2, prepend=np.uint16(0)).astype(np.uint16)
    content = np.concatenate([(steps >> 8).astype(np.uint8).ravel(), (steps & 0xFF).astype(np.uint8).ravel()])
    return base64.b64encode(zlib.compress(content.tobytes(), LEVEL)).decode("ascii")


def block_means(values: Array, covered: Array, level: int) -> Array:
    """Return the mean of covered pixels in each block of 2^level x 2^level; 0 where nothing is covered.

    (c, h, w) to (c, h / 2^level, w / 2^level), rounded up at the far edges.
    """
    if level == 0:
        return values
    sums, counts = (_block_sums(one, level) for one in (np.where(covered, values, 0), covered.astype(np.float64)))
    means: Array = sums / np.maximum(counts, 1)
    return means


def _block_sums(values: Array, level: int) -> Array:
    rows, columns = (np.arange(0, side, 1 << level) for side in values.shape[-2:])
    sums: Array = np.add.reduceat(np.add.reduceat(values, rows, axis=-2), columns, axis=-1)
    return sums


class Store:
    """All planes of a page, each at every level of coarseness; what is put in is known by its number."""

    def __init__(self) -> None:
        self._levels: list[tuple[dict[str, Any], ...]] = []  # text, and what the script must know to unpack it
        self._importance: list[int] = []
        self._used: list[int] = []  # level of each

    def add(self, planes: Array, covered: Array, importance: int = FIRST) -> int:
        """Put in planes, (c, h, w), which have a mean over blocks of covered pixels; return their number."""
        return self._put(importance, (_numbers(block_means(planes, covered, level)) for level in range(COARSEST + 1)))

    def add_mask(self, covered: Array) -> int:
        """Put in which pixels, (h, w), show a surface; it is never made coarse. Return its number."""
        return self._put(FIRST, [_numbers(covered[None].astype(np.float64))])

    def add_ids(self, ids: Array) -> int:
        """Put in ids, (h, w), uint32, of the upper left pixel of each block: two planes of 16 bits, the lower first."""
        return self._put(SECOND, (_words(ids[::1 << level, ::1 << level]) for level in range(COARSEST + 1)))

    def fit(self, limit: int) -> None:
        """Make planes coarser until all are within `limit` characters, the least important and the last first."""
        size = sum(map(len, self.texts()))
        steps = sorted((level + GRACE * (THIRD - importance), importance, level)
                       for importance in (FIRST, SECOND, THIRD) for level in range(1, COARSEST + 1))
        for _, importance, level in steps:
            for number, levels in reversed(list(enumerate(self._levels))):
                if size <= limit:
                    return
                if self._importance[number] == importance and level < len(levels):
                    size += len(levels[level]["text"]) - len(levels[self._used[number]]["text"])
                    self._used[number] = level

    def texts(self) -> list[str]:
        """Return what the page holds as Base64, by number."""
        return [levels[level]["text"] for levels, level in zip(self._levels, self._used, strict=True)]

    def facts(self) -> list[dict[str, Any]]:
        """Return what the script must know to unpack each, by number: channels, exponent and level."""
        return [{"channels": levels[level]["channels"], "exponent": levels[level]["exponent"], "level": level}
                for levels, level in zip(self._levels, self._used, strict=True)]

    def _put(self, importance: int, levels: Iterable[dict[str, Any]]) -> int:
        self._levels.append(tuple(levels))
        self._importance.append(importance)
        self._used.append(0)
        return len(self._levels) - 1


def _numbers(planes: Array) -> dict[str, Any]:
    bits, exponent = halves(planes)
    return {"text": packed(bits), "channels": len(bits), "exponent": exponent}


def _words(ids: Array) -> dict[str, Any]:
    words = np.stack([ids & 0xFFFF, ids >> 16]).astype(np.uint16)
    return {"text": packed(words), "channels": 2, "exponent": 0}


class SurfaceFit:
    """Sums over the pictures of a view, (3, h, w), taken one after the other."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        self._count: Array = np.zeros(shape, np.int64)
        self._sums = np.zeros((4, *shape))  # of E, L, E^2, E L

    def add(self, irradiance: Array, radiance: Array) -> None:
        """Count a picture: irradiance, W/m^2, and radiance that the camera receives; only pixels that are finite."""
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
    """Return whether a picture's radiance is what L_0 and k make of its irradiance, up to a rounding to halves."""
    emitted, reflectance = surface
    finite = np.isfinite(irradiance) & np.isfinite(radiance)
    made = np.where(finite, emitted + reflectance * np.where(finite, irradiance, 0.0), 0.0)
    right = np.where(finite, radiance, 0.0)
    floor = np.abs(right).max(initial=0.0) * 2.0**-24
    return bool((np.abs(made - right) <= TOLERANCE * np.abs(right) + floor).all())


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

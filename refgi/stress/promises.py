"""Promises of numerical stability: each with its settings and limit, and what was found of it, as data and table.

Bits are promised where a change rounds nothing, or names the same triangles otherwise; where numbers round anew, twice
the worst that was observed (docs/precision.md). Where other lights would be drawn, every texel is a light.
"""

import builtins
import json
import math
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, NamedTuple

import pydantic

from refgi.bench.results import Strict
from refgi.image import write_text
from refgi.scene import DirectionalLight, PointLight, Scene, SpotLight
from refgi.settings import Settings, from_text
from refgi.stress.changes import Change, NotPromisedError, Promise

FORMAT: Literal["stability 1"] = "stability 1"
COLUMNS = ("property", "of", "scene", "where it holds", "worst", "limit", "where the limit comes from", "cases")

Kind = Literal["exact", "derived", "observed x 2", "statistics"]


class Row(Strict):
    """One promise: what holds, where, the worst that was found and the limit."""

    part: str  # of the run, such as "kernels"
    property: str
    subject: str  # method, kernel or format
    scene: str = ""
    domain: str  # inputs for which it is promised
    figure: float  # the worst found; NaN or above the limit fails
    unit: str
    limit: float  # infinity where none is known yet
    kind: Kind  # of the limit
    source: str  # what the limit is derived from, or what it was observed on
    cases: int
    seed: int | None = None
    reproduce: str  # one line for a shell, with which the worst case comes again
    detail: str = ""
    seconds: float = 0.0

    @builtins.property
    def passed(self) -> bool:
        """Whether the worst that was found keeps the limit."""
        return self.figure <= self.limit

    @builtins.property
    def key(self) -> tuple[str, str, str, str]:
        """What tells it from other rows."""
        return self.part, self.property, self.subject, self.scene

    @pydantic.field_validator("figure", mode="before")
    @classmethod
    def _read_figure(cls, value: Any) -> Any:
        return math.nan if value is None else value

    @pydantic.field_validator("limit", mode="before")
    @classmethod
    def _read_limit(cls, value: Any) -> Any:
        return math.inf if value is None else value

    @pydantic.field_serializer("figure", "limit", when_used="json")
    def _write_none(self, value: float) -> float | None:
        return value if math.isfinite(value) else None  # JSON has neither NaN nor infinity


class Stability(Strict):
    """The rows of a run and where it was made."""

    refgi: Literal["stability 1"] = FORMAT
    environment: dict[str, Any]
    rows: tuple[Row, ...]

    @property
    def failed(self) -> tuple[Row, ...]:
        """Rows that do not keep their limit."""
        return tuple(row for row in self.rows if not row.passed)


def markdown(rows: Iterable[Row]) -> str:
    """Write rows as a table of Markdown; rows that fail bear FAIL before their figure."""
    lines = [f"| {' | '.join(COLUMNS)} |", f"|{'---|' * len(COLUMNS)}"]
    for row in rows:
        figure = f"{'' if row.passed else '**FAIL** '}{row.figure:.3g} {row.unit}".rstrip()
        cells = (row.property, row.subject, row.scene, row.domain, figure, f"{row.limit:.3g}",
                 f"{row.kind}: {row.source}", f"{row.cases:,}")
        lines.append(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |")
    return "\n".join(lines) + "\n"


def write_rows(result: Stability, path: Path) -> None:
    """Write a run's rows as JSON, whole or not at all."""
    write_text(path, json.dumps(result.model_dump(mode="json"), indent=1) + "\n")


def read_rows(path: Path) -> Stability:
    """Read what `write_rows` wrote."""
    return Stability.model_validate_json(path.read_text())


def schema_text() -> str:
    """Return the JSON Schema of stability.json, as it is kept in `refgi/stress/files`."""
    return json.dumps(Stability.model_json_schema(), indent=1) + "\n"


def strain(row: Row) -> float:
    """Return a figure over its limit, over 1 where broken; infinity for no number and for any beside a limit of 0."""
    if not math.isfinite(row.figure):
        return math.inf
    return row.figure / row.limit if row.limit > 0 else (math.inf if row.figure > 0 else 0.0)


def over_scenes(rows: Iterable[Row]) -> Iterator[Row]:
    """Join the rows of one promise on several scenes: yield the one nearest to its limit, with the cases of all."""
    found: dict[tuple[str, str, str], list[Row]] = {}
    for row in rows:
        found.setdefault((row.part, row.property, row.subject), []).append(row)
    for alike in found.values():
        worst = max(alike, key=strain)
        scene = f"{len(alike)} scenes; worst {worst.scene}" if len(alike) > 1 and worst.scene else worst.scene
        yield worst.model_copy(update={"cases": sum(row.cases for row in alike), "scene": scene,
                                       "seconds": math.fsum(row.seconds for row in alike)})


NONE: Mapping[str, Any] = MappingProxyType({})
FILE = Path(__file__).parent / "files" / "observed.json"
LEAST = 1e-6  # of the mean: a limit is never below what a handful of roundings of float32 come to
UNLIKELY = 1e-5  # probability that a right estimate is called wrong
SURFACES = "visible surfaces"

FEW = {"vpl": ("lights=192",), "truth": ("samples=128",)}  # as many as time allows
# every texel of a small map a light, every texel of a level a sample, every pixel a subsplat: nothing is drawn
EVERY = {"sii": ("pattern=all",), "multires": ("pattern=all", "coarsest=65536"), "vpl": ("pattern=all",),
         "hssil": ("sampling.pattern=all", "downsample=closest", "disc_share=1")}
SMALL_MAP: Mapping[str, Any] = MappingProxyType({"rsm_resolution": 16})
DRAWN_ANEW = ("mirrored", "two lamps of half")  # changes after which other lights or samples are drawn
SAMPLED_ANEW = ("quarter turn", "turned", "mirrored", "two lamps of half")  # changes after which paths go elsewhere
# the same where surfaces have images: a hit that is rounded otherwise reads another place, and senders are picked by it
PAINTED_ANEW = ("moved far", "moved aside", "faces permuted", "faces split", "faces unwelded", "faces doubled")

AROUND = "it looks at the picture around a pixel"
WITHOUT_MAPS = ("hssil", "truth")
BY_NUMBER = "its clusters begin at lights by number"
SILENT: Mapping[tuple[str, str], str] = MappingProxyType({
    ("multires", "cropped"): AROUND, ("hssil", "cropped"): AROUND, ("gather", "cropped"): AROUND,
    ("truth", "cropped"): "it draws by a pixel's number",
    ("gather", "mirrored"): "its fixed samples have a handedness",
    ("val", "mirrored"): BY_NUMBER, ("val", "two lamps of half"): BY_NUMBER,
})
UNBOUNDED = {"gather": "its sum of points has no clamp", "vpl": "its sum of points has no clamp"}
POWER_OF_TWO = "a factor that is a power of two rounds nothing"
SUBNORMAL = "sums that reach subnormal numbers"
SAME = "the same triangles, each owned by the same texels and rays"


class Asked(NamedTuple):
    """How a method is asked for a change."""

    promise: Promise
    settings: tuple[str, ...] = ()  # beside the defaults
    options: Mapping[str, Any] = NONE  # of both frames
    limit: float = 0.0
    kind: Kind = "exact"
    source: str = ""


def asked(method: str, change: Change, scene: Scene, size: tuple[int, int] | None = None) -> Asked:
    """Return how a method is asked for a change: promise, settings and limit, infinity where nothing was observed yet.

    Of the scene as it is: some lamps' maps do not turn with it. Without a picture's size, width and height, one that
    any promise holds for. A NotPromisedError says why the method promises nothing after this change.
    """
    if (method, change.name) in SILENT:
        raise NotPromisedError(SILENT[method, change.name])
    if method not in WITHOUT_MAPS and (why := _other_maps(change.name, scene)):
        raise NotPromisedError(why)
    if (method, change.name) == ("hssil", "mirrored") and size is not None:
        _require_whole_texels(*size)
    few = FEW.get(method, ())
    if method == "hssil" and change.name == "flux x 2^-60":
        return Asked("rounding", few, limit=LEAST, kind="derived", source=SUBNORMAL)
    if method == "truth" and _samples_anew(change.name, scene):
        return Asked("estimate", few, kind="statistics", source=f"Student's t of both estimates, {UNLIKELY:g}")
    if change.promise == "bits":
        return Asked("bits", few, source=POWER_OF_TWO if " x 2^" in change.name else SAME)
    if change.name == "hidden plane":
        return Asked("rounding", few, limit=LEAST, kind="derived", source="no light comes from it, none goes to it")
    limit, source = _observed(method, change.name)
    rounded = Asked("mean" if change.promise == "mean" else "rounding", few, NONE, limit, "observed x 2", source)
    # ranges of normals are those of x, y and z
    if change.name in DRAWN_ANEW or (method, change.name) == ("multires", "turned"):
        return rounded._replace(settings=EVERY.get(method, few), options=SMALL_MAP)
    return rounded


def _samples_anew(change: str, scene: Scene) -> bool:
    """Return whether the truth's samples are others after a change, so that both are one estimate's draws."""
    if change == "faces split" and scene.geometry.vertex_normals is not None:
        return any(any(material.specular) for material in scene.materials)  # cells of lobes bend as a face's corners do
    return change in SAMPLED_ANEW or (change in PAINTED_ANEW and any(m.textures for m in scene.materials))


def _require_whole_texels(width: int, height: int) -> None:
    """Refuse a width that texels of the coarsest level do not divide: counted from the left, they are not mirrored."""
    from refgi.sssil.levels import useful_levels
    from refgi.sssil.settings import HssilSettings

    sampling = HssilSettings().sampling
    texel = 2 ** (sampling.first_level + useful_levels((height, width), sampling) - 1)
    if width % texel:
        raise NotPromisedError(f"a width of {width} pixels is no multiple of the {texel} of its coarsest texels")


def _other_maps(change: str, scene: Scene) -> str:
    """Return why lamps' maps hold other texels after a change; nothing where they do not."""
    spots = [light.direction for light in scene.lights if isinstance(light, SpotLight)]
    if change in ("quarter turn", "turned") and any(x == z == 0 for x, _, z in spots):
        return "the axes of a spot's map are the world's where it shines along y"
    if change == "turned" and any(isinstance(light, PointLight) for light in scene.lights):
        return "a point lamp's map stands along the world's axes"
    if change == "turned" and any(isinstance(light, DirectionalLight) for light in scene.lights):
        return "a directional lamp's map is fitted to the scene's box along the world's axes"
    if change == "mirrored" and any(material.is_dielectric for material in scene.materials):
        return "the search behind glass ends on other texels"
    return ""


def surfaces(change: Change) -> Asked:
    """Return promise and limit of the surfaces that pixels show after a change."""
    if change.promise == "bits" or change.name in ("hidden plane", "two lamps of half"):
        return Asked("bits", source="no place is rounded")
    limit, source = _observed(SURFACES, change.name)
    return Asked("rounding", limit=limit, kind="observed x 2", source=source)


def settings_of(method: str, pairs: tuple[str, ...]) -> Settings:
    """Return a method's settings with some changed, such as ``lights=64``."""
    from refgi.methods import find_method

    settings: Settings = from_text(find_method(method).settings(), pairs)
    return settings


@cache
def _file() -> dict[str, Any]:
    content: dict[str, Any] = json.loads(FILE.read_text())
    return content


def _observed(subject: str, change: str) -> tuple[float, str]:
    worst = _file()["worst"].get(subject, {}).get(change)
    limit = float("inf") if worst is None else max(LEAST, 2 * worst[0])
    return limit, "nothing yet" if worst is None else f"{_file()['scenes']}; worst {worst[1]}"

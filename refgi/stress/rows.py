"""Promises of numerical stability and what was found of them: one row a promise, as data, table and schema."""

import builtins
import json
import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Literal

import pydantic

from refgi.image import write_text

FORMAT: Literal["stability 1"] = "stability 1"
COLUMNS = ("property", "of", "scene", "where it holds", "worst", "limit", "where the limit comes from", "cases")

Kind = Literal["exact", "derived", "observed x 2", "statistics"]


class _Strict(pydantic.BaseModel):
    model_config = pydantic.ConfigDict(extra="forbid", frozen=True)


class Row(_Strict):
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


class Stability(_Strict):
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
    """Return a figure over its limit; infinity for what is no number, and for any figure beside a limit of 0.

    Over 1 where the promise is broken.
    """
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

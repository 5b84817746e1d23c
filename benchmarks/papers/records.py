"""What one figure or table of a paper came to: pictures, tables, ratios, notes."""

import dataclasses
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]
Cell = str | float | None  # None: nothing is known or nothing was printed


@dataclasses.dataclass(frozen=True)
class Picture:
    """One picture: how it looks, and the linear planes behind it."""

    name: str  # file name without suffix, unique within its figure
    title: str
    said: str  # a line below
    pixels: npt.NDArray[np.uint8]  # (h, w, 3) display colours
    planes: Mapping[str, Array] = dataclasses.field(default_factory=dict)  # (h, w) each, for the EXR; empty: no EXR
    settings: Any = None  # what it was made with


@dataclasses.dataclass(frozen=True)
class Table:
    """Rows of figures; `paper` says which columns hold the paper's own."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    paper: frozenset[int] = frozenset()


class Bar(NamedTuple):
    """One ratio here and in the paper."""

    label: str
    here: float
    paper: float | None


@dataclasses.dataclass(frozen=True)
class Ratios:
    """Ratios within this run beside the same ratios in the paper."""

    title: str
    bars: tuple[Bar, ...]


@dataclasses.dataclass(frozen=True)
class Plot:
    """A drawing as an SVG element without references to anything outside."""

    svg: str
    caption: str


@dataclasses.dataclass(frozen=True)
class Figure:
    """A paper's figure or table, made again."""

    shows: str  # what the paper shows there, in a sentence
    facts: tuple[str, ...]  # what it was made from: scene, sizes, lights
    pictures: tuple[Picture, ...] = ()
    columns: int = 4  # of pictures, on a wide page
    ratios: tuple[Ratios, ...] = ()
    tables: tuple[Table, ...] = ()
    plots: tuple[Plot, ...] = ()
    notes: tuple[str, ...] = ()  # how the shape compares with the paper's, and why it differs where it does

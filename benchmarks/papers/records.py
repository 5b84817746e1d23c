"""What is made and what came of it: papers, their figures, and the pictures, tables, ratios and plots of a figure."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.errors import InputError
from refgi.types import Array

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Scale, Workbench
Cell = str | float | None  # None: nothing is known or nothing was printed
Rows = Sequence[Sequence[Cell]]


@dataclasses.dataclass(frozen=True)
class Picture:
    """One picture: how it looks, and the linear planes behind it."""

    name: str  # file name without suffix, unique within its figure
    title: str
    said: str  # a line below
    pixels: npt.NDArray[np.uint8]  # (h, w, 3) display colours
    planes: Mapping[str, Array] = dataclasses.field(default_factory=dict)  # (h, w) each, for the EXR; empty: no EXR
    settings: Any = None  # what it was made with


class Case(NamedTuple):
    """One of the ways to make a picture that a figure compares."""

    name: str
    title: str
    settings: Any
    printed: float | None = None  # frames per second in the paper
    scene: str = ""


@dataclasses.dataclass(frozen=True)
class Table:
    """Rows of numbers; columns whose names hold one of `printed` are the paper's own."""

    title: str
    columns: Sequence[str]
    rows: Rows
    printed: tuple[str, ...] = ("paper",)

    @property
    def paper(self) -> list[int]:
        """The columns that hold the paper's own numbers."""
        return [index for index, name in enumerate(self.columns) if any(word in name for word in self.printed)]


class Bar(NamedTuple):
    """One ratio here and in the paper."""

    label: str
    here: float
    paper: float | None


@dataclasses.dataclass(frozen=True)
class Ratios:
    """Ratios within this run beside the same ratios in the paper."""

    title: str
    bars: Sequence[Bar]


def relative(title: str, here: Mapping[str, float], paper: Mapping[str, float | None],
             to: str | None = None) -> Ratios:
    """Return values as shares of one of them, the first if not said otherwise, beside what was printed."""
    first = next(iter(here)) if to is None else to
    base = paper.get(first)

    def printed(label: str) -> float | None:
        value = paper.get(label)
        return None if value is None or base is None else value / base

    return Ratios(title, [Bar(label, value / here[first], printed(label)) for label, value in here.items()])


@dataclasses.dataclass(frozen=True)
class Plot:
    """A drawing as an SVG element without references to anything outside."""

    svg: str
    caption: str


@dataclasses.dataclass(frozen=True)
class Figure:
    """A paper's figure or table, made again."""

    facts: Sequence[str]  # what it was made from: scene, sizes, lights
    pictures: Sequence[Picture] = ()
    ratios: Sequence[Ratios] = ()
    tables: Sequence[Table] = ()
    plots: Sequence[Plot] = ()
    notes: Sequence[str] = ()  # how the shape compares with the paper's, and why it differs where it does


class Entry(NamedTuple):
    """A figure or table of a paper and the function that makes it again."""

    key: str  # as on the command line: "fig8", "table1"
    label: str  # as in the paper: "Figure 8"
    title: str
    shows: str  # what the paper shows there, in a sentence
    make: "Callable[[Workbench], Figure]"
    columns: int = 4  # of pictures, on a wide page


class Paper(NamedTuple):
    """A paper by its short name; its figures are imported when they are loaded."""

    name: str
    title: str
    citation: str

    def load(self) -> Sequence[Entry]:
        """Return the paper's figures and tables, in the order in which they are shown."""
        entries: Sequence[Entry] = import_module(f"benchmarks.papers.{self.name}").FIGURES
        return entries


PAPERS = {paper.name: paper for paper in (
    Paper("sii", "Splatting Indirect Illumination", "Carsten Dachsbacher and Marc Stamminger, I3D 2006"),
    Paper("multires", "Interactive Indirect Illumination Using Adaptive Multiresolution Splatting",
          "Greg Nichols and Chris Wyman, IEEE TVCG 2010"),
    Paper("val", "Real-time Indirect Illumination with Clustered Visibility",
          "Zhao Dong, Thorsten Grosch, Tobias Ritschel, Jan Kautz and Hans-Peter Seidel, VMV 2009"),
    Paper("hssil", "Hierarchical Screen-Space Indirect Illumination For Video Games",
          "Cyril Soler, Olivier Hoel, Franck Rochet, Frederic Jay and Nicolas Holzschuch, INRIA RR-7162, 2009"))}


def find_paper(name: str) -> Paper:
    """Return a paper of the table, or raise InputError."""
    if name not in PAPERS:
        raise InputError(f"paper: expected one of {', '.join(PAPERS)}, got {name!r}")
    return PAPERS[name]


def choose(paper: Paper, only: Sequence[str] | None) -> list[Entry]:
    """Return the entries that are asked for (None: all), in the paper's order; raise InputError for unknown keys."""
    entries = list(paper.load())
    known = [entry.key for entry in entries]
    wrong = [key for key in only or () if key not in known]
    if wrong or (only is not None and not only):
        raise InputError(f"only: expected some of {', '.join(known)}, got {', '.join(map(repr, wrong)) or 'none'}")
    return [entry for entry in entries if only is None or entry.key in only]


@dataclasses.dataclass(frozen=True)
class Outcome:
    """One figure or table: what it came to, or why it did not."""

    entry: Entry
    figure: Figure | None
    failure: str  # empty where there is a figure
    seconds: float  # to make it, with compiling and references


@dataclasses.dataclass(frozen=True)
class Reproduction:
    """A paper's figures made again, as far as the run has come."""

    paper: Paper
    scale: "Scale"
    asked: int  # how many figures
    outcomes: Sequence[Outcome]
    environment: Mapping[str, Any]

    @property
    def failures(self) -> dict[str, str]:
        """Why figures could not be made, by their keys."""
        return {outcome.entry.key: outcome.failure for outcome in self.outcomes if outcome.figure is None}

    @property
    def is_sound(self) -> bool:
        """Whether every figure that was asked for was made."""
        return len(self.outcomes) == self.asked and not self.failures

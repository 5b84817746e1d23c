"""The table of papers. A new paper is one folder here and one line."""

from collections.abc import Callable, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, NamedTuple

from refgi.errors import InputError

if TYPE_CHECKING:
    from benchmarks.papers.records import Figure
    from benchmarks.papers.workbench import Workbench


class Entry(NamedTuple):
    """A figure or table of a paper and the function that makes it again."""

    key: str  # as on the command line: "fig8", "table1"
    label: str  # as in the paper: "Figure 8"
    title: str
    make: "Callable[[Workbench], Figure]"


class Paper(NamedTuple):
    """A paper by its short name; its figures are imported when they are loaded."""

    name: str
    title: str
    citation: str
    home: str  # module that holds FIGURES

    def load(self) -> Sequence[Entry]:
        """Return the paper's figures and tables, in the order in which they are shown."""
        entries: Sequence[Entry] = import_module(self.home).FIGURES
        return entries


PAPERS = {
    paper.name: paper
    for paper in (
        Paper("sii", "Splatting Indirect Illumination", "Carsten Dachsbacher and Marc Stamminger, I3D 2006",
              "benchmarks.papers.sii"),
        Paper("multires", "Interactive Indirect Illumination Using Adaptive Multiresolution Splatting",
              "Greg Nichols and Chris Wyman, IEEE TVCG 2010", "benchmarks.papers.multires"),
        Paper("val", "Real-time Indirect Illumination with Clustered Visibility",
              "Zhao Dong, Thorsten Grosch, Tobias Ritschel, Jan Kautz and Hans-Peter Seidel, VMV 2009",
              "benchmarks.papers.val"),
        Paper("hssil", "Hierarchical Screen-Space Indirect Illumination For Video Games",
              "Cyril Soler, Olivier Hoel, Franck Rochet, Frederic Jay and Nicolas Holzschuch, INRIA RR-7162, 2009",
              "benchmarks.papers.hssil"),
    )
}


def find_paper(name: str) -> Paper:
    """Return a paper of the table.

    Parameters
    ----------
    name : str
        Its short name.

    Returns
    -------
    Paper
        The table's row.

    Raises
    ------
    InputError
        If there is none of that name.
    """
    if name not in PAPERS:
        raise InputError(f"paper: expected one of {', '.join(PAPERS)}, got {name!r}")
    return PAPERS[name]


def choose(paper: Paper, only: Sequence[str] | None) -> list[Entry]:
    """Return the entries that are asked for, in the paper's order.

    Parameters
    ----------
    paper : Paper
        The paper.
    only : sequence of str or None
        Keys of entries; None for all.

    Returns
    -------
    list of Entry
        One or more.

    Raises
    ------
    InputError
        If a key is unknown or none is given.
    """
    entries = list(paper.load())
    known = [entry.key for entry in entries]
    wrong = [key for key in only or () if key not in known]
    if wrong or (only is not None and not only):
        raise InputError(f"only: expected some of {', '.join(known)}, got {', '.join(map(repr, wrong)) or 'none'}")
    return [entry for entry in entries if only is None or entry.key in only]

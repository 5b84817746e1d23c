"""What became of a paper: each figure that was asked for, made or failed, and on what."""

import dataclasses
from collections.abc import Mapping
from typing import Any

from benchmarks.papers.catalogue import Entry, Paper
from benchmarks.papers.records import Figure
from benchmarks.papers.workbench import Scale


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
    scale: Scale
    asked: int  # how many figures
    outcomes: tuple[Outcome, ...]
    environment: Mapping[str, Any]

    @property
    def failures(self) -> dict[str, str]:
        """Why figures could not be made, by their keys."""
        return {outcome.entry.key: outcome.failure for outcome in self.outcomes if outcome.figure is None}

    @property
    def is_sound(self) -> bool:
        """Whether every figure that was asked for was made."""
        return len(self.outcomes) == self.asked and not self.failures

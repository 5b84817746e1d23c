"""Which settings of which methods are run: a grid as TOML, and tracks that a search walks along one key.

One table a method, or several as an array of tables; each key holds a value or a list of values, and all combinations
are run. `[truth]` has the key `passes`: after how many the path tracer is stopped, for the line to beat.
"""

import itertools
import json
import math
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from refgi.errors import InputError, expect, first_faults
from refgi.methods import find_method
from refgi.scene.files import read_toml
from refgi.settings import Settings, from_text

FILES = Path(__file__).with_name("files")
TRUTH = "truth"
MOST_CHOICES = 10_000  # of one table: more would run for weeks


class Choice(NamedTuple):
    """One method with one choice of settings."""

    method: str
    changes: tuple[str, ...]  # "key=value" beside the defaults
    settings: Settings

    @property
    def label(self) -> str:
        """What is said of it: the changes."""
        return ", ".join(self.changes) or "default"


class Grid(NamedTuple):
    """What is run on a scene."""

    choices: tuple[Choice, ...]
    passes: tuple[int, ...]  # of the truth, stopped early


def built_in(quick: bool) -> Grid:
    """Return the grid that refgi comes with; the quick one has three settings a method in place of ten and more."""
    return read_grid(FILES / ("quick.toml" if quick else "grid.toml"))


def read_grid(file: Path) -> Grid:
    """Read a grid from TOML; an InputError names all unknown methods and keys and values that are not usable."""
    return grid_of(read_toml(file), file)


def grid_of(tables: Mapping[str, Any], file: Path) -> Grid:
    """Return the grid of tables by method, each choice once; an InputError names all that is not usable in `file`."""
    passes = _passes(tables.get(TRUTH, {}), file)
    choices: dict[tuple[str, tuple[str, ...]], Choice] = {}
    faults = []
    for name, entry in tables.items():
        for table in [] if name == TRUTH else entry if isinstance(entry, list) else [entry]:
            for changes in _combinations(table, f"{file}: {name}"):
                try:
                    method = find_method(name)
                    settings = from_text(method.settings(), changes)
                    choices[method.name, changes] = Choice(method.name, changes, settings)
                except InputError as error:
                    faults.append(f"{file}: {name}: {error}")
    if faults:
        raise InputError(first_faults(list(dict.fromkeys(faults))), file=str(file))
    return Grid(tuple(choices.values()), passes)


def chosen(grid: Grid, methods: Sequence[str] | None) -> Grid:
    """Return the part of a grid that is of some methods, all where absent; InputError if it has none of one."""
    if methods is None:
        return grid
    names = _found(methods, grid.choices, "some that the grid has settings of")
    return grid._replace(choices=tuple(choice for choice in grid.choices if choice.method in names))


def _found(methods: Sequence[str], there: Iterable[Any], expected: str) -> set[str]:
    """Return names of methods, all of which are those of something that is there."""
    names = {find_method(name).name for name in methods}
    missing = names - {one.method for one in there}
    expect(not missing, "methods", expected, ", ".join(sorted(missing)))
    return names


def _passes(table: Mapping[str, Any], file: Path) -> tuple[int, ...]:
    expect(set(table) <= {"passes"}, f"{file}: {TRUTH}", "the key passes alone", ", ".join(map(str, table)))
    passes = table.get("passes", [])
    good = isinstance(passes, list) and all(isinstance(one, int) and one >= 2 for one in passes)
    expect(good, f"{file}: {TRUTH}.passes", "whole numbers of 2 and more", passes)
    return tuple(sorted(set(passes)))


def _combinations(table: Any, where: str) -> Iterable[tuple[str, ...]]:
    expect(isinstance(table, dict), where, "a table of settings", type(table).__name__)
    lists = [[f"{key}={value_text(value)}" for value in (values if isinstance(values, list) else [values])]
             for key, values in sorted(flat(table).items())]
    count = math.prod(map(len, lists))
    expect(count <= MOST_CHOICES, where, f"at most {MOST_CHOICES:,} combinations", f"{count:,}")
    return itertools.product(*lists)


def flat(table: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return values by their dotted keys: TOML reads `a.b = 1` as a table in a table."""
    found: dict[str, Any] = {}
    for key, value in table.items():
        found |= flat(value, f"{prefix}{key}.") if isinstance(value, dict) else {f"{prefix}{key}": value}
    return found


def value_text(value: Any) -> str:
    """Return a value as `--set` takes it."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def toml_line(key: str, value: Any) -> str:
    """Return one line of a table: a list, a number, true or false as it is, any other text in quotes.

    >>> [toml_line("a.b", "0.5"), toml_line("kind", "csm"), toml_line("size", [64, 48])]
    ['a.b = 0.5', 'kind = "csm"', 'size = [64, 48]']
    """
    try:
        tomllib.loads(f"value = {value}")
        text = str(value)
    except tomllib.TOMLDecodeError:
        text = json.dumps(str(value))
    return f"{key} = {json.dumps(value) if isinstance(value, list) else text}"


STEP = math.sqrt(2.0)
WORDS = ("along", "from", "to")
WAITS = "waits"


class Track(NamedTuple):
    """Choices of one method, from the fastest to the slowest."""

    rungs: tuple[Choice, ...]
    values: tuple[int, ...]  # of the key that changes along the track
    waits: bool = False  # until another track of the method comes to the first value without meeting the wish

    @property
    def method(self) -> str:
        """The method of all rungs."""
        return self.rungs[0].method


def built_in_tracks(methods: Sequence[str] | None = None) -> tuple[Track, ...]:
    """Return the tracks that refgi comes with, of some methods or all; InputError if one has none."""
    tracks = read_tracks(FILES / "tracks.toml")
    if methods is None:
        return tracks
    names = _found(methods, tracks, "some that have tracks")
    return tuple(track for track in tracks if track.method in names)


def read_tracks(file: Path) -> tuple[Track, ...]:
    """Read tracks from TOML: tables with `along` (a key), `from`, `to` (its range), `waits` and other keys' values."""
    found = []
    for name, tables in read_toml(file).items():
        for table in tables if isinstance(tables, list) else [tables]:
            try:
                found.append(_track(name, table))
            except InputError as error:
                raise InputError(f"{file}: {name}: {error}", file=str(file), key=error.key) from error
    return tuple(found)


def _track(name: str, table: Mapping[str, Any]) -> Track:
    for word in WORDS:
        expect(word in table, word, "a value", "none")
    key, values = str(table["along"]), _values(table["from"], table["to"])
    expect(isinstance(table.get(WAITS, False), bool), WAITS, "true or false", table.get(WAITS))
    fixed = [f"{other}={value_text(value)}" for other, value in flat(table).items() if other not in (*WORDS, WAITS)]
    method = find_method(name)
    changes = [(f"{key}={value}", *fixed) for value in values]
    rungs = tuple(Choice(method.name, one, from_text(method.settings(), one)) for one in changes)
    return Track(rungs, values, table.get(WAITS, False))


def _values(least: Any, most: Any) -> tuple[int, ...]:
    """Return whole numbers a factor of the root of 2 apart."""
    for key, value in (("from", least), ("to", most)):
        expect(isinstance(value, int) and value >= 1, key, "a whole number from 1", value)
    expect(most >= least, "to", f"{least} or more", most)
    steps = math.floor(math.log(most / least) / math.log(STEP) + 1e-9)
    return tuple(dict.fromkeys(round(least * STEP**step) for step in range(steps + 1)))

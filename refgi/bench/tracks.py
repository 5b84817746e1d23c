"""Tracks: settings of a method that get slower and nearer along one key, for a search that need not run them all."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from refgi.bench.grid import FILES, Choice, flat, value_text
from refgi.errors import InputError, expect
from refgi.methods import find_method
from refgi.scene.files import read_toml
from refgi.settings import from_text

STEP = math.sqrt(2.0)
WORDS = ("along", "from", "to")


class Track(NamedTuple):
    """Choices of one method, from the fastest to the slowest."""

    rungs: tuple[Choice, ...]
    values: tuple[int, ...]  # of the key that changes along the track

    @property
    def method(self) -> str:
        """The method of all rungs."""
        return self.rungs[0].method


def built_in_tracks(methods: Sequence[str] | None = None) -> tuple[Track, ...]:
    """Return the tracks that refgi comes with, of all methods where absent.

    InputError if a method is unknown or has no track.
    """
    tracks = read_tracks(FILES / "tracks.toml")
    if methods is None:
        return tracks
    names = {find_method(name).name for name in methods}
    missing = names - {track.method for track in tracks}
    expect(not missing, "methods", "some that have tracks", ", ".join(sorted(missing)))
    return tuple(track for track in tracks if track.method in names)


def read_tracks(file: Path) -> tuple[Track, ...]:
    """Read tracks from TOML, in the file's order.

    An array of tables a method, each with `along` (a key), `from` and `to` (its least and largest value), and other
    keys with their values. InputError if the file cannot be read, a method or key is unknown or a value not usable.
    """
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
    fixed = [f"{other}={value_text(value)}" for other, value in flat(table).items() if other not in WORDS]
    method = find_method(name)
    changes = [(f"{key}={value}", *fixed) for value in values]
    return Track(tuple(Choice(method.name, one, from_text(method.settings(), one)) for one in changes), values)


def _values(least: Any, most: Any) -> tuple[int, ...]:
    """Return whole numbers a factor of the root of 2 apart."""
    for key, value in (("from", least), ("to", most)):
        expect(isinstance(value, int) and value >= 1, key, "a whole number from 1", value)
    expect(most >= least, "to", f"{least} or more", most)
    steps = math.floor(math.log(most / least) / math.log(STEP) + 1e-9)
    return tuple(dict.fromkeys(round(least * STEP**step) for step in range(steps + 1)))

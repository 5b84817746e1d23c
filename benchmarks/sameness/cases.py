"""Cases out of the tables: every method on every scene as it is, and every setting changed."""

from collections.abc import Iterator
from typing import Any, NamedTuple

from benchmarks.sameness.rows import Row
from benchmarks.sameness.scenes import scene_names
from benchmarks.sameness.settings import settings_of
from benchmarks.sameness.tables import TABLES
from refgi.errors import InputError
from refgi.methods import METHODS

DTYPES = ("float32", "float64")
DEFAULTS = {"truth": {"samples": 24}}  # where the default takes long
GLOSSY = ("stage", "ring")  # scenes that show a surface with a lobe
LOBES: dict[str, tuple[dict[str, Any], ...]] = {
    "sii": ({"lights": 96}, {"lights": 96, "cut": "relative"}, {"lights": 96, "clamp": "distance", "clamp_value": 0.1}),
    "multires": ({"lights": 96}, {"lights": 24, "subsplats": "irradiance"}, {"lights": 96, "subsplats": "error"}),
    "val": ({"lights": 96, "clusters": 5}, {"lights": 96, "clusters": 5, "visibility": "pcf"}),
    "hssil": ({"radius": 5.0, "samples": 16}, {"radius": 5.0, "pattern": "all"},
              {"radius": 5.0, "samples": 16, "visibility": "rays"},
              {"radius": 5.0, "samples": 16, "visibility": "bitmask"}),
    "gather": ({"samples": 96},), "vpl": ({"lights": 96},), "truth": ({"samples": 24},)}
AS_IS, BASE = "default", "base"


class Case(NamedTuple):
    """One picture."""

    name: str
    method: str
    scene: str
    dtype: str
    flat: dict[str, Any]
    unlike: tuple[str, ...] = ()  # cases whose picture is another one
    part: str = "irradiance"  # or "lobes", those of receivers by indirect light


def all_cases() -> list[Case]:
    """Return every case once, those of one scene together."""
    found: dict[str, Case] = {}
    for case in (*_as_they_are(), *_varied(), *_lobes()):
        known = found.setdefault(case.name, case)
        found[case.name] = known._replace(unlike=tuple(dict.fromkeys((*known.unlike, *case.unlike))))
    return sorted(found.values(), key=lambda case: (case.scene, case.dtype))


def _as_they_are() -> Iterator[Case]:
    for method in METHODS:
        for scene in scene_names():
            for dtype in DTYPES:
                yield Case(f"{method}/{scene}/{dtype}/{AS_IS}", method, scene, dtype, DEFAULTS.get(method, {}))


def _lobes() -> Iterator[Case]:
    """Yield the lobes of glossy receivers, by what reaches them: each way to sum them once."""
    for method, ways in LOBES.items():
        for scene in GLOSSY:
            for dtype in DTYPES:
                for flat in ways:
                    yield Case(f"{method}/{scene}/{dtype}/lobes,{described(flat)}", method, scene, dtype, dict(flat),
                               part="lobes")


def _varied() -> Iterator[Case]:
    for method, table in TABLES.items():
        for row in table.rows:
            for scene in row.on:
                for dtype in DTYPES:
                    yield from _of_row(method, table.base, row, f"{method}/{scene}/{dtype}")


def _of_row(method: str, base: dict[str, Any], row: Row, where: str) -> Iterator[Case]:
    """Yield what the values are compared to, and each value; those of one row differ from each other as well."""
    _, scene, dtype = where.split("/")
    earlier = []
    try:
        usual = settings_of(method, **base | row.companions)
        earlier.append(f"{where}/{described(row.companions)}")
        yield Case(earlier[0], method, scene, dtype, base | row.companions)
    except InputError:  # companions that cannot be without the value
        usual = None
    for value in row.values:
        flat = row.companions | {row.field: value}
        if settings_of(method, **base | flat) == usual:  # the default, in a table that methods share
            continue
        name = f"{where}/{described(flat)}"
        yield Case(name, method, scene, dtype, base | flat, () if row.same else tuple(earlier))
        earlier.append(name)


def described(flat: dict[str, Any]) -> str:
    """Return settings as text, by name: `terms=8`."""
    return ",".join(f"{name}={_text(flat[name])}" for name in sorted(flat)) or BASE


def _text(value: Any) -> str:
    if isinstance(value, str):
        return value or "empty"
    return str(value).lower() if isinstance(value, bool) or value is None else repr(value)

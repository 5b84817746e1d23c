"""Whether the tables have every setting of every method, and of each every name."""

from benchmarks.sameness.rows import Table
from benchmarks.sameness.settings import SETS, TRANSLATIONS, choice_of, key_of, names_of, translated
from benchmarks.sameness.tables import TABLES


def gaps() -> list[str]:
    """Return what no case of the tables covers, and what they name without need."""
    return [gap for method, table in TABLES.items() for gap in _gaps_of(method, table)]


def _gaps_of(method: str, table: Table) -> list[str]:
    wanted = names_of(method)
    tried: dict[str, set[object]] = {}
    for row in table.rows:
        for value in row.values:
            companions = row.companions if method in TRANSLATIONS else {}
            for name, one in translated(method, companions | {row.field: value}).items():
                key = key_of(method, name)
                tried.setdefault(key, set()).update(one.split("+") if name in SETS else [one])
                if chosen := choice_of(method, key):
                    tried.setdefault(chosen[0], set()).add(chosen[1])
    excluded = {key_of(method, name) for name in table.excluded}
    excluded |= {name for name in wanted if name.startswith(table.borrowed)}
    found = [f"{method}: no case has {name}" for name in wanted if name not in tried and name not in excluded]
    found += [f"{method}: {name} is no setting" for name in (*tried, *excluded) if name not in wanted]
    return found + [f"{method}: no case has {name} {value!r}" for name, values in wanted.items()
                    if name not in excluded for value in sorted(values - tried.get(name, set()), key=str)]

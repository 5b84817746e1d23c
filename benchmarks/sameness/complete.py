"""Whether the tables have every setting of every method, and of each every name."""

from benchmarks.sameness.rows import Table
from benchmarks.sameness.settings import key_of, names_of, renamed_value
from benchmarks.sameness.tables import TABLES


def gaps() -> list[str]:
    """Return what no case of the tables covers, and what they name without need."""
    return [gap for method, table in TABLES.items() for gap in _gaps_of(method, table)]


def _gaps_of(method: str, table: Table) -> list[str]:
    wanted = names_of(method)
    tried: dict[str, set[object]] = {}
    for row in table.rows:
        for value in row.values:
            several = row.field in ("as_published", "criteria")
            values = value.split("+") if several else [renamed_value(method, row.field, value)]
            tried.setdefault(key_of(method, row.field), set()).update(values)
    excluded = {key_of(method, name) for name in table.excluded}
    found = [f"{method}: no case has {name}" for name in wanted if name not in tried and name not in excluded]
    found += [f"{method}: {name} is no setting" for name in (*tried, *excluded) if name not in wanted]
    return found + [f"{method}: no case has {name} {value!r}" for name, values in wanted.items()
                    if name not in excluded for value in sorted(values - tried.get(name, set()), key=str)]

"""The language of the tables: a row varies one setting, with the companions without which it has no effect."""

from typing import Any, NamedTuple

USUAL = ("cornell_box", "stage")  # diffuse, and with a glossy vase


class Row(NamedTuple):
    """One setting, its other values, and where they are tried."""

    field: str
    values: tuple[Any, ...]
    companions: dict[str, Any]
    on: tuple[str, ...]
    same: str  # why a value may leave the picture as it is; empty: it must not


class Table(NamedTuple):
    """All cases of one method."""

    base: dict[str, Any]  # what the rows start from, for speed
    rows: list[Row]
    excluded: dict[str, str] = {}  # setting: why no case has it  # noqa: RUF012
    borrowed: tuple[str, ...] = ()  # starts of keys of parts that are another method's, whose table has their cases


def vary(field: str, *values: Any, on: tuple[str, ...] = USUAL, same: str = "", **companions: Any) -> Row:
    """Return a row of a table."""
    return Row(field, values, companions, on, same)

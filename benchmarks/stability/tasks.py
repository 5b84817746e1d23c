"""What a part of the stability run is made of."""

from collections.abc import Callable, Iterable
from typing import NamedTuple

from refgi.stress.rows import Row

Tell = Callable[[str], None]


class Task(NamedTuple):
    """Some rows that are made together; a run that was interrupted goes on after the last finished one."""

    name: str  # unique in its part
    run: Callable[[Tell], Iterable[Row]]

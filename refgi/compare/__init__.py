"""Methods judged against path tracing: figures of error, one comparison, its files and its page.

`metrics` has the figures and `outcome` puts each beside what the truth's own noise gives; `comparison.compare` runs
every method on one scene; `results` writes EXR, PNG and results.json; `report` writes the one-file page. The package
itself can be called: `refgi.compare(...)` is `refgi.compare.compare(...)`.
"""

import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from refgi.compare.comparison import compare
    from refgi.compare.outcome import Comparison, Figure, Measurement, MethodResult, measure

__all__ = ["Comparison", "Figure", "Measurement", "MethodResult", "compare", "measure"]

_HOME = {
    "Comparison": "outcome", "Figure": "outcome", "Measurement": "outcome", "MethodResult": "outcome",
    "compare": "comparison", "measure": "outcome",
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'refgi.compare' has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"refgi.compare.{_HOME[name]}"), name)


class _Callable(ModuleType):
    """The package under the name of its main function: importing it must not hide `refgi.compare`."""

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        from refgi.compare.comparison import compare

        return compare(*args, **kwargs)


sys.modules[__name__].__class__ = _Callable

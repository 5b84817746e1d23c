"""The cases of the kits, by id. Ids are stable: a case that changes its meaning gets another id."""

from collections.abc import Callable
from importlib import import_module

from refgi.errors import InputError
from refgi.vectors.spec import Case

# each with QUICK and FULL: functions without arguments that make a case, by its id
MODULES = ("splat", "multires", "visibility", "hssil")


def kit_cases(kit: str) -> dict[str, Callable[[], Case]]:
    """Return what makes the cases of the kit "quick" or "full", by id; the full kit holds the quick one.

    InputError if there is no kit of that name.
    """
    if kit not in ("quick", "full"):
        raise InputError(f"kit: expected 'quick' or 'full', got {kit!r}", key="kit")
    return {id: make for module in MODULES for name in ("QUICK", "FULL")[: 1 + (kit == "full")]
            for id, make in getattr(import_module(f"refgi.vectors.cases.{module}"), name).items()}

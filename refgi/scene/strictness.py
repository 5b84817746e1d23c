"""Whether readers refuse what a picture can do without: an absent material file or texture, an index of no normal."""

import contextlib
import warnings
from collections.abc import Iterator
from contextvars import ContextVar

from refgi.errors import InputError, RefgiWarning

_strict: ContextVar[bool] = ContextVar("_strict", default=False)


@contextlib.contextmanager
def strictness(strict: bool) -> Iterator[None]:
    """Let readers inside the block refuse (true) or pass over what they could do without."""
    token = _strict.set(strict)
    try:
        yield
    finally:
        _strict.reset(token)


def is_strict() -> bool:
    """Return whether readers refuse what they could do without."""
    return _strict.get()


def tolerate(text: str) -> None:
    """Warn of what is passed over; raise `InputError` instead where readers are strict."""
    if is_strict():
        raise InputError(text)
    warnings.warn(RefgiWarning(text), stacklevel=5)

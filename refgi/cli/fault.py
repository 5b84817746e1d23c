"""An exception that ended a run, as exit code, message, file and key."""

from collections.abc import Iterator

import click

from refgi.cli.session import FAILED, INTERRUPTED, USAGE, Fault
from refgi.errors import InputError, RefgiError


def fault_of(error: BaseException, *, debug: bool = False) -> Fault:
    """Return what went wrong, for people and for programs.

    Parameters
    ----------
    error : BaseException
        What was raised.
    debug : bool
        Whether the traceback is shown anyway.

    Returns
    -------
    Fault
        One line of message, or one for each fault of a file.
    """
    if isinstance(error, click.exceptions.Abort | KeyboardInterrupt):
        return Fault(INTERRUPTED, "interrupted")
    if isinstance(error, click.UsageError):
        asked = error.ctx.command_path if error.ctx else "refgi"
        return Fault(USAGE, f"{_one_line(error.format_message())} (see {asked} --help)", key=_option(error))
    if isinstance(error, click.ClickException):
        return Fault(USAGE, _one_line(error.format_message()))
    if isinstance(error, RefgiError):
        return Fault(USAGE, str(error), *_place(error))
    if isinstance(error, MemoryError):
        return Fault(USAGE, f"out of memory: {_one_line(str(error)) or 'try a smaller --size'}")
    hint = "" if debug else " (a fault of refgi; --debug shows where)"
    return Fault(FAILED, f"unexpected {type(error).__name__}: {_one_line(str(error))}{hint}")


def _option(error: click.UsageError) -> str | None:
    """Return the option or argument that click refuses."""
    if isinstance(error, click.NoSuchOption | click.BadOptionUsage):
        return error.option_name
    if isinstance(error, click.BadParameter) and error.param is not None:
        return error.param.opts[-1] if isinstance(error.param, click.Option) else error.param.human_readable_name
    return None


def _place(error: RefgiError) -> tuple[str | None, str | None]:
    """Return file and key of an error, as far as it or one that it arose from says them.

    A file's error names file and key at the start of its message: `file: key: expected ...`.
    """
    said = [one for one in _chain(error) if isinstance(one, InputError)]
    file = next((one.file for one in said if one.file is not None), None)
    key = next((one.key for one in said if one.key is not None), None)
    prefix = f"{file}: "
    if key is None and str(error).startswith(prefix) and "\n" not in str(error):
        start, colon, _ = str(error).removeprefix(prefix).partition(": ")
        key = start if colon and " " not in start else None
    key = None if key == file or key is None else key.removeprefix(prefix)
    return file, key


def _chain(error: BaseException | None) -> Iterator[BaseException]:
    while error is not None:
        yield error
        error = error.__cause__


def _one_line(text: str) -> str:
    return " ".join(text.split())

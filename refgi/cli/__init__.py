"""The command `refgi`: verbs are loaded when they are used; the only place that prints, asks or exits.

Results go to stdout, everything else to stderr. Exit codes: 0 done, 1 a check failed (or a fault of refgi itself),
2 usage or input error, 130 interrupted, 143 terminated.
"""

import atexit
import contextlib
import os
import sys
import threading
from collections.abc import Sequence
from typing import NoReturn

from refgi.cli.group import SIGNALLED, VerbGroup


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line, that of the process where absent, and exit."""
    _open_standard_files()
    try:
        VerbGroup.refgi().main(arguments, prog_name="refgi")
    except SystemExit as end:
        if end.code in SIGNALLED:
            _leave(end.code)
        raise


def _open_standard_files() -> None:
    """Put the null device where stdin, stdout or stderr are closed, lest a picture's file takes their number."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free
    if sys.stderr is None:  # of which a message to nobody would otherwise go to stdout
        sys.stderr = os.fdopen(2, "w", closefd=False)


def _leave(code: int) -> NoReturn:
    """End like the interpreter, but take no object apart: a signal may have left any, as a compiler's, half made."""
    threading._shutdown()  # type: ignore[attr-defined]
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()
    os._exit(code)

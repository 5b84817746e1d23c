"""The command's frame: verbs loaded when used, errors and warnings as one line each, exit codes.

What the libraries would fail at is refused before they are loaded: a number of threads that Numba cannot start, and a
limit of address space (`ulimit -v`) too small for them. Without room OpenBLAS asks for memory without end, and LLVM and
Embree end the process with no word of refgi's.
"""

import contextlib
import importlib
import os
import signal
import sys
import threading
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NoReturn

import click

from refgi import __version__
from refgi.cli.session import DONE, FAILED, INTERRUPTED, TERMINATED, USAGE, Fault, Session
from refgi.errors import InputError, RefgiError, expect, nearest

COMPUTING = frozenset({"render", "sequence", "compare", "bench", "batch", "choose", "vectors", "explain", "warm"})
LIBRARIES = 600 << 20  # bytes: with NumPy, SciPy, LLVM, Embree and a small picture 650 MiB in all, some of it loaded
KERNELS = 64 << 20  # ... where the libraries are loaded; a small picture by sii takes 32 MiB
NO_THREAD = "can't start new thread"  # what Python says where a thread's stack finds no room

THREADS, MOST_THREADS = "NUMBA_NUM_THREADS", 4096  # a million end the process


def require_threads() -> None:
    """Refuse (InputError) a value of NUMBA_NUM_THREADS that is no whole number, or that Numba cannot start."""
    asked = os.environ.get(THREADS)
    usable = asked is None or (asked.strip().isdecimal() and 1 <= int(asked[:20]) <= MOST_THREADS)
    expect(usable, THREADS, f"a whole number from 1 to {MOST_THREADS}", asked)


def require_room(verb: str) -> None:
    """Refuse (InputError) a verb that computes where the address space left is too small for what it loads."""
    left = _left()
    needed = KERNELS if "scipy.spatial" in sys.modules else LIBRARIES
    if verb in COMPUTING and left is not None and left < needed:
        raise InputError(f"out of memory: the limit of address space (ulimit -v) leaves {max(0, left) >> 20} MiB, "
                         f"{verb} needs {needed >> 20} or more")


def _left() -> int | None:
    """Return the bytes of address space below a limit; None where there is none or that cannot be told."""
    try:
        import resource

        limit = resource.getrlimit(resource.RLIMIT_AS)[0]
        pages = int(Path("/proc/self/statm").read_text().split()[0])
    except (ImportError, OSError, ValueError):
        return None
    return None if limit == resource.RLIM_INFINITY else limit - pages * resource.getpagesize()


# by name the module of this package that has it
VERBS = {"scenes": "short", "render": "render", "sequence": "sequence", "compare": "judge", "bench": "judge",
         "batch": "batch", "choose": "judge", "report": "short", "vectors": "vectors", "check": "judge",
         "stress": "short", "explain": "explain", "settings": "short", "warm": "short", "info": "short"}
HELP = """Indirect light by four published methods on the CPU, judged by path tracing.

SCENE is a built-in name such as cornell_box (see `refgi scenes`), a scene file (.json), or a mesh (.glb, .gltf, .obj,
.ply) with camera and light options. Results go to stdout, everything else to stderr.

Exit codes: 0 done, 1 a check failed, 2 usage or input error, 130 interrupted, 143 terminated.
"""


SIGNALLED = (INTERRUPTED, TERMINATED)  # exit codes
_interrupts: list[BaseException] = []  # kept, so that no frame they came through is taken apart: see `refgi.cli.main`


class Terminated(KeyboardInterrupt):
    """SIGTERM, by which systems ask a program to end: cleaned up after like an interrupt from the keyboard."""


def fault_of(error: BaseException, *, debug: bool = False) -> Fault:
    """Return what went wrong: a line of message, or one for each fault of a file; `debug` shows the traceback."""
    if isinstance(error, Terminated):
        return Fault(TERMINATED, "terminated")
    if isinstance(error, click.exceptions.Abort | KeyboardInterrupt):
        return Fault(INTERRUPTED, "interrupted")
    if isinstance(error, click.UsageError):
        asked = error.ctx.command_path if error.ctx else "refgi"
        return Fault(USAGE, f"{_one_line(error.format_message())} (see {asked} --help)", key=_option(error))
    if isinstance(error, click.ClickException):
        return Fault(USAGE, _one_line(error.format_message()))
    if isinstance(error, RefgiError):
        return Fault(USAGE, str(error), *_place(error))
    if isinstance(error, MemoryError) or NO_THREAD in str(error):
        return Fault(USAGE, f"out of memory: {_one_line(str(error)) or 'try a smaller --size'}")
    hint = "" if debug else " (a fault of refgi; REFGI_DEBUG=1 shows where)"
    return Fault(FAILED, f"unexpected {type(error).__name__}: {_one_line(str(error))}{hint}")


def _option(error: click.UsageError) -> str | None:
    """Return the option or argument that click refuses."""
    if isinstance(error, click.NoSuchOption | click.BadOptionUsage):
        return error.option_name
    if isinstance(error, click.BadParameter) and error.param is not None:
        return error.param.opts[-1] if isinstance(error.param, click.Option) else error.param.human_readable_name
    return None


def _place(error: RefgiError) -> tuple[str | None, str | None]:
    """Return file and key of an error or one that it arose from, or of a message `file: key: expected ...`."""
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


class VerbGroup(click.Group):
    """A group of verbs, each the command `_VERB` of a module of this package."""

    @classmethod
    def refgi(cls) -> "VerbGroup":
        """Return the whole command."""
        group = cls("refgi", help=HELP, context_settings={"help_option_names": ["-h", "--help"],
                                                          "max_content_width": 100})
        return click.version_option(__version__, "-V", "--version", message="refgi %(version)s")(group)

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002
        """Return the verbs in the order in which one meets them."""
        return list(VERBS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002
        """Import a verb."""
        if cmd_name not in VERBS:
            return None
        command: click.Command = getattr(importlib.import_module(f"refgi.cli.{VERBS[cmd_name]}"), f"_{cmd_name}")
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the verb, and the nearest one for the message where there is none of that name."""
        require_room(args[0])
        require_threads()
        try:
            return super().resolve_command(ctx, args)
        except click.UsageError as error:
            near = nearest(args[0], VERBS)
            hint = f"Did you mean {near!r}?" if near else f"There are {', '.join(VERBS)}."
            raise click.UsageError(f"{error.format_message()} {hint}", ctx) from error

    def invoke(self, ctx: click.Context) -> Any:
        """Run a verb; an interrupt and a reader that left end it here, before click has its own word on them."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt as error:
            return _explained(error, ctx.ensure_object(Session))
        except BrokenPipeError:  # whoever read stdout has had enough: refgi scenes | head -1
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return DONE

    def main(  # type: ignore[override]
        self, args: Sequence[str] | None = None, prog_name: str | None = None, **extra: Any
    ) -> NoReturn:
        """Run and exit with the code that tells what became of it."""
        args = sys.argv[1:] if args is None else list(args)
        session = Session(debug=bool(os.environ.get("REFGI_DEBUG")), as_json="--json" in args)  # usage errors as well
        extra |= {"standalone_mode": False, "obj": session}
        with warnings.catch_warnings(), _heeding_signals():
            warnings.simplefilter("default")
            warnings.showwarning = session.warn
            try:
                code = super().main(args, prog_name, **extra)
            except BaseException as error:
                code = _explained(error, session)
        sys.exit(code if isinstance(code, int) else DONE)


@contextlib.contextmanager
def _heeding_signals() -> Iterator[None]:
    """End by an exception where SIGTERM or SIGINT comes, so that unfinished files are removed; a main thread can."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    handlers: dict[signal.Signals, Callable[..., NoReturn]] = {signal.SIGTERM: _terminate}
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # a shell's background job ignores it
        handlers[signal.SIGINT] = _interrupt
    before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _terminate(*_: object) -> NoReturn:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # once: what is cleaned up now is cleaned up whole
    _expect_halves()
    raise Terminated


def _interrupt(*_: object) -> NoReturn:
    _expect_halves()
    raise KeyboardInterrupt


def _expect_halves() -> None:
    """Say nothing of finalizers that fail from now on: a signal may leave any object, as a compiler's, half made."""
    sys.unraisablehook = lambda _: None


def _explained(error: BaseException, session: Session) -> int:
    """Say what went wrong and return the exit code."""
    if isinstance(error, KeyboardInterrupt):
        _interrupts.append(error)
    if isinstance(error, SystemExit):
        return error.code if isinstance(error.code, int) else FAILED
    if session.debug and not isinstance(error, click.exceptions.Abort | KeyboardInterrupt):
        traceback.print_exception(error)
    if isinstance(error, click.exceptions.NoArgsIsHelpError):
        click.echo(error.format_message(), file=sys.stderr)
        return USAGE

    fault = fault_of(error, debug=session.debug)
    session.fault(fault)
    return fault.code

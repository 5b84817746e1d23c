"""The command's frame: verbs loaded when used, errors and warnings as one line each, exit codes."""

import difflib
import importlib
import os
import sys
import traceback
import warnings
from collections.abc import Sequence
from typing import Any, NoReturn

import click

from refgi import __version__
from refgi.cli.session import DONE, FAILED, USAGE, Session

VERBS = ("scenes", "render", "sequence", "compare", "explain", "info")
HELP = """Indirect light by four published methods on the CPU, judged by path tracing.

SCENE is a built-in name such as cornell_box (see `refgi scenes`), a scene file (.json), or a mesh (.glb, .gltf, .obj,
.ply) with camera and light options. Results go to stdout, everything else to stderr.

Exit codes: 0 done, 1 a check failed, 2 usage or input error, 130 interrupted.
"""


class VerbGroup(click.Group):
    """A group of verbs, each the `command` of a module of this package with its name."""

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
        command: click.Command = importlib.import_module(f"refgi.cli.{cmd_name}").command
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the verb, and the nearest one for the message where there is none of that name."""
        try:
            return super().resolve_command(ctx, args)
        except click.UsageError as error:
            near = difflib.get_close_matches(args[0], VERBS, n=1)
            hint = f"Did you mean {near[0]!r}?" if near else f"There are {', '.join(VERBS)}."
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
        with warnings.catch_warnings():
            warnings.simplefilter("default")
            warnings.showwarning = session.warn
            try:
                code = super().main(args, prog_name, **extra)
            except BaseException as error:
                code = _explained(error, session)
        sys.exit(code if isinstance(code, int) else DONE)


def _explained(error: BaseException, session: Session) -> int:
    """Say what went wrong and return the exit code."""
    if isinstance(error, SystemExit):
        return error.code if isinstance(error.code, int) else FAILED
    if session.debug and not isinstance(error, click.exceptions.Abort | KeyboardInterrupt):
        traceback.print_exception(error)
    if isinstance(error, click.exceptions.NoArgsIsHelpError):
        click.echo(error.format_message(), file=sys.stderr)
        return USAGE
    from refgi.cli.fault import fault_of

    fault = fault_of(error, debug=session.debug)
    session.fault(fault)
    return fault.code

"""`refgi warm`: compile the methods' kernels ahead, and the same before a command that would compile many."""

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

import click

from refgi.cli.options import speech
from refgi.cli.session import Session, progress

if TYPE_CHECKING:
    from refgi.jit.ahead import Specialisation

FEW = 4  # kernels that a run compiles faster by itself than other processes start


@click.command("warm")
@click.option("--methods", metavar="NAME,NAME", help="Methods to compile for; all where absent.")
@click.option("--dtype", type=click.Choice(["float32", "float64"]), default="float32", show_default=True,
              help="Element type of their kernels.")
@click.option("--processes", type=click.IntRange(1), help="How many compile at a time; one a core where absent.")
@speech
@click.pass_obj
def _warm(session: Session, /, methods: str | None, dtype: str, processes: int | None) -> None:
    """Compile kernels ahead, on all cores.

    Those that methods need at their defaults; they are kept on disk.
    """
    from refgi.jit.ahead import compile_ahead
    from refgi.methods import METHODS, find_method

    names = list(METHODS) if methods is None else [find_method(name.strip()).name for name in methods.split(",")]
    lacking = _lacking(names, dtype)
    with progress() as tell:
        compile_ahead(lacking, tell, processes)
    session.result(f"{len(lacking)} kernels compiled for {', '.join(names)} ({dtype})",
                   {"methods": names, "dtype": dtype, "compiled": [one.kernel for one in lacking]})


command = _warm


def warm_up(methods: Iterable[str], dtype: str, tell: Callable[[str, float], None]) -> None:
    """Compile in several processes what methods at their defaults would have to compile first."""
    from refgi.jit.ahead import compile_ahead, cores

    if cores() > 1 and len(lacking := _lacking(methods, dtype)) >= FEW:
        compile_ahead(lacking, tell)


def _lacking(methods: Iterable[str], dtype: str) -> "list[Specialisation]":
    from refgi.jit.ahead import missing, read_list

    needs = {f"{name}/{dtype}" for name in methods}
    return missing(one for one in read_list() if one.needed_by & needs)

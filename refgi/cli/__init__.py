"""The command `refgi`: one file a verb, loaded when it is used; the only place that prints, asks or exits.

Results go to stdout, everything else to stderr. Exit codes: 0 done, 1 a check failed (or a fault of refgi itself),
2 usage or input error, 130 interrupted, 143 terminated.
"""

from refgi.cli.group import VerbGroup

__all__ = ["main"]


def main() -> None:
    """Run the command line and exit."""
    VerbGroup.refgi().main(prog_name="refgi")

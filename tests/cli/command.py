"""The command, run in the process of its tests."""

import functools

from click.testing import CliRunner

from refgi.cli.group import VerbGroup

TINY = ["--size", "12x10", "--rsm-resolution", "16"]


def invoke(*arguments):
    return CliRunner().invoke(VerbGroup.refgi(), [str(argument) for argument in arguments])


def runner(verb):
    return functools.partial(invoke, verb)


def refused(result, *words):
    """Exit code 2, lines on stderr with these words, nothing on stdout."""
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    assert result.stderr.startswith("refgi: ")
    for word in words:
        assert word in result.stderr, result.stderr
    return True


def refused_in_a_line(result, *words):
    assert result.stderr.count("\n") == 1, result.stderr
    return refused(result, *words)

"""Progress: lines now and then where there is no terminal, a bar where there is one, never on stdout."""

import sys

from refgi.cli import session as module
from refgi.cli.session import progress


def test_lines_come_only_every_few_seconds(monkeypatch, capsys):
    clock = iter([0.0, 1.0, 3.5, 4.0, 7.0])
    monkeypatch.setattr(module.time, "monotonic", lambda: next(clock))
    with progress() as tell:
        for done in (0.1, 0.5, 0.6, 1.0):
            tell("truth", done)
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == "refgi: truth 50%\nrefgi: truth done\n"


def test_a_terminal_gets_a_bar(monkeypatch, capsys):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    with progress() as tell:
        tell("truth", 0.25)
        tell("sii", 0.5)
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "sii" in captured.err

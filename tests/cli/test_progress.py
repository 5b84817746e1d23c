"""Progress: lines now and then where there is no terminal, a bar where there is one, never on stdout."""

import os
import signal
import sys

import pytest

from refgi.cli import progress as module
from refgi.cli.progress import progress


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


def interrupt():
    """Send this process SIGINT where Python drops the exception, as in a callback from compiled code."""
    try:
        os.kill(os.getpid(), signal.SIGINT)
        for _ in range(10_000):
            pass  # signals are handled between two steps of the interpreter
    except KeyboardInterrupt:
        pass


def test_an_interrupt_that_was_dropped_stops_the_work_at_the_next_report():
    showing = progress()
    tell = showing.__enter__()
    tell("truth", 0.1)
    interrupt()
    with pytest.raises(KeyboardInterrupt) as stopped:
        tell("truth", 0.2)
    assert not showing.__exit__(KeyboardInterrupt, stopped.value, None)  # goes on to whoever called
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_an_interrupt_that_was_dropped_counts_at_the_end():
    with pytest.raises(KeyboardInterrupt), progress():
        interrupt()

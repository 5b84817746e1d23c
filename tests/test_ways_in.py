"""What the pages of docs/index.md have a newcomer type runs as printed, in their order, and prints what they show."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from refgi.cli.group import VerbGroup

ROOT = Path(__file__).parents[1]
# appended, so that a command means the same and ends sooner
SOONER = {"compare": ["--set", "truth.samples=48", "--methods", "sii,multires,val,hssil"],
          "choose": ["--rounds", "1", "--set", "samples=48", "--methods", "sii,truth"],
          "explain": ["--size", "24x18"]}
NUMBER = re.compile(r"[-\u2212+]*\d[\d.,e+\u2212-]*%?")


def blocks(page):
    """Return what a page has its reader do and see, in order: (kind, text); a file's kind is its name."""
    text = (ROOT / "docs" / f"{page}.md").read_text("utf-8")
    found = re.finditer(r"(?:`(\w+\.py)`[^\n]*\n\n)?^```(\w*)\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    return [(one[1] or one[2], one[3]) for one in found]


def ran(line, sooner):
    """Run a line and return what it prints; its exit code is 0 or what its remark says."""
    words = shlex.split(line, comments=True)
    code = int(re.search(r"# exit code (\d)|$", line)[1] or 0)
    if words[0] == "refgi":
        done = CliRunner().invoke(VerbGroup.refgi(), [*words[1:], *(sooner.get(words[1], []))])
        assert done.exit_code == code, (line, done.output)
        return done.output
    words[0] = sys.executable if words[0] == "python" else words[0]
    done = subprocess.run(words, capture_output=True, text=True, check=False,
                          env=os.environ | {"PYTHONPATH": str(ROOT)})
    assert done.returncode == code, (line, done.stdout, done.stderr)
    return done.stdout


def words(line):
    """Return a line's words, numbers as #: those of another machine may differ in their last digits, times wholly."""
    return NUMBER.sub("#", line).split()


def followed(page, sooner=None):
    """Do what a page says, in the current folder; lines that it shows and the last commands did not print."""
    printed, missing = "", []
    for kind, text in blocks(page):
        if kind.endswith(".py"):
            Path(kind).write_text(text)
        elif kind == "":
            printed = "".join(ran(line, sooner or {}) for line in text.replace("\\\n", " ").splitlines())
        elif kind == "text":
            there = [words(line) for line in printed.splitlines()]
            missing += [line for line in text.splitlines() if not any(
                words(line) == one[:len(words(line))] for one in there)]
    return missing


def test_a_stage_is_ported(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert followed("port") == []


@pytest.mark.slow
def test_a_picture_and_a_stage_are_tested(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    followed("port")  # whose files it goes on with
    assert followed("test_against") == []


@pytest.mark.slow
def test_methods_are_compared(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert followed("compare_methods", SOONER) == []


def test_what_a_page_shows_and_is_not_printed_is_found(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys.modules[__name__], "blocks", lambda _: [
        ("", "python -c 'print(\"a 1.5 b\")'\n"), ("text", "a 2 b\nc\n")])
    assert followed("any") == ["c"]

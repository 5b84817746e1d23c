"""Every command that docs/vectors.md and the kit's README show a port's author runs and means what they say."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from refgi.cli.group import VerbGroup
from refgi.vectors.options import OPTIONS
from tests.vectors.port import Port

ROOT = Path(__file__).parents[2]
DOCUMENTS = {name: (ROOT / name).read_text(encoding="utf-8").replace("\\\n", "")
             for name in ("docs/vectors.md", "refgi/vectors/files/README.md")}
CASE = "sii-halton"  # to which each check is narrowed


def commands():
    lines = [line for text in DOCUMENTS.values()
             for line in re.findall(r"^ {0,4}((?:refgi|python kit/check\.py) .*)$", text, re.MULTILINE)]
    return list(dict.fromkeys(tuple(shlex.split(line, comments=True)) for line in lines))


def refgi(*arguments):
    done = CliRunner().invoke(VerbGroup.refgi(), [*arguments])
    assert done.exit_code == 0, done.output


@pytest.fixture
def place(kit, tmp_path, monkeypatch):
    """A folder with kit/ and my_output/, right, and what else the commands name."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(kit.folder, "kit", copy_function=os.link)
    expected = re.search(r"^```text\n(.*?)^```", DOCUMENTS["docs/vectors.md"], re.MULTILINE | re.DOTALL)[1]
    Path("expected.txt").write_text(expected)
    return Port(kit, CASE, tmp_path)


def change(port, command):
    """Write what options speak of."""
    if "--depth" in command:
        z = port.arrays["rsm.surface.depth"].astype(float)
        d = np.where(np.isinf(z), 1.0, 100.0 * (z - 0.1) / (np.where(np.isinf(z), 1.0, z) * 99.9))
        port.write("rsm.surface.depth", np.round(d * (2**24 - 1)) / (2**24 - 1))
    if "--unordered" in command:
        lights = next(step.writes for step in port.case.stages if step.name == "lights.pixel_lights")
        order = np.random.default_rng(1).permutation(port.arrays["lights.pixel_lights.texel"].size)
        for name in lights:
            port.write(name, port.arrays[name][..., order])


@pytest.mark.parametrize("command", commands(), ids=" ".join)
def test_a_command_runs(place, command):
    change(place, command)
    place.folder.rename("my_output")
    if command[:2] == ("refgi", "check"):
        refgi("render", "cornell_box", "--method", "sii", "--size", "48x36", "--out", "mine.exr")
    less = ["--case", "pairs-diffuse"] if command[2:4] == ("export", "--kit") else ["--case", CASE]
    less = ["--size", "16x12", "--rsm-resolution", "16"] if "cornell_box" in command[:4] else less
    if command[0] == "python":
        done = subprocess.run([sys.executable, "-I", *command[1:], *less], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    else:
        refgi(*command[1:], *([] if command[:2] == ("refgi", "check") else less))
    for option in ("--json", "--junit", "--html"):
        if option in command:
            assert Path(command[command.index(option) + 1]).stat().st_size > 100


def test_every_option_stands_in_both_documents():
    for name, text in DOCUMENTS.items():
        assert [one.flag for one in OPTIONS if one.flag not in text] == [], name


def test_commands_are_found():
    assert len(commands()) > 12
    assert ("python", "kit/check.py", "my_output/", "--unordered", "lights.pixel_lights") in commands()

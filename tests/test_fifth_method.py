"""Property tests of a method that another package brings: docs/new_method.md, installed and used as printed there."""

import json
import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from refgi.image import read_exr

PAGE = Path(__file__).parents[1] / "docs" / "new_method.md"
TINY = ["--size", "24x18", "--rsm-resolution", "24"]


def block(language: str) -> str:
    """Return the page's first block of code in a language."""
    found = re.search(rf"```{language}\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert found
    return found[1]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Install the page's package from a wheel, which needs no build backend."""
    folder = tmp_path_factory.mktemp("fifth")
    entry = re.search(r'\[project\.entry-points\."refgi\.methods"\]\n(.*)', block("toml"))[1].replace('"', "")
    files = {
        "ambient/__init__.py": block("python"),
        "ambient-1.0.dist-info/METADATA": "Metadata-Version: 2.1\nName: ambient\nVersion: 1.0\n",
        "ambient-1.0.dist-info/WHEEL": "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\n"
                                       "Tag: py3-none-any\n",
        "ambient-1.0.dist-info/entry_points.txt": f"[refgi.methods]\n{entry}\n"}
    files["ambient-1.0.dist-info/RECORD"] = "".join(f"{name},,\n" for name in files)
    with zipfile.ZipFile(folder / "ambient-1.0-py3-none-any.whl", "w") as wheel:
        for name, text in files.items():
            wheel.writestr(name, text)
    install = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--target",
               str(folder / "site"), str(folder / "ambient-1.0-py3-none-any.whl")]
    subprocess.run(install, check=True)
    return folder / "site"


RUN = """
import json, sys
from click.testing import CliRunner
from refgi.cli.group import VerbGroup
said = []
for arguments in json.loads(sys.argv[1]):
    done = CliRunner().invoke(VerbGroup.refgi(), arguments)
    said.append((done.exit_code, done.stdout, done.stderr))
print(json.dumps(said))
"""


def refgi(site, *commands, codes=None):
    """Run commands in one process that sees a folder of packages; return what each says, on stdout and stderr."""
    paths = [str(site), str(PAGE.parents[1])]
    asked = json.dumps([[str(word) for word in command] for command in commands])
    done = subprocess.run([sys.executable, "-c", RUN, asked], capture_output=True, text=True, check=False,
                          env=os.environ | {"PYTHONPATH": os.pathsep.join(paths)})
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert [code for code, *_ in found] == (codes or [0] * len(commands)), found
    return [said for _, *said in found]


@pytest.fixture(scope="module")
def done(site, tmp_path_factory):
    """What one process says to all commands, and the folder that they write to."""
    out = tmp_path_factory.mktemp("out")
    render = ("render", "cornell_box", *TINY, "--method", "ambient")
    commands = ((*render, "--set", "share=0.2", "--out", out / "a.exr"),
                (*render, "--set", "share=0.4", "--out", out / "b.exr"),
                ("render", "--again", out / "a.exr"),
                ("compare", "cornell_box", *TINY, "--methods", "sii,ambient", "--set", "sii.lights=16",
                 "--set", "truth.samples=24", "--out", out / "compared", "--json"),
                ("explain", "cornell_box", *TINY, "--method", "ambient", "--preset", "dim", "--json"),
                ("info", "--json"), ("settings", "ambient", "--json"),
                ("render", "cornell_box", "--method", "ambient", "--set", "shares=2", "--out", "x.exr"))
    return refgi(site, *commands, codes=[0] * 7 + [2]), out


def test_it_renders(done):
    said, out = done
    planes, record = read_exr(out / "a.exr")
    twice = read_exr(out / "b.exr")[0]
    assert record["settings"] == {"share": 0.2}
    assert planes["irradiance.R"].max() > 0
    lit = planes["irradiance.R"] > 0
    assert abs(twice["irradiance.R"][lit] / planes["irradiance.R"][lit] - 2).max() < 1e-6
    assert "the same to the bit" in said[2][0]


def test_it_is_compared(done):
    said, out = done
    content = json.loads(said[3][0])
    assert set(content["methods"]) == {"sii", "ambient"}
    assert len(content["methods"]["ambient"]["against"]) == 2  # truth, and truth without visibility
    assert "ambient" in (out / "compared" / "index.html").read_text(encoding="utf-8")


def test_it_is_explained_and_listed_with_its_settings(done):
    (explained, _), (info, _), (settings, _), (_, refused) = done[0][4:]
    content = json.loads(explained)
    assert "ambient.spread" in {line["name"] for line in content["stages"]}
    assert content["settings"]["share"] == 0.1
    assert "ambient" in json.loads(info)["methods"]
    content = json.loads(settings)
    assert content["schema"]["properties"]["share"]["maximum"] == 1.0
    assert content["presets"]["dim"] == {"share": 0.1}
    assert "share" in refused


def test_one_that_cannot_be_imported_is_one_error(tmp_path):
    info = tmp_path / "broken-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: broken\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[refgi.methods]\nbroken = nowhere:METHOD\nsii = nowhere:METHOD\n")
    (_, said), _ = refgi(tmp_path, ("render", "cornell_box", *TINY, "--method", "broken", "--out", tmp_path / "a.exr"),
                         ("settings", "sii"), codes=[2, 0])  # no other package takes the place of refgi's own
    assert "method broken: nowhere:METHOD cannot be imported" in said

"""What a user installs: the wheel alone, away from the sources, compares methods and gives stage data."""

import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SMOKE = """
import refgi, sys
from pathlib import Path
from refgi.testing import stages
assert Path(refgi.__file__).is_relative_to(sys.argv[1]), refgi.__file__
data = stages("cornell_box", "sii", folder="kit", only="pairs.", width=8, height=6, rsm_resolution=8)
data.assert_close(data["pairs.sum"], "pairs.sum")
try:
    data.assert_close(2 * data["pairs.sum"], "pairs.sum")
except AssertionError:
    print(len(data.case.stages))
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """Return the folder of a wheel's packages, built from what git has."""
    home = tmp_path_factory.mktemp("wheel")
    subprocess.run([sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "-w", str(home), str(ROOT)],
                   check=True, capture_output=True)
    wheel, = home.glob("refgi-*.whl")
    zipfile.ZipFile(wheel).extractall(home / "packages")
    return home / "packages"


def python(installed, folder, *arguments):
    environment = os.environ | {"PYTHONPATH": str(installed), "PYTHONWARNINGS": "ignore"}
    done = subprocess.run([sys.executable, *arguments], cwd=folder, env=environment, capture_output=True, text=True,
                          check=False, timeout=600)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_it_compares_methods(installed, tmp_path):
    python(installed, tmp_path, "-m", "refgi", "compare", "cornell_box", "--methods", "sii,hssil", "--size", "16x12",
           "--set", "truth.samples=4", "--out", "out")
    found = json.loads((tmp_path / "out" / "results.json").read_text())
    assert "sii" in json.dumps(found)
    assert (tmp_path / "out" / "index.html").exists()


def test_it_gives_stage_data_with_likely_bugs(installed, tmp_path):
    assert python(installed, tmp_path, "-c", SMOKE, str(installed)).strip() == "1"
    bugs, = (tmp_path / "kit").rglob("*.npz")
    assert bugs.stat().st_size > 1000


def test_it_holds_no_tests_and_all_that_is_no_python(installed):
    assert {path.name for path in installed.iterdir() if path.suffix != ".dist-info"} == {"refgi"}
    kept = {path.relative_to(ROOT) for path in (ROOT / "refgi").rglob("*") if path.is_file()
            and path.suffix not in (".py", ".pyc")}
    assert kept <= {path.relative_to(installed) for path in installed.rglob("*")}

"""What a user installs: the wheel alone, away from the sources, compares methods and gives stage data."""

import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from refgi.jit.cache import levels, target_of

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
    zipfile.ZipFile(built(ROOT, home)).extractall(home / "packages")
    return home / "packages"


def built(sources, home):
    subprocess.run([sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "-w", str(home), str(sources)],
                   check=True, capture_output=True)
    wheel, = home.glob("refgi-*.whl")
    return wheel


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


def test_one_with_kernels_is_for_this_python_and_platform(tmp_path):
    for name in ("pyproject.toml", "hatch_build.py", "README.md"):
        shutil.copy(ROOT / name, tmp_path)
    home = tmp_path / "refgi" / "jit" / "brought"
    home.mkdir(parents=True)
    for path in (tmp_path / "refgi" / "__init__.py", home / "one.kernel", home / ".lock"):
        path.touch()
    shutil.copy(ROOT / ".gitignore", tmp_path)
    wheel = built(tmp_path, tmp_path / "dist")
    assert f"-cp3{sys.version_info[1]}-" in wheel.name
    assert not wheel.name.endswith("-any.whl")
    assert {name for name in zipfile.ZipFile(wheel).namelist() if "dist-info" not in name} == {
        "refgi/__init__.py", "refgi/jit/brought/one.kernel"}


@pytest.mark.slow
@pytest.mark.parametrize("level", levels())
def test_kernels_of_every_level_make_the_same_picture(tmp_path, level):
    def picture(name, **environment):
        subprocess.run([sys.executable, "-m", "refgi", "render", "cornell_box", "--size", "64x48", "--out",
                        str(tmp_path / name)], check=True, env=os.environ | environment)
        return [path.read_bytes() for path in (tmp_path / name).glob("*.exr")]

    assert picture("native") == picture(level, REFGI_CACHE_DIR=str(tmp_path / "cache"), **target_of(level))

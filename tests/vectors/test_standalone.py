"""The checker that lies in every kit: NumPy alone, and to the letter what `refgi vectors check` says."""

import ast
import importlib.util
import json
import shutil
import subprocess
import sys

import numpy as np
import pytest
from click.testing import CliRunner

from refgi.cli.group import VerbGroup
from refgi.vectors import standalone
from refgi.vectors.standalone import standalone_text
from tests.vectors.port import Port

CASE = "sii-warp-a"


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """The kit's check.py as a module of its own."""
    file = tmp_path_factory.mktemp("alone") / "check.py"
    file.write_text(standalone_text())
    spec = importlib.util.spec_from_file_location("kit_check", file)
    module = importlib.util.module_from_spec(spec)
    sys.modules["kit_check"] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules["kit_check"]


@pytest.fixture
def both(alone, kit, tmp_path, capsys):
    """Check by both, expect the same text, JSON and code, and return them."""
    def run(port, *options):
        files = [tmp_path / "refgi.json", tmp_path / "alone.json"]
        options = [*options, "--case", port.id] if hasattr(port, "id") else [*options]
        folder = str(getattr(port, "folder", port))
        done = CliRunner().invoke(VerbGroup.refgi(), ["vectors", "check", str(kit.folder), folder, *options,
                                                      "--json", str(files[0])])
        capsys.readouterr()
        code = alone.main([folder, "--kit", str(kit.folder), *options, "--json", str(files[1])])
        said = capsys.readouterr()
        assert code == done.exit_code
        if code == 2:  # with --json refgi says it as JSON
            assert json.loads(done.stdout)["error"]["message"] == said.err.strip().removeprefix("check.py: ")
            return code, said.err, None
        assert said.out == done.stdout
        assert files[0].read_text() == files[1].read_text()
        return code, said.out, json.loads(files[1].read_text())
    return run


@pytest.fixture
def port(kit, tmp_path):
    return Port(kit, CASE, tmp_path)


def test_it_needs_python_3_10_and_numpy_alone(kit):
    text = (kit.folder / "check.py").read_text()
    assert text == standalone_text()
    tree = ast.parse(text, feature_version=(3, 10))
    modules = {name.split(".")[0] for node in ast.walk(tree) for name in (
        [one.name for one in node.names] if isinstance(node, ast.Import)
        else [node.module] if isinstance(node, ast.ImportFrom) else [])}
    assert modules <= {"numpy", *sys.stdlib_module_names}
    assert "tomllib" not in modules  # newer than 3.10
    blocked = "import sys, runpy; sys.modules |= dict.fromkeys(('refgi', 'pydantic', 'numba', 'click')); "
    run = (f"{blocked}sys.argv = ['check.py', {str(kit.folder)!r}, '--case', {CASE!r}]; "
           f"runpy.run_path({str(kit.folder / 'check.py')!r}, run_name='__main__')")
    done = subprocess.run([sys.executable, "-I", "-c", run], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert "isolated: 19 exact" in done.stdout


def test_right_arrays(both, port, kit):
    assert both(port)[2]["verdict"] == "exact"
    assert both(port, "--chained")[0] == 0
    assert both(kit.folder)[0] == 0  # all cases


def test_rounding_noise_and_tiers(both, port):
    rng = np.random.default_rng(0)
    for name, array in port.arrays.items():
        if array.dtype.kind == "f":
            port.write(name, array * (1 + 2.0**-24 * rng.uniform(-1, 1, array.shape)))
    assert both(port)[2]["verdict"] == "within"
    for name, array in port.arrays.items():
        if array.dtype.kind == "f":
            port.write(name, array.astype(np.float16))
    assert both(port)[0] == 1
    assert both(port, "--tier", "T2")[0] == 0
    assert both(port, "--tier", "rsm=T2", "--tier", "lights.pixel_lights.flux=R11G11B10F", "--chained")[0] == 1


def test_wrong_missing_misshapen_and_damaged_arrays(both, port):
    port.write("rsm.reflected_flux0.flux", port.arrays["rsm.reflected_flux0.flux"] / np.pi)
    code, text, result = both(port)
    assert (code, result["first"]) == (1, [CASE, "rsm.reflected_flux0"])
    assert "likely: every element is 1/pi times" in text
    assert both(port, "--chained", "--fail-fast")[2]["left"] > 0
    port.remove("lights.pixel_lights.normal")
    port.write("rsm.map_surface0.albedo", np.moveaxis(port.arrays["rsm.map_surface0.albedo"], 0, -1))
    port.write("lights.texels1.texel", port.arrays["lights.texels1.texel"].astype(float))
    assert both(port)[2]["first"] == [CASE, "rsm.map_surface0"]
    assert both(port, "--layout", "rgba", "--unordered", "lights.pixel_lights")[0] == 1
    (port.folder / CASE / "pairs.sum.npy").write_bytes(b"none")
    assert both(port, "--format", "github")[0] == 5


def test_estimates_and_edges(both, kit, tmp_path):
    port = Port(kit, "truth-matte", tmp_path)
    mean = port.arrays["truth.path_traced.mean"]
    spread = np.sqrt(port.arrays["truth.path_traced.variance_of_mean"])
    port.write("truth.path_traced.mean", mean + spread * np.random.default_rng(1).normal(size=mean.shape))
    assert both(port)[0] == 0
    port.write("truth.path_traced.mean", 1.5 * mean)
    assert both(port)[0] == 1


def test_options_and_folders(both, port, tmp_path):
    depth = port.arrays["rsm.surface.depth"].astype(float)
    port.write("rsm.surface.depth", np.where(np.isinf(depth), 1.0, 100 * (depth - 0.1) / (np.where(
        np.isinf(depth), 1.0, depth) * 99.9)))
    assert both(port, "--depth", "rsm.surface=ndc:0.1:100:32")[0] == 0
    (tmp_path / "expect.txt").write_text("rsm.surface\npairs.sum\n")
    assert both(port, "--expect", str(tmp_path / "expect.txt"), "--require", "all")[0] == 0
    for wrong in (("--stage", "pairs.summ"), ("--tier", "sum=T9"), ("--depth", "x"), ("--require", "nothing")):
        assert both(port, *wrong)[0] == 2
    empty = tmp_path / "empty"
    empty.mkdir()
    assert both(empty)[0] == 4
    assert both(tmp_path / "nowhere")[0] == 2


@pytest.mark.parametrize(("change", "said"), [
    (lambda one: one | {"strange": 1}, "Extra inputs are not permitted"),
    (lambda one: {key: one[key] for key in one if key != "vectors"}, "Field required"),
    (lambda one: one | {"cases": [3]}, "should be"),
    (lambda one: one | {"kit": 3}, "should be"),
    (lambda _: None, "should be"),
])
def test_damaged_kits(alone, kit, port, tmp_path, capsys, change, said):
    (tmp_path / "kit").mkdir()
    content = change(json.loads((kit.folder / "kit.json").read_text()))
    (tmp_path / "kit" / "kit.json").write_text(json.dumps(content))
    assert alone.main([str(port.folder), "--kit", str(tmp_path / "kit")]) == 5
    assert said in capsys.readouterr().err
    shutil.rmtree(tmp_path / "kit")
    assert alone.main([str(port.folder), "--kit", str(tmp_path / "kit")]) == 5


@pytest.mark.parametrize(("text", "said"), [
    ("from refgi.vectors.changes import _text\nfrom refgi.vectors.page import _text as other\n",
     "_text: expected one of this name"),
    ("from refgi.errors import nearest\n", "nearest: expected one of this name, got those of files and refgi.errors"),
    ("from refgi.testing import kit_folder\n", "expected imports at the top of its module"),
])
def test_what_cannot_be_gathered_is_refused(tmp_path, monkeypatch, text, said):
    """Two definitions of one name, and an import in a body, would make another program of it."""
    monkeypatch.setattr(standalone, "FILES", tmp_path)
    (tmp_path / "check.py").write_text(f'"""A check."""\n{text}')
    (tmp_path / "models.py").write_text('"""Models."""\ndef nearest(): ...\n')
    with pytest.raises(ValueError, match=said):
        standalone_text()

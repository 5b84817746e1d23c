"""The GLSL port of examples/ports/glsl passes the kit, and so do variants that a GPU or an author may choose."""

import subprocess
import sys
from pathlib import Path

import pytest

from refgi.vectors.check import ALL_WITHIN, Asked, Kit, check_output
from refgi.vectors.export import export_kit
from refgi.vectors.manifest import Result

PORT = Path(__file__).parents[2] / "examples/ports/glsl/run.py"
CONTEXT = "import moderngl; moderngl.create_standalone_context(backend='egl', require=450)"
COVERED = {
    "pairs": {("pairs-diffuse", "pairs"), ("pairs-glossy", "pairs")},
    "sii": {("sii-warp-a", "footprints"), *((f"sii-{case}", "sum") for case in (
        "halton", "three-lamps", "warp-a", "warp-b", "grid", "one-texel"))},
    "hssil": {*((f"hssil-{case}", f"gather{level}") for case, levels in (
        ("default", 4), ("paper", 4), ("odd", 5)) for level in range(levels))},
    "val": {(f"val-{case}", stage) for case in ("csm", "single") for stage in (
        "basis", "mip", "search.means", "penumbra.means", "visibility")},
}


@pytest.fixture(scope="module")
def _gl() -> None:
    made = subprocess.run([sys.executable, "-c", CONTEXT], capture_output=True, text=True, check=False)
    if made.returncode:
        pytest.skip(f"no OpenGL 4.5 by moderngl and EGL: {made.stderr.strip().splitlines()[-1]}")


@pytest.fixture(scope="module", params=COVERED)
def kit(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory, _gl: None) -> tuple[str, Kit]:
    folder = tmp_path_factory.mktemp("glsl") / "kit"
    export_kit("quick", folder, only=request.param)
    return request.param, Kit(folder)


def run(kit: Kit, out: Path, *options: str, **asked: object) -> Result:
    command = [sys.executable, PORT, kit.folder, out, *options]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return check_output(kit, out, Asked(**asked))  # type: ignore[arg-type]


def expect_all_within(made: Result, cases: str) -> None:
    ran = {(one.case, one.stage): one for one in made.stages if one.verdict != "not-run"}
    assert ran.keys() == COVERED[cases]
    assert made.exit_code == ALL_WITHIN, [one for one in ran.values() if one.verdict not in ("exact", "within")]


@pytest.mark.parametrize("variant", ["plain", "fused", "rsqrt", "reversed", "tree", "unnormalised"])
def test_stages_are_within_bounds(kit: tuple[str, Kit], tmp_path: Path, variant: str) -> None:
    expect_all_within(run(kit[1], tmp_path / "out", "--variant", variant), kit[0])


def test_stages_that_read_own_outputs_are_within_bounds(kit: tuple[str, Kit], tmp_path: Path) -> None:
    expect_all_within(run(kit[1], tmp_path / "out", "--chained", chained=True), kit[0])


def test_half_floats_are_within_bounds_of_tier_2(kit: tuple[str, Kit], tmp_path: Path) -> None:
    expect_all_within(run(kit[1], tmp_path / "out", "--variant", "half", tiers={"": "T2"}), kit[0])

"""The GLSL port of examples/ports/glsl passes the kit, and so do variants that a GPU or an author may choose."""

import subprocess
import sys
from pathlib import Path

import pytest

from refgi.methods import METHODS
from refgi.settings import of
from refgi.testing import stages
from refgi.vectors.check import ALL_WITHIN, Asked, Kit, check_output
from refgi.vectors.manifest import Result

PORT = Path(__file__).parents[2] / "examples/ports/glsl/run.py"
CONTEXT = "import moderngl; moderngl.create_standalone_context(backend='egl', require=450)"
COVERED = {
    "pairs": {("pairs-diffuse", "pairs.pairs"), ("pairs-glossy", "pairs.pairs")},
    "sii": {("sii-warp-a", "lights.footprints"), *((f"sii-{case}", "pairs.sum") for case in (
        "halton", "three-lamps", "warp-a", "warp-b", "grid", "one-texel"))},
    "hssil": {*((f"hssil-{case}", f"sssil.gather_samples{level}") for case, levels in (
        ("default", 4), ("paper", 4), ("odd", 5)) for level in range(levels))},
    "val": {("val-csm", "lights.footprints"), *(("val-csm", f"cluster.{stage}") for stage in (
        "basis", "mip_levels", "mip_means0", "mip_means1", "csm"))},
}


@pytest.fixture(scope="module")
def _gl() -> None:
    made = subprocess.run([sys.executable, "-c", CONTEXT], capture_output=True, text=True, check=False)
    if made.returncode:
        pytest.skip(f"no OpenGL 4.5 by moderngl and EGL: {made.stderr.strip().splitlines()[-1]}")


@pytest.fixture(params=COVERED)
def cases(request: pytest.FixtureRequest, _gl: None) -> str:
    return request.param


def run(kit: Kit, cases: str, out: Path, *options: str, **asked: object) -> Result:
    names = sorted({case for case, _ in COVERED[cases]})
    done = subprocess.run([sys.executable, PORT, kit.folder, out, *names, *options], capture_output=True, text=True,
                          check=False)
    assert done.returncode == 0, done.stderr
    return check_output(kit, out, Asked(cases=tuple(names), **asked))  # type: ignore[arg-type]


def expect_all_within(made: Result, cases: str) -> None:
    ran = {(one.case, one.stage): one for one in made.stages if one.verdict != "not-run"}
    assert ran.keys() == COVERED[cases]
    assert made.exit_code == ALL_WITHIN, [one for one in ran.values() if one.verdict not in ("exact", "within")]


@pytest.mark.parametrize("variant", ["plain", "fused", "rsqrt", "reversed", "tree", "unnormalised"])
def test_stages_are_within_bounds(kit: Kit, cases: str, tmp_path: Path, variant: str) -> None:
    expect_all_within(run(kit, cases, tmp_path / "out", "--variant", variant), cases)


def test_stages_that_read_own_outputs_are_within_bounds(kit: Kit, cases: str, tmp_path: Path) -> None:
    expect_all_within(run(kit, cases, tmp_path / "out", "--chained", chained=True), cases)


def test_half_floats_are_within_bounds_of_tier_2(kit: Kit, cases: str, tmp_path: Path) -> None:
    expect_all_within(run(kit, cases, tmp_path / "out", "--variant", "half", tiers={"": "T2"}), cases)


@pytest.mark.usefixtures("_gl")
@pytest.mark.parametrize(("method", "only", "settings", "ran"), [
    ("sii", "pairs.", {"lights": 64}, 1), ("hssil", "sssil.gather_samples", {"samples": 16}, 1),
    ("val", "cluster.", {"lights": 64, "maps.resolution": 16, "clusters": 2}, 5)])
def test_stages_of_any_scene_are_within_bounds(
    tmp_path: Path, method: str, only: str, settings: dict[str, int], ran: int
) -> None:
    data = stages("cornell_box", method, of(METHODS[method].settings, **settings), folder=tmp_path / "kit", only=only,
                  width=16, height=12, rsm_resolution=32)
    done = subprocess.run([sys.executable, PORT, data.kit.folder, tmp_path / "out"], capture_output=True, text=True,
                          check=False)
    made = check_output(data.kit, tmp_path / "out", Asked())
    assert made.exit_code == ALL_WITHIN, done.stderr
    assert sum(one.verdict != "not-run" for one in made.stages) >= ran

"""The port in C99 passes the kit: float32, from the papers and the kit alone."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from refgi.vectors.check import ALL_WITHIN, Asked, check_output

SOURCE = Path(__file__).parents[2] / "examples/ports/c"
FLAGS = ("-O2", "-std=c99", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off")
BUFFERS = {"gbuffer.ids", "gbuffer.surface", "rsm#.ids", "rsm#.surface", "rsm#.flux", "rsm#.points", "rsm#.texels",
           "lights"}
LEVELS = {"direct", "level#", "shifts of samples#", "samples#", "gather#", "blur#", "light#", "picture"}
COVERED = {
    "pairs": {"pairs"},
    "sii": BUFFERS | {"rsm#.importance", "rsm#.warp", "footprints", "sum"},
    "multires": BUFFERS | {"footprints"} | {f"multires.{stage}" for stage in (
        "depth_ranges", "normal_ranges", "discontinuities", "states", "subsplats", "points", "irradiance", "upsample",
        "upsample.#", "detail")},
    "hssil": (BUFFERS | LEVELS) - {"rsm#.points", "rsm#.texels", "rsm#.flux", "lights"},
    "val": BUFFERS | {"footprints", "extents", "kmeans.start", "kmeans.assign#", "kmeans.means#", "kmeans", "series",
                      "scale", "maps.t", "basis", "mip", "facing", "hard", "search", "search.means", "penumbra",
                      "penumbra.means", "visibility", "sum"},
}


@pytest.fixture(scope="module")
def port(tmp_path_factory):
    """The program, built without a warning."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler")
    program = tmp_path_factory.mktemp("build") / "port"
    subprocess.run([compiler, *FLAGS, "-o", program, *sorted(SOURCE.glob("*.c")), "-lm"], check=True)
    return program


@pytest.mark.parametrize("chained", [False, True])
@pytest.mark.parametrize("name", sorted(COVERED))
def test_stages_are_within_their_bounds(port, kit, tmp_path, evidence, name, chained):
    cases = sorted(case.id for case in kit.manifest.cases if case.id.startswith(f"{name}-")
                   and not case.id.startswith("sii-range-"))
    subprocess.run([port, kit.folder, tmp_path, *(["--chained"] if chained else []), *cases], check=True,
                   capture_output=True)
    result = check_output(kit, tmp_path, Asked(chained=chained, cases=tuple(cases)))
    wrong = [(one.case, one.stage, one.arrays, one.causes) for one in result.stages
             if one.verdict in ("out", "invalid")]
    assert not wrong
    assert result.exit_code == ALL_WITHIN
    ran = {re.sub(r"\d+", "#", one.stage) for one in result.stages if one.verdict != "not-run"}
    assert ran == COVERED[name]
    worst = max(array.worst or 0.0 for one in result.stages for array in one.arrays)
    evidence(f"{name}, {'chained' if chained else 'isolated'}: {len(ran)} kinds of stages within, "
             f"worst {worst:.2g} bounds")


def test_the_buffers_of_every_method_are_within(port, kit, tmp_path):
    """Whatever the program has of methods that it does not know."""
    subprocess.run([port, kit.folder, tmp_path], check=True, capture_output=True)
    result = check_output(kit, tmp_path, Asked())
    assert result.findings == ()
    assert {one.case.split("-")[0] for one in result.stages if one.verdict != "not-run"} >= {
        "gather", "vpl", "truth", *COVERED}

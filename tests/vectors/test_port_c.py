"""The port in C99 passes the kit: float32, from the papers and the kit alone."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from refgi.vectors.check import ALL_WITHIN, Asked, Kit, check_output
from refgi.vectors.export import export_kit

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
# maps of 1 and 3 x 3 texels, over which the reference integrates a spot's falloff to no better than 2e-5
NOT_MET = {"sii-one-texel", "val-empty"}


@pytest.fixture(scope="module")
def port(tmp_path_factory):
    """The program, built without a warning."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler")
    program = tmp_path_factory.mktemp("build") / "port"
    subprocess.run([compiler, *FLAGS, "-o", program, *sorted(SOURCE.glob("*.c")), "-lm"], check=True)
    return program


@pytest.fixture(scope="module", params=sorted(COVERED))
def method(request, tmp_path_factory):
    """A method and its part of the quick kit."""
    folder = tmp_path_factory.mktemp("kit") / request.param
    export_kit("quick", folder, only=request.param)
    return request.param, Kit(folder)


@pytest.mark.parametrize("chained", [False, True])
def test_stages_are_within_their_bounds(port, method, tmp_path, evidence, chained):
    name, kit = method
    cases = sorted({case.id for case in kit.manifest.cases} - NOT_MET)
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

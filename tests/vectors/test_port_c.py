"""The port in C99 passes the kit: float32, from the papers and the kit alone."""

import shutil
import subprocess
from pathlib import Path

import pytest

from refgi.vectors.check import ALL_WITHIN, Asked, check_output
from refgi.vectors.spec import kind_of

SOURCE = Path(__file__).parents[2] / "examples/ports/c"
FLAGS = ("-O2", "-std=c99", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off")
VIEW = {"rsm.visible_triangles", "rsm.surface"}
LIGHTS = {"rsm.map_triangles", "rsm.map_surface", "rsm.reflected_flux", "lights.texels", "lights.pixel_lights"}
COVERED = {
    "pairs": {"pairs.pairs"},
    "sii": VIEW | LIGHTS | {f"lights.{stage}" for stage in (
        "halton_points", "grid_points", "importance", "warp", "footprints")} | {"pairs.sum"},
    "multires": VIEW | LIGHTS | {"lights.grid_points", "lights.footprints"} | {f"multires.{stage}" for stage in (
        "depth_ranges", "normal_ranges", "discontinuities", "states", "subsplats", "points", "subsplat_irradiance",
        "upsample_level", "upsample_at_once", "detail")},
    "hssil": VIEW | {"rsm.map_triangles", "rsm.map_surface", "rsm.reflected_flux", "rsm.facing",
                     "rsm.direct_irradiance"} | {f"sssil.{stage}" for stage in (
        "first_level", "coarser_level", "points_and_shifts", "crown_samples", "gather_samples", "blur", "upsample")},
    "val": VIEW | LIGHTS | {"lights.halton_points", "lights.footprints", "rsm.facing", "rsm.visible_extent",
                            "rsm.illuminated_extent"} | {f"cluster.{stage}" for stage in (
        "kmeans_start", "kmeans_assign", "kmeans_means", "kmeans_rounds", "kmeans_each", "series", "depth_scale",
        "map_depths", "basis", "mip_levels", "search", "mip_means", "csm_penumbra", "csm", "depth_tests", "shadowed")},
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
    ran = {kind_of(one.stage) for one in result.stages if one.verdict != "not-run"}
    assert ran == COVERED[name]
    worst = max(array.worst or 0.0 for one in result.stages for array in one.arrays)
    evidence(f"{name}, {'chained' if chained else 'isolated'}: {len(ran)} kinds of stages within, "
             f"worst {worst:.2g} bounds")


@pytest.mark.slow
def test_the_buffers_of_every_method_are_within(port, kit, tmp_path):
    """Whatever the program has of methods that it does not know."""
    subprocess.run([port, kit.folder, tmp_path], check=True, capture_output=True)
    result = check_output(kit, tmp_path, Asked())
    assert result.findings == ()
    assert {one.case.split("-")[0] for one in result.stages if one.verdict != "not-run"} >= {
        "gather", "vpl", "truth", *COVERED}

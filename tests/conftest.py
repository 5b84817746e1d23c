"""What every test can ask for: the real scenes' folder, and a place to put the figure a feature's evidence gave."""

import os
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import hypothesis
import pytest

# the same examples on every run and no limit on time, which a compiling kernel would break
hypothesis.settings.register_profile("refgi", derandomize=True, deadline=None)
hypothesis.settings.load_profile("refgi")

ROOT = Path(__file__).parents[1]
# what `make quick` runs: a minute with warm kernels
QUICK = (
    "tests/settings", "tests/image", "tests/scene/test_scenefile", "tests/compare", "tests/provenance",
    "tests/test_stages.py", "tests/test_draws.py", "tests/test_limits.py", "tests/test_docstrings.py",
    "tests/jit/test_bands.py", "tests/jit/test_kernel.py", "tests/cli/test_settings.py", "tests/cli/test_render.py",
    "tests/pairs/test_pair_sum.py", "tests/pairs/test_clamps.py", "tests/sssil/crown/test_pattern.py",
    "tests/cluster/clustering", "tests/lights/test_warp.py")

# what `make test` leaves out beside the tests that are marked slow: cases that take long beside others of their kind
LONG = {
    "tests/bench/test_measure.py": (
        "test_a_method_of_the_screen_is_judged_by_what_the_camera_sees_as_well",
        "test_the_path_tracer_s_line_estimates_what_the_reference_does",
    ),
    "tests/bench/test_val_split.py": (
        "test_each_step_is_the_change_between_literal_pictures[cornell_sphere:faces=80]",
    ),
    "tests/benchmarks/test_mutate.py": (
        "test_a_killed_run_goes_on",
        "test_faults_of_the_sources_are_programs",
        "test_the_report_has_score_and_survivors",
    ),
    "tests/cli/test_bench.py": (
        "test_a_choice_that_gives_no_picture_is_told",
        "test_a_split_of_blended_frames_has_a_temporal_part",
    ),
    "tests/cli/test_destination.py": (
        "test_a_file_of_another_program_is_overwritten_by_force_alone[compare]",
        "test_missing_folders_are_made_one_deep_or_where_one_says_so[compare]",
    ),
    "tests/compare/test_flip.py": ("test_a_larger_error_is_seen_more",),
    "tests/compare/test_results.py": ("test_a_kill_leaves_whole_files_or_none",),
    "tests/jit/test_ahead.py": (
        "test_the_list_is_what_methods_call[gather]",
        "test_the_list_is_what_methods_call[multires]",
        "test_the_list_is_what_methods_call[truth]",
        "test_the_list_is_what_methods_call[val]",
        "test_the_list_is_what_methods_call[vpl]",
    ),
    "tests/pairs/test_sphere.py": ("test_cones_are_integrated[float64]",),
    "tests/scene/test_linear.py": ("test_time_grows_with_the_file[own_meshes]",),
    "tests/splat/sii/test_sii.py": (
        "test_error_slopes_of_random_and_low_discrepancy_patterns",
        "test_no_lamps_light_depends_on_the_number_of_lights[{'pattern': 'random'}]",
    ),
    "tests/sssil/crown/test_texel_form_factor.py": (
        "test_a_disc_of_a_share_is_as_dark_as_that[1.0]",
        "test_few_samples_are_unbiased",
    ),
    "tests/sssil/temporal/test_sequence.py": ("test_only_what_the_next_frame_needs_is_kept",),
    "tests/sssil/test_against_truth.py": (
        "test_every_pixel_lights_every_pixel[True-none]",
        "test_the_line_of_figure_5",
    ),
    "tests/truth/test_bias_compensation.py": (
        "test_bounded_light_and_short_rays_are_the_two_parts_of_the_integral[0.003]",
    ),
    "tests/truth/test_caustics.py": ("test_without_the_option_the_lobe_is_an_emitter_like_any_other",),
    "tests/truth/test_closed_forms.py": (
        "test_estimators_agree[several]",
        "test_integrating_sphere[combined]",
        "test_the_naive_twin[True-smoothstep]",
    ),
    "tests/truth/test_error.py": ("test_pixels_lie_within_their_standard_error[light]",),
    "tests/truth/test_faces_and_lobes.py": (
        "test_lobes_beyond_the_bound_are_left_to_the_hemisphere[0.002]",
        "test_lobes_beyond_the_bound_are_left_to_the_hemisphere[0.1]",
    ),
    "tests/truth/test_glossy.py": ("test_the_sharpest_lobes_are_mirrors[1000000.0]",),
    "tests/truth/test_light_sets.py": (
        "test_points_follow_the_density",
        "test_sets_and_densities_change_no_expectation[spot]",
    ),
    "tests/truth/test_receiver_lobes.py": (
        "test_estimators_agree[2.0-20.0]",
        "test_every_texel_of_the_map_gives_the_same[1.0-None]",
        "test_every_texel_of_the_map_gives_the_same[1000.0-None]",
        "test_every_texel_of_the_map_gives_the_same[30.0-20.0]",
        "test_photons_and_directions_share_out_sharp_senders[40.0]",
        "test_the_error_falls_with_the_root_of_the_samples[100000.0]",
        "test_without_visibility_the_sum_over_every_texel[900.0]",
    ),
    "tests/truth/test_textures.py": (
        "test_colour_bleeds_as_every_texel_of_the_map_says[bilinear]",
        "test_colour_bleeds_as_every_texel_of_the_map_says[nearest]",
    ),
    "tests/truth/test_visible_emitters.py": (
        "test_estimators_agree_and_all_is_more",
        "test_the_part_of_a_sphere_that_is_seen[combined]",
    ),
    "tests/truth/test_vpl.py": (
        "test_all_texels_converge_to_the_truth[cornell_box]",
        "test_the_full_sum_without_visibility_is_that_of_sii_and_of_the_truth",
    ),
    "tests/test_cutouts.py": ("test_flux_behind_a_plate_that_is_half_hole[float64]",),
    "tests/test_draws.py": ("test_neighbouring_seeds_streams_and_parts_are_independent",),
    "tests/vectors/test_port_c.py": ("test_the_buffers_of_every_method_are_within",),
    "tests/vectors/test_truth_stages.py": (
        "test_a_sum_over_the_light_s_cone_agrees",
        "test_another_estimator_agrees[truth-visible]",
        "test_the_chain_is_the_method[truth-two-bounces]",
    ),
    "tests/wiring/test_multires.py": (
        "test_the_twin[shadows of clusters of unclamped light]",
        "test_the_twin[shadows of clusters]",
    ),
    "tests/wiring/test_truth.py": ("test_the_mean[visible emitters, not blocked]",),
}


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--evidence", action="store_true", help="print feature id, test and measured figure")
    parser.addoption("--all", action="store_true", help="run the slow tests too")


def pytest_configure() -> None:
    with warnings.catch_warnings():  # third-party modules that warn on their first import
        warnings.simplefilter("ignore")
        import trimesh  # noqa: F401


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if not any("::" in argument for argument in config.args):
        _expect_long_tests(items)
    for item in items:
        if item.nodeid.startswith(QUICK):
            item.add_marker("quick")
        if item.name in LONG.get(item.nodeid.partition("::")[0], ()):
            item.add_marker("slow")
    if not config.getoption("--all"):
        slow = [item for item in items if item.get_closest_marker("slow")]
        if slow:
            config.hook.pytest_deselected(items=slow)
            items[:] = [item for item in items if not item.get_closest_marker("slow")]


def _expect_long_tests(items: list[pytest.Item]) -> None:
    """Refuse names of long tests that their files do not have."""
    found: dict[str, set[str]] = {}
    for item in items:
        found.setdefault(item.nodeid.partition("::")[0], set()).add(item.name)
    gone = [f"{file}::{name}" for file in LONG.keys() & found.keys() for name in set(LONG[file]) - found[file]]
    if gone:
        raise pytest.UsageError(f"LONG in tests/conftest.py names tests that are not there: {', '.join(sorted(gone))}")


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Put features where a report carries them from a worker to the process that prints."""
    item.user_properties += [("feature", feature) for mark in item.iter_markers("feature") for feature in mark.args]


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    if not config.getoption("--evidence"):
        return
    reports = [report for outcome in ("passed", "failed") for report in terminalreporter.getreports(outcome)]
    table = sorted(row for report in reports if report.when == "call" for row in _evidence_of(report))
    if table:
        terminalreporter.section("evidence")
        for feature, test, figure in table:
            terminalreporter.write_line(f"{feature:8} {test}\n         {figure}")


def _evidence_of(report: pytest.TestReport) -> list[tuple[str, str, str]]:
    """Return a row for each feature whose evidence a test measured."""
    figure = "; ".join(str(text) for kind, text in report.user_properties if kind == "figure") or "-"
    figure = figure if report.passed else f"FAILED ({figure})"
    return [(str(feature), report.nodeid, figure) for kind, feature in report.user_properties if kind == "feature"]


@pytest.fixture
def evidence(request: pytest.FixtureRequest) -> Callable[[str], None]:
    """Return a function that keeps a measured figure for the evidence table."""
    return lambda figure: request.node.user_properties.append(("figure", figure))


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Return the folder of real scenes (REFGI_DATA), or skip: a user of the project has none."""
    folder = Path(os.environ.get("REFGI_DATA", ROOT / ".." / "shared" / "data")).resolve()
    if not folder.is_dir():
        pytest.skip("no real scenes here: set REFGI_DATA to their folder")
    return folder


@pytest.fixture(scope="session")
def failure_dir() -> Path:
    """Return where a failed picture test leaves image, reference and error."""
    folder = ROOT / "out" / "failures"
    folder.mkdir(parents=True, exist_ok=True)
    return folder

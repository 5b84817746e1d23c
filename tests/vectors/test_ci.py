"""What a port's continuous integration reads: expected failures, what must have run, JUnit, annotations, exit codes."""

import shutil
from xml.etree import ElementTree

import numpy as np
import pytest
from click.testing import CliRunner

from refgi.cli.group import VerbGroup
from tests.vectors.port import Port

CASE = "sii-warp-a"


@pytest.fixture
def port(kit, tmp_path):
    return Port(kit, CASE, tmp_path)


def check(port, *options, case=True):
    arguments = ["vectors", "check", str(port.kit.folder), str(port.folder), *(("--case", CASE) if case else ())]
    return CliRunner().invoke(VerbGroup.refgi(), [*arguments, *map(str, options)])


def expecting(tmp_path, text):
    (tmp_path / "expected.txt").write_text(text)
    return "--expect", tmp_path / "expected.txt"


def spoil(port, *names):
    for name in names:
        port.write(name, 3 * port.arrays[name])


def test_expected_failures_do_not_count_and_are_told(port, tmp_path):
    spoil(port, "rsm.reflected_flux0.flux", "pairs.sum")
    both = expecting(tmp_path, "# the lobes are not done\nsii-*/rsm.reflected_flux?\npairs.sum  # as well\n\n")
    done = check(port, *both)
    assert done.exit_code == 0
    assert "17 exact, 2 out; 2 of them expected to fail" in done.stdout
    assert "expected to fail: sii-*/rsm.reflected_flux?" in done.stdout
    assert "first wrong stage" not in done.stdout
    assert "and does not" not in done.stdout
    done = check(port, *expecting(tmp_path, "rsm.reflected_flux0"))
    assert done.exit_code == 1
    assert "first wrong stage: pairs.sum of sii-warp-a" in done.stdout
    assert check(port, *expecting(tmp_path, "sii-warp-b/rsm.reflected_flux0\npairs.sum")).exit_code == 1


def test_an_unexpected_pass_is_told_and_a_stale_name_refused(port, tmp_path):
    done = check(port, *expecting(tmp_path, "rsm.reflected_flux0\nval-rim/lights.pixel_lights\n"))
    assert done.exit_code == 0
    assert "expected to fail and does not: rsm.reflected_flux0\n" in done.stdout
    assert "does not: val-rim" not in done.stdout  # not run
    done = check(port, *expecting(tmp_path, "rms.reflected_flux0"))
    assert done.exit_code == 2
    assert "--expect: expected [CASE/]STAGE, got 'rms.reflected_flux0'" in done.stderr
    assert "did you mean 'rsm.reflected_flux0'?" in done.stderr
    assert check(port, "--expect", tmp_path / "none.txt").exit_code == 2


def test_what_follows_from_an_expected_failure_does_not_count_in_a_chain(port, tmp_path):
    spoil(port, "rsm.reflected_flux0.flux", "lights.importance0", "lights.pixel_lights.flux")
    expected = expecting(tmp_path, "rsm.reflected_flux0")
    assert check(port, *expected).exit_code == 1
    done = check(port, "--chained", *expected)
    assert done.exit_code == 0
    assert "made from stages that are expected to fail" in done.stdout
    spoil(port, "rsm.reflected_flux1.flux")  # lights are made from both
    done = check(port, "--chained", *expected)
    assert done.exit_code == 1
    assert "first wrong stage: rsm.reflected_flux1" in done.stdout


def test_a_part_is_counted_and_what_is_required_must_have_run(port):
    for name in port.arrays:
        if not name.startswith(("rsm.map", "lights.warp0")):
            port.remove(name)
    done = check(port)
    assert done.exit_code == 0
    assert ("a part alone: 14 of 19 stages not run, 0 of 1 cases without any; --require NAME makes them count"
            in done.stdout)
    cases = len(port.kit.manifest.cases)
    assert f"{cases - 1} of {cases} cases without any" in check(port, case=False).stdout
    for name in ("rsm.map", "sii-warp-a/rsm.map", "warp"):
        assert check(port, "--require", name).exit_code == (4 if name == "warp" else 0), name
    for name in ("sum", "sii-warp-a/pairs.sum", "sii-warp", "all"):
        done = check(port, "--require", name)
        assert done.exit_code == 4, name
        assert "required and not run: sii-warp-a/" in done.stdout
    assert check(port, "--require", "val", case=False).exit_code == 4
    done = check(port, "--require", "pairs.summ")
    assert done.exit_code == 2
    assert "did you mean 'pairs.sum'?" in done.stderr


def test_the_check_stops_at_the_first_wrong_stage_that_counts(port, tmp_path):
    spoil(port, "rsm.map_surface0.depth", "rsm.reflected_flux0.flux", "pairs.sum")
    done = check(port, "--fail-fast", *expecting(tmp_path, "rsm.map_surface0"))
    assert done.exit_code == 1
    assert "first wrong stage: rsm.reflected_flux0" in done.stdout
    assert "stopped at the first wrong stage: 16 stages not looked at" in done.stdout
    assert "pairs.sum" not in done.stdout


def test_an_empty_folder_and_none_are_told_apart(port):
    shutil.rmtree(port.folder)
    done = check(port, case=False)
    assert done.exit_code == 2
    assert "expected a folder of a port's arrays, got none" in done.stderr
    port.folder.mkdir()
    done = check(port, case=False)
    assert done.exit_code == 4
    assert "nothing to check: OUTPUT/<case>/<array>.npy is where arrays are looked for" in done.stdout


def test_junit(port, tmp_path):
    spoil(port, "rsm.reflected_flux0.flux", "lights.pixel_lights.flux", "pairs.sum")
    port.write("rsm.reflected_flux1.flux", port.arrays["rsm.reflected_flux1.flux"][0])
    port.remove("lights.footprints")
    file = tmp_path / "junit.xml"
    done = check(port, "--junit", file, "--require", "footprints", *expecting(tmp_path, "lights.pixel_lights"))
    assert done.exit_code == 1
    (suite,) = ElementTree.parse(file).getroot()
    assert suite.attrib == {"name": CASE, "tests": "19", "failures": "2", "errors": "2", "skipped": "1"}
    tests = {test.get("name"): test for test in suite}
    assert list(tests["rsm.map_triangles0"]) == []
    assert tests["rsm.reflected_flux0"].find("failure").get("message") == "out"
    assert "likely: every element is 3 times" in tests["rsm.reflected_flux0"].find("failure").text
    assert "expected shape" in tests["rsm.reflected_flux1"].find("error").text
    assert tests["lights.footprints"].find("error").get("message") == "not run"
    assert tests["lights.pixel_lights"].find("skipped").get("message") == "expected to fail: lights.pixel_lights"
    check(port, "--junit", file, "--chained")
    (suite,) = ElementTree.parse(file).getroot()
    assert {test.find("skipped").get("message") for test in suite if test.find("skipped") is not None} == {
        "made from wrong inputs", "not run"}
    assert check(port, "--junit", tmp_path / "none" / "junit.xml").exit_code == 2
    shutil.rmtree(port.folder / CASE)
    assert check(port, "--junit", file).exit_code == 4
    assert ElementTree.parse(file).getroot()[0].get("errors") == "19"


def test_annotations(port, tmp_path):
    assert "::error" not in check(port, "--format", "github").stdout
    spoil(port, "rsm.reflected_flux0.flux")
    port.remove("pairs.sum")
    done = check(port, "--format", "github", "--require", "sum", *expecting(tmp_path, "lights.pixel_lights"))
    assert done.exit_code == 1
    wrong, missing, passing, *counts = done.stdout.splitlines()
    assert wrong.startswith("::error title=refgi%3A rsm.reflected_flux is wrong in 1 of 2%2C first rsm.reflected_flux0 "
                            "of sii-warp-a::")
    assert "%0A  likely: every element is 3 times what it should be" in wrong
    assert missing == "::error title=refgi%3A required and not run::sii-warp-a/pairs.sum"
    assert passing == "::warning title=refgi%3A expected to fail and does not::lights.pixel_lights"
    assert counts[-1] == "first wrong stage: rsm.reflected_flux0 of sii-warp-a"


def test_numbers_that_are_none_are_written_as_xml(port, tmp_path):
    flux = port.arrays["rsm.reflected_flux0.flux"].copy()
    flux[0, 5, 5] = np.nan
    port.write("rsm.reflected_flux0.flux", flux)
    check(port, "--junit", tmp_path / "junit.xml")
    assert "NaN or infinity here" in (tmp_path / "junit.xml").read_text()

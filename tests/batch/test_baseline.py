"""A batch beside an earlier one, both made by hand."""

import pytest

from refgi.batch.outcome import first_change, worse
from refgi.bench.results import read_result
from refgi.errors import InputError
from tests.batch.made import result_of, run_of, scene_of

BEFORE = run_of("sii", ("lights=16",), rmse=0.2, unoccluded=0.1, flip=0.3, ssim=0.9, relmse=0.5, picture="old.exr",
                hashes=(("a", "1"), ("b", "2"), ("c", "3")))


def found(tolerance=0.1, **changes):
    now = run_of("sii", ("lights=16",), **{
        "rmse": 0.2, "unoccluded": 0.1, "flip": 0.3, "ssim": 0.9, "relmse": 0.5, "picture": "new.exr",
        "hashes": (("a", "1"), ("b", "x"), ("c", "y")), **changes})
    return worse(result_of(scene_of("box", [now])), result_of(scene_of("box", [BEFORE])), tolerance, "base")


@pytest.mark.parametrize(("changes", "figures"), [
    ({}, []),
    ({"rmse": 0.219, "unoccluded": 0.109, "flip": 0.329, "relmse": 0.549, "ssim": 0.811}, []),
    ({"rmse": 0.221}, ["rmse"]),
    ({"unoccluded": 0.111}, ["rmse_unoccluded"]),
    ({"flip": 0.331}, ["flip"]),
    ({"relmse": 0.551}, ["relmse"]),
    ({"ssim": 0.809}, ["ssim"]),
    ({"rmse": 0.1, "flip": 0.0, "ssim": 1.0, "seconds": (9.0,)}, []),
    ({"rmse": None}, ["rmse"]),
])
def test_what_is_worse_by_more_than_the_tolerance(changes, figures):
    assert [finding.figure for finding in found(**changes)] == figures


def test_a_finding_names_figure_pictures_and_the_first_stage_that_changed():
    finding, = found(tolerance=0.0, rmse=0.2001)
    assert str(finding) == ("box.sii (lights=16): rmse was 0.2 and is 0.2001; new.exr; before: base/old.exr; "
                            "first stage that changed: b")


def test_the_first_stage_that_changed():
    def of(*hashes):
        return run_of("sii", hashes=hashes)

    assert first_change(of(("a", "1"), ("b", "2")), of(("a", "1"), ("b", "2"))) is None
    assert first_change(of(("a", "1")), of(("a", "1"), ("b", "2"))) == "b"
    assert first_change(of(("a", "1"), ("b", "2")), of(("a", "1"))) == "b"
    assert first_change(of(("a", "1"), ("n", "2")), of(("a", "1"), ("b", "2"))) == "n"
    assert first_change(of(("a", "1")), of()) is None


def test_only_what_both_hold_is_compared():
    now = result_of(scene_of("box", [run_of("sii", ("lights=16",), rmse=9.0)]))
    for other in (scene_of("hall", [BEFORE]), scene_of("box", [run_of("sii", ("lights=17",))]), scene_of("box", [])):
        assert worse(now, result_of(other), 0.0) == []
    line = result_of(scene_of("box", [], [run_of("truth", rmse=0.1)]))
    assert [one.place for one in worse(result_of(scene_of("box", [], [run_of("truth", rmse=0.2)])), line, 0.0)] == [
        "box.truth (default)"]


@pytest.mark.parametrize(("text", "said"), [(None, "cannot be read"), ("{", "expected results"), ("{}", "environment")])
def test_what_is_no_baseline(tmp_path, text, said):
    if text is not None:
        (tmp_path / "results.json").write_text(text)
    with pytest.raises(InputError, match=said) as error:
        read_result(tmp_path / "results.json", "--baseline")
    assert "results.json" in str(error.value)
    assert error.value.key == "--baseline"

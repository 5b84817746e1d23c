"""A batch beside an earlier one, both made by hand."""

import math

import numpy as np
import pytest

from refgi.batch.outcome import Still, first_change, over_time, worse
from refgi.bench.folder import read_result
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


SHAPE = (3, 20, 30)
FRAMES = 8


def stills(pictures, truths, variance=0.0, covered=None):
    covered = np.ones(SHAPE[1:], bool) if covered is None else covered
    for picture, truth in zip(pictures, truths, strict=True):
        yield Still(np.full(SHAPE, picture, float), np.full(SHAPE, truth, float), np.full(SHAPE, variance), covered)


RAMP = [10.0 + 2 * k for k in range(-5, FRAMES)]
TRUTH = RAMP[5:]


@pytest.mark.parametrize("late", [0, 1, 3])
def test_a_steady_change_shown_late_has_that_lag_and_no_flicker(late):
    found = over_time(stills(RAMP[5 - late:len(RAMP) - late], TRUTH))
    assert found.lag == pytest.approx(late)
    assert found.flicker == pytest.approx(0, abs=1e-12)
    assert found.noise == 0


def test_a_blend_with_the_frame_before_has_the_lag_of_its_share():
    share, light, blend = 0.6, 0.0, []
    for k in range(-200, FRAMES):
        light = share * light + (1 - share) * (10.0 + 2 * k)
        blend.append(light)
    assert over_time(stills(blend[200:], TRUTH)).lag == pytest.approx(share / (1 - share))


def test_flicker_is_what_changes_beside_the_truth():
    truths = [5.0, 6.0, 8.0]
    found = over_time(stills([5.0 + 1, 6.0 - 1, 8.0 + 1], truths))  # changes by -2 and 2 too much
    assert found.flicker == pytest.approx(2 / 7)  # the mean over frames that have one before


def test_an_error_that_stays_is_no_flicker():
    assert over_time(stills([7.0, 8.0, 10.0], [5.0, 6.0, 8.0])).flicker == pytest.approx(0, abs=1e-12)


def test_noise_of_the_truth_is_stated_and_taken_off_the_lag():
    rng, deviation = np.random.default_rng(3), 0.4
    shape = (3, 200, 200)

    def frames():
        for k in range(FRAMES):
            noise = deviation * rng.standard_normal(shape)
            yield Still(np.full(shape, 10.0 + 2 * k), 10.0 + 2 * k + noise, np.full(shape, deviation**2),
                        np.ones(shape[1:], bool))

    found = over_time(frames())
    assert found.flicker == pytest.approx(found.noise, rel=0.02)
    assert found.lag == pytest.approx(0, abs=0.01)  # 0.04 with the noise left in


def test_only_pixels_with_light_in_both_frames_count():
    half = np.zeros(SHAPE[1:], bool)
    half[:10] = True

    def frames():
        for k, covered in enumerate((half, np.ones_like(half), half)):
            picture = np.where(half, 10.0 + 2 * k, 1000.0 * k)
            yield Still(np.broadcast_to(picture, SHAPE), np.full(SHAPE, 10.0 + 2 * k), np.zeros(SHAPE), covered)

    assert over_time(frames()).flicker == pytest.approx(0, abs=1e-12)


def test_what_cannot_be_told():
    assert all(map(math.isnan, over_time(stills([1.0], [1.0]))))
    still = over_time(stills([2.0, 3.0], [5.0, 5.0]))
    assert still.flicker == pytest.approx(0.2)
    assert math.isnan(still.lag)
    assert math.isnan(over_time(stills([2.0, 3.0], [5.0, 5.1], variance=0.01)).lag)  # no more than noise

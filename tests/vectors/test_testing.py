"""What ports' test suites import: assertions with a report, the fixture, the example project of the docs."""

import shutil
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import refgi
from refgi import testing
from refgi.errors import InputError
from refgi.image import read_exr
from refgi.testing import assert_image_close, assert_stage_close, kit_folder, stages
from refgi.vectors.check import Asked
from refgi.vectors.judge import judge_picture

EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "port_tests"


def flux_of(kit):
    (case,) = kit.cases(Asked(cases=("sii-warp-b",)))
    return kit.array(case, "rsm.reflected_flux0.flux")


def test_a_stage(kit):
    flux = flux_of(kit)
    assert_stage_close(flux.astype(np.float64), "sii-warp-b", "rsm.reflected_flux0.flux", kit=kit)
    with pytest.raises(AssertionError, match=r"rsm\.reflected_flux0 is out(.|\n)*likely: every element is pi times"):
        assert_stage_close(np.pi * flux, "sii-warp-b", "rsm.reflected_flux0.flux", kit=kit)
    with pytest.raises(AssertionError, match="expected shape"):
        assert_stage_close(flux[0], "sii-warp-b", "rsm.reflected_flux0.flux", kit=kit)
    assert_stage_close(flux.astype(np.float16), "sii-warp-b", "rsm.reflected_flux0.flux", tier="T2", kit=kit)
    with pytest.raises(InputError, match="case: expected one of"):
        assert_stage_close(flux, "sii-warp-z", "rsm.reflected_flux0.flux", kit=kit)


def noisy(seed, samples=64, size=24):
    """Return an estimate of a smooth picture, its variance, and the picture."""
    y, x = np.mgrid[:size, :size] / size
    picture = np.stack([1 + x, 2 - y, 1 + x * y])
    draws = picture * np.random.default_rng(seed).exponential(1.0, (samples, *picture.shape))
    return draws.mean(axis=0), draws.var(axis=0, ddof=1) / samples, picture


def test_estimates_of_one_picture_are_close_and_others_are_not(tmp_path):
    for seed in range(5):
        (a, va, _), (b, vb, _) = noisy(seed), noisy(100 + seed)
        assert_image_close(a, b, variance=vb, own_variance=va)
        with pytest.raises(AssertionError, match="RMSE"):
            assert_image_close(1.1 * a, b, variance=vb, own_variance=va)
        with pytest.raises(AssertionError, match="RMSE"):
            assert_image_close(a[:, ::-1], b, variance=vb, own_variance=va)
    with pytest.raises(AssertionError, match="pictures: "):
        assert_image_close(a * np.pi, b, variance=vb, report=tmp_path / "report")
    assert set(read_exr(tmp_path / "report" / "difference.exr")[0]) == {"R", "G", "B"}


def test_a_bias_that_hides_in_noise_shows_in_the_sum():
    """2 % of a picture whose pixels are 12 % noise."""
    (a, va, _), (b, vb, _) = noisy(1), noisy(2)
    assert judge_picture(a, b, vb, va).close
    assert not judge_picture(1.03 * a, b, vb, va, tolerance=0.0).close


def test_pictures_without_noise_have_a_tolerance():
    *_, picture = noisy(0)
    assert_image_close(1.005 * picture, picture, tolerance=0.01)
    with pytest.raises(AssertionError, match=r"too few digits|times what"):
        assert_image_close(1.02 * picture, picture, tolerance=0.01)
    with pytest.raises(InputError, match="shape"):
        assert_image_close(picture[:, 1:], picture)


def test_a_kit_of_ones_own_is_used(monkeypatch, tmp_path):
    monkeypatch.setenv("REFGI_KIT", str(tmp_path))
    assert kit_folder() == tmp_path


def test_a_kit_is_made_anew_for_what_makes_it_alone(monkeypatch, tmp_path):
    """Imports run one way: what lies above refgi.vectors changes no kit."""
    monkeypatch.setattr(refgi, "__file__", str(tmp_path / "__init__.py"))
    files = [tmp_path / one for one in ("vectors/cases.py", "literal/pairs.bugs", "scene/cli.py", "cli/vectors.py",
                                        "testing.py")]
    for file in files:
        file.parent.mkdir(exist_ok=True)
        file.write_text("")
    digests = [testing._digest()]
    for file in files:
        file.write_text(file.name)
        digests.append(testing._digest())
    assert [one != other for one, other in pairwise(digests)] == [True, True, True, False, False]


@pytest.mark.usefixtures("kit")
def test_the_example_project_passes_and_finds_a_bug(tmp_path):
    project = tmp_path / "port_tests"
    shutil.copytree(EXAMPLE, project, ignore=shutil.ignore_patterns("__pycache__"))

    def tested():
        return subprocess.run([sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(project)],
                              capture_output=True, text=True, check=False, cwd=project)

    assert "2 passed" in tested().stdout
    port = project / "my_port.py"
    port.write_text(port.read_text().replace("np.maximum(0, -(normal", "np.abs((normal"))
    done = tested().stdout
    assert "1 failed, 1 passed" in done
    assert "likely: the receiver's cosine is taken as absolute value" in done


@pytest.mark.feature("REF-33")
def test_arrays_of_any_scene_are_given_to_a_suite(tmp_path):
    data = stages("cornell_box", "sii", folder=tmp_path / "kit", only="pairs.", width=12, height=9, rsm_resolution=8)
    assert set(data) >= {"pairs.sum", "pairs.sum.lights.flux", "pairs.sum.receivers.position"}
    assert data["pairs.sum"].shape == (3, 9, 12)
    data.assert_close(data["pairs.sum"], "pairs.sum")
    with pytest.raises(AssertionError, match=r"pairs\.sum"):
        data.assert_close(2 * data["pairs.sum"], "pairs.sum")
    with pytest.raises(KeyError, match="none"):
        data["none"]

"""What commands say and how they end where the truth's own error is not to be trusted (REF-31).

By the light side alone a Cornell box has heavy tails in its corners, by both estimators none
(tests/truth/test_tails.py).
"""

import json

import numpy as np
import pytest
from click.testing import CliRunner

from refgi.batch.plan import broken, read_threshold
from refgi.bench.results import markdown
from refgi.cli.group import VerbGroup
from refgi.compare.outcome import measure
from refgi.image import read_exr
from refgi.truth import TruthResult
from tests.batch.made import path_of, result_of, run_of, scene_of

SIZE = ("--size", "64x64")
SAID = "the error is not to be trusted"
PLAN = """
[batch]
scenes = ["cornell_box"]
size = [64, 64]
rsm_resolution = 32
rounds = 1
truth = {samples = 128, estimator = "light"}
[sii]
lights = [16]
[expect]
"cornell_box.sii.rmse" = "<= 9"
"cornell_box.sii.seconds" = "<= 999"
"""

pytestmark = [pytest.mark.feature("REF-31"), pytest.mark.filterwarnings("ignore:.* of the indirect light")]


def refgi(*arguments):
    return CliRunner().invoke(VerbGroup.refgi(), [*map(str, arguments)])


@pytest.fixture
def doubted(monkeypatch):
    """Make every error doubtful, whatever its tails say."""
    monkeypatch.setattr(TruthResult, "doubt", property(lambda _: SAID))


def test_compare(tmp_path, evidence):
    done = refgi("compare", "cornell_box", *SIZE, "--methods", "sii", "--rsm-resolution", "32", "--set",
                 "truth.estimator=light", "--set", "truth.samples=128", "--out", tmp_path / "out")
    assert done.exit_code == 0, done.output
    assert f"cornell_box: truth: {SAID}" in done.stderr
    found = json.loads((tmp_path / "out" / "results.json").read_text())
    stated = found["references"]["truth"]["estimate"]
    assert stated["trusted"] is False
    assert stated["tail_index"] > 0.7
    assert not any(figure["is_noise"] for figure in found["methods"]["sii"]["against"]["truth"]["figures"].values())
    html = (tmp_path / "out" / "index.html").read_text()
    assert f'<p class="failure"><strong>truth</strong> {SAID}' in html
    assert read_exr(tmp_path / "out" / "truth.exr")[1]["estimate"]["tail_index"] == stated["tail_index"]
    evidence(f"results.json: k = {stated['tail_index']:.2f}, {stated['statement']}")


def test_what_would_be_noise_is_not_called_so(monkeypatch):
    rough = [part for key in ("samples=1", "picks=1", "estimator=light") for part in ("--set", f"truth.{key}")]

    def noises():
        done = refgi("compare", "cornell_box", "--size", "24x18", "--methods", "vpl", *rough, "--json")
        figures = json.loads(done.stdout)["methods"]["vpl"]["against"]["truth"]["figures"]
        return {name for name, one in figures.items() if one["is_noise"]}

    assert "rmse" in noises()
    monkeypatch.setattr(TruthResult, "doubt", property(lambda _: SAID))
    assert noises() == set()


def test_nothing_is_within_a_noise_that_is_not_trusted():
    mean = np.full((3, 8, 8), 2.0)
    trusted, not_trusted = (measure(mean + 0.01, mean, 0.01 * mean, trusted=one).figures for one in (True, False))
    assert trusted["rmse"].is_noise
    assert not any(figure.is_noise for figure in not_trusted.values())
    assert not_trusted["rmse"].noise == trusted["rmse"].noise


def test_check(tmp_path):
    file = tmp_path / "truth.exr"
    assert refgi("render", "cornell_box", *SIZE, "--method", "truth", "--set", "seed=5", "--out", file).exit_code == 0
    right = refgi("check", file, "--against", "cornell_box", "--tolerance", "0.5")
    assert right.exit_code == 0, right.output
    assert "irradiance is that of cornell_box by truth" in right.stdout
    light = ("--tolerance", "0.5", "--set", "estimator=light", "--set", "samples=128")
    done = refgi("check", file, "--against", "cornell_box", *light)
    assert done.exit_code == 1, done.output
    assert "irradiance is not known to be that of cornell_box by truth" in done.stdout
    assert f"truth: {SAID}" in done.stdout
    said = json.loads(refgi("check", file, "--against", "cornell_box", *light, "--json").stdout)
    assert (said["close"], said["trusted"]) == (True, False)
    wrong = refgi("check", file, "--against", "cornell_sphere", *light[2:])
    assert (wrong.exit_code, "irradiance is not that of" in wrong.stdout) == (1, True)


def test_choose(tmp_path):
    asked = ("choose", "cornell_box", *SIZE, "--methods", "sii", "--rounds", "1", "--error", "300%", "--set",
             "samples=192", "--set", "target_error=1e-4")
    assert "wished for" in refgi(*asked).stdout
    done = refgi(*asked, "--set", "estimator=light", "--emit", tmp_path / "plan.toml")
    assert done.exit_code == 1, done.output
    assert f"nothing is known to meet an error of 300 %: {SAID}" in done.stdout
    assert "refgi render" not in done.stdout
    assert not (tmp_path / "plan.toml").exists()


def test_batch(tmp_path):
    (tmp_path / "plan.toml").write_text(PLAN)
    done = refgi("batch", tmp_path / "plan.toml", "--out", tmp_path / "out")
    assert done.exit_code == 1, done.output
    assert "cornell_box: the error of the truth is not to be trusted" in done.stderr
    (line,) = [line for line in done.stderr.splitlines() if "expected" in line]
    assert line.startswith("refgi: cornell_box.sii (lights=16): rmse is")
    assert "expected <= 9, but in doubt: the truth's error is not to be trusted" in line


def doubtful(run, *names):
    errors = {name: one.model_copy(update={"in_doubt": name in names}) for name, one in run.errors.items()}
    return run.model_copy(update={"errors": errors})


@pytest.mark.parametrize(("name", "figure", "found"), [
    ("truth", "rmse", 1), ("truth", "flip", 1), ("truth", "seconds", 0), ("truth", "rmse_unoccluded", 0),
    ("unoccluded", "rmse", 0), ("unoccluded", "rmse_unoccluded", 1), ("truth", "lag", 1), ("unoccluded", "flicker", 0)])
def test_thresholds(name, figure, found):
    run = doubtful(run_of("sii", rmse=0.1, unoccluded=0.1, flip=0.1), name)
    result = result_of(scene_of("box@0", [run_of("sii", rmse=0.1, unoccluded=0.1, flip=0.1)]), scene_of("box@1", [run]),
                       paths=(path_of("box", "sii"),))
    threshold = read_threshold(f"box.sii.{figure}", "<= 1", ("box",), {"sii"}, "plan.toml")
    findings = broken([threshold], result)
    assert len(findings) == found
    assert all("in doubt" in str(one) for one in findings)


def test_a_bench_s_page_and_table_say_it():
    scene = scene_of("box", [doubtful(run_of("sii", unoccluded=0.1), "unoccluded"), doubtful(run_of("val"), "truth")])
    assert scene.doubts == ["the error of the truth (unoccluded) is not to be trusted, nor are figures against it",
                            "the error of the truth is not to be trusted, nor are figures against it"]
    result = result_of(scene)
    assert f"**{scene.doubts[1]}**" in markdown(result)
    assert result_of(scene_of("box", [run_of("sii")])).scenes[0].doubts == []


@pytest.mark.usefixtures("doubted")
def test_lobes_are_asked_too(tmp_path):
    file = tmp_path / "a.exr"
    done = refgi("render", "stage", "--size", "24x18", "--method", "truth", "--set", "samples=48", "--out", file,
                 "--json")
    lobes = json.loads(done.stdout)["estimate"]["lobes"]
    assert lobes["trusted"] is False
    assert lobes["statement"].endswith(SAID)
    assert read_exr(file)[1]["estimate"]["lobes"] == lobes

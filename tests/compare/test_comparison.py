"""compare(): what is run against what, what is timed, and what happens when a method fails."""

import dataclasses
import json
import sys
import types
import warnings
from typing import Any

import numpy as np
import pytest

import refgi
import refgi.methods
from refgi.compare import compare
from refgi.compare import comparison as module
from refgi.compare.metrics import Flip
from refgi.errors import InputError, RefgiWarning
from refgi.frame import Frame
from refgi.method import Method
from refgi.methods import METHODS
from refgi.scene import Camera, Geometry, Material, Scene, SpotLight, load_scene
from refgi.settings import Settings, of, setting
from refgi.stages import counted_pixels, stage
from refgi.truth import TruthSettings

pytestmark = [pytest.mark.filterwarnings("ignore:.* of the indirect light"),  # that is told: tests/pairs/test_loss
              pytest.mark.filterwarnings("ignore:a fake method")]

SIZE = {"width": 20, "height": 16, "rsm_resolution": 32}


@dataclasses.dataclass(frozen=True)
class FakeSettings(Settings):
    level: Any = setting(0.25, "irradiance everywhere; also what is no number")
    fails: bool = setting(False, "raises an error")


@stage("fake.even")
def even(frame, settings):
    return np.full((3, frame.height, frame.width), settings.level, frame.dtype) * frame.gbuffer.covered


def fake_method(frame, settings):
    warnings.warn(RefgiWarning("a fake method"), stacklevel=1)
    if settings.fails:
        raise InputError("lobes: expected none, got some")
    return even(frame, settings)


@pytest.fixture
def fakes(monkeypatch):
    """Two methods: `blind` knows no visibility, `seeing` does."""
    table = {name: Method(name, f"fake that is {name}", fake_method, FakeSettings, visibility=sees)
             for name, sees in (("blind", False), ("seeing", True))} | {"truth": METHODS["truth"]}
    monkeypatch.setattr(module, "flip", lambda *_: Flip(skipped="left out"))  # it has tests of its own
    for place in (module, refgi.methods):
        monkeypatch.setattr(place, "METHODS", table)
    return table


@pytest.fixture
def truth_settings():
    return TruthSettings(samples=24)


@pytest.fixture(scope="module")
def box():
    return load_scene("cornell_box")


def test_the_small_picture_before_a_timed_one_stands_for_it(box, truth_settings, fakes):
    seen = []

    def counting(frame, settings):
        seen.append((frame.width * frame.height, counted_pixels(frame.width * frame.height)))
        return even(frame, settings)

    fakes["seeing"] = fakes["seeing"]._replace(function=counting)
    compare(box, ["seeing"], truth_settings=truth_settings, **SIZE | {"width": 130, "height": 100})
    assert seen == [(module.WARM_UP_SIZE**2, 13000), (13000, 13000)]


@pytest.mark.usefixtures("fakes")
def test_a_method_without_visibility_is_judged_twice(box, truth_settings):
    got = compare(box, truth_settings=truth_settings, **SIZE)
    assert set(got.references) == {"truth", "unoccluded"}
    assert set(got.results) == {"blind", "seeing"}
    assert set(got.results["blind"].against) == {"truth", "unoccluded"}
    assert set(got.results["seeing"].against) == {"truth"}
    assert not got.references["unoccluded"].settings.visibility
    assert got.truth.settings == truth_settings


def test_settings_say_whether_a_method_is_judged_twice(box, truth_settings, fakes):
    fakes["blind"] = fakes["blind"]._replace(visibility=lambda settings: settings.level > 0)
    got = compare(box, ["blind"], truth_settings=truth_settings, method_settings={"blind": FakeSettings(0.5)}, **SIZE)
    assert set(got.references) == set(got.results["blind"].against) == {"truth"}
    got = compare(box, ["blind"], truth_settings=truth_settings, method_settings={"blind": FakeSettings(0.0)}, **SIZE)
    assert set(got.references) == set(got.results["blind"].against) == {"truth", "unoccluded"}


@pytest.mark.parametrize(("name", "blind", "seeing"), [
    ("multires", {}, {"visibility": "rays"}), ("hssil", {}, {"visibility": "rays"}),
    ("hssil", {}, {"visibility": "bitmask"}), ("val", {"visibility": None}, {}), ("vpl", {"visibility": False}, {})])
def test_methods_know_visibility_by_their_settings(name, blind, seeing):
    method = METHODS[name]
    assert not method.knows_visibility(of(method.settings, **blind))
    assert method.knows_visibility(of(method.settings, **seeing))


@pytest.mark.usefixtures("fakes")
def test_without_blind_methods_the_second_truth_is_not_traced(box, truth_settings):
    assert set(compare(box, ["seeing"], truth_settings=truth_settings, **SIZE).references) == {"truth"}


@pytest.mark.usefixtures("fakes")
def test_figures_and_pictures_belong_together(box, truth_settings):
    got = compare(box, ["seeing"], truth_settings=truth_settings, method_settings={"seeing": FakeSettings(0.5)}, **SIZE)
    result = got.results["seeing"]
    assert (result.irradiance[:, got.covered] == 0.5).all()
    error = 0.5 - got.truth.irradiance[:, got.covered]
    assert result.against["truth"].figures["bias"].value == pytest.approx(error.mean())
    frame = Frame(box, shadows="exact", **SIZE)
    assert np.array_equal(result.radiance, frame.radiance(result.irradiance))


@pytest.mark.usefixtures("fakes")
def test_a_methods_time_has_its_own_buffers_and_its_stages(box, truth_settings):
    """Each method gets a fresh frame: the second one draws its G-buffer again."""
    got = compare(box, truth_settings=truth_settings, **SIZE)
    for result in got.results.values():
        names = [run.name for run in result.runs]
        assert "rsm.gbuffer" in names
        assert "fake.even" in names
        assert result.seconds >= max(run.seconds for run in result.runs)


@pytest.mark.usefixtures("fakes")
def test_warnings_come_once_from_the_real_run(box, truth_settings):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        compare(box, ["seeing"], truth_settings=truth_settings, **SIZE)
    assert [str(w.message) for w in caught if w.category is RefgiWarning] == ["a fake method"]


@pytest.mark.usefixtures("fakes")
def test_one_method_that_fails_does_not_stop_the_others(box, truth_settings, tmp_path):
    got = compare(box, truth_settings=truth_settings, method_settings={"blind": FakeSettings(fails=True)},
                  out=tmp_path / "new", **SIZE)
    assert got.failures == {"blind": "lobes: expected none, got some"}
    assert set(got.results) == {"seeing"}
    assert not got.is_sound
    assert "lobes: expected none" in (tmp_path / "new" / "index.html").read_text("utf-8")
    assert json.loads((tmp_path / "new" / "results.json").read_text())["sound"] is False


@pytest.mark.usefixtures("fakes")
def test_non_finite_pixels_are_counted_and_unsound(box, truth_settings):
    got = compare(box, ["seeing"], truth_settings=truth_settings,
                  method_settings={"seeing": FakeSettings(float("nan"))}, **SIZE)
    measured = got.results["seeing"].against["truth"]
    assert measured.non_finite == got.covered.sum()
    assert np.isnan(measured.figures["mse"].value)
    assert not got.is_sound


def test_a_ledger_is_asked_for_only_where_files_are_written(box, truth_settings, tmp_path, fakes):
    asked = []

    def account(frame, settings):
        asked.append((frame.width, settings.level))
        row = types.SimpleNamespace(name="emitted", watts=np.ones(3), meaning="", is_part=False)
        return types.SimpleNamespace(rows=[row], difference=np.zeros(3))

    fakes["seeing"] = fakes["seeing"]._replace(ledger=account)
    assert compare(box, truth_settings=truth_settings, **SIZE).results["seeing"].ledger is None
    assert not asked
    compare(box, truth_settings=truth_settings, out=tmp_path, **SIZE)
    assert asked == [(20, 0.25)]
    methods = json.loads((tmp_path / "results.json").read_text())["methods"]
    assert methods["seeing"]["ledger"] == {"rows": {"emitted": [1.0] * 3}, "parts": [], "difference": [0.0] * 3}
    assert methods["blind"]["ledger"] is None


@pytest.mark.usefixtures("fakes")
def test_progress_names_what_runs(box, truth_settings, tmp_path):
    heard = []
    compare(box, ["seeing"], truth_settings=truth_settings, out=tmp_path, progress=lambda *a: heard.append(a), **SIZE)
    names = [name for name, _ in heard]
    assert names[0] == "truth"
    assert any(name.startswith("seeing: ") for name in names)
    assert "index.html" in names
    assert all(0 <= done <= 1 for _, done in heard)


@pytest.mark.parametrize(("arguments", "word"), [
    ({"methods": ["sii", "nothing"]}, "nothing"),
    ({"methods": ["truth"]}, "methods"),
    ({"methods": ["sii"], "method_settings": {"vpl": None}}, "vpl"),
    ({"methods": ["sii"], "method_settings": {"sii": TruthSettings()}}, "SiiSettings"),
    ({"methods": ["sii"], "truth_settings": 3}, "TruthSettings"),
    ({"width": 0}, "width"),
    ({"scene": "no_such_scene"}, "no_such_scene"),
])
def test_unusable_arguments_are_named(arguments, word):
    with pytest.raises(InputError, match=word):
        compare(**{"scene": "cornell_box"} | arguments)


def test_a_place_that_cannot_be_written_is_refused_before_anything_is_traced(box, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setattr(module._Runner, "reference", lambda *_: pytest.fail("traced"))
    with pytest.raises(InputError, match="out"):
        compare(box, ["sii"], out=tmp_path / "file" / "out", **SIZE)


def test_a_camera_that_sees_nothing_is_named():
    away = Scene("away", Geometry(np.eye(3), np.array([[0, 1, 2]], np.int32), np.zeros(1, np.int32)), (Material(),),
                 Camera((0.0, 0.0, 9.0), (0.0, 0.0, 20.0)),
                 (SpotLight((0.0, 5.0, 0.0), (0.0, -1.0, 0.0), 0.3, 0.4, (1.0, 1.0, 1.0)),))
    with pytest.raises(InputError, match="camera"):
        compare(away, ["sii"], **SIZE)


def test_an_interrupted_truth_can_go_on_and_the_second_keeps_its_own_file():
    settings = module.limited(TruthSettings(checkpoint="sums.npz"), "unoccluded", module.WITHOUT_VISIBILITY)
    assert (settings.visibility, settings.checkpoint) == (False, "sums.npz.unoccluded")
    assert module.limited(TruthSettings(), "unoccluded", module.WITHOUT_VISIBILITY).checkpoint is None


def test_a_second_comparison_traces_no_truth_that_a_folder_holds(box, tmp_path, monkeypatch):
    truth = sys.modules["refgi.truth.truth"]

    settings = TruthSettings(samples=48, checkpoint=tmp_path)
    first = compare(box, ["sii"], truth_settings=settings, **SIZE)
    traced, one_pass = [], truth.one_pass
    monkeypatch.setattr(truth, "one_pass", lambda task, number: traced.append(len(task.receivers.pixel)) or one_pass(
        task, number))
    again = compare(box, ["gather"], truth_settings=settings, **SIZE)
    assert len(traced) == 4  # two warm-ups of two passes, on other pixels
    assert int(first.truth.samples.max()) == 48
    assert all(count > (first.truth.samples > 0).sum() for count in traced)
    assert set(first.references) == {"truth", "unoccluded"}
    for name, reference in first.references.items():
        assert np.array_equal(reference.irradiance, again.references[name].irradiance)


@pytest.mark.feature("REF-21")
def test_the_real_methods_on_the_cornell_box(box, truth_settings, evidence):
    """Picture: sii without visibility is nearer to the truth without visibility than to the truth; vpl is unbiased."""
    got = compare(box, truth_settings=truth_settings, width=32, height=32, rsm_resolution=64)
    assert got.is_sound
    assert set(got.results) == set(METHODS) - {"truth"}
    sii = got.results["sii"].against
    assert abs(sii["unoccluded"].figures["bias"].value) < abs(sii["truth"].figures["bias"].value)
    evidence("; ".join(f"{r.name} relMSE {r.against['truth'].figures['relmse'].value:.3g} in {r.seconds:.3g} s"
                       for r in got.results.values()))


def test_the_package_is_the_function_too():
    """`import refgi.compare` must not turn `refgi.compare(...)` into a call of a module."""
    with pytest.raises(InputError, match="no_such_scene"):
        refgi.compare("no_such_scene")

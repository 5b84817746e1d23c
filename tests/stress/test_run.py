"""Methods with faults put in: each must break the promise that is about it, and no other."""

import warnings
from types import SimpleNamespace

import numpy as np
import pytest

import refgi.methods
from refgi import load_scene
from refgi.errors import InputError
from refgi.jit import most_threads
from refgi.scene import PointLight
from refgi.stress import promises
from refgi.stress.changes import CHANGES, Changed, NotPromisedError
from refgi.stress.run import (
    Seen,
    Silence,
    bits_apart,
    estimates_apart,
    means_apart,
    rmse_apart,
    same_surface,
    stress,
    unsound,
)
from refgi.truth.result import TruthResult

SIZE = {"width": 16, "height": 12}
EXACT = ["flux x 2^27", "length x 2^-27", "moved aside", "faces permuted", "hidden plane"]


@pytest.fixture(scope="module")
def box():
    return load_scene("cornell_box")


def broken(scene, changes=None, method="hssil"):
    return {found.row.property for found in stress(scene, [method], changes=changes, **SIZE) if not found.row.passed}


@pytest.fixture
def faulty(monkeypatch):
    """Put a fault into what methods render: a function of (irradiance, frame)."""
    render = refgi.methods.render

    def put(fault):
        def rendered(*arguments, **options):
            made = render(*arguments, **options)
            return made._replace(irradiance=fault(made.irradiance, made.frame))

        monkeypatch.setattr(refgi.methods, "render", rendered)

    return put


def test_a_sound_method_keeps_all(box):
    assert broken(box) == set()


FAULTS = {
    "a light of its own": (lambda light, _: light + light.dtype.type(1e-3), "flux x 2^27"),
    "a length in metres": (lambda light, frame: light * light.dtype.type(1 + 1e-6 * np.tanh(frame.extent.diagonal)),
                           "length x 2^-27"),
    "a place in the world": (lambda light, frame: light * light.dtype.type(1 + 1e-4 * frame.scene.camera.eye[0]),
                             "moved aside"),
    "the order of faces": (lambda light, frame: light + (frame.gbuffer.triangle_id == 3).astype(light.dtype),
                           "faces permuted"),
    "the size of all that a file holds": (
        lambda light, frame: light * light.dtype.type(frame.scene.geometry.diagonal), "hidden plane"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_breaks_its_promise(box, faulty, name):
    fault, promise = FAULTS[name]
    faulty(fault)
    assert promise in broken(box, EXACT)


def test_numbers_that_are_no_light(box, faulty):
    faulty(lambda light, frame: np.where(frame.gbuffer.triangle_id == 0, np.nan, light))
    assert "sound numbers" in broken(box)


def test_warnings_of_python(box, faulty):
    def fault(light, _):
        warnings.warn("overflow", RuntimeWarning, stacklevel=1)
        return light

    faulty(fault)
    assert broken(box) == {"no warning of Python"}


def test_random_bits(box, faulty):
    rng = np.random.default_rng(0)
    faulty(lambda light, _: light * light.dtype.type(1 + 1e-6 * rng.random()))
    assert {"again", "one thread", "flux x 2^27"} <= broken(box)


@pytest.mark.skipif(most_threads() == 1, reason="one processor")
def test_bits_of_the_number_of_threads(box, faulty):
    import numba

    faulty(lambda light, _: light * light.dtype.type(1 + 1e-6 * numba.get_num_threads()))
    assert broken(box) == {"one thread"}


def test_made_energy(box, faulty):
    faulty(lambda light, _: 1000 * light)
    assert broken(box) == {"energy"}


def test_truth_after_a_turn_is_judged_by_its_errors(box):
    turns = ["quarter turn", "two lamps of half"]
    assert broken(box, turns, "truth") == set()
    render, count = refgi.methods.render, [0]

    def rendered(*arguments, **options):
        made, count[0] = render(*arguments, **options), count[0] + 1
        mean = made.estimate.picture_mean * (2 if count[0] > 1 else 1)
        return made._replace(estimate=made.estimate._replace(picture_mean=mean))

    refgi.methods.render = rendered
    try:
        assert broken(box, turns, "truth") == set(turns)
    finally:
        refgi.methods.render = render


def test_an_estimate_in_doubt_is_not_judged(box, monkeypatch):
    """Of several scenes the truth says itself that its error is not to be trusted; bits and bounds are judged still."""
    doubt = "the error is not to be trusted"
    monkeypatch.setattr(TruthResult, "doubt", doubt)
    silent: list[Silence] = []
    anew, same = ["moved aside", "quarter turn", "resolution x 2"], ["flux x 2^27", "hidden plane"]
    found = list(stress(box, ["truth"], changes=anew + same, silent=silent.append, **SIZE))
    assert silent == [Silence("truth", name, doubt) for name in anew]
    assert {one.row.property for one in found if one.row.subject == "truth"} == set(same)


def test_what_is_not_promised_is_said(box):
    silent: list[Silence] = []
    lit = box.with_lights(PointLight((0.2, 0.4, 0.2), (1.0, 1.0, 1.0)))
    rows = [found.row for found in stress(lit, ["sii"], changes=["turned"], silent=silent.append, **SIZE)]
    assert rows == []
    assert silent == [Silence("sii", "turned", "a point lamp's map stands along the world's axes")]
    with pytest.raises(InputError, match="change: expected one of"):
        list(stress(box, ["sii"], changes=["melted"], **SIZE))


@pytest.mark.parametrize(("width", "height", "texel"), [(63, 40, 2), (62, 40, None), (62, 62, 4), (64, 41, None),
                                                        (36, 27, None), (268, 132, 8), (272, 131, None)])
def test_a_mirrored_pyramid_is_promised_where_texels_divide_the_width(box, width, height, texel):
    """Texels of level k are 2^k pixels wide from the left: mirrored, another would begin at the other edge."""
    change = next(one for one in CHANGES if one.name == "mirrored")
    if texel is None:
        assert promises.asked("hssil", change, box, (width, height)).promise == "rounding"
        return
    with pytest.raises(NotPromisedError, match=f"a width of {width} pixels is no multiple of the {texel} of its"):
        promises.asked("hssil", change, box, (width, height))


@pytest.mark.parametrize(("width", "height"), [(31, 24), (36, 23)])
def test_odd_sizes_promise_what_holds(box, width, height):
    silent = []
    rows = list(stress(box, ["hssil"], width=width, height=height, changes=["mirrored"], silent=silent.append))
    assert [one.method for one in silent] == (["hssil"] if width == 31 else [])
    assert all(found.row.passed for found in rows), rows


def test_every_limit_has_a_source(box):
    """What was observed stands in the file, for every method that promises it."""
    for method in refgi.methods.BUILT_IN:
        for change in CHANGES:
            if (method, change.name) in promises.SILENT:
                continue
            asked = promises.asked(method, change, box)
            assert np.isfinite(asked.limit), (method, change.name)
            assert asked.source
            assert (asked.limit == 0) == (asked.promise in ("bits", "estimate"))


def seen(light, depth=1.0):
    light = np.broadcast_to(np.asarray(light, float), (3, 2, 2))
    return Seen(light, np.broadcast_to(np.asarray(depth, float), (2, 2)), np.full((3, 2, 2), 0.5), None, ())


def test_what_cannot_be_compared_is_not_well():
    """No pixel of the same place; an estimate that is no number."""
    assert rmse_apart(seen(2.0), seen(2.0, 3.0), Changed(None)) == np.inf

    def estimate(mean):
        return SimpleNamespace(picture_mean=np.array([1.0, mean, 1.0]), picture_variance=np.full(3, 0.5),
                               degrees_of_freedom=3)

    one, two = (seen(1.0)._replace(estimate=estimate(mean)) for mean in (1.0, 4.0))
    assert estimates_apart(one, one, Changed(None)) == (0.0, 6.0)
    assert estimates_apart(one, two, Changed(None)) == (3.0, 6.0)
    assert np.isnan(estimates_apart(one, one._replace(estimate=estimate(np.nan)), Changed(None))[0])


def test_a_method_without_observed_limits_is_not_asked(box, monkeypatch):
    monkeypatch.setattr(promises, "_file", lambda: {"worst": {}, "scenes": ""})
    silent: list[Silence] = []
    assert list(stress(box, ["hssil"], changes=["turned"], silent=silent.append, **SIZE)) == []
    assert silent == [Silence("hssil", "turned", "no limit was observed yet")]
    unknown = list(stress(box, ["hssil"], changes=["turned"], unknown=True, **SIZE))
    assert [found.row.subject for found in unknown] == ["visible surfaces", "hssil"]


def test_judges_in_closed_form():
    plain = Changed(None)
    assert rmse_apart(seen(1.0), seen(1.0), plain) == 0
    assert rmse_apart(seen(2.0), seen([[2, 2], [2, 4]]), plain) == pytest.approx(0.5)  # sqrt(4/4) / 2
    assert rmse_apart(seen(2.0), seen(4.0), Changed(None, flux=2.0)) == 0
    assert bits_apart(seen(1.0), seen([[1, 1], [1, np.nextafter(1, 2)]]), plain) == 1
    assert bits_apart(seen([[1, 2], [3, 4]]), seen([[2, 1], [4, 3]]), Changed(None, mirrored=True)) == 0
    darker, subnormal = Changed(None, flux=2.0**-27), 2.0**-110  # 2^-137 in the darker picture
    for was, now, apart in ((subnormal, 0.0, 0), (0.0, subnormal, 0), (2.0**-98, 0.0, 1), (0.0, 2.0**-98, 1),
                            (subnormal, 1.0, 1), (np.nan, np.nan, 1)):
        assert bits_apart(seen([[was, 1], [1, 1]]), seen(darker.flux * np.array([[now, 1], [1, 1]])), darker) == apart
    moved = seen(2.0, [[1, 1], [1, 2]])  # another place in one pixel: 4, which is left out
    assert same_surface(seen(2.0), moved, plain).tolist() == [[True, True], [True, False]]
    assert rmse_apart(seen(2.0), moved._replace(light=seen([[2, 2], [2, 9]]).light), plain) == 0
    assert same_surface(seen(1.0), seen(1.0, 8.0), Changed(None, length=8.0)).all()
    assert means_apart(seen(2.0), seen(3.0), plain) == pytest.approx(0.5)
    assert unsound(np.array([[[1.0, np.nan]], [[1.0, 1.0]], [[-1.0, 1.0]]])) == 2

"""Approximations as methods declare them: each is a real change, and with all of them off a method is its limit."""


import numpy as np
import pytest

from refgi.bench.grid import TRUTH, Choice
from refgi.bench.measure import REFERENCE_SEED
from refgi.bench.split import REST, Renderer, chain_of, split_of
from refgi.methods import METHODS
from refgi.provenance.frames import StillFrames
from refgi.scene import load_scene
from refgi.settings import of, replaced
from refgi.sssil.temporal import TemporalSettings
from refgi.truth import TruthSettings

pytestmark = pytest.mark.filterwarnings("ignore::refgi.errors.RefgiWarning")

OPTIONS = {"width": 32, "height": 24, "rsm_resolution": 64}
STILL = StillFrames(4, TemporalSettings(weight=0.75))
# settings with which every approximation of a method is made; of several kinds, where one excludes another
MADE = {
    "sii": [{"lights": 64, "cut": "relative", "half_resolution": True, "quantisation": "published",
             "openness.flux": "scale", "ambient_occlusion": "openness"},
            {"lights": 2000, "lightcuts": "bounded", "lightcuts.error": 0.5}],
    "multires": [{"lights": 64, "detail": 0.5, "supersampled": True, "openness.flux": "scale",
                  "ambient_occlusion": "openness"},
                 {"lights": 32, "subsplats.visibility": "val", "clusters.count": 4, "maps.resolution": 32},
                 {"lights": 2000, "lightcuts": "bounded", "lightcuts.error": 0.5}],
    "val": [{"lights": 64, "clusters.count": 4, "maps.resolution": 32, "interleaving": 4, "openness.flux": "scale"},
            {"lights": 32, "visibility": "none", "interleaving": 2},
            {"lights": 32, "clusters.count": 4, "maps.resolution": 32}],
    "hssil": [{"radius": 2.0, "levels": 2, "samples": 8},
              {"visibility": "bitmask", "radius": 2.0, "levels": 2, "samples": 8}],
    "gather": [{"interpolation.grid": 16, "interpolation.reach": 1.0}],
    "vpl": [{"lights": 32}, {"lights": 32, "visibility": False},
            {"lights": 32, "maps": "imperfect", "maps.points": 500}],
    "truth": [{"samples": 24}, {"samples": 24, "visibility": False, "emitters": "visible"}],
}
# without the only one that its settings switch off a method with rays is the truth: that is not rendered
LAST = {("vpl", 0): "light sampling", ("truth", 0): "few samples", ("truth", 1): "few samples"}
KINDS = [(name, number) for name, several in MADE.items() for number in range(len(several))]


@pytest.fixture(scope="module")
def renderer():
    return Renderer(load_scene("cornell_box"), TruthSettings(samples=48), **OPTIONS)


@pytest.fixture(scope="module")
def small():
    return Renderer(load_scene("cornell_box"), TruthSettings(samples=24), still=STILL, width=24, height=18,
                    rsm_resolution=32)


def settings_of(name, number):
    return of(METHODS[name].settings, **MADE[name][number])


def test_every_method_declares_its_own_once():
    assert set(MADE) == set(METHODS)
    frames = {**OPTIONS, "still": STILL}
    for name, method in METHODS.items():
        declared = [one.name for one in method.approximations]
        assert declared, name
        assert len(set(declared)) == len(declared)
        assert all(one.about and one.name != REST for one in method.approximations)
        made = {one.name for number in range(len(MADE[name])) for one in method.approximations
                if one.shared_by(settings_of(name, number))
                or one.without(settings_of(name, number), OPTIONS)[0] != settings_of(name, number)
                or one.without(settings_of(name, number), frames)[1] != frames}
        assert made == set(declared)


def test_what_is_switched_off_stays_off():
    for name, number in KINDS:
        settings = settings_of(name, number)
        for one in METHODS[name].approximations:
            if one.off and name != TRUTH and one.name != "shadow map resolution":  # there is always more of these
                off = one.off(settings, OPTIONS)
                assert one.off(off, OPTIONS) == off, one.name


def test_the_truth_leaves_visibility_out_where_the_method_does():
    for name, number in KINDS:
        method, settings = METHODS[name], settings_of(name, number)
        limits = {key: value for one in method.approximations for key, value in one.shared_by(settings).items()}
        assert limits.get("visibility", True) is method.knows_visibility(settings), (name, number)


@pytest.mark.parametrize(("name", "number"), [one for one in KINDS if one != ("val", 2)])  # of few pixels each is lit
def test_each_changes_the_picture(small, name, number):
    """Each approximation that settings make changes some pixel where it is switched off alone, or the truth."""
    chain = chain_of(small, Choice(name, (), settings_of(name, number)), 1)
    used = chain.links[-1].pictures[0]
    for part, alone in chain.alone.items():
        changed = not np.array_equal(alone.pictures[0], used)
        assert changed or not np.array_equal(alone.truth, chain.links[0].pictures[0]), part
    steps = {link.name for link in chain.links} - {TRUTH, REST}
    assert set(chain.alone) == steps - {LAST.get((name, number))}
    for before, after in zip(chain.links, chain.links[1:], strict=False):
        assert not np.array_equal(before.pictures[0], after.pictures[0]), after.name


# RMSE of all switched off against the last truth, over its mean: peaks beside texels and pixels, which are points
LIMITS = {"sii": 0.15, "multires": 0.15, "gather": 0.15, "hssil": 0.25}
DARKER = 0.03  # of the mean: what lies beyond the rim of the picture or of the map's cone


@pytest.mark.parametrize("name", LIMITS)
def test_with_all_of_them_off_a_method_is_the_truth_that_shares_its_limits(renderer, name, evidence):
    if name == "hssil":  # whose senders are pixels
        larger = {"width": 64, "height": 48, "rsm_resolution": 64}
        renderer = Renderer(load_scene("cornell_box"), TruthSettings(samples=96), **larger)
    chain = chain_of(renderer, Choice(name, (), settings_of(name, 0)), 1, alone=False)
    names = [link.name for link in chain.links]
    at = names.index(REST)
    assert names[1:at] == (["unseen senders", "visibility"] if name == "hssil" else ["visibility"])
    truth, made, used = (chain.links[k].pictures[0][:, chain.covered] for k in (at - 1, at, -1))
    left, whole = (np.sqrt(((picture - truth) ** 2).mean()) / truth.mean() for picture in (made, used))
    evidence(f"{name}: RMSE {left:.3f} of the mean with all approximations off, {whole:.3f} as it is used")
    assert left < LIMITS[name]
    assert left < 0.6 * whole
    assert made.mean() == pytest.approx(truth.mean(), rel=DARKER)


@pytest.mark.parametrize("name", ["val", "vpl"])
def test_many_lights_with_rays_converge_to_the_truth(name, evidence):
    """Where light sampling starts from the truth, all texels with a ray each are the truth but for their size."""
    renderer = Renderer(load_scene("cornell_box"), TruthSettings(samples=192), width=12, height=9, rsm_resolution=48)
    settings, options = settings_of(name, 0), renderer.options
    for one in METHODS[name].approximations:
        settings = one.without(settings, options)[0]
    truth = renderer.truth().mean[:, renderer.covered]
    made = renderer.picture(name, settings, options)[:, renderer.covered]
    left = np.sqrt(((made - truth) ** 2).mean()) / truth.mean()
    evidence(f"{name}: RMSE {left:.3f} of the mean, every texel a light with rays")
    assert left < LIMITS["sii"]
    assert made.mean() == pytest.approx(truth.mean(), rel=DARKER)


def test_steps_switch_on_what_they_say(renderer):
    """The pictures of the chain of sii are those of settings made by hand."""
    chain = chain_of(renderer, Choice("sii", (), of(METHODS["sii"].settings, lights=64, half_resolution=True)), 2,
                     alone=False)
    assert [link.name for link in chain.links] == [
        TRUTH, "visibility", REST, "RSM resolution", "light sampling", "clamp", "upsampling"]
    fine = {**renderer.options, "rsm_resolution": 128}
    every = {"pattern": "all", "lights": 1, "pairs.clamp": None}
    by_hand = [(every, fine), (every, renderer.options), ({"lights": 64, "pairs.clamp": None}, renderer.options),
               ({"lights": 64}, renderer.options), ({"lights": 64, "half_resolution": True}, renderer.options)]
    for link, (keys, options) in zip(chain.links[2:], by_hand, strict=True):
        for seed in range(2):
            random = {} if "pattern" in keys else {"seed": seed}
            expected = renderer.picture("sii", of(METHODS["sii"].settings, **keys, **random), options)
            assert np.array_equal(link.pictures[seed], expected), (link.name, seed)
    assert chain.links[2].pictures[0] is chain.links[2].pictures[1]  # without random numbers it is made once
    assert not np.array_equal(*chain.links[-1].pictures)


def test_frames_of_a_resting_scene_are_the_last_part(evidence):
    """Each seed has frames of its own; the k-th counts as much as those before at first, then the share 1 - a."""
    renderer = Renderer(load_scene("cornell_box"), TruthSettings(samples=24), still=STILL, **OPTIONS)
    settings, seeds = settings_of("hssil", 0), 2
    chain = chain_of(renderer, Choice("hssil", (), settings), seeds)
    frames = [METHODS["hssil"].function(renderer.frame, replaced(settings, {"seed": k})).astype(np.float64)
              for k in range(seeds * STILL.frames)]
    assert chain.links[-1].name == "temporal"
    for seed in range(seeds):
        first, *others = frames[seed * STILL.frames : (seed + 1) * STILL.frames]
        blend = first
        for k, other in enumerate(others, 1):
            share = min(STILL.temporal.weight, k / (k + 1))
            blend = share * blend + (1 - share) * other
        np.testing.assert_array_equal(chain.links[-2].pictures[seed], first)
        np.testing.assert_array_equal(chain.alone["temporal"].pictures[seed], first)
        np.testing.assert_allclose(chain.links[-1].pictures[seed], blend, atol=2e-6 * blend.mean(), rtol=0)
    split = split_of(chain, Choice("hssil", (), settings))
    evidence(f"hssil: RMSE {split.error.rmse:.3f} with {STILL.frames} frames, {split.parts[-1].alone.rmse:.3f} of one")
    assert split.error.rmse < split.parts[-1].alone.rmse
    assert split.parts[-1].share < 0  # takes back noise of few samples


def test_truths_have_seeds_of_their_own_and_are_traced_once(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr("refgi.bench.split.trace_truth", lambda frame, settings: asked.append(settings) or frame)
    made = Renderer(load_scene("cornell_box"), TruthSettings(samples=7, checkpoint=tmp_path / "a file"), **OPTIONS)
    for limits in ({}, {"visibility": False}, {"emitters": "visible"}, {"emitters": "visible", "visibility": False},
                   {"visibility": False, "emitters": "visible"}, {}):
        made.truth(limits)
    assert [(one.visibility, one.emitters) for one in asked] == [
        (True, "all"), (False, "all"), (True, "visible"), (False, "visible")]
    seeds = [one.seed for one in asked]
    assert seeds[0] == REFERENCE_SEED
    assert len(set(seeds)) == 4
    assert min(seeds) >= REFERENCE_SEED  # no round's
    assert {(one.samples, one.checkpoint) for one in asked} == {(7, None)}
    held = Renderer(load_scene("cornell_box"), TruthSettings(checkpoint=tmp_path), **OPTIONS)
    held.truth()
    assert asked[-1].checkpoint == tmp_path


def test_a_method_that_declares_none_has_one_part(small, monkeypatch):
    bare = METHODS["sii"]._replace(approximations=())
    monkeypatch.setattr("refgi.bench.split.METHODS", {"sii": bare})
    chain = chain_of(small, Choice("sii", (), settings_of("sii", 0)), 1)
    assert [link.name for link in chain.links] == [TRUTH, REST]
    assert np.array_equal(chain.links[-1].pictures[0], small.picture("sii", settings_of("sii", 0), small.options))
    assert chain.alone == {}


@pytest.mark.feature("VAL-27")
def test_kinds_of_visibility_in_val_have_the_maps_of_the_method():
    """Near distances that are best for each kind would be a step of their own: those of the series, 0.4, stay."""
    method = METHODS["val"]
    kinds = {}
    for one in method.approximations[5:]:
        off = one.off(method.settings(), OPTIONS)
        if off.visibility != method.settings().visibility:
            kinds[one.name] = off.visibility.name(), off.maps.near_distance or off.drawn_maps.near_distance
    assert kinds == {"clustering": ("rays_vpls", 0.4), "rectangle": ("rays_vpls", 0.4),
                     "single view": ("rays_rectangle", 0.4), "kernel": ("back_projection", 0.4),
                     "CSM series": ("pcss", 0.4), "filter": ("csm", 0.4)}

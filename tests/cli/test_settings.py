"""`--set`, `--preset` and `refgi settings`: text to settings, and all that is wrong with it at once."""

import dataclasses
import json
from typing import ClassVar, Literal

import numpy as np
import pytest
from click.testing import CliRunner

import refgi
from refgi.cli.group import VerbGroup
from refgi.cli.view import by_method, has_seed, settings_for
from refgi.errors import InputError
from refgi.methods import METHODS
from refgi.settings import Settings, flat, from_text, leaves, of, setting
from refgi.splat import SiiSettings


@dataclasses.dataclass(frozen=True)
class Knobs(Settings):
    SWITCHES: ClassVar[frozenset[str]] = frozenset({"a", "b"})

    count: int | None = setting(8, "how many", least=1)
    share: float = setting(0.5, "share", least=0.0, most=1.0)
    exact: bool = setting(False, "exact")
    mode: Literal["grid", "halton"] = setting("grid", "mode")
    warp: Literal["A", "B"] = setting("A", "warp")
    shift: tuple[float, float] = setting((0.0, 0.0), "shift")
    switches: frozenset[str] = setting(frozenset(), "switches")
    name_of: str | None = setting(None, "name")
    seed: int = setting(0, "seed", least=0)


@dataclasses.dataclass(frozen=True)
class Still(Settings):
    count: int = setting(1, "how many")


@pytest.mark.parametrize(("pair", "expected"), [
    ("count=12", {"count": 12}), ("count=none", {"count": None}), ("share=1e-3", {"share": 1e-3}),
    ("exact=true", {"exact": True}), ("exact=0", {"exact": False}), ("mode=halton", {"mode": "halton"}),
    ("shift=0.25,0.5", {"shift": (0.25, 0.5)}), ("shift=[1, 2]", {"shift": (1.0, 2.0)}),
    ("switches=a,b", {"switches": frozenset({"a", "b"})}), ("switches=a", {"switches": frozenset({"a"})}),
    ("switches=", {"switches": frozenset()}), ("name_of=x=y", {"name_of": "x=y"}),
    ("name_of=null", {"name_of": None}),
])
def test_text_becomes_the_settings_own_types(pair, expected):
    assert from_text(Knobs(), [pair]) == Knobs(**expected)


def test_nothing_set_gives_the_defaults_and_the_last_of_two_wins():
    assert from_text(Knobs(), []) == Knobs()
    assert from_text(Knobs(), ["count=1", "count=2"]).count == 2


def test_the_seed_option_is_a_setting():
    assert {value for key, value in flat(settings_for("sii", [], seed=9)).items() if key.endswith("seed")} == {9}
    assert has_seed("sii")
    with pytest.raises(InputError, match="'seed' is not a setting of Still"):
        from_text(Still(), ["seed=9"])


@pytest.mark.parametrize(("pair", "words"), [
    ("count", ["'count' is not key=value"]), ("coutn=3", ["'coutn'", "did you mean 'count'"]),
    ("count=3.5", ["count", "'3.5'"]), ("exact=perhaps", ["exact", "'perhaps'"]),
    ("mode=spiral", ["mode: input should be 'grid' or 'halton'", "'spiral'"]),
    ("warp=a", ["'A' or 'B'", "'a'"]), ("shift=1", ["shift", "'1'"]), ("share=2", ["share", "2.0"]),
    ("share=nan", ["share", "nan"]), ("mode=none", ["mode"]),
])
def test_what_is_wrong_is_named(pair, words):
    with pytest.raises(InputError) as caught:
        from_text(Knobs(), [pair])
    assert all(word in str(caught.value) for word in words)


def test_everything_that_is_wrong_is_reported_at_once():
    with pytest.raises(InputError) as caught:
        from_text(Knobs(), ["coutn=1", "mode=spiral", "count=-1", "share=7", "loose"])
    assert all(word in str(caught.value) for word in ("'coutn'", "'spiral'", "-1", "7.0", "'loose'"))


@pytest.mark.parametrize("method", list(METHODS))
def test_presets_are_settings_of_their_method(method):
    known = METHODS[method]
    for name, preset in known.presets.items():
        assert isinstance(preset, known.settings)
        assert settings_for(method, [], preset=name) == preset
        assert of(known.settings, **flat(preset)) == preset
    with pytest.raises(InputError, match=f"preset: expected one of default.* for {method}, got 'other'"):
        settings_for(method, [], preset="other")


@pytest.mark.filterwarnings("ignore::refgi.errors.RefgiWarning")  # of what printed values cost
@pytest.mark.parametrize(("method", "preset"),
                         [(method, name) for method in METHODS for name in METHODS[method].presets])
def test_presets_make_a_picture(method, preset):
    picture = refgi.render("cornell_box", method, METHODS[method].preset(preset), width=18, height=14)
    assert np.isfinite(picture.radiance).all()
    assert picture.irradiance.any()


def test_papers_have_their_presets():
    assert {name for name in METHODS if "paper" in METHODS[name].presets} >= {"sii", "multires", "val", "hssil"}


def test_a_preset_is_what_set_starts_from():
    assert settings_for("sii", ["lights=5"], preset="paper") == of(
        SiiSettings, **flat(METHODS["sii"].preset("paper")) | {"lights.count": 5})


@pytest.mark.parametrize("method", list(METHODS))
def test_the_verb_lists_every_key(method):
    every = {leaf.key for leaf in leaves(METHODS[method].settings)}
    shown = CliRunner().invoke(VerbGroup.refgi(), ["settings", method, "--all"])
    assert shown.exit_code == 0, shown.output
    assert every <= {line.split()[0] for line in shown.output.splitlines() if line.strip()}
    content = json.loads(CliRunner().invoke(VerbGroup.refgi(), ["settings", method, "--json"]).stdout)
    assert set(content["schema"]["properties"]) == every
    assert set(content["values"]) == set(flat(METHODS[method].settings()))
    for leaf in leaves(METHODS[method].settings):
        assert leaf.about, leaf.key
        assert leaf.about != "threshold", leaf.key


@pytest.mark.parametrize(("key", "takes", "items"), [
    ("as_published", "names out of hss_disc_pi, hss_level_factor, hss_tan_f",
     {"enum": ["hss_disc_pi", "hss_level_factor", "hss_tan_f"]}),
    ("cameras.views", "a list in JSON of {eye, target, up, vfov, width, height}", None)])
def test_the_verb_says_what_names_and_lists_take(key, takes, items):
    lines = CliRunner().invoke(VerbGroup.refgi(), ["settings", "hssil", "--all"]).output.splitlines()
    line, = (line for line in lines if line.startswith(f"{key} "))
    assert takes in line
    content = json.loads(CliRunner().invoke(VerbGroup.refgi(), ["settings", "hssil", "--json"]).stdout)
    assert content["schema"]["properties"][key].get("items") == items


def test_settings_sorted_by_method():
    assert by_method(["sii.lights=3", "truth.samples=4", "sii.seed=1"], ["sii", "vpl", "truth"]) == {
        "sii": ["lights=3", "seed=1"], "vpl": [], "truth": ["samples=4"]}

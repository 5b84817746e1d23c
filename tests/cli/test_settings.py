"""`--set`: text to settings, and all that is wrong with it at once."""

import dataclasses
from typing import Literal

import pytest

from refgi.cli.settings import by_method, read_settings
from refgi.errors import InputError, expect


@dataclasses.dataclass(frozen=True)
class Knobs:
    count: int | None = 8
    share: float = 0.5
    exact: bool = False
    mode: Literal["grid", "halton"] = "grid"
    warp: Literal["A", "B"] = "A"
    shift: tuple[float, float] = (0.0, 0.0)
    switches: frozenset[str] = frozenset()
    name: str | None = None
    seed: int = 0

    def __post_init__(self):
        expect(self.count is None or self.count > 0, "count", "a number > 0", self.count)
        expect(0 <= self.share <= 1, "share", "0 to 1", self.share)


@pytest.mark.parametrize(("pair", "expected"), [
    ("count=12", {"count": 12}), ("count=none", {"count": None}), ("share=1e-3", {"share": 1e-3}),
    ("exact=true", {"exact": True}), ("exact=0", {"exact": False}), ("mode=halton", {"mode": "halton"}),
    ("shift=0.25,0.5", {"shift": (0.25, 0.5)}), ("shift=[1, 2]", {"shift": (1.0, 2.0)}),
    ("switches=a,b", {"switches": frozenset({"a", "b"})}), ("switches=a", {"switches": frozenset({"a"})}),
    ("switches=", {"switches": frozenset()}), ("name=x=y", {"name": "x=y"}), ("name=null", {"name": None}),
])
def test_text_becomes_the_settings_own_types(pair, expected):
    assert read_settings(Knobs, [pair]) == Knobs(**expected)


def test_nothing_set_gives_the_defaults_and_the_last_of_two_wins():
    assert read_settings(Knobs, []) == Knobs()
    assert read_settings(Knobs, ["count=1", "count=2"]).count == 2


def test_the_seed_option_is_a_setting():
    assert read_settings(Knobs, [], seed=9).seed == 9
    with pytest.raises(InputError, match="'seed' is not a setting of still"):
        read_settings(dataclasses.make_dataclass("Still", [("count", int, 1)], frozen=True), [], 9, "still")


@pytest.mark.parametrize(("pair", "words"), [
    ("count", ["'count' is not key=value"]), ("coutn=3", ["'coutn'", "did you mean 'count'"]),
    ("count=3.5", ["count", "'3.5'"]), ("exact=perhaps", ["exact", "'perhaps'"]),
    ("mode=spiral", ["mode: input should be 'grid' or 'halton'", "'spiral'"]),
    ("warp=a", ["'A' or 'B'", "'a'"]), ("shift=1", ["shift", "'1'"]), ("share=2", ["share", "2.0"]),
    ("share=nan", ["share", "nan"]), ("mode=none", ["mode"]),
])
def test_what_is_wrong_is_named(pair, words):
    with pytest.raises(InputError) as caught:
        read_settings(Knobs, [pair], owner="still")
    assert all(word in str(caught.value) for word in words)


def test_everything_that_is_wrong_is_told_at_once():
    with pytest.raises(InputError) as caught:
        read_settings(Knobs, ["coutn=1", "mode=spiral", "count=-1", "share=7", "loose"])
    assert all(word in str(caught.value) for word in ("'coutn'", "'spiral'", "-1", "7.0", "'loose'", "settings: count"))


def test_settings_sorted_by_method():
    assert by_method(["sii.lights=3", "truth.samples=4", "sii.seed=1"], ["sii", "vpl", "truth"]) == {
        "sii": ["lights=3", "seed=1"], "vpl": [], "truth": ["samples=4"]}

"""Grids as TOML: all combinations, each once; every fault of a file at once."""

import pytest

from refgi.bench.grid import TRUTH, built_in, built_in_tracks, chosen, read_grid, read_tracks
from refgi.errors import InputError
from refgi.methods import METHODS


@pytest.fixture
def file(tmp_path):
    def written(text):
        (tmp_path / "grid.toml").write_text(text)
        return tmp_path / "grid.toml"

    return written


def test_all_combinations_in_order_each_once(file):
    grid = read_grid(file("""
        [truth]
        passes = [8, 2, 2]
        [[sii]]
        lights = [16, 64]
        half_resolution = [true, false]
        [[sii]]
        lights = 64
        half_resolution = false
        [multires]
        subsplats.criteria.depth.threshold = [0.1, 0.2]
    """))
    assert grid.passes == (2, 8)
    assert [(one.method, one.label) for one in grid.choices] == [
        ("sii", "half_resolution=true, lights=16"), ("sii", "half_resolution=true, lights=64"),
        ("sii", "half_resolution=false, lights=16"), ("sii", "half_resolution=false, lights=64"),
        ("multires", "subsplats.criteria.depth.threshold=0.1"),
        ("multires", "subsplats.criteria.depth.threshold=0.2")]
    settings = grid.choices[1].settings
    assert (settings.lights.count, settings.half_resolution) == (64, True)
    assert grid.choices[5].settings.subsplats.criteria.depth.threshold == 0.2


def test_a_method_alone_is_its_default(file):
    (choice,) = read_grid(file("[val]\n")).choices
    assert (choice.label, choice.settings) == ("default", METHODS["val"].settings())


def test_the_built_in_grids_have_every_method():
    full, quick = built_in(quick=False), built_in(quick=True)
    for name in set(METHODS) - {TRUTH}:
        assert sum(choice.method == name for choice in full.choices) >= 10
        assert sum(choice.method == name for choice in quick.choices) >= 3
    assert len(set(full.choices)) == len(full.choices)


def test_methods_are_chosen_in_the_grid_s_order():
    some = chosen(built_in(quick=True), ["val", "sii"])
    assert list(dict.fromkeys(choice.method for choice in some.choices)) == ["sii", "val"]
    assert chosen(built_in(quick=True), None) == built_in(quick=True)
    with pytest.raises(InputError, match="expected one of"):
        chosen(some, ["siii"])
    with pytest.raises(InputError, match="got 'hssil'"):
        chosen(some, ["hssil"])


@pytest.mark.parametrize(("text", "said"), [
    ("sii = 3", "expected a table"),
    ("[sii\n", "no TOML"),
    ("[siii]\n", "siii"),
    ("[sii]\nlihgts = 3", "did you mean"),
    ("[sii]\nlights = 'many'", "lights"),
    ("[truth]\npasses = [1]", "2 and more"),
    (f"[sii]\nlights = {list(range(1, 102))}\nseed = {list(range(100))}", "at most 10,000 combinations, got '10,100'"),
    ("[truth]\nsamples = 3", "passes alone"),
])
def test_what_is_wrong_is_said(file, text, said):
    with pytest.raises(InputError, match=said):
        read_grid(file(text))


def test_all_faults_are_told_at_once(file):
    with pytest.raises(InputError, match=r"(?s)lihgts.*samplse"):
        read_grid(file("[sii]\nlihgts = 3\n[gather]\nsamplse = 4"))
    with pytest.raises(InputError, match=r"none\.toml: no such file"):
        read_grid(file("").with_name("none.toml"))


def written(tmp_path, text):
    file = tmp_path / "tracks.toml"
    file.write_text(text)
    return file


def test_a_track_goes_in_steps_of_the_root_of_two(tmp_path):
    file = written(tmp_path, '[[sii]]\nalong = "lights"\nfrom = 4\nto = 17\nhalf_resolution = true\n')
    (track,) = read_tracks(file)
    assert track.values == (4, 6, 8, 11, 16)
    assert track.method == "sii"
    assert track.rungs[1].changes == ("lights=6", "half_resolution=true")
    assert [rung.settings.lights.count for rung in track.rungs] == list(track.values)
    assert all(rung.settings.half_resolution for rung in track.rungs)


def test_a_track_may_wait(tmp_path):
    text = '[[sii]]\nalong = "lights"\nfrom = 4\nto = 8\n[[sii]]\nalong = "lights"\nfrom = 8\nto = 8\nwaits = true\n'
    plain, waiting = read_tracks(written(tmp_path, text))
    assert (plain.waits, waiting.waits) == (False, True)
    assert waiting.rungs[0].changes == ("lights=8",)


def test_cuts_wait_for_many_lights():
    """Tracks with a cut begin where a cut pays (docs/methods/sii_range.md)."""
    cuts = {track.rungs[0].settings.reach.cut.share: track for track in built_in_tracks(["sii"]) if track.waits}
    assert {share: track.values[0] for share, track in cuts.items()} == {0.01: 2048, 0.05: 1024}
    assert all(rung.settings.reach.cut is None for track in built_in_tracks(["sii"]) if not track.waits
               for rung in track.rungs)


def test_every_method_has_a_track():
    assert {track.method for track in built_in_tracks()} == set(METHODS)
    assert {track.method for track in built_in_tracks(["val", "truth"])} == {"val", "truth"}


@pytest.mark.parametrize(("text", "said"), [
    ('[[sii]]\nalong = "lights"\nfrom = 4\n', "to: expected"),
    ('[[sii]]\nalong = "lights"\nfrom = 8\nto = 4\n', "8 or more"),
    ('[[sii]]\nalong = "lights"\nfrom = 0\nto = 4\n', "whole number from 1"),
    ('[[sii]]\nalong = "light"\nfrom = 1\nto = 4\n', "light"),
    ('[[siii]]\nalong = "lights"\nfrom = 1\nto = 4\n', "siii"),
    ('[[sii]]\nalong = "lights"\nfrom = 4\nto = 8\nwaits = 3\n', "waits: expected true or false"),
    ("[[sii]\n", "no TOML"),
])
def test_what_cannot_be_used_is_named(tmp_path, text, said):
    file = written(tmp_path, text)
    with pytest.raises(InputError, match=said) as caught:
        read_tracks(file)
    assert str(file) in str(caught.value)

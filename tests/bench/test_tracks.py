"""Tracks as files: what is read, and what is refused."""

import pytest

from refgi.bench.grid import built_in_tracks, read_tracks
from refgi.errors import InputError
from refgi.methods import METHODS


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


def test_every_method_has_a_track():
    assert {track.method for track in built_in_tracks()} == set(METHODS)
    assert {track.method for track in built_in_tracks(["val", "truth"])} == {"val", "truth"}


@pytest.mark.parametrize(("text", "said"), [
    ('[[sii]]\nalong = "lights"\nfrom = 4\n', "to: expected"),
    ('[[sii]]\nalong = "lights"\nfrom = 8\nto = 4\n', "8 or more"),
    ('[[sii]]\nalong = "lights"\nfrom = 0\nto = 4\n', "whole number from 1"),
    ('[[sii]]\nalong = "light"\nfrom = 1\nto = 4\n', "light"),
    ('[[siii]]\nalong = "lights"\nfrom = 1\nto = 4\n', "siii"),
    ("[[sii]\n", "no TOML"),
])
def test_what_cannot_be_used_is_named(tmp_path, text, said):
    file = written(tmp_path, text)
    with pytest.raises(InputError, match=said) as caught:
        read_tracks(file)
    assert str(file) in str(caught.value)

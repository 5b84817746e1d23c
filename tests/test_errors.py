"""What is suggested for a mistyped word, and how large a refused value may be."""

import re

import pytest

from refgi.errors import InputError, nearest
from refgi.scene import Camera, DirectionalLight
from refgi.scene.motion import rotation_about
from refgi.settings import of
from refgi.splat.gather.gather import GatherSettings
from refgi.splat.sii.settings import SiiSettings
from refgi.truth.vpl import VplSettings


@pytest.mark.parametrize(("word", "known", "meant"), [
    ("cornel_box", ["cornell_box", "cornell_sphere"], "cornell_box"), ("coutn", ["count"], "count"),
    ("Red", ["red"], "red"),
    ("sqare.ply", ["square.ply"], "square.ply"), ("texture_of_wood.png", ["textur_fo_wodo.png"], "textur_fo_wodo.png"),
    ("gone.mtl", ["n.mtl"], None), ("a.mtl", ["b.mtl"], None), ("ab", ["ac"], None), ("kitchen", ["chicken"], None),
    ("wood.png", ["wool.png", "woods.png", "wood.png"], "wood.png"), ("abcdefghijkl", ["abcd5678ijkl"], None),
    ("abcdefghijkl", ["abcd567hijkl"], "abcd567hijkl"), ("", ["a"], None), ("a", [], None)])
def test_only_what_is_near_is_suggested(word: str, known: list[str], meant: str | None) -> None:
    assert nearest(word, known) == meant


@pytest.mark.parametrize(("make", "said"), [
    (lambda: of(GatherSettings, samples=10**9), "samples: expected a whole number, 1 to 268,435,456, got"),
    (lambda: of(VplSettings, batch=2**31), "batch: expected a whole number, 1 to 1,073,741,824, got 2147483648"),
    (lambda: of(SiiSettings, cut_share=1e10), "share: expected a number, 0 < x <= 1e+09, got"),
    (lambda: DirectionalLight((1e200, 0, 0), (1, 1, 1)), "direction: expected a finite vector, not zero, up to 1e+100"),
    (lambda: Camera((0, 0, 0), (0, 0, 1), (0, 1e200, 0)), "up: expected a finite vector, not zero, up to 1e+100"),
    (lambda: rotation_about((0, 1e200, 0), 1.0), "axis: expected a finite vector, not zero, up to 1e+100"),
])
def test_the_upper_end_is_in_the_message(make, said):
    with pytest.raises(InputError, match=re.escape(said)):
        make()

"""What is suggested for a mistyped word."""

import pytest

from refgi.errors import nearest


@pytest.mark.parametrize(("word", "known", "meant"), [
    ("cornel_box", ["cornell_box", "cornell_sphere"], "cornell_box"), ("coutn", ["count"], "count"),
    ("Red", ["red"], "red"),
    ("sqare.ply", ["square.ply"], "square.ply"), ("texture_of_wood.png", ["textur_fo_wodo.png"], "textur_fo_wodo.png"),
    ("gone.mtl", ["n.mtl"], None), ("a.mtl", ["b.mtl"], None), ("ab", ["ac"], None), ("kitchen", ["chicken"], None),
    ("wood.png", ["wool.png", "woods.png", "wood.png"], "wood.png"), ("abcdefghijkl", ["abcd5678ijkl"], None),
    ("abcdefghijkl", ["abcd567hijkl"], "abcd567hijkl"), ("", ["a"], None), ("a", [], None)])
def test_only_what_is_near_is_suggested(word: str, known: list[str], meant: str | None) -> None:
    assert nearest(word, known) == meant

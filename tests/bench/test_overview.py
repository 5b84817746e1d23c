"""The table over scenes: each method's least ratio and its nearest picture, by hand."""

import re

from refgi.bench.report import Place, overview
from tests.bench.folders import make_scene


def test_each_cell_is_the_best_of_its_method():
    made = overview([Place(make_scene("box", "p"), "#scene1"), Place(make_scene("hall", "p", 2.0), "hall/#scene1")])
    assert made["methods"] == ["sii", "vpl"]
    assert [(row["scene"], row["link"], row["size"]) for row in made["rows"]] == [
        ("box", "#scene1", "24 x 18"), ("hall", "hall/#scene1", "24 x 18")]
    sii, vpl = made["rows"][0]["cells"]
    assert sii == {"ratio": "0.8", "sort": "0.8", "at": "lights=64, 40 ms", "nearest": "30 % in 40 ms", "beaten": ""}
    assert vpl == {"ratio": "1.75", "sort": "1.75", "at": "lights=64, 200 ms", "nearest": "35 % in 200 ms",
                   "beaten": "yes"}
    assert made["rows"][1]["cells"][0]["at"] == "lights=64, 80 ms"


def test_a_method_without_pictures_or_ratio_has_an_empty_cell():
    scene = make_scene("box", "p")
    fast = scene.model_copy(update={"runs": scene.runs[:1], "line": ()})
    made = overview([Place(scene, "a"), Place(fast, "b")])
    assert made["rows"][1]["cells"] == [
        {"ratio": "", "sort": "", "at": "", "nearest": "50 % in 10 ms", "beaten": ""},
        {"ratio": "", "sort": "", "at": "", "nearest": "", "beaten": ""}]


def test_the_plot_has_all_ratios_and_the_path_tracer_at_one():
    svg = overview([Place(make_scene("box", "p"), "")])["plot"]
    assert [name for name in ("sii", "vpl", "path tracer") if f">{name}<" in svg.replace("\n", "")] == [
        "sii", "vpl", "path tracer"]
    assert 'aria-label="RMSE over' in svg
    assert re.search(r"stroke-dasharray", svg)
    none = make_scene("box", "p").model_copy(update={"runs": ()})
    assert overview([Place(none, "")])["plot"] == ""

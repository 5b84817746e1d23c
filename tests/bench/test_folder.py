"""Pages of folders: read anew each time, an index over several, kept up to date while they change."""

import json
import re
import shutil

import pytest

from refgi.bench import report
from refgi.bench.folder import INDEX, RESULTS, folders_of, read_result, remake, watch, write_results
from refgi.errors import InputError
from refgi.image import is_from_refgi
from tests.bench.folders import make_folder
from tests.compare.test_report import Outline


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("made")
    make_folder(folder / "out")
    make_folder(folder / "a <b>", scenes=("box",))
    return folder


@pytest.fixture(autouse=True)
def _without_plots(monkeypatch):
    """Plots have tests of their own; here they would take most of the time."""
    monkeypatch.setattr(report, "plot_of", lambda *_: "")
    monkeypatch.setattr(report, "curves_plot", lambda *_: "")


@pytest.fixture
def home(made, tmp_path):
    shutil.copytree(made, tmp_path / "home")
    return tmp_path / "home"


def test_one_folder_gets_its_page(home):
    out = home / "out"
    held, = remake(out, folders_of(out))
    assert held.result == read_result(out / RESULTS)
    assert is_from_refgi(out / INDEX)
    first = (out / INDEX).read_text()
    remake(out, folders_of(out))
    assert (out / INDEX).read_text() == first
    assert not (home / INDEX).exists()


def test_folders_get_their_pages_and_an_index(home):
    held = remake(home, folders_of(home))
    assert [one.folder.name for one in held] == ["a <b>", "out"]
    assert all(is_from_refgi(folder / INDEX) for folder in (home, *(one.folder for one in held)))
    html = (home / INDEX).read_text()
    outline = Outline(html)
    assert outline.closed_right
    assert [a["href"] for a in outline.all("a")] == ["a%20%3Cb%3E/index.html#scene1", "out/index.html#scene1",
                                                    "out/index.html#scene2"]
    assert 'id="scene2"' in (home / "out" / INDEX).read_text()
    assert "3 scenes of 2 folders" in html
    assert "a &lt;b&gt;" in html
    assert "data-refresh" not in html


def test_folders_without_results_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"expected results\.json, or folders with one, got neither"):
        folders_of(tmp_path)


@pytest.mark.parametrize(("text", "said"), [
    ('{"schema": 1, "refgi": {}}', "refgi"), ("{", "JSON"), ('{"environment": {}, "scenes": [{}]}', "scenes.0.scene")])
def test_other_results_are_refused_with_file_and_key(tmp_path, text, said):
    (tmp_path / RESULTS).write_text(text)
    with pytest.raises(InputError, match=rf"results\.json: {said}: expected results of `refgi bench`") as caught:
        read_result(tmp_path / RESULTS)
    assert (caught.value.file, caught.value.key) == (str(tmp_path / RESULTS), said)
    with pytest.raises(InputError, match="cannot be read"):
        read_result(tmp_path / "none.json")


def test_watching_makes_pages_when_results_change_and_ends_without_refresh(home):
    said, seen = [], []
    results = home / "out" / RESULTS
    text = results.read_text()

    def later(seconds):
        assert seconds > 0
        page = (home / INDEX).read_text()
        seen.append(("data-refresh" in page, re.search(r"(\d) scenes of", page)[1], len(said)))
        if len(seen) == 2:  # nothing had changed
            content = json.loads(text)
            write_results(read_result(results).model_copy(update={"scenes": ()}), home / "out")
            assert content["scenes"]
        elif len(seen) == 3:
            results.write_text("{")
        elif len(seen) == 4:
            results.write_text(text)
        elif len(seen) == 5:
            raise KeyboardInterrupt

    watch(home, said.append, later)
    assert seen == [(True, "3", 1), (True, "3", 1), (True, "1", 2), (True, "1", 3), (True, "3", 4)]
    assert "out: 8 runs" in said[0]
    assert "expected results of" in said[2]
    assert all("data-refresh" not in (folder / INDEX).read_text() for folder in (home, home / "out"))


NAMES = ["", "a\nb", "<script>alert(1)</script>", "|", "../../etc", "\0", "{{ 7*7 }}", "%s", "'\"&<", "$\\frac{",
         "a" * 5000]


@pytest.fixture(scope="module")
def named(tmp_path_factory):
    folder = tmp_path_factory.mktemp("names") / "out"
    write_results(make_folder(folder), folder)
    return folder


@pytest.fixture
def content(named):
    held = json.loads((named / "results.json").read_text())
    yield held
    (named / "results.json").write_text(json.dumps(held))


def changed(folder, content, change):
    copy = json.loads(json.dumps(content))
    change(copy)
    (folder / "results.json").write_text(json.dumps(copy))


def test_names_of_scenes_methods_and_settings_are_text(named, content):
    """A scene of each name."""
    def change(one):
        template = json.dumps(one["scenes"][0])
        one["scenes"] = [json.loads(template) for _ in NAMES]
        for scene, name in zip(one["scenes"], NAMES, strict=True):
            scene["scene"] = scene["truth"] = name
            for run in (*scene["runs"], *scene["line"]):
                run["method"], run["changes"], run["picture"] = name, [name], None
            scene["failures"] = {name: name}
            scene["runs"][0]["picture"] = None if name == "../../etc" else name or None

    changed(named, content, change)
    remake(named, folders_of(named))
    page = (named / "index.html").read_text()
    assert "<script>alert" not in page
    assert "\n49\n" not in page


@pytest.mark.parametrize(("path", "said"), [
    (("environment", "versions"), "environment: expected versions"),
    (("environment", "cpu"), "environment: expected cpu"),
    (("scenes", 0, "runs", 0, "errors", "truth"), "scenes.0.runs.0.errors: expected results"),
    (("scenes", 0, "line", 0, "errors", "truth"), "scenes.0.line.0.errors: expected results")])
def test_what_a_page_needs_is_asked_for(named, content, path, said):
    def change(one):
        for key in path[:-1]:
            one = one[key]
        del one[path[-1]]

    changed(named, content, change)
    with pytest.raises(InputError, match=said):
        read_result(named / "results.json")


@pytest.mark.parametrize("versions", ["1", [], 2, {}])
def test_versions_are_those_of_packages(named, content, versions):
    changed(named, content, lambda one: one["environment"].update(versions=versions))
    with pytest.raises(InputError, match="environment: expected versions, that of refgi"):
        read_result(named / "results.json")


def test_a_run_has_a_time(named, content):
    changed(named, content, lambda one: one["scenes"][0]["runs"][0].update(times=[]))
    with pytest.raises(InputError, match=r"runs\.0\.times"):
        read_result(named / "results.json")

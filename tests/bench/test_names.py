"""Results of any names: the page shows them as they are, and what a page needs is asked for."""

import json

import pytest

from refgi.bench.folder import folders_of, remake
from refgi.bench.results import read_result, write_results
from refgi.errors import InputError
from tests.bench.folders import make_folder

NAMES = ["", "a\nb", "<script>alert(1)</script>", "|", "../../etc", "\0", "{{ 7*7 }}", "%s", "'\"&<", "$\\frac{",
         "a" * 5000]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("names") / "out"
    write_results(make_folder(folder), folder)
    return folder


@pytest.fixture
def content(made):
    held = json.loads((made / "results.json").read_text())
    yield held
    (made / "results.json").write_text(json.dumps(held))


def changed(folder, content, change):
    copy = json.loads(json.dumps(content))
    change(copy)
    (folder / "results.json").write_text(json.dumps(copy))


@pytest.mark.parametrize("name", NAMES, ids=range(len(NAMES)))
def test_names_of_scenes_methods_and_settings_are_text(made, content, name):
    def change(one):
        scene = one["scenes"][0]
        scene["scene"] = scene["truth"] = name
        for run in (*scene["runs"], *scene["line"]):
            run["method"], run["changes"] = name, [name]
        scene["failures"] = {name: name}
        scene["runs"][0]["picture"] = name or None

    changed(made, content, change)
    if name == "../../etc":
        with pytest.raises(InputError, match="picture: expected a file inside its folder"):
            remake(made, folders_of(made))
        return
    remake(made, folders_of(made))
    page = (made / "index.html").read_text()
    assert "<script>alert" not in page
    assert "\n49\n" not in page


@pytest.mark.parametrize(("path", "said"), [
    (("environment", "versions"), "environment: expected versions"),
    (("environment", "cpu"), "environment: expected cpu"),
    (("scenes", 0, "runs", 0, "errors", "truth"), "scenes.0.runs.0.errors: expected results"),
    (("scenes", 0, "line", 0, "errors", "truth"), "scenes.0.line.0.errors: expected results")])
def test_what_a_page_needs_is_asked_for(made, content, path, said):
    def change(one):
        for key in path[:-1]:
            one = one[key]
        del one[path[-1]]

    changed(made, content, change)
    with pytest.raises(InputError, match=said):
        read_result(made / "results.json")


@pytest.mark.parametrize("versions", ["1", [], 2, {}])
def test_versions_are_those_of_packages(made, content, versions):
    changed(made, content, lambda one: one["environment"].update(versions=versions))
    with pytest.raises(InputError, match="environment: expected versions, that of refgi"):
        read_result(made / "results.json")


def test_a_run_has_a_time(made, content):
    changed(made, content, lambda one: one["scenes"][0]["runs"][0].update(times=[]))
    with pytest.raises(InputError, match=r"runs\.0\.times"):
        read_result(made / "results.json")

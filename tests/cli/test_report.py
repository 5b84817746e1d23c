"""`refgi report`: pages, what is said, wrong folders, pages of others."""

import json

import pytest

from refgi.bench import folder as pages
from tests.bench.folders import make_folder
from tests.cli.command import runner

run = runner("report")


@pytest.fixture
def home(tmp_path):
    make_folder(tmp_path / "home" / "out", scenes=("box",))
    return tmp_path / "home"


def test_a_folder_s_page_is_made_again(home):
    done = run(home / "out", "--json")
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout) == {"pages": [str(home / "out" / "index.html")], "scenes": 1, "runs": 4,
                                       "warnings": []}
    assert "scene1-sii-2" in (home / "out" / "index.html").read_text()


def test_a_folder_of_folders_gets_an_index(home):
    done = run(home)
    assert done.exit_code == 0, done.output
    assert f"{home / 'out'}: box" in done.stdout
    assert f"open {home / 'index.html'}" in done.stdout
    assert "out/index.html#scene1" in (home / "index.html").read_text()


def test_pages_of_others_are_spared(home):
    (home / "out" / "index.html").write_text("<p>mine</p>")
    refused = run(home)
    assert refused.exit_code == 2
    assert "not from refgi" in refused.stderr
    assert not (home / "index.html").exists()
    assert (home / "out" / "index.html").read_text() == "<p>mine</p>"
    assert run(home, "--force").exit_code == 0


def test_watching_goes_on_until_interrupted(home, monkeypatch):
    looks = []

    def wait(seconds):
        looks.append(seconds)
        if len(looks) == 2:
            raise KeyboardInterrupt

    monkeypatch.setattr(pages.watch, "__defaults__", (wait,))
    done = run(home / "out", "--watch")
    assert done.exit_code == 0, done.output
    assert done.stderr.count("4 runs") == 2  # at first and at last
    assert len(looks) == 2


@pytest.mark.parametrize(("make", "said"), [
    (lambda _: None, "a folder"), (lambda path: path.mkdir(), "got neither"),
    (lambda path: [path.mkdir(), (path / "results.json").write_text("{}")], "expected results of")])
def test_wrong_folders_are_one_clear_error(tmp_path, make, said):
    make(tmp_path / "wrong")
    done = run(tmp_path / "wrong")
    assert done.exit_code == 2
    assert said in done.stderr
    assert "Traceback" not in done.output

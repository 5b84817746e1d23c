"""Reached sources: of a package made by hand, and of the methods."""

import importlib

import pytest

from refgi.batch import code
from refgi.batch.code import code_key, place_of, reached, source_digest

FILES = {
    "__init__.py": '"""A package."""\nfrom made_by_hand.left import METHOD\nfrom made_by_hand.right import OTHER\n',
    "left.py": "from typing import TYPE_CHECKING\nimport math\nfrom .shelf import one\n"
               "if TYPE_CHECKING:\n    from made_by_hand.unused import Kind\nelse:\n    import made_by_hand.otherwise\n"
               "METHOD = one\n\ndef late():\n    from made_by_hand import lately\n    return lately\n",
    "right.py": "OTHER = 2\n",
    "unused.py": "Kind = int\n",
    "otherwise.py": "",
    "lately.py": "import refgi.errors\n",
    "shelf/__init__.py": "from .first import first as one\n"
                         "from made_by_hand.shelf.second import two\n",
    "shelf/first.py": "def first():\n    return 1\n",
    "shelf/second.py": "two = 2\n",
}
PLACE = "made_by_hand:METHOD"


@pytest.fixture
def package(tmp_path, monkeypatch):
    for name, text in FILES.items():
        file = tmp_path / "made_by_hand" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    forget()
    yield tmp_path / "made_by_hand"
    forget()


def forget():
    importlib.invalidate_caches()
    for cached in (code.reached, code._source, code._found):
        cached.cache_clear()


def key():
    forget()
    return code_key(PLACE)


def test_imports_are_followed_name_by_name(package):
    assert package.is_dir()
    assert reached(PLACE) == {"made_by_hand.left", "made_by_hand.shelf.first", "made_by_hand.lately",
                              "made_by_hand.otherwise", "refgi.errors"}


def test_the_key_changes_with_the_code_that_is_reached_and_with_nothing_else(package):
    before = key()
    for name, text in (("right.py", "OTHER = 3\n"), ("unused.py", "Kind = float\n"), ("shelf/second.py", "two = 3\n"),
                       ("shelf/first.py", '"""Text."""\ndef first():\n    """More."""\n\n    return 1  # one\n')):
        (package / name).write_text(text)
        assert key() == before, name
    (package / "shelf/first.py").write_text("def first():\n    return 2\n")
    assert key() != before
    (package / "shelf/first.py").write_text(FILES["shelf/first.py"])
    assert key() == before
    forget()
    assert code_key(PLACE, alone=("made_by_hand.right",)) != before


def test_a_digest_knows_a_docstring_from_code():
    assert source_digest(b'def f():\n    "a"\n    return 1') == source_digest(b'def f():\n    return   1 # b')
    assert source_digest(b'x = "a"') != source_digest(b'x = "b"')
    assert source_digest(b'def f(a):\n    return a') != source_digest(b'def f(b):\n    return b')


def test_methods_depend_on_what_they_use():
    of = {name: reached(place_of(name)) for name in ("sii", "multires", "val", "hssil", "gather", "vpl")}
    assert {"refgi.splat.sii.sii", "refgi.lights.pixel_lights", "refgi.pairs.pair_sum"} <= of["sii"]
    assert not {name for name in of["sii"] if "multires" in name or name.startswith("refgi.cluster.")}
    of_hssil = {name.split(".")[2] for name in of["sii"] if name.startswith("refgi.sssil.")}
    assert not of_hssil & {"hssil", "cameras", "rays", "slices", "temporal", "upsampling"}  # screen: its first level
    assert not {name for name in of["hssil"] if name.startswith(("refgi.splat.", "refgi.cluster."))}
    assert "refgi.cluster.val" in of["val"]
    assert "refgi.truth.vpl" in of["vpl"]
    assert not any(name.startswith(("refgi.cli", "refgi.compare", "refgi.bench")) for name in set().union(*of.values()))

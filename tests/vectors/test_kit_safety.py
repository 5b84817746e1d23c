"""A kit of a stranger: its names stay inside it, and sizes in headers are no reason to ask for memory."""

import hashlib
import io
import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from refgi.cli.group import VerbGroup
from refgi.vectors.check import Asked, DamagedError, Kit, check_output
from refgi.vectors.kit import read_array
from refgi.vectors.manifest import BugWriter

VALUES = np.arange(6, dtype=np.float32).reshape(2, 3)


def npy(array: np.ndarray = VALUES) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def write_kit(folder: Path, *, case: str = "a", name: str = "sum", file: str = "out/sum.npy",
              manifest: str = "cases/a/manifest.json", content: bytes = b"", extra: str | None = None) -> Path:
    """Write a kit of one case with one array, all hashes right."""
    content = content or npy()
    bugs = BugWriter().content()
    home = folder / "cases" / "a"
    (home / "out").mkdir(parents=True)
    (home / "out" / "sum.npy").write_bytes(content)
    (home / "bugs.npz").write_bytes(bugs)
    entry = {"file": file, "sha256": hashlib.sha256(content).hexdigest(), "dtype": "<f4", "shape": [2, 3],
             "axes": "row, column", "unit": "1", "what": "", "tier": "T1"} | ({} if extra is None else {"bound": extra})
    made = {"id": case, "method": "sii", "what": "x", "vectors": "1.0.1", "facts": {}, "factors": {}, "given": [],
            "stages": [{"name": "sum", "what": "x", "reads": [], "writes": [name]}], "arrays": {name: entry},
            "bugs_sha256": hashlib.sha256(bugs).hexdigest()}
    text = json.dumps(made).encode()
    (home / "manifest.json").write_bytes(text)
    (folder / "kit.json").write_text(json.dumps({"kit": "k", "vectors": "1.0.1", "refgi": "0", "cases": [{
        "id": case, "method": "sii", "what": "x", "manifest": manifest,
        "sha256": hashlib.sha256(text).hexdigest()}]}))
    return folder


@pytest.fixture
def output(tmp_path):
    folder = tmp_path / "output" / "a"
    folder.mkdir(parents=True)
    (folder / "sum.npy").write_bytes(npy())
    return folder.parent


def check(kit: Path, output: Path):
    return CliRunner().invoke(VerbGroup.refgi(), ["vectors", "check", str(kit), str(output)])


def test_a_small_kit_is_whole(tmp_path, output):
    assert check_output(Kit(write_kit(tmp_path / "kit")), output, Asked()).verdict == "exact"


def outside(tmp_path: Path) -> Path:
    """The kit's own files once more, outside of it."""
    return write_kit(tmp_path / "outside") / "cases" / "a"


@pytest.mark.parametrize("changes", [
    {"file": "../../../outside/cases/a/out/sum.npy"}, {"file": "ABSOLUTE/out/sum.npy"},
    {"manifest": "../outside/cases/a/manifest.json"}, {"manifest": "ABSOLUTE/manifest.json"},
    {"extra": "../../../outside/cases/a/out/sum.npy"}, {"extra": "/dev/zero"}, {"file": "out/\0"}, {"manifest": "a\nb"},
])
def test_files_outside_a_kit_are_not_read(tmp_path, output, changes):
    other = outside(tmp_path)
    kit = write_kit(tmp_path / "kit", **{key: text.replace("ABSOLUTE", str(other)) for key, text in changes.items()})
    with pytest.raises(DamagedError, match=r"expected files inside the kit, got|cannot be read"):
        check_output(Kit(kit), output, Asked())
    done = check(kit, output)
    assert (done.exit_code, len(done.stderr.splitlines())) == (5, 1)


def test_a_link_out_of_a_kit_is_not_followed(tmp_path, output):
    other = outside(tmp_path)
    kit = write_kit(tmp_path / "kit")
    (kit / "cases" / "a" / "out" / "sum.npy").unlink()
    (kit / "cases" / "a" / "out" / "sum.npy").symlink_to(other / "out" / "sum.npy")
    with pytest.raises(DamagedError, match="expected files inside the kit"):
        check_output(Kit(kit), output, Asked())
    (tmp_path / "linked").symlink_to(kit)
    (kit / "cases" / "a" / "out" / "sum.npy").unlink()
    (kit / "cases" / "a" / "out" / "sum.npy").write_bytes(npy())
    assert check_output(Kit(tmp_path / "linked"), output, Asked()).verdict == "exact"  # a kit that is one itself


@pytest.mark.parametrize("name", ["../a", "..", "a/../../b", "/etc", "", "a\\b", "a\nb", "x" * 300, "ü" * 150])
@pytest.mark.parametrize("what", ["case", "name"])
def test_names_of_cases_and_arrays_are_names_of_files(tmp_path, output, what, name):
    kit = write_kit(tmp_path / "kit", **{what: name})
    with pytest.raises(DamagedError, match="expected names of files, got"):
        check_output(Kit(kit), output, Asked())


def test_a_kit_without_stages_is_damaged(tmp_path, output):
    kit = write_kit(tmp_path / "kit")
    whole = json.loads((kit / "kit.json").read_text())
    (kit / "kit.json").write_text(json.dumps(whole | {"cases": []}))
    with pytest.raises(DamagedError, match="kit: expected cases with stages, got none"):
        check_output(Kit(kit), output, Asked())
    assert check(kit, output).exit_code == 5


def test_faults_of_a_kit_are_a_line_each(tmp_path):
    kit = write_kit(tmp_path / "kit")
    (kit / "kit.json").write_text(json.dumps({"x\ny": 1}))
    with pytest.raises(DamagedError) as error:
        Kit(kit)
    assert all(line.startswith(f"{kit / 'kit.json'}: ") for line in str(error.value).splitlines())


def header(shape: str, kind: str = "'<f4'", version: tuple[int, int] = (1, 0)) -> bytes:
    text = f"{{'descr': {kind}, 'fortran_order': False, 'shape': {shape}, }}".encode()
    text += b" " * (63 - (len(text) + 10) % 64) + b"\n"
    return b"\x93NUMPY" + bytes(version) + len(text).to_bytes(2 if version == (1, 0) else 4, "little") + text


@pytest.mark.parametrize("content", [
    header("(1000000, 1000000)") + bytes(100), header("(4294967296, 4294967296, 4294967296)") + bytes(100),
    header("(2, -3)") + bytes(24), header("(2, 3)", "'|O'") + bytes(48), header("(2, 3)", "[('a', '<f4')]"),
    header("(2, 3), 'x': 1"), header("(2, 3.5)") + bytes(24), header("open('x')"), header("(" * 5000),
    header("(2, 3)", version=(2, 0)) + bytes(23), header("(2, 3)", version=(7, 0)) + bytes(24),
    header("(2, 3)")[:20], header("(2, 3)") + bytes(25)])
def test_headers_that_do_not_fit_the_file_are_damage(tmp_path, output, content, monkeypatch):
    (output / "a" / "sum.npy").write_bytes(content)
    with monkeypatch.context() as patch:
        patch.setattr("numpy.lib.format.read_array", lambda *_, **__: pytest.fail("memory was asked for"))
        with pytest.raises(DamagedError, match=r"sum\.npy: (cannot be read as \.npy|expected the [0-9,]+ bytes)"):
            read_array(output / "a" / "sum.npy")
    assert check(write_kit(tmp_path / "kit"), output).exit_code == 5


@pytest.mark.parametrize("version", [(1, 0), (2, 0)])
def test_whole_files_of_each_version_are_read(tmp_path, version):
    (tmp_path / "a.npy").write_bytes(header("(2, 3)", version=version) + VALUES.tobytes())
    assert np.array_equal(read_array(tmp_path / "a.npy"), VALUES)

"""Property tests of the kernel cache: it follows what a kernel reaches, and mends what is damaged."""

import os
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

CALL = "import package_a.outer as o; print(o.outer(1.5), o.outer.stats.cache_hits.total())"


@pytest.fixture
def package(tmp_path: Path) -> Path:
    folder = tmp_path / "package_a"
    folder.mkdir()
    (folder / "__init__.py").touch()
    write_inner(folder, "x + 1.0")
    (folder / "outer.py").write_text(textwrap.dedent("""\
        from package_a.inner import inner
        from refgi.jit import kernel

        @kernel
        def outer(x):
            return 2.0 * inner(x)
        """))
    return folder


def write_inner(folder: Path, expression: str) -> None:
    (folder / "inner.py").write_text(
        f"from refgi.jit import kernel\n\n@kernel\ndef inner(x):\n    return {expression}\n")


def run(folder: Path) -> str:
    call = CALL.replace("o.outer.stats.cache_hits.total()", "sum(o.outer.stats.cache_hits.values())")
    environment = os.environ | {"REFGI_CACHE_DIR": str(folder.parent / "cache"), "PYTHONPATH": str(folder.parent)}
    done = subprocess.run([sys.executable, "-c", call], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_a_changed_import_recompiles_the_caller(package):
    assert run(package) == "5.0 0"
    assert run(package) == "5.0 1"
    write_inner(package, "x + 2.0")
    assert run(package) == "7.0 0"


def test_a_copy_of_the_sources_finds_the_same_kernels(package, tmp_path):
    assert run(package) == "5.0 0"
    copy = tmp_path / "elsewhere" / package.name
    shutil.copytree(package, copy, ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "elsewhere" / "cache").symlink_to(tmp_path / "cache")
    assert run(copy) == "5.0 1"


def test_a_caller_imported_after_an_edit_does_not_pass_for_the_edited_one(package):
    code = """\
        import package_a.inner, pathlib
        inner = pathlib.Path(package_a.inner.__file__)
        inner.write_text(inner.read_text().replace("1.0", "2.0"))
        import package_a.outer as o
        o.outer(1.5)
        """
    environment = os.environ | {"REFGI_CACHE_DIR": str(package.parent / "cache"), "PYTHONPATH": str(package.parent)}
    subprocess.run([sys.executable, "-c", textwrap.dedent(code)], env=environment, check=True)
    assert run(package) == "7.0 0"


@pytest.mark.parametrize("damage", [b"\x80\x05garbage", pytest.param(b"", marks=pytest.mark.slow)])
def test_a_damaged_cache_is_dropped_and_rebuilt(package, damage):
    run(package)
    files = list((package.parent / "cache").rglob("outer.*.kernel"))
    assert files
    for file in files:
        file.write_bytes(damage)
    assert run(package) == "5.0 0"
    assert run(package) == "5.0 1"


def test_only_entry_points_are_kept(package):
    run(package)
    assert [path.name.partition("-")[0] for path in (package.parent / "cache").iterdir()] == ["outer.outer"]


def test_a_folder_that_cannot_be_written_is_named(package):
    (package.parent / "cache").write_text("a file, not a folder")
    call = "import warnings; warnings.simplefilter('always'); import package_a.outer as o; print(o.outer(1.5))"
    environment = os.environ | {"REFGI_CACHE_DIR": str(package.parent / "cache"), "PYTHONPATH": str(package.parent)}
    done = subprocess.run([sys.executable, "-c", call], env=environment, capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "5.0"
    assert done.stderr.count("compiled kernels cannot be kept") == 1


def test_kernels_run_as_plain_python(package):
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(package.parent)}
    call = "import package_a.outer as o; print(o.outer(1.5))"
    done = subprocess.run([sys.executable, "-c", call], env=environment, capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "5.0", done.stderr

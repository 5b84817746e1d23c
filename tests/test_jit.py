"""Property tests of the kernel cache: it follows imported sources, and mends what is damaged."""

import ast
import os
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest

from refgi import jit

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


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
@pytest.mark.parametrize("damage", [b"", b"\x80\x05garbage"])
def test_a_damaged_cache_is_dropped_and_rebuilt(package, suffix, damage):
    run(package)
    files = list((package.parent / "cache").rglob(f"outer.*.{suffix}"))
    assert files
    for file in files:
        file.write_bytes(damage)
    assert run(package) == "5.0 0"
    assert run(package) == "5.0 1"


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


def test_kernels_are_strict():
    """Summing 1, 1e16, -1e16 in this order must lose the 1, and a*b - a*b must be exactly rounded twice."""

    @jit.kernel
    def total(values):
        result = 0.0
        for value in values:
            result += value
        return result

    @jit.kernel
    def difference(a, b, c):
        return a * b - c

    assert total(np.array([1.0, 1e16, -1e16])) == 0.0
    a = 1 + 2.0**-30
    assert difference(a, a, a * a) == 0.0  # a fused multiply-add would give 2**-60


def test_threads_are_put_back():
    import numba

    before = numba.get_num_threads()
    with jit.threads(1):
        assert numba.get_num_threads() == 1
    assert numba.get_num_threads() == before


def dropped_writes(source: str) -> list[int]:
    """Return the lines of a module that write through a field inside a `prange` loop."""
    loops = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.For)
             and isinstance(node.iter, ast.Call) and ast.unparse(node.iter.func) == "prange"]
    written = [part for loop in loops for part in ast.walk(loop)
               if isinstance(part, ast.Subscript) and isinstance(part.ctx, ast.Store)]
    return [part.lineno for part in written if isinstance(part.value, ast.Attribute)]


def test_no_parallel_loop_writes_through_a_tuple():
    """Numba drops `record.field[i] = x` directly inside a `prange` without a word: no kernel may do it."""
    assert dropped_writes("for i in prange(n):\n    record.field[i] = 1\n") == [2]
    assert dropped_writes("for i in prange(n):\n    field[i] = record.other[i]\n") == []
    root = Path(jit.__file__).parent
    assert not {path.name: lines for path in root.rglob("*.py") if (lines := dropped_writes(path.read_text()))}

"""Property tests of the kernel cache: it follows what a kernel reaches, and mends what is damaged."""

import hashlib
import json
import os
import pickle
import shutil
import stat
import subprocess
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path

import pytest

from refgi.jit.cache import LEVELS, levels, target_of

CALL = "import package_a.outer as o; print(o.outer(1.5), sum(o.outer.stats.cache_hits.values()))"


@pytest.fixture
def package(tmp_path: Path) -> Path:
    return written(tmp_path / "package_a")


@pytest.fixture(scope="module")
def once(tmp_path_factory) -> Path:
    """The package whose kernel a process has compiled and kept."""
    package = written(tmp_path_factory.mktemp("once") / "package_a")
    assert run(package) == "5.0 0"
    return package


@pytest.fixture
def compiled(once: Path, tmp_path: Path) -> Path:
    """A copy of the package and its kernel, modes and all: the key of code knows no place."""
    shutil.copytree(once.parent, tmp_path, dirs_exist_ok=True, ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path / once.name


def written(folder: Path) -> Path:
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


def surroundings(folder: Path) -> dict[str, str]:
    """A place of kernels beside the package, and no bytecode: within a second Python takes the old one for the new."""
    return os.environ | {"REFGI_CACHE_DIR": str(folder.parent / "cache"), "PYTHONPATH": str(folder.parent),
                         "PYTHONDONTWRITEBYTECODE": "1"}


SERVER = """
import atexit, json, os, sys, traceback
import numpy, refgi.jit
for line in sys.stdin:
    code, environment, *files = json.loads(line)
    if (child := os.fork()) == 0:
        for number, file in enumerate(files, 1):
            os.dup2(os.open(file, os.O_CREAT | os.O_TRUNC | os.O_WRONLY), number)
        os.environ.clear()
        os.environ.update(environment)
        sys.path.insert(0, environment["PYTHONPATH"])
        sys.dont_write_bytecode = True
        failed = 0
        try:
            exec(code, {"__name__": "__main__"})
        except BaseException:
            failed = 1
            traceback.print_exc()
        atexit._run_exitfuncs()
        sys.stdout.flush()
        os._exit(failed)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""


@pytest.fixture(scope="module", autouse=True)
def server() -> Iterator[None]:
    """A process that has imported `refgi.jit` and compiled nothing: those of the tests are forked from it."""
    with subprocess.Popen([sys.executable, "-c", SERVER], text=True, stdin=subprocess.PIPE,
                          stdout=subprocess.PIPE) as started:
        SERVERS.append(started)
        yield
        SERVERS.pop().stdin.close()


SERVERS: list[subprocess.Popen[str]] = []


def process(folder: Path, code: str) -> subprocess.CompletedProcess[str]:
    files = [folder.parent / name for name in ("stdout", "stderr")]
    print(json.dumps([code, surroundings(folder), *map(str, files)]), file=SERVERS[0].stdin, flush=True)
    returned = int(SERVERS[0].stdout.readline())
    return subprocess.CompletedProcess(code, returned, *(file.read_text() for file in files))


def run(folder: Path, said: str = "", call: str = CALL) -> str:
    """Return what a new process computes and how many kernels it found; it says one line of `said`, or nothing."""
    done = process(folder, call)
    assert done.returncode == 0, done.stderr
    warned = [line for line in done.stderr.splitlines() if "Warning" in line]
    assert len(warned) == bool(said), done.stderr
    assert said in done.stderr
    return done.stdout.strip()


def test_a_changed_import_recompiles_the_caller(compiled):
    """And a copy of the sources finds the kernel of the first ones."""
    assert run(compiled) == "5.0 1"
    write_inner(compiled, "x + 2.0")
    assert run(compiled) == "7.0 0"


def test_a_caller_imported_after_an_edit_does_not_pass_for_the_edited_one(package):
    code = """\
        import package_a.inner, pathlib
        inner = pathlib.Path(package_a.inner.__file__)
        inner.write_text(inner.read_text().replace("1.0", "2.0"))
        import package_a.outer as o
        o.outer(1.5)
        """
    assert process(package, textwrap.dedent(code)).returncode == 0
    assert run(package) == "7.0 0"


@pytest.mark.parametrize("damage", [lambda _: b"\x80\x05garbage", lambda _: b"", lambda content: content[:-40],
                                    lambda content: content[:-40] + bytes([content[-40] ^ 1]) + content[-39:]],
                         ids=["other", "empty", "short", "flipped"])
def test_a_damaged_cache_is_dropped_and_rebuilt(compiled, damage):
    files = list((compiled.parent / "cache").rglob("outer.*.kernel"))
    assert files
    for file in files:
        file.write_bytes(damage(file.read_bytes()))
    assert run(compiled) == "5.0 0"
    assert run(compiled) == "5.0 1"


def test_a_kernel_that_is_an_argument_counts_by_its_code(package):
    (package / "outer.py").write_text(textwrap.dedent("""\
        from package_a.inner import inner
        from refgi.jit import kernel

        @kernel
        def other(x):
            return x - 1.0

        @kernel
        def outer(function, x):
            return function(x)
        """))
    call = "import package_a.outer as o; print(o.outer(o.{}, 1.5), sum(o.outer.stats.cache_hits.values()))"
    assert [run(package, call=call.format(name)) for name in ("inner", "other", "inner")] == ["2.5 0", "0.5 0", "2.5 1"]


def test_only_entry_points_are_kept(once):
    assert [path.name.partition("-")[0] for path in (once.parent / "cache").glob("*.kernel")] == ["outer.outer"]


def test_a_folder_that_cannot_be_written_is_named(package):
    (package.parent / "cache").write_text("a file, not a folder")
    call = "import warnings; warnings.simplefilter('always'); import package_a.outer as o; print(o.outer(1.5))"
    done = process(package, call)
    assert done.stdout.strip() == "5.0"
    assert done.stderr.count("compiled kernels cannot be kept") == 1


def test_kernels_run_as_plain_python(package):
    call = "import package_a.outer as o; print(o.outer(1.5))"
    done = subprocess.run([sys.executable, "-c", call], env=surroundings(package) | {"NUMBA_DISABLE_JIT": "1"},
                          capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "5.0", done.stderr


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def plant(file: Path, content: bytes) -> None:
    """Put a file under a kernel's name, with the digest that anyone can compute."""
    file.write_bytes(content + hashlib.sha256(content).digest())


class Payload:
    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self):
        return os.mkdir, (str(self.mark),)


def test_no_word_of_a_planted_file_is_run(compiled, tmp_path):
    file, = (tmp_path / "cache").glob("outer.*.kernel")
    mark, trap = tmp_path / "ran", tmp_path / "trap_of_cache.py"
    trap.write_text(f"import os\nos.mkdir({str(mark)!r})\nclass Pair(tuple): _fields = ()\n")
    head, _, rest = file.read_bytes()[:-32].partition(b"\n")[2].partition(b"\n")
    heads = (head.replace(b'"returns": "float64"', b'"returns": "named(\'trap_of_cache.Pair\',)"'),
             head.replace(b'"package_a.outer"', b'"trap_of_cache"'), head.replace(b"[]]", b'["trap_of_cache"]]'))
    assert head not in heads
    contents = [pickle.dumps(Payload(mark)), *(b"refgi kernel 2\n" + one + b"\n" + rest for one in heads)]
    for number, content in enumerate(contents):
        plant(tmp_path / str(number), content)
    assert run(compiled, call=PLANTED) == "\n".join(["5.0 0"] * len(contents))
    assert not mark.exists()


PLANTED = """
import os, shutil, sys
from pathlib import Path
cache = Path(os.environ["REFGI_CACHE_DIR"])
file, = cache.glob("outer.*.kernel")
for number in range(4):
    shutil.copy(cache.parent / str(number), file)
    sys.modules.pop("package_a.outer", None)
    import package_a.outer as o
    print(o.outer(1.5), sum(o.outer.stats.cache_hits.values()))
"""


def test_the_folder_is_made_for_its_owner_alone(once):
    assert mode(once.parent / "cache") == 0o700
    assert {mode(file) for file in (once.parent / "cache").iterdir()} == {0o600}


@pytest.mark.slow("504", "455", "1023")
@pytest.mark.parametrize("bits", [0o770, 0o707, 0o720, 0o702, 0o1777])
def test_a_folder_that_others_can_write_is_refused(compiled, bits):
    folder = compiled.parent / "cache"
    folder.chmod(bits)
    before = {file: file.read_bytes() for file in folder.iterdir()}
    assert run(compiled, "cache: compiled kernels cannot be kept (other users can write to it)") == "5.0 0"
    assert {file: file.read_bytes() for file in folder.iterdir()} == before
    folder.chmod(0o755)  # readable by all: what nobody else can have written is used
    assert run(compiled) == "5.0 1"


def test_a_kernel_that_others_can_write_is_not_run(compiled):
    file, = (compiled.parent / "cache").glob("*.kernel")
    file.chmod(0o620)
    assert run(compiled, "other users can write to it: this compiled kernel is not run") == "5.0 0"
    assert mode(file) == 0o600
    assert run(compiled) == "5.0 1"


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root gives files away")
@pytest.mark.parametrize("what", ["file", "folder"])
def test_what_another_user_owns_is_not_run(compiled, what):
    folder = compiled.parent / "cache"
    file, = folder.glob("*.kernel")
    os.chown(folder if what == "folder" else file, 65534, 65534)
    said = f"{(folder if what == 'folder' else file).name}: "
    said += "compiled kernels cannot be kept (it belongs" if what == "folder" else "it belongs to another user"
    assert run(compiled, said) == "5.0 0"
    assert file.stat().st_uid == 0  # made anew, or left alone
    assert run(compiled, said if what == "folder" else "") == ("5.0 0" if what == "folder" else "5.0 1")


def test_of_two_processes_at_once_one_compiles(package):
    code = """
        import sys, time
        from pathlib import Path
        from package_a.outer import outer
        save, here = outer._cache.save_overload, Path(sys.argv[1])
        outer._cache.save_overload = lambda *given: (time.sleep(0.5), save(*given))
        (here / sys.argv[2]).touch()
        while len(list(here.iterdir())) < 2:
            time.sleep(0.001)
        print(outer(1.5), sum(outer.stats.cache_hits.values()))
        """
    here = package.parent / "here"
    here.mkdir()
    both = [subprocess.Popen([sys.executable, "-c", textwrap.dedent(code), str(here), name], env=surroundings(package),
                             text=True, stdout=subprocess.PIPE) for name in "ab"]
    assert sorted(one.communicate()[0].strip() for one in both) == ["5.0 0", "5.0 1"]


def test_processes_that_compile_ahead_share_the_folder_that_takes_the_place(package):
    (package.parent / "cache").mkdir(mode=0o777)
    (package.parent / "cache").chmod(0o777)
    code = ("import os, warnings\nwarnings.simplefilter('ignore')\n"
            "from refgi.jit.ahead import *\n"
            "few = read_list()[-2:]\n"
            "if __name__ == '__main__':\n"
            "    missing(few)\n"
            "    warnings.simplefilter('error')\n"
            "    compile_ahead(few, processes=1)\n"
            "    print(len(missing(few)))\n")
    done = process(package, code)
    assert (done.stdout.strip(), done.stderr) == ("0", "")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    """The package, and beside it the folder `brought` of its kernel for every level that the processor has."""
    package = written(tmp_path_factory.mktemp("wheel") / "package_a")
    for level in levels():
        subprocess.run([sys.executable, "-c", CALL], check=True, env=surroundings(package) | target_of(level) | {
            "REFGI_CACHE_DIR": str(package.parent / "brought")})
    return package


def from_wheel(folder: Path, then: str = "") -> str:
    return f"import refgi.jit.cache as c, pathlib; c.BROUGHT = pathlib.Path({str(folder)!r}) / 'brought'; {then}{CALL}"


needs_a_level = pytest.mark.skipif(not levels(), reason="wheels bring kernels for x86-64-v3 and better")


@needs_a_level
@pytest.mark.parametrize("level", LEVELS)
def test_kernels_of_a_wheel_run_at_the_best_level_that_is_there(wheel, package, level):
    """And none is written."""
    assert run(package, call=from_wheel(wheel.parent, f"c.levels = lambda: [{level!r}]; ")) == (
        "5.0 1" if level in levels() else "5.0 0")
    assert bool(list((package.parent / "cache").glob("*.kernel"))) == (level not in levels())


@needs_a_level
@pytest.mark.parametrize("then", [
    "c.levels = lambda: []; ", "import os; os.environ['NUMBA_CPU_NAME'] = 'x86-64'; ",
    "import os; os.environ['NUMBA_OPT'] = '2'; ",
    "[f.write_bytes(f.read_bytes()[:-1]) for f in c.BROUGHT.iterdir()]; "],
    ids=["no level", "another target", "another optimisation", "damaged"])
def test_kernels_of_a_wheel_that_do_not_fit_are_compiled(wheel, package, then):
    shutil.copytree(wheel.parent / "brought", package.parent / "brought")
    assert run(package, call=from_wheel(package.parent, then)) == "5.0 0"


@pytest.mark.parametrize(("lacks", "found"), [
    ("", ["x86-64-v4", "x86-64-v3"]), ("avx512vl", ["x86-64-v3"]), ("fma", [])])
def test_a_level_is_there_with_all_its_features(monkeypatch, lacks, found):
    features = {name: name != lacks for level in LEVELS.values() for name in level.split()}
    monkeypatch.setattr("llvmlite.binding.get_host_cpu_features", lambda: features)
    assert levels.__wrapped__() == found


RESULTS = """\
    from typing import NamedTuple
    import numpy as np
    from refgi.jit import kernel

    class Pair(NamedTuple):
        sums: np.ndarray
        count: int

    @kernel
    def pair(a):
        return Pair(a + a, len(a))

    @kernel
    def mixed(a):
        return a.sum(), (len(a), a > 1), a[:, None]

    @kernel
    def text(a):
        return str(len(a))
    """


def test_every_kind_of_result_comes_back_from_the_disk(package):
    (package / "results.py").write_text(textwrap.dedent(RESULTS))
    code = ("import numpy as np, package_a.results as r\n"
            "a = np.arange(3, dtype=np.float32)\n"
            "p, (total, (count, larger), column) = r.pair(a), r.mixed(a)\n"
            "print(type(p) is r.Pair, p.sums, p.sums.dtype, p.count, total, count, larger, column.shape, r.text(a),\n"
            "      [sum(one.stats.cache_hits.values()) for one in (r.pair, r.mixed, r.text)])\n")

    def said(hits):
        done = process(package, code)
        assert done.stdout.strip() == f"True [0. 2. 4.] float32 3 3.0 3 [False False  True] (3, 1) 3 {hits}"
        assert done.stderr.count("a compiled kernel cannot be kept (unicode_type: no text for this type)") == 1

    said([0, 0, 0])
    said([1, 1, 0])

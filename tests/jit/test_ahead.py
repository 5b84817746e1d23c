"""Property tests of compiling ahead: the list is what methods call, and what it lists is compiled and kept."""

import os
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest
from numba import types

from refgi.jit.ahead import LIST, read_list
from refgi.jit.kernelfile import text_of, types_of
from refgi.methods import BUILT_IN

ROOT = Path(__file__).parents[2]
MOST = {"sii": 14, "multires": 22, "val": 37, "hssil": 18, "gather": 14, "vpl": 15, "truth": 20}  # kernels
KINDS = [types.float32, types.boolean, types.none, types.int64[:], types.float32[:, ::1], types.float64[::1, :],
         types.float32[:, :, ::1], types.float32[:, :, :], types.float32[::1].copy(readonly=True),
         types.Tuple((types.int64, types.float32)), types.UniTuple(types.float32[::1], 1), types.Omitted(1.5)]


def run(code, **environment):
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=ROOT,
                          env=os.environ | {"PYTHONPATH": str(ROOT)} | environment)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("kind", KINDS, ids=str)
def test_types_survive_their_text(kind):
    assert types_of(text_of(kind)) == (kind,)


def test_every_line_of_the_list_is_a_kernel_and_its_types():
    for one in read_list():
        kernel, arguments = one.find()
        assert len(arguments) == len(kernel.py_func.__code__.co_varnames[: kernel.py_func.__code__.co_argcount])
        assert ", ".join(map(text_of, arguments)) == one.arguments
    assert len(read_list()) == len(LIST.read_text(encoding="utf-8").splitlines())


@pytest.mark.slow("gather", "multires", "truth", "val", "vpl")
@pytest.mark.parametrize("method", list(BUILT_IN))
def test_the_list_is_what_methods_call(method):
    """After changes of kernels: python -m benchmarks.signatures."""
    called = {line.partition("\t")[2] for line in run(
        f"import sys; sys.argv = ['', {method!r}, 'float32']; from benchmarks.signatures import main; main()"
    ).splitlines()}
    listed = {f"{one.kernel}({one.arguments})" for one in read_list() if f"{method}/float32" in one.needed_by}
    assert called == listed


def test_a_first_picture_of_a_plain_scene_waits_for_few_kernels():
    needed = Counter(key for one in read_list() for key in one.needed_by)
    assert {method: needed[f"{method}/float32"] for method in MOST} == MOST


def test_what_is_compiled_ahead_is_kept(tmp_path):
    out = run("from refgi.jit.ahead import *\n"
              "few = read_list()[-4:]\n"
              "if __name__ == '__main__':\n"
              "    assert missing(few) == few\n"
              "    shares = []\n"
              "    compile_ahead(few, lambda text, share: shares.append(share), 2)\n"
              "    print(len(missing(few)), shares[-1])", REFGI_CACHE_DIR=str(tmp_path))
    assert out.split() == ["0", "1.0"]
    assert len(list(tmp_path.glob("*.kernel"))) == 4


def test_a_list_that_is_out_of_date_stops_nothing():
    out = run("from refgi.jit.ahead import *\n"
              "old = [Specialisation('refgi.gone.kernel', 'int64', frozenset()),"
              " Specialisation('refgi.sampling.gone', 'int64', frozenset()),"
              " Specialisation('refgi.sampling.Any', 'nothing', frozenset())]\n"
              "print(missing(old))")
    assert out.strip() == "[]"

"""The width of registers that loops are shaped for."""

import os
import subprocess
import sys

import llvmlite.binding
import pytest

from refgi.jit import has_wide_registers


@pytest.mark.parametrize(("name", "features", "wide"), [
    (None, "+sse2,+avx512f", True), (None, "+avx2,-avx512f", False), ("skylake-avx512", None, False),
    ("skylake-avx512", "+avx2,+avx512f", True), ("x86-64", None, False)])
def test_the_target_that_is_named_counts(monkeypatch, name, features, wide):
    for key, value in (("NUMBA_CPU_NAME", name), ("NUMBA_CPU_FEATURES", features)):
        monkeypatch.delenv(key, raising=False)
        if value is not None:
            monkeypatch.setenv(key, value)
    assert has_wide_registers() is wide


@pytest.mark.parametrize("name", [None, "host"])
def test_else_the_processor_does(monkeypatch, name):
    monkeypatch.delenv("NUMBA_CPU_FEATURES", raising=False)
    monkeypatch.delenv("NUMBA_CPU_NAME", raising=False)
    if name:
        monkeypatch.setenv("NUMBA_CPU_NAME", name)
    for has in (True, False):
        monkeypatch.setattr(llvmlite.binding, "get_host_cpu_features", lambda has=has: {"avx512f": has})
        assert has_wide_registers() is has


SCALE = """
from numba import float32
from refgi.jit import kernel

@kernel
def scale(a, b):
    for i in range(a.size):
        b[i] *= a[i]

scale.compile((float32[::1], float32[::1]))
print("".join(scale.inspect_asm().values()))
"""


def test_registers_of_512_bits_are_used_where_llvm_would_take_half(tmp_path):
    (tmp_path / "scale.py").write_text(SCALE)
    target = {"NUMBA_CPU_NAME": "skylake-avx512", "NUMBA_CPU_FEATURES": "", "REFGI_CACHE_DIR": str(tmp_path / "cache")}
    run = subprocess.run([sys.executable, tmp_path / "scale.py"], env=os.environ | target, check=True,
                         capture_output=True, text=True)
    assert "zmm" in run.stdout

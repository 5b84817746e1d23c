"""What kernels are compiled for, where the shape of a loop should follow the processor."""

import os

import llvmlite.binding

WIDEST = "avx512f"


def has_wide_registers() -> bool:
    """Return whether kernels are compiled for AVX-512, which masks out what lies beside a span at no cost.

    Returns
    -------
    bool
        Of the processor, unless NUMBA_CPU_NAME and NUMBA_CPU_FEATURES name another target.
    """
    features = os.environ.get("NUMBA_CPU_FEATURES")
    if features is not None:
        return f"+{WIDEST}" in features.split(",")
    if os.environ.get("NUMBA_CPU_NAME") not in (None, "host"):
        return False
    return bool(llvmlite.binding.get_host_cpu_features().get(WIDEST))

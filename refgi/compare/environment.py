"""What a result was made with: versions, processor, threads."""

import platform
from typing import Any

from refgi.provenance import versions

SIMD = ("sse2", "avx", "avx2", "fma", "avx512f", "avx512vl", "neon", "sve")


def environment() -> dict[str, Any]:
    """Return versions, platform, SIMD features and threads as JSON values.

    Returns
    -------
    dict
        With the keys versions, platform, cpu, simd and threads.
    """
    import llvmlite.binding
    import numba

    features = llvmlite.binding.get_host_cpu_features()
    return {
        "versions": versions(),
        "platform": f"{platform.system()} {platform.machine()}",
        "cpu": llvmlite.binding.get_host_cpu_name(),
        "simd": [name for name in SIMD if features.get(name)],
        "threads": numba.get_num_threads(),
    }

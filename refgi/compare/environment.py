"""What a result was made with: versions, processor, threads."""

import platform
from importlib.metadata import PackageNotFoundError, version
from typing import Any

PACKAGES = ("refgi", "numpy", "numba", "llvmlite", "scipy", "embreex", "trimesh", "OpenEXR", "imageio", "matplotlib",
            "click", "rich", "pydantic", "jinja2", "flip-evaluator")
SIMD = ("sse2", "avx", "avx2", "fma", "avx512f", "avx512vl", "neon", "sve")


def versions() -> dict[str, str | None]:
    """Return the versions of Python, refgi and what it stands on.

    Returns
    -------
    dict of str to str
        None for a package that is not installed.
    """
    return {"python": platform.python_version()} | {name: _version(name) for name in PACKAGES}


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


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None

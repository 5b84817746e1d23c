"""The file of hashes, and how two sets of hashes differ."""

import json
import platform
from pathlib import Path

import llvmlite
import llvmlite.binding
import numba
import numpy as np


def machine() -> dict[str, str]:
    """Return what the bits may depend on besides the code."""
    return {"python": platform.python_version(), "numba": numba.__version__, "llvmlite": llvmlite.__version__,
            "numpy": np.__version__, "cpu": llvmlite.binding.get_host_cpu_name(), "model": _cpu_model()}


def write(file: Path, hashes: dict[str, str]) -> None:
    content = {"machine": machine(), "cases": dict(sorted(hashes.items()))}
    file.write_text(json.dumps(content, indent=1) + "\n")


def read(file: Path) -> tuple[dict[str, str], dict[str, str]]:
    """Return the machine that wrote a ledger, and its hashes."""
    content = json.loads(file.read_text())
    return content["machine"], content["cases"]


def differences(recorded: dict[str, str], found: dict[str, str]) -> list[str]:
    """Return one line for each case that is not the same in both."""
    lines = [f"differs: {name}" for name in recorded if name in found and recorded[name] != found[name]]
    lines += [f"missing: {name}" for name in recorded if name not in found]
    return lines + [f"not recorded: {name}" for name in found if name not in recorded]


def _cpu_model() -> str:
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.is_file() else []
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")),
                platform.processor())

"""The pictures of the cases, the file of their hashes, and how two sets of hashes differ."""

import hashlib
import json
import platform
from pathlib import Path
from typing import Any

import llvmlite
import llvmlite.binding
import numba
import numpy as np

from benchmarks.sameness.cases import Case, scene_of, sequence_of
from benchmarks.sameness.settings import settings_of
from refgi import render
from refgi.sssil.temporal import Sequence


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


SIZE = {"width": 45, "height": 33}
WIDER = {"width": 161, "height": 121}
RSM = 64
STILL = {"radius": 3.0, "levels": 3, "samples": 16, "downsample": "closest"}  # settings of each frame of a sequence
DIGITS = 16


def picture(case: Case) -> Any:
    """Return the irradiance of a case (3, h, w), its lobes, or the irradiance of all frames, (frames, 3, h, w)."""
    options = dict(dtype=case.dtype, rsm_resolution=RSM, **_size(case))
    settings = settings_of(case.method, **case.flat)
    if case.method == "temporal":
        still = settings_of("hssil", **STILL)
        return np.stack([step.irradiance for step in Sequence(sequence_of(case.scene), still, settings, **options)])
    return getattr(render(scene_of(case.scene), case.method, settings, **options), case.part)


def _size(case: Case) -> dict[str, int]:
    levels = case.method == "hssil" and not case.flat  # the default's need room
    drawn = case.method == "multires" and "target_error" in case.flat  # more pixels than are drawn of them
    return WIDER if levels or drawn else SIZE


def hash_of(irradiance: Any) -> str:
    """Return the first digits of the SHA-256 of dtype, shape and bytes."""
    kind = f"{irradiance.dtype.str}{irradiance.shape}".encode()
    return hashlib.sha256(kind + np.ascontiguousarray(irradiance).tobytes()).hexdigest()[:DIGITS]


def fault_of(irradiance: Any) -> str:
    """Return why a picture shows little; empty where it shows something."""
    if not np.isfinite(irradiance).all():
        return "holds infinite numbers or NaN"
    return "" if irradiance.any() else "is black"

"""The record of a comparison's pictures as rows of text, for its page.

What a result was made with: versions, processor, threads.
"""

import math
import platform
from collections.abc import Sequence
from typing import Any

from refgi.provenance import Record, versions
from refgi.scene.files import text_of

DEGREE = "\N{DEGREE SIGN}"
SIMD = ("sse2", "avx", "avx2", "fma", "avx512f", "avx512vl", "neon", "sve")


def provenance_rows(record: Record) -> list[tuple[str, str]]:
    """Return what a record says, as (name, text), in the order in which one asks."""
    scene, program = record["scene"], record["refgi"]
    return [
        ("scene", "made in Python" if scene["source"] is None else text_of(scene["source"])),
        *((f"file {text_of(name)}", f"SHA-256 {digest}") for name, digest in scene["files"].items()),
        ("geometry", f"{scene['faces']:,} faces, SHA-256 {scene['geometry_sha256']}"),
        ("materials", f"SHA-256 {scene['materials_sha256']}"),
        ("camera", _fields(scene["camera"])),
        *((f"light {number}", f"{light['type']}; {_fields(light)}") for number, light in enumerate(scene["lights"])),
        *((key.replace("_", " "), str(value)) for key, value in record["options"].items()),
        ("refgi", f"{program['version']}, commit {program.get('git', 'unknown')}"),
    ]


def _fields(content: dict[str, Any]) -> str:
    return "; ".join(f"{key.replace('_', ' ')} {_value(value)}" for key, value in content.items() if key != "type")


def _value(value: Sequence[float] | float) -> str:
    if isinstance(value, Sequence):
        return ", ".join(f"{part:g}" for part in value)
    return str(value) if isinstance(value, int) else f"{math.degrees(value):g}{DEGREE}"  # sizes, and angles


def environment() -> dict[str, Any]:
    """Return versions, platform, cpu, simd (features of the processor) and threads as JSON values."""
    import llvmlite.binding

    from refgi.jit import thread_count

    features = llvmlite.binding.get_host_cpu_features()
    return {
        "versions": versions(),
        "platform": f"{platform.system()} {platform.machine()}",
        "cpu": llvmlite.binding.get_host_cpu_name(),
        "simd": [name for name in SIMD if features.get(name)],
        "threads": thread_count(),
    }

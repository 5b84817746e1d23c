"""The pictures of the cases and their hashes."""

import hashlib
from typing import Any

import numpy as np

from benchmarks.sameness.cases import Case
from benchmarks.sameness.scenes import scene_of, sequence_of
from benchmarks.sameness.settings import settings_of
from refgi import render
from refgi.sssil.temporal import Sequence

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
    drawn = case.method in ("multires", "val") and "target_error" in case.flat  # more pixels than are drawn of them
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

"""Adaptive multiresolution splatting (Nichols and Wyman 2009): pixel lights evaluated where the picture changes.

`multires` evaluates the lights of `sii` at subsplats, large where nothing changes: `refine` lists them, `evaluate` sums
Eq. 2 at them, `upsample` makes pixels of them; `per_light` refines for each light by its own irradiance and
`error_target` until an error is met. Unlike in the paper, subsplats at full resolution are not filtered.
"""

from refgi.method import Method
from refgi.splat.multires.approximations import APPROXIMATIONS, multires_ledger
from refgi.splat.multires.multires import extra_bytes, multires, multires_lobes, shared_subsplats
from refgi.splat.multires.settings import (
    PRESETS,
    ByError,
    ByGeometry,
    ByIrradiance,
    Criteria,
    MultiresSettings,
)

__all__ = [
    "PRESETS",
    "ByError",
    "ByGeometry",
    "ByIrradiance",
    "Criteria",
    "MultiresSettings",
    "multires",
    "shared_subsplats",
]

METHOD = Method(
    "multires", "Adaptive Multiresolution Splatting (2009): the same lights, evaluated where the picture changes",
    multires, MultiresSettings, visibility=lambda settings: settings.visibility is not None, ledger=multires_ledger,
    memory=extra_bytes, presets=PRESETS, approximations=APPROXIMATIONS, lobes=multires_lobes)

"""Splatting Indirect Illumination (Dachsbacher and Stamminger 2006): pixel lights where they are significant.

`sii` turns texels of the reflective shadow map into pixel lights and adds the irradiance of each to the pixels where it
is significant: `threshold` turns settings into I_low and ranges, `bounds` encloses what a light may reach, `lists` says
which tiles that touches, `fragments` counts what came of it. It differs from the paper where that is silent or wrong:
fluxes carry exact solid angles and T / N, intensities 1 / pi, Phong lobes conserve their flux above the surface, and
the picture is that of the threshold alone, whatever bound found the pixels.
"""

from refgi.method import Method
from refgi.splat.sii.approximations import APPROXIMATIONS, sii_ledger
from refgi.splat.sii.settings import (
    PRESETS,
    AbsoluteCut,
    EllipsoidBound,
    FullBound,
    MeshBound,
    QuadBound,
    ReachSettings,
    RelativeCut,
    SiiSettings,
    TangentBound,
    extra_bytes,
)
from refgi.splat.sii.sii import cut_irradiance, sii, sii_lobes, splat

__all__ = [
    "PRESETS",
    "AbsoluteCut",
    "EllipsoidBound",
    "FullBound",
    "MeshBound",
    "QuadBound",
    "ReachSettings",
    "RelativeCut",
    "SiiSettings",
    "TangentBound",
    "cut_irradiance",
    "sii",
    "splat",
]

METHOD = Method(
    "sii", "Splatting Indirect Illumination (2006): pixel lights shine where they are significant", sii, SiiSettings,
    visibility=False, ledger=sii_ledger, memory=extra_bytes, presets=PRESETS, approximations=APPROXIMATIONS,
    lobes=sii_lobes)

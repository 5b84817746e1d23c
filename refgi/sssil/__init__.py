"""Screen-space indirect light: the surfaces that a camera sees light each other.

`hssil` (Soler, Hoel, Rochet, Jay and Holzschuch 2009) gathers light from samples around every pixel, near by at high
and far away at low resolution. `levels` builds the mip levels, `pattern` places samples, `crown` sums their light,
`blur` averages it along surfaces, `upsampling` joins the levels, `temporal` blends frames, `cameras` adds surfaces
outside the picture, `bitmask` and `rays` test what lies between receiver and sample, `glossy` draws samples for lobes.
"""

from refgi.method import Method
from refgi.sssil.approximations import APPROXIMATIONS, extra_bytes
from refgi.sssil.crown import gather
from refgi.sssil.hssil import hssil, hssil_lobes
from refgi.sssil.levels import pyramid
from refgi.sssil.settings import (
    PRESETS,
    TEMPORAL_PRESETS,
    Bilateral,
    Bilinear,
    Bitmask,
    CameraSettings,
    GeometryBlur,
    HssilSettings,
    Nearest,
    Rays,
    SamplingSettings,
    SenderSettings,
    TemporalSettings,
)
from refgi.sssil.upsampling import Guide, upsample
from refgi.sssil.view import Level

__all__ = [
    "PRESETS",
    "TEMPORAL_PRESETS",
    "Bilateral",
    "Bilinear",
    "Bitmask",
    "CameraSettings",
    "GeometryBlur",
    "Guide",
    "HssilSettings",
    "Level",
    "Nearest",
    "Rays",
    "SamplingSettings",
    "SenderSettings",
    "gather",
    "hssil",
    "pyramid",
    "upsample",
]

METHOD = Method(
    "hssil", "Hierarchical Screen-Space Indirect Illumination (2009): what the camera sees lights what it sees", hssil,
    HssilSettings, visibility=lambda settings: settings.visibility is not None, memory=extra_bytes, presets=PRESETS,
    temporal=TemporalSettings(), temporal_presets=TEMPORAL_PRESETS, approximations=APPROXIMATIONS, lobes=hssil_lobes)

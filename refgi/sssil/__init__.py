"""Screen-space indirect light: what a camera sees lights what it sees.

`hssil` (Soler, Hoel, Rochet, Jay and Holzschuch 2009) gathers light from samples around every pixel, near by at high
and far away at low resolution.

`pyramid` makes the levels, `crown` places samples and sums what they send, `upsampling` joins the levels, `temporal`
keeps light from frame to frame, `cameras` add what the picture does not see, `visibility` tells what lies between.
"""

from refgi.method import Method
from refgi.sssil.crown.gather import gather
from refgi.sssil.hssil import hssil
from refgi.sssil.level import Level
from refgi.sssil.memory import extra_bytes
from refgi.sssil.pyramid.levels import pyramid
from refgi.sssil.settings import HssilSettings
from refgi.sssil.upsampling.upsample import Guide, upsample

__all__ = ["Guide", "HssilSettings", "Level", "gather", "hssil", "pyramid", "upsample"]

METHOD = Method(
    "hssil", "Hierarchical Screen-Space Indirect Illumination (2009): what the camera sees lights what it sees", hssil,
    HssilSettings, visibility=False, memory=extra_bytes)

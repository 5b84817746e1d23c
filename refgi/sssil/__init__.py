"""Screen-space indirect light: what a camera sees lights what it sees.

`hssil` (Soler, Hoel, Rochet, Jay and Holzschuch 2009) gathers light from samples around every pixel, near by at high
and far away at low resolution.

`pyramid` makes the levels, `crown` places samples and sums what they send, `upsampling` joins the levels, `temporal`
keeps light from frame to frame, `cameras` add what the picture does not see, `visibility` tells what lies between.
"""

from refgi.sssil.settings import HssilSettings

__all__ = ["HssilSettings"]

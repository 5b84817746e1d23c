"""From area lights to the picture: all pixel lights under their visibility, interleaved and blurred (Sec. 4, 6).

`clustered_irradiance` is the sum, `interleave` assigns the lights to the pixels of blocks, `blur` joins these. Unlike
the paper, each light counts n^2 times in the pixels that sum it, and irradiance is blurred instead of radiance.
"""

from refgi.cluster.lighting.blur import blur
from refgi.cluster.lighting.clustered import clustered_irradiance

__all__ = ["blur", "clustered_irradiance"]

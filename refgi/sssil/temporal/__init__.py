"""Temporal coherence: indirect light blended over frames, which removes most of the noise and adds lag (Sec. 3.3).

Each pixel's surface point is reprojected into the frame before, where that surface was then (`motion`), and the light
it had there is blended with the new (`filter`). `Sequence` renders scenes one after the other and stores the `History`
of the last; `refgi.scene.path` moves camera, lights and objects through one scene.
"""

from refgi.sssil.settings import TemporalSettings
from refgi.sssil.temporal.sequence import Sequence, SequenceFrame, still_frame

__all__ = ["Sequence", "SequenceFrame", "TemporalSettings", "still_frame"]

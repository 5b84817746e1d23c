"""Indirect light kept from frame to frame: most of a sequence's noise goes, at the price of light that lags behind.

Each pixel's surface point is found in the frame before, where that surface was then (`motion`), and the light it had
there is blended with the new (`filter`). `Sequence` renders scenes one after the other and keeps of each what the next
needs; `refgi.scene.path` moves camera, lights and objects through one scene.
"""

from refgi.sssil.temporal.filter import TemporalSettings
from refgi.sssil.temporal.sequence import Sequence, Step

__all__ = ["Sequence", "Step", "TemporalSettings"]

"""Energy ledger of `val` (REF-04): beside what all pixel lights lose, light that is blocked or lost to interleaving."""

import dataclasses
from typing import TYPE_CHECKING

from refgi.cluster.settings import InterleavingSettings, ValSettings
from refgi.cluster.val import val
from refgi.ledger import Ledger, account
from refgi.lights.selection import choose_lights, footprints
from refgi.lights.settings import with_clamp
from refgi.pairs.irradiance import Receivers, irradiance
from refgi.stages import stage

if TYPE_CHECKING:
    from refgi.frame import Frame


@stage("cluster.ledger")
def val_ledger(frame: "Frame", settings: ValSettings) -> Ledger:
    """Account for the power of the lights under `val`.

    -> Ledger: Its lines sum to `emitted` but for the rounding of the frame's dtype.

    Notes
    -----
    `shadowed` is what the method's own soft shadows take. On the Cornell box at 512 x 512 it takes 2.6 times as long as
    the picture.
    """
    settings = with_clamp(settings)
    footprint = footprints(frame, settings.lights, settings.pairs)
    receivers = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))
    unblocked = irradiance(receivers, choose_lights(frame, settings.lights), settings.pairs, footprint)
    whole = dataclasses.replace(settings, interleaving=InterleavingSettings(block=1))
    picture = val(frame, settings)
    every = val(frame, whole) if whole != settings else picture
    return account(frame, settings.lights, settings.pairs, footprint, picture,
                   {"shadowed": unblocked - every, "interpolated": every - picture})

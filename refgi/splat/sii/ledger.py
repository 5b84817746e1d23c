"""Energy ledger of `sii` (REF-04): beside what all pixel lights lose, light out of range and between pixels."""

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy.typing as npt

from refgi.ledger import Ledger, account
from refgi.lights.selection import choose_lights, footprints
from refgi.lights.settings import with_clamp
from refgi.pairs.irradiance import Receivers
from refgi.settings import replaced
from refgi.splat.sii.settings import MeshBound, SiiSettings
from refgi.splat.sii.sii import cut_irradiance, sii
from refgi.stages import stage

if TYPE_CHECKING:
    from refgi.frame import Frame

Array = npt.NDArray[Any]


@stage("sii.ledger")
def sii_ledger(frame: "Frame", settings: SiiSettings) -> Ledger:
    """Account for the power of the lights under `sii`.

    -> Ledger: Its lines sum to `emitted` but for the rounding of the frame's dtype.

    Notes
    -----
    Lights are summed in full, without lightcuts.
    On the Cornell box at 512 x 512 it takes six times as long as the picture.
    """
    settings = dataclasses.replace(with_clamp(settings), lightcuts=None)
    footprint = footprints(frame, settings.lights, settings.pairs)
    picture = sii(frame, settings)
    between = sii(frame, replaced(settings, {"half_resolution": False})) - picture if settings.half_resolution else None
    return account(frame, settings.lights, settings.pairs, footprint, picture,
                   {"cut": _cut(frame, settings, footprint), "interpolated": between})


def _cut(frame: "Frame", settings: SiiSettings, footprint: Array | None) -> Array | None:
    """Return what the range leaves out, and what a mesh that does not enclose it leaves out besides."""
    if settings.reach.cut is None:
        return None
    receivers = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))
    cut = cut_irradiance(receivers, choose_lights(frame, settings.lights), settings, footprint)
    bound = settings.reach.bound
    if isinstance(bound, MeshBound) and not bound.inflate:
        cut = cut + sii(frame, replaced(settings, {"bound_inflate": True})) - sii(frame, settings)
    return cut

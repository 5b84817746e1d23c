"""Energy ledger of `multires` (REF-04): beside what all pixel lights lose, light between subsplats and in Eq. 3."""

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy.typing as npt

from refgi.ledger import Ledger, account
from refgi.lights.selection import choose_lights
from refgi.pairs.irradiance import Receivers, irradiance
from refgi.splat.multires.multires import light_areas, multires
from refgi.splat.multires.settings import MOST_CELLS, ByGeometry, MultiresSettings
from refgi.stages import stage

if TYPE_CHECKING:
    from refgi.frame import Frame

Array = npt.NDArray[Any]


@stage("multires.ledger")
def multires_ledger(frame: "Frame", settings: MultiresSettings) -> Ledger:
    """Account for the power of the lights under `multires`.

    -> Ledger: Its lines sum to `emitted` but for the rounding of the frame's dtype.

    Notes
    -----
    Lights are summed in full, without lightcuts.
    `interpolated` is every pixel's sum less the picture before Eq. 3, and so holds twice the size and the printed
    forms of subsplats as well. It sums all lights at every pixel three times or more: on the Cornell box at 512 x 512
    it takes 17 times as long as the picture.
    """
    settings = dataclasses.replace(settings, lightcuts=None)
    lights, pairs = choose_lights(frame, settings.lights), settings.effective_pairs
    footprint = light_areas(frame, lights, settings)
    receivers = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))
    unblocked = every = irradiance(receivers, lights, pairs, footprint)
    if settings.visibility is not None:
        finest = ByGeometry(coarsest=MOST_CELLS, visibility=settings.visibility)
        every = multires(frame, MultiresSettings(settings.lights, settings.pairs, finest))
    picture = plain = multires(frame, settings)
    if settings.detail > 0:
        plain = multires(frame, dataclasses.replace(settings, detail=0.0))
    return account(frame, settings.lights, pairs, footprint, picture,
                   {"shadowed": unblocked - every, "interpolated": every - plain, "darkened": plain - picture})

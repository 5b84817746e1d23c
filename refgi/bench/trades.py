"""What a method could leave out at the cost of a difference: changes of its settings, to be measured on a scene."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pydantic

from refgi.bench.dim_lights import DimLights
from refgi.errors import InputError
from refgi.methods import Picture
from refgi.settings import Settings, from_text

Array = npt.NDArray[Any]

# by method: what is left out, or put back, and how settings change
TRADES: dict[str, tuple[tuple[str, tuple[str, ...]], ...]] = {
    "sii": (("pairs below 1 % of the brightest light's irradiance", ("reach.cut=relative", "reach.cut.share=0.01")),
            ("three of four pixels where neighbours resemble each other", ("half_resolution=true",))),
    "multires": (("subsplats that a target of 1 % does not ask for", ("subsplats=error", "subsplats.target=0.01")),),
    "val": (("63 of 64 lights at each pixel", ("interleaving.block=8",)),
            ("nothing: walls that nothing lies behind are drawn into maps too", ("maps.occluders_alone=false",))),
}


class Trade(pydantic.BaseModel):
    """A change of settings, measured."""

    model_config = pydantic.ConfigDict(extra="forbid", frozen=True)

    meaning: str
    changes: tuple[str, ...]  # "key=value", as --set takes them
    times: tuple[float, ...]  # s of a whole frame as the settings are, a round each
    times_changed: tuple[float, ...]  # as changed, right after
    difference: float | None  # RMSE to the picture as the settings are, over its mean; None where that is black


class Change(NamedTuple):
    """A change of settings."""

    meaning: str
    changes: tuple[str, ...]
    settings: Settings


def changes_of(method: str, settings: Settings, lights: DimLights | None) -> list[Change]:
    """Return what a method could leave out and does not yet.

    Those of `TRADES` that go with the other settings, after fewer lights.
    """
    fewer = () if lights is None else (
        (f"lights: as many as carry {lights.share:.1%}, drawn anew", (f"lights.count={lights.count}",)),)
    made = []
    for meaning, changes in (*fewer, *TRADES.get(method, ())):
        try:
            changed = from_text(settings, changes)
        except InputError:  # does not go with the other settings
            continue
        if changed != settings:
            made.append(Change(meaning, changes, changed))
    return made


def difference(picture: Picture, plain: Picture) -> float | None:
    """Return the RMSE between the irradiance of two pictures over all pixels with a surface, over the second's mean.

    None where the second is black.
    """
    covered = plain.frame.gbuffer.covered
    made, right = (one.irradiance[:, covered].astype(np.float64) for one in (picture, plain))
    mean = float(right.mean()) if right.size else 0.0
    return float(np.sqrt(((made - right) ** 2).mean())) / mean if mean > 0 else None

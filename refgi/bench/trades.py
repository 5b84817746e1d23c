"""What a method could leave out at the cost of a difference: changes of its settings, and lights too dim to matter.

A light's part is its irradiance over sampled pixels, clamped as the method clamps it, without visibility. The sum over
all pixels is then timed with all lights and with those alone that carry `SHARE` of it. No setting leaves such lights
out: lights stand for equal shares of the maps, and `lights.count` draws fewer that stand for more each.
"""

from collections.abc import Callable
from time import perf_counter
from typing import NamedTuple

import numpy as np
import pydantic

from refgi.errors import InputError
from refgi.frame import Frame
from refgi.lights.selection import choose_lights, footprints
from refgi.lights.settings import LightSettings
from refgi.methods import Picture
from refgi.pairs.estimates import light_at, sample_for
from refgi.pairs.irradiance import Receivers, irradiance
from refgi.pairs.pixel_lights import PixelLights
from refgi.pairs.settings import PairSettings
from refgi.settings import Settings, from_text
from refgi.types import Array

SHARE = 0.999
MOST = 8192  # lights that are summed one by one


class DimLights(pydantic.BaseModel):
    """Lights that carry nearly all of a picture's light without visibility."""

    model_config = pydantic.ConfigDict(extra="forbid", frozen=True)

    lights: int
    carrying: int  # the fewest that carry `share`
    count: int  # `lights.count` that draws about as many
    share: float
    times: tuple[float, ...]  # s of the sum over all lights at all pixels, a round each
    times_carrying: tuple[float, ...]  # over those alone
    error: float  # RMSE without the others, over the mean


def dim_lights(
    frame: Frame, settings: Settings, rounds: int, *, share: float = SHARE, clock: Callable[[], float] = perf_counter
) -> DimLights | None:
    """Measure what leaving out the dimmest pixel lights would save and cost; at least `share` of the light is kept.

    None for a method without pixel lights, with rays for them or more than `MOST`, and for a dark picture. `clock` in
    s.
    """
    chosen = getattr(settings, "lights", None)
    pairs = getattr(settings, "effective_pairs", None)
    if not isinstance(chosen, LightSettings) or pairs is None:
        return None
    lights = choose_lights(frame, chosen)
    footprint = footprints(frame, chosen, pairs)
    receivers = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))
    if lights.flux.shape[1] > MOST:
        return None
    parts = parts_of_lights(receivers, lights, pairs, footprint)
    kept = brightest(parts, share)
    if not len(kept):
        return None
    some = (receivers, lights.selected(kept), pairs, None if footprint is None else footprint[kept])
    every = (receivers, lights, pairs, footprint)
    times: tuple[list[float], list[float]] = ([], [])
    right, without = irradiance(*every), irradiance(*some)
    for _ in range(rounds):
        for took, arguments in zip(times, (every, some), strict=True):
            started = clock()
            irradiance(*arguments)
            took.append(clock() - started)
    difference = (without - right)[:, receivers.covered].astype(np.float64)
    mean = float(right[:, receivers.covered].mean(dtype=np.float64))
    return DimLights(lights=len(parts), carrying=len(kept), count=max(1, round(chosen.count * len(kept) / len(parts))),
                     share=share, times=tuple(times[0]),
                     times_carrying=tuple(times[1]), error=float(np.sqrt((difference**2).mean())) / mean)


def parts_of_lights(
    receivers: Receivers, lights: PixelLights, pairs: PairSettings, footprint: Array | None = None
) -> Array:
    """Return the irradiance, W/m^2, that each of N lights adds to the mean over sampled pixels and channels, (N,).

    Without visibility; `footprint`: surface area that each light stands for, m^2.
    """
    sample = sample_for(receivers, lights)
    return np.array([light_at(sample, lights.selected([k]), pairs, None if footprint is None else footprint[[k]])
                     for k in range(lights.flux.shape[1])])


def brightest(parts: Array, share: float) -> Array:
    """Return the fewest lights (n,) that carry a share of the sum of all parts (N,), rising; none where that is 0."""
    order = np.argsort(-parts, kind="stable")
    sums = np.cumsum(parts[order])
    if not len(sums) or sums[-1] <= 0:
        return order[:0]
    return np.sort(order[: int(np.searchsorted(sums, share * sums[-1])) + 1])


# by method: what is left out, or put back, and how settings change
TRADES: dict[str, tuple[tuple[str, tuple[str, ...]], ...]] = {
    "sii": (("pairs below 1 % of the brightest light's irradiance", ("reach.cut=relative", "reach.cut.share=0.01")),
            ("three of four pixels where neighbours resemble each other", ("half_resolution=true",))),
    "multires": (("subsplats that a target of 1 % does not ask for", ("subsplats=error", "subsplats.target=0.01")),),
    "val": (("subsplats that a target of 10 % does not ask for", ("interleaving.block=none", "subsplats.target=0.1")),
            ("63 of 64 lights at each pixel", ("interleaving.block=8",)),
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

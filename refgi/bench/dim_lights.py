"""Lights below a share of the sum: how many pixel lights carry nearly all of a picture's light; what the others cost.

A light's part is its irradiance over sampled pixels, clamped as the method clamps it, without visibility. The sum over
all pixels is then timed with all lights and with those alone that carry `SHARE` of it. No setting leaves such lights
out: lights stand for equal shares of the maps, and `lights.count` draws fewer that stand for more each.
"""

from collections.abc import Callable
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt
import pydantic

from refgi.frame import Frame
from refgi.lights.selection import choose_lights, footprints
from refgi.lights.settings import LightSettings
from refgi.pairs.irradiance import Receivers, irradiance
from refgi.pairs.loss import light_at, sample_for
from refgi.pairs.pixel_lights import PixelLights
from refgi.pairs.settings import PairSettings
from refgi.settings import Settings

Array = npt.NDArray[Any]

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

    None for a method without pixel lights, or with more than `MOST`, and for a dark picture. `clock` in s.
    """
    chosen = getattr(settings, "lights", None)
    if not isinstance(chosen, LightSettings):
        return None
    lights, pairs = choose_lights(frame, chosen), settings.effective_pairs  # type: ignore[attr-defined]
    footprint = footprints(frame, chosen, pairs)
    receivers = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))
    if lights.flux.shape[1] > MOST:
        return None
    parts = parts_of_lights(receivers, lights, pairs, footprint)
    kept = brightest(parts, share)
    if not len(kept):
        return None
    some = (receivers, selected(lights, kept), pairs, None if footprint is None else footprint[kept])
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
    return np.array([light_at(sample, selected(lights, [k]), pairs, None if footprint is None else footprint[[k]])
                     for k in range(lights.flux.shape[1])])


def selected(lights: PixelLights, index: Any) -> PixelLights:
    """Return some of the lights, in the order of `index` (n,)."""
    parts: dict[str, Any] = {name: values[..., index] for name, values in lights._asdict().items()
                             if isinstance(values, np.ndarray)}
    return lights._replace(**parts)


def brightest(parts: Array, share: float) -> Array:
    """Return the fewest lights (n,) that carry a share of the sum of all parts (N,), rising; none where that is 0."""
    order = np.argsort(-parts, kind="stable")
    sums = np.cumsum(parts[order])
    if not len(sums) or sums[-1] <= 0:
        return order[:0]
    return np.sort(order[: int(np.searchsorted(sums, share * sums[-1])) + 1])

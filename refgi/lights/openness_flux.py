"""Openness scaling and Russian roulette of pixel lights (SII Sec. 3.6): lights near nothing cost as much as others.

The paper scales the flux "by the ambient occlusion term" on an unwarped pattern. With O the share of free directions
the intended factor is 1 - O: `scale_flux` darkens lights in the open and so loses energy, the sum of Phi O. `roulette`
instead removes them at random and lets the survivors make up for it, so the mean stays the same. By the paper's own O
(Sec. 3.5) the printed factor is O, which darkens the lights near other surfaces, against its aim: `as_printed`.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.draws import ROULETTE, draws
from refgi.errors import expect
from refgi.stages import stage

if TYPE_CHECKING:
    from refgi.pairs.pixel_lights import PixelLights

Array = npt.NDArray[Any]


@stage("lights.scale_flux")
def scale_flux(
    lights: "PixelLights", openness: Array, as_printed: bool = False
) -> "tuple[PixelLights, Array]":
    """Scale each light's flux by 1 - O.

    openness (light,): Share O of unoccluded directions of each light, 0 to 1.
    as_printed: Scale by O, the ambient occlusion term as the paper defines it.
    -> lights PixelLights: All of them, in the same order; those with O = 1, as printed O = 0, are dark.
    -> lost (3,) float64: Flux removed, W, diffuse and lobe together.

    Raises
    ------
    InputError
        If openness does not fit.
    """
    _check(lights, openness)
    factor = (openness if as_printed else 1 - openness).astype(lights.flux.dtype)
    scaled = lights._replace(flux=lights.flux * factor)
    if lights.lobe_flux is not None:
        scaled = scaled._replace(lobe_flux=lights.lobe_flux * factor)
    return scaled, power(lights) - power(scaled)


@stage("lights.roulette")
def roulette(lights: "PixelLights", openness: Array, floor: float, seed: int) -> "PixelLights":
    """Keep each light with chance p = max(floor, 1 - O) and divide its flux by p.

    openness (light,): Share O of unoccluded directions of each light, 0 to 1.
    floor: Least chance, above 0 to 1: no light's flux grows by more than 1 / floor.
    seed: Which random choice: one number a light, in their order.
    -> PixelLights: The survivors, in order. Sums over them have the mean of sums over `lights`.

    Raises
    ------
    InputError
        If openness does not fit or a number is out of range.
    """
    _check(lights, openness)
    expect(0 < floor <= 1, "floor", "above 0, up to 1", floor)
    chance = np.maximum(1 - np.asarray(openness, np.float64), floor)
    survives = draws(seed, ROULETTE, len(chance)) < chance
    gain = (1 / chance[survives]).astype(lights.flux.dtype)
    parts: dict[str, Any] = {name: part[..., survives] for name, part in lights._asdict().items()
                             if isinstance(part, np.ndarray)}
    survivors = lights._replace(**parts)
    survivors = survivors._replace(flux=survivors.flux * gain)
    if survivors.lobe_flux is not None:
        survivors = survivors._replace(lobe_flux=survivors.lobe_flux * gain)
    return survivors


def _check(lights: "PixelLights", openness: Array) -> None:
    count = lights.flux.shape[1]
    expect(np.shape(openness) == (count,), "openness", f"shape ({count},), one for each light", np.shape(openness))
    expect(bool(((openness >= 0) & (openness <= 1)).all()), "openness", "numbers from 0 to 1", "others")


def power(lights: "PixelLights") -> Array:
    """Return the flux of all lights, diffuse and lobe together, (3,) W in float64."""
    flux: Array = lights.flux.sum(axis=1, dtype=np.float64)
    return flux if lights.lobe_flux is None else flux + lights.lobe_flux.sum(axis=1, dtype=np.float64)

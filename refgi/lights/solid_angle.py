"""Reflective shadow maps whose texels are taken to subtend the same solid angle, as the papers print it.

A texel at the centre of a square 90 degree frustum subtends 1.910 times the mean, one in its corner 0.368 times, so
with equal ones lights come out too dim inside and too bright outside (Nichols and Wyman 2009, Fig. 13).
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.errors import expect

if TYPE_CHECKING:
    from refgi.rsm import PixelLights, Rsm
    from refgi.scene.model import Light

Array = npt.NDArray[Any]

DEMO_CONSTANT = 1.5  # pi over the 2 pi / 3 sr of a square 90 degree frustum


def with_equal_solid_angles(rsm: "Rsm") -> "Rsm":
    """Return a map with the flux its texels would have if all that the light shines into subtended the same.

    Parameters
    ----------
    rsm : Rsm
        A map with exact solid angles.

    Returns
    -------
    Rsm
        With solid angles and fluxes scaled; the solid angle of the whole map is unchanged.
    """
    from refgi.rsm.reflective import incident_flux

    exact = rsm.solid_angle
    inside = incident_flux(rsm.light, rsm.projection, exact, exact.dtype).any(axis=0)
    mean = exact[inside].sum(dtype=np.float64) / max(1, np.count_nonzero(inside))
    equal = np.where(inside, mean, exact).astype(exact.dtype)
    factor = np.divide(equal, exact, out=np.zeros_like(exact), where=inside)
    lobe = None if rsm.lobe_flux is None else rsm.lobe_flux * factor
    return rsm._replace(solid_angle=equal, flux=rsm.flux * factor, lobe_flux=lobe)


def demo_footprints(lights: "PixelLights", sources: "Sequence[Light]", shares: "Sequence[int]") -> Array:
    """Return the disc that each light stands for in the authors' demo: pi L^2 / (1.5 N).

    Parameters
    ----------
    lights : PixelLights
        Of maps.
    sources : sequence of Light
        The light of each map.
    shares : sequence of int
        N: how many texels were drawn from each map.

    Returns
    -------
    (N',) ndarray
        Area, m^2: that of equal shares of a square 90 degree frustum, seen from the front.

    Raises
    ------
    InputError
        If a light is directional and so has no distance L.
    """
    area = np.zeros(lights.position.shape[1])
    for index, (source, count) in enumerate(zip(sources, shares, strict=True)):
        place = getattr(source, "position", None)
        expect(place is not None, "as_published", "no 'ams_disc' under a directional light", "ams_disc")
        mine = lights.map_index == index
        away = lights.position[:, mine] - np.asarray(place, np.float64)[:, None]
        area[mine] = np.pi / (DEMO_CONSTANT * count) * (away**2).sum(axis=0)
    return area

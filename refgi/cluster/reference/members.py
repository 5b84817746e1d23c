"""Visibility of an area light as the share of its pixel lights that rays reach: what clustering alone leaves (Sec. 4).

V_C(x) = sum over the cluster of w_i V(p_i, x) / sum of w_i. With w_i = L_i(x), what each light gives to x, the sum of
the paper's third equation is that of its second, exactly: no error of clustering is left, and none of soft shadows.
"""

from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from refgi.cluster.area_lights import AreaLights, Given
from refgi.cluster.reference.unobstructed import free_share

if TYPE_CHECKING:
    from refgi.frame import Frame
    from refgi.lights import PixelLights

Array = npt.NDArray[Any]
Weights = Literal["even", "flux", "light"]


def member_visibility(
    frame: "Frame", lights: "PixelLights", areas: AreaLights, weights: Weights = "flux"
) -> Given:
    """Return V of an area light as the share of its lights that a receiver sees.

    Parameters
    ----------
    frame : Frame
        The scene, whose triangles block.
    lights : PixelLights
        The lights.
    areas : AreaLights
        Their clusters.
    weights : {"even", "flux", "light"}
        What a light counts: all alike; by its flux; by the light it would give a diffuse receiver, with both cosines
        and the distance.

    Returns
    -------
    callable
        ``(m, points (3, n), facing (3, n)) -> (n,)``, in the dtype of the points.

    Notes
    -----
    Lights that face away from a receiver, or lie below its surface, give it nothing and do not count; where none is
    left V is 1. There is no rule for receivers behind the area light: each light has a normal of its own. A light's
    flux is the sum over its channels, diffuse and glossy.
    """
    position, normal = (np.asarray(a, np.float64) for a in (lights.position, lights.normal))
    flux = np.asarray(lights.flux, np.float64).sum(axis=0)
    if lights.lobe_flux is not None:
        flux = flux + np.asarray(lights.lobe_flux, np.float64).sum(axis=0)
    order = np.argsort(areas.of, kind="stable")
    first = np.searchsorted(areas.of[order], np.arange(len(areas.members) + 1))

    def given(m: int, points: Array, facing: Array) -> Array:
        of = order[first[m] : first[m + 1]]

        def worth(toward: Array, up: Array) -> Array:
            away: Array = -np.einsum("nkc,ck->nk", toward, normal[:, of])
            if weights != "light":
                counted: Array = np.where(away > 0, flux[of] if weights == "flux" else 1.0, 0.0)
                return counted
            square = np.einsum("nkc,nkc->nk", toward, toward)
            above = np.einsum("nkc,nc->nk", toward, up)
            faced = (away > 0) & (above > 0)
            given_light: Array = np.divide(flux[of] * away * above, square**2, out=np.zeros_like(square), where=faced)
            return given_light

        return free_share(frame.tracer, points, facing, position[:, of], normal[:, of], worth, frame.tracer.grain)

    return given

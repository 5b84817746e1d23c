"""Visibility of an area light as the share of its pixel lights that rays reach: what clustering alone leaves (Sec. 4).

V_C(x) = sum over the cluster of w_i V(p_i, x) / sum of w_i. With w_i = L_i(x), what each light gives to x, the sum of
the paper's third equation is that of its second, exactly: no error of clustering is left, and none of soft shadows.
"""

from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from refgi.cluster.clustering.rectangle import AreaLights, VisibilityFunction
from refgi.cluster.maps.occluders import ends_of
from refgi.cluster.reference.back_projection import back_projection_visibility
from refgi.cluster.reference.rays import free_share, rectangle_visibility
from refgi.cluster.settings import BackProjection, RaysRectangle, RaysVpls, ValSettings

if TYPE_CHECKING:
    from refgi.cluster.maps.shadow_maps import ShadowMaps
    from refgi.frame import Frame
    from refgi.lights import PixelLights

Array = npt.NDArray[Any]

Weights = Literal["even", "flux", "light"]


def vpl_visibility(
    frame: "Frame", lights: "PixelLights", areas: AreaLights, weights: Weights = "flux"
) -> VisibilityFunction:
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
        What a light counts: the same for all; its flux; the light it would give a diffuse receiver, with both cosines
        and the distance.

    Returns
    -------
    callable
        A `VisibilityFunction`, in the dtype of the points.

    Notes
    -----
    Lights that face away from a receiver, or lie below its horizon, give it nothing and do not count; where none is
    left V is 1. Those above the horizon of an interpolated normal and below the face count as hidden. There is no rule
    for receivers behind the area light: each light has a normal of its own. A light's flux is the sum over its
    channels, diffuse and glossy.
    """
    position, normal = (np.asarray(a, np.float64) for a in (lights.position, lights.normal))
    flux = np.asarray(lights.flux, np.float64).sum(axis=0)
    if lights.lobe_flux is not None:
        flux = flux + np.asarray(lights.lobe_flux, np.float64).sum(axis=0)
    order = np.argsort(areas.of, kind="stable")
    first = np.searchsorted(areas.of[order], np.arange(len(areas.members) + 1))

    def visibility_of(m: int, points: Array, facing: Array, shading: Array | None = None) -> Array:
        of = order[first[m] : first[m + 1]]

        def contribution(toward: Array, up: Array) -> Array:
            away: Array = -np.einsum("nkc,ck->nk", toward, normal[:, of])
            if weights != "light":
                counted: Array = np.where(away > 0, flux[of] if weights == "flux" else 1.0, 0.0)
                return counted
            square = np.einsum("nkc,nkc->nk", toward, toward)
            above = np.einsum("nkc,nc->nk", toward, up)
            faced = (away > 0) & (above > 0)
            light: Array = np.divide(flux[of] * away * above, square**2, out=np.zeros_like(square), where=faced)
            return light

        return free_share(frame.tracer, points, facing, position[:, of], normal[:, of], contribution,
                          frame.tracer.grain, shading=shading)

    return visibility_of


def reference_visibility(
    frame: "Frame", lights: "PixelLights", areas: AreaLights, maps: "ShadowMaps | None",
    settings: ValSettings,
) -> VisibilityFunction | None:
    """Return the reference visibility of `settings.visibility`.

    Parameters
    ----------
    frame : Frame
        The scene.
    lights : PixelLights
        The pixel lights.
    areas : AreaLights
        Their area lights.
    maps : ShadowMaps or None
        Their shadow maps; for `BackProjection` alone.
    settings : ValSettings
        Says which.

    Returns
    -------
    callable or None
        A `VisibilityFunction`; None where it is not by reference.
    """
    if isinstance(settings.visibility, RaysVpls):
        return vpl_visibility(frame, lights, areas)
    projected = maps if isinstance(settings.visibility, BackProjection) else None
    rectangle = None
    if isinstance(settings.visibility, RaysRectangle) or (projected is not None and settings.maps.behind == "raytrace"):
        rectangle = rectangle_visibility(frame, areas, settings.drawn_maps, ends=ends_of(frame, lights))
    return rectangle if projected is None else back_projection_visibility(areas, projected, rectangle)

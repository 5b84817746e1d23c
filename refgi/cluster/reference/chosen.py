"""The reference that settings ask for."""

from typing import TYPE_CHECKING

from refgi.cluster.clustering.rectangle import AreaLights, Given
from refgi.cluster.maps.occluders import ends_of
from refgi.cluster.reference.back_projection import back_projected_visibility
from refgi.cluster.reference.rays import member_visibility, rectangle_visibility
from refgi.cluster.settings import ValSettings

if TYPE_CHECKING:
    from refgi.cluster.maps.shadow_maps import ShadowMaps
    from refgi.frame import Frame
    from refgi.lights import PixelLights


def reference_visibility(
    frame: "Frame", lights: "PixelLights", areas: AreaLights, maps: "ShadowMaps | None",
    settings: ValSettings,
) -> Given | None:
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
        What each area light sees; for "back_projection" alone.
    settings : ValSettings
        Says which.

    Returns
    -------
    callable or None
        ``(m, points (3, n), facing (3, n)) -> (n,)``; None where it is not by reference.
    """
    if settings.visibility == "members":
        return member_visibility(frame, lights, areas)
    projected = maps if settings.visibility == "back_projection" else None
    rectangle = None
    if settings.visibility == "rectangle" or (projected is not None and settings.behind == "raytrace"):
        rectangle = rectangle_visibility(frame, areas, settings, ends=ends_of(frame, lights))
    return rectangle if projected is None else back_projected_visibility(areas, projected, rectangle)

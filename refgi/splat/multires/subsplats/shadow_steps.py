"""Light at subsplats under soft shadows of clusters one step after the other: those of `val` on one row of pixels."""

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.cluster.lighting.clustered import clustered_irradiance
from refgi.cluster.reference import reference_visibility
from refgi.cluster.val import cluster_lights
from refgi.pairs.irradiance import Receivers
from refgi.pairs.tiles import taken
from refgi.rsm import facing_normals
from refgi.splat.multires.refinement.grid import Subsplats
from refgi.stages import stage

if TYPE_CHECKING:
    from refgi.cluster.settings import ValSettings
    from refgi.frame import Frame
    from refgi.lights import PixelLights
    from refgi.rsm import GBuffer

Array = npt.NDArray[Any]


@stage("multires.one_row", kept=False)
def one_row(position: Array, normal: Array, triangle_id: Array, pixel: Array) -> tuple[Array, Array, Array]:
    """Take the pixels of subsplats for a picture of one row (AMS Sec. 3.4; E-AMS-11).

    pixel (n,): Pixel of each subsplat.
    -> position (xyz, row, subsplat): Surface point, m.
    -> normal (xyz, row, subsplat): Its unit normal.
    -> triangle_id (row, subsplat) int32: Triangle that it lies on.
    """
    return (taken(position, pixel)[:, None], taken(normal, pixel)[:, None],
            np.ascontiguousarray(triangle_id.reshape(-1)[None, pixel]))


@stage("multires.of_row", kept=False)
def of_row(irradiance: Array) -> Array:
    """Return the light of a picture of one row to the list of subsplats (AMS Sec. 3.4).

    irradiance (3, 1, n): Irradiance of the row, W/m^2.
    -> (rgb, subsplat): Indirect irradiance, W/m^2.
    """
    return np.ascontiguousarray(irradiance[:, 0])


def shadowed_steps(
    frame: "Frame", buffer: "GBuffer", subsplats: Subsplats, lights: "PixelLights", settings: "ValSettings",
    footprint: Array | None = None,
) -> Array:
    """Return the light at subsplats under soft shadows, made by steps."""
    for extent in ("visible_extent", "illuminated_extent"):
        vars(frame).pop(extent, None)  # found anew, as steps of their own
    areas, maps = cluster_lights(frame, lights, settings)
    reference = reference_visibility(frame, lights, areas, maps, settings)
    position, normal, ids = one_row(buffer.position, buffer.normal, buffer.triangle_id, subsplats.pixel)
    facing = facing_normals(frame.scene.geometry, ids, normal)
    row = Receivers(position, normal, np.ones(ids.shape, np.bool_))
    return of_row(clustered_irradiance(row, facing, lights, areas, maps, settings, footprint, reference,
                                       rays=frame.tracer if settings.maps.behind == "raytrace" else None))

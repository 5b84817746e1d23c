"""Light at the subsplats with visibility: the pairs of `vpl` at the pixels that stand for subsplats, a shadow ray each.

No paper on splatting knows what blocks indirect light. With rays at subsplats alone the picture converges to `vpl` as
they become fine, and to the truth as lights become many, at the subsplats' share of the rays.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.pairs.shadow_rays import receivers, shadowed_sum
from refgi.pairs.tiles import taken
from refgi.scene import Geometry
from refgi.splat.refinement.grid import Subsplats
from refgi.stages import stage

if TYPE_CHECKING:
    from refgi.lights import PixelLights
    from refgi.rays import Tracer
    from refgi.rsm import GBuffer

Array = npt.NDArray[Any]


@stage("splat.visible")
def evaluate_visible(
    tracer: "Tracer", geometry: Geometry, buffer: "GBuffer", subsplats: Subsplats, lights: "PixelLights"
) -> Array:
    """Sum the irradiance that reaches each subsplat's pixel from every pixel light.

    Parameters
    ----------
    tracer : Tracer
        The scene's rays.
    geometry : Geometry
        The triangles that the buffer shows.
    buffer : GBuffer
        What the camera sees.
    subsplats : Subsplats
        The subsplats.
    lights : PixelLights
        Lights to sum.

    Returns
    -------
    (3, n) ndarray
        Irradiance, W/m^2, linear RGB, in the buffer's dtype: that of `vpl` for the same lights, to the bit.
        Excludes the receiver's albedo/pi.

    Notes
    -----
    Pairs are calibrated and not clamped, summed in float64: the code of `vpl`. Settings that change a pair (clamps,
    offsets, lobes' norms and widening, published forms) and means over a cell, which lie on no triangle, have no
    counterpart here.
    """
    position, normal, triangle_id = buffer.resolve("position", "normal", "triangle_id")
    seen = triangle_id.reshape(-1)[subsplats.pixel]
    to = receivers(geometry, taken(position, subsplats.pixel), taken(normal, subsplats.pixel), seen, tracer.grain)
    return shadowed_sum(tracer, to, lights).astype(np.asarray(position).dtype)

"""Lobes of glossy receivers by gathering: each glossy pixel sums f_s times the light of the texels in its disc."""

from typing import TYPE_CHECKING, Any

import numpy as np

from refgi.jit import kernel, prange
from refgi.pairs.pair_sum import geometry_term
from refgi.radiometry import lobe_gap, lobe_power, receiver_norm
from refgi.rsm.buffers.leaving import GlossyPoints, spread_over_picture
from refgi.splat.gather.gather import DiscSettings, GatherSettings, disc_texels
from refgi.splat.gather.gather_sum import GatherMap, centers, sample_texel
from refgi.stages import stage, tally
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.frame import Frame
    from refgi.rsm import Rsm


def gather_lobes(frame: "Frame", settings: GatherSettings) -> Array:
    """Return the radiance towards the eye that receivers' lobes make of the texels in their discs.

    (3, h, w), W/m^2/sr, linear RGB, without visibility; 0 where there is no lobe. Every glossy pixel runs the sum, and
    none is interpolated.
    """
    points = frame.glossy_points
    return spread_over_picture(points, gather_glossy(points, frame.rsms, settings.disc), (frame.height, frame.width))


@stage("gather.glossy")
def gather_glossy(points: GlossyPoints, rsms: "tuple[Rsm, ...]", disc: DiscSettings) -> Array:
    """Sum the radiance that lobes make of the texels in each receiver's disc.

    rsms: Reflective shadow maps, one a light; of glossy materials only the diffuse part is gathered.
    -> (3, n): W/m^2/sr, linear RGB: the terms of `gather_irradiance`, each times f_s.
    """
    total = np.zeros_like(points.position)
    for rsm in rsms:
        tally("pairs", lambda: len(points.pixel) * disc.samples)
        source, pattern, scale = disc_texels(rsm, disc, points.position.dtype)
        _gather(points, centers(rsm.projection, points.position), source, pattern, scale, total)
    radiance: Array = total * points.specular
    return radiance


@kernel(parallel=True)
def _gather(
    points: GlossyPoints, center: Array, source: GatherMap, pattern: Array, scale: Any, radiance: Array
) -> None:
    """Add scale norm sum weight Phi g <m . w>^P, radiance over reflectance; arguments as for `gather_discs`."""
    real = points.position.dtype.type
    height, width = source.flux.shape[1:]
    for i in prange(len(points.pixel)):
        red, green, blue = real(0.0), real(0.0), real(0.0)
        x, y, z = points.position[0, i], points.position[1, i], points.position[2, i]
        nx, ny, nz = points.normal[0, i], points.normal[1, i], points.normal[2, i]
        mx, my, mz = points.mirrored[0, i], points.mirrored[1, i], points.mirrored[2, i]
        norm = receiver_norm(points.exponent[i]) * scale
        for s in range(pattern.shape[0]):
            t, u = sample_texel(center, pattern, i, s)
            if 0 <= t < height and 0 <= u < width:
                p, n = source.position, source.normal
                dx, dy, dz = p[0, t, u] - x, p[1, t, u] - y, p[2, t, u] - z
                # SII Eq. (2), times the lobe
                g = geometry_term(dx, dy, dz, -n[0, t, u], -n[1, t, u], -n[2, t, u], nx, ny, nz)
                if g > 0:
                    g *= real(pattern[s, 2]) * lobe_power(lobe_gap(mx, my, mz, dx, dy, dz), points.exponent[i])
                    red, green, blue = (red + g * source.flux[0, t, u], green + g * source.flux[1, t, u],
                                        blue + g * source.flux[2, t, u])
        radiance[0, i] += red * norm
        radiance[1, i] += green * norm
        radiance[2, i] += blue * norm

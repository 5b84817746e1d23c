"""`gather` as a whole by the literal text: discs of texels around each pixel's own place, map by map, in float64."""

import numpy as np

from refgi.literal import gather as literal
from refgi.literal.lights import halton_points
from refgi.vectors.forms.splat import KINDS
from tests.naive.draws import draw


def gather(frame, settings):
    """Return the irradiance (3, h, w), and how many pixels ran the sum."""
    buffer, coarsely = frame.gbuffer, settings.interpolation
    sums = every_sum(buffer, frame.rsms, settings.disc)
    if coarsely is None:
        return sums, np.count_nonzero(buffer.covered)
    seen = buffer.position[:, buffer.covered]
    visible = seen.min(axis=1), seen.max(axis=1)
    chosen, light = literal.interpolate(buffer.position, buffer.normal, ids_of(buffer), sums, visible, coarsely.grid,
                                        coarsely.least_cosine, coarsely.reach)
    coarse = np.ix_(*(literal.middles(size, coarsely.grid) for size in buffer.covered.shape))
    chosen[coarse] = False  # they run the sum
    return light, np.count_nonzero(buffer.covered & ~chosen)


def ids_of(receivers):
    """Return 0 where there is a surface, -1 where not."""
    return np.where(receivers.covered, 0, -1)


def every_sum(receivers, rsms, disc):
    """Run the sum at every covered pixel, over all maps, (3, h, w)."""
    offset, weight = disc_pattern(disc)
    return sum(disc_sum(rsm, disc, offset, weight, receivers.position, receivers.normal, ids_of(receivers))
               for rsm in rsms)


def disc_pattern(disc):
    """Return offsets and weights of the samples: Halton points from 1 on."""
    shift = [draw(disc.seed, 5, c) if disc.seed else 0.0 for c in (0, 1)]
    points = halton_points([disc.samples + 1], np.array([shift]), 0)[1:]
    return literal.pattern(points, "rsm_weight_squared" in disc.as_published)


def disc_sum(rsm, disc, offset, weight, position, normal, ids):
    """Return the light of one map."""
    texel, texels = disc_texels(rsm, disc, offset, position, ids), rsm.projection.height * rsm.projection.width
    return literal.disc_sum(position, normal, ids, texel, weight, rsm.position, rsm.normal, rsm.flux, disc.radius,
                            texels, disc.offset)


def disc_texels(rsm, disc, offset, position, ids):
    """Return the texels (S, h, w) of the discs of receivers on one map."""
    maps = rsm.projection
    center, _ = literal.centers(position, ids, maps.origin, maps.frame, maps.half, maps.height, maps.width,
                                KINDS[maps.kind])
    return literal.disc_texels(center, offset, ids, disc.radius, maps.maps, maps.height, maps.width)

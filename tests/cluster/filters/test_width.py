"""How wide the filters of a penumbra are: second moments of what they read, in closed form (VAL-16)."""

import numpy as np
import pytest

from refgi.cluster.filters.prefilter import build_filters
from refgi.cluster.settings import Csm
from tests.cluster.filters import reads

SIDE, CENTRES = 256, 4000
# of R^2 / 4: texels are points of the parabola, 1 / w^2 of a level's w, and 4000 places within a texel (0.9 % at most)
TEXELS = 0.03
BETWEEN = 1.27  # most of (1 + 3 f) / 4^f: a level's variance grows by 4, between two levels by a straight line


def spread(prefilter, diameter):
    """Return the variance of a filter along the rows over R^2 / 4, that of a disc of its diameter (texels).

    What it reads of a parabola, less the parabola at its middle, in the mean over where its middle lies in a texel.
    """
    x = np.arange(SIDE) + 0.5
    depth = np.broadcast_to((x - SIDE / 2) ** 2, (SIDE, SIDE)).copy()
    scale = reads.linear(reads.MOST / depth.max())
    filters = build_filters(depth, scale, Csm(terms=1, prefilter=prefilter), box=False)
    middle = np.random.default_rng(1).uniform(-32, 32, (2, CENTRES))
    discs = (*(2 * middle / SIDE), np.full(CENTRES, diameter / SIDE))
    moment = reads.means(filters, discs, 1)[4] * depth.max() / reads.MOST - middle[0] ** 2
    return moment.mean() / (diameter / 4) ** 2


@pytest.mark.feature("VAL-16")
def test_a_read_of_the_mip_map_is_as_wide_as_the_disc(evidence):
    """Texels of side w read between their centres: w^2 / 12 + w^2 / 6 = w^2 / 4, which is the disc's at w = R.

    One level off would make it 4 or 1/4 of that.
    """
    exact = {diameter: spread("mip", diameter) for diameter in (16.0, 32.0, 64.0)}
    between = {diameter: spread("mip", diameter) for diameter in (20.0, 22.6, 28.0, 45.0)}
    disc = spread("brute", 32.0)
    evidence("variance over the disc's: " + ", ".join(f"{v:.3f} at {d:g} texels" for d, v in (exact | between).items())
             + f"; of the disc read texel by texel {disc:.3f}")
    assert list(exact.values()) == pytest.approx([1] * 3, rel=TEXELS)
    assert disc == pytest.approx(1, rel=TEXELS)
    for diameter, found in between.items():
        f = np.log2(diameter) % 1
        assert found == pytest.approx((1 + 3 * f) / 4**f, rel=TEXELS)
        assert 1 < found < BETWEEN

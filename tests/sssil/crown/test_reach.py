"""How far samples reach, by the figures of the paper's own settings."""

import math
import warnings

import pytest

from refgi.errors import RefgiWarning
from refgi.settings import of
from refgi.sssil.pattern import chosen_radius, covering_radius, reach, warn_short_reach
from refgi.sssil.settings import HssilSettings

# first level, levels, radius -> reach and diagonal, texels: Fig. 6 at 1280 x 720 and Fig. 5 at 720 x 720
PAPER = [((180, 320), 4, 20.0, 320, 367), ((360, 640), 4, 20.0, 320, 734), ((360, 640), 5, 20.0, 640, 734),
         ((720, 720), 4, 40.0, 640, 1018)]


@pytest.mark.feature("HSS-07")
@pytest.mark.parametrize(("shape", "levels", "radius", "far", "diagonal"), PAPER)
def test_the_papers_settings_do_not_cover_the_screen(shape, levels, radius, far, diagonal, evidence):
    """Analytic: r 2^K against the diagonal; the warning names both and the radius that would do."""
    settings = of(HssilSettings, radius=radius, levels=levels)
    assert reach(settings.sampling, chosen_radius(shape, settings.sampling)) == far
    assert int(math.hypot(*shape)) == diagonal
    with pytest.warns(RefgiWarning, match=rf"{far}.*{diagonal}.*{math.ceil(diagonal / 2**levels)} texels"):
        warn_short_reach(shape, settings.sampling)
    evidence(f"{shape[1]} x {shape[0]}, r = {radius:g}, K = {levels}: reaches {far} of {diagonal} texels")


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (90, 160), (361, 641)])
def test_the_chosen_radius_covers_the_screen(shape):
    """Property: without a radius nothing is warned of, and one texel less would not do."""
    settings = of(HssilSettings, radius=None, levels=3)
    radius = chosen_radius(shape, settings.sampling)
    assert reach(settings.sampling, radius) >= math.hypot(*shape) * (1 - 1e-12)
    assert radius == max(1.0, math.hypot(*shape) / 8) == covering_radius(shape, 3)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_short_reach(shape, settings.sampling)
